"""What estimators take: a cloud in metres, with normals or without, and a key, checked before anything is done."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, TypeVar, runtime_checkable

import jax
import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.points.cloud_normals import cloud_normals


@runtime_checkable
class OrientedCloud(Protocol):
    """What an estimator takes: points [m] in the camera frame and unit normals, zero where unknown."""

    @property
    def points(self) -> Float[np.ndarray, "n 3"]: ...

    @property
    def normals(self) -> Float[np.ndarray, "n 3"]: ...


@dataclass(frozen=True)
class Cloud:
    """The plainest of them. Attributes: points `(n, 3)` [m]; normals `(n, 3)`, unit; zero where unknown."""

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]


T = TypeVar("T")
AnyCloud: TypeAlias = OrientedCloud | Float[np.ndarray, "n 3"]


def checked_cloud(
    cloud: AnyCloud, *, fewest: int, shortest: float, longest: float, what: str
) -> tuple[Float[np.ndarray, "kept 3"], Float[np.ndarray, "kept 3"] | None]:
    """A cloud's points [m] and its normals, of any length but 0; None without any.

    Repeated points count once, as `distinct_rows` says. Normals that are zero are estimated.

    Args:
      cloud: Points, or points with normals.
      fewest: Points that it has to have.
      shortest: Span that it has to have [m].
      longest: Span beyond which it cannot be in metres [m].
      what: It shows, for the message.

    Raises:
      InputError: Too few points, wrong shape, not finite, or not in metres.
    """
    points, normals = cloud_arrays(cloud)
    for name, values in (("points", points), ("normals", normals)):
        if values is not None and not np.all(np.isfinite(values)):
            bad = int(np.sum(~np.all(np.isfinite(values), axis=1)))
            raise InputError(f"{bad} of {len(values)} {name} are not finite; leave them out")
    given = points
    kept = distinct_rows(points)
    if not kept.all():
        points, normals = points[kept], None if normals is None else normals[kept]
    if len(given) >= fewest and np.ptp(given, axis=0).max() == 0:
        raise InputError(
            f"cloud of {len(given)} points: all points are equal; expected the surface of {what}"
        )
    if len(points) < fewest:
        once = f" of which {len(points)} differ" if len(given) >= fewest else ""
        raise InputError(f"cloud of {len(given)} points{once}; expected at least {fewest}")
    middle = np.median(points, axis=0)
    # Half of the points, so that no stray one decides.
    span = 4 * float(np.median(np.linalg.norm(points - middle, axis=1)))
    if span > longest:
        hint = ": millimetres? divide by 1000" if span < 1000 * longest else ""
        raise InputError(f"cloud about {span:.3g} m across; expected metres{hint}")
    if span < shortest:
        raise InputError(
            f"cloud about {1000 * span:.2g} mm across: too small; expected the surface of {what} in metres"
        )
    points = points.astype(np.float32)
    return points, None if normals is None else _known(points, normals)


def listed_clouds(clouds: Iterable[T]) -> tuple[T, ...]:
    """Several clouds, as often as they are needed: a generator has them once.

    Raises:
      InputError: They are none, but a single cloud or nothing.
    """
    try:
        return tuple(clouds)
    except TypeError:
        raise InputError(
            f"clouds are of type {type(clouds).__name__}; expected a list of clouds"
        ) from None


def cloud_arrays(
    cloud: AnyCloud,
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"] | None]:
    """The points of a cloud as they are, and the normals of one that has any.

    Raises:
      InputError: They are no numbers, three a row, some are masked, or there are not as many normals as points.
    """
    oriented = not isinstance(cloud, np.ndarray) and hasattr(cloud, "points")
    points: np.ndarray
    given: Any = cloud.points if oriented else cloud  # pyright: ignore[reportAttributeAccessIssue]
    _check_unmasked("points", given)
    try:
        points = np.asarray(given)
    except ValueError:  # rows of several lengths
        points = np.empty(0)
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "fiu":
        raise InputError(
            f"cloud of shape {points.shape} and type {points.dtype}; expected numbers, (points, 3), or with normals "
            "a Cloud(points, normals)"
        )
    told = getattr(cloud, "normals", None) if oriented else None
    if told is None:
        return points, None
    _check_unmasked("normals", told)
    try:
        normals = np.asarray(told)
    except ValueError:
        normals = np.empty(0)
    if normals.shape != points.shape:
        raise InputError(f"normals of shape {normals.shape} with points of shape {points.shape}")
    if normals.dtype.kind not in "fiu":
        raise InputError(f"normals of type {normals.dtype}; expected numbers")
    return points, normals


def _check_unmasked(name: str, rows: Any) -> None:
    if np.ma.is_masked(rows):  # which plain arrays forget
        masked = np.atleast_1d(np.ma.getmaskarray(rows))
        bad = int(masked.reshape(len(masked), -1).any(axis=1).sum())
        raise InputError(f"{bad} of {len(masked)} {name} are masked; leave them out")


def distinct_rows(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    """Which points are the first of those that are exactly equal.

    Points at the origin of which there are several are padding: none of them is kept.

    Args:
      points: Finite [m].
    """
    order = np.lexsort(points.T)  # stable: of equal points the first comes first
    ranked = points[order]
    kept = np.ones(len(points), bool)
    kept[order[1:][np.all(ranked[1:] == ranked[:-1], axis=1)]] = False
    if not kept.all():
        origin = ~points.any(axis=1)
        if origin.sum() > 1:
            kept &= ~origin
    return kept


def seeds_of(key: Any) -> np.ndarray:
    """The numbers in a JAX key; every estimator asks for them before it draws.

    Raises:
      InputError: It is none, or several.
    """
    try:
        numbers = np.asarray(jax.random.key_data(key))
    except TypeError:
        raise InputError(f"key is {key!r}; expected one such as jax.random.key(0)") from None
    if numbers.ndim != 1:
        shape = numbers.shape[:-1]
        raise InputError(
            f"key is an array of keys, {shape}; expected one such as jax.random.key(0)"
        )
    return numbers


def _known(
    points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"] | None:
    """The normals, with those estimated that are zero; None if all are."""
    unknown = np.flatnonzero(~normals.any(axis=1))
    if len(unknown) == 0:
        return normals
    if len(unknown) == len(normals):
        return None
    filled = normals.astype(np.float64)
    filled[unknown] = cloud_normals(points, unknown)
    return filled
