"""What is drawn for each world: the domain randomisation, the grip of the pads, and errors of where things stand."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import inf, radians

import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.mjcf.panda.robot import HOME, MAX_OPENING
from manipose_mj.mjcf.sleep import sleep_disabled
from manipose_mj.poses import quaternion_to_rotation, rotation_about, rotation_to_quaternion
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.core.randomisation import Randomisation, Randomiser
from manipose_mj.tasks.core.start import EpisodeStart, ModelChanges, PlacedObject

# Of the model, what a plan's success depends on.
_FIELDS = ("geom_friction", "body_mass", "body_inertia", "actuator_gainprm", "actuator_biasprm")
# What is drawn, and in which units people read it.
FACTORS: tuple[str, ...] = ("friction", "pad_friction", "mass", "gains")
ERRORS: tuple[str, ...] = (
    "latency_ms",
    "shift_cm",
    "turn_deg",
    "object_shift_cm",
    "object_turn_deg",
)
DRAWN = (*FACTORS, *ERRORS)
_MOST_LATENCY_MS = 10_000
_DEEPER = 0.001  # than things are pressed into each other in the plan's world, at most [m]
_TRIES = 20  # at a place for an object where it is not


@dataclass(frozen=True)
class Variation:
    """How much is drawn.

    Attributes:
      friction, mass, gains: Factors are log-uniform between 1 / f and f; see `Randomisation`. What the finger pads touch
        has the friction of the pads.
      pad_friction: The same for the pads of the fingers, in sliding.
      latency_ms: Most by which servo targets come late, uniform from none; below 10,000.
      shift_cm: Most by which all objects and furniture stand, as one, beside where the plan has them, as a camera makes
        them appear that is wrongly calibrated; in any direction on the table, the distance uniform.
      turn_deg: Most by which they are turned as one, uniform both ways, about the vertical through the first
        object, or through the first piece of furniture where there is no object. What stands at a distance d from
        there goes d times the turn besides: 5 cm at 0.6 m and 5 deg, whatever `shift_cm` is.
      object_shift_cm: Most by which each object stands beside that, on its own, as an error of its pose does.
      object_turn_deg: Most by which each object is turned on its own, about the vertical through its label's origin. An
        object that would stand 1 mm in something is drawn again, and stays where it was after twenty such places.
    """

    friction: float = 1.5
    pad_friction: float = 1.5
    mass: float = 1.4
    gains: float = 1.2
    latency_ms: float = 40.0
    shift_cm: float = 1.0
    turn_deg: float = 5.0
    object_shift_cm: float = 0.5
    object_turn_deg: float = 2.0

    def __post_init__(self) -> None:
        for name in FACTORS:
            if not 1 <= getattr(self, name) < inf:
                raise InputError(
                    f"--{_option(name)} is {getattr(self, name)}; expected a factor of 1 or more"
                )
        for name in ERRORS:
            if not 0 <= getattr(self, name) < inf:
                raise InputError(f"--{_option(name)} is {getattr(self, name)}; expected 0 or more")
        if self.latency_ms >= _MOST_LATENCY_MS:
            raise InputError(
                f"--latency-ms is {self.latency_ms}; expected less than {_MOST_LATENCY_MS}"
            )

    @property
    def strength(self) -> Randomisation:
        """Of the model's fields; what is seen does not matter to a plan."""
        return Randomisation(
            friction=self.friction,
            mass=self.mass,
            gains=self.gains,
            latency=self.latency_ms / 1000,
        )


class Varied:
    """Draws other worlds for one start of a task's environment, which was reset to it."""

    def __init__(self, environment: TaskEnvironment, variation: Variation) -> None:
        task, physics = environment.task, environment.physics
        pads = np.asarray(physics.bind(task.robot.pad_geoms).element_id)
        self._task, self._physics = task, physics
        self._variation, self._pads = variation, pads
        self._pressed: float | None = None  # depth of the plan's start, once it is needed [m]
        self._randomiser = Randomiser(
            variation.strength, physics, task.scene.rigid_objects, pads.tolist()
        )
        model = physics.model.ptr
        free = np.setdiff1d(np.arange(model.ngeom), pads)
        # Where the factors can be read from what was drawn.
        self._geom = int(free[model.geom_friction[free, 0] > 0][0])
        bodies = [physics.bind(o.mjcf_model.find_all("body")) for o in task.objects.values()]
        self._body = int(bodies[0].element_id[0]) if bodies else None
        self._compiled = {name: np.array(getattr(model, name)) for name in _FIELDS}

    def draw(
        self, start: EpisodeStart, rng: np.random.RandomState, *, nominal: bool = False
    ) -> tuple[EpisodeStart, dict[str, float]]:
        """Another world for the same plan, and what was drawn.

        `shift_cm` is of what the rest is turned about, the objects' own errors are those of the first one. The
        environment's simulation is left anywhere.

        Args:
          start: As the plan was made for.
          rng: Draws.
          nominal: Whether to draw nothing, and only state every field of the model.
        """
        if nominal:
            return self.compiled(start), _nothing()
        changes = self._randomiser.draw(rng)
        direction = rng.uniform(-np.pi, np.pi)
        distance = rng.uniform(0, self._variation.shift_cm) / 100
        turn = rng.uniform(-1, 1) * radians(self._variation.turn_deg)
        grip = float(np.exp(rng.uniform(-1, 1) * np.log(self._variation.pad_friction)))
        # However often it draws, the next world is the same.
        own = np.random.RandomState(rng.randint(2**31))
        if grip != 1.0:
            # A start states all fields of the model or none.
            changes = replace(changes, fields={**self._stated(), **changes.fields})
            changes.fields["geom_friction"][self._pads, 0] *= grip
        drawn = self._factors(changes) | {"pad_friction": grip}
        shift = distance * np.array([np.cos(direction), np.sin(direction), 0.0])
        drawn |= {"shift_cm": 100 * distance, "turn_deg": float(np.rad2deg(turn))}
        moved = replace(_moved(start, shift, turn), model=changes)
        moved, errors = self._with_own_errors(moved, start, own)
        return moved, drawn | errors

    def _with_own_errors(
        self, start: EpisodeStart, planned: EpisodeStart, rng: np.random.RandomState
    ) -> tuple[EpisodeStart, dict[str, float]]:
        """Each object beside where it was, and the first one's errors.

        Args:
          start: Moved as one.
          planned: As the plan was made for.
          rng: Draws.
        """
        errors = {"object_shift_cm": 0.0, "object_turn_deg": 0.0}
        most = self._variation.object_shift_cm, self._variation.object_turn_deg
        if most == (0.0, 0.0):
            return start, errors
        if self._pressed is None:
            self._pressed = self.depth(planned)
        with self._standing(start):
            for number, name in enumerate(start.objects):
                for _ in range(_TRIES):
                    direction, turn = rng.uniform(-np.pi, np.pi), rng.uniform(-1, 1) * most[1]
                    distance = rng.uniform(0, most[0])
                    shift = distance / 100 * np.array([np.cos(direction), np.sin(direction), 0.0])
                    other = _with_object_moved(start, name, shift, radians(turn))
                    self._place(other.objects[name])
                    if self._depth() <= self._pressed + _DEEPER:
                        start = other
                        if number == 0:
                            errors = {"object_shift_cm": distance, "object_turn_deg": turn}
                        break
                else:
                    self._place(start.objects[name])
        return start, errors

    @contextmanager
    def _standing(self, start: EpisodeStart) -> Iterator[None]:
        """While everything is where it is at the start, before it settles."""
        task, physics = self._task, self._physics
        with physics.reset_context(), sleep_disabled(physics):
            task.robot.set_configuration(physics, HOME, MAX_OPENING)
            task.scene.write(physics, start)
            yield

    def _place(self, placed: PlacedObject) -> None:
        objects = self._task.scene.objects
        assert objects is not None, "a start with objects is of a scene with objects"
        objects.entities[placed.index].place(self._physics, placed.pose)

    def _depth(self) -> float:
        """How deep things are pressed into each other at most [m]."""
        self._physics.forward()
        return -float(self._physics.data.contact.dist.min(initial=0.0))

    def depth(self, start: EpisodeStart) -> float:
        """How deep things are pressed into each other at most, before they settle [m]."""
        with self._standing(start):
            return self._depth()

    def compiled(self, start: EpisodeStart) -> EpisodeStart:
        """The start in the model as it was compiled, every field of it stated."""
        return replace(start, model=ModelChanges(self._stated()))

    def _stated(self) -> dict[str, np.ndarray]:
        return {name: values.copy() for name, values in self._compiled.items()}

    def _factors(self, changes: ModelChanges) -> dict[str, float]:
        fields = {**self._compiled, **changes.fields}
        ratio = {
            name: fields[name] / np.where(now == 0, 1, now) for name, now in self._compiled.items()
        }
        gains = ratio["actuator_gainprm"][:, 0]
        return {
            "friction": float(ratio["geom_friction"][self._geom, 0]),
            "mass": 1.0 if self._body is None else float(ratio["body_mass"][self._body]),
            "gains": float(np.exp(np.log(gains).mean())),
            "latency_ms": 1000 * changes.latency,
        }


def _nothing() -> dict[str, float]:
    return dict.fromkeys(FACTORS, 1.0) | dict.fromkeys(ERRORS, 0.0)


def _option(name: str) -> str:
    return name.replace("_", "-")


def _moved(start: EpisodeStart, shift: Float[np.ndarray, "3"], turn: float) -> EpisodeStart:
    """Objects and furniture beside where they were: all turned about `_centre`, then shifted."""
    about = rotation_about(np.array([0.0, 0.0, 1.0]), turn)
    centre = _centre(start)

    def place(position: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
        return centre + about @ (position - centre) + shift

    objects = {}
    for name, placed in start.objects.items():
        pose = placed.pose.copy()
        pose[:3, :3], pose[:3, 3] = about @ pose[:3, :3], place(pose[:3, 3])
        objects[name] = replace(placed, pose=pose)
    furniture = tuple(
        replace(
            piece,
            position=place(np.asarray(piece.position, float)),
            quaternion=rotation_to_quaternion(
                about @ quaternion_to_rotation(np.asarray(piece.quaternion, float))
            ),
        )
        for piece in start.furniture
    )
    return replace(start, objects=objects, furniture=furniture)


def _with_object_moved(
    start: EpisodeStart, name: str, shift: Float[np.ndarray, "3"], turn: float
) -> EpisodeStart:
    """One object turned about the vertical through the origin of its pose, then shifted."""
    placed = start.objects[name]
    pose = placed.pose.copy()
    pose[:3, :3] = rotation_about(np.array([0.0, 0.0, 1.0]), turn) @ pose[:3, :3]
    pose[:3, 3] += shift
    return replace(start, objects={**start.objects, name: replace(placed, pose=pose)})


def _centre(start: EpisodeStart) -> Float[np.ndarray, "3"]:
    """What all else is turned about: the first object, or the first piece of furniture where there is none."""
    for placed in start.objects.values():
        return placed.pose[:3, 3].copy()
    return np.asarray(start.furniture[0].position, float)
