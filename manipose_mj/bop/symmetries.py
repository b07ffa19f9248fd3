"""Symmetries as `models_info.json` lists them, as transforms and as the group of a frame with X along the axis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.label import symmetry_from_bop
from manipose_mj.poses import SymmetryGroup, compose, rotation_about

TURNS = (
    315  # of a continuous symmetry, so that no vertex moves further than 1 % of the diameter in one
)


@dataclass(frozen=True)
class ModelSymmetry:
    """What leaves a model's look unchanged.

    Attributes:
      transforms: In the model frame [m], the identity first; continuous ones in `TURNS` samples.
      frame: Rotation of a frame in the model frame whose X is the axis of revolution, if there is one.
      group: Proper rotations in that frame.
    """

    transforms: Float[np.ndarray, "k 4 4"]
    frame: Float[np.ndarray, "3 3"]
    group: SymmetryGroup

    @property
    def kind(self) -> str:
        """`"axial"`, `"discrete"` or `"none"`."""
        if self.group.axial:
            return "axial"
        return "discrete" if len(self.transforms) > 1 else "none"


def model_symmetry(info: Mapping[str, Any]) -> ModelSymmetry:
    """The symmetry of an entry of `models_info.json`, which is in millimetres.

    Raises:
      ValueError: A symmetry is no rotation, or there are two axes.
    """
    discrete = [list(each) for each in info.get("symmetries_discrete", [])]
    continuous = list(info.get("symmetries_continuous", []))
    if len(continuous) > 1:
        raise ValueError("several continuous symmetries")
    own = [np.eye(4), *(_metres(np.reshape(each, (4, 4)).astype(float)) for each in discrete)]
    frame, turns = np.eye(3), [np.eye(4)]
    if continuous:
        axis = np.asarray(continuous[0]["axis"], float)
        axis = axis / np.linalg.norm(axis)
        frame = _frame_along(axis)
        offset = np.asarray(continuous[0]["offset"], float) / 1000
        angles = 2 * np.pi * np.arange(TURNS) / TURNS
        rotations = [rotation_about(axis, angle) for angle in angles]
        turns = [compose(each, offset - each @ offset) for each in rotations]
    transforms = np.stack([turn @ each for each in own for turn in turns])
    return ModelSymmetry(transforms, frame, symmetry_from_bop(frame, discrete, continuous))


def _metres(pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
    return compose(pose[:3, :3], pose[:3, 3] / 1000)


def _frame_along(axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """A right-handed frame with X along a unit vector."""
    if np.allclose(axis, [1.0, 0.0, 0.0]):
        return np.eye(3)
    other = np.eye(3)[np.argmin(np.abs(axis))]
    y = np.cross(axis, other)
    y /= np.linalg.norm(y)
    return np.stack([axis, y, np.cross(axis, y)], axis=1)
