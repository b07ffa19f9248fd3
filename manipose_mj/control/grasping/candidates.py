"""An object's annotated grasps in the world, and which of them are in reach."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from manipose_mj.control.motion.batch_ik import forward, seeds_for, solve
from manipose_mj.control.scene.scene_estimate import ObjectEstimate
from manipose_mj.mjcf.panda.robot import MAX_OPENING

# How much further than the object the gripper is open on approach, in all [m].
OPENING_MARGIN = 0.012
WIDE_MARGIN = 0.035  # for walls that lean or curve
MIN_CLEARANCE = 0.003  # between the open gripper and what it takes, in all [m]
# Smallest singular value of the Jacobian (m and rad alike) from which straight motions still go.
MIN_DEXTERITY = 0.06
_HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True)
class Grasps:
    """Attributes: tcp_poses `(n, 4, 4)`, `T_world_tcp`, best first; widths `(n,)` [m]; margin: how much further the
    gripper is open on approach [m]."""

    tcp_poses: Float[np.ndarray, "n 4 4"]
    widths: Float[np.ndarray, "n"]
    margin: float = OPENING_MARGIN

    def __len__(self) -> int:
        return len(self.widths)

    def take(self, index: Int[np.ndarray, "k"]) -> Grasps:
        """These of them, in this order."""
        return replace(self, tcp_poses=self.tcp_poses[index], widths=self.widths[index])

    @property
    def openings(self) -> Float[np.ndarray, "n"]:
        """How far to open before the approach [m]."""
        return np.minimum(self.widths + self.margin, MAX_OPENING)


def object_grasps(obj: ObjectEstimate) -> Grasps:
    """The annotated grasps that are narrow enough, and their half turns about the approach."""
    narrow = obj.grasps.widths <= MAX_OPENING - MIN_CLEARANCE
    own = obj.pose @ obj.grasps.poses[narrow]
    both = np.stack([own, own @ _HALF_TURN], axis=1).reshape(-1, 4, 4)
    return Grasps(both, np.repeat(obj.grasps.widths[narrow], 2))


@dataclass(frozen=True)
class Reach:
    """Which poses the arm can take: index `(k,)` into them, with joints `(k, 7)` [rad]."""

    index: Int[np.ndarray, "k"]
    joints: Float[np.ndarray, "k 7"]


def reachable(
    tcp_poses: Float[np.ndarray, "n 4 4"],
    near: Float[np.ndarray, "7"],
    *,
    extra_seeds: Float[np.ndarray, "n 7"] | None = None,
) -> Reach:
    """Of each reachable pose the solution nearest to the configuration `near`.

    Solutions next to a singularity do not count: the arm could not leave them in a straight line.
    """
    return postures(tcp_poses, near, extra_seeds=extra_seeds)[0]


def postures(
    tcp_poses: Float[np.ndarray, "n 4 4"],
    near: Float[np.ndarray, "7"],
    *,
    extra_seeds: Float[np.ndarray, "*s n 7"] | None = None,
) -> tuple[Reach, ...]:
    """`reachable`, then for the poses that have them the second nearest solutions, and so on.

    The arm has a joint more than a pose needs: where its elbow or forearm meets something, it may bend otherwise.
    """
    if not len(tcp_poses):
        return (Reach(np.empty(0, int), np.empty((0, 7))),)
    seeds = seeds_for(tcp_poses)
    if extra_seeds is not None:
        seeds = np.concatenate([seeds, extra_seeds.reshape(-1, len(tcp_poses), 7)])
    joints, solved = solve(tcp_poses, seeds)
    _, jacobian = forward(joints[solved])
    least = np.linalg.eigvalsh(jacobian @ jacobian.transpose(0, 2, 1))[:, 0]
    solved[solved] = least > MIN_DEXTERITY**2
    distance = np.where(solved, np.abs(joints - near).sum(axis=-1), np.inf)
    found = []
    for rank in np.argsort(distance, axis=0, kind="stable"):
        index = np.flatnonzero(np.isfinite(np.take_along_axis(distance, rank[None], axis=0)[0]))
        found.append(Reach(index, joints[rank[index], index]))
    return tuple(found)
