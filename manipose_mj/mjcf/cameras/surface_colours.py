"""The colour of a point on a geom: rgba, material and texture, without GL."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from manipose_mj.mjcf.cameras.ray_casting import geom_colours

_SAMPLES_PER_MESH = 60_000
_Lookup = Callable[[np.ndarray], np.ndarray]  # points in the geom's frame -> (n, 3) factors


class SurfaceColours:
    """Colours of hit points, with textures read once and kept.

    A ray reports no texture coordinates. A plane's follow from the point; a textured mesh is
    sampled densely once and a hit takes the colour of the nearest sample; anything else (cube maps
    on primitives) gets its texture's mean colour.

    Attributes:
      textured: `(ngeom,)` bool, the geoms that have a texture.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self.textured = _texture_of_geom(model) >= 0
        self._lookups: dict[tuple[float, ...], _Lookup | None] = {}

    def at(
        self,
        data: mujoco.MjData,
        points: Float[np.ndarray, "n 3"],
        geom_id: Int[np.ndarray, "n"],
    ) -> Float[np.ndarray, "n 3"]:
        """The diffuse colour, linear light, in 0..1.

        Args:
          data: Where the geoms are.
          points: World frame, on the geoms' surfaces.
          geom_id: The geom of each point, not -1.
        """
        colours = self.plain()[geom_id]
        for geom in np.unique(geom_id[self.textured[geom_id]]):
            lookup = self._lookup(int(geom))
            if lookup is None:
                continue
            rows = geom_id == geom
            local = (points[rows] - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
            colours[rows] *= lookup(local)
        return colours

    def plain(self) -> Float[np.ndarray, "ngeom 3"]:
        """The diffuse colours of all geoms but for their textures, linear light, in 0..1."""
        return to_linear(geom_colours(self._model)[:, :3])

    def _lookup(self, geom: int) -> _Lookup | None:
        model = self._model
        key = (
            int(model.geom_matid[geom]),
            int(model.geom_dataid[geom]),
            int(model.geom_type[geom]),
            *model.geom_size[geom, :2].tolist(),  # a texture is stretched over a plane
        )
        if key not in self._lookups:
            self._lookups[key] = _make_lookup(model, geom)
        return self._lookups[key]


def to_linear(srgb: np.ndarray) -> np.ndarray:
    """Linear light of display values in 0..1; gamma 2.2 stands for the sRGB curve."""
    return np.power(np.clip(srgb, 0.0, 1.0).astype(np.float32), np.float32(2.2))


def to_display(linear: np.ndarray) -> np.ndarray:
    """The inverse of `to_linear`."""
    return np.power(np.clip(linear, 0.0, 1.0), np.float32(1 / 2.2))


def _texture_of_geom(model: mujoco.MjModel) -> np.ndarray:
    """`(ngeom,)` texture id of each geom's material, -1 without."""
    if not model.nmat:
        return np.full(model.ngeom, -1)
    textures = model.mat_texid[:, mujoco.mjtTextureRole.mjTEXROLE_RGB]
    return np.where(model.geom_matid >= 0, textures[model.geom_matid], -1)


def _make_lookup(model: mujoco.MjModel, geom: int) -> _Lookup | None:
    texture = int(_texture_of_geom(model)[geom])
    image = _texture_image(model, texture)
    if image is None:
        return None
    mesh = int(model.geom_dataid[geom])
    flat = model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D
    if flat and model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
        return _plane_lookup(model, geom, image)
    is_mesh = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH
    if flat and is_mesh and model.mesh_texcoordadr[mesh] >= 0:
        return _mesh_lookup(model, geom, image)
    mean = image.reshape(-1, 3).mean(axis=0)
    return lambda local: np.broadcast_to(mean, local.shape)


def _texture_image(model: mujoco.MjModel, texture: int) -> np.ndarray | None:
    """`(height, width, 3)` linear colours, or None for a texture that is not one of colours."""
    height, width = int(model.tex_height[texture]), int(model.tex_width[texture])
    channels, start = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
    if channels not in (3, 4):
        return None
    texels = model.tex_data[start : start + height * width * channels]
    return to_linear(texels.reshape(height, width, channels)[..., :3] / np.float32(255))


def _plane_lookup(model: mujoco.MjModel, geom: int, image: np.ndarray) -> _Lookup:
    material = int(model.geom_matid[geom])
    repeat = model.mat_texrepeat[material].astype(float)
    size = model.geom_size[geom, :2]
    # As GL shows it: a repeat spans two metres, or, stretched over a finite plane, its length.
    stretched = (size > 0) & (not model.mat_texuniform[material])
    scale = repeat / np.where(stretched, 2 * size, 2.0) * np.array([1.0, -1.0])
    offset = np.where(stretched, repeat, 1.0) / 2
    mean = image.reshape(-1, 3).mean(axis=0)

    def lookup(local: np.ndarray) -> np.ndarray:
        # Far repeats are finer than a pixel; the mean keeps them from flickering.
        far = np.clip(np.linalg.norm(local[:, :2], axis=1) / 8.0 - 0.25, 0.0, 1.0)[:, None]
        return (1 - far) * _texels(image, local[:, :2] * scale + offset) + far * mean

    return lookup


def _mesh_lookup(model: mujoco.MjModel, geom: int, image: np.ndarray) -> _Lookup:
    mesh, repeat = int(model.geom_dataid[geom]), model.mat_texrepeat[model.geom_matid[geom]]
    faces = _rows(model.mesh_face, model.mesh_faceadr, model.mesh_facenum, mesh)
    uv_faces = _rows(model.mesh_facetexcoord, model.mesh_faceadr, model.mesh_facenum, mesh)
    vertices = _rows(model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum, mesh)
    uv = _rows(model.mesh_texcoord, model.mesh_texcoordadr, model.mesh_texcoordnum, mesh)
    corners = vertices[faces].astype(float)
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    rng = np.random.default_rng(0)
    chosen = np.searchsorted(np.cumsum(area) / area.sum(), rng.random(_SAMPLES_PER_MESH))
    chosen = np.minimum(chosen, len(faces) - 1)
    # Uniform barycentric coordinates (Osada et al. 2002, equation 1).
    root, other = np.sqrt(rng.random(_SAMPLES_PER_MESH)), rng.random(_SAMPLES_PER_MESH)
    weights = np.stack([1 - root, root * (1 - other), root * other], axis=-1)[..., None]
    tree = cKDTree((corners[chosen] * weights).sum(axis=1))
    colours = _texels(image, (uv[uv_faces[chosen]] * weights).sum(axis=1) * repeat)
    return lambda local: colours[tree.query(local)[1]]


def _rows(values: np.ndarray, starts: np.ndarray, counts: np.ndarray, index: int) -> np.ndarray:
    return values[starts[index] : starts[index] + counts[index]]


def _texels(image: np.ndarray, uv: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 3"]:
    height, width = image.shape[:2]
    wrapped = uv - np.floor(uv)
    column = np.minimum((wrapped[:, 0] * width).astype(int), width - 1)
    row = np.minimum((wrapped[:, 1] * height).astype(int), height - 1)
    return image[row, column]
