"""Many thumbnails with their names on one picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PIL import Image, ImageDraw, ImageFont

COLUMNS = 9
TITLE_HEIGHT, CAPTION_HEIGHT, GAP = 34, 32, 6
INK, FAINT, PAPER = (25, 28, 32), (105, 110, 118), (255, 255, 255)


@dataclass(frozen=True)
class Cell:
    """One picture, the name below it, and a second line about it."""

    picture: Image.Image
    name: str
    note: str


def contact_sheet(title: str, cells: Sequence[Cell]) -> Image.Image:
    """All cells in rows under a title; their pictures are of one size."""
    columns = min(COLUMNS, len(cells))
    rows = -(-len(cells) // columns)
    width, height = cells[0].picture.size
    width, height = width + GAP, height + CAPTION_HEIGHT + GAP
    sheet = Image.new("RGB", (columns * width + GAP, rows * height + TITLE_HEIGHT), PAPER)
    pen = ImageDraw.Draw(sheet)
    pen.text((GAP, 6), title, fill=INK, font=ImageFont.load_default(18))
    name_font, note_font = ImageFont.load_default(12), ImageFont.load_default(10)
    for index, cell in enumerate(cells):
        x = GAP + index % columns * width
        y = TITLE_HEIGHT + index // columns * height
        sheet.paste(cell.picture, (x, y))
        below = y + cell.picture.height
        pen.text((x, below + 1), _fitted(cell.name, name_font, width), fill=INK, font=name_font)
        pen.text((x, below + 16), _fitted(cell.note, note_font, width), fill=FAINT, font=note_font)
    return sheet


def _fitted(text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: int) -> str:
    """The text, cut where it would run into the next cell."""
    if font.getlength(text) <= width - GAP:
        return text
    while text and font.getlength(text + "...") > width - GAP:
        text = text[:-1]
    return text + "..."
