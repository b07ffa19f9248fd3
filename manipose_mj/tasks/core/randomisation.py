"""Domain randomisation: another world each episode, within named strengths; off unless asked for.

Changes are drawn from the environment's random state before objects are placed, so that episodes
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
from manipose_mj.tasks.core.start import ModelChanges

# The fields of the model that change.
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
_DEFAULT_RGBA = np.array([0.5, 0.5, 0.5, 1.0], np.float32)


@dataclass(frozen=True)
class Randomisation:
    """How much is drawn. Factors are log-uniform between 1 / f and f.

    Attributes:
      friction: Factor of the sliding friction of everything but the finger pads; one for all.
      mass: Factor of each object's mass and inertia.
      gains: Factor of each servo's stiffness, the gripper's too, one for each; the damping of the arm's follows with
        its root, so that none rings.
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
    """Draws changes of a compiled model, each time anew from what was compiled.

    Attributes:
      active: Whether it changes anything at all.
    """

    def __init__(
        self,
        strength: Randomisation,
        physics: mjcf.Physics,
        objects: Sequence[composer.Entity],
        fixed_friction: Sequence[int],
    ) -> None:
        """Copies what it may change.

        Args:
          strength: How much is drawn.
          physics: Compiled, and not changed yet.
          objects: Entities with a mass of their own.
          fixed_friction: Ids of geoms that keep their friction.
        """
        self.active = strength != STRENGTHS["none"]
        self._strength = strength
        model = physics.model.ptr
        self._nominal = {name: np.array(getattr(model, name)) for name in _FIELDS}
        self._bodies = [
            np.asarray(physics.bind(entity.mjcf_model.find_all("body")).element_id)
            for entity in objects
        ]
        self._keeps = np.isin(np.arange(model.ngeom), fixed_friction)
        # MuJoCo gives a geom its material's colour as long as its own is the default.
        plain = (self._nominal["geom_rgba"] == _DEFAULT_RGBA).all(axis=1)
        self._by_material = plain & (np.array(model.geom_matid) >= 0)

    def draw(self, random_state: np.random.RandomState) -> ModelChanges:
        """Another world; none is drawn, and nothing changed, at the strength `none`."""
        if not self.active:
            return ModelChanges()
        strength = self._strength
        fields = {name: values.copy() for name, values in self._nominal.items()}

        def factors(most: float, count: int) -> Float[np.ndarray, "n"]:
            return np.exp(random_state.uniform(-1, 1, count) * np.log(most))

        def shift(name: str, deviation: float) -> None:
            fields[name] += random_state.normal(0, deviation, fields[name].shape)

        fields["geom_friction"][~self._keeps, 0] *= factors(strength.friction, 1)
        masses = factors(strength.mass, len(self._bodies))
        for bodies, factor in zip(self._bodies, masses, strict=True):
            fields["body_mass"][bodies] *= factor
            fields["body_inertia"][bodies] *= factor
        gains = factors(strength.gains, len(fields["actuator_gainprm"]))
        fields["actuator_gainprm"][:, 0] *= gains
        fields["actuator_biasprm"][:, 1] *= gains
        fields["actuator_biasprm"][:, 2] *= np.sqrt(gains)
        lights = factors(strength.light, len(fields["light_diffuse"]))
        fields["light_diffuse"] *= lights[:, None]
        shift("light_pos", strength.light_shift)
        for name in ("geom_rgba", "mat_rgba"):
            colours = fields[name]
            noise = random_state.normal(0, strength.colour, (len(colours), 3))
            if name == "geom_rgba":
                noise[self._by_material] = 0.0
            colours[:, :3] = np.clip(colours[:, :3] + noise, 0.0, 1.0)
        shift("cam_pos", strength.camera_shift)
        for quaternion in fields["cam_quat"]:
            _turn(quaternion, random_state.normal(0, strength.camera_turn, 3))
        return ModelChanges(fields, latency=float(random_state.uniform(0, strength.latency)))


def write_changes(physics: mjcf.Physics, changes: ModelChanges) -> None:
    """Change a model. Configurations are lost: place everything afterwards."""
    for name, values in changes.fields.items():
        getattr(physics.model.ptr, name)[:] = values
    mujoco.mj_setConst(physics.model.ptr, physics.data.ptr)


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


def _turn(quaternion: Float[np.ndarray, "4"], turn: Float[np.ndarray, "3"]) -> None:
    """Turn a `wxyz` quaternion by a rotation vector in its own frame [rad], in place."""
    angle = float(np.linalg.norm(turn))
    if angle == 0.0:
        return
    by, turned = np.zeros(4), np.zeros(4)
    mujoco.mju_mat2Quat(by, rotation_about(turn / angle, angle).ravel())
    mujoco.mju_mulQuat(turned, quaternion, by)
    quaternion[:] = turned
