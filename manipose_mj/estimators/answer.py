"""What an estimator gives back, checked.

| key | value |
|---|---|
| `pose` | `(4, 4)`, `T_camera_label` [m] |
| `score` | probability that the pose is within 15 deg and 2 cm, 0 to 1 |
| `extents` | optional, `(3,)`: lengths of the object's bounding box along the label's axes [m] |
| `hypotheses` | optional: other answers, likeliest first, without hypotheses of their own |
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from manipose_mj.ppf_jax.pose_estimate import PoseEstimate
from manipose_mj.user_code import reason_of

_RIGID = 1e-3  # how far a rotation may be from orthonormal
_ROUNDING = 1e-6  # how far a score may be beyond 0 and 1
_LAST_ROW = [0.0, 0.0, 0.0, 1.0]


class EstimatorFailedError(RuntimeError):
    """An estimator raised an error, or gave no pose; the message is one line."""


def checked_answer(answer: Any, mesh: Mapping[str, np.ndarray] | None = None) -> PoseEstimate:
    """An answer as an estimate; unknown extents are those of the mesh, or NaN.

    Args:
      answer: The dictionary, or a `PoseEstimate`.
      mesh: That the estimator was given.

    Raises:
      EstimatorFailedError: Something is missing, not finite or no rigid transform.
    """
    if isinstance(answer, PoseEstimate):
        answer = _told(answer) | {"hypotheses": [_told(each) for each in answer.hypotheses]}
    if not isinstance(answer, Mapping):
        raise EstimatorFailedError(f"answered a {type(answer).__name__}; expected a dictionary")
    others = answer.get("hypotheses")
    others = () if others is None else others
    if not isinstance(others, list | tuple):
        raise EstimatorFailedError(f"hypotheses are a {type(others).__name__}; expected a list")
    first = _estimate(answer, mesh)
    rest = tuple(_other(number, each, mesh) for number, each in enumerate(others))
    return PoseEstimate(first.pose, first.extents, first.confidence, rest)


def _other(number: int, answer: Any, mesh: Mapping[str, np.ndarray] | None) -> PoseEstimate:
    if not isinstance(answer, Mapping):
        kind = type(answer).__name__
        raise EstimatorFailedError(f"hypothesis {number} is a {kind}; expected a dictionary")
    try:
        return _estimate(answer, mesh)
    except EstimatorFailedError as error:
        raise EstimatorFailedError(f"hypothesis {number}: {error}") from None


def _told(estimate: PoseEstimate) -> dict[str, Any]:
    """An estimate as the dictionary that would say it; extents that are None or NaN are unknown."""
    extents: Any = estimate.extents
    try:
        if extents is not None and not np.isfinite(np.asarray(extents, float)).all():
            extents = None
    except Exception:
        pass  # no numbers, as any answer's may be: told where they are read
    return {"pose": estimate.pose, "score": estimate.confidence, "extents": extents}


def _estimate(answer: Mapping[str, Any], mesh: Mapping[str, np.ndarray] | None) -> PoseEstimate:
    pose = _array(answer, "pose", (4, 4))
    rotation = pose[:3, :3]
    rigid = np.allclose(rotation @ rotation.T, np.eye(3), atol=_RIGID)
    if not rigid or np.linalg.det(rotation) < 0 or not np.allclose(pose[3], _LAST_ROW):
        raise EstimatorFailedError("pose is not a rigid transform")
    score = float(_array(answer, "score", ()))
    if not -_ROUNDING <= score <= 1 + _ROUNDING:
        raise EstimatorFailedError(f"score is {score!r}; expected 0 to 1")
    score = min(max(score, 0.0), 1.0)
    if answer.get("extents") is not None:
        extents = _array(answer, "extents", (3,))
        if (extents <= 0).any():
            raise EstimatorFailedError("extents are not positive")
    elif mesh is not None:
        extents = np.ptp(mesh["vertices"].astype(float), axis=0)
    else:
        extents = np.full(3, np.nan)
    return PoseEstimate(pose, extents, score)


def _array(
    answer: Mapping[str, Any], name: str, shape: tuple[int, ...]
) -> Float[np.ndarray, "..."]:
    if not isinstance(answer, Mapping) or name not in answer:
        raise EstimatorFailedError(f"answer has no {name!r}")
    try:
        given = np.asarray(answer[name])
        if np.iscomplexobj(given):
            raise TypeError
        value = np.array(given, float)
    except (TypeError, ValueError):
        raise EstimatorFailedError(f"{name} is not made of numbers") from None
    except Exception as error:  # such as of a tensor that is elsewhere
        raise EstimatorFailedError(f"{name} is no array: {reason_of(error)}") from error
    if value.shape != shape:
        raise EstimatorFailedError(f"{name} has shape {value.shape}; expected {shape}")
    if not np.isfinite(value).all():
        raise EstimatorFailedError(f"{name} is not finite")
    return value
