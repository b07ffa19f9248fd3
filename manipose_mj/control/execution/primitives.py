"""The three primitives: `grasp_at`, `move_to`, `release`. Everything is held by friction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from manipose_mj.control.execution.executor import Actions, Executor
from manipose_mj.control.execution.letting_go import let_go, retreat_from
from manipose_mj.control.execution.lifting import retraction_of
from manipose_mj.control.execution.part_lead import lead_part
from manipose_mj.control.execution.placing import place_held, placed_again
from manipose_mj.control.execution.slip import closed_past, exceeds, pose_in_hand, slip_of
from manipose_mj.control.grasping.handle_grasps import Push
from manipose_mj.control.grasping.object_push import leave_pushed, push_object
from manipose_mj.control.grasping.part_pick import (
    ending_free,
    is_a_stage,
    leads_enough,
    way_in_hand,
)
from manipose_mj.control.grasping.part_push import off_surface, push_part, reached_by
from manipose_mj.control.grasping.pick import ObjectPick, PartPick, pick_object, pick_part
from manipose_mj.control.grasping.retraction import lowering, transport_path
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.plan import Step
from manipose_mj.control.planning.plan_articulated import AJAR
from manipose_mj.control.scene.collision_query import GRAZING, CollisionQuery
from manipose_mj.control.scene.scene_estimate import PartEstimate, SceneEstimate
from manipose_mj.failures import StageFailure

# Past this the object in the hand is not where the grasp put it.
_LOST_DISTANCE, _LOST_ANGLE = 0.04, 0.6
# How much slip in the hand calls for a new descent, and how much forbids the old one [m, rad].
_SLIP, _BIG_SLIP = (0.002, 0.02), (0.01, 0.08)
# Of a part's joint from where it should have gone, as a share of its range.
_OPENING_TOLERANCE = 0.12
_PUSHED = 0.015  # what a push moves an object at least [m]
_PUSH_TOLERANCE = 0.02  # the same, from which on a push has nothing to do
_PUSHES = 2  # of a part
_STAGES = 6  # the same, where each may lead it less far than all the way
_AT_END = 0.1  # how far a push leads a door on that is at its end, at most [rad]
_IN_VAIN = 0.3  # of what a push should move a part by, under which it is not made again
# How far beyond where it should be shut, or open, a part is pushed whose place is estimated [m, rad].
_BEYOND_SHUT = {"slide": 0.010, "hinge": 0.03}
_BEYOND_OPEN = {"slide": 0.0, "hinge": 0.08}


@dataclass(frozen=True)
class _Held:
    """Attributes: name; pick: how it was taken; pose_tcp: `T_tcp_label` then (of a handle, for a part)."""

    name: str
    pick: ObjectPick | PartPick
    pose_tcp: Float[np.ndarray, "4 4"]


class Primitives:
    """Executes plan steps; each is a generator of actions and plans on what it observes.

    The planner that a primitive takes says what to assume; it plans in the scene of every new
    observation. Raises `StageFailure` where a step cannot be done.

    Attributes:
      in_stages: Whether parts may be pushed several times, each as far as a push leads, also where no grip comes first
        or the hand slipped off, and knobs are held deeper: a last resort.
    """

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._held: _Held | None = None
        # `T_tcp_label` of grasps that did not hold or led nowhere, and of those objects were last released from.
        self._slipped: dict[str, list[Float[np.ndarray, "4 4"]]] = {}
        self._released: dict[str, Float[np.ndarray, "4 4"]] = {}
        # Joint targets by which what is held was lifted, while it is still where they end.
        self._lifted: Float[np.ndarray, "t 7"] | None = None
        self._in_vain: dict[str, list[Push]] = {}  # pushes that hardly moved a part
        self.in_stages = False
        # Of parts: where the hand last led each by its handle from, and where to [m or rad].
        self._led: dict[str, tuple[float, float]] = {}
        # A part that is pushed on though the plan has it led by its handle.
        self._ungripped: str | None = None

    @property
    def held(self) -> str | None:
        """What is held."""
        return None if self._held is None else self._held.name

    def grasp_at(
        self, planner: MotionPlanner, name: str, destination: Step | None, thorough: bool = False
    ) -> Actions:
        """Take hold of an object, or of a part's handle, in a way that allows the next `move_to`.

        `thorough`: whether to look long for one.
        """
        estimate, planner = self._observe(planner)
        if name in estimate.parts:
            opening = None if destination is None else destination.opening
            part = estimate.parts[name]
            try:
                pick = pick_part(
                    planner,
                    estimate,
                    part,
                    opening,
                    in_stages=self.in_stages,
                    following=self._executor.feels_joints,
                )
            except StageFailure:
                if not self.in_stages or not _can_be_pushed_on(part, opening):
                    raise
                self._ungripped = name
                return
        else:
            poses = () if destination is None else destination.poses
            slipped = self._slipped.get(name, ())
            obj = estimate.objects[name]
            pick = pick_object(planner, estimate, obj, poses, slipped, thorough)
        yield from self._executor.open_to(pick.opening)
        yield from self._executor.follow(pick.free_path)
        yield from self._executor.follow(pick.approach)
        yield from self._executor.close()
        estimate = self._executor.observe()
        if closed_past(estimate, name, pick.width):
            if name in estimate.objects and estimate.objects[name].uncertainty > 0:
                self._slipped.setdefault(name, []).append(pose_in_hand(estimate, name))
            yield from let_go(self._executor, planner, name)
            raise StageFailure("grasp", f"the gripper closed past {name}")
        self._executor.hold(name)
        if name in estimate.parts:
            estimate = self._executor.observe()  # a handle is where the hand has it
        self._held = _Held(name, pick, pose_in_hand(estimate, name))

    def move_to(self, planner: MotionPlanner, step: Step, thorough: bool = False) -> Actions:
        """Bring what is held to its destination.

        `thorough`: whether to look long for a path.
        """
        if self._held is None and step.opening is not None:
            yield from self._push_part(planner, step.subject, step.opening)
        elif self._held is None:
            yield from self._push_object(planner, step)
        elif isinstance(self._held.pick, PartPick):
            yield from self._move_part(planner, step)
        else:
            yield from self._move_object(planner, step, self._held.pick, thorough)

    def release(self, planner: MotionPlanner, name: str) -> Actions:
        """Let go and back off along the approach."""
        held, self._held, self._lifted = self._held, None, None
        ungripped, self._ungripped = self._ungripped, None
        if held is None and name == ungripped:
            return
        if held is None:
            raise StageFailure("plan", f"release {name} while nothing is held")
        if not isinstance(held.pick, PartPick):
            self._released[name] = held.pose_tcp
        planner = planner.touching_support(held.pick.support_allowance)
        yield from let_go(self._executor, planner, name, close=held.pick.close)

    def avoid_last_grasps(self) -> None:
        """Objects were set down, and it did not do: take them another way next time."""
        for name, pose in self._released.items():
            self._slipped.setdefault(name, []).append(pose)
        self._released.clear()

    def put_back(self) -> Actions:
        """Set what was only lifted down where it was taken, and take it another way next time.

        Raises:
          StageFailure: It has been carried on, or nothing is held.
        """
        if self._held is None or self._lifted is None:
            raise StageFailure("plan", "nothing was only lifted")
        self._slipped.setdefault(self._held.name, []).append(self._held.pose_tcp)
        way, self._lifted = self._lifted[::-1], None
        yield from self._executor.follow(way)

    def lower(self, planner: MotionPlanner, name: str) -> Actions:
        """Take what is held straight down until it nearly meets something."""
        estimate, planner = self._observe(planner)
        line = lowering(planner, estimate.joints, estimate.in_hand(name))
        if line is not None:
            yield from self._executor.follow(line)

    def observe(self) -> SceneEstimate:
        """A fresh estimate."""
        return self._executor.observe()

    def _observe(self, planner: MotionPlanner) -> tuple[SceneEstimate, MotionPlanner]:
        """A new estimate, and the planner in its scene."""
        estimate = self._executor.observe()
        return estimate, planner.within(estimate.scene)

    def _move_object(
        self, planner: MotionPlanner, step: Step, pick: ObjectPick, thorough: bool
    ) -> Actions:
        name = step.subject
        planner = planner.touching_support(pick.support_allowance)
        estimate, planner = self._observe(planner)
        lifted = retraction_of(planner, estimate, name)
        yield from self._executor.follow(lifted)
        self._lifted = lifted if self._lifted is None else np.concatenate([self._lifted, lifted])
        # Things turn a little in the hand when their weight comes on it: measure, then plan.
        estimate, planner = self._observe(planner)
        pose_tcp = self._check_held(estimate, name)
        place = place_held(planner, estimate, step, pose_tcp, pick.goal)
        if place is None and self._held is not None:
            # What hangs down in the hand turns back as it meets the table.
            place = place_held(planner, estimate, step, self._held.pose_tcp, pick.goal)
        if place is None:
            raise StageFailure("plan", f"no way to set {name} down where it should go")
        attached = estimate.in_hand(name)
        free = transport_path(
            planner, estimate.joints, place.above, attached, pressed=True, patient=thorough
        )
        if free is None:
            raise StageFailure("plan", f"no path for {name} to where it should go")
        self._lifted = None
        yield from self._executor.follow(free)
        estimate, planner = self._observe(planner)
        now = self._check_held(estimate, name)
        slip = slip_of(estimate, name, now, pose_tcp)
        if exceeds(slip, _SLIP):
            again = placed_again(planner, estimate, step, now)
            if again is not None:
                free, place = again
                yield from self._executor.follow(free)
            elif exceeds(slip, _BIG_SLIP):
                raise StageFailure("plan", f"{name} slipped, no way to set it down as it is now")
        yield from self._executor.follow(place.descent)

    def _move_part(self, planner: MotionPlanner, step: Step) -> Actions:
        """As far as the hand on the handle can lead it: a push may do the rest."""
        assert step.opening is not None and self._held is not None
        estimate, planner = self._observe(planner)
        part = estimate.parts[step.subject]
        self._led[part.name] = (part.opening, step.opening)
        self._check_held(estimate, step.subject)
        if self._executor.feels_joints:
            yield from lead_part(self._executor, planner, step.subject, step.opening)
            self._held = replace(
                self._held, pose_tcp=pose_in_hand(self._executor.observe(), step.subject)
            )
            return
        way = way_in_hand(planner, estimate, part, step.opening)
        way = None if way is None else ending_free(planner, part, way)
        if way is None or not (leads_enough(way, part, step.opening) or is_a_stage(way, part)):
            raise StageFailure("plan", f"the arm cannot carry {part.name} far by its handle")
        yield from self._executor.follow(way.targets(self._executor.timestep))
        moved = self._executor.observe().parts[part.name].opening
        low, high = part.joint.range
        now = replace(part, opening=moved)
        if self.in_stages and _can_be_pushed_on(now, step.opening):
            return
        if abs(moved - way.openings[-1]) > _OPENING_TOLERANCE * (high - low):
            raise StageFailure(
                "motion",
                f"{part.name} is at {moved:.3f}, the hand should have it at {way.openings[-1]:.3f}",
            )
        if part.joint.kind == "slide" and not leads_enough(way, part, step.opening):
            raise StageFailure(
                "motion", f"{part.name} is at {moved:.3f}, the arm takes it no further"
            )

    def _push_part(self, planner: MotionPlanner, name: str, opening: float) -> Actions:
        """With closed fingers; nothing to do where the part is there already.

        A hand that leaves may drag the part along: it is pushed once more.
        """
        part = self._executor.observe().parts[name]
        span = float(np.ptp(part.joint.range))
        for _ in range(_STAGES if self.in_stages else _PUSHES):
            if abs(part.opening - opening) < _PUSH_TOLERANCE * span:
                return
            led = self.in_stages or self._executor.feels_joints
            if led and self._led_beyond(part, opening):
                return
            before = part.opening
            try:
                yield from self._push_once(planner, name, opening)
            except StageFailure:
                if not part.goes_on or opening < before:
                    raise
                part = self._executor.observe().parts[name]
                self._executor.pushed(name, part.opening)  # as open as anybody can tell
                return
            part = self._executor.observe().parts[name]
            # An estimated part is sent beyond: it need not come back.
            beyond = (part.opening - opening) * (opening - before) > 0
            if beyond and self._executor.feels_joints:
                return
        if abs(part.opening - opening) > _OPENING_TOLERANCE * span:
            raise StageFailure(
                "motion", f"{name} is at {part.opening:.3f}, should be at {opening:.3f}"
            )

    def _led_beyond(self, part: PartEstimate, opening: float) -> bool:
        """Whether the hand has led a part there and on: it need not come back."""
        start, end = self._led.get(part.name, (opening, opening))
        return end == opening and (part.opening - opening) * (opening - start) > 0

    def _push_once(self, planner: MotionPlanner, name: str, opening: float) -> Actions:
        yield from self._executor.close()
        estimate, planner = self._observe(planner)
        part = estimate.parts[name]
        aim = opening
        if self._executor.feels_joints:
            beyond = _BEYOND_SHUT if opening <= part.joint.range[0] else _BEYOND_OPEN
            aim += np.sign(opening - part.opening) * beyond[part.joint.kind]
        in_vain = self._in_vain.get(name, ())
        # Where nobody knows how far it goes, any way will do.
        stages = self.in_stages or part.goes_on
        push = push_part(planner, estimate, part, aim, in_vain, in_stages=stages)
        yield from self._executor.follow(push.free_path)
        yield from self._executor.follow(push.approach)
        yield from self._executor.follow(push.way.targets(self._executor.timestep))
        reached, blocked = reached_by(push.way, self._executor.joints())
        # Where the hand goes no further at once, a door that was led as far as is usual is at its end.
        opens = part.goes_on and opening > part.opening
        at_end = blocked and opens and reached - part.opening < _AT_END
        self._executor.pushed(name, part.opening if at_end else reached)
        estimate, planner = self._observe(planner)
        gone = abs(estimate.parts[name].opening - part.opening)
        meant = min(abs(opening - part.opening), abs(push.way.openings[-1] - part.opening))
        if gone < _IN_VAIN * meant and isinstance(push.way.hold, Push):
            self._in_vain.setdefault(name, []).append(push.way.hold)
        back = off_surface(planner, estimate.parts[name], push.way, estimate.joints)
        if back is not None:
            yield from self._executor.follow(back)
        # Fingers that caught on something are still there.
        estimate, planner = self._observe(planner)
        if not planner.collides(estimate.joints, CollisionQuery(GRAZING)):
            return
        try:
            yield from self._executor.follow(retreat_from(planner, estimate, name))
        except StageFailure:
            # Back as the hand came: the part does not follow it.
            yield from self._executor.follow(push.way.targets(self._executor.timestep)[::-1])
            yield from self._executor.follow(push.approach[::-1])

    def _push_object(self, planner: MotionPlanner, step: Step) -> Actions:
        """With closed fingers, over the table, then up."""
        name = step.subject
        estimate, planner = self._observe(planner)
        obj = estimate.objects[name]
        push = push_object(planner, estimate, obj, step.poses)
        if push is None:
            raise StageFailure("plan", f"no way to push {name}")
        yield from self._executor.close()
        for targets in (push.free_path, push.down, push.along):
            yield from self._executor.follow(targets)
        estimate, planner = self._observe(planner)
        moved = estimate.objects[name].label_pose[:2, 3] - obj.label_pose[:2, 3]
        hand = planner.tcp_pose(push.along[-1])[:2, 3] - planner.tcp_pose(push.along[0])[:2, 3]
        back = leave_pushed(planner, estimate.joints, estimate.objects[name], hand)
        if back is None:
            raise StageFailure("release", f"no way to leave {name} after a push")
        yield from self._executor.follow(back)
        if float(np.linalg.norm(moved)) < _PUSHED:
            raise StageFailure("motion", f"{name} did not move when it was pushed")

    def _check_held(self, estimate: SceneEstimate, name: str) -> Float[np.ndarray, "4 4"]:
        """`T_tcp_label` now.

        Raises:
          StageFailure: It is no longer where the grasp had it.
        """
        assert self._held is not None
        now, then = pose_in_hand(estimate, name), self._held.pose_tcp
        moved, turned = slip_of(estimate, name, now, then)
        # A handle may slide along its bar and turn about it; what counts there is the joint.
        is_part = name in estimate.parts
        if moved > _LOST_DISTANCE or (turned > _LOST_ANGLE and not is_part):
            # Where the hand held it before it slipped.
            self._slipped.setdefault(name, []).append(then)
            raise StageFailure(
                "grasp", f"lost hold of {name}: it moved {moved * 100:.1f} cm in the hand"
            )
        return now


def _can_be_pushed_on(part: PartEstimate, opening: float | None) -> bool:
    """Whether it is a door, wide enough open to be pushed open further from inside."""
    ajar = part.joint.kind == "hinge" and part.opening > part.joint.range[0] + AJAR
    return ajar and opening is not None and opening > part.opening
