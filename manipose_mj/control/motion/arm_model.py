"""The arm alone, with the rest of the scene frozen around it: what mink solves on.

Differential IK over the scene's every joint would spend its time on objects it must not move; here
the seven arm joints are the only degrees of freedom.
"""

from __future__ import annotations

import mujoco
import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.control.scene.collision_model import forbid_sleep, subtree_geoms
from manipose_mj.control.scene.planning_scene import PlanningScene

_ARM_JOINTS = tuple(f"joint{i}" for i in range(1, 8))


class ArmModel:
    """A model with seven joints whose other bodies can be put where the scene has them.

    Attributes:
      model: nq = nv = 7; free bodies of the scene are left out, articulated ones are rigid.
      tracks: Joint targets of lines that were asked for, None where the arm cannot follow, by what they depend on.
    """

    tracks: dict[bytes, Float[np.ndarray, "k 7"] | None]

    def __init__(self, root: mjcf.RootElement, prefix: str = "panda") -> None:
        """Compiles the scene of `root` without its other joints."""
        self._compile(
            mujoco.MjSpec.from_string(root.to_xml_string(), assets=root.get_assets()), prefix
        )

    @classmethod
    def of_spec(cls, spec: mujoco.MjSpec, prefix: str = "panda") -> ArmModel:
        """The same of a scene that was put together otherwise; `spec` is used up."""
        arm = cls.__new__(cls)
        arm._compile(spec, prefix)
        return arm

    def _compile(self, spec: mujoco.MjSpec, prefix: str) -> None:
        arm = {f"{prefix}/{name}" for name in _ARM_JOINTS}
        for collection in (spec.actuators, spec.tendons, spec.equalities, spec.sensors):
            for element in list(collection):
                spec.delete(element)
        for body in list(spec.bodies):
            if any(j.type == mujoco.mjtJoint.mjJNT_FREE for j in body.joints):
                spec.delete(body)
        for joint in list(spec.joints):
            if joint.name not in arm:
                spec.delete(joint)
        # Visual meshes collide with nothing.
        for geom in list(spec.geoms):
            if not geom.contype and not geom.conaffinity:
                spec.delete(geom)
        self.model = spec.compile()
        self.tracks = {}
        forbid_sleep(self.model)
        self.tcp = f"{prefix}/tcp"
        self._robot_body = self.model.body(f"{prefix}/").id
        self.robot_geoms = subtree_geoms(self.model, self._robot_body)
        distal = self.model.body(f"{prefix}/link5").id
        self.distal_geoms = np.flatnonzero(subtree_geoms(self.model, distal))

    def obstacle_geoms(self, touched_bodies: frozenset[str]) -> list[int]:
        """Geoms around the robot, but those of bodies that the motion may touch."""
        return [
            geom
            for geom in np.flatnonzero(~self.robot_geoms).tolist()
            if self.model.body(self.model.geom_bodyid[geom]).name not in touched_bodies
        ]

    def follow(
        self,
        scene: PlanningScene,
        joints: Float[np.ndarray, "7"],
        opening: float | None = None,
    ) -> None:
        """Put every body, fingers included, where the scene has it; the arm itself stays free.

        Args:
          scene: Of the same bodies, and more.
          joints: Of the arm [rad].
          opening: Of the gripper [m]; None: as observed.
        """
        places, turns = scene.body_frames(joints, opening)
        inside = np.zeros(self.model.nbody, bool)
        arm_root = self.model.body(self._robot_body).name
        for body in range(1, self.model.nbody):
            name = self.model.body(body).name
            parent = int(self.model.body_parentid[body])
            inside[body] = inside[parent] or name == arm_root
            if inside[body] and not name.endswith("_finger"):
                continue
            source = scene.model.body(name).id
            above = scene.model.body(self.model.body(parent).name).id
            inverse_position, inverse_quaternion = np.zeros(3), np.zeros(4)
            mujoco.mju_negPose(inverse_position, inverse_quaternion, places[above], turns[above])
            mujoco.mju_mulPose(
                self.model.body_pos[body],
                self.model.body_quat[body],
                inverse_position,
                inverse_quaternion,
                places[source],
                turns[source],
            )
