"""A planning scene without the objects' own models: known shapes stand where estimates put them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.control.planning_scene import PlanningScene
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
        for collection in (spec.actuators, spec.tendons, spec.equalities, spec.sensors):
            for element in list(collection):
                spec.delete(element)
        for body in list(spec.bodies):
            if any(joint.type == _FREE for joint in body.joints):
                spec.delete(body)
        for geom in list(spec.geoms):
            if not geom.contype and not geom.conaffinity:
                spec.delete(geom)
        self._spec = spec
        self._robot = robot

    def build(
        self, shapes: Mapping[str, Sequence[Float[np.ndarray, "v 3"]]]
    ) -> tuple[PlanningScene, SceneFollower]:
        """A scene with a free body for each object, named `estimated/NAME`.

        Args:
          shapes: Vertices of the convex parts of each object, in its frame [m].

        Returns:
          The scene, and what brings its other bodies up to date with a simulation's.
        """
        spec = self._spec.copy()
        for number, (name, hulls) in enumerate(shapes.items()):
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
        model = spec.compile()
        body_of = model.body
        scene = PlanningScene(
            model, body_of(f"{self._robot}/").id, body_of(f"{self._robot}/hand").id
        )
        return scene, SceneFollower(scene)


class SceneFollower:
    """Brings robot and furniture of a planning scene up to date with a simulation's, by name."""

    def __init__(self, scene: PlanningScene) -> None:
        self._scene = scene
        model = scene.model
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

    def follow(self, model: mujoco.MjModel, qpos: Float[np.ndarray, "nq"]) -> None:
        """Take over joint positions, and bodies that a task moved; never those of free bodies."""
        scene = self._scene
        for body, name in self._bodies:
            source = model.body(name).id
            scene.model.body_pos[body] = model.body_pos[source]
            scene.model.body_quat[body] = model.body_quat[source]
        for address, name in self._joints:
            scene.data.qpos[address] = qpos[model.joint(name).qposadr[0]]

    def body(self, name: str) -> int:
        """The body that stands for an object."""
        return int(self._scene.model.body(PREFIX + name).id)

    def place(self, name: str, pose: Float[np.ndarray, "4 4"]) -> None:
        """Put an object's stand-in at `T_world_label`."""
        model = self._scene.model
        address = int(model.jnt_qposadr[model.body_jntadr[self.body(name)]])
        self._scene.data.qpos[address : address + 7] = pose_to_vector(pose)
