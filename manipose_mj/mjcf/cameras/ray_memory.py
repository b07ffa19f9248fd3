"""What a camera's rays met before, so that only what has moved since is cast anew."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.mjcf.cameras.ray_casting import (
    RayBundles,
    RayHits,
    bundle_rays,
    cast_rays,
    visible_geoms,
)


@dataclass(frozen=True)
class _Kept:
    """The last picture of what stands still.

    Attributes:
      model: Of the scene.
      T_world_rays: The frame of the rays.
      bundles: The rays.
      places: `(ngeom, k)`, where every geom was then, and what it was.
      still: `(ngeom,)`, those that the hits are of.
      hits: What the rays met of them, as if nothing else were there.
    """

    model: mujoco.MjModel
    T_world_rays: Float[np.ndarray, "4 4"]
    bundles: RayBundles
    places: Float[np.ndarray, "ngeom k"]
    still: Bool[np.ndarray, "ngeom"]
    hits: RayHits


class RayMemory:
    """Casts the rays of one camera again and again, with the hits of `cast_rays`, bit for bit.

    A camera that stands somewhere else, sees at another size, or looks into another model casts all its rays anew. Else
    rays are cast at what has moved since the last picture, and where something was that has left its place. A geom that
    moved and stands again counts as still from the second picture on.
    """

    def __init__(self) -> None:
        self._kept: _Kept | None = None

    def cast(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        T_world_rays: Float[np.ndarray, "4 4"],
        bundles: RayBundles,
    ) -> RayHits:
        """What every ray meets of the model's visible geoms; not to be written to.

        Args:
          model: The compiled model; vertices of its meshes must not change.
          data: Positions of its geoms: `mj_forward` or `mj_kinematics` has run.
          T_world_rays: The frame of the rays.
          bundles: From `bundle_rays`; the same object where they are the same rays.
        """
        shown, places = visible_geoms(model), _places(model, data)
        kept = self._kept
        if (
            kept is None
            or kept.model is not model
            or kept.bundles is not bundles
            or not np.array_equal(kept.T_world_rays, T_world_rays)
        ):
            hits = cast_rays(model, data, T_world_rays, bundles, shown=shown)
            self._kept = _Kept(model, T_world_rays.copy(), bundles, places, shown, hits)
            return hits
        stands = shown & (places == kept.places).all(axis=1)
        still = stands & kept.still
        hits = kept.hits
        left = np.append(kept.still & ~still, False)[hits.geom_id]  # nothing, -1, is the last
        if left.any():
            rays = left[bundles.order]
            behind = cast_rays(
                model, data, T_world_rays, bundle_rays(bundles.directions[rays, :2]), shown=still
            )
            hits = _replaced(hits, bundles.order[rays], behind)
        again = stands & ~still
        if again.any():
            hits = _nearer(hits, cast_rays(model, data, T_world_rays, bundles, shown=again))
        self._kept = _Kept(model, kept.T_world_rays, bundles, places, stands, hits)
        moved = shown & ~stands
        if moved.any():
            hits = _nearer(hits, cast_rays(model, data, T_world_rays, bundles, shown=moved))
        return hits


def _places(model: mujoco.MjModel, data: mujoco.MjData) -> Float[np.ndarray, "ngeom k"]:
    """All that a hit depends on, geom by geom: tasks change sizes and meshes as well as places."""
    kinds = np.stack([model.geom_type, model.geom_dataid], axis=1)
    return np.concatenate([data.geom_xpos, data.geom_xmat, model.geom_size, kinds], axis=1)


def _replaced(hits: RayHits, rays: np.ndarray, by: RayHits) -> RayHits:
    """The hits with those of some rays replaced."""
    scale, geom_id, normal = hits.scale.copy(), hits.geom_id.copy(), hits.normal.copy()
    scale[rays], geom_id[rays], normal[rays] = by.scale, by.geom_id, by.normal
    return RayHits(scale, geom_id, normal)


def _nearer(one: RayHits, other: RayHits) -> RayHits:
    """Of two hits of a ray the nearer; of two at one place the first in the model's order, as by MuJoCo."""
    before = (other.scale < one.scale) | (
        (other.scale == one.scale) & (other.geom_id < one.geom_id)
    )
    rays = np.flatnonzero((other.scale >= 0) & ((one.scale < 0) | before))
    return _replaced(one, rays, RayHits(other.scale[rays], other.geom_id[rays], other.normal[rays]))
