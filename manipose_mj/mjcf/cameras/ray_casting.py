"""Many rays from one point against a model's visible geoms, without GL.

`mujoco.mj_multiRay` alone is not exact: it skips a body by a sphere around its collision geoms
(centre not rotated with the body) and a geom by the azimuth and elevation of its box's corners
(edges can lie outside them), so near or visual-only geoms lose pixels that `mj_ray` hits. Here its
culling is switched off and replaced by one that cannot lose a hit: rays are sorted into bundles,
and a bundle is shown the geoms whose oriented boxes reach into its pyramid. That is also faster: for
every ray MuJoCo goes through all geoms, of which scenes have hundreds; here through those of a bundle.
Meshes that fill a picture come last and one by one, each for the rays that meet its box before anything else.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int

VISIBLE_GROUPS = (0, 1, 2)  # what sensors see; group 3 holds the collision shapes
PICTURE_GROUPS = (0, 1, 2, 4)  # group 4: markers that only pictures show
_RAYS_PER_BUNDLE = 256
_SHOWN, _HIDDEN = 0, 5  # geom groups, while rays are cast
_MASK = np.array([1, 0, 0, 0, 0, 0], np.uint8)  # of the groups that rays can meet
# A mesh that may be met by so many rays is cast by itself; from 300 on, clutter's clouds took a quarter longer.
_ALONE_FROM = 2000
_ROOM = 1e-6  # about a mesh's box, for the last bits [m]
_FAR = 1e6  # half length that stands for an endless plane [m]
# As plain integers: comparing an array with MuJoCo's own enumeration is a thousand times slower.
_PLANE, _SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"))
    for kind in ("PLANE", "SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX")
)
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_IS_PRIMITIVE = np.isin(
    np.arange(int(mujoco.mjtGeom.mjGEOM_TRIANGLE) + 1),
    (_PLANE, _SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX),
)


@dataclass(frozen=True)
class RayBundles:
    """Rays `(x, y, 1)` from the origin of a frame that looks along its z, sorted by direction.

    Attributes:
      directions: `(n, 3)`, sorted so that a bundle's rays are neighbours; z is 1.
      order: `(n,)`, `directions = given[order]`.
      starts: `(k + 1,)`, bundle `i` is `directions[starts[i]:starts[i + 1]]`.
      planes: `(k, 4, 3)`, inward normals of each bundle's pyramid.
    """

    directions: Float[np.ndarray, "n 3"]
    order: Int[np.ndarray, "n"]
    starts: Int[np.ndarray, "k1"]
    planes: Float[np.ndarray, "k 4 3"]


@dataclass(frozen=True)
class RayHits:
    """What rays met, in the order in which the rays were given.

    Attributes:
      scale: `(n,)`, hit point = origin + scale * direction; -1 where nothing was hit.
      geom_id: `(n,)`, -1 where nothing was hit.
      normal: `(n, 3)`, world frame, unit, towards the ray's origin; zero where nothing was hit.
    """

    scale: Float[np.ndarray, "n"]
    geom_id: Int[np.ndarray, "n"]
    normal: Float[np.ndarray, "n 3"]

    def within(self, scale: float) -> RayHits:
        """These hits, those beyond `scale` counted as nothing."""
        beyond = self.scale > scale
        if not beyond.any():
            return self
        return RayHits(
            np.where(beyond, -1.0, self.scale),
            np.where(beyond, np.int32(-1), self.geom_id),
            np.where(beyond[:, None], 0.0, self.normal),
        )


def bundle_rays(xy: Float[np.ndarray, "n 2"]) -> RayBundles:
    """Sort rays `(x, y, 1)` into bundles of similar direction.

    Args:
      xy: Slopes of the rays in their frame.
    """
    count = len(xy)
    if count == 0:
        return RayBundles(
            np.empty((0, 3)), np.empty(0, np.int64), np.zeros(1, np.int64), np.empty((0, 4, 3))
        )
    # Strips of equal count along x, each cut into cells of equal count along y: small cells where
    # rays are dense, which a regular grid does not give for light falling on a wide floor.
    side = max(1, round(float(np.sqrt(count / _RAYS_PER_BUNDLE))))
    strip = np.empty(count, np.int64)
    strip[np.argsort(xy[:, 0], kind="stable")] = np.arange(count) * side // count
    order = np.lexsort((xy[:, 1], strip))
    cells = min(side * side, count)
    starts = -(-np.arange(cells) * count // cells)
    sorted_xy = xy[order]
    x0, y0 = np.minimum.reduceat(sorted_xy, starts).T
    x1, y1 = np.maximum.reduceat(sorted_xy, starts).T
    one, zero = np.ones_like(x0), np.zeros_like(x0)
    planes = np.stack(
        [
            np.stack([one, zero, -x0], axis=-1),
            np.stack([-one, zero, x1], axis=-1),
            np.stack([zero, one, -y0], axis=-1),
            np.stack([zero, -one, y1], axis=-1),
        ],
        axis=1,
    )
    directions = np.concatenate([sorted_xy, np.ones((count, 1))], axis=1)
    return RayBundles(directions, order, np.r_[starts, count], planes)


def cast_rays(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    T_world_rays: Float[np.ndarray, "4 4"],
    bundles: RayBundles,
    *,
    shown: np.ndarray | None = None,
) -> RayHits:
    """Cast every ray; equal to `mj_ray` of each (a test holds that).

    While it runs, the model's geom groups, and the bodies' lists of geoms and bounding volumes, hold
    other values: another thread must not step or render the same model meanwhile.

    Args:
      model: The compiled model.
      data: Positions of its geoms: `mj_forward` or `mj_kinematics` has run.
      T_world_rays: The frame of the rays.
      bundles: From `bundle_rays`.
      shown: `(ngeom,)` bool, the geoms that rays can meet; `visible_geoms(model)` if not given.
    """
    shown = visible_geoms(model) if shown is None else shown
    rotation, origin = T_world_rays[:3, :3], np.ascontiguousarray(T_world_rays[:3, 3])
    count = len(bundles.directions)
    vectors = rotated(bundles.directions, rotation)
    found = RayHits(np.full(count, -1.0), np.full(count, -1, np.int32), np.zeros((count, 3)))
    reached = _reached(model, data, origin, bundles.planes @ rotation.T, np.flatnonzero(shown))
    flat, normal = vectors.reshape(-1), found.normal.reshape(-1)
    sizes = np.diff(bundles.starts)
    filling = (model.geom_type == _MESH) & (sizes @ reached >= _ALONE_FROM)
    alone = np.flatnonzero(filling).tolist()
    entries = [
        _entries(model, data, g, origin, vectors, np.repeat(reached[:, g], sizes)) for g in alone
    ]
    reached[:, alone] = False
    groups = np.where(reached, _SHOWN, _HIDDEN).astype(np.int32)
    bodies = np.flatnonzero(model.body_geomnum)
    first, number = _runs(reached, model.body_geomadr[bodies])
    busy = reached.any(axis=1)
    with _own_culling(model):
        for i in np.flatnonzero(busy).tolist():
            model.geom_group[:] = groups[i]
            model.body_geomadr[bodies] = first[i]
            model.body_geomnum[bodies] = number[i]
            a, b = int(bundles.starts[i]), int(bundles.starts[i + 1])
            rows = slice(3 * a, 3 * b)
            _cast(
                model, data, origin, flat[rows], found.scale[a:b], found.geom_id[a:b], normal[rows]
            )
        model.geom_group[:] = _HIDDEN
        model.body_geomnum[bodies] = 0
        # What is nearest hides most of the rest.
        for entry in sorted(entries, key=lambda entry: entry.nearest):
            _cast_alone(model, data, origin, vectors, entry, found)
    # A surface seen from within has its normal turned to whoever looks at it.
    away = np.einsum("ij,ij->i", found.normal, vectors) > 0
    found.normal[away] *= -1.0
    hits = RayHits(
        *(np.empty_like(values) for values in (found.scale, found.geom_id, found.normal))
    )
    hits.scale[bundles.order] = found.scale
    hits.geom_id[bundles.order] = found.geom_id
    hits.normal[bundles.order] = found.normal
    return hits


@dataclass(frozen=True)
class _Entries:
    """Rays that meet a geom's box. Attributes: geom; rays, their indices; scale, where each enters."""

    geom: int
    rays: Int[np.ndarray, "m"]
    scale: Float[np.ndarray, "m"]

    @property
    def nearest(self) -> float:
        """Where the first of them enters."""
        return float(self.scale.min(initial=np.inf))


def _entries(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geom: int,
    origin: Float[np.ndarray, "3"],
    vectors: Float[np.ndarray, "n 3"],
    among: np.ndarray,
) -> _Entries:
    """Which of some rays meet a mesh's box, and where, with room for the last bits."""
    rays = np.flatnonzero(among)
    centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    xmat = data.geom_xmat[geom].reshape(3, 3)
    start = (origin - data.geom_xpos[geom]) @ xmat - centre
    enter, leave = np.zeros(len(rays)), np.full(len(rays), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis in range(3):
            inverse = 1.0 / (vectors[rays] @ xmat[:, axis])
            room = half[axis] + _ROOM
            one, other = (-room - start[axis]) * inverse, (room - start[axis]) * inverse
            # fmax, fmin: a ray within the box's plane says nothing where it starts on it.
            enter = np.fmax(enter, np.fmin(one, other))
            leave = np.fmin(leave, np.fmax(one, other))
    met = enter <= leave
    return _Entries(geom, rays[met], enter[met])


def _cast_alone(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    origin: Float[np.ndarray, "3"],
    vectors: Float[np.ndarray, "n 3"],
    entries: _Entries,
    found: RayHits,
) -> None:
    """Cast on one geom the rays that have met nothing before its box; `found` takes what is nearer."""
    before = found.scale[entries.rays]
    rays = entries.rays[(before < 0) | (entries.scale <= before)]
    if not len(rays):
        return
    geom, body = entries.geom, model.geom_bodyid[entries.geom]
    model.geom_group[geom] = _SHOWN
    model.body_geomadr[body], model.body_geomnum[body] = geom, 1
    scale, geom_id = np.full(len(rays), -1.0), np.full(len(rays), -1, np.int32)
    normal = np.zeros((len(rays), 3))
    _cast(model, data, origin, vectors[rays].reshape(-1), scale, geom_id, normal.reshape(-1))
    model.geom_group[geom] = _HIDDEN
    model.body_geomnum[body] = 0
    before, other = found.scale[rays], found.geom_id[rays]
    # Of two at one place the first in the model's order, as by MuJoCo.
    nearer = (scale >= 0) & ((before < 0) | (scale < before) | ((scale == before) & (geom < other)))
    found.scale[rays[nearer]] = scale[nearer]
    found.geom_id[rays[nearer]] = geom
    found.normal[rays[nearer]] = normal[nearer]


def _cast(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    origin: Float[np.ndarray, "3"],
    vectors: Float[np.ndarray, "n3"],
    scale: Float[np.ndarray, "n"],
    geom_id: Int[np.ndarray, "n"],
    normal: Float[np.ndarray, "n3"],
) -> None:
    """`mj_multiRay` on the geoms of group `_SHOWN`, into the last three."""
    mujoco.mj_multiRay(
        model,
        data,
        origin,
        vectors,
        _MASK,
        True,
        -1,
        geom_id,
        scale,
        normal,
        len(scale),
        mujoco.mjMAXVAL,
    )


def rotated(
    vectors: Float[np.ndarray, "n 3"], rotation: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "n 3"]:
    """`rotation @ v` of each; not through BLAS, whose threads spin on products so thin."""
    return np.einsum("nj,ij->ni", vectors, rotation)


def visible_geoms(model: mujoco.MjModel, groups: tuple[int, ...] = VISIBLE_GROUPS) -> np.ndarray:
    """`(ngeom,)` bool: in one of the groups and not fully transparent."""
    among = np.array([group in groups for group in range(mujoco.mjNGROUP)])
    return among[model.geom_group] & (geom_colours(model)[:, 3] > 0)


def geom_colours(model: mujoco.MjModel) -> Float[np.ndarray, "ngeom 4"]:
    """Each geom's rgba by MuJoCo: its own unless left at the default, else its material's."""
    rgba = model.geom_rgba.copy()
    untouched = (rgba == np.array([0.5, 0.5, 0.5, 1.0], np.float32)).all(axis=1)
    from_material = untouched & (model.geom_matid >= 0)
    rgba[from_material] = model.mat_rgba[model.geom_matid[from_material]]
    return rgba


def geom_boxes(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Centres and half lengths `(ngeom, 3)` [m] of the geoms' boxes in their own frames.

    Primitives' are computed from `geom_size`, which may be edited after compilation;
    `geom_aabb` is not updated then.
    """
    kind, size = model.geom_type, model.geom_size
    centre, half = model.geom_aabb[:, :3].copy(), model.geom_aabb[:, 3:].copy()
    centre[_IS_PRIMITIVE[kind]] = 0.0
    as_is = (kind == _BOX) | (kind == _ELLIPSOID)
    half[as_is] = size[as_is]
    sphere = kind == _SPHERE
    half[sphere] = size[sphere, :1]
    capsule, cylinder = kind == _CAPSULE, kind == _CYLINDER
    half[cylinder] = size[cylinder][:, [0, 0, 1]]
    half[capsule] = size[capsule][:, [0, 0, 1]] + size[capsule, :1] * np.array([0.0, 0.0, 1.0])
    half[kind == _PLANE] = (_FAR, _FAR, 0.0)
    return centre, half


def _reached(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    origin: Float[np.ndarray, "3"],
    planes: Float[np.ndarray, "k 4 3"],
    shown: Int[np.ndarray, "g"],
) -> np.ndarray:
    """`(k, ngeom)` bool: a shown geom whose box is not wholly behind one of the bundle's planes."""
    found = np.zeros((len(planes), model.ngeom), bool)
    if not len(planes):
        return found
    centre, half = (box[shown] for box in geom_boxes(model))
    xmat = data.geom_xmat[shown].reshape(-1, 3, 3)
    centre = data.geom_xpos[shown] + np.einsum("gij,gj->gi", xmat, centre) - origin
    normals = planes.reshape(-1, 3)
    reach = normals @ centre.T
    for axis in range(3):
        reach += np.abs(normals @ (xmat[:, :, axis] * half[:, axis, None]).T)
    # The last bits of a box that ends in a plane must not hide it.
    met = reach >= -1e-9 * (1 + np.abs(reach))
    found[:, shown] = met.reshape(len(planes), 4, -1).all(axis=1)
    return found


def _runs(
    reached: np.ndarray, starts: Int[np.ndarray, "b"]
) -> tuple[Int[np.ndarray, "k b"], Int[np.ndarray, "k b"]]:
    """Of each body's geoms, which begin at `starts`, the first that is reached, and how many to the last."""
    if not len(starts):
        return np.zeros((len(reached), 0), np.int32), np.zeros((len(reached), 0), np.int32)
    index = np.arange(reached.shape[1], dtype=np.int32)
    first = np.minimum.reduceat(np.where(reached, index, len(index)), starts, axis=1)
    last = np.maximum.reduceat(np.where(reached, index, -1), starts, axis=1)
    number = np.maximum(last - first + 1, 0)
    return np.where(number > 0, first, 0), number


@contextmanager
def _own_culling(model: mujoco.MjModel) -> Iterator[None]:
    """What `mj_multiRay` culls by is as before afterwards; meanwhile nothing is culled by volumes or materials."""
    alpha = model.mat_rgba[:, 3]
    changed = (model.geom_group, model.body_geomadr, model.body_geomnum, model.body_bvhadr, alpha)
    kept = [values.copy() for values in changed]
    try:
        model.body_bvhadr[:] = -1  # a body without bounding volumes is not culled
        # A geom of its own colour is seen whatever its material's is; groups say which are.
        alpha[:] = 1.0
        yield
    finally:
        for values, before in zip(changed, kept, strict=True):
            values[:] = before
