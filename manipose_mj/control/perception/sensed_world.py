"""A world made of what cameras see: the robot as it is known, furniture and surroundings from clouds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float

from manipose_mj.control.furniture.estimated_furniture import EstimatedFurniture
from manipose_mj.control.furniture.sensing.part_sensing import PartSensor, sense_parts
from manipose_mj.control.furniture.sensing.scene_cloud import SceneViews
from manipose_mj.control.furniture.shapes.boxes import Boxes, no_boxes
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel
from manipose_mj.control.furniture.surroundings import surrounding_boxes
from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.perception.estimated_scene import PREFIX, add_object, without_looks
from manipose_mj.control.perception.worlds import Hulls, Poses
from manipose_mj.control.scene.collision_model import CollisionModel, ScenePositions, subtree_geoms
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, PartEstimate
from manipose_mj.mjcf.panda.robot import Panda
from manipose_mj.poses import invert, pose_to_vector
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.instructions.sentence import asked_parts

_ROBOT = "panda"
_BASE = f"{PREFIX}furniture"
_IN_DRAWER = 0.01  # beyond its cavity, which is an estimate [m]


class SensedWorld:
    """Furniture and surroundings as clouds show them."""

    source = "estimated"
    feels_joints = True

    def __init__(
        self,
        task: ManipulationTask,
        physics: mjcf.Physics,
        cameras: tuple[str, ...],
        front_cameras: tuple[str, ...],
        wide_cameras: tuple[str, ...] = (),
        sense: PartSensor = sense_parts,
    ) -> None:
        """Looks at nothing yet.

        Args:
          task: Of an environment with these cameras.
          physics: The environment's.
          cameras: All that are looked through.
          front_cameras: Those that look at what the robot faces, the highest first.
          wide_cameras: Further ones, which show furniture whole.
          sense: Finds handles and joints.
        """
        self._task, self._physics = task, physics
        self._views = SceneViews(task.task_observables, cameras, wide_cameras)
        self._furniture = EstimatedFurniture(task, physics, self._views, front_cameras, sense)
        self._followed: FurnitureModel | None = None  # as objects in drawers were taken along last
        self._robot = _robot_alone()
        self._surroundings: Boxes = no_boxes()
        self._model: CollisionModel | None = None
        self._arm: ArmModel | None = None
        self._called: Mapping[str, str] = {}  # words of the instruction for parts
        self._with_extra: tuple[str, ...] = ()  # parts on which more was seen than they are made of

    @property
    def arm(self) -> ArmModel:
        """The arm in the scene that was built last."""
        assert self._arm is not None  # reset comes first
        return self._arm

    @property
    def furniture(self) -> EstimatedFurniture:
        """What is known of the furniture."""
        return self._furniture

    def reset(self, key: Any) -> None:
        """Look at furniture and surroundings.

        Raises:
          StageFailure: A part that a goal is about is not found.
        """
        self._called = asked_parts(self._task)
        self._furniture.reset(key)
        self._followed = self._furniture.model
        clouds = [
            self._views.cloud(self._physics, mask, normals=False).points
            for mask in self._task.surroundings_masks
        ]
        self._surroundings = surrounding_boxes(np.concatenate(clouds))

    def build(self, shapes: Hulls) -> None:
        """Compile robot, boxes and objects."""
        spec = self._robot.copy()
        _add_boxes(spec.worldbody, self._surroundings)
        model = self._furniture.model
        names: list[str] = []
        self._with_extra = ()
        if model is not None:
            pose = pose_to_vector(model.pose)
            self._with_extra = tuple(part.name for part in model.parts if len(part.extra))
            base = spec.worldbody.add_body(name=_BASE, pos=pose[:3], quat=pose[3:])
            _add_boxes(base, model.fixed)
            for part in model.parts:
                names.append(PREFIX + part.name)
                body = spec.worldbody.add_body(name=names[-1], pos=pose[:3], quat=pose[3:])
                _add_boxes(body, part.boxes)
                if len(part.extra):
                    names.append(_extra_of(PREFIX + part.name))
                    extra = spec.worldbody.add_body(name=names[-1], pos=pose[:3], quat=pose[3:])
                    _add_boxes(extra, part.extra)
        self._arm = ArmModel.of_spec(spec.copy(), _ROBOT)
        for name in names:
            body = spec.body(name)
            body.add_freejoint()
            body.mass, body.inertia, body.explicitinertial = 1.0, [1e-3] * 3, True
        for number, (name, hulls) in enumerate(shapes.items()):
            add_object(spec, number, name, hulls)
        self._model = CollisionModel(spec.compile(), _ROBOT, names)

    def body(self, name: str) -> int:
        """The body that stands for an object or a part."""
        return int(self._built.model.body(PREFIX + name).id)

    def observed(
        self,
        joints: Float[np.ndarray, "7"],
        opening: float,
        poses: Mapping[str, Float[np.ndarray, "4 4"]],
    ) -> PlanningScene:
        """Robot, parts and objects where they are known to be."""
        built = self._built
        model = built.model
        qpos = model.qpos0.copy()
        parts = self._furniture.part_poses()
        extra = {_extra_of(name): parts[name] for name in self._with_extra}
        for name, pose in {**poses, **parts, **extra}.items():
            address = built.joint_address(self.body(name))
            qpos[address : address + 7] = pose_to_vector(pose)
        qpos[built.arm_addresses] = joints
        qpos[built.finger_addresses] = opening / 2
        positions = ScenePositions(qpos, model.body_pos.copy(), model.body_quat.copy())
        return PlanningScene(built, positions)

    def parts(
        self, scene: PlanningScene, objects: Mapping[str, ObjectEstimate]
    ) -> dict[str, PartEstimate]:
        """All that were found."""
        bodies = {name: self.body(name) for name in self._furniture.part_poses()}
        geoms = {name: subtree_geoms(scene.model, body) for name, body in bodies.items()}
        carried = {name: (self.body(_extra_of(name)),) for name in self._with_extra}
        found = self._furniture.parts(bodies, geoms, objects, carried)
        called = self._called
        return {name: replace(part, called=called.get(name, "")) for name, part in found.items()}

    def follow(
        self, tcp_pose: Float[np.ndarray, "4 4"], objects: Poses
    ) -> dict[str, Float[np.ndarray, "4 4"]]:
        """By the hand where it holds a part, by cameras else."""
        self._furniture.follow(tcp_pose)
        before, self._followed = self._followed, self._furniture.model
        return gone_along(before, self._followed, objects)

    def hold(self, name: str | None, tcp_pose: Float[np.ndarray, "4 4"]) -> None:
        """Remember how the hand holds a handle."""
        self._furniture.hold(name, tcp_pose)

    def feel(self, name: str, path: Float[np.ndarray, "n 4 4"], stopped: bool) -> None:
        """Correct a joint."""
        self._furniture.feel(name, path, stopped)

    def pushed(self, name: str, opening: float) -> None:
        """Look for a part about there."""
        self._furniture.pushed(name, opening)

    def look_again(self, key: Any) -> None:
        """Measure what open parts show."""
        self._furniture.look_again()

    @property
    def _built(self) -> CollisionModel:
        assert self._model is not None  # reset comes first
        return self._model


def _extra_of(name: str) -> str:
    """The body that stands for what else was seen on a part, by the name of the part or of its body."""
    return f"{name}-extra"


def gone_along(
    before: FurnitureModel | None, now: FurnitureModel | None, objects: Poses
) -> dict[str, Float[np.ndarray, "4 4"]]:
    """Where what lay in drawers is once these have moved."""
    moved: dict[str, Float[np.ndarray, "4 4"]] = {}
    if before is None or now is None:
        return moved
    parts = {part.name: part for part in now.parts}
    for part in before.parts:
        cavity, after = part.part.cavity, parts.get(part.name)
        if cavity is None or not cavity.moves_with_part or after is None:
            continue
        if after.opening == part.opening:
            continue
        to_part = invert(before.pose @ part.motion(part.opening))
        for name, pose in objects.items():
            place = (to_part @ pose)[:3, 3] - cavity.center
            if (np.abs(place) < cavity.extents / 2 + _IN_DRAWER).all():
                moved[name] = now.pose @ after.motion(after.opening) @ to_part @ pose
    return moved


def _robot_alone() -> mujoco.MjSpec:
    """The robot at the world's origin, and nothing else."""
    arena = composer.Arena(name="world")
    arena.attach(Panda(name=_ROBOT))
    root = arena.mjcf_model
    spec = mujoco.MjSpec.from_string(root.to_xml_string(), assets=root.get_assets())
    without_looks(spec)
    return spec


def _add_boxes(body: mujoco.MjsBody, boxes: Boxes) -> None:
    for low, high in boxes:
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=(low + high) / 2,
            size=np.maximum((high - low) / 2, 5e-4),
        )
