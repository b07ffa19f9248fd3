"""Draws a pool of starts: runs the CPU task's own reset for every seed and keeps what it leaves."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from dm_control import mjcf
from jaxtyping import Float, Int

from manipose_mj import suite
from manipose_mj.actions import control_law
from manipose_mj.batch.measurement import Addresses, measure
from manipose_mj.batch.starts import Layout, Start, StartPool
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.mjcf.cameras.clouds import geom_instances
from manipose_mj.mjcf.cameras.ray_camera import camera_id
from manipose_mj.poses import SymmetryGroup
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec, check_seed
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.core.simulation_state import read_simulation
from manipose_mj.tasks.core.snapshot import MODEL_FIELDS
from manipose_mj.tasks.core.start import EpisodeStart
from manipose_mj.tasks.goals import Goal
from manipose_mj.tasks.observations.pose_observables import MAX_TURNS
from manipose_mj.tasks.observations.sensor_config import PoseNoise
from manipose_mj.tasks.observations.sensors import parse_modes
from manipose_mj.tasks.scene.indices import FIRST, NOBODY, SceneShapes, find_indices, shapes_of

OBSERVED = ("state", "pose")  # modes
_ROBOT = "panda"  # whose single keys are modes too
# Makes other starts of an environment that was reset to one; how many there are is the caller's business.
Vary = Callable[[TaskEnvironment, EpisodeStart], Iterable[EpisodeStart]]
_CONSTANT = tuple(
    f"pose/{kind}/" for kind in ("symmetry", "symmetry_count", "axial", "bounds", "counts")
)


@dataclass(frozen=True)
class _Names:
    """Attributes: objects, slots; parts, of the furniture by their slots."""

    objects: tuple[str, ...]
    parts: dict[str, str]


def draw_pool(
    config: EnvConfig,
    episodes: Sequence[int | EpisodeSpec],
    vary: Vary | None = None,
    *,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> StartPool:
    """The starts of these episodes, as `suite.make(config)` begins them.

    Args:
      config: Of the task.
      episodes: Their seeds, or what they are, with seeds; each seed once.
      vary: Gives the starts to take instead of each episode's own; all of them have its seed. They state every field
        of the model that any of them changes.
      on_progress: Called with the number of episodes drawn and that of all.

    Raises:
      InputError: A mode cannot be batched, a seed is none, or the task cannot use the objects.
    """
    _require_batchable(config)
    if not episodes:
        raise InputError("no seeds: a batch of worlds needs at least one start")
    for each in episodes:
        if not isinstance(each, EpisodeSpec):
            check_seed(each)
    specs = [e if isinstance(e, EpisodeSpec) else EpisodeSpec(seed=int(e)) for e in episodes]
    seen: set[int | None] = set()
    for spec in specs:
        if spec.seed in seen:
            raise InputError(f"seed {spec.seed} is given twice; expected each seed once")
        seen.add(spec.seed)
    environment = suite.make(config, specs[0].seed)
    assert isinstance(environment, TaskEnvironment)
    drawn = _Drawing(environment, config)
    for done, spec in enumerate(specs, 1):
        drawn.add(spec, vary)
        on_progress(done, len(specs))
    environment.close()
    return drawn.pool()


def _require_batchable(config: EnvConfig) -> None:
    control_law(config.control_mode)
    for mode in parse_modes(config.obs_mode):
        if mode.split("/")[0] not in (*OBSERVED, _ROBOT):
            raise unknown_name("observation mode of batched worlds", mode, OBSERVED)
    if config.sensors.pose_noise != PoseNoise():
        raise InputError("pose noise is not available in batched worlds: set sensors without it")
    if config.sensors.pose_error or config.sensors.camera_error:
        raise InputError("batched worlds know no errors of poses or cameras: set sensors without")


class _Drawing:
    """Scenes and starts so far."""

    def __init__(self, environment: TaskEnvironment, config: EnvConfig) -> None:
        self._environment, self._config = environment, config
        self._scenes: dict[Hashable, int] = {}
        self._models: list[mujoco.MjModel] = []
        self._compiled: list[dict[str, np.ndarray]] = []
        self._starts: list[Start] = []
        self._xml: tuple[str, dict[str, bytes]] = ("", {})
        self._layout: Layout | None = None

    def add(self, spec: EpisodeSpec, vary: Vary | None = None) -> None:
        environment, seed = self._environment, spec.seed
        assert seed is not None, "an episode of a pool has a seed"
        observation = environment.reset(spec).observation
        task, physics = environment.task, environment.physics
        names = _Names(task.observed_objects, _part_slots(task.goals))
        self._widen(names, observation)
        scene = self._scene_of(environment)
        if vary is None:
            self._keep(seed, scene, observation)
            return
        assert task.start is not None
        for other in vary(environment, task.start):
            with physics.reset_context():
                task.write(physics, other)
            self._keep(seed, scene, observation)

    def _keep(self, seed: int, scene: int, observation: Mapping[str, Any]) -> None:
        """The start at which the environment's simulation is."""
        model = self._environment.physics.model.ptr
        changed = {
            name: np.array(getattr(model, name))
            for name, compiled in self._compiled[scene].items()
            if not np.array_equal(getattr(model, name), compiled)
        }
        start = _start_of(self._environment, seed, scene, changed, self._slots(), observation)
        self._starts.append(start)

    def pool(self) -> StartPool:
        layout = self._layout
        assert layout is not None
        return StartPool(layout, tuple(self._models), tuple(self._starts), *self._xml)

    def _slots(self) -> Layout:
        assert self._layout is not None
        return self._layout

    def _widen(self, names: _Names, observation: Mapping[str, Any]) -> None:
        """Make the layout of the first episode; a later one must fit it."""
        if self._layout is None:
            self._layout = _layout_of(self._environment, self._config, names, observation)
        if not set(names.objects) <= set(self._layout.objects):
            raise InputError(
                f"{self._config.task}: observes {names.objects} in one episode and "
                f"{self._layout.objects} in another; batched worlds need the same names in all"
            )

    def _scene_of(self, environment: TaskEnvironment) -> int:
        objects = environment.scene_objects
        key = None if objects is None else objects.key
        if key not in self._scenes:
            if not self._scenes:
                root = environment.task.root_entity.mjcf_model
                self._xml = root.to_xml_string(), root.get_assets()
            self._scenes[key] = len(self._models)
            compiled = mujoco.MjModel.__copy__(environment.physics.model.ptr)
            self._models.append(compiled)
            self._compiled.append({n: np.array(getattr(compiled, n)) for n in MODEL_FIELDS})
        return self._scenes[key]


def _layout_of(
    environment: TaskEnvironment,
    config: EnvConfig,
    names: _Names,
    observation: Mapping[str, Any],
) -> Layout:
    task = environment.task
    goals = task.observed_goals
    frames = tuple(name for name in task.sensors.poses.names if name not in goals)
    timestep = task.physics_timestep
    return Layout(
        task=config.task,
        objects=task.observed_objects,
        parts=tuple(names.parts.values()),
        frames=frames,
        goal_frames=goals,
        cameras=config.sensors.camera_names,
        constants=tuple(name for name in observation if name.startswith(_CONSTANT)),
        timestep=timestep,
        substeps=task.physics_steps_per_control_step,
        horizon=_control_steps(task.config.horizon, timestep, task.physics_steps_per_control_step),
        tolerance=task.config.tolerance,
        reward_mode=config.reward_mode,
        obs_mode=config.obs_mode,
        control_mode=config.control_mode,
        shows_opening="opening" in task.extra_observables,
    )


def _start_of(
    environment: TaskEnvironment,
    seed: int,
    scene: int,
    changed: dict[str, np.ndarray],
    layout: Layout,
    observation: Mapping[str, Any],
) -> Start:
    task, physics = environment.task, environment.physics
    model, data = physics.model.ptr, physics.data.ptr
    parts = _part_slots(task.goals)
    if tuple(parts.values()) != layout.parts:
        raise InputError(f"{layout.task}: episodes differ in how many parts their goals name")
    indices = find_indices(physics, task.robot, task.objects, task.articulated_objects)
    known = shapes_of(list(task.objects.values()), task.articulated_objects)
    rows = {name: i for i, name in enumerate(indices.objects)}
    doors = [indices.parts.index(name) for name in parts]
    carriers = task.sensors.poses.carriers(physics)
    frame_bodies, frames = _frames(layout, task.sensors.poses.names, carriers)
    count, part_count = len(indices.objects), len(indices.parts)
    bodies = [int(indices.bodies[rows[n]]) if n in rows else 0 for n in layout.objects]
    bodies += [int(indices.bodies[count + i]) for i in doors]
    bodies += [int(indices.bodies[count + part_count + i]) for i in doors]
    addresses = Addresses(
        servos=task.robot.servos(physics).at,
        bodies=np.array([*bodies, *frame_bodies], int),
        dofs=np.array(
            [int(indices.speeds[rows[n], 0, 0]) if n in rows else 0 for n in layout.objects], int
        ),
        openings=indices.openings[doors],
        owners=_owners(indices.owners, [rows.get(n) for n in layout.objects], doors, count),
        cameras=np.array([camera_id(model, name) for name in layout.cameras], int),
    )
    goal_frames = np.zeros((len(layout.goal_frames), 4, 4))
    for row, name in enumerate(layout.goal_frames):
        if name in carriers.goals:
            goal_frames[row] = carriers.goals[name].pose
    assert task.start is not None
    return Start(
        seed=seed,
        object_name=task.object_name,
        scene=scene,
        model=changed,
        simulation=read_simulation(model, data).flat(),
        addresses=addresses,
        measurement=measure(model, data, addresses),
        shapes=_slot_shapes(known, [rows.get(n) for n in layout.objects], doors),
        goals=tuple(_renamed(goal, parts) for goal in task.goals),
        instances=_instances(environment),
        frames=frames,
        goal_frames=goal_frames,
        constants={name: np.array(observation[name]) for name in layout.constants},
        latency=round(task.start.model.latency / layout.timestep),
        servo_lag=task.robot.servo_lag(physics),
    )


def _instances(environment: TaskEnvironment) -> Int[np.ndarray, " geoms"]:
    """What segmentation calls each geom; 0: nothing of its own."""
    physics = environment.physics
    entities = environment.task.scene.instances.values()
    frames = [mjcf.get_attachment_frame(entity.mjcf_model) for entity in entities]
    bodies = [int(physics.bind(frame).element_id) for frame in frames]
    return geom_instances(physics.model.ptr, bodies) + 1


def _frames(
    layout: Layout, names: tuple[str, ...], carriers: Any
) -> tuple[list[int], Float[np.ndarray, "frames 4 4"]]:
    """The bodies that carry the layout's frames, and `T_body_frame`."""
    bodies, frames = [0] * len(layout.frames), np.zeros((len(layout.frames), 4, 4))
    place = {name: row for row, name in enumerate(layout.frames)}
    for row, body, pose in zip(carriers.rows, carriers.ids, carriers.poses, strict=True):
        slot = place[names[row]]
        bodies[slot], frames[slot] = int(body), pose
    return bodies, frames


def _owners(
    owners: np.ndarray, objects: Sequence[int | None], parts: Sequence[int], count: int
) -> np.ndarray:
    """Whose slot each geom belongs to."""
    slots = np.full(owners.max() + 1, NOBODY)
    slots[:NOBODY] = np.arange(NOBODY)
    for slot, row in enumerate(objects):
        if row is not None:
            slots[FIRST + row] = FIRST + slot
    for slot, row in enumerate(parts):
        slots[FIRST + count + row] = FIRST + len(objects) + slot
    return slots[owners]


def _slot_shapes(
    known: SceneShapes, objects: Sequence[int | None], parts: Sequence[int]
) -> SceneShapes:
    """The shapes in the order of the slots; nothing for objects that the episode does not have."""
    chosen = known.select([row or 0 for row in objects] if known.symmetries else [], list(parts))
    if objects and not known.symmetries:
        chosen = replace(
            chosen,
            frames=np.concatenate([np.tile(np.eye(4), (len(objects), 1, 1)), chosen.frames]),
            extents=np.zeros((len(objects), 3)),
            centers=np.zeros((len(objects), 3)),
            symmetries=(SymmetryGroup.identity(),) * len(objects),
        )
    padded = tuple(group.padded(MAX_TURNS) for group in chosen.symmetries)
    return replace(chosen, symmetries=padded)


def _part_slots(goals: Sequence[Goal]) -> dict[str, str]:
    """The slot of every part that goals name, in the order in which they do."""
    slots: dict[str, str] = {}
    for goal in goals:
        name = getattr(goal, "part", None)
        if isinstance(name, str) and name not in slots:
            slots[name] = "part" if not slots else f"part_{len(slots)}"
    return slots


def _renamed(goal: Goal, parts: Mapping[str, str]) -> Goal:
    part: Any = getattr(goal, "part", None)
    if not isinstance(part, str):
        return goal
    return replace(goal, part=parts[part])  # pyright: ignore[reportArgumentType, reportCallIssue]


def _control_steps(horizon: float, timestep: float, substeps: int) -> int:
    """How many control steps an episode has: until MuJoCo's clock, which adds up, is at the horizon."""
    time, steps = 0.0, 0
    while time < horizon:
        for _ in range(substeps):
            time += timestep
        steps += 1
    return steps
