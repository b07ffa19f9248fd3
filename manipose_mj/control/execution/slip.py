"""How far what is held has slipped in the hand."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.control.scene.scene_estimate import PartEstimate, SceneEstimate
from manipose_mj.poses import invert, pose_error, rotation_angle

_SOMETHING = 0.0015  # between fingers that are not shut [m]


def closed_past(estimate: SceneEstimate, name: str, width: float) -> bool:
    """Whether fingers that have closed on something have it not between them.

    Args:
      estimate: After they closed.
      name: Of the object or part.
      width: That the grasp should have [m].
    """
    least = min(0.5 * width, width - 0.004)
    obj = estimate.objects.get(name)
    if obj is not None and obj.uncertainty > 0:
        least = min(least, _SOMETHING)  # a wall may be thinner than its surface seems to be
    return estimate.opening < least


def pose_in_hand(estimate: SceneEstimate, name: str) -> Float[np.ndarray, "4 4"]:
    """`T_tcp_label` of an object, or of a part's handle."""
    part: PartEstimate | None = estimate.parts.get(name)
    pose = estimate.objects[name].label_pose if part is None else part.handle_pose
    return invert(estimate.tcp_pose) @ pose


def slip_of(
    estimate: SceneEstimate,
    name: str,
    now: Float[np.ndarray, "4 4"],
    then: Float[np.ndarray, "4 4"],
) -> tuple[float, float]:
    """Between two poses in the hand: distance [m] and angle [rad].

    Of what is estimated, but for turns that change nothing: which of them an estimate says is chance.
    """
    obj = estimate.objects.get(name)
    if obj is None or obj.uncertainty == 0:
        shift = float(np.linalg.norm(now[:3, 3] - then[:3, 3]))
        return shift, float(rotation_angle(now[:3, :3], then[:3, :3]))
    shift, turn = pose_error(now, then, obj.label.symmetry)
    return float(shift), float(turn)


def exceeds(slip: tuple[float, float], limit: tuple[float, float]) -> bool:
    """Whether a distance [m] or an angle [rad] is beyond its limit."""
    return slip[0] > limit[0] or slip[1] > limit[1]
