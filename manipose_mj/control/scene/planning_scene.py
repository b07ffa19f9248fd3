"""The planner's picture of the world: where objects are, and what a motion would hit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.scene.collision_model import CollisionModel, Contacts, ScenePositions
from manipose_mj.control.scene.collision_query import CollisionQuery
from manipose_mj.poses import pose_to_vector, vector_to_pose

_HARDLY = 1e-6  # how deep the robot counts as being in what it is too close to, untouched [m]


@dataclass(frozen=True)
class PlanningScene:
    """One observation of the world, or what would be if some of it were elsewhere. It never changes.

    Attributes:
      collision_model: Answers questions about positions; shared by the scenes of an episode.
      positions: Where everything is.
    """

    collision_model: CollisionModel
    positions: ScenePositions

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled scene, whose bodies and geoms estimates name."""
        return self.collision_model.model

    @property
    def robot(self) -> Bool[np.ndarray, "ngeom"]:
        """Mask of the robot's geoms."""
        return self.collision_model.robot

    def body_pose(self, body: int) -> Float[np.ndarray, "4 4"]:
        """`T_world_body` of a body on a free joint."""
        address = self.collision_model.joint_address(body)
        return vector_to_pose(self.positions.qpos[address : address + 7])

    def is_free(self, body: int) -> bool:
        """Whether a body is put where an estimate has it: it has no joint of its own in the scene."""
        joint = int(self.model.body_jntadr[body])
        return joint >= 0 and int(self.model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_FREE)

    def with_joint_at(self, body: int, position: float) -> PlanningScene:
        """The scene with a body's hinge or slide at another position [rad or m]."""
        return self._with_qpos(self.collision_model.joint_address(body), np.array([position]))

    def with_body_at(self, body: int, pose: Float[np.ndarray, "4 4"]) -> PlanningScene:
        """The scene with a body on a free joint at `T_world_body`."""
        return self._with_qpos(self.collision_model.joint_address(body), pose_to_vector(pose))

    def _with_qpos(self, address: int, values: Float[np.ndarray, "k"]) -> PlanningScene:
        qpos = self.positions.qpos.copy()
        qpos[address : address + len(values)] = values
        return replace(self, positions=replace(self.positions, qpos=qpos))

    def tcp_pose(self, joints: Float[np.ndarray, "7"]) -> Float[np.ndarray, "4 4"]:
        """`T_world_tcp` in this configuration of the arm."""
        return self.collision_model.tcp_pose(self.positions, joints)

    def body_frames(
        self, joints: Float[np.ndarray, "7"], opening: float | None = None
    ) -> tuple[Float[np.ndarray, "nbody 3"], Float[np.ndarray, "nbody 4"]]:
        """Position [m] and quaternion wxyz of every body in the world.

        Args:
          joints: Of the arm [rad].
          opening: Of the gripper [m]; None: as observed.
        """
        data = self.collision_model.forward(self.positions, joints, opening)
        return data.xpos.copy(), data.xquat.copy()

    def in_collision(
        self, joints: Float[np.ndarray, "7"], query: CollisionQuery | None = None
    ) -> bool:
        """Whether the robot or what is attached comes closer to something than it may."""
        return self.first_collision(joints, query) is not None

    def first_collision(
        self, joints: Float[np.ndarray, "7"], query: CollisionQuery | None = None
    ) -> tuple[str, str, float] | None:
        """Names of the two geoms that collide first, and their distance [m]; None if free."""
        query = query or CollisionQuery()
        contacts = self.collision_model.contacts(self.positions, joints, query)
        if not len(contacts.distances):
            return None
        bad = np.flatnonzero(contacts.distances < self._allowed(contacts, query))
        if not len(bad):
            return None
        i = int(bad[0])
        names = [self.model.geom(int(g)).name or f"geom {g}" for g in contacts.geoms[i]]
        return names[0], names[1], float(contacts.distances[i])

    def obstacles(
        self, joints: Float[np.ndarray, "7"], query: CollisionQuery
    ) -> Bool[np.ndarray, "ngeom"]:
        """Mask of all geoms that the robot or what is attached comes too close to.

        The robot's own among them where two of its links meet.
        """
        contacts = self.collision_model.contacts(self.positions, joints, query)
        bad = contacts.geoms[contacts.distances < self._allowed(contacts, query)]
        moving = self.robot if query.attached is None else self.robot | query.attached.geoms
        hit = np.zeros(len(self.robot), bool)
        for first, second in bad.reshape(-1, 2):
            both = moving[first] and moving[second]
            hit[first] |= both or not moving[first]
            hit[second] |= both or not moving[second]
        return hit

    def depths(
        self, joints: Float[np.ndarray, "7"], query: CollisionQuery
    ) -> Float[np.ndarray, "ngeom"]:
        """How deep the robot is in each geom that it is too close to, hardly at all if it does not touch it [m]; zero in
        the others.

        A robot that is where it is cannot be in what is solid: estimates have put that too near. All geoms of a body
        count as one, for they are off together; those of the world are bodies of their own.
        """
        contacts = self.collision_model.contacts(self.positions, joints, query)
        bad = contacts.distances < self._allowed(contacts, query)
        depths = np.zeros(len(self.robot))
        for (first, second), distance in zip(
            contacts.geoms[bad].tolist(), contacts.distances[bad].tolist(), strict=True
        ):
            if self.robot[first] == self.robot[second]:
                continue
            other = second if self.robot[first] else first
            body = int(self.model.geom_bodyid[other])
            alike = self.model.geom_bodyid == body if body else np.arange(len(depths)) == other
            depths[alike] = np.maximum(depths[alike], max(-distance, _HARDLY))
        return depths

    def depth_in_fixed(self, geoms: Bool[np.ndarray, "ngeom"]) -> float:
        """How deep these geoms are in what neither is loose nor of the robot [m]; zero where they touch none of it."""
        contacts = self.collision_model.contacts_of(self.positions, geoms)
        first, second = contacts.geoms.T
        others = np.where(geoms[first], second, first)
        fixed = ~(geoms | self.robot | self.collision_model.loose)[others]
        return float(-contacts.distances[fixed].min(initial=0.0))

    def touching(
        self, geoms: Bool[np.ndarray, "ngeom"], distance: float
    ) -> list[tuple[int, float]]:
        """What is nearer to these geoms than `distance` [m].

        Returns:
          The other geom, and the vertical part of the direction towards it, of each contact.
        """
        contacts = self.collision_model.contacts_of(self.positions, geoms)
        found = []
        for (first, second), gap, normal in zip(
            contacts.geoms.tolist(), contacts.distances, contacts.normals, strict=True
        ):
            if gap < distance and geoms[first] != geoms[second]:
                upwards = float(normal[2])
                found.append((second, upwards) if geoms[first] else (first, -upwards))
        return found

    def _allowed(self, contacts: Contacts, query: CollisionQuery) -> Float[np.ndarray, "c"]:
        """The smallest distance allowed in each contact [m]; -inf where it does not matter."""
        first, second = contacts.geoms.T
        robot, gripper, loose = self.robot, self.collision_model.gripper, self.collision_model.loose
        clearance, nothing = query.clearance, np.zeros(len(robot), bool)
        attached = nothing if query.attached is None else query.attached.geoms
        target = nothing if query.target is None else query.target
        allowed = np.full(len(first), -np.inf)
        load = attached[first] ^ attached[second]
        allowed[load] = clearance.attached
        one_robot = robot[first] ^ robot[second]
        allowed[one_robot] = clearance.arm
        allowed[robot[first] & robot[second]] = 0.0
        by_gripper = one_robot & (gripper[first] | gripper[second])
        if clearance.allows_contact and query.support_allowance > 0:
            fixed = by_gripper & ~(loose[first] | loose[second])
            allowed[fixed] -= query.support_allowance
        if clearance.allows_contact and query.contact_allowance > 0:
            pushed = (load | by_gripper) & (loose[first] | loose[second])
            # What is attached is loose too, but not what it lies on.
            pushed &= ~(load & (loose[first] ^ loose[second]))
            allowed[pushed] = np.minimum(allowed[pushed], -query.contact_allowance)
        allowed[by_gripper & (target[first] | target[second])] = clearance.target
        if query.depths is not None:
            depths = np.where(robot[first], query.depths[second], query.depths[first])
            excused = one_robot & (depths > 0)
            allowed[excused] = np.minimum(allowed[excused], -depths[excused])
        allowed[by_gripper & (attached[first] | attached[second])] = -np.inf
        return allowed
