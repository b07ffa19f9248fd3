"""What every plan must keep, whoever made it: things exist, and each step finds what it needs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from manipose_mj.control.planning.plan import Plan, Step
from manipose_mj.control.scene.articulation import joint_motion
from manipose_mj.control.scene.scene_estimate import PartEstimate, SceneEstimate
from manipose_mj.errors import InputError
from manipose_mj.poses import invert

# Of a part's range, from which on the hand gets through.
OPEN_ENOUGH = 0.5
# What a push along the table leaves of an object's height [m] and of the vertical's cosine.
_SAME_HEIGHT, _SAME_TILT = 0.03, 0.98
_SLACK = 1e-3  # of a joint beyond its range [m or rad]


class PlanState:
    """What is open, held and where, as far as a plan has gone.

    Attributes:
      openings: Of every part [m or rad].
      places: `T_world_label` of every object, in a set of which any may be true.
      held: What the hand holds, or None.
    """

    def __init__(self, estimate: SceneEstimate) -> None:
        """Before the first step, with an empty hand."""
        self._estimate = estimate
        self.parts = estimate.parts
        self.openings = {name: part.opening for name, part in estimate.parts.items()}
        self.places: dict[str, tuple[Float[np.ndarray, "4 4"], ...]] = {
            name: (obj.label_pose,) for name, obj in estimate.objects.items()
        }
        self.held: str | None = None

    def is_open(self, name: str) -> bool:
        """Whether the hand gets into a drawer or through a door."""
        low, high = self.parts[name].joint.range
        return self.openings[name] >= low + OPEN_ENOUGH * (high - low)

    def as_estimate(self) -> SceneEstimate:
        """The scene as it is then; what may be at several places is at the first."""
        objects = {
            name: replace(obj, pose=self.places[name][0] @ invert(obj.label.pose))
            for name, obj in self._estimate.objects.items()
        }
        parts = {
            name: replace(
                part,
                opening=self.openings[name],
                pose=part.base_pose @ joint_motion(part, self.openings[name]),
            )
            for name, part in self.parts.items()
        }
        return replace(self._estimate, objects=objects, parts=parts)

    def part_around(self, label_pose: Float[np.ndarray, "4 4"]) -> str | None:
        """The drawer or door in whose cavity an object at `T_world_label` is, or None."""
        for name, part in self.parts.items():
            if in_cavity(part, self.openings[name], label_pose):
                return name
        return None

    def carry_out(self, step: Step, where: str) -> None:
        """Go on by one step.

        Raises:
          InputError: The step does not find what it needs.
        """
        if step.subject not in self.parts and step.subject not in self.places:
            known = ", ".join(sorted({*self.parts, *self.places}))
            raise InputError(f"{where}: there is no {step.subject}; expected one of {known}")
        {"grasp_at": self._grasp, "move_to": self._move, "release": self._release}[step.primitive](
            step, where
        )

    def _grasp(self, step: Step, where: str) -> None:
        if self.held is not None:
            raise InputError(f"{where}: grasp_at {step.subject}: the hand holds {self.held}")
        if step.subject in self.places:
            around = self.part_around(self.places[step.subject][0])
            if around is not None and not self.is_open(around):
                raise InputError(
                    f"{where}: grasp_at {step.subject}: it is inside {around}, which is not open then"
                )
        self.held = step.subject

    def _move(self, step: Step, where: str) -> None:
        if self.held not in (None, step.subject):
            raise InputError(f"{where}: move_to {step.subject}: the hand holds {self.held}")
        if step.subject in self.parts:
            self._move_part(step, where)
        else:
            self._move_object(step, where)

    def _move_part(self, step: Step, where: str) -> None:
        if step.opening is None:
            raise InputError(f"{where}: move_to {step.subject}: a part moves to an 'opening'")
        low, high = self.parts[step.subject].joint.range
        if not low - _SLACK <= step.opening <= high + _SLACK:
            raise InputError(
                f"{where}: move_to {step.subject}: opening {step.opening:g} is outside {low:g} to {high:g}"
            )
        pulls = step.opening > self.openings[step.subject]
        slides = self.parts[step.subject].joint.kind == "slide"
        ajar = self.openings[step.subject] > low + 0.05 * (high - low)
        if self.held is None and pulls and (slides or not ajar):
            raise InputError(
                f"{where}: move_to {step.subject}: only a hand on its handle can open it; grasp it before"
            )
        self._carry_along(self.parts[step.subject], step.opening)
        self.openings[step.subject] = step.opening

    def _carry_along(self, part: PartEstimate, opening: float) -> None:
        """Move what lies in a drawer with it."""
        if part.cavity is None or not part.cavity.moves_with_part:
            return
        now = self.openings[part.name]
        turned = joint_motion(part, opening) @ invert(joint_motion(part, now))
        motion = part.base_pose @ turned @ invert(part.base_pose)
        for name, poses in self.places.items():
            if name != self.held and in_cavity(part, now, poses[0]):
                self.places[name] = tuple(motion @ pose for pose in poses)

    def _move_object(self, step: Step, where: str) -> None:
        if not step.poses:
            raise InputError(f"{where}: move_to {step.subject}: an object moves to 'poses'")
        if self.held is None:
            was, to = self.places[step.subject][0], step.poses[0]
            tilted = float(was[2, :3] @ to[2, :3]) < _SAME_TILT
            if tilted or abs(float(was[2, 3] - to[2, 3])) > _SAME_HEIGHT:
                raise InputError(
                    f"{where}: move_to {step.subject}: it is not held, and a push only slides it; grasp it before"
                )
        around = self.part_around(step.poses[0])
        if around is not None and not self.is_open(around):
            raise InputError(
                f"{where}: move_to {step.subject}: the place is inside {around}, which is not open then"
            )
        self.places[step.subject] = step.poses

    def _release(self, step: Step, where: str) -> None:
        if self.held != step.subject:
            holds = "nothing" if self.held is None else self.held
            raise InputError(f"{where}: release {step.subject}: the hand holds {holds}")
        self.held = None


def check_plan(plan: Plan, estimate: SceneEstimate) -> None:
    """Follow a plan without moving anything.

    Args:
      plan: Its steps.
      estimate: What is where before the first; the hand is empty.

    Raises:
      InputError: A step is about something that is not there, or does not find what it needs; one line.
    """
    state = PlanState(estimate)
    for i, step in enumerate(plan):
        state.carry_out(step, f"plan[{i}]")
    if state.held is not None:
        raise InputError(f"plan: it ends with {state.held} in the hand; release it")


def in_cavity(part: PartEstimate, opening: float, label_pose: Float[np.ndarray, "4 4"]) -> bool:
    """Whether an object with its label at `T_world_label` is in the part's cavity, the part at `opening`."""
    if part.cavity is None:
        return False
    carrier = part.base_pose
    if part.cavity.moves_with_part:
        carrier = part.base_pose @ joint_motion(part, opening)
    place = (invert(carrier) @ label_pose)[:3, 3] - part.cavity.center
    return bool((np.abs(place) < part.cavity.extents / 2).all())
