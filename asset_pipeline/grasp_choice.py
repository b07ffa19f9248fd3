"""Choose among many grasps: clear of the support where it matters, good, and unlike one another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from asset_pipeline.assets import StablePose
from asset_pipeline.grasp_fit import STANDOFF, Candidates
from asset_pipeline.gripper import ParallelJaw

PLANE_CLEARANCE = 0.003  # [m]
SPREAD = 0.05  # a distance that counts as much as 60 degrees between approaches [m]


def clear_of_plane(
    poses: Float[np.ndarray, "n 4 4"],
    widths: Float[np.ndarray, "n"],
    stable_poses: Sequence[StablePose],
    gripper: ParallelJaw,
) -> Bool[np.ndarray, "n s"]:
    """Whether the open hand, at the grasp and 10 cm back, is 3 mm clear of the support plane."""
    ups = np.array([p.rotation[2] for p in stable_poses]).reshape(-1, 3)
    heights = np.array([p.height for p in stable_poses])
    boxes = gripper.boxes(gripper.opening(widths))[:, None]  # n, 1, box, 2, 3
    up = ups @ poses[:, :3, :3]  # in the tcp frame: n, s, 3
    corner = np.minimum(up[:, :, None] * boxes[..., 0, :], up[:, :, None] * boxes[..., 1, :])
    back = np.minimum(0.0, -STANDOFF * up[..., 2])
    lowest = corner.sum(axis=3).min(axis=2) + poses[:, :3, 3] @ ups.T + heights + back
    return lowest >= PLANE_CLEARANCE


def diverse(
    candidates: Candidates, clear: Bool[np.ndarray, "n s"], count: int
) -> Int[np.ndarray, "k"]:
    """Indices of at most `count` grasps, best first.

    Farthest-point choice weighted by quality: half of the places are shared out among the stable
    poses, for grasps that are clear in them; the rest are open.
    """
    chosen: list[int] = []
    for column in clear.T:
        _add_farthest(candidates, np.flatnonzero(column), count // (2 * clear.shape[1]), chosen)
    _add_farthest(candidates, np.arange(len(candidates)), count - len(chosen), chosen)
    index = np.array(chosen, int)
    return index[np.argsort(-candidates.quality[index], kind="stable")]


def _add_farthest(
    candidates: Candidates, allowed: Int[np.ndarray, "m"], extra: int, chosen: list[int]
) -> None:
    """Append up to `extra` of `allowed`: each time the best in quality times distance to the chosen."""
    features = np.hstack([candidates.poses[:, :3, 3] / SPREAD, candidates.poses[:, :3, 2]])
    quality = candidates.quality[allowed]
    distance = np.ones(len(allowed))

    def keep_away(k: int) -> None:
        np.minimum(distance, np.linalg.norm(features[allowed] - features[k], axis=1), out=distance)

    for k in chosen:
        keep_away(k)
    for _ in range(min(extra, len(allowed))):
        best = int(np.argmax(distance * quality))
        if distance[best] * quality[best] <= 0:
            return
        chosen.append(int(allowed[best]))
        keep_away(chosen[-1])
