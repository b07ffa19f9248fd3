"""What differs between the starts of one scene, as tables by row that a GPU can copy from."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from jaxtyping import Int

from manipose_mj.batch.slot_bodies import ScenePlaces
from manipose_mj.batch.slot_model import SlotModel, slot_model
from manipose_mj.batch.starts import RowModels, StartPool, awake
from manipose_mj.mjcf.panda.servos import ServoAddresses
from manipose_mj.poses import quaternion_to_rotation
from manipose_mj.tasks.core.simulation_state import unflatten, write_simulation
from manipose_mj.tasks.scene.indices import NOBODY

_STATES = ("qpos", "qvel", "ctrl", "qacc_warmstart")
# Of the fields that episodes change, those that a physics step or a camera's pose depends on.
_FIELDS = (
    "body_pos",
    "body_quat",
    "body_ipos",
    "body_iquat",
    "body_mass",
    "body_inertia",
    "body_subtreemass",
    "body_invweight0",
    "body_gravcomp",
    "jnt_pos",
    "jnt_axis",
    "jnt_range",
    "jnt_solref",
    "jnt_solimp",
    "jnt_stiffness",
    "jnt_margin",
    "dof_armature",
    "dof_damping",
    "dof_frictionloss",
    "dof_invweight0",
    "geom_friction",
    "geom_solref",
    "actuator_gainprm",
    "actuator_biasprm",
    "cam_pos",
    "cam_quat",
    "cam_fovy",
)
# What a body and its joint have that a scene lacks: nothing holds them, nothing moves them.
_UNUSED = {"jnt_range": (-1.0, 1.0), "dof_frictionloss": 0.0, "body_gravcomp": 1.0}
# MuJoCo Warp places geoms that cannot move once, not in every world anew.
_STATIC = ("geom_xpos", "geom_xmat")


class RowFields:
    """Tables with a row for each start.

    Attributes:
      model: Of the scene, with nothing asleep.
      geoms: For each scene, which of its geoms the model's are; -1: none.
      fields: Of the model, those that differ.
      static: Of the data, the poses of geoms.
      states: Where each start is.
      owners: Of the geoms, as in `Addresses`.
      addresses: Of measurements, by name.
    """

    def __init__(self, pool: StartPool, *, visual: bool = False) -> None:
        """Fills the tables.

        Args:
          pool: Of starts.
          visual: Whether to keep visual shapes where scenes differ.

        Raises:
          InputError: The pool's scenes differ in more than objects and furniture.
        """
        slots, models = slot_model(pool, visual=visual), RowModels(pool)
        self.model, self.geoms = awake(slots.model), slots.geoms
        fields: dict[str, list[np.ndarray]] = {}
        found: dict[str, list[np.ndarray]] = {name: [] for name in (*_STATIC, *_STATES)}
        owners = []
        for row, start in enumerate(pool.starts):
            model = awake(models.at(row))
            data = mujoco.MjData(model)
            write_simulation(model, data, unflatten(model, data, start.simulation))
            geoms, places = slots.geoms[start.scene], slots.places[start.scene]
            of_scene = {"body": places.bodies, "jnt": places.joints, "dof": places.dofs}
            of_scene["geom"] = geoms
            for name, values in _fields_of(model, of_scene, self.model).items():
                fields.setdefault(name, []).append(values)
            for name, values in slots.fields[start.scene].items():
                if visual or name != "geom_rgba":
                    fields.setdefault(name, []).append(values)
            for name, index, rest in (
                ("qpos", places.angles, self.model.qpos0),
                ("qvel", places.dofs, 0.0),
                ("qacc_warmstart", places.dofs, 0.0),
            ):
                found[name].append(np.where(index < 0, rest, getattr(data, name)[index]))
            found["ctrl"].append(np.array(data.ctrl))
            for name, values in _geom_poses(slots.model, slots, start.scene, data).items():
                found[name].append(values)
            owners.append(np.where(geoms < 0, NOBODY, start.addresses.owners[geoms]))
        stacked = {name: np.stack(values) for name, values in fields.items()}
        self.fields = {
            name: table
            for name, table in stacked.items()
            if (table != getattr(self.model, name)).any()
        }
        self.static = {name: np.stack(found[name]) for name in _STATIC}
        self.states = {name: np.stack(found[name]) for name in _STATES}
        self.owners: Int[np.ndarray, "starts geoms"] = np.stack(owners)
        self.addresses = {name: [] for name in ("bodies", "dofs", "openings", "cameras")}
        for start in pool.starts:
            at, places = start.addresses, slots.places[start.scene]
            _require_robot_first(at.servos, places)
            self.addresses["bodies"].append(places.placed("bodies", at.bodies))
            self.addresses["dofs"].append(places.placed("dofs", at.dofs))
            self.addresses["openings"].append(places.placed("angles", at.openings))
            self.addresses["cameras"].append(at.cameras)
        self.addresses = {name: np.stack(values) for name, values in self.addresses.items()}

    def to_device(self, model: Any, data: Any, worlds: int) -> list[tuple[Any, Any]]:
        """Give every world fields of its own in a model of MuJoCo Warp.

        Returns:
          Tables by start with the arrays by world that they are copied to.
        """
        import warp as wp  # pyright: ignore[reportMissingImports]

        pairs = []
        for name, table in self.fields.items():
            shared = getattr(model, name)
            kind = np.int32 if table.dtype.kind == "i" else np.float32
            first = np.repeat(table[:1], worlds, axis=0).astype(kind)
            scalar = shared.dtype in (wp.float32, wp.int32)
            shape = (worlds, *shared.shape[1:]) if scalar else (worlds, *shared.shape[1:], -1)
            own = wp.array(first.reshape(shape), dtype=shared.dtype)
            setattr(model, name, own)
            pairs.append((table, own))
        pairs += [(table, getattr(data, name)) for name, table in self.static.items()]
        return [_in_one_column(table, own, worlds) for table, own in pairs]


def _fields_of(
    model: mujoco.MjModel, of_scene: dict[str, Int[np.ndarray, "n"]], slots: mujoco.MjModel
) -> dict[str, np.ndarray]:
    """What may differ between starts, of the model with slots.

    Args:
      model: Of the start.
      of_scene: Its bodies, joints, dofs and geoms, in the order of the model with slots; -1: none.
      slots: The model with slots.
    """
    fields = {}
    for name in _FIELDS:
        own, index = np.array(getattr(model, name)), of_scene.get(name.split("_")[0])
        if index is None:
            fields[name] = own
            continue
        absent = (index < 0).reshape(-1, *(1,) * (own.ndim - 1))
        unused = _UNUSED.get(name, getattr(slots, name))
        fields[name] = np.where(absent, unused, own[index])
    return fields


def _geom_poses(
    model: mujoco.MjModel, slots: SlotModel, scene: int, data: mujoco.MjData
) -> dict[str, np.ndarray]:
    """Where the geoms of the model with slots are in a scene's state: `_STATIC` by name."""
    filled, bodies = slots.fields[scene], slots.places[scene].bodies
    if not filled:
        return {name: np.array(getattr(data, name)) for name in _STATIC}
    absent = bodies < 0
    origin = np.where(absent[:, None], 0.0, data.xpos[bodies])[model.geom_bodyid]
    turn = np.where(absent[:, None], np.eye(3).ravel(), data.xmat[bodies])[model.geom_bodyid]
    turn = turn.reshape(-1, 3, 3)
    # Meshes in slots were compiled again, and have other frames than in their scenes.
    positions = origin + np.einsum("gij,gj->gi", turn, filled["geom_pos"])
    rotations = turn @ quaternion_to_rotation(filled["geom_quat"])
    return {"geom_xpos": positions, "geom_xmat": rotations.reshape(-1, 9)}


def _require_robot_first(servos: ServoAddresses, places: ScenePlaces) -> None:
    """The robot has the same addresses in all scenes: it comes before objects and furniture."""
    for name, ids in (("angles", servos.angles), ("angles", servos.fingers), ("dofs", servos.dofs)):
        ids = np.arange(ids.start, ids.stop)
        assert np.array_equal(places.placed(name, ids), ids), "the robot does not come first"


def _in_one_column(table: np.ndarray, own: Any, worlds: int) -> tuple[Any, Any]:
    """A table on the device and the array that it is copied to, both as plain numbers, the latter as a view."""
    import warp as wp  # pyright: ignore[reportMissingImports]

    whole = table.dtype.kind == "i"
    kind, numbers = (int, np.int32) if whole else (float, np.float32)
    flat = np.ascontiguousarray(table.reshape(len(table), -1).astype(numbers))
    view = wp.array(
        ptr=own.ptr, shape=(worlds, flat.shape[1]), dtype=kind, device=own.device, copy=False
    )
    view._owner = own  # its memory lives as long as the view
    return wp.array(flat, dtype=kind), view
