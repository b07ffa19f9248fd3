"""A perception whose object poses are made wrong on purpose, to measure what an error costs.

Errors follow from the seed of the episode's sensors; the planner sees the wrong poses only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import StablePose
from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.perception.pose_sensing import EstimatedPose
from manipose_mj.control.perception.protocol import Perception
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.poses import compose, invert, rotation_about
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.observations.fixed_error import FixedError

_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class PosePerturbation:
    """What is wrong with the poses of objects that a baseline acts on.

    Attributes:
      error: Of each object's pose, the same throughout an episode.
      upright: Every object that is not in the hand is taken to stand upright, where it is and with the
        heading it has: a baseline that knows no orientation but that.
    """

    error: FixedError = FixedError()
    upright: bool = False

    def __bool__(self) -> bool:
        return bool(self.error) or self.upright


UNPERTURBED = PosePerturbation()


class PerturbedPerception:
    """Another perception, with errors.

    Attributes:
      sources: As the other perception has them.
      feels_joints: The same.
      last_estimates: The wrong poses of the last observation.
    """

    def __init__(
        self, perception: Perception, task: ManipulationTask, errors: PosePerturbation
    ) -> None:
        self._perception, self._task, self._errors = perception, task, errors
        self._held: str | None = None
        self._wrong: dict[str, Float[np.ndarray, "4 4"]] = {}
        self.sources: Mapping[str, str] = perception.sources
        self.feels_joints = perception.feels_joints
        self.looks_by_hand = perception.looks_by_hand
        self.last_estimates: tuple[EstimatedPose, ...] = ()

    @property
    def unseen(self) -> frozenset[str]:
        """Objects of goals that nothing has shown yet."""
        return self._perception.unseen

    @property
    def held_name(self) -> str:
        """What is in the hand; empty: nothing."""
        return self._held or ""

    @property
    def arm(self) -> ArmModel:
        """The arm in the scene of the last observation."""
        return self._perception.arm

    def feel(self, name: str, path: Float[np.ndarray, "n 4 4"], stopped: bool) -> None:
        """The hand led a part along this path, world frame [m]; `stopped`: it went no further."""
        self._perception.feel(name, path, stopped)

    def pushed(self, name: str, opening: float) -> None:
        """The hand pushed a part to about this opening [m or rad]."""
        self._perception.pushed(name, opening)

    def look_around(self) -> None:
        """Between two plans: look for what others may have hidden, and anew at what is uncertain."""
        self._perception.look_around()

    def look_again(self) -> None:
        """Look at what was opened, and into it; what is found gets an error of its own."""
        self._perception.look_again()

    def look_closely(self) -> None:
        """Look through the hand's camera too."""
        self._perception.look_closely()

    def reset(self, seed: int, *, for_goals: bool = True) -> None:
        """Start an episode; errors follow from the seed of its sensors, whatever `seed` is."""
        self._perception.reset(seed, for_goals=for_goals)
        self._held, self._wrong = None, {}

    def robot(self) -> tuple[Float[np.ndarray, "7"], float]:
        """Joint angles [rad] and opening [m], true."""
        return self._perception.robot()

    def hold(self, name: str | None) -> None:
        """The hand holds this from now on; its error stays what it was."""
        self._held = name
        self._perception.hold(name)

    def observe(self) -> SceneEstimate:
        """The scene with its objects where they are not."""
        estimate = self._perception.observe()
        scene, objects = estimate.scene, {}
        for name, obj in estimate.objects.items():
            if name != self._held or name not in self._wrong:
                self._wrong[name] = self._error_of(obj)
            pose = obj.label_pose @ self._wrong[name] @ invert(obj.label.pose)
            objects[name] = replace(obj, pose=pose)
            scene = scene.with_body_at(obj.body, pose)
        confidences = {e.name: e for e in getattr(self._perception, "last_estimates", ())}
        self.last_estimates = tuple(
            replace(confidences[name], pose=obj.label_pose)
            if name in confidences
            else EstimatedPose(name, obj.label_pose, 1.0, "none")
            for name, obj in objects.items()
        )
        return replace(estimate, objects=objects, scene=scene)

    def _error_of(self, obj: ObjectEstimate) -> Float[np.ndarray, "4 4"]:
        """`T_true_wrong` of the label."""
        assert self._task.noise_seed is not None
        axial = obj.label.symmetry.axial
        error = self._errors.error.drawn(self._task.noise_seed, obj.name, axial=axial)
        if not self._errors.upright:
            return error
        return invert(obj.label_pose) @ standing(obj) @ error


def standing(obj: ObjectEstimate) -> Float[np.ndarray, "4 4"]:
    """`T_world_label` of an object that stands upright where it is, as low as it lies.

    The heading is the one next to the true pose. What has no upright, a box or a tool, lies as it is
    most likely to.
    """
    own, label = obj.label_pose, obj.label
    if not obj.rests:
        return own
    upright = _upright(obj).rotation @ label.rotation
    turned = own[:3, :3] @ upright.T
    heading = float(np.arctan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1]))
    rotation = rotation_about(_UP, heading) @ upright
    middle = own[:3, 3] + own[:3, :3] @ label.center
    middle[2] += label.reach(rotation)[2] - label.reach(own[:3, :3])[2]
    return compose(rotation, middle - rotation @ label.center)


def _upright(obj: ObjectEstimate) -> StablePose:
    """The rest pose in which label X points up, of labels that say what is up; else the likeliest."""
    label = obj.label
    either_way = (label.symmetry.rotations[:, 0, 0] < -0.5).any()
    if label.object_type == "axial" or (label.object_type == "mirror" and not either_way):
        return max(obj.rests, key=lambda rest: float((rest.rotation @ label.rotation)[2, 0]))
    return max(obj.rests, key=lambda rest: rest.probability)
