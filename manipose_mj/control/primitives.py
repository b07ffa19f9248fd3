"""The three primitives: `grasp_at`, `move_to`, `release`. Everything is held by friction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from manipose_mj.control.belief import Belief, PartBelief
from manipose_mj.control.cavity_mouth import way_out
from manipose_mj.control.executor import Actions, Executor
from manipose_mj.control.failure import StageFailure
from manipose_mj.control.grasp_candidates import OPENING_MARGIN
from manipose_mj.control.lifting import Place, ascents, carrying_path, find_place
from manipose_mj.control.motion_planner import HANDLE_RETREATS, RETREATS, MotionPlanner
from manipose_mj.control.part_pick import (
    MIN_SHARE,
    ending_free,
    off_surface,
    push_part,
    share_of,
    way_in_hand,
)
from manipose_mj.control.pick import ObjectPick, PartPick, pick_object, pick_part
from manipose_mj.control.plan import Step
from manipose_mj.control.planning_scene import CONTACT, TRANSIT, Carried
from manipose_mj.mjcf.panda import MAX_OPENING
from manipose_mj.poses import invert, rotation_angle

# Past this the thing in the hand is not where the grasp put it.
_LOST_DISTANCE = 0.04
_LOST_ANGLE = 0.6
# How much slip in the hand calls for a new descent, and how much forbids the old one [m, rad].
_SLIP = (0.002, 0.02)
_BIG_SLIP = (0.01, 0.08)
# Of a part's joint from where it should have gone, as a share of its range.
_OPENING_TOLERANCE = 0.12
_PUSH_TOLERANCE = 0.02  # the same, from which on a push has nothing to do
_SETTLE = 0.25  # after letting go [s]


@dataclass(frozen=True)
class _Held:
    """Attributes: name; pick: how it was taken; pose_tcp: `T_tcp_label` then (of a handle, for a part)."""

    name: str
    pick: ObjectPick | PartPick
    pose_tcp: Float[np.ndarray, "4 4"]


class Primitives:
    """Executes plan steps; each is a generator of actions and plans from a fresh belief.

    Raises `StageFailure` where a step cannot be done.
    """

    def __init__(self, executor: Executor, planner: MotionPlanner) -> None:
        self._executor = executor
        self._planner = planner
        self._held: _Held | None = None

    @property
    def held(self) -> str | None:
        """What is held."""
        return None if self._held is None else self._held.name

    def grasp_at(self, name: str, destination: Step | None) -> Actions:
        """Take hold of an object, or of a part's handle, in a way that allows the next `move_to`."""
        belief = self._executor.perceive()
        if name in belief.parts:
            opening = None if destination is None else destination.opening
            pick = pick_part(self._planner, belief, belief.parts[name], opening)
        else:
            poses = () if destination is None else destination.poses
            pick = pick_object(self._planner, belief, belief.objects[name], poses)
        yield from self._executor.open_to(pick.opening)
        yield from self._executor.follow(pick.free_path)
        yield from self._executor.follow(pick.approach)
        yield from self._executor.close()
        belief = self._executor.perceive()
        if belief.opening < min(0.5 * pick.width, pick.width - 0.004):
            yield from self._let_go(name)
            raise StageFailure("grasp", f"the gripper closed past {name}")
        self._executor.hold(name)
        self._held = _Held(name, pick, self._pose_in_hand(belief, name))

    def move_to(self, step: Step) -> Actions:
        """Bring what is held to its destination."""
        if self._held is None and step.opening is not None:
            yield from self._push_part(step.subject, step.opening)
        elif self._held is None:
            raise StageFailure("plan", f"move_to {step.subject} while nothing is held")
        elif isinstance(self._held.pick, PartPick):
            yield from self._move_part(step, self._held.pick)
        else:
            yield from self._move_object(step, self._held.pick)

    def release(self, name: str) -> Actions:
        """Let go and back off along the approach."""
        held, self._held = self._held, None
        if held is None:
            raise StageFailure("plan", f"release {name} while nothing is held")
        yield from self._let_go(name)

    def _let_go(self, name: str) -> Actions:
        belief = self._executor.perceive()
        opening = min(belief.opening + OPENING_MARGIN, MAX_OPENING)
        yield from self._executor.open_to(opening)
        yield from self._executor.wait(_SETTLE)
        self._executor.hold(None)
        belief = self._executor.perceive()
        yield from self._executor.follow(self._retreat(belief, name))

    def _retreat(self, belief: Belief, name: str) -> Float[np.ndarray, "t 7"]:
        thing = belief.parts.get(name) or belief.objects[name]
        clearance = replace(CONTACT, arm=0.0)
        found = None
        for distance in HANDLE_RETREATS if name in belief.parts else RETREATS:
            line = self._planner.line(
                belief.joints,
                self._planner.backed_off(belief.joints, distance),
                clearance=clearance,
                target=thing.geoms,
                touched=frozenset({self._planner.body_name(thing.body)}),
            )
            # Where the next motion starts there should be room for it.
            if line is not None and not self._planner.collides(line[-1], clearance=TRANSIT):
                return line
            found = line if found is None else found
        if found is None:
            raise StageFailure("release", f"no way to back off from {name}")
        return found

    def _move_object(self, step: Step, pick: ObjectPick) -> Actions:
        name = step.subject
        yield from self._executor.follow(self._lift(name))
        # Things turn a little in the hand when their weight comes on it: measure, then plan.
        belief = self._executor.perceive()
        pose_tcp = self._check_held(belief, name)
        thing, carried = belief.objects[name], self._carried(belief, name)
        way = way_out(belief, step.poses[0][:3, 3])
        place = find_place(
            self._planner, pose_tcp, step.poses, thing.label.symmetry, carried, pick.goal, way
        )
        if place is None:
            raise StageFailure("plan", f"no way to set {name} down where it should go")
        free = carrying_path(self._planner, belief.joints, place.above, carried)
        if free is None:
            raise StageFailure("plan", f"no path for {name} to where it should go")
        yield from self._executor.follow(free)
        belief = self._executor.perceive()
        now = self._check_held(belief, name)
        if _moved(pose_tcp, now, _SLIP):
            again = self._placed_again(belief, name, step, now)
            if again is not None:
                free, place = again
                yield from self._executor.follow(free)
            elif _moved(pose_tcp, now, _BIG_SLIP):
                raise StageFailure("plan", f"{name} slipped, no way to set it down as it is now")
        yield from self._executor.follow(place.descent)

    def _placed_again(
        self, belief: Belief, name: str, step: Step, pose_tcp: Float[np.ndarray, "4 4"]
    ) -> tuple[Float[np.ndarray, "t 7"], Place] | None:
        """A short path and a descent for the thing as it lies in the hand now."""
        carried = self._carried(belief, name)
        symmetry = belief.objects[name].label.symmetry
        way = way_out(belief, step.poses[0][:3, 3])
        place = find_place(
            self._planner, pose_tcp, step.poses, symmetry, carried, belief.joints, way
        )
        if place is None:
            return None
        free = self._planner.free_path(belief.joints, place.above, carried=carried)
        return None if free is None else (free, place)

    def _lift(self, name: str) -> Float[np.ndarray, "t 7"]:
        belief = self._executor.perceive()
        carried = self._carried(belief, name)
        way = way_out(belief, belief.objects[name].label_pose[:3, 3])
        for lift in ascents(self._planner, belief.joints, carried, way):
            return lift
        raise StageFailure("plan", f"no way to lift {name}")

    def _carried(self, belief: Belief, name: str) -> Carried:
        return self._planner.held_at(belief.objects[name], self._planner.tcp_pose(belief.joints))

    def _move_part(self, step: Step, pick: PartPick) -> Actions:
        assert step.opening is not None
        belief = self._executor.perceive()
        part = belief.parts[step.subject]
        self._check_held(belief, step.subject)
        yield from self._lead_part(belief, part, step.opening)

    def _lead_part(self, belief: Belief, part: PartBelief, opening: float) -> Actions:
        """As far as the hand on the handle can lead it: a push may do the rest."""
        way = way_in_hand(self._planner, belief, part, opening)
        way = None if way is None else ending_free(self._planner, part, way)
        if way is None or share_of(way, part, opening) < MIN_SHARE[part.joint.kind]:
            raise StageFailure("plan", f"the arm cannot carry {part.name} far by its handle")
        yield from self._executor.follow(way.targets(self._executor.timestep))
        moved = self._executor.perceive().parts[part.name].opening
        low, high = part.joint.range
        if abs(moved - way.openings[-1]) > _OPENING_TOLERANCE * (high - low):
            raise StageFailure(
                "motion",
                f"{part.name} is at {moved:.3f}, the hand should have it at {way.openings[-1]:.3f}",
            )

    def _push_part(self, name: str, opening: float) -> Actions:
        """With closed fingers; nothing to do where the part is there already."""
        part = self._executor.perceive().parts[name]
        low, high = part.joint.range
        if abs(part.opening - opening) < _PUSH_TOLERANCE * (high - low):
            return
        yield from self._executor.close()
        belief = self._executor.perceive()
        push = push_part(self._planner, belief, belief.parts[name], opening)
        yield from self._executor.follow(push.free_path)
        yield from self._executor.follow(push.approach)
        yield from self._executor.follow(push.way.targets(self._executor.timestep))
        belief = self._executor.perceive()
        back = off_surface(self._planner, belief.parts[name], push.way, belief.joints)
        if back is not None:
            yield from self._executor.follow(back)
        moved = belief.parts[name].opening
        if abs(moved - opening) > _OPENING_TOLERANCE * (high - low):
            raise StageFailure("motion", f"{name} is at {moved:.3f}, should be at {opening:.3f}")

    def _pose_in_hand(self, belief: Belief, name: str) -> Float[np.ndarray, "4 4"]:
        part: PartBelief | None = belief.parts.get(name)
        pose = belief.objects[name].label_pose if part is None else part.handle_pose
        return invert(self._planner.tcp_pose(belief.joints)) @ pose

    def _check_held(self, belief: Belief, name: str) -> Float[np.ndarray, "4 4"]:
        """`T_tcp_label` now.

        Raises:
          StageFailure: It is no longer where the grasp had it.
        """
        assert self._held is not None
        now, then = self._pose_in_hand(belief, name), self._held.pose_tcp
        moved = float(np.linalg.norm(now[:3, 3] - then[:3, 3]))
        turned = float(rotation_angle(now[:3, :3], then[:3, :3]))
        # A handle may slide along its bar and turn about it; what counts there is the joint.
        is_part = name in belief.parts
        if moved > _LOST_DISTANCE or (turned > _LOST_ANGLE and not is_part):
            raise StageFailure(
                "grasp", f"lost hold of {name}: it moved {moved * 100:.1f} cm in the hand"
            )
        return now


def _moved(
    a: Float[np.ndarray, "4 4"], b: Float[np.ndarray, "4 4"], limit: tuple[float, float]
) -> bool:
    """Whether a thing has slipped in the hand by more than a distance [m] or an angle [rad]."""
    shift = float(np.linalg.norm(a[:3, 3] - b[:3, 3]))
    return shift > limit[0] or float(rotation_angle(a[:3, :3], b[:3, :3])) > limit[1]
