"""What the baseline asks of a perception, wherever its knowledge comes from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from jaxtyping import Float

from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.scene.scene_estimate import SceneEstimate


class Perception(Protocol):
    """Where a policy's knowledge comes from.

    Attributes:
      sources: `"true"` or `"estimated"` of what it knows of `"objects"` and `"furniture"`; what is told of `"kinds"`.
      feels_joints: Whether it corrects joints by what the hand feels.
      looks_by_hand: Whether the hand has a camera that it looks through.
      unseen: Objects of goals that nothing has shown yet.
    """

    sources: Mapping[str, str]
    feels_joints: bool
    looks_by_hand: bool

    @property
    def unseen(self) -> frozenset[str]: ...

    @property
    def arm(self) -> ArmModel:
        """The arm in the scene of the last observation."""
        ...

    def reset(self, seed: int, *, for_goals: bool = True) -> None:
        """Start an episode.

        Args:
          seed: Of everything random.
          for_goals: Whether what goals are about has to be seen, or at least what may hide it.

        Raises:
          StageFailure: It is not.
        """
        ...

    def robot(self) -> tuple[Float[np.ndarray, "7"], float]:
        """Joint angles [rad] and opening [m], cheap enough for every control step."""
        ...

    def observe(self) -> SceneEstimate:
        """An estimate of the whole scene as it is now."""
        ...

    def hold(self, name: str | None) -> None:
        """The hand holds this from now on; None: it has let go."""
        ...

    def feel(self, name: str, path: Float[np.ndarray, "n 4 4"], stopped: bool) -> None:
        """The hand led a part by its handle.

        Args:
          name: Of the part.
          path: `T_world_tcp` on the way.
          stopped: Whether the part went no further.
        """
        ...

    def pushed(self, name: str, opening: float) -> None:
        """The hand pushed a part to about this opening [m or rad]."""
        ...

    def look_around(self) -> None:
        """Between two plans: look for what others may have hidden, and anew at what is uncertain."""
        ...

    def look_again(self) -> None:
        """Look at what was opened, and into it; plans made before no longer count."""
        ...

    def look_closely(self) -> None:
        """Look through the hand's camera too, which was brought before something that was opened."""
        ...
