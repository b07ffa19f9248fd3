"""A pool of starts: what the CPU task makes of each seed, as arrays that any engine can begin from."""

from __future__ import annotations

import hashlib
import pickle
from dataclasses import dataclass
from pathlib import Path

import jax
import mujoco
import numpy as np
from jaxtyping import Float, Int

from manipose_mj.batch.measurement import Addresses, Measurement
from manipose_mj.errors import InputError
from manipose_mj.storage.cache_file import new_cache_file
from manipose_mj.tasks import pytrees
from manipose_mj.tasks.goals import Goal, RewardMode, Tolerance
from manipose_mj.tasks.scene.indices import SceneShapes


@dataclass(frozen=True)
class Layout:
    """What is the same in all episodes of a task.

    Attributes:
      task: `"domain/name"`.
      objects: Names of the slots of rigid objects.
      parts: Names of the slots of drawers and doors that goals may name; those of the furniture itself may
        be others.
      frames: Names of the frames that `pose` observations show, without goals.
      goal_frames: Names of the goals that they show.
      cameras: In whose frames they show them as well.
      constants: Names of observations that an episode does not change, with their shapes and types.
      timestep: Of the physics [s].
      substeps: Physics steps in a control step.
      horizon: Control steps in an episode.
      tolerance: Of success.
      reward_mode: Of the reward.
      obs_mode: What is observed, as users write it.
      control_mode: What actions mean.
      shows_opening: Whether `pose/opening` is observed, the joint of the first part.
    """

    task: str
    objects: tuple[str, ...]
    parts: tuple[str, ...]
    frames: tuple[str, ...]
    goal_frames: tuple[str, ...]
    cameras: tuple[str, ...]
    constants: tuple[str, ...]
    timestep: float
    substeps: int
    horizon: int
    tolerance: Tolerance
    reward_mode: RewardMode
    obs_mode: str
    control_mode: str
    shows_opening: bool


@dataclass(frozen=True)
class Start:
    """How the episode of a seed begins.

    Attributes:
      seed: Of the episode, on the CPU as here.
      object_name: What the episode is about.
      scene: Which of the pool's models.
      model: Fields in which this episode's model differs from it.
      simulation: `SimulationState.flat` once all has come to rest.
      addresses: Of measurements in the model.
      measurement: At the start.
      shapes: Of the objects and parts in their slots.
      goals: With the names of the slots.
      instances: Of the geoms, as segmentation numbers them; 0: none.
      frames: `T_body_frame` of the layout's frames; zeros for those that the episode does not have.
      goal_frames: `T_world_label` of the layout's goals, likewise.
      constants: Observations that the episode does not change.
      latency: By how many physics steps servo targets come late.
      servo_lag: Of the joints' servos [s].
    """

    seed: int
    object_name: str
    scene: int
    model: dict[str, np.ndarray]
    simulation: Float[np.ndarray, "n"]
    addresses: Addresses
    measurement: Measurement
    shapes: SceneShapes
    goals: tuple[Goal, ...]
    instances: Int[np.ndarray, " geoms"]
    frames: Float[np.ndarray, "frames 4 4"]
    goal_frames: Float[np.ndarray, "goals 4 4"]
    constants: dict[str, np.ndarray]
    latency: int
    servo_lag: Float[np.ndarray, "7"]


@dataclass(frozen=True, eq=False)
class StartPool:
    """Starts by their rows, and the models that they are about.

    Attributes:
      layout: Of the task.
      scenes: Models; episodes change some fields of them.
      starts: One a seed.
      xml: Of the first scene.
      xml_assets: Files that it names.
    """

    layout: Layout
    scenes: tuple[mujoco.MjModel, ...]
    starts: tuple[Start, ...]
    xml: str
    xml_assets: dict[str, bytes]

    @property
    def seeds(self) -> tuple[int, ...]:
        """Of the starts, by row."""
        return tuple(start.seed for start in self.starts)

    @property
    def digest(self) -> str:
        """Of what the starts are about: objects, states, models, goals and latencies; equal for equal pools."""
        text = hashlib.sha256()
        for start in self.starts:
            text.update(f"{start.object_name} {start.scene} {start.latency}".encode())
            text.update(np.ascontiguousarray(start.simulation).tobytes())
            for name, values in sorted(start.model.items()):
                text.update(name.encode() + np.ascontiguousarray(values).tobytes())
            for goal in start.goals:
                pytrees.register(type(goal))  # or it is one leaf, whose bytes are an address
            leaves, structure = jax.tree.flatten((start.goals, start.shapes, start.constants))
            text.update(str(structure).encode())
            for leaf in leaves:
                text.update(np.ascontiguousarray(leaf).tobytes())
        return text.hexdigest()

    def rows(self, seeds: list[int]) -> list[int]:
        """Where the starts of these seeds are.

        Raises:
          InputError: The pool does not have one of them.
        """
        known = {seed: row for row, seed in enumerate(self.seeds)}
        for seed in seeds:
            if seed not in known:
                low, high = min(known), max(known)
                raise InputError(
                    f"seed {seed} is not in the pool of {len(known)} starts ({low} to {high}); "
                    "name it in `seeds` when the batch is made"
                )
        return [known[seed] for seed in seeds]

    def save(self, path: Path | str) -> None:
        """Write the pool to a file, to be read by the same version of MuJoCo."""
        with new_cache_file(Path(path)) as scratch:
            scratch.write_bytes(pickle.dumps((mujoco.__version__, self)))

    @classmethod
    def load(cls, path: Path | str) -> StartPool:
        """A pool that was saved; only load files that you trust.

        Raises:
          InputError: There is none, or it is of another version of MuJoCo.
        """
        try:
            version, pool = pickle.loads(Path(path).read_bytes())
        except Exception as error:  # damaged pickles raise anything
            reason = " ".join(_reason(error).split())
            raise InputError(
                f"{path}: no pool of starts can be read from it ({reason[:200]})"
            ) from None
        if version != mujoco.__version__:
            raise InputError(
                f"{path}: made with MuJoCo {version}; this is {mujoco.__version__}: draw it again"
            )
        if not isinstance(pool, cls):
            raise InputError(f"{path}: holds a {type(pool).__name__}, no pool of starts")
        return pool


def _reason(error: Exception) -> str:
    """Why a file could not be read, for people as far as it is known."""
    if isinstance(error, OSError):
        return error.strerror or str(error)
    if isinstance(error, EOFError):
        return "it is empty, or cut short"
    return f"{type(error).__name__}: {error}"


class RowModels:
    """A model for each start that is asked for, copied from its scene's at the first time."""

    def __init__(self, pool: StartPool) -> None:
        self._pool = pool
        self._models: dict[int, mujoco.MjModel] = {}

    def at(self, row: int) -> mujoco.MjModel:
        """The model of a start's scene with the start's own fields in it."""
        known = self._models.get(row)
        if known is None:
            start = self._pool.starts[row]
            known = mujoco.MjModel.__copy__(self._pool.scenes[start.scene])
            for name, values in start.model.items():
                getattr(known, name)[:] = values
            self._models[row] = known
        return known


def awake(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy in which nothing sleeps."""
    copied = mujoco.MjModel.__copy__(model)
    copied.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    return copied
