"""What one camera saw of furniture, kept small: training holds views by the thousand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.ppf_jax.data.articulated.region_of_interest import RegionOfInterest

UNIT = 2e-4  # of kept places [m]; 16 bits reach 6.5 m, and noise is ten times as much
_DIRECTION = 127.0
SLIP = 0.04  # how far off a handle training may look for it [m]
# Around every handle and spot: of the points that stand out as far as a handle does, and of the others.
_OUT_KEPT, _REST_KEPT = 512, 768


@dataclass(frozen=True)
class FurnitureView:
    """What one camera saw of one piece of furniture.

    Attributes:
      places: `(n, 3)` int16, camera frame [`UNIT` m].
      directions: `(n, 3)` int8, of the normals, towards the camera.
      part: `(n,)` int8, the part that a point belongs to; -1 for the base and for strays.
      handle: `(n,)`, whether the point is on that part's handle.
      pose: `(4, 4)` float32, `T_camera_object`.
      handle_pixels: `(parts,)` int32, how many measured pixels show each handle, as if of 480 rows.
      even: Of so many rows, the first; they are an even sample of all pixels, in random order. The others
        are from around handles and spots.
      pixels: How many pixels show the furniture, as if of 480 rows.
      spots: `(s, 2, 3)` float32, places at the surface [m] and which way is out there, camera frame.
    """

    places: Int[np.ndarray, "n 3"]
    directions: Int[np.ndarray, "n 3"]
    part: Int[np.ndarray, "n"]
    handle: Bool[np.ndarray, "n"]
    pose: Float[np.ndarray, "4 4"]
    handle_pixels: Int[np.ndarray, "parts"]
    even: int
    pixels: float
    spots: Float[np.ndarray, "s 2 3"]

    @property
    def points(self) -> Float[np.ndarray, "n 3"]:
        """`(n, 3)` float32 [m], camera frame."""
        return self.places * np.float32(UNIT)

    @property
    def normals(self) -> Float[np.ndarray, "n 3"]:
        """`(n, 3)` float32, unit, towards the camera."""
        normals = self.directions.astype(np.float32)
        return normals / np.sqrt(np.einsum("ni,ni->n", normals, normals))[:, None]


def kept_places(points: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "n 3"]:
    """As `FurnitureView` keeps points [m]."""
    return np.rint(points / UNIT).astype(np.int16)


def kept_directions(normals: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "n 3"]:
    """As `FurnitureView` keeps unit normals."""
    return np.rint(normals * _DIRECTION).astype(np.int8)


def thinned(
    points: Float[np.ndarray, "n 3"],
    spots: Float[np.ndarray, "s 2 3"],
    even: int,
    region: RegionOfInterest,
    rng: np.random.Generator,
) -> tuple[Int[np.ndarray, "m"], int]:
    """Rows to keep: an even sample, then more from around some spots; and how many are of the first kind.

    Args:
      points: [m].
      spots: Places [m] and which way is out there.
      even: Rows of the even sample, at most.
      region: How training will resample from them.
      rng: Draws the rows.
    """
    order = rng.permutation(len(points))
    rows, left = [order[:even]], order[even:]
    for place, outward in spots:
        offset = points[left] - place
        near = np.einsum("ni,ni->n", offset, offset) < (region.radius + SLIP) ** 2
        out = offset @ outward > region.out
        taken = np.concatenate(
            [np.flatnonzero(near & out)[:_OUT_KEPT], np.flatnonzero(near & ~out)[:_REST_KEPT]]
        )
        rows.append(left[taken])
        left = np.delete(left, taken)
    return np.concatenate(rows), len(rows[0])
