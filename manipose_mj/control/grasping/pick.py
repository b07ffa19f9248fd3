"""Choosing a grasp: reachable, free of collision, and good for what comes next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.grasping.approach import (
    bent_approaches,
    free_of_collision,
    straight_approach,
)
from manipose_mj.control.grasping.candidates import (
    WIDE_MARGIN,
    Grasps,
    Reach,
    object_grasps,
    postures,
)
from manipose_mj.control.grasping.part_pick import grip_handle
from manipose_mj.control.grasping.retraction import (
    equivalent_poses,
    find_place,
    retractions,
    transport_path,
)
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.cavity_mouth import way_out
from manipose_mj.control.scene.collision_query import CONTACT, AttachedObject, CollisionQuery
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, PartEstimate, SceneEstimate
from manipose_mj.failures import StageFailure
from manipose_mj.poses import invert, pose_error, rotation_angle

# How much nearer than usual fingers come to the table under a thin object, which they then touch softly [m].
SOFT_TOUCH = 0.004
# A grasp this far from the label's origin [m] counts as one unit worse than one at it.
_LEVER = 0.08
# Pairs of grasp and destination looked at, straight approaches and complete picks tried, at most.
_MAX_PAIRS = 2400
_MAX_APPROACHES = 40
_MAX_TRIES = 12
_BENT_TRIES = 4  # complete picks where each may take a long search
_POSTURES = 3  # of the arm at a destination
_THOROUGH = 4  # times as many, where nothing else works
# Grasps nearer than this to one another hold alike [m, rad].
_ALIKE = (0.02, 0.5)
# What can be lifted so far has room around it: a path is taken for granted before it is needed [m].
_ROOMY = 0.05


@dataclass(frozen=True)
class _Effort:
    """Attributes: tries: times as many as usual; posture: the arm comes to each grasp by its nearest solution but so
    many; bent: it is bent in any way that leaves an approach, and paths are sought for longer."""

    tries: int = 1
    posture: int = 0
    bent: bool = False


_USUAL = _Effort()


@dataclass(frozen=True)
class ObjectPick:
    """How to take an object.

    Attributes:
      free_path: Joint targets to where the approach starts `(t, 7)`.
      approach: Joint targets to the grasp `(s, 7)`.
      width: Expected between the pads once closed [m].
      opening: Of the gripper on approach [m].
      goal: A configuration in which the object is where it shall go; the grasp's own if it goes
        nowhere.
      support_allowance: As the planner's that found it [m].
      close: Whether there is little room to come to it.
    """

    free_path: Float[np.ndarray, "t 7"]
    approach: Float[np.ndarray, "s 7"]
    width: float
    opening: float
    goal: Float[np.ndarray, "7"]
    support_allowance: float = 0.0
    close: bool = False


@dataclass(frozen=True)
class PartPick(ObjectPick):
    """How to take a part by its handle."""


def pick_object(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    obj: ObjectEstimate,
    destinations: tuple[Float[np.ndarray, "4 4"], ...],
    slipped: Sequence[Float[np.ndarray, "4 4"]] = (),
    thorough: bool = False,
) -> ObjectPick:
    """The first grasp, in order of promise, that can be approached and can reach a destination.

    Where there is none, the hand opens wider, and the arm bends otherwise; and where the object is estimated, the fingers may at last touch what
    it lies on: what is thin may leave them less room than its pose is uncertain by. Grasps like those that did not
    hold come last.

    Args:
      planner: Plans in the scene of `estimate`.
      estimate: What is where.
      obj: What to take.
      destinations: `T_world_label` that it shall go to, any of them; empty if it only is to be held.
      slipped: `T_tcp_label` of grasps that did not hold.
      thorough: Whether to try many more grasps in the end, the arm bent in many ways, and to sample more if it can be;
        which takes long.

    Raises:
      StageFailure: There is none; the reason says at which filter the last ones fell.
    """
    grasps = object_grasps(obj)
    wider = replace(grasps, margin=WIDE_MARGIN)
    attempts = [
        (planner, grasps, _USUAL),
        (planner, wider, _USUAL),
        (planner, grasps, _Effort(posture=1)),
    ]
    others = grasps
    if len(slipped):
        others = grasps.take(np.flatnonzero(~_alike(obj, grasps, np.stack(slipped))))
        attempts.insert(0, (planner, others, _USUAL))
    if obj.uncertainty > 0:
        attempts.append((planner.touching_support(SOFT_TOUCH), grasps, _USUAL))
    if thorough:
        attempts.append((planner, grasps, _Effort(_THOROUGH)))
        attempts.append((planner, others if len(others) else grasps, _Effort(bent=True)))
    failures = []
    for allowing, candidates, effort in attempts:
        try:
            return _pick(allowing, estimate, obj, destinations, candidates, effort)
        except StageFailure as failure:
            failures.append(failure)
    if thorough and obj.sample_more is not None:
        more = object_grasps(replace(obj, sample_grasps=obj.sample_more))
        with suppress(StageFailure):
            return _pick(planner, estimate, obj, destinations, more, _USUAL)
    raise failures[0] from None


def _alike(
    obj: ObjectEstimate, grasps: Grasps, slipped: Float[np.ndarray, "k 4 4"]
) -> Bool[np.ndarray, "n"]:
    """Which grasps hold the object nearly as one of these, `T_tcp_label`, does."""
    own = invert(grasps.tcp_poses) @ obj.label_pose
    apart, turned = pose_error(own[:, None], slipped[None], obj.label.symmetry)
    return ((apart < _ALIKE[0]) & (turned < _ALIKE[1])).any(axis=1)


def _pick(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    obj: ObjectEstimate,
    destinations: tuple[Float[np.ndarray, "4 4"], ...],
    grasps: Grasps,
    effort: _Effort,
) -> ObjectPick:
    """A pick among these grasps."""
    approaches: dict[int, Float[np.ndarray, "s 7"] | None] = {}
    if effort.bent:
        approaches.update(bent_approaches(planner, grasps, estimate.joints, obj.geoms))
        free = _at_grasp(approaches)
        if not approaches:
            raise StageFailure("plan", f"no grasp of {obj.name} has a straight approach")
    else:
        free = _free(planner, estimate, obj, grasps, effort.posture)
    way = way_out(estimate, destinations[0][:3, 3]) if destinations else None
    looked_at: set[int] = set()
    tries = 0
    for index, joints, goal in _with_destination(planner, grasps, free, obj, destinations):
        if index not in approaches:
            approaches[index] = straight_approach(planner, grasps, index, joints, obj.geoms)
        looked_at.add(index)
        approach = approaches[index]
        enough = len(looked_at) == effort.tries * _MAX_APPROACHES
        if tries == (_BENT_TRIES if effort.bent else effort.tries * _MAX_TRIES) or enough:
            break
        if approach is None:
            continue
        tries += 1
        retraction = _retract(planner, estimate, grasps, index, obj, joints)
        if destinations and (
            retraction is None
            or not _can_transport(
                planner, grasps, index, obj, retraction, destinations, goal, way, effort.bent
            )
        ):
            continue
        width, opening = float(grasps.widths[index]), float(grasps.openings[index])
        query = CollisionQuery(opening=opening)
        free_path = planner.free_path(
            estimate.joints, approach[0], query, tight=effort.bent, patient=effort.bent
        )
        if free_path is not None:
            allowance = planner.support_allowance
            return ObjectPick(free_path, approach, width, opening, goal, allowance, effort.bent)
    counts = f"{len(free.index)} grasps of {obj.name} are free to take"
    if not looked_at:
        raise StageFailure("plan", f"{counts}, none can have it at its destination")
    if not tries:
        raise StageFailure("plan", f"{counts}, none of {len(looked_at)} has a straight approach")
    raise StageFailure("plan", f"{counts}, none of {tries} could be carried out")


def _free(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    obj: ObjectEstimate,
    grasps: Grasps,
    posture: int,
) -> Reach:
    """Grasps free to take, the arm coming to each by its `posture`-th nearest solution first.

    Raises:
      StageFailure: There are none.
    """
    reaches = postures(grasps.tcp_poses, estimate.joints)[posture:]
    count = len(reaches[0].index) if reaches else 0
    if not count:
        raise StageFailure("plan", f"none of {len(grasps)} grasps of {obj.name} is in reach")
    free = free_of_collision(planner, grasps, reaches, obj.geoms)
    if not len(free.index):
        raise StageFailure("plan", f"all {count} reachable grasps of {obj.name} collide")
    return free


def _at_grasp(approaches: Mapping[int, Float[np.ndarray, "s 7"] | None]) -> Reach:
    """Where approaches by grasp lead to."""
    ends = {index: way[-1] for index, way in approaches.items() if way is not None}
    return Reach(np.array(list(ends), int), np.array(list(ends.values())).reshape(-1, 7))


def pick_part(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    part: PartEstimate,
    opening: float | None,
    *,
    in_stages: bool = False,
    following: bool = False,
) -> PartPick:
    """A grip of the handle that can be approached and moves the part towards `opening`; None: anywhere.

    `in_stages` and `following` as of `grip_handle`.

    Raises:
      StageFailure: There is none.
    """
    grip = grip_handle(planner, estimate, part, opening, in_stages=in_stages, following=following)
    return PartPick(grip.free_path, grip.approach, grip.width, grip.opening, grip.approach[-1])


def _with_destination(
    planner: MotionPlanner,
    grasps: Grasps,
    free: Reach,
    obj: ObjectEstimate,
    destinations: tuple[Float[np.ndarray, "4 4"], ...],
) -> Iterator[tuple[int, Float[np.ndarray, "7"], Float[np.ndarray, "7"]]]:
    """Grasp index, joints at the grasp and at a destination, the most promising first.

    At the destination the arm and what it carries are free of collision.
    """
    if not destinations:
        yield from ((int(i), q, q) for i, q in zip(free.index, free.joints, strict=True))
        return
    goals = equivalent_poses(destinations, obj.label.symmetry)
    tcp_starts = grasps.tcp_poses[free.index]
    label_tcp = invert(obj.label_pose) @ tcp_starts
    tcp_goals = (goals[None] @ label_tcp[:, None]).reshape(-1, 4, 4)
    owner = np.repeat(np.arange(len(free.index)), len(goals))
    lever = np.linalg.norm(label_tcp[:, :3, 3], axis=1)
    effort = (owner / len(free.index)) + lever[owner] / _LEVER
    promise = _promise(tcp_starts[owner], tcp_goals) + effort
    likely = np.argsort(promise, kind="stable")[:_MAX_PAIRS]
    owner, tcp_goals, promise = owner[likely], tcp_goals[likely], promise[likely]
    starts = free.joints[owner]
    used: dict[int, int] = {}
    for reach in postures(tcp_goals, free.joints.mean(axis=0), extra_seeds=starts)[:_POSTURES]:
        travel = np.abs(reach.joints - starts[reach.index]).max(axis=1)
        # A short way with a middling grasp beats a long one with the best.
        order = np.argsort(travel + promise[reach.index], kind="stable")
        for k in order:
            grasp = int(owner[reach.index[k]])
            if used.get(grasp, 0) == 2:
                continue
            index = int(free.index[grasp])
            if planner.collides(reach.joints[k], _attached(grasps, index, obj).query(CONTACT)):
                continue
            used[grasp] = used.get(grasp, 0) + 1
            yield index, free.joints[grasp], reach.joints[k]


def _promise(
    tcp_starts: Float[np.ndarray, "n 4 4"], tcp_goals: Float[np.ndarray, "n 4 4"]
) -> Float[np.ndarray, "n"]:
    """A guess, before any kinematics, at how hard a pair is: less is better.

    Coming from above meets the least; a hand that has to turn little can do it anywhere.
    """
    turn = rotation_angle(tcp_starts[:, :3, :3], tcp_goals[:, :3, :3])
    return 1 + tcp_goals[:, 2, 2] + turn / np.pi


def _retract(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    grasps: Grasps,
    index: int,
    obj: ObjectEstimate,
    joints: Float[np.ndarray, "7"],
) -> Float[np.ndarray, "t 7"] | None:
    """Joint targets that take the object off its support."""
    attached = _attached(grasps, index, obj)
    way = way_out(estimate, obj.label_pose[:3, 3])
    return next(retractions(planner, joints, attached, way), None)


def _can_transport(
    planner: MotionPlanner,
    grasps: Grasps,
    index: int,
    obj: ObjectEstimate,
    retraction: Float[np.ndarray, "t 7"],
    destinations: tuple[Float[np.ndarray, "4 4"], ...],
    goal: Float[np.ndarray, "7"],
    way: Float[np.ndarray, "3"] | None,
    patient: bool,
) -> bool:
    """Whether the lifted object can be set down; where it cannot be lifted far, also on which path.

    `patient`: whether to look for that long.
    """
    attached = _attached(grasps, index, obj)
    pose_tcp = invert(grasps.tcp_poses[index]) @ obj.label_pose
    symmetry = obj.label.symmetry
    place = find_place(planner, pose_tcp, destinations, symmetry, attached, goal, way)
    if place is None:
        return False
    risen = planner.tcp_pose(retraction[-1])[2, 3] - planner.tcp_pose(retraction[0])[2, 3]
    if risen > _ROOMY:
        return True
    path = transport_path(planner, retraction[-1], place.above, attached, patient=patient)
    return path is not None


def _attached(grasps: Grasps, index: int, obj: ObjectEstimate) -> AttachedObject:
    """The object in the hand, as this grasp would hold it."""
    return obj.attached_to(grasps.tcp_poses[index], float(grasps.widths[index]))
