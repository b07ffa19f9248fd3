"""Setting an object down on the way: which placements join a start and a goal that no grasp shares.

A graph search over stable poses, at a few places and turns each; an edge is a grasp that the arm can
have at both ends. At most two placements.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.grasp_table import GraspTable
from manipose_mj.control.planning.table_places import (
    DROP_HEIGHT,
    PLACES,
    YAWS,
    is_free,
    resting_height,
    resting_rotation,
)
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.poses import compose

Poses = tuple[Float[np.ndarray, "4 4"], ...]

_MAX_GOALS = 4  # destinations that share a grasp with the start, before the rest is left
_SEARCHED_GOALS = 3  # destinations that placements are sought for
_GOOD = 3  # grasps on both sides of a placement that make looking further pointless
_MAX_CHAINS = 24  # pairs of placements looked at
_MIN_CLEAR = 3  # grasps of a stable pose that make it worth a placement


@dataclass(frozen=True)
class _Placement:
    """Attributes: pose, `T_world_label`; rest, index of the stable pose; before, after: grasps that
    can bring the object there and that can take it on to the goal."""

    pose: Float[np.ndarray, "4 4"]
    rest: int
    before: Bool[np.ndarray, "n"]
    after: Bool[np.ndarray, "n"]

    @property
    def worth(self) -> int:
        return int(min(self.before.sum(), self.after.sum()))


def routes(
    planner: MotionPlanner, estimate: SceneEstimate, obj: ObjectEstimate, destinations: Poses
) -> Iterator[tuple[Poses, ...]]:
    """Ways to a destination, the most promising first: where to set the object down, one after the
    other; the last are destinations.

    Args:
      planner: Plans in the scene of `estimate`.
      estimate: What is where.
      obj: What to move; without stable poses there is only the direct way.
      destinations: `T_world_label`, any of them will do.
    """
    table = GraspTable(planner, estimate, obj)
    everything = np.ones(len(table), bool)
    start = table.usable(obj.label_pose, everything, as_it_lies=True, enough=len(table))
    direct = []
    for pose in destinations:
        among = start & table.clear_at(pose)
        if is_free(planner, obj, pose) and table.usable(pose, among, enough=1).any():
            direct.append(pose)
        if len(direct) == _MAX_GOALS:
            break
    if direct:
        yield (tuple(direct),)
    if obj.rests and start.any():
        yield from _with_placements(planner, obj, destinations, table, start)
    # Nothing was found: let whoever tries the direct way say why it fails.
    yield (destinations,)


def _with_placements(
    planner: MotionPlanner,
    obj: ObjectEstimate,
    destinations: Poses,
    table: GraspTable,
    start: Bool[np.ndarray, "n"],
) -> Iterator[tuple[Poses, ...]]:
    goals, goal = [], np.zeros(len(table), bool)
    for pose in destinations:
        if not is_free(planner, obj, pose):
            continue
        usable = table.usable(pose, table.clear_at(pose), enough=len(table))
        if usable.any():
            goals.append(pose)
            goal |= usable
        if len(goals) == _SEARCHED_GOALS:
            break
    if not goals:
        return
    placements: list[_Placement] = []
    for pose, rest in _candidates(planner, obj, table, start, goal):
        before = table.usable(pose, start & table.clear[:, rest])
        after = table.usable(pose, goal & table.clear[:, rest])
        placements.append(_Placement(pose, rest, before, after))
        if placements[-1].worth >= _GOOD:
            yield ((pose,), tuple(goals))
    fair = sorted((p for p in placements if 0 < p.worth < _GOOD), key=lambda p: -p.worth)
    for placement in fair:
        yield ((placement.pose,), tuple(goals))
    yield from _chains(table, placements, tuple(goals))


def _candidates(
    planner: MotionPlanner,
    obj: ObjectEstimate,
    table: GraspTable,
    start: Bool[np.ndarray, "n"],
    goal: Bool[np.ndarray, "n"],
) -> Iterator[tuple[Float[np.ndarray, "4 4"], int]]:
    """Free placements, those first that most grasps of start and goal are clear of the table in."""
    clear = table.clear.astype(int)
    from_start, to_goal = start.astype(int) @ clear, goal.astype(int) @ clear
    both, either = np.minimum(from_start, to_goal), np.maximum(from_start, to_goal)
    for rest in np.lexsort((-either, -both)):
        if either[rest] < _MIN_CLEAR:
            continue
        for turn, yaw in enumerate(YAWS):
            rotation = resting_rotation(obj, obj.rests[rest], yaw)
            if obj.label.symmetry.axial and turn and abs(rotation[2, 0]) > 0.99:
                break  # it stands on its axis: turning it changes nothing
            height = resting_height(obj, rotation) + DROP_HEIGHT
            for shift in range(3):
                x, y = PLACES[(turn + shift) % 5]
                pose = compose(rotation, np.array([x, y, height]))
                if is_free(planner, obj, pose):
                    yield pose, int(rest)
                    break


def _chains(
    table: GraspTable, placements: list[_Placement], goals: Poses
) -> Iterator[tuple[Poses, ...]]:
    """Two placements: one that the start can reach, another that can reach the goal."""
    firsts = sorted((p for p in placements if p.before.any()), key=lambda p: -p.before.sum())
    seconds = sorted((p for p in placements if p.after.any()), key=lambda p: -p.after.sum())
    pairs = [(a, b) for a in firsts for b in seconds if a.rest != b.rest]
    pairs.sort(key=lambda pair: -min(pair[0].before.sum(), pair[1].after.sum()))
    for first, second in pairs[:_MAX_CHAINS]:
        shared = table.clear[:, first.rest] & table.clear[:, second.rest]
        shared = table.usable(first.pose, shared)
        if shared.any() and table.usable(second.pose, shared, enough=1).any():
            yield ((first.pose,), (second.pose,), goals)
