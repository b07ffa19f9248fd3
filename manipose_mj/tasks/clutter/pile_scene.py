"""A table between invisible walls, a few objects and a hand: where piles are dropped and judged."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.assets.physics import SOLIMP, SUPPORT_CONDIM, SUPPORT_FRICTION, set_physics
from manipose_mj.mjcf.arena import TABLE_CENTER, TABLE_HALF_EXTENTS
from manipose_mj.poses import pose_to_vector, vector_to_pose
from manipose_mj.tasks.clutter.pile_views import most_seen

_WALLS = 8
_DROP_TIMESTEP = 0.004  # while objects fall [s]
_SETTLE_TIMESTEP = 0.002  # while they come to rest; what rests is judged in the benchmark's [s]
_PIECE = 0.05  # of time, after which is looked again [s]
_PARKING_HEIGHT = 10.0
_HAND_PARKING = (0.0, 0.0, -5.0)
_STANDOFF = 0.10  # from which a hand comes straight to a grasp [m]
_FINGER_MARGIN = 0.002  # kept between the open hand and other objects [m]
_BRUSHED = 0.0005  # depth to which it may meet what it takes [m]
_TABLE_MARGIN = 0.001  # and the table
_MIN_LEVEL = 0.5  # of a contact's normal along the vertical, from which on it carries
# Half of other tasks': what the arm flips over or flings out of a pile spins, and its ends meet other
# objects at 4 m/s. Contacts in between would not be seen before they are 8 mm deep.
PILE_TIMESTEP = 0.001  # [s]
PILE_CONTACT_TIME = 0.0025  # of contacts between objects and table [s]
_NATIVE_CCD_OFF = int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)
# Bits of MuJoCo's contact filter.
_OBJECT, _FIXED, _HAND = 1, 2, 4


class PileScene:
    """Objects that wait above the table and are dropped one by one.

    Attributes:
      kept: `(n,)`, which have not rolled away.
    """

    def __init__(self, assets: Sequence[Asset], radius: float) -> None:
        """Compiles the scene.

        Args:
          assets: In the order in which they are to fall.
          radius: Of the walls [m].
        """
        self._assets = assets
        self.kept = np.ones(len(assets), bool)
        self._model = _compiled(assets, radius)
        self._data = mujoco.MjData(self._model)
        model = self._model
        self._bodies = np.array([model.body(f"{i}/object").id for i in range(len(assets))])
        self._joints = model.body_jntadr[self._bodies]
        self._owner = np.full(model.nbody, -1)
        for i, body in enumerate(self._bodies):
            self._owner[model.body_rootid == body] = i
        self._geom_owner = self._owner[model.geom_bodyid]
        self._fallen = 0
        self._masks = model.geom_contype.copy(), model.geom_conaffinity.copy()
        self._touching = np.ones(model.ngeom, bool)
        for i in range(len(assets)):
            self._park(i)
        mujoco.mj_forward(model, self._data)

    def drop(
        self,
        order: int,
        rotation: Float[np.ndarray, "3 3"],
        xy: Float[np.ndarray, "2"],
        gap: float,
        speed: float,
    ) -> None:
        """Let the next object fall from just above what lies there, its label's origin taken for the middle of its box.

        A tool, whose origin is elsewhere, may begin lower (`docs/experiments/pile_drops.md`).

        Args:
          order: Which; each once, from 0 on.
          rotation: `R_world_object`.
          xy: Of the middle of its label [m].
          gap: Between it and the highest point that lies there [m].
          speed: Downwards, to begin with [m/s].
        """
        assert order == self._fallen
        pose = np.eye(4)
        pose[:3, :3] = rotation
        label = self._assets[order].label
        reach = np.abs((rotation @ label.rotation)[2]) @ label.extents / 2
        middle = np.array([*xy, self._top() + gap + reach])
        pose[:3, 3] = middle - rotation @ label.origin
        joint = self._joints[order]
        address, velocity = self._model.jnt_qposadr[joint], self._model.jnt_dofadr[joint]
        self._data.qpos[address : address + 7] = pose_to_vector(pose)
        self._data.qvel[velocity : velocity + 6] = [0.0, 0.0, -speed, 0.0, 0.0, 0.0]
        self._model.body_gravcomp[self._owner == order] = 0.0
        self._fallen += 1
        self._touching[self._geom_owner == order] = True
        self._update_touching()

    def run(self, duration: float) -> None:
        """Let time pass [s]."""
        mujoco.mj_step(self._model, self._data, round(duration / self._model.opt.timestep))

    def remove_walls(self) -> None:
        """Take the walls away; what leaned on them moves."""
        self._model.opt.timestep = _SETTLE_TIMESTEP
        walls = [self._model.geom(f"wall_{k}").id for k in range(_WALLS)]
        self._touching[walls] = False
        self._update_touching()

    def step_finely(self) -> None:
        """From now on let time pass in the benchmark's steps."""
        self._model.opt.timestep = PILE_TIMESTEP

    def rest(
        self,
        longest: float,
        still: float,
        limits: tuple[float, float],
        spread: float,
        *,
        momentary: tuple[float, float] | None = None,
    ) -> bool:
        """Let time pass until everything has been still for a while; whether it came to that.

        Args:
          longest: Time that may pass [s].
          still: For how long it has to be still [s].
          limits: Of speeds that count as still, means over the time between two looks [m/s, rad/s].
          spread: What gets farther from the middle is taken away [m].
          momentary: Limits of the speeds at each look as well; None: objects may tremble on the spot, as they do
            in coarse steps [m/s, rad/s].
        """
        quiet = 0.0
        before = self._configurations()
        for _ in range(round(longest / _PIECE)):
            self.run(_PIECE)
            self._take_away(spread)
            now = self._configurations()
            calm = (_way(before, now) / _PIECE < limits).all()
            if momentary is not None:
                velocity = self._data.qvel.reshape(-1, 2, 3)
                calm &= (np.linalg.norm(velocity, axis=2) < momentary).all()
            before = now
            quiet = quiet + _PIECE if calm else 0.0
            if quiet > still - 1e-9:
                return True
        return False

    def _configurations(self) -> Float[np.ndarray, "n 7"]:
        """Of each object, its position [m] and quaternion."""
        rows = self._model.jnt_qposadr[self._joints][:, None] + np.arange(7)
        return self._data.qpos[rows]

    def _take_away(self, spread: float) -> None:
        """Make what rolled away wait again."""
        away = np.linalg.norm(self._configurations()[:, :2], axis=1) > spread
        for i in np.flatnonzero(self.kept & away).tolist():
            self.kept[i] = False
            self._park(i)

    def _park(self, i: int) -> None:
        """Make an object wait high above, touching nothing, not even the walls, which know no top."""
        joint = self._joints[i]
        address, velocity = self._model.jnt_qposadr[joint], self._model.jnt_dofadr[joint]
        self._data.qpos[address : address + 7] = [0, 0, _PARKING_HEIGHT * (i + 1), 1, 0, 0, 0]
        self._data.qvel[velocity : velocity + 6] = 0.0
        self._model.body_gravcomp[self._owner == i] = 1.0
        self._touching[self._geom_owner == i] = False
        self._update_touching()

    @property
    def diverged(self) -> bool:
        """Whether MuJoCo found the motion unstable, and put everything back to where it waited."""
        kinds = mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL
        kinds = *kinds, mujoco.mjtWarning.mjWARN_BADQACC
        return any(self._data.warning[kind].number for kind in kinds)

    def penetration(self) -> float:
        """The deepest overlap of any two objects [m]."""
        return max(0.0, -float(self._data.contact.dist.min(initial=0.0)))

    def poses(self) -> Float[np.ndarray, "n 4 4"]:
        """`T_table_object`, the middle between the walls at the origin."""
        addresses = self._model.jnt_qposadr[self._joints]
        return np.stack([vector_to_pose(self._data.qpos[a : a + 7].copy()) for a in addresses])

    def set_poses(self, poses: Float[np.ndarray, "n 4 4"]) -> None:
        """Put everything at `T_table_object`, at rest."""
        for joint, pose in zip(self._joints, poses, strict=True):
            address = self._model.jnt_qposadr[joint]
            self._data.qpos[address : address + 7] = pose_to_vector(pose)
        self._data.qvel[:] = 0.0
        mujoco.mj_forward(self._model, self._data)

    def supports(self) -> Bool[np.ndarray, "n n"]:
        """`[i, j]`: object `i` rests on object `j`."""
        mujoco.mj_forward(self._model, self._data)
        count = len(self._assets)
        found = np.zeros((count, count), bool)
        for contact in self._data.contact:
            first, second = self._geom_owner[contact.geom1], self._geom_owner[contact.geom2]
            if first < 0 or second < 0 or contact.dist > 0:
                continue
            # The normal points from the first to the second.
            if contact.frame[2] > _MIN_LEVEL:
                found[second, first] = True
            elif contact.frame[2] < -_MIN_LEVEL:
                found[first, second] = True
        return found

    def grasp_obstacles(self) -> Bool[np.ndarray, "n g m"]:
        """`[i, k, j]`: the open hand's straight way to grasp `k` of object `i` meets object `j`; last, the table.

        Into the table, through the object itself, beyond an object's last grasp, and of an object that rolled away,
        it meets everything.
        """
        sets = [asset.grasps for asset in self._assets]
        count = len(sets)
        most = max(0 if grasps is None else len(grasps.widths) for grasps in sets)
        found = np.ones((count, most, count + 1), bool)
        model, data = self._model, self._data
        parts = [model.body(name).id for name in ("left", "right", "hand")]
        hand = np.isin(model.geom_bodyid, parts)
        mocap = model.body_mocapid[parts]
        touching, flags = model.geom_contype.copy(), model.opt.disableflags
        model.geom_contype[~hand] = 0
        # What objects fall with finds overlaps of shapes that are apart, where there are margins.
        model.opt.disableflags &= ~_NATIVE_CCD_OFF
        gripper = ParallelJaw()
        for i, (grasps, pose) in enumerate(zip(sets, self.poses(), strict=True)):
            for k in range(len(grasps.widths) if grasps is not None and self.kept[i] else 0):
                assert grasps is not None
                tcp = pose @ grasps.poses[k]
                half = float(gripper.opening(grasps.widths[k])) / 2
                vector = pose_to_vector(tcp)
                data.mocap_pos[mocap] = vector[:3] + np.outer([half, -half, 0.0], tcp[:3, 1])
                data.mocap_quat[mocap] = vector[3:]
                mujoco.mj_kinematics(model, data)
                # MuJoCo knows no contact of the hand, which nothing moves, with the table.
                reach = np.abs(data.geom_xmat[hand][:, 6:9] * model.geom_size[hand]).sum(axis=1)
                if (data.geom_xpos[hand, 2] - reach).min() < _TABLE_MARGIN:
                    continue
                mujoco.mj_collision(model, data)
                contact = data.contact
                met = np.where(hand[contact.geom1], contact.geom2, contact.geom1)
                own = self._geom_owner[met] == i
                if (contact.dist[own] < -_BRUSHED).any():
                    continue  # the object itself is in the way of its grasp
                found[i, k] = False
                # The table is of no object: -1.
                found[i, k, self._geom_owner[met[~own & (contact.dist < _FINGER_MARGIN)]]] = True
        model.geom_contype[:], model.opt.disableflags = touching, flags
        data.mocap_pos[mocap] = _HAND_PARKING
        mujoco.mj_forward(model, data)
        return found

    def most_seen(self, i: int, enough: float) -> float:
        """The share of an object that is seen from where most of it is; beyond `enough`, some of it."""
        middle = self.poses()[self.kept][:, :2, 3].mean(axis=0)
        return most_seen(self._model, self._data, self._geom_owner == i, middle, enough)

    def _update_touching(self) -> None:
        contype, conaffinity = self._masks
        self._model.geom_contype[:] = np.where(self._touching, contype, 0)
        self._model.geom_conaffinity[:] = np.where(self._touching, conaffinity, 0)

    def _top(self) -> float:
        """Height of the highest point of what has fallen, as in `drop` [m]."""
        tops = [0.0]
        for pose, asset in zip(self.poses()[: self._fallen], self._assets, strict=False):
            label = pose @ asset.label.pose
            tops.append(label[2, 3] + np.abs(label[2, :3]) @ asset.label.extents / 2)
        return max(tops)


def _way(before: Float[np.ndarray, "n 7"], now: Float[np.ndarray, "n 7"]) -> np.ndarray:
    """How far anything went at most, and how far it turned, between two configurations [m, rad]."""
    went = np.linalg.norm(now[:, :3] - before[:, :3], axis=1).max()
    # A quaternion and its opposite are the same; the chord between two is half the angle, if small.
    chords = [np.linalg.norm(now[:, 3:] - sign * before[:, 3:], axis=1) for sign in (1, -1)]
    return np.array([went, 2 * np.min(chords, axis=0).max()])


def _compiled(assets: Sequence[Asset], radius: float) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    set_physics(spec.option, _DROP_TIMESTEP)
    spec.option.disableflags |= _NATIVE_CCD_OFF
    spec.memory = 64 * 2**20
    world = spec.worldbody
    table = world.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=TABLE_HALF_EXTENTS,
        pos=[0, 0, TABLE_CENTER[2]],
        contype=_FIXED,
        conaffinity=_OBJECT,
    )
    # As hard and as rough as the arena's.
    table.condim, table.friction = SUPPORT_CONDIM, SUPPORT_FRICTION
    table.solref = np.array([PILE_CONTACT_TIME, 1.0])
    table.solimp[:3] = SOLIMP
    for k in range(_WALLS):
        angle = 2 * np.pi * k / _WALLS
        outwards = np.array([np.cos(angle), np.sin(angle), 0.0])
        wall = world.add_geom(
            name=f"wall_{k}",
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[0, 0, 0.1],
            pos=radius * outwards,
            # A plane's normal is its z: half a turn about what lies midway between it and inwards.
            quat=[0.0, *_half_way(np.array([0.0, 0.0, 1.0]), -outwards)],
            contype=_FIXED,
            conaffinity=_OBJECT,
        )
        wall.friction = [0.1, 0.005, 0.0001]
    _add_hand(world)
    for i, asset in enumerate(assets):
        child = mujoco.MjSpec.from_file(str(asset.model_path))
        body = child.worldbody.first_body()
        body.name = "object"
        frame = world.add_frame()
        spec.attach(child, frame=frame, prefix=f"{i}/")
        # Compiled in, or MuJoCo would not look for it.
        body.gravcomp = 1.0
        for geom in body.find_all("geom"):
            if geom.contype:
                geom.contype, geom.conaffinity = _OBJECT, _OBJECT | _FIXED | _HAND
                geom.solref = np.array([PILE_CONTACT_TIME, 1.0])
    return spec.compile()


def _half_way(a: Float[np.ndarray, "3"], b: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """The unit vector midway between two."""
    return (a + b) / np.linalg.norm(a + b)


def _add_hand(world: mujoco.MjsBody) -> None:
    """The hand's boxes, each as long as its straight way in; they touch nothing while objects fall."""
    gripper = ParallelJaw()
    finger = np.array(gripper.finger)
    bodies = {
        "left": finger,
        "right": np.sort(finger * [-1, -1, 1], axis=1),
        "hand": np.array(gripper.hand),
    }
    for name, boxes in bodies.items():
        body = world.add_body(name=name, mocap=True, pos=_HAND_PARKING)
        for low, high in boxes:
            low = low - np.array([0, 0, _STANDOFF])
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=(high - low) / 2,
                pos=(high + low) / 2,
                contype=_HAND,
                conaffinity=0,
                margin=_FINGER_MARGIN,
            )
