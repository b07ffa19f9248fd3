"""What is drawn for each world: the existing domain randomisation, and errors of where objects and furniture stand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians

import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.poses import quaternion_to_rotation, rotation_about, rotation_to_quaternion
from manipose_mj.tasks.core.environment import TaskEnvironment
from manipose_mj.tasks.core.randomisation import Randomisation, Randomiser
from manipose_mj.tasks.core.start import EpisodeStart, ModelChanges

# Of the model, what a plan's success depends on.
_FIELDS = ("geom_friction", "body_mass", "body_inertia", "actuator_gainprm", "actuator_biasprm")
# What is drawn, and in which units people read it.
DRAWN = ("friction", "mass", "gains", "latency_ms", "shift_cm", "turn_deg")


@dataclass(frozen=True)
class Variation:
    """How much is drawn.

    Attributes:
      friction, mass, gains: Factors are log-uniform between 1 / f and f; see `Randomisation`.
      latency_ms: Most by which servo targets come late, uniform from none.
      shift_cm: Most by which all objects and furniture stand, as one, beside where the plan has them; in any
        direction on the table, the distance uniform.
      turn_deg: Most by which they are turned as one, uniform both ways, about the vertical through the first
        object, or through the first piece of furniture where there is no object. What stands at a distance d from
        there goes d times the turn besides: 5 cm at 0.6 m and 5 deg, whatever `shift_cm` is.
    """

    friction: float = 1.5
    mass: float = 1.4
    gains: float = 1.2
    latency_ms: float = 40.0
    shift_cm: float = 1.0
    turn_deg: float = 5.0

    def __post_init__(self) -> None:
        for name in ("friction", "mass", "gains"):
            if not 1 <= getattr(self, name) < np.inf:
                raise InputError(
                    f"--{name} is {getattr(self, name)}; expected a factor of 1 or more"
                )
        for name in ("latency_ms", "shift_cm", "turn_deg"):
            if not 0 <= getattr(self, name) < np.inf:
                option = name.replace("_", "-")
                raise InputError(f"--{option} is {getattr(self, name)}; expected 0 or more")

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
        self._variation = variation
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
        """Another world for the same plan, and what was drawn; `shift_cm` is of what the rest is turned about.

        Args:
          start: As the plan was made for.
          rng: Draws.
          nominal: Whether to draw nothing, and only state every field of the model.
        """
        if nominal:
            return self.compiled(start), _nothing()
        changes = self._randomiser.draw(rng)
        drawn = self._factors(changes)
        direction = rng.uniform(-np.pi, np.pi)
        distance = rng.uniform(0, self._variation.shift_cm) / 100
        turn = rng.uniform(-1, 1) * radians(self._variation.turn_deg)
        shift = distance * np.array([np.cos(direction), np.sin(direction), 0.0])
        drawn |= {"shift_cm": 100 * distance, "turn_deg": float(np.rad2deg(turn))}
        return replace(_moved(start, shift, turn), model=changes), drawn

    def compiled(self, start: EpisodeStart) -> EpisodeStart:
        """The start in the model as it was compiled, every field of it stated."""
        fields = {name: values.copy() for name, values in self._compiled.items()}
        return replace(start, model=ModelChanges(fields))

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
    return dict(zip(DRAWN, (1.0, 1.0, 1.0, 0.0, 0.0, 0.0), strict=True))


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


def _centre(start: EpisodeStart) -> Float[np.ndarray, "3"]:
    """What all else is turned about: the first object, or the first piece of furniture where there is none."""
    for placed in start.objects.values():
        return placed.pose[:3, 3].copy()
    return np.asarray(start.furniture[0].position, float)
