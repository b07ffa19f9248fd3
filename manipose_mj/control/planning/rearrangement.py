"""Plans in clutter: one object at a time, in an order that a search over what blocks what has found.

Each plan is the next move only. After it the scene is observed again: in a pile everything moves a
little when one object is taken.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from itertools import islice
from math import radians

import numpy as np

from manipose_mj.control.grasping.object_push import push_object
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.obstructions import blockers_of
from manipose_mj.control.planning.plan import CandidatePlan, Plan, Step
from manipose_mj.control.planning.removal_order import Blockers, first_removals
from manipose_mj.control.planning.set_aside import places_aside, places_pushed, radius
from manipose_mj.control.planning.table_places import is_free
from manipose_mj.control.planning.transport import place, transport_plans
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.errors import InputError
from manipose_mj.poses import pose_error
from manipose_mj.tasks.goals import Goal, OnTableGoal, PoseGoal, Tolerance

USUAL_TOLERANCE = Tolerance()  # of tasks that set none of their own
# Of the task's tolerance: a goal that is met to within so much is left alone, by translation and rotation.
_MET = (0.018 / 0.02, radians(13) / radians(15))
_CLOSE = 0.012  # between objects of one crowd [m]
_CROWDED = 0.04  # between the circles about objects, which are wider than most of them [m]
_TOUCHING = 0.002  # [m]
_ABOVE = 0.3  # of the direction to what touches an object along the vertical: it lies on the object
# How far the hand may push objects aside, first and when nothing else is left [m].
_CONTACT_ALLOWANCES = (0.001, 0.006, 0.012)


def in_clutter(goals: tuple[Goal, ...], estimate: SceneEstimate) -> bool:
    """Whether the goals are about objects among others."""
    only_poses = all(isinstance(goal, PoseGoal | OnTableGoal) for goal in goals)
    names = estimate.objects.keys() | {goal.object for goal in goals if isinstance(goal, PoseGoal)}
    return only_poses and len(names) > 1 and not estimate.parts


def candidate_moves(
    goals: tuple[Goal, ...],
    estimate: SceneEstimate,
    planner: MotionPlanner,
    tolerance: Tolerance = USUAL_TOLERANCE,
) -> Iterator[CandidatePlan]:
    """Next moves, the most promising first; a single one without steps when every pose is reached.

    First what brings a target to its goal, or starts the shortest order that lets one be brought there, past
    neighbours that may give way ever more; then such orders with pushes among them; then what may hide a target that
    is not seen; then anything near, which at last is pushed.

    Args:
      goals: All of them.
      estimate: What is where; targets may be missing.
      planner: Of motions in the scene of `estimate`.
      tolerance: The task's: what is left alone meets its goal with a little of it to spare.

    Raises:
      InputError: There are no more moves.
    """
    pose_goals = [goal for goal in goals if isinstance(goal, PoseGoal)]
    seen = [goal for goal in pose_goals if goal.object in estimate.objects]
    hidden = [goal.object for goal in pose_goals if goal.object not in estimate.objects]
    unmet = [goal for goal in seen if not _met(goal, estimate.objects[goal.object], tolerance)]
    if not unmet and not hidden:
        yield CandidatePlan(tuple)
        return
    done = {goal.object for goal in seen} - {goal.object for goal in unmet}
    in_place = {goal.object: _in_place(goal, estimate, planner) for goal in unmet}
    ready = {goal.object: goal for goal in unmet if not in_place[goal.object]}

    @cache
    def aside(name: str, attempt: int) -> Plan:
        """Taken and set down elsewhere; no steps where the table is full."""
        poses = places_aside(estimate.objects[name], pose_goals, estimate, planner, attempt)
        return place(name, poses) if poses else ()

    @cache
    def pushed(name: str) -> Plan:
        """Pushed over the table; no steps where the hand cannot push it."""
        obj, firm = estimate.objects[name], planner.allowing(_CONTACT_ALLOWANCES[-1])
        poses = places_pushed(obj, pose_goals, estimate, planner)
        possible = name not in done and push_object(firm, estimate, obj, poses) is not None
        return (Step("move_to", name, poses=poses),) if possible else ()

    def taken(name: str, attempt: int) -> CandidatePlan | None:
        allowance = _CONTACT_ALLOWANCES[attempt]
        if name in ready:
            pushing = planner.allowing(allowance)
            return CandidatePlan(
                partial(_route, ready[name], estimate, pushing, attempt), allowance
            )
        plan = () if name in done else aside(name, attempt)
        return CandidatePlan(lambda: plan, allowance) if plan else None

    attempts = range(len(_CONTACT_ALLOWANCES))
    for attempt in attempts:
        pushing = planner.allowing(_CONTACT_ALLOWANCES[attempt])
        names = _searched(unmet, in_place, estimate, pushing)
        yield from filter(None, (taken(name, attempt) for name in names))
    for name in _searched(unmet, in_place, estimate, planner, lambda name: bool(pushed(name))):
        if plan := pushed(name):
            yield CandidatePlan(lambda plan=plan: plan, _CONTACT_ALLOWANCES[-1])
    nearby = _near(unmet, in_place, estimate, planner)
    if hidden:
        nearby = list(dict.fromkeys([*_covers(estimate, planner), *nearby]))
    for attempt in attempts:
        yield from filter(None, (taken(name, attempt) for name in nearby))
    for name in nearby:
        if plan := pushed(name):
            yield CandidatePlan(lambda plan=plan: plan, _CONTACT_ALLOWANCES[-1])
    if not unmet:
        raise InputError(
            f"no camera sees {hidden[0]}, and nothing can be moved any more that hides it"
        )
    raise InputError(f"nothing can be moved any more towards {unmet[0].object}'s goal")


def is_supported(obj: ObjectEstimate, scene: PlanningScene) -> bool:
    """Whether something besides the robot is under it."""
    return any(
        upwards < -_ABOVE and not scene.robot[geom]
        for geom, upwards in scene.touching(obj.geoms, _TOUCHING)
    )


def _route(goal: PoseGoal, estimate: SceneEstimate, planner: MotionPlanner, attempt: int) -> Plan:
    """The steps to a goal: another way at each attempt, while there is one."""
    return deque(islice(transport_plans(goal, estimate, planner), attempt + 1), maxlen=1).pop()


def _searched(
    unmet: list[PoseGoal],
    in_place: Mapping[str, frozenset[str]],
    estimate: SceneEstimate,
    planner: MotionPlanner,
    can_push: Callable[[str], bool] = lambda name: False,
) -> list[str]:
    """Targets that can be taken, then what comes first in the shortest orders that free another.

    What can be pushed need not be taken.
    """
    goals = {goal.object: goal for goal in unmet}

    @cache
    def blockers(name: str) -> Blockers:
        found = blockers_of(estimate.objects[name], estimate, planner, goals.get(name))
        free = frozenset() in found or (name not in goals and can_push(name))
        return (frozenset(),) if free else found

    orders = [first_removals(goal.object, blockers, in_place[goal.object]) for goal in unmet]
    free = [order[0] for order in orders if order and order[0] in goals]
    return list(dict.fromkeys([*free, *(name for order in orders for name in order)]))


def _near(
    unmet: list[PoseGoal],
    in_place: Mapping[str, frozenset[str]],
    estimate: SceneEstimate,
    planner: MotionPlanner,
) -> list[str]:
    """What is where a target shall go or near one, what nothing lies on first; at last the targets."""
    objects = estimate.objects
    covered = {name for name, obj in objects.items() if _lies_under_others(estimate, obj, planner)}
    crowd = [obj.name for obj in _crowd(unmet, estimate, planner)]
    nearby = [obj.name for obj in _nearby(unmet, estimate)]
    blocking = [name for goal in unmet for name in sorted(in_place[goal.object])]
    names = [name for name in (*blocking, *crowd, *nearby) if name not in covered]
    high = sorted(covered, key=lambda name: -float(objects[name].label_pose[2, 3]))
    targets = [goal.object for goal in unmet]
    return [*(n for n in dict.fromkeys((*names, *high)) if n not in targets), *targets]


def _covers(estimate: SceneEstimate, planner: MotionPlanner) -> list[str]:
    """What may hide something: of the largest crowd first, what nothing lies on before the rest, and what hides most."""
    left, crowds = dict(estimate.objects), []
    while left:
        crowd = [left.pop(next(iter(left)))]
        for obj in crowd:
            near = [name for name, other in left.items() if _gap(obj, other) < _CROWDED]
            crowd += [left.pop(name) for name in near]
        crowds.append(crowd)
    ranked = sorted(
        (
            -len(crowd),
            _lies_under_others(estimate, obj, planner),
            -_space_under(obj, estimate),
            obj.name,
        )
        for crowd in crowds
        for obj in crowd
    )
    return [name for *_, name in ranked]


def _space_under(obj: ObjectEstimate, estimate: SceneEstimate) -> float:
    """From the table to the top of the box around an object, itself included [m^3]."""
    middle, half = obj.box_around(estimate.scene, obj.label_pose[:3, :3])
    return float(4 * half[0] * half[1] * (obj.label_pose[2, 3] + middle[2] + half[2]))


def _crowd(
    unmet: list[PoseGoal], estimate: SceneEstimate, planner: MotionPlanner
) -> list[ObjectEstimate]:
    """What is close to a target, or close to what is, and so on."""
    crowd = [estimate.objects[goal.object] for goal in unmet]
    for obj in crowd:
        geoms = {geom for geom, _ in planner.scene.touching(obj.geoms, _CLOSE)}
        for other in estimate.objects.values():
            known = any(other is one for one in crowd)
            if not known and any(other.geoms[geom] for geom in geoms):
                crowd.append(other)
    return crowd


def _nearby(unmet: list[PoseGoal], estimate: SceneEstimate) -> list[ObjectEstimate]:
    """What may be in the hand's way to a target, the nearest first."""
    gaps = {}
    for goal in unmet:
        obj = estimate.objects[goal.object]
        for name, other in estimate.objects.items():
            gaps[name] = min(_gap(obj, other), gaps.get(name, np.inf))
    return [estimate.objects[n] for n in sorted(gaps, key=lambda n: gaps[n]) if gaps[n] < _CROWDED]


def _met(goal: PoseGoal, obj: ObjectEstimate, tolerance: Tolerance) -> bool:
    shift, turn = pose_error(obj.label_pose, goal.pose, obj.label.symmetry)
    return bool(shift < _MET[0] * tolerance.translation and turn < _MET[1] * tolerance.rotation)


def _lies_under_others(
    estimate: SceneEstimate, obj: ObjectEstimate, planner: MotionPlanner
) -> bool:
    """Whether another object lies on this one."""
    loose = np.any([other.geoms for other in estimate.objects.values()], axis=0)
    touching = planner.scene.touching(obj.geoms, _TOUCHING)
    return any(upwards > _ABOVE and loose[geom] for geom, upwards in touching)


def _in_place(goal: PoseGoal, estimate: SceneEstimate, planner: MotionPlanner) -> frozenset[str]:
    """What is where the goal wants its object."""
    obj = estimate.objects[goal.object]
    if is_free(planner, obj, goal.pose):
        return frozenset()
    return frozenset(
        name
        for name, other in estimate.objects.items()
        if name != goal.object
        and np.linalg.norm(other.label_pose[:2, 3] - goal.pose[:2, 3]) < radius(other) + radius(obj)
    )


def _gap(one: ObjectEstimate, other: ObjectEstimate) -> float:
    """Between the spheres about two objects [m]."""
    distance = np.linalg.norm(one.label_pose[:3, 3] - other.label_pose[:3, 3])
    return float(distance) - radius(one) - radius(other)
