"""A handle on a front whose outward normal is -x: what it is made of, and its label.

A label's X runs along the handle and Y outwards. Of X's two signs ours is the one with X up; for a level
handle, the one with Z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.articulated.handles.portion import Portion
from manipose_mj.assets.label import PoseLabel

Direction = Literal["level", "upright"]
OUT = np.array([-1.0, 0.0, 0.0])
ALUMINIUM = 2700.0  # [kg/m^3], what handles are made of


@dataclass(frozen=True)
class Mounted:
    """A handle in the object frame. Attributes: portion, its shapes; label, of its grip."""

    portion: Portion
    label: PoseLabel


class Handle(Protocol):
    """What a drawer or a door is pulled by."""

    @property
    def length(self) -> float:
        """How much room it takes along its X [m]."""
        ...

    def mounted(self, foot: Float[np.ndarray, "3"], direction: Direction) -> Mounted:
        """The handle in its place.

        Args:
          foot: `(3,)`, the point of the face behind the handle's middle [m].
          direction: Of the handle: along y, or along z.
        """
        ...


def handle_axes(direction: Direction) -> Float[np.ndarray, "3 3"]:
    """Columns are the label's X, Y, Z in the object frame."""
    x = np.eye(3)[1 if direction == "level" else 2]
    return np.stack([x, OUT, np.cross(x, OUT)], axis=1)
