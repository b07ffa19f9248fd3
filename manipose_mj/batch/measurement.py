"""What the task's functions need of a simulation after each control step, in arrays of one size for all worlds.

Engines fill a `Measurement`; `scene_state` and the observations are functions of it. Objects and parts are in
slots: those that the goals may name, in one order for all worlds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.mjcf.panda.servos import ServoAddresses
from manipose_mj.poses import Array, namespace
from manipose_mj.tasks.scene.indices import FIRST, NOBODY, RIGHT_PAD, SceneIndices, SceneShapes
from manipose_mj.tasks.scene.read import PhysicsArrays, read
from manipose_mj.tasks.scene.state import SceneState

_ROBOT_KINDS = RIGHT_PAD + 1  # of geoms: the robot's, the left pad, the right pad


class Measurement(NamedTuple):
    """Attributes:
    joints, velocities, torques: Of the arm [rad, rad/s, N m].
    fingers: Positions of both finger joints [m].
    tcp_position, tcp_rotation: Of the TCP in the world.
    positions, rotations: Of the bodies of the layout: objects, handles, cavities, observed frames.
    speeds: Of the objects: three that move [m/s], three that turn [rad/s].
    openings: Of the parts' joints [m or rad].
    contacts: Whether the robot, its left pad or its right pad touches each object, then each part.
    camera_positions, camera_rotations: In MuJoCo's axes.
    """

    joints: Float[Array, "*b 7"]
    velocities: Float[Array, "*b 7"]
    torques: Float[Array, "*b 7"]
    fingers: Float[Array, "*b 2"]
    tcp_position: Float[Array, "*b 3"]
    tcp_rotation: Float[Array, "*b 3 3"]
    positions: Float[Array, "*b bodies 3"]
    rotations: Float[Array, "*b bodies 3 3"]
    speeds: Float[Array, "*b objects 6"]
    openings: Float[Array, "*b parts"]
    contacts: Bool[Array, "*b 3 owned"]
    camera_positions: Float[Array, "*b cameras 3"]
    camera_rotations: Float[Array, "*b cameras 3 3"]


@dataclass(frozen=True)
class Addresses:
    """Where a measurement is in one compiled model. What an episode does not have is the world's row.

    Attributes:
      servos: Of the robot.
      bodies: As in `Measurement.positions`.
      dofs: First of each object's free joint.
      openings: Of the parts' joints, in `qpos`.
      owners: Of each geom: `ROBOT`, `LEFT_PAD`, `RIGHT_PAD`, `NOBODY`, or from `FIRST` on a slot.
      cameras: Of the layout.
    """

    servos: ServoAddresses
    bodies: Int[np.ndarray, " bodies"]
    dofs: Int[np.ndarray, " objects"]
    openings: Int[np.ndarray, " parts"]
    owners: Int[np.ndarray, " geoms"]
    cameras: Int[np.ndarray, " cameras"]


class FlatMeasurement(NamedTuple):
    """Attributes: values, all of a `Measurement` but contacts, one field after the other; contacts."""

    values: Float[Array, "*b n"]
    contacts: Bool[Array, "*b 3 owned"]

    def split(self, like: Measurement) -> Measurement:
        """With a field for each quantity; like: any measurement of one world."""
        fields, place = {}, 0
        for name, one in zip(Measurement._fields, like, strict=True):
            if name == "contacts":
                continue
            own = self.values[..., place : place + one.size]
            fields[name] = own.reshape(*own.shape[:-1], *one.shape)
            place += one.size
        return Measurement(**fields, contacts=self.contacts)


def flat_values(measurement: Measurement) -> np.ndarray:
    """Of one world, the values of a `FlatMeasurement`."""
    fields = measurement._asdict()
    del fields["contacts"]
    return np.concatenate([np.reshape(field, -1) for field in fields.values()])


def measure(model: mujoco.MjModel, data: mujoco.MjData, at: Addresses) -> Measurement:
    """A measurement of one simulation, whose kinematics and contacts are up to date."""
    contacts = np.zeros((_ROBOT_KINDS, len(at.dofs) + len(at.openings)), bool)
    if data.ncon:
        kinds, owned, _ = touching(at.owners[data.contact.geom])
        contacts[kinds, owned] = True
    return gathered(data, at, contacts)


def touching(
    owners: Int[np.ndarray, "contacts 2"],
) -> tuple[Int[np.ndarray, " some"], Int[np.ndarray, " some"], Int[np.ndarray, " some"]]:
    """Of contacts of the robot with something owned: its kind of geom, the slot, and which contacts they are."""
    owners = np.sort(owners, axis=-1)
    which = np.flatnonzero((owners[:, 0] <= RIGHT_PAD) & (owners[:, 1] >= FIRST))
    kinds, slots = owners[which].T
    return kinds, slots - FIRST, which


def gathered(data: Any, at: Addresses, contacts: Bool[np.ndarray, "3 owned"]) -> Measurement:
    """What a measurement takes from arrays named and shaped as MuJoCo's."""
    servos = at.servos
    return Measurement(
        joints=data.qpos[servos.angles],
        velocities=data.qvel[servos.dofs],
        torques=data.actuator_force[servos.arm],
        fingers=data.qpos[servos.fingers],
        tcp_position=data.site_xpos[servos.tcp],
        tcp_rotation=data.site_xmat[servos.tcp].reshape(3, 3),
        positions=data.xpos[at.bodies],
        rotations=data.xmat[at.bodies].reshape(-1, 3, 3),
        speeds=data.qvel[at.dofs[:, None] + np.arange(6)],
        openings=data.qpos[at.openings],
        contacts=contacts,
        camera_positions=data.cam_xpos[at.cameras],
        camera_rotations=data.cam_xmat[at.cameras].reshape(-1, 3, 3),
    )


def scene_state(
    objects: tuple[str, ...], parts: tuple[str, ...], shapes: SceneShapes, now: Measurement
) -> SceneState:
    """The state that goals and rewards are functions of, as the tasks themselves read it.

    Args:
      objects: Names of the slots.
      parts: Names of the slots.
      shapes: Of the objects and parts in these slots.
      now: Of the simulation.
    """
    count, owned = len(objects), len(objects) + len(parts)
    slots = FIRST + np.arange(owned)
    indices = SceneIndices(
        objects=objects,
        parts=parts,
        tcp=0,
        fingers=(0, 1),
        bodies=np.arange(count + 2 * len(parts)),
        speeds=np.arange(6 * count).reshape(-1, 2, 3),
        openings=2 + np.arange(len(parts)),
        owners=np.array([*range(_ROBOT_KINDS), NOBODY, *slots]),
        owned=slots,
    )
    xp = namespace(now.joints)
    pairs = np.stack(np.meshgrid(np.arange(_ROBOT_KINDS), slots, indexing="ij"), axis=-1)
    batch = now.joints.shape[:-1]
    pairs = xp.broadcast_to(xp.asarray(pairs.reshape(-1, 2)), (*batch, _ROBOT_KINDS * owned, 2))
    data = PhysicsArrays(
        qpos=xp.concat([now.fingers, now.openings], axis=-1),
        qvel=now.speeds.reshape(*batch, 6 * count),
        xpos=now.positions,
        xmat=now.rotations,
        site_xpos=now.tcp_position[..., None, :],
        site_xmat=now.tcp_rotation[..., None, :, :],
        contact_geoms=pairs,
        contact_valid=now.contacts.reshape(*batch, _ROBOT_KINDS * owned),
    )
    return read(indices, shapes, data)
