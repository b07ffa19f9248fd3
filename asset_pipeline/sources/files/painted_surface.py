"""The pieces of a mesh file as one surface: with one colour, one image as it is, or one into which several are packed."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from jaxtyping import Float, Int
from PIL import Image
from trimesh.parent import Geometry
from trimesh.visual import ColorVisuals, TextureVisuals
from trimesh.visual.material import PBRMaterial

from asset_pipeline.sources.files.images import as_rgb

log = logging.getLogger(__name__)

GREY = (0.7, 0.7, 0.7, 1.0)
LEAST_OPACITY = 0.15
PACKED_PIXELS = 1024  # of a packed image's sides
# Of the packed image, the height of the plain colours beside images: they stay in small pictures, too.
PLAIN_SHARE = 0.125
MARGIN = 4  # pixels around each of several images that repeat its edge
MOST_REPEATS = 8  # of an image across a face, in a packed image
# Of a material library: a diffuse colour beside an image tints it only if it is no grey, which exporters write by habit.
LEAST_TINT = 0.1

Colour = tuple[float, float, float, float]
Box = tuple[int, int, int, int]  # of an image, in pixels: left, top, right, bottom


@dataclass(frozen=True)
class Paint:
    """Attributes: rgba, the colour, or what tints the image; image, or None."""

    rgba: Colour
    image: Image.Image | None = None

    @cached_property
    def key(self) -> tuple[Colour, bytes]:
        """The same for paints that look the same."""
        if self.image is None:
            return self.rgba, b""
        data = f"{self.image.mode}{self.image.size}".encode() + self.image.tobytes()
        return self.rgba, hashlib.sha256(data).digest()

    def tinted(self) -> Image.Image:
        """The image, with its tint."""
        assert self.image is not None
        image = as_rgb(self.image)
        if self.rgba[:3] == (1.0, 1.0, 1.0):
            return image
        return Image.fromarray(np.uint8(np.asarray(image) * np.array(self.rgba[:3]) + 0.5))


@dataclass(frozen=True)
class _Piece:
    """Attributes: vertices; faces; uv, or None; paint."""

    vertices: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]
    uv: Float[np.ndarray, "n 2"] | None
    paint: Paint


def painted_surface(
    loaded: Geometry,
    is_placeholder: Callable[[Image.Image], bool],
    beside: Callable[[], Image.Image | None],
    where: str,
) -> tuple[trimesh.Trimesh, Image.Image | None, Colour]:
    """One surface, with `uv` where there is an image; the image, or None; the colour of a surface without one.

    Args:
      loaded: What trimesh read.
      is_placeholder: Whether an image is one that trimesh gives where there is none.
      beside: The image for surfaces whose materials name none.
      where: Opens the warnings.
    """
    pieces = list(_pieces(loaded, is_placeholder))
    if all(piece.paint.image is None for piece in pieces) and any(
        piece.uv is not None for piece in pieces
    ):
        image = beside()
        if image is not None:
            white = Paint((1.0, 1.0, 1.0, 1.0), image)
            pieces = [
                piece if piece.uv is None else _Piece(piece.vertices, piece.faces, piece.uv, white)
                for piece in pieces
            ]
    paints = list({piece.paint.key: piece.paint for piece in pieces}.values())
    if len(paints) == 1:
        (paint,) = paints
        if paint.image is None:
            return _joined(pieces), None, paint.rgba
        return _with_uv(pieces), paint.tinted(), paint.rgba
    return *_packed(pieces, paints, where), GREY


def _pieces(loaded: Geometry, is_placeholder: Callable[[Image.Image], bool]) -> Iterator[_Piece]:
    """Each mesh where its scene has it."""
    placed: list[tuple[Geometry, np.ndarray]] = [(loaded, np.eye(4))]
    if isinstance(loaded, trimesh.Scene):
        nodes = (loaded.graph[name] for name in loaded.graph.nodes_geometry)
        placed = [(loaded.geometry[name], transform) for transform, name in nodes]
    for mesh, transform in placed:
        if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
            continue
        bare = trimesh.Trimesh(np.array(mesh.vertices), np.array(mesh.faces), process=False)
        bare.apply_transform(transform)
        uv = getattr(mesh.visual, "uv", None)
        uv = None if uv is None else np.nan_to_num(np.asarray(uv, float)[:, :2])
        paint = _paint(mesh, uv is not None, is_placeholder)
        yield _Piece(np.asarray(bare.vertices), np.asarray(bare.faces), uv, paint)


def _paint(
    mesh: trimesh.Trimesh, has_uv: bool, is_placeholder: Callable[[Image.Image], bool]
) -> Paint:
    material = getattr(mesh.visual, "material", None)
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if not has_uv or not isinstance(image, Image.Image) or is_placeholder(image):
        return Paint(_colour(mesh))
    r, g, b, _ = _colour(mesh)
    if not isinstance(material, PBRMaterial) and max(r, g, b) - min(r, g, b) < LEAST_TINT:
        r, g, b = 1.0, 1.0, 1.0
    return Paint((r, g, b, 1.0), image)


def _colour(mesh: trimesh.Trimesh) -> Colour:
    """The material's or the vertices' main colour; grey where the file states none. Never invisible."""
    visual = mesh.visual
    source = getattr(visual, "material", visual)
    if source is visual and getattr(visual, "kind", None) not in ("vertex", "face"):
        return GREY
    if not isinstance(source, PBRMaterial):
        r, g, b, a = (np.asarray(getattr(source, "main_color"), float) / 255).tolist()  # noqa: B009
        return r, g, b, max(a, LEAST_OPACITY)
    # glTF: a factor that is not there is white, and vertices' colours multiply it.
    factor = np.ones(4) if source.baseColorFactor is None else np.array(source.main_color) / 255
    of_vertices = getattr(visual, "vertex_attributes", {}).get("color")
    if of_vertices is not None and getattr(source, "baseColorTexture", None) is None:
        factor = factor * _main(mesh, np.asarray(of_vertices))
    r, g, b, a = factor.tolist()
    # What is not said to blend is opaque, whatever its alpha.
    return r, g, b, max(a, LEAST_OPACITY) if source.alphaMode in ("BLEND", "MASK") else 1.0


def _main(mesh: trimesh.Trimesh, colours: np.ndarray) -> Float[np.ndarray, "4"]:
    """The commonest colour of vertices."""
    most = np.iinfo(colours.dtype).max if colours.dtype.kind == "u" else 1.0
    whole = np.ones((len(colours), 4))
    whole[:, : colours.shape[1]] = colours / most
    levels = np.uint8(np.clip(whole, 0, 1) * 255 + 0.5)
    return np.asarray(ColorVisuals(mesh, vertex_colors=levels).main_color) / 255


def _joined(pieces: list[_Piece]) -> trimesh.Trimesh:
    counts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    faces = [piece.faces + first for piece, first in zip(pieces, counts[:-1], strict=True)]
    vertices = np.concatenate([piece.vertices for piece in pieces])
    return trimesh.Trimesh(vertices, np.concatenate(faces), process=False)


def _with_uv(pieces: list[_Piece]) -> trimesh.Trimesh:
    """With the coordinates of each piece, which all have some."""
    mesh = _joined(pieces)
    mesh.visual = TextureVisuals(uv=np.concatenate([p.uv for p in pieces if p.uv is not None]))
    return mesh


def _packed(
    pieces: list[_Piece], paints: list[Paint], where: str
) -> tuple[trimesh.Trimesh, Image.Image]:
    """All pieces with coordinates in one image that holds every paint."""
    sheet = Image.new("RGB", (PACKED_PIXELS, PACKED_PIXELS))
    images = [paint for paint in paints if paint.image is not None]
    plain = [paint for paint in paints if paint.image is None]
    plain_from = PACKED_PIXELS if not plain else 0
    if plain and images:
        plain_from = round(PACKED_PIXELS * (1 - PLAIN_SHARE))
    boxes = [*_cells(len(images), 0, plain_from), *_cells(len(plain), plain_from, PACKED_PIXELS)]
    placed = []
    for paint, box in zip((*images, *plain), boxes, strict=True):
        own = [piece for piece in pieces if piece.paint.key == paint.key]
        placed += (
            _in_colour(own, box, sheet)
            if paint.image is None
            else _in_image(own, box, sheet, where)
        )
    return _with_uv(placed), sheet


def _in_colour(own: list[_Piece], box: Box, sheet: Image.Image) -> list[_Piece]:
    """Pieces of a plain colour, which fills a box of the sheet."""
    paint = own[0].paint
    r, g, b, _ = paint.rgba
    sheet.paste((round(255 * r), round(255 * g), round(255 * b)), box)
    middle = _in_sheet(np.array([[0.5, 0.5]]), box)
    return [
        _Piece(p.vertices, p.faces, np.repeat(middle, len(p.vertices), axis=0), paint) for p in own
    ]


def _in_image(own: list[_Piece], box: Box, sheet: Image.Image, where: str) -> list[_Piece]:
    """Pieces with an image, which lies in a box of the sheet as often as it repeats across a face."""
    turned = [(piece, *_within_repeats(piece)) for piece in own]
    reach = max(float(uv.max()) for _, _, _, uv in turned)
    repeats = max(int(np.ceil(reach - 1e-6)), 1)
    if repeats > MOST_REPEATS:
        log.warning(
            "%s: an image repeats %d times across a face; drawn as if %d times",
            where, repeats, MOST_REPEATS,
        )  # fmt: skip
    left, top, right, bottom = box
    margin = min(MARGIN, (right - left) // 4, (bottom - top) // 4)
    inner = (left + margin, top + margin, right - margin, bottom - margin)
    image = _tiled(own[0].paint.tinted(), min(repeats, MOST_REPEATS), inner)
    # Smaller pictures of the sheet mix what is around the image into it.
    around = np.pad(np.asarray(image), ((margin, margin), (margin, margin), (0, 0)), mode="edge")
    sheet.paste(Image.fromarray(around), (left, top))
    return [
        _Piece(p.vertices[rows], faces, _in_sheet(uv / repeats, inner), p.paint)
        for p, rows, faces, uv in turned
    ]


def _cells(count: int, top: int, bottom: int) -> list[Box]:
    """Boxes of about equal size in rows of the sheet, between two heights."""
    if count == 0:
        return []
    ratio = (bottom - top) / PACKED_PIXELS
    rows = max(round(np.sqrt(count * ratio)), 1)
    columns = -(-count // rows)
    x = np.linspace(0, PACKED_PIXELS, columns + 1).astype(int).tolist()
    y = np.linspace(top, bottom, rows + 1).astype(int).tolist()
    every = [(x[i], y[k], x[i + 1], y[k + 1]) for k in range(rows) for i in range(columns)]
    return every[:count]


def _within_repeats(
    piece: _Piece,
) -> tuple[Int[np.ndarray, " k"], Int[np.ndarray, "m 3"], Float[np.ndarray, "k 2"]]:
    """The piece's vertices, faces and coordinates, each face in the lowest repeats of its image.

    Vertices whose faces lie in different repeats are there for each.
    """
    assert piece.uv is not None
    shifts = np.floor(piece.uv[piece.faces].min(axis=1) + 1e-6).astype(int)
    each = np.concatenate([piece.faces.reshape(-1, 1), np.repeat(shifts, 3, axis=0)], axis=1)
    kept, index = np.unique(each, axis=0, return_inverse=True)
    uv = np.maximum(piece.uv[kept[:, 0]] - kept[:, 1:], 0.0)
    return kept[:, 0], index.reshape(-1, 3), uv


def _tiled(image: Image.Image, repeats: int, box: Box) -> Image.Image:
    """The image side by side with itself, as large as the box."""
    size = box[2] - box[0], box[3] - box[1]
    one = image.resize(
        (max(size[0] // repeats, 1), max(size[1] // repeats, 1)), Image.Resampling.LANCZOS
    )
    return Image.fromarray(np.tile(np.asarray(one), (repeats, repeats, 1))).resize(size)


def _in_sheet(uv: Float[np.ndarray, "n 2"], box: Box) -> Float[np.ndarray, "n 2"]:
    """Coordinates in a box of the sheet as those of the sheet, from below."""
    left, top, right, bottom = box
    u = (left + uv[:, 0] * (right - left)) / PACKED_PIXELS
    v = 1 - (bottom - uv[:, 1] * (bottom - top)) / PACKED_PIXELS
    return np.stack([u, v], axis=1)
