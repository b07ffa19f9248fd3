"""What estimators take: a cloud in metres, with normals or without, and a key, checked before anything is done."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, runtime_checkable

import jax
import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError


@runtime_checkable
class OrientedCloud(Protocol):
    """What an estimator takes: points [m] in the camera frame and unit normals."""

    @property
    def points(self) -> Float[np.ndarray, "n 3"]: ...

    @property
    def normals(self) -> Float[np.ndarray, "n 3"]: ...


@dataclass(frozen=True)
class Cloud:
    """The plainest of them. Attributes: points `(n, 3)` [m]; normals `(n, 3)`, unit."""

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]


AnyCloud: TypeAlias = OrientedCloud | Float[np.ndarray, "n 3"]


def checked_cloud(
    cloud: AnyCloud, *, fewest: int, shortest: float, longest: float, what: str
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"] | None]:
    """A cloud's points [m] and its normals, of any length; None without any.

    Args:
      cloud: Points, or points with normals.
      fewest: Points that it has to have.
      shortest: Span that it has to have [m].
      longest: Span beyond which it cannot be in metres [m].
      what: It shows, for the message.

    Raises:
      InputError: Too few points, wrong shape, not finite, or not in metres.
    """
    oriented = not isinstance(cloud, np.ndarray) and hasattr(cloud, "points")
    points: np.ndarray
    try:
        points = np.asarray(cloud.points if oriented else cloud)  # pyright: ignore[reportAttributeAccessIssue]
    except ValueError:  # rows of several lengths
        points = np.empty(0)
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "fiu":
        raise InputError(
            f"cloud of shape {points.shape} and type {points.dtype}; expected numbers, (points, 3), or with normals "
            "a Cloud(points, normals)"
        )
    normals = np.asarray(cloud.normals) if oriented else None  # pyright: ignore[reportAttributeAccessIssue]
    if normals is not None and normals.shape != points.shape:
        raise InputError(f"normals of shape {normals.shape} with points of shape {points.shape}")
    if len(points) < fewest:
        raise InputError(f"cloud of {len(points)} points; expected at least {fewest}")
    for name, values in (("points", points), ("normals", normals)):
        if values is not None and not np.all(np.isfinite(values)):
            bad = int(np.sum(~np.all(np.isfinite(values), axis=1)))
            raise InputError(f"{bad} of {len(values)} {name} are not finite; leave them out")
    middle = np.median(points, axis=0)
    # Half of the points, so that no stray one decides.
    span = 4 * float(np.median(np.linalg.norm(points - middle, axis=1)))
    if span > longest:
        hint = ": millimetres? divide by 1000" if span < 1000 * longest else ""
        raise InputError(f"cloud about {span:.3g} m across; expected metres{hint}")
    if span < shortest:
        fault = "all points are equal" if np.ptp(points, axis=0).max() == 0 else "too small"
        raise InputError(
            f"cloud about {1000 * span:.2g} mm across: {fault}; expected the surface of {what} in metres"
        )
    return points.astype(np.float32), normals


def seeds_of(key: Any) -> np.ndarray:
    """The numbers in a JAX key; every estimator asks for them before it draws.

    Raises:
      InputError: It is none.
    """
    try:
        return np.asarray(jax.random.key_data(key)).ravel()
    except TypeError:
        raise InputError(f"key is {key!r}; expected one such as jax.random.key(0)") from None
