"""Choose among many grasps: clear of the support where it matters, good, and unlike one another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.assets.asset import GraspSet, StablePose
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.grasp_sampling.grasp_fit import Candidates
from manipose_mj.grasp_sampling.gripper_clearance import STANDOFF

PLANE_CLEARANCE = 0.003  # [m]
SPREAD = 0.05  # a distance that counts as much as 60 degrees between approaches [m]
CLEAR_SHARE = 0.9  # of the places; the others are open to grasps that no support allows


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

    Farthest-point choice weighted by quality. Most places are shared out equally among the stable
    poses and their pairs, as a grasp that moves an object from one to another is clear in both.
    """
    if len(candidates) == 0:
        return np.empty(0, int)
    groups = [
        clear[:, i] & clear[:, j] for i in range(clear.shape[1]) for j in range(i, clear.shape[1])
    ]
    groups = sorted((g for g in groups if g.any()), key=np.count_nonzero)  # the scarcest first
    choice = _FarthestChoice(candidates.poses, candidates.quality)
    for number, group in enumerate(groups):
        places = round(CLEAR_SHARE * count) - len(choice.chosen)
        choice.extend(group, max(1, places // (len(groups) - number)), count)
    choice.extend(np.ones(len(candidates), bool), count, count)
    index = np.array(choice.chosen, int)
    return index[np.argsort(-candidates.quality[index], kind="stable")]


def spread_out(grasps: GraspSet, count: int) -> Int[np.ndarray, "k"]:
    """Indices of at most `count` of the grasps: good, clear of some support, and of every side.

    Args:
      grasps: Best first.
      count: How many.
    """
    rank = np.linspace(1.0, 0.3, len(grasps))
    choice = _FarthestChoice(grasps.poses, np.where(grasps.clear.any(axis=1), rank, rank / 2))
    choice.extend(np.ones(len(grasps), bool), count, count)
    return np.array(choice.chosen, int)


class _FarthestChoice:
    """Grows a set of grasps, each time by the best in quality times distance to the chosen."""

    def __init__(self, poses: Float[np.ndarray, "n 4 4"], score: Float[np.ndarray, "n"]) -> None:
        closing = poses[:, :3, 1]
        # y y^T is the same for both signs of y.
        line = np.einsum("ni,nj->nij", closing, closing).reshape(-1, 9) / 2
        features = [poses[:, :3, 3] / SPREAD, poses[:, :3, 2], line]
        self._features = np.hstack(features).astype(np.float32)
        self._score = score.astype(np.float32)
        self._distance = np.ones(len(poses), np.float32)
        self.chosen: list[int] = []

    def extend(self, allowed: Bool[np.ndarray, "n"], more: int, limit: int) -> None:
        """Choose up to `more` from `allowed`, while there are fewer than `limit` in all."""
        index = np.flatnonzero(allowed)
        size = min(len(self.chosen) + more, limit)
        while len(index) and len(self.chosen) < size:
            value = (self._distance * self._score)[index]
            best = int(index[np.argmax(value)])
            if value.max() <= 0:
                return
            self.chosen.append(best)
            away = np.linalg.norm(self._features - self._features[best], axis=1)
            np.minimum(self._distance, away, out=self._distance)
