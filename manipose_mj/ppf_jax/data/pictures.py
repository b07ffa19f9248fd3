"""Whole images of the views that clouds come from: colours, depth and masks, as a camera would give them.

The window with the object is the one that its cloud was cut out of, noise and all. Around it lies what the object
stands on, or nothing.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float, UInt8
from PIL import Image

from manipose_mj.assets.geometry import Shape
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import invert, transform
from manipose_mj.ppf_jax.data.rasteriser import NOTHING, Raster, Triangles, pixel_rays, rasterise
from manipose_mj.ppf_jax.data.rendering import Subject, View, grounded, measured
from manipose_mj.ppf_jax.data.view_settings import ViewSetting

_OBJECT, _PLANE = 0, 2  # of `Raster.item`
_GREY, _TABLE = (0.45, 0.45, 0.5), (0.75, 0.7, 0.62)
_AMBIENT = 0.35  # share of the light that comes from everywhere; the rest is the camera's own


@dataclass(frozen=True)
class Picture:
    """One whole image.

    Attributes:
      rgb: Colours.
      depth: As the sensor reports it, 0 where nothing was measured [m].
      mask: The object's pixels as a segmentation reports them.
      visible: Its pixels as they are.
      silhouette: Those it would have with nothing in front.
      intrinsics: Of the image.
    """

    rgb: UInt8[np.ndarray, "height width 3"]
    depth: Float[np.ndarray, "height width"]
    mask: Bool[np.ndarray, "height width"]
    visible: Bool[np.ndarray, "height width"]
    silhouette: Bool[np.ndarray, "height width"]
    intrinsics: Intrinsics


def picture(view: View, subject: Subject, setting: ViewSetting, name: str) -> Picture:
    """The whole image of a view.

    Args:
      view: Drawn of the subject.
      subject: With its coloured shapes; without them it is grey.
      setting: That the view was drawn in.
      name: Of the view; the noise around the window follows from it.
    """
    image, window = view.placement.intrinsics, view.intrinsics
    left, top = round(image.cx - window.cx), round(image.cy - window.cy)
    rows, columns = slice(top, top + window.height), slice(left, left + window.width)
    shape = (image.height, image.width)
    empty = Raster(np.zeros(shape), np.full(shape, NOTHING, np.int32), np.zeros((*shape, 3)))
    around = grounded(empty, view.placement, image)
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    depth = measured(around, image, rng, setting.sensor)
    depth[rows, columns] = view.depth
    rgb = _shaded(around, np.zeros((*shape, 3)), image)
    rgb[rows, columns] = _shaded(view.exact, _object_colours(view, subject), window)
    alone = rasterise([(subject.triangles, view.T_camera_mesh)], image)

    def whole(part: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "height width"]:
        mask = np.zeros(shape, bool)
        mask[rows, columns] = part
        return mask

    return Picture(
        rgb=rgb,
        depth=depth.astype(np.float32),
        mask=whole(view.mask),
        visible=whole(view.exact.item == _OBJECT),
        silhouette=alone.item == _OBJECT,
        intrinsics=image,
    )


def label_mesh(subject: Subject) -> trimesh.Trimesh:
    """The surface of a subject in the frame of its label [m], its colours at the vertices."""
    meshes = [shape.surface() for shape in subject.shapes]
    rgb = np.round(255 * shape_colours(subject.shapes)).astype(np.uint8)
    sizes = [len(mesh.vertices) for mesh in meshes]
    starts = np.cumsum([0, *sizes[:-1]])
    vertices = np.concatenate([np.asarray(mesh.vertices, float) for mesh in meshes])
    faces = np.concatenate([mesh.faces + first for mesh, first in zip(meshes, starts, strict=True)])
    return trimesh.Trimesh(
        transform(invert(subject.label.pose), vertices),
        faces,
        vertex_colors=np.repeat(rgb, sizes, axis=0),
        process=False,
    )


def shape_colours(shapes: Sequence[Shape]) -> Float[np.ndarray, "shapes 3"]:
    """The colour of each shape in 0 to 1; of a textured one the texture's mean."""
    return np.array([_mean_colour(shape) for shape in shapes], float).reshape(-1, 3)


def _mean_colour(shape: Shape) -> np.ndarray:
    colour = np.array(shape.rgba[:3], float)
    if shape.texture is None:
        return colour
    with Image.open(shape.texture) as texture:
        return colour * np.asarray(texture.convert("RGB"), float).reshape(-1, 3).mean(axis=0) / 255


def _object_colours(view: View, subject: Subject) -> Float[np.ndarray, "height width 3"]:
    """Where the window shows the object, its colours."""
    colours = np.full((*view.depth.shape, 3), _GREY)
    if subject.shapes:
        items = [
            (Triangles.of_mesh(shape.surface()), view.T_camera_mesh) for shape in subject.shapes
        ]
        item = rasterise(items, view.intrinsics).item
        own = shape_colours(subject.shapes)
        colours = np.where((item >= 0)[..., None], own[np.maximum(item, 0)], colours)
    return colours


def _shaded(
    drawn: Raster, colours: Float[np.ndarray, "height width 3"], window: Intrinsics
) -> UInt8[np.ndarray, "height width 3"]:
    """The image with a light at the camera; `colours` are the object's."""
    rays = pixel_rays(window)
    cosine = -np.einsum("hwi,hwi->hw", drawn.normal, rays) / np.linalg.norm(rays, axis=-1)
    plain = np.where((drawn.item == _PLANE)[..., None], _TABLE, np.array(_GREY))
    plain = np.where((drawn.item == _OBJECT)[..., None], colours, plain)
    light = np.where(drawn.item == NOTHING, 0.0, _AMBIENT + (1 - _AMBIENT) * np.clip(cosine, 0, 1))
    return np.round(255 * plain * light[..., None]).astype(np.uint8)
