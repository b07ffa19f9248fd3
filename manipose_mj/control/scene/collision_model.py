"""Kinematics and contacts of a compiled scene, computed from scratch for every question.

Everything a question depends on comes in as arguments; the MuJoCo data behind it is scratch paper.
Nothing here steps time.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.scene.collision_query import DETECTION_DISTANCE, CollisionQuery
from manipose_mj.poses import pose_to_vector

_FREE = int(mujoco.mjtJoint.mjJNT_FREE)


@dataclass(frozen=True)
class ScenePositions:
    """Where everything is; the arrays cannot be written to.

    Attributes:
      qpos: Joint positions.
      body_pos: Of every body in its parent's frame [m].
      body_quat: The same, wxyz.
    """

    qpos: Float[np.ndarray, "nq"]
    body_pos: Float[np.ndarray, "nbody 3"]
    body_quat: Float[np.ndarray, "nbody 4"]

    def __post_init__(self) -> None:
        for array in (self.qpos, self.body_pos, self.body_quat):
            array.setflags(write=False)


@dataclass(frozen=True)
class Contacts:
    """Attributes: geoms `(c, 2)`; distances `(c,)` [m]; normals `(c, 3)`, from first to second geom."""

    geoms: np.ndarray
    distances: Float[np.ndarray, "c"]
    normals: Float[np.ndarray, "c 3"]


def subtree_geoms(model: mujoco.MjModel, body: int) -> Bool[np.ndarray, "ngeom"]:
    """Mask of the geoms of a body and everything below it."""
    inside = np.zeros(model.nbody, bool)
    inside[body] = True
    for index in range(body + 1, model.nbody):
        inside[index] = inside[model.body_parentid[index]]
    return inside[model.geom_bodyid]


def forbid_sleep(model: mujoco.MjModel) -> None:
    """Have all bodies computed: furniture that a task moves counts as asleep otherwise and stays."""
    model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)


class CollisionModel:
    """A private copy of a compiled scene.

    Attributes:
      model: The copy, with margins that detect contacts early.
      robot: Mask of the robot's geoms, `(ngeom,)`.
      gripper: Mask of the hand's, which may touch what it grasps.
      loose: Mask of the geoms of bodies on free joints, but for parts of furniture.
      arm_addresses: Where in `qpos` the arm's joints are, `(7,)`.
      finger_addresses: Where the fingers' are, `(2,)`.
    """

    def __init__(self, model: mujoco.MjModel, robot: str, parts: Sequence[str] = ()) -> None:
        """Copies the model of a scene.

        Args:
          model: Of the scene.
          robot: The robot's name in it.
          parts: Names of bodies on free joints that are parts of furniture: they do not give way.
        """
        self.model = copy.copy(model)
        self.model.geom_margin[:] = DETECTION_DISTANCE
        # The broad phase drops pairs of bodies by margins of its own.
        self.model.body_margin[:] = DETECTION_DISTANCE
        forbid_sleep(self.model)
        # The other detector of convex shapes finds 25 mm of overlap between a pad and a carton 6 mm away.
        self.model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)
        roots = model.body_rootid[model.geom_bodyid]
        jointed = model.body_jntnum[roots] == 1
        self.loose = jointed & (model.jnt_type[model.body_jntadr[roots]] == _FREE)
        for part in parts:
            self.loose &= ~subtree_geoms(model, model.body(part).id)
        self.robot = subtree_geoms(model, model.body(f"{robot}/").id)
        self.gripper = subtree_geoms(model, model.body(f"{robot}/hand").id)
        self._contype = model.geom_contype.copy()
        self.arm_addresses = np.array(
            [model.joint(f"{robot}/joint{i}").qposadr[0] for i in range(1, 8)]
        )
        self.finger_addresses = np.array(
            [model.joint(f"{robot}/finger_joint{i}").qposadr[0] for i in (1, 2)]
        )
        self._tcp = model.site(f"{robot}/tcp").id
        self._data = mujoco.MjData(self.model)
        self._bodies: Float[np.ndarray, "nbody 3"] | None = None
        self._checked: tuple[Bool[np.ndarray, "ngeom"] | None, bool] = (None, False)

    def positions_of(self, model: mujoco.MjModel, qpos: Float[np.ndarray, "nq"]) -> ScenePositions:
        """Where a model of the same bodies and joints has everything; a task may move its bodies."""
        return ScenePositions(np.array(qpos), model.body_pos.copy(), model.body_quat.copy())

    def joint_address(self, body: int) -> int:
        """Where in `qpos` the first joint of a body starts."""
        return int(self.model.jnt_qposadr[self.model.body_jntadr[body]])

    def forward(
        self,
        positions: ScenePositions,
        joints: Float[np.ndarray, "7"] | None = None,
        opening: float | None = None,
    ) -> mujoco.MjData:
        """Kinematics with the arm [rad] and the gripper [m] elsewhere where that is given.

        Returns:
          Scratch data, good until the next question.
        """
        data = self._data
        if positions.body_pos is not self._bodies:
            self._bodies = positions.body_pos
            self.model.body_pos[:] = positions.body_pos
            self.model.body_quat[:] = positions.body_quat
        data.qpos[:] = positions.qpos
        if opening is not None:
            data.qpos[self.finger_addresses] = opening / 2
        if joints is not None:
            data.qpos[self.arm_addresses] = joints
        mujoco.mj_kinematics(self.model, data)
        return data

    def tcp_pose(
        self, positions: ScenePositions, joints: Float[np.ndarray, "7"]
    ) -> Float[np.ndarray, "4 4"]:
        """`T_world_tcp` in a configuration of the arm [rad]."""
        return self._site_pose(self.forward(positions, joints))

    def contacts(
        self, positions: ScenePositions, joints: Float[np.ndarray, "7"], query: CollisionQuery
    ) -> Contacts:
        """Contacts of the robot and of what is attached, with anything near."""
        data = self.forward(positions, joints, query.opening)
        attached = query.attached
        if attached is not None:
            address = self.joint_address(attached.body)
            pose = attached.pose(self._site_pose(data))
            data.qpos[address : address + 7] = pose_to_vector(pose)
            mujoco.mj_kinematics(self.model, data)
        if attached is None:
            self._check_only(self.robot)
        else:
            self._check_only(attached.geoms, and_robot=True)
        return self._contacts()

    def contacts_of(self, positions: ScenePositions, geoms: Bool[np.ndarray, "ngeom"]) -> Contacts:
        """Contacts of some geoms with anything near, everything where it was observed."""
        self.forward(positions)
        self._check_only(geoms)
        return self._contacts()

    def _contacts(self) -> Contacts:
        mujoco.mj_collision(self.model, self._data)
        contact = self._data.contact
        return Contacts(contact.geom, contact.dist, contact.frame[:, :3])

    def _check_only(self, geoms: Bool[np.ndarray, "ngeom"], *, and_robot: bool = False) -> None:
        """Detect contacts of these with anything: those among the rest do not matter, and in a pile
        they are most of the work."""
        if geoms is self._checked[0] and and_robot == self._checked[1]:
            return
        self._checked = geoms, and_robot
        model = self.model
        checked = geoms | self.robot if and_robot else geoms
        model.geom_contype[:] = np.where(checked, self._contype, 0)
        bodies = np.zeros(model.nbody, model.body_contype.dtype)
        np.bitwise_or.at(bodies, model.geom_bodyid, model.geom_contype)
        model.body_contype[:] = bodies

    def _site_pose(self, data: mujoco.MjData) -> Float[np.ndarray, "4 4"]:
        pose = np.eye(4)
        pose[:3, :3] = data.site_xmat[self._tcp].reshape(3, 3)
        pose[:3, 3] = data.site_xpos[self._tcp]
        return pose
