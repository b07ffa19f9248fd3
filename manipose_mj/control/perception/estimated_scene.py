"""A planning scene without the objects' own models: known shapes stand where estimates put them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.control.scene.collision_model import CollisionModel, ScenePositions
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.poses import pose_to_vector

PREFIX = "estimated/"
_HIGH = 20.0  # bodies start apart, far above the scene [m]
_FREE = mujoco.mjtJoint.mjJNT_FREE


class EstimatedScenes:
    """Compiles a planning scene for each set of shapes."""

    def __init__(self, root: mjcf.RootElement, robot: str) -> None:
        """Takes the scene of `root` without its free bodies; nothing of these is read.

        Args:
          root: The whole scene.
          robot: The robot's name in it.
        """
        spec = mujoco.MjSpec.from_string(root.to_xml_string(), assets=root.get_assets())
        without_looks(spec)
        for body in list(spec.bodies):
            if any(joint.type == _FREE for joint in body.joints):
                spec.delete(body)
        self._spec = spec
        self._robot = robot

    def build(self, shapes: Mapping[str, Sequence[Float[np.ndarray, "_ 3"]]]) -> EstimatedScene:
        """A scene with a free body for each object, named `estimated/NAME`.

        Args:
          shapes: Vertices of the convex parts of each object, in its frame [m].
        """
        spec = self._spec.copy()
        for number, (name, hulls) in enumerate(shapes.items()):
            add_object(spec, number, name, hulls)
        return EstimatedScene(CollisionModel(spec.compile(), self._robot))


class EstimatedScene:
    """Builds planning scenes with robot and furniture as a simulation has them, found by name."""

    def __init__(self, collision_model: CollisionModel) -> None:
        self._collision_model = collision_model
        self._model = model = collision_model.model
        self._bodies = [
            (body, model.body(body).name)
            for body in range(1, model.nbody)
            if not model.body(body).name.startswith(PREFIX)
        ]
        self._joints = [
            (int(model.jnt_qposadr[joint]), model.joint(joint).name)
            for joint in range(model.njnt)
            if model.jnt_type[joint] != _FREE
        ]

    def body(self, name: str) -> int:
        """The body that stands for an object."""
        return int(self._model.body(PREFIX + name).id)

    def observed(
        self,
        model: mujoco.MjModel,
        qpos: Float[np.ndarray, "nq"],
        poses: Mapping[str, Float[np.ndarray, "4 4"]],
    ) -> PlanningScene:
        """The scene with objects at their estimates.

        Args:
          model: Of the simulation; a task may have moved its bodies.
          qpos: Of the simulation; joints of free bodies are not read.
          poses: `T_world_label` of every object.
        """
        own = self._model
        own_qpos, body_pos, body_quat = own.qpos0.copy(), own.body_pos.copy(), own.body_quat.copy()
        for body, name in self._bodies:
            source = model.body(name).id
            body_pos[body] = model.body_pos[source]
            body_quat[body] = model.body_quat[source]
        for address, name in self._joints:
            own_qpos[address] = qpos[model.joint(name).qposadr[0]]
        for name, pose in poses.items():
            address = self._collision_model.joint_address(self.body(name))
            own_qpos[address : address + 7] = pose_to_vector(pose)
        return PlanningScene(self._collision_model, ScenePositions(own_qpos, body_pos, body_quat))


def without_looks(spec: mujoco.MjSpec) -> None:
    """Delete from a scene what neither collides nor turns: servos, sensors, visual geoms."""
    for collection in (spec.actuators, spec.tendons, spec.equalities, spec.sensors):
        for element in list(collection):
            spec.delete(element)
    for geom in list(spec.geoms):
        if not geom.contype and not geom.conaffinity:
            spec.delete(geom)


def add_object(
    spec: mujoco.MjSpec, number: int, name: str, hulls: Sequence[Float[np.ndarray, "_ 3"]]
) -> None:
    """Add a free body, `estimated/NAME`, with these convex parts, apart from those of other numbers."""
    body = spec.worldbody.add_body(name=PREFIX + name, pos=[number, 0.0, _HIGH])
    body.add_freejoint()
    body.mass, body.inertia, body.explicitinertial = 1.0, [1e-3] * 3, True
    for part, hull in enumerate(hulls):
        mesh = f"{PREFIX}{name}/{part}"
        spec.add_mesh(
            name=mesh,
            uservert=np.asarray(hull, float).ravel().tolist(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
        )
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh)
