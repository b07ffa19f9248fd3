"""Places on the table for what is put aside: out of everybody's way, first with room for the hand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.table_places import (
    DROP_HEIGHT,
    HOME,
    UP,
    is_free,
    resting_height,
    resting_rotation,
)
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.goals import PoseGoal

Poses = tuple[Float[np.ndarray, "4 4"], ...]

# A grid that the arm reaches, and how far from all else, best first [m]. Circles about long objects are
# wider than they are: at last only what touches counts.
_PLACES = tuple(
    (float(x), float(y))
    for x in np.linspace(0.30, 0.66, 6)
    for y in np.linspace(-0.55, 0.55, 13)
    if 0.33 < np.hypot(x, y) < 0.70
)
_ROOMS = (0.09, 0.05, 0.02, -0.02, -np.inf)
_MAX_PLACES = 6
_MAX_RESTS = 2
# How far things are pushed [m], and to where on the table [m].
_PUSHES = (0.10, 0.06)
_DIRECTIONS = 12
_NEAREST, _FARTHEST, _WIDEST = 0.30, 0.72, 0.55
_MAX_PUSHES = 8
_MIN_CLEAR = 3  # grasps of a stable pose that make it worth setting something down in
_QUARTER = np.pi / 2
_UNSEEN = 0.08  # radius of what nobody has seen [m]


def places_aside(
    obj: ObjectEstimate,
    goals: Sequence[PoseGoal],
    estimate: SceneEstimate,
    planner: MotionPlanner,
    attempt: int = 0,
    joints: Float[np.ndarray, "7"] = HOME,
) -> Poses:
    """`T_world_label` where the object is out of everybody's way, turned as little as it can be.

    Args:
      obj: What to put aside; where it is now, also in the hand, the nearest places come first.
      goals: Kept free for their objects.
      estimate: What is where.
      planner: Plans in the scene of `estimate`.
      attempt: The nearest places come at the first, 0; the next ones and other sides down at each later one.
      joints: Where the arm is by then [rad].

    Returns:
      Poses with as much room around them as there is; none where the table is full.
    """
    others = [other for other in estimate.objects.values() if other.name != obj.name]
    taken = [(other.label_pose[:2, 3], radius(other)) for other in others]
    wanted = _wanted(goals, estimate)
    own = obj.label_pose[:2, 3]
    order = sorted(_PLACES, key=lambda place: float(np.linalg.norm(np.array(place) - own)))
    rotations = _rest_rotations(obj, _MAX_RESTS * (attempt + 1))
    enough = _MAX_PLACES * len(rotations)
    for room in _ROOMS:
        turns = (0.0,) if np.isfinite(room) else (0.0, _QUARTER, -_QUARTER)
        found: list[Float[np.ndarray, "4 4"]] = []
        for xy in order:
            least = radius(obj) + room
            near = _gap(xy, taken) < least or _gap(xy, wanted) < max(least, 0.0)
            if near:
                continue
            poses = (pose for turn in turns for pose in _poses_at(obj, rotations, xy, turn))
            found += [pose for pose in poses if is_free(planner, obj, pose, joints)]
            if len(found) >= enough * (attempt + 1):
                break
        if found:
            return tuple(found[enough * attempt :] or found[-enough:])
    return ()


def places_pushed(
    obj: ObjectEstimate,
    goals: Sequence[PoseGoal],
    estimate: SceneEstimate,
    planner: MotionPlanner,
) -> Poses:
    """`T_world_label` a push away, turned as it is: the farthest from other things first, free ones before the rest.

    Arguments as for `places_aside`.
    """
    others = [other for other in estimate.objects.values() if other.name != obj.name]
    taken = [(other.label_pose[:2, 3], radius(other)) for other in others]
    wanted = _wanted(goals, estimate)
    found = []
    for distance in _PUSHES:
        for angle in np.linspace(-np.pi, np.pi, _DIRECTIONS, endpoint=False):
            pose = obj.label_pose.copy()
            pose[:2, 3] += distance * np.array([np.cos(angle), np.sin(angle)])
            x, y = pose[:2, 3]
            in_reach = _NEAREST < np.hypot(x, y) < _FARTHEST and abs(y) < _WIDEST
            if in_reach and _gap((x, y), wanted) > radius(obj):
                raised = pose.copy()
                raised[2, 3] += DROP_HEIGHT
                free = is_free(planner, obj, raised)
                found.append((free, _gap((x, y), taken), pose))
    found.sort(key=lambda each: each[:2], reverse=True)
    return tuple(pose for _, _, pose in found[:_MAX_PUSHES])


def radius(obj: ObjectEstimate) -> float:
    """Of a circle about the label's origin that the object stays in, however it lies [m]."""
    return float(np.linalg.norm(np.sort(obj.label.extents)[1:])) / 2


def _wanted(
    goals: Sequence[PoseGoal], estimate: SceneEstimate
) -> list[tuple[Float[np.ndarray, "2"], float]]:
    """Circles that objects will fill at their goals; of one that nobody has seen its size is guessed."""
    objects = estimate.objects
    return [
        (goal.pose[:2, 3], radius(objects[goal.object]) if goal.object in objects else _UNSEEN)
        for goal in goals
    ]


def _gap(xy: tuple[float, float], circles: list[tuple[Float[np.ndarray, "2"], float]]) -> float:
    """From a point to the nearest circle; infinite without any [m]."""
    gaps = [float(np.linalg.norm(np.array(xy) - at)) - size for at, size in circles]
    return min(gaps, default=np.inf)


def _poses_at(
    obj: ObjectEstimate,
    rotations: list[Float[np.ndarray, "3 3"]],
    xy: tuple[float, float],
    turn: float,
) -> Iterator[Float[np.ndarray, "4 4"]]:

    for rotation in rotations:
        turned = rotation_about(UP, turn) @ rotation
        yield compose(turned, np.array([*xy, resting_height(obj, turned) + DROP_HEIGHT]))


def _rest_rotations(obj: ObjectEstimate, most: int) -> list[Float[np.ndarray, "3 3"]]:
    """`R_world_label` of the stable poses nearest to how the object lies now."""
    own = obj.label_pose[:3, :3]
    up = own[2] @ obj.label.rotation.T
    graspable = [
        rest
        for k, rest in enumerate(obj.rests)
        if len(obj.grasps) and obj.grasps.clear[:, k].sum() >= _MIN_CLEAR
    ]
    nearest = sorted(graspable, key=lambda rest: -float(rest.rotation[2] @ up))[:most]
    if not nearest:
        return [own]
    rotations = []
    for rest in nearest:
        turned = own @ resting_rotation(obj, rest, 0.0).T
        yaw = float(np.arctan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1]))
        rotations.append(resting_rotation(obj, rest, yaw))
    return rotations
