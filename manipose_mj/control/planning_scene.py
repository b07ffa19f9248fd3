"""The planner's picture of the world: where things are, and what a motion would hit.

Kinematics and collision detection only, on a private copy of the model; nothing here steps time.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.poses import pose_to_vector

# Contacts are detected this far apart [m]; clearances asked for must be smaller.
DETECTION_DISTANCE = 0.012


@dataclass(frozen=True)
class Clearance:
    """Smallest distances allowed [m]; negative where touching is part of the motion.

    Attributes:
      arm: Between the robot and everything it may not touch.
      target: Between the gripper and the thing it is about to take or has just let go.
      carried: Between what is carried and everything but the gripper.
      nudges: Whether the gripper and what it carries may push loose things aside, as far as the
        scene allows.
    """

    arm: float
    target: float
    carried: float
    nudges: bool = False


# Paths through free space; the same once their corners are rounded; the same where the ends leave
# less room; motions that end in contact.
TRANSIT = Clearance(arm=0.008, target=0.0, carried=0.012)
ROUNDED = Clearance(arm=0.003, target=0.0, carried=0.006)
GRAZING = Clearance(arm=0.001, target=0.0, carried=0.0)
CONTACT = Clearance(arm=0.003, target=-0.003, carried=-0.003, nudges=True)


@dataclass(frozen=True)
class Carried:
    """What moves with the gripper.

    Attributes:
      geoms: `(ngeom,)` mask of what belongs to it.
      place: Writes its joints into `qpos`, given `T_world_tcp`.
    """

    geoms: Bool[np.ndarray, "ngeom"]
    place: Callable[[Float[np.ndarray, "nq"], Float[np.ndarray, "4 4"]], None]


def carried_free_body(
    model: mujoco.MjModel, body: int, joint: int, pose_tcp: Float[np.ndarray, "4 4"]
) -> Carried:
    """An object on a free joint, held with its frame at `T_tcp_object`."""
    address = int(model.jnt_qposadr[joint])

    def place(qpos: np.ndarray, tcp_pose: np.ndarray) -> None:
        qpos[address : address + 7] = pose_to_vector(tcp_pose @ pose_tcp)

    return Carried(subtree_geoms(model, body), place)


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


class PlanningScene:
    """Answers whether a configuration of the arm, with what it carries, is free of collision.

    Attributes:
      nudge: How far loose things may be pushed aside where a motion ends in contact [m].
    """

    def __init__(self, model: mujoco.MjModel, robot_body: int, gripper_body: int) -> None:
        """Copies the model.

        Args:
          model: The compiled scene.
          robot_body: Root body of the robot.
          gripper_body: Body of the hand, whose subtree may touch what it grasps.
        """
        self.model = copy.copy(model)
        self.model.geom_margin[:] = DETECTION_DISTANCE
        # The broad phase drops pairs of bodies by margins of its own.
        self.model.body_margin[:] = DETECTION_DISTANCE
        forbid_sleep(self.model)
        self.data = mujoco.MjData(self.model)
        self._contype = model.geom_contype.copy()
        roots = model.body_rootid[model.geom_bodyid]
        free = int(mujoco.mjtJoint.mjJNT_FREE)
        jointed = model.body_jntnum[roots] == 1
        self._loose = jointed & (model.jnt_type[model.body_jntadr[roots]] == free)
        self.nudge = 0.0
        self.robot = subtree_geoms(model, robot_body)
        self.gripper = subtree_geoms(model, gripper_body)
        prefix = model.body(robot_body).name.rstrip("/")
        self._arm = np.array([model.joint(f"{prefix}/joint{i}").qposadr[0] for i in range(1, 8)])
        self._fingers = np.array(
            [model.joint(f"{prefix}/finger_joint{i}").qposadr[0] for i in (1, 2)]
        )
        self._tcp = model.site(f"{prefix}/tcp").id
        self._only_moving(self.robot)
        self._target = np.zeros(model.ngeom, bool)
        self._carried: Carried | None = None
        self._clearance = TRANSIT

    def synchronise(self, model: mujoco.MjModel, qpos: Float[np.ndarray, "nq"]) -> None:
        """Take over where everything is: joint positions, and bodies that a task moved."""
        self.model.body_pos[:] = model.body_pos
        self.model.body_quat[:] = model.body_quat
        self.data.qpos[:] = qpos

    def set_opening(self, opening: float) -> None:
        """The gripper's opening [m] in the queries to come."""
        self.data.qpos[self._fingers] = opening / 2

    @contextmanager
    def query(
        self,
        *,
        clearance: Clearance = TRANSIT,
        target: Bool[np.ndarray, "ngeom"] | None = None,
        carried: Carried | None = None,
    ) -> Iterator[PlanningScene]:
        """Ask with these clearances, this thing to be grasped and this thing carried."""
        saved = self._clearance, self._target, self._carried
        positions = self.data.qpos.copy()
        none = np.zeros(self.model.ngeom, bool)
        self._clearance, self._carried = clearance, carried
        self._target = none if target is None else target
        self._only_moving(self.robot if carried is None else self.robot | carried.geoms)
        try:
            yield self
        finally:
            self._clearance, self._target, self._carried = saved
            before = self._carried
            self._only_moving(self.robot if before is None else self.robot | before.geoms)
            self.data.qpos[:] = positions

    def _only_moving(self, moving: Bool[np.ndarray, "ngeom"]) -> None:
        """Look for contacts of these with anything: those of the rest do not matter, in a pile of
        things they are most of the work."""
        model = self.model
        model.geom_contype[:] = np.where(moving, self._contype, 0)
        bodies = np.zeros(model.nbody, model.body_contype.dtype)
        np.bitwise_or.at(bodies, model.geom_bodyid, model.geom_contype)
        model.body_contype[:] = bodies

    def touching(
        self, geoms: Bool[np.ndarray, "ngeom"], distance: float
    ) -> list[tuple[int, float]]:
        """What is nearer to these geoms than `distance` [m], where everything is now.

        Returns:
          The other geom, and the vertical part of the direction towards it, of each contact.
        """
        self._only_moving(geoms)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        self._only_moving(self.robot)
        found = []
        for contact in self.data.contact:
            first, second = int(contact.geom1), int(contact.geom2)
            if contact.dist < distance and geoms[first] != geoms[second]:
                upwards = float(contact.frame[2])
                found.append((second, upwards) if geoms[first] else (first, -upwards))
        return found

    def tcp_pose(self, joints: Float[np.ndarray, "7"]) -> Float[np.ndarray, "4 4"]:
        """`T_world_tcp` in this configuration."""
        self.data.qpos[self._arm] = joints
        mujoco.mj_kinematics(self.model, self.data)
        return self._site_pose()

    def in_collision(self, joints: Float[np.ndarray, "7"]) -> bool:
        """Whether the robot or what it carries comes closer to something than it may."""
        return self.first_collision(joints) is not None

    def first_collision(self, joints: Float[np.ndarray, "7"]) -> tuple[str, str, float] | None:
        """Names of the two geoms that collide first, and their distance [m]; None if free."""
        self.data.qpos[self._arm] = joints
        mujoco.mj_kinematics(self.model, self.data)
        if self._carried is not None:
            self._carried.place(self.data.qpos, self._site_pose())
            mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        contact = self.data.contact
        if not len(contact.dist):
            return None
        bad = np.flatnonzero(contact.dist < self._allowed(contact.geom1, contact.geom2))
        if not len(bad):
            return None
        i = int(bad[0])
        names = [self.model.geom(int(g)).name or f"geom {g}" for g in contact.geom[i]]
        return names[0], names[1], float(contact.dist[i])

    def _allowed(self, first: np.ndarray, second: np.ndarray) -> Float[np.ndarray, "c"]:
        """The smallest distance allowed for each pair of geoms; -inf where it does not matter."""
        clearance = self._clearance
        carried = self._target & False if self._carried is None else self._carried.geoms
        allowed = np.full(len(first), -np.inf)
        robot_1, robot_2 = self.robot[first], self.robot[second]
        carried_1, carried_2 = carried[first], carried[second]
        load = carried_1 ^ carried_2
        allowed[load] = clearance.carried
        one_robot = robot_1 ^ robot_2
        allowed[one_robot] = clearance.arm
        allowed[robot_1 & robot_2] = 0.0
        gripper = self.gripper[first] | self.gripper[second]
        target = self._target[first] | self._target[second]
        if clearance.nudges and self.nudge > 0:
            pushed = (load | one_robot & gripper) & (self._loose[first] | self._loose[second])
            # What is carried is loose too, but not what it lies on.
            pushed &= ~(load & (self._loose[first] ^ self._loose[second]))
            allowed[pushed] = np.minimum(allowed[pushed], -self.nudge)
        allowed[one_robot & gripper & target] = clearance.target
        allowed[one_robot & gripper & (carried_1 | carried_2)] = -np.inf
        return allowed

    def _site_pose(self) -> Float[np.ndarray, "4 4"]:
        pose = np.eye(4)
        pose[:3, :3] = self.data.site_xmat[self._tcp].reshape(3, 3)
        pose[:3, 3] = self.data.site_xpos[self._tcp]
        return pose
