"""Handles and joints of furniture as the estimator of parts sees them, in the world frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from jaxtyping import Float

from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.errors import InputError
from manipose_mj.poses import invert, transform

_LEAST = 0.03  # confidence of what is looked at at all
_SAME = 0.04  # handles nearer than this are one [m]


@dataclass(frozen=True)
class SensedPart:
    """One drawer or door, as it stands.

    Attributes:
      handle: `T_world_handle`.
      kind: Of its joint.
      origin: `(3,)`, on the joint's axis, world frame [m].
      axis: `(3,)`, unit; positive is opening, world frame.
      opening: [m or rad].
      confidence: Of the estimator; 1 of what is certain.
    """

    handle: Float[np.ndarray, "4 4"]
    kind: Literal["slide", "hinge"]
    origin: Float[np.ndarray, "3"]
    axis: Float[np.ndarray, "3"]
    opening: float
    confidence: float

    @property
    def certain(self) -> bool:
        """Whether it was seen itself, its handle or not."""
        return self.confidence >= 1.0


@dataclass(frozen=True)
class SensedFurniture:
    """Attributes: front `(3,)`: which way the front faces, level, world frame; parts: the surest first."""

    front: Float[np.ndarray, "3"]
    parts: tuple[SensedPart, ...]


class PartSensor(Protocol):
    """Finds parts in a cloud."""

    def __call__(
        self, cloud: SceneCloud, camera_pose: Float[np.ndarray, "4 4"], key: Any
    ) -> SensedFurniture:
        """What a piece of furniture is, seen from a camera at `T_world_camera`."""
        ...


def sense_parts(
    cloud: SceneCloud, camera_pose: Float[np.ndarray, "4 4"], key: Any
) -> SensedFurniture:
    """Parts by the package's estimator.

    Args:
      cloud: Of one piece of furniture.
      camera_pose: `T_world_camera` of a camera that sees the front.
      key: Of all that is drawn.

    Raises:
      InputError: The cloud shows too little of it.
    """
    from manipose_mj.ppf_jax.articulated_estimator import ArticulatedEstimator, estimate_rows
    from manipose_mj.ppf_jax.points.cloud_input import Cloud

    to_camera = invert(camera_pose)
    local = Cloud(
        transform(to_camera, cloud.points).astype(np.float32),
        (cloud.normals @ camera_pose[:3, :3]).astype(np.float32),
    )
    up = camera_pose[2, :3]
    row = estimate_rows(ArticulatedEstimator.load().model, [local], key=key, up=tuple(up))[0]
    return sensed_furniture(row, camera_pose)


def sensed_furniture(
    row: Mapping[str, np.ndarray], camera_pose: Float[np.ndarray, "4 4"]
) -> SensedFurniture:
    """What the estimator of parts found, taken out of the camera's frame.

    Args:
      row: As of `articulated_estimator.estimate_rows`.
      camera_pose: `T_world_camera`.

    Raises:
      InputError: The front faces up or down.
    """
    turn = camera_pose[:3, :3]
    parts = [
        SensedPart(
            handle=camera_pose @ row["handle"][i].astype(float),
            kind="hinge" if row["hinge"][i] > 0.5 else "slide",
            origin=transform(camera_pose, row["axis_origin"][i][None].astype(float))[0],
            axis=turn @ row["axis"][i].astype(float),
            opening=float(row["opening"][i]),
            confidence=float(row["confidence"][i]),
        )
        for i in np.argsort(-row["confidence"], kind="stable")
    ]
    front = turn @ row["body"][:, 0].astype(float)
    return SensedFurniture(_level(front), tuple(_distinct(parts)))


def _distinct(parts: list[SensedPart]) -> list[SensedPart]:
    """Those of some confidence; of parts with one handle the surest."""
    kept: list[SensedPart] = []
    for part in parts:
        apart = (np.linalg.norm(part.handle[:3, 3] - other.handle[:3, 3]) for other in kept)
        if part.confidence >= _LEAST and all(distance > _SAME for distance in apart):
            kept.append(part)
    return kept


def _level(vector: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    flat = vector * [1.0, 1.0, 0.0]
    length = float(np.linalg.norm(flat))
    if length < 0.1:
        raise InputError("the estimated front of the furniture faces up or down")
    return flat / length
