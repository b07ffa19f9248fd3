"""Domain randomisation: another world each episode, within named strengths; off unless asked for.

What is drawn is drawn from the environment's random state before objects are placed, so that episodes
repeat; an episode's start poses therefore differ from those without randomisation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import radians

import mujoco
import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float

from manipose_mj.errors import unknown_name
from manipose_mj.poses import rotation_about

# Changed fields of the model, put back before every draw.
_FIELDS = (
    "geom_friction",
    "body_mass",
    "body_inertia",
    "light_pos",
    "light_diffuse",
    "geom_rgba",
    "mat_rgba",
    "cam_pos",
    "cam_quat",
    "actuator_gainprm",
    "actuator_biasprm",
)


@dataclass(frozen=True)
class Randomisation:
    """How much is drawn. Factors are log-uniform between 1 / f and f.

    Attributes:
      friction: Factor of the sliding friction of everything but the finger pads; one for all.
      mass: Factor of each object's mass and inertia.
      gains: Factor of the arm's servo stiffness; damping follows with its root, so that none rings.
      light: Factor of each light's brightness.
      light_shift: Standard deviation of each light's place, each way [m].
      colour: Standard deviation of every colour's channels, of 1.
      camera_shift: Standard deviation of each camera's place, each way [m].
      camera_turn: Standard deviation of each camera's direction [rad].
      latency: Most by which servo targets come late, uniform from none [s].
    """

    friction: float = 1.0
    mass: float = 1.0
    gains: float = 1.0
    light: float = 1.0
    light_shift: float = 0.0
    colour: float = 0.0
    camera_shift: float = 0.0
    camera_turn: float = 0.0
    latency: float = 0.0


STRENGTHS: dict[str, Randomisation] = {
    "none": Randomisation(),
    # As much as one laboratory's day differs from the next.
    "mild": Randomisation(
        friction=1.15,
        mass=1.1,
        gains=1.05,
        light=1.3,
        light_shift=0.1,
        colour=0.03,
        camera_shift=0.003,
        camera_turn=radians(0.3),
        latency=0.01,
    ),
    # As much as one laboratory differs from another.
    "strong": Randomisation(
        friction=1.5,
        mass=1.4,
        gains=1.2,
        light=2.0,
        light_shift=0.4,
        colour=0.15,
        camera_shift=0.02,
        camera_turn=radians(2),
        latency=0.04,
    ),
}


def randomisation(name: str) -> Randomisation:
    """The strength of this name.

    Raises:
      InputError: There is none.
    """
    if name not in STRENGTHS:
        raise unknown_name("randomisation", name, STRENGTHS)
    return STRENGTHS[name]


class Randomiser:
    """Applies a strength to a compiled model, each time anew from what was compiled."""

    def __init__(self, strength: Randomisation) -> None:
        self._strength = strength
        self._model: mujoco.MjModel | None = None
        self._nominal: dict[str, np.ndarray] = {}

    @property
    def active(self) -> bool:
        """Whether it changes anything at all."""
        return self._strength != STRENGTHS["none"]

    def apply(
        self,
        physics: mjcf.Physics,
        movable: Sequence[composer.Entity],
        fixed_friction: Sequence[int],
        random_state: np.random.RandomState,
    ) -> float:
        """Draw another world. Configurations are lost: place everything afterwards.

        Args:
          physics: To change.
          movable: Entities with a mass of their own.
          fixed_friction: Ids of geoms that keep their friction.
          random_state: Draws.

        Returns:
          By how much servo targets come late in this episode [s].
        """
        model, strength = physics.model.ptr, self._strength
        if model is not self._model:
            self._nominal = {name: np.array(getattr(model, name)) for name in _FIELDS}
            self._model = model
        for name, values in self._nominal.items():
            getattr(model, name)[:] = values

        def factors(most: float, count: int) -> Float[np.ndarray, "n"]:
            return np.exp(random_state.uniform(-1, 1, count) * np.log(most))

        keeps = np.isin(np.arange(model.ngeom), fixed_friction)
        model.geom_friction[~keeps, 0] *= factors(strength.friction, 1)
        for entity, factor in zip(movable, factors(strength.mass, len(movable)), strict=True):
            bodies = physics.bind(entity.mjcf_model.find_all("body")).element_id
            model.body_mass[bodies] *= factor
            model.body_inertia[bodies] *= factor
        gains = factors(strength.gains, model.nu)
        model.actuator_gainprm[:, 0] *= gains
        model.actuator_biasprm[:, 1] *= gains
        model.actuator_biasprm[:, 2] *= np.sqrt(gains)
        model.light_diffuse *= factors(strength.light, model.nlight)[:, None]
        model.light_pos += random_state.normal(0, strength.light_shift, model.light_pos.shape)
        for colours in (model.geom_rgba, model.mat_rgba):
            noise = random_state.normal(0, strength.colour, (len(colours), 3))
            colours[:, :3] = np.clip(colours[:, :3] + noise, 0.0, 1.0)
        model.cam_pos += random_state.normal(0, strength.camera_shift, model.cam_pos.shape)
        for camera in range(model.ncam):
            turn = random_state.normal(0, strength.camera_turn, 3)
            _turn_camera(model, camera, turn)
        mujoco.mj_setConst(model, physics.data.ptr)
        return float(random_state.uniform(0, strength.latency))


@dataclass
class Delay:
    """Servo targets that come some physics steps late.

    Attributes:
      waiting: `(steps, 8)`, the targets under way, the next one first.
    """

    waiting: Float[np.ndarray, "steps 8"] = field(default_factory=lambda: np.empty((0, 8)))

    def start(self, steps: int, target: Float[np.ndarray, "8"]) -> None:
        """Begin an episode in which the robot holds `target`."""
        self.waiting = np.tile(target, (steps, 1))

    def through(self, target: Float[np.ndarray, "8"]) -> Float[np.ndarray, "8"]:
        """Send a target; what arrives now."""
        if not len(self.waiting):
            return target
        arrives = self.waiting[0].copy()
        self.waiting = np.concatenate([self.waiting[1:], target[None]])
        return arrives


def _turn_camera(model: mujoco.MjModel, camera: int, turn: Float[np.ndarray, "3"]) -> None:
    """Turn a camera by a rotation vector in its own frame [rad]."""
    angle = float(np.linalg.norm(turn))
    if angle == 0.0:
        return
    by, turned = np.zeros(4), np.zeros(4)
    mujoco.mju_mat2Quat(by, rotation_about(turn / angle, angle).ravel())
    mujoco.mju_mulQuat(turned, model.cam_quat[camera], by)
    model.cam_quat[camera] = turned
