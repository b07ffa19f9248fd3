"""An error of a pose that stays the same throughout an episode, as a wrong calibration or a wrong label does."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.depth_noise import is_number
from manipose_mj.poses import compose, rotation_about


@dataclass(frozen=True)
class FixedError:
    """An error of exactly this size, in a random direction.

    Attributes:
      translation: Distance [m].
      rotation: Angle [rad].

    Raises:
      InputError: One is negative or not finite.
    """

    translation: float = 0.0
    rotation: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not is_number(value) or not 0 <= value < np.inf:
                raise InputError(f"error: {name} is {value!r}; expected 0 or more")

    def __bool__(self) -> bool:
        return bool(self.translation > 0 or self.rotation > 0)

    def drawn(self, seed: int, name: str, *, axial: bool = False) -> Float[np.ndarray, "4 4"]:
        """`T_true_wrong`: a wrong pose is the true one times this.

        The directions depend on seed and name alone, not on the sizes: larger errors go the same way.

        Args:
          seed: Of the episode's sensors.
          name: Of what is wrong; each name has directions of its own.
          axial: Turn about an axis perpendicular to X, so that no share of the angle is a symmetry.
        """
        number = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
        shift, axis = np.random.default_rng((seed, number)).standard_normal((2, 3))
        if axial:
            axis[0] = 0.0
        turn = rotation_about(axis / np.linalg.norm(axis), self.rotation)
        return compose(turn, self.translation * shift / np.linalg.norm(shift))
