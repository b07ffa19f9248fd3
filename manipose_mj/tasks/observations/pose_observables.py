"""The mode `pose`: where objects, handles, joint axes and goals are, and their symmetry.

Of each frame, by its name: `pose/NAME` is `T_world_frame`; `pose/robot/NAME` the same in the robot's
base frame; `pose/cameras/NAME` in each camera's as calibration states it (OpenCV's axes, in the order of the
configuration).
`pose/symmetry/NAME` holds the rotations of its symmetry group, `pose/symmetry_count/NAME` how
many of them count, `pose/axial/NAME` whether every turn about X belongs to the group as well.
`pose/bounds/NAME` are the lower and the upper corner of an object's bounding box in its frame [m].
`pose/counts/NAME` says of a goal whether its translation and whether its rotation counts.
`pose/opening_PART` is a joint's position. What an episode does not have is zeros, with a count of 0.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from dm_control import composer, mjcf
from dm_env import specs
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

from manipose_mj.errors import InputError, brief
from manipose_mj.mjcf.objects import ArticulatedObject
from manipose_mj.poses import SymmetryGroup, compose, invert
from manipose_mj.tasks.goals import GoalFrame
from manipose_mj.tasks.observations.declared import Declared, Read, bounded, unbounded
from manipose_mj.tasks.observations.fixed_error import FixedError
from manipose_mj.tasks.observations.frames import (
    PosedScene,
    furniture_frames,
    goal_frames,
    object_frame,
)
from manipose_mj.tasks.observations.sensor_config import PoseNoise
from manipose_mj.tasks.observations.step_cache import StepCache, step_number

log = logging.getLogger(__name__)

MAX_TURNS = 24  # members of a cube's group, the largest of our shapes that are not round


@dataclass(frozen=True)
class Slots:
    """Names of what a task may show; the same in every episode.

    Attributes:
      objects: As in the task's `objects`.
      goals: `goal` if an episode asks for the pose of one object at most, else `goal_` and the object.
      furniture: All pieces that an episode may show.

    Raises:
      InputError: Objects or goals are no names, or a goal is named otherwise.
    """

    objects: tuple[str, ...]
    goals: tuple[str, ...]
    furniture: tuple[ArticulatedObject, ...]

    def __post_init__(self) -> None:
        names: Any
        for what, names in (("observed_objects", self.objects), ("observed_goals", self.goals)):
            if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
                raise InputError(f"{what} is {brief(names)}; expected a tuple of names")
        known = [f"goal_{name}" for name in self.objects]
        for name in () if self.goals == ("goal",) else self.goals:
            if name not in known:
                raise InputError(
                    f"observed_goals names {name!r}; expected 'goal' alone, or {', '.join(known) or 'none'}"
                )


class PoseObservables:
    """Reads all poses of a moment at once, and hands them out one by one."""

    def __init__(
        self,
        scene: PosedScene,
        robot: composer.Entity,
        slots: Slots,
        cameras: Sequence[str],
        camera_pose: Callable[[mjcf.Physics, str], Float[np.ndarray, "4 4"]],
        noise: PoseNoise,
        error: FixedError,
    ) -> None:
        """Lays out the names.

        Args:
          scene: The task.
          robot: Whose frame is the robot's.
          slots: What there may be to see.
          cameras: In whose frames poses are given as well.
          camera_pose: `T_world_camera` as calibration states it.
          noise: Of what is not a goal.
          error: Of objects.
        """
        self._error, self._camera_pose = error, camera_pose
        self._scene, self._slots, self._cameras, self._noise = scene, slots, cameras, noise
        self._robot = mjcf.get_attachment_frame(robot.mjcf_model)
        parts = {**furniture_frames(slots.furniture), **scene.extra_frames}
        # Frames without a symmetry have no keys that speak of one.
        self._plain = {name for name, frame in parts.items() if frame.symmetry is None}
        self._names = (*slots.objects, *sorted(parts), *slots.goals)
        self._openings = tuple(
            sorted({part.name for piece in slots.furniture for part in piece.asset.parts})
        )
        self._cache = StepCache()
        self._bodies: FrameCarriers | None = None

    def observables(self) -> dict[str, Declared]:
        """Of every name; without the mode's prefix."""
        shown: dict[str, Declared] = {}

        def show(name: str, spec: specs.Array, read: Read) -> None:
            shown[name] = Declared(spec, read, self._started)

        shape = (len(self._cameras), 4, 4)
        for row, name in enumerate(self._names):
            show(name, unbounded((4, 4)), lambda p, i=row: self._poses(p)[0][i])
            show(f"robot/{name}", unbounded((4, 4)), lambda p, i=row: self._poses(p)[1][i])
            if self._cameras:
                show(f"cameras/{name}", unbounded(shape), lambda p, i=row: self._poses(p)[2][i])
        for name in self._names:
            if name in self._plain:
                continue
            turns = bounded((MAX_TURNS, 3, 3), np.float64, -1.0, 1.0)
            show(f"symmetry/{name}", turns, lambda p, n=name: self._symmetry(p, n)[0])
            count = bounded((1,), np.int32, 0, MAX_TURNS)
            show(f"symmetry_count/{name}", count, lambda p, n=name: self._symmetry(p, n)[1])
            axial = bounded((1,), np.int32, 0, 1)
            show(f"axial/{name}", axial, lambda p, n=name: self._symmetry(p, n)[2])
        for name in self._slots.objects:
            show(f"bounds/{name}", unbounded((2, 3)), lambda p, n=name: self._bounds(p, n))
        for name in self._slots.goals:
            counts = bounded((2,), np.int32, 0, 1)
            show(f"counts/{name}", counts, lambda p, n=name: self._counts(p, n))
        for part in self._openings:
            show(f"opening_{part}", unbounded((1,)), lambda p, n=part: [self._opening(p, n)])
        return shown

    def _started(self) -> bool:
        return self._scene.noise_seed is not None

    def forget(self) -> None:
        """An episode begins, or the state was changed from outside."""
        self._cache.forget()
        self._bodies = None

    def _poses(self, physics: mjcf.Physics) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self._cache.get(physics, "poses", lambda: self._measured(physics))

    def _measured(self, physics: mjcf.Physics) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """All poses in the world `(n, 4, 4)`, in the robot's frame, in the cameras' `(n, c, 4, 4)`."""
        bodies, data = self.carriers(physics), physics.data
        rotations = data.xmat[bodies.ids].reshape(-1, 3, 3)
        world = np.zeros((len(self._names), 4, 4))
        world_frames = compose(rotations, data.xpos[bodies.ids]) @ bodies.poses
        world[bodies.rows] = world_frames
        if self._error:
            self._perturb(world)
        if self._noise != PoseNoise():
            world[bodies.rows] = self._disturbed(physics, world)[bodies.rows]
        first_goal = len(self._names) - len(self._slots.goals)
        for row, goal in enumerate(self._slots.goals, start=first_goal):
            if goal in bodies.goals:
                world[row] = bodies.goals[goal].pose
        base = int(physics.bind(self._robot).element_id)
        T_world_base = compose(data.xmat[base].reshape(3, 3), data.xpos[base])
        robot = invert(T_world_base) @ world
        cameras = [invert(self._camera_pose(physics, name)) for name in self._cameras]
        seen = np.stack([T @ world for T in cameras], axis=1) if cameras else world[:, None][:, :0]
        return world, robot, seen

    def _perturb(self, world: Float[np.ndarray, "n 4 4"]) -> None:
        """Give objects their errors of this episode, in place."""
        assert self._scene.noise_seed is not None
        for name, entity in self._scene.objects.items():
            axial = entity.asset.label.symmetry.axial
            world[self._names.index(name)] @= self._error.drawn(
                self._scene.noise_seed, name, axial=axial
            )

    def _disturbed(
        self, physics: mjcf.Physics, poses: Float[np.ndarray, "n 4 4"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """The poses with errors that follow from the episode's seed and the time alone."""
        assert self._scene.noise_seed is not None
        rng = np.random.default_rng((self._scene.noise_seed, step_number(physics)))
        errors = rng.standard_normal((len(poses), 6))
        turns = Rotation.from_rotvec(errors[:, 3:] * self._noise.rotation).as_matrix()
        shifted = poses[:, :3, 3] + errors[:, :3] * self._noise.translation
        return compose(poses[:, :3, :3] @ turns, shifted)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all frames that there may be: objects, parts, then goals."""
        return self._names

    def carriers(self, physics: mjcf.Physics) -> FrameCarriers:
        """Which of the names this episode has, and what carries them."""
        if self._bodies is None:
            self._bodies = self._found(physics)
        return self._bodies

    def _found(self, physics: mjcf.Physics) -> FrameCarriers:
        scene, slots = self._scene, self._slots
        objects = scene.objects
        frames = furniture_frames(scene.articulated_objects)
        frames |= {name: object_frame(entity) for name, entity in objects.items()}
        frames |= scene.extra_frames
        asked = goal_frames(scene.goals, objects)
        goals = {f"goal_{name}": goal for name, goal in asked.items()}
        if slots.goals == ("goal",):
            goals = dict(zip(slots.goals, asked.values(), strict=False))
        if sum(name in slots.goals for name in goals) < len(asked):
            _warn_of_hidden(type(scene).__name__, tuple(asked), slots.goals)
        rows = [row for row, name in enumerate(self._names) if name in frames]
        present = [frames[self._names[row]] for row in rows]
        groups = {n: t.symmetry for n, t in frames.items() if t.symmetry is not None}
        groups |= {name: goal.symmetry for name, goal in goals.items()}
        return FrameCarriers(
            rows=np.array(rows, int),
            ids=np.array([int(physics.bind(t.body).element_id) for t in present], int),
            poses=np.stack([t.pose for t in present]) if present else np.zeros((0, 4, 4)),
            symmetries={name: padded_group(group, name) for name, group in groups.items()},
            bounds={name: entity.asset.label.bounds for name, entity in objects.items()},
            goals=goals,
            openings={
                part.name: int(np.asarray(physics.bind(piece.joint(part.name)).qposadr).item())
                for piece in scene.articulated_objects
                for part in piece.asset.parts
            },
        )

    def _symmetry(
        self, physics: mjcf.Physics, name: str
    ) -> tuple[Float[np.ndarray, "24 3 3"], list[int], list[bool]]:
        group = self.carriers(physics).symmetries.get(name)
        if group is None:
            return np.zeros((MAX_TURNS, 3, 3)), [0], [False]
        return group

    def _bounds(self, physics: mjcf.Physics, name: str) -> Float[np.ndarray, "2 3"]:
        return self.carriers(physics).bounds.get(name, np.zeros((2, 3)))

    def _counts(self, physics: mjcf.Physics, name: str) -> tuple[bool, bool]:
        goal = self.carriers(physics).goals.get(name)
        return (False, False) if goal is None else (goal.translation_counts, goal.rotation_counts)

    def _opening(self, physics: mjcf.Physics, part: str) -> float:
        """The joint's position [m or rad]; 0 for a part that the episode does not have."""
        address = self.carriers(physics).openings.get(part)
        return 0.0 if address is None else float(physics.data.qpos[address])


@cache
def _warn_of_hidden(task: str, asked: tuple[str, ...], shown: tuple[str, ...]) -> None:
    """Warn, once, of goal poses that a task asks for and no observation shows."""
    log.warning(
        "%s: goals ask for poses of %s, and observed_goals is %s: the others are not observed",
        task,
        ", ".join(asked),
        shown,
    )


@dataclass(frozen=True)
class FrameCarriers:
    """An episode's frames: `rows` among the names, body `ids`, `T_body_frame`; boxes of objects; its goals."""

    rows: Int[np.ndarray, "n"]
    ids: Int[np.ndarray, "n"]
    poses: Float[np.ndarray, "n 4 4"]
    symmetries: dict[str, tuple[np.ndarray, list[int], list[bool]]]
    bounds: dict[str, Float[np.ndarray, "2 3"]]
    goals: dict[str, GoalFrame]
    openings: dict[str, int]


def padded_group(
    group: SymmetryGroup, name: str
) -> tuple[Float[np.ndarray, "24 3 3"], list[int], list[bool]]:
    """A group's rotations padded with zeros, their number, and whether it is axial.

    Raises:
      InputError: It has too many.
    """
    count = len(group.rotations)
    if count > MAX_TURNS:
        raise InputError(
            f"{name}: its symmetry group has {count} rotations; observations hold {MAX_TURNS}"
        )
    turns = np.zeros((MAX_TURNS, 3, 3))
    turns[:count] = np.clip(group.rotations, -1.0, 1.0)
    return turns, [count], [group.axial]
