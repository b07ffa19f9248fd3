"""How much room contacts and constraints take, from a probe: a few worlds whose hands go to the objects and beyond.

MuJoCo Warp's arrays have a fixed size. What does not fit is lost, and the episode is flagged; what is never used
costs memory. The probe plays some of a pool's starts on the CPU and counts.
"""

from __future__ import annotations

import hashlib
import json
import logging
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.batch.measurement import FlatMeasurement
from manipose_mj.batch.starts import RowModels, StartPool, awake
from manipose_mj.console.process import CORES
from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.mjcf.panda.servos import ServoAddresses
from manipose_mj.storage.cache_file import new_cache_file
from manipose_mj.storage.cache_root import cache_root
from manipose_mj.storage.source_hash import source_hash
from manipose_mj.tasks.core.simulation_state import unflatten, write_simulation

_log = logging.getLogger(__name__)
PROBED = 8  # starts
MARGIN = 1.5  # of what the probe saw
# On top of that: a hand that closes on what no probed hand closed on.
MORE_CONTACTS, MORE_CONSTRAINTS = 16, 96
# And for each part of furniture: jammed in its frame it has 48 rows, and an arm seldom jams all of them at once.
PART_CONSTRAINTS = 26
# Control steps: to above the object, down onto it, closing, lifting; then to joint angles drawn at random.
_PHASES = (30, 35, 15, 20)
_DRAWN_TARGETS, _HELD = 4, 25
_ABOVE, _INTO = 0.12, -0.02  # where the hand goes to, from the object's frame [m]
_DAMPING, _FURTHEST = 0.05, 0.1  # of the inverse kinematics; metres that it goes at once


@dataclass(frozen=True)
class Capacity:
    """Room of the engine `warp`.

    Attributes:
      contacts: Of a world on average, whose worlds share the room; pairs of shapes that are near each other count too.
      constraints: Rows of each world.
    """

    contacts: float
    constraints: int

    def __post_init__(self) -> None:
        for name in ("contacts", "constraints"):
            if not getattr(self, name) > 0:
                raise InputError(
                    f"capacity: {name} is {getattr(self, name)}; expected more than none"
                )


@dataclass(frozen=True)
class Peaks:
    """The most that worlds of a probe had at any moment.

    Attributes:
      contacts: Of each; or pairs of shapes near each other, where these were more.
      constraints: Rows of each.
      parts: Of furniture in a world, at most: drawers, doors and knobs.
    """

    contacts: Int[np.ndarray, " probed"]
    constraints: Int[np.ndarray, " probed"]
    parts: int = 0

    def capacity(self, worlds: int) -> Capacity:
        """Room for so many worlds, with a margin.

        One world can be the worst; many are as the probed ones on average, all of them at their worst at once.
        """
        mean, most = float(self.contacts.mean()), float(self.contacts.max())
        contacts = MARGIN * (mean + (most - mean) / worlds**0.5) + MORE_CONTACTS
        more = MORE_CONSTRAINTS + PART_CONSTRAINTS * self.parts
        constraints = MARGIN * int(self.constraints.max()) + more
        return Capacity(contacts, int(np.ceil(constraints)))


def kept_probe(pool: StartPool) -> Peaks:
    """`probe`, whose peaks are kept in the cache: nothing is played for a pool that was probed before."""
    path = _kept_at(pool)
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        contacts, constraints = (np.array(kept[name], int) for name in ("contacts", "constraints"))
        return Peaks(contacts, constraints, kept["parts"])
    except (OSError, ValueError, TypeError, KeyError):
        peaks = probe(pool)  # there are none, or they cannot be read
    values = {
        "contacts": peaks.contacts.tolist(),
        "constraints": peaks.constraints.tolist(),
        "parts": peaks.parts,
    }
    try:
        with new_cache_file(path) as scratch:
            scratch.write_text(json.dumps(values), encoding="utf-8")
    except InputError as error:
        _log.warning("peaks of contacts are not kept: %s", error)
    return peaks


def _kept_at(pool: StartPool) -> Path:
    """Another file for everything that a probe's peaks depend on."""
    digest = hashlib.sha256(repr((pool.layout, pool.seeds, pool.digest)).encode())
    for scene in pool.scenes:
        compiled = np.zeros(mujoco.mj_sizeModel(scene), np.uint8)
        mujoco.mj_saveModel(scene, None, compiled)
        digest.update(compiled.tobytes())
    code = source_hash((__name__,), mujoco.__version__, np.__version__)
    return cache_root() / "probes" / f"{code}-{digest.hexdigest()[:16]}.json"


def probe(pool: StartPool) -> Peaks:
    """Play some starts of a pool on the CPU, with nothing asleep; the same pool has the same peaks.

    Args:
      pool: Of starts; those that are played have from the fewest to the most contacts when they begin.
    """
    from manipose_mj.batch.simulator import Simulator, packed, state_size  # Numba is slow to load

    pool = replace(pool, scenes=tuple(awake(scene) for scene in pool.scenes))
    counter = _Counter(pool)
    rows = counter.spread(min(PROBED, len(pool.starts)))
    starts = [pool.starts[row] for row in rows]
    simulator, size = Simulator(pool, len(rows), threads=CORES), state_size(pool)
    first = np.stack([packed(start.simulation, size) for start in starts])
    states, seen, rng = first.copy(), simulator.room(), np.random.default_rng(pool.seeds)
    down = [start.measurement.tcp_rotation for start in starts]
    targets = np.stack([np.append(s.measurement.joints, MAX_OPENING) for s in starts])
    peaks = np.stack([counter.begun[row] for row in rows])
    for step in range(sum(_PHASES) + _DRAWN_TARGETS * _HELD):
        held = np.repeat(targets[:, None], pool.layout.substeps, axis=1)
        simulator.advance(states, np.asarray(rows), held, seen)
        measured = FlatMeasurement(seen.values, seen.contacts)
        now = measured.split(starts[0].measurement)
        states = np.where(seen.diverged[:, None], first, seen.states)
        for world in np.flatnonzero(~seen.diverged).tolist():
            model, data = simulator.held(world)
            peaks[world] = np.maximum(peaks[world], counter.count(rows[world], model, data))
            if step < sum(_PHASES):
                phase = int(np.searchsorted(np.cumsum(_PHASES), step, side="right"))
                goal = now.positions[world, 0] + [0, 0, _INTO if phase in (1, 2) else _ABOVE]
                at = starts[world].addresses.servos
                targets[world, :7] = _towards(model, data, at, goal, down[world])
                targets[world, 7] = MAX_OPENING if phase < 2 else 0.0
        if step >= sum(_PHASES) and (step - sum(_PHASES)) % _HELD == 0:
            targets = _drawn(rng, len(rows))
    simulator.close()
    jointed = max(_parts(pool.scenes[start.scene], start.addresses.servos) for start in pool.starts)
    return Peaks(peaks[:, 0], peaks[:, 1], jointed)


def _parts(model: mujoco.MjModel, at: ServoAddresses) -> int:
    """How many drawers, doors and knobs a scene has: what turns or slides and is not the robot."""
    single = np.isin(model.jnt_type, (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE))
    robot = [*range(model.nq)[at.angles], *range(model.nq)[at.fingers]]
    return int((single & ~np.isin(model.jnt_qposadr, robot)).sum())


def _towards(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    at: ServoAddresses,
    goal: Float[np.ndarray, "3"],
    rotation: Float[np.ndarray, "3 3"],
) -> Float[np.ndarray, "7"]:
    """Joint angles that bring the TCP nearer to a pose: one step of damped least squares."""
    jacobian = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], at.tcp)
    jacobian = jacobian[:, at.dofs]
    way = goal - data.site_xpos[at.tcp]
    way *= min(1.0, _FURTHEST / max(float(np.linalg.norm(way)), 1e-9))
    now = data.site_xmat[at.tcp].reshape(3, 3)
    turn = 0.5 * np.cross(now.T, rotation.T).sum(axis=0)
    inverse = jacobian @ jacobian.T + _DAMPING**2 * np.eye(6)
    step = jacobian.T @ np.linalg.solve(inverse, np.concatenate([way, turn]))
    return np.clip(data.qpos[at.angles] + step, *POSITION_LIMITS.T)


def _drawn(rng: np.random.Generator, count: int) -> Float[np.ndarray, "count 8"]:
    """Joint angles around home, up to half way to their limits, and openings."""
    low, high = (POSITION_LIMITS.T + HOME) / 2
    joints = rng.uniform(low, high, (count, 7))
    return np.concatenate([joints, rng.uniform(0, MAX_OPENING, (count, 1))], axis=1)


class _Counter:
    """Counts contacts, or pairs that are near each other if these are more, and rows of constraints.

    Attributes: begun: both, of every start.
    """

    def __init__(self, pool: StartPool) -> None:
        models = RowModels(pool)
        self._pairs = [touching_pairs(scene) for scene in pool.scenes]
        self._scenes = [start.scene for start in pool.starts]
        begun = []
        for row, start in enumerate(pool.starts):
            model = models.at(row)
            data = mujoco.MjData(model)
            write_simulation(model, data, unflatten(model, data, start.simulation))
            begun.append(self.count(row, model, data))
        self.begun: Int[np.ndarray, "starts 2"] = np.array(begun)

    def count(self, row: int, model: mujoco.MjModel, data: mujoco.MjData) -> tuple[int, int]:
        near = near_pairs(model, data, self._pairs[self._scenes[row]])
        # Of the physics steps in between MuJoCo remembers the most contacts, and not their rows.
        rows = data.nefc + (data.maxuse_con - data.ncon) * _rows_of_a_contact(model)
        return max(data.maxuse_con, near), rows

    def spread(self, count: int) -> Int[np.ndarray, " count"]:
        """So many starts, from the one with the fewest to the one with the most."""
        order = np.argsort(self.begun[:, 0], kind="stable")
        return order[np.linspace(0, len(order) - 1, count).round().astype(int)]


def _rows_of_a_contact(model: mujoco.MjModel) -> int:
    """The most that one can have."""
    dimensions = int(model.geom_condim.max())
    pyramid = model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
    return max(2 * (dimensions - 1), 1) if pyramid else dimensions


def near_pairs(
    model: mujoco.MjModel, data: mujoco.MjData, pairs: Int[np.ndarray, "pairs 2"]
) -> int:
    """How many pairs of shapes have bounding boxes that meet, as MuJoCo Warp finds those to look at closely.

    Args:
      model: Of them.
      data: With geoms in their places.
      pairs: That can touch at all, `touching_pairs`.
    """
    radius, reach = model.geom_rbound, model.geom_margin + model.geom_gap
    place, axes = data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3)
    one, other = pairs.T
    margin, between = reach[one] + reach[other], place[other] - place[one]
    plane_one, plane_other = radius[one] == 0, radius[other] == 0
    height = np.where(
        plane_one,
        np.einsum("pi,pi->p", between, axes[one, :, 2]),
        -np.einsum("pi,pi->p", between, axes[other, :, 2]),
    )
    far = np.where(plane_one | plane_other, height, np.linalg.norm(between, axis=1))
    near = far <= radius[one] + radius[other] + margin
    boxes = np.flatnonzero(near & ~plane_one & ~plane_other)
    met = _boxes_meet(model, place, axes, pairs[boxes], margin[boxes])
    return int(near.sum() - len(boxes) + met.sum())


def _boxes_meet(
    model: mujoco.MjModel,
    place: Float[np.ndarray, "geoms 3"],
    axes: Float[np.ndarray, "geoms 3 3"],
    pairs: Int[np.ndarray, "pairs 2"],
    margin: Float[np.ndarray, " pairs"],
) -> Bool[np.ndarray, " pairs"]:
    """Whether no face of either oriented box parts them."""
    middle = place + np.einsum("gij,gj->gi", axes, model.geom_aabb[:, :3])
    half, (one, other) = model.geom_aabb[:, 3:], pairs.T
    between = middle[other] - middle[one]
    angles = np.abs(np.einsum("pij,pik->pjk", axes[one], axes[other]))
    meet = np.ones(len(pairs), bool)
    for own, their, cosines in ((one, other, angles), (other, one, angles.swapaxes(1, 2))):
        apart = np.abs(np.einsum("pi,pij->pj", between, axes[own]))
        room = half[own] + np.einsum("pjk,pk->pj", cosines, half[their]) + margin[:, None]
        meet &= (apart <= room).all(axis=1)
    return meet


def touching_pairs(model: mujoco.MjModel) -> Int[np.ndarray, "pairs 2"]:
    """The pairs of geoms that MuJoCo lets touch: by their bits, and neither of one body nor of parent and child."""
    one, other = np.triu_indices(model.ngeom, 1)
    types, affinities = model.geom_contype, model.geom_conaffinity
    wanted = (types[one] & affinities[other]) | (types[other] & affinities[one])
    body = model.geom_bodyid
    weld = model.body_weldid[body]
    above = model.body_weldid[model.body_parentid[weld]]
    allowed = (wanted != 0) & (weld[one] != weld[other])
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        # What is welded to the world is nobody's parent in this sense.
        child = (weld[one] == above[other]) & (weld[one] != 0)
        allowed &= ~child & ~((weld[other] == above[one]) & (weld[other] != 0))
    low, high = np.minimum(body[one], body[other]), np.maximum(body[one], body[other])
    allowed &= ~np.isin((low << 16) + high, model.exclude_signature)
    return np.stack([one[allowed], other[allowed]], axis=1)
