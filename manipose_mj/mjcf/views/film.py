"""Strips and animations of pictures, as bytes that a report can embed; no ffmpeg, no font files."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

from manipose_mj.errors import InputError

_GAP = 6  # pixels between the pictures of a strip
_PAPER, _INK = (255, 255, 255), (40, 40, 40)
Format = Literal["webp", "gif", "png"]
FORMATS: tuple[str, ...] = ("webp", "gif", "png")


def film_strip(
    pictures: Sequence[UInt8[np.ndarray, "height width 3"]],
    captions: Sequence[str],
    *,
    columns: int | None = None,
) -> bytes:
    """Pictures side by side with their captions below, as one PNG.

    Args:
      pictures: One or more, all of one size.
      captions: One for each picture; too long a one is cut to the picture's width.
      columns: Pictures in a row; all in one row if not given.

    Raises:
      InputError: No picture, sizes differ, or the number of captions does.
    """
    height, width = _common_size(pictures)
    if len(captions) != len(pictures):
        raise InputError(
            f"{len(captions)} captions for {len(pictures)} pictures; expected one each"
        )
    columns = min(columns or len(pictures), len(pictures))
    rows = -(-len(pictures) // columns)
    size = max(11, round(height / 16))
    font = ImageFont.load_default(size)
    line = round(1.6 * size)
    strip = Image.new(
        "RGB",
        (columns * (width + _GAP) + _GAP, rows * (height + line + _GAP) + _GAP),
        _PAPER,
    )
    draw = ImageDraw.Draw(strip)
    for index, (picture, caption) in enumerate(zip(pictures, captions, strict=True)):
        row, column = divmod(index, columns)
        x, y = _GAP + column * (width + _GAP), _GAP + row * (height + line + _GAP)
        strip.paste(Image.fromarray(picture), (x, y))
        draw.text((x, y + height + 0.2 * size), _cut(caption, font, width), fill=_INK, font=font)
    return _saved(strip, "PNG", optimize=True)


def encode_animation(
    frames: Sequence[UInt8[np.ndarray, "height width 3"]],
    *,
    fps: float = 10.0,
    format: Format = "webp",
) -> bytes:
    """Frames as a picture that plays by itself, over and over, in any browser.

    Args:
      frames: One or more, all of one size.
      fps: Frames per second.
      format: "webp" is the smallest; "gif" has 256 colours; "png" is lossless.

    Raises:
      InputError: No frame, sizes differ, no such format, or a rate that browsers do not show.
    """
    _common_size(frames)
    if format not in FORMATS:
        raise InputError(f"animation format {format!r}; expected one of {', '.join(FORMATS)}")
    # A frame lasts whole milliseconds, in a GIF hundredths of a second; browsers slow down those of one.
    most = 50.0 if format == "gif" else 1000.0
    if not 0 < fps <= most:
        raise InputError(
            f"{fps:g} frames per second; expected more than 0, in {format} at most {most:g}"
        )
    images = [Image.fromarray(frame) for frame in frames]
    if format == "gif":
        # One palette for all frames keeps still parts from flickering.
        some = frames[:: -(-len(frames) // 5)]
        palette = Image.fromarray(np.concatenate(list(some))).quantize(255)
        images = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    settings = {"webp": {"quality": 80, "method": 3}, "gif": {"optimize": True}, "png": {}}
    return _saved(
        images[0],
        format.upper(),
        save_all=True,
        append_images=images[1:],
        duration=round(1000 / fps),
        loop=0,
        **settings[format],
    )


def encode_png(picture: UInt8[np.ndarray, "height width 3"]) -> bytes:
    """One picture as PNG."""
    return _saved(Image.fromarray(picture), "PNG", optimize=True)


def _common_size(pictures: Sequence[np.ndarray]) -> tuple[int, int]:
    if not len(pictures):
        raise InputError("no picture given; expected at least one")
    sizes = sorted({tuple(picture.shape) for picture in pictures})
    if len(sizes) > 1 or len(sizes[0]) != 3 or sizes[0][2] != 3 or 0 in sizes[0]:
        raise InputError(f"pictures of shapes {sizes}; expected one shape (height, width, 3)")
    return sizes[0][0], sizes[0][1]


def _cut(text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: int) -> str:
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(text + "...") > width:
        text = text[:-1]
    return text + "..."


def _saved(image: Image.Image, kind: str, **settings) -> bytes:
    stream = io.BytesIO()
    image.save(stream, kind, **settings)
    return stream.getvalue()
