"""Which of what stands out of a front is whose handle, and the parts that only their handles show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from manipose_mj.control.furniture.fit.shut_part import ALIKE, ShutPart
from manipose_mj.control.furniture.shapes.handle_shape import ACROSS_FRONT
from manipose_mj.control.furniture.shapes.relief import Bump, Relief
from manipose_mj.poses import compose, transform

# How near a handle what stands out of the front is the handle, and how far from where it was sensed it may be [m]; the
# confidence of what was not sensed.
_AT_HANDLE, _FAR, _MISSED = 0.03, 0.60, 0.12


def claim(shut: Sequence[ShutPart], relief: Relief, points: Float[np.ndarray, "n 3"]) -> None:
    """Give handles what stands out of the front where they were sensed, or else nearest to it; the surest choose first.

    A handle stays where it was sensed if cameras do not see that nothing stands out there.

    Args:
      shut: Parts as they were sensed.
      relief: Of the front.
      points: Of the furniture, object frame [m].
    """
    free = list(relief.bumps)
    parts = [part for part in shut if part.opening == 0.0 and not part.sensed.certain]
    parts.sort(key=lambda part: -part.sensed.confidence)
    for most in (_AT_HANDLE, _FAR):
        for part in parts:
            place = part.handle[:3, 3]
            if part.base is not None or not free or (most == _FAR and not relief.shows(place)):
                continue
            nearest = min(free, key=lambda bump: bump.beside(place))
            if nearest.beside(place) < most:
                part.take(nearest, points)
                free = [bump for bump in free if bump is not nearest]


def missed(
    shut: Sequence[ShutPart], relief: Relief, points: Float[np.ndarray, "n 3"]
) -> list[ShutPart]:
    """Parts of what stands out of the front and is no handle of these, of little confidence; arguments as of `claim`."""
    taken = [part.handle[:3, 3] for part in shut]
    free = [b for b in relief.bumps if all(b.beside(place) > _AT_HANDLE for place in taken)]
    return [_missed_part(bump, shut, points) for bump in free] if shut else []


def _missed_part(
    bump: Bump, shut: Sequence[ShutPart], points: Float[np.ndarray, "n 3"]
) -> ShutPart:
    """A part by its handle alone: of the kind of that whose handle is as large, or a door."""
    like = max(shut, key=lambda part: part.sensed.confidence)
    handle = compose(like.pose[:3, :3] @ ACROSS_FRONT, transform(like.pose, bump.middle[None])[0])
    sensed = replace(like.sensed, handle=handle, opening=0.0, confidence=_MISSED)
    part = ShutPart(sensed, like.pose)
    part.take(bump, points)
    alike = [o for o in shut if o.measured and np.abs(o.half - part.half).max() < ALIKE]
    near = min(
        alike, key=lambda o: float(np.linalg.norm(o.handle[:3, 3] - bump.middle)), default=None
    )
    part.kind = "hinge" if near is None else near.kind
    # A hinge is looked for where a door's is likely to be.
    part.axis, part.origin = np.array([1.0, 0.0, 0.0]), part.handle[:3, 3].copy()
    return part
