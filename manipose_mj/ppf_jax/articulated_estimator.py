"""From the cloud of a piece of furniture to its handles and joints: `ArticulatedEstimator.load()`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, PRNGKeyArray

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.articulated.model import ArticulatedModel, estimate_furniture
from manipose_mj.ppf_jax.compilation_cache import keep_compiled
from manipose_mj.ppf_jax.data.articulated.clouds import CLOUD_POINTS
from manipose_mj.ppf_jax.points.cloud_input import AnyCloud, checked_cloud, seeds_of
from manipose_mj.ppf_jax.points.cloud_normals import cloud_normals
from manipose_mj.ppf_jax.weight_files import load_weights

WEIGHTS = "furniture.npz"
# Sizes that clouds are padded to; one compilation each.
BUCKETS = (2048, 8192, 32_768, CLOUD_POINTS)
MIN_POINTS = 256
CAMERA_UP = (0.0, -1.0, 0.0)  # of an upright camera, whose y is down
_LONGEST, _SHORTEST = 12.0, 0.05  # of clouds of furniture that can be in metres [m]


@dataclass(frozen=True)
class PartEstimate:
    """Where a part of furniture is held and how it moves, camera frame.

    Attributes:
      handle: `(4, 4)`, `T_camera_handle` [m]: X along the handle, Y outwards.
      joint: `"hinge"` or `"slide"`.
      axis_origin: `(3,)` [m], on the joint's axis; the handle's centre of a part that slides.
      axis: `(3,)`, unit; positive is opening.
      opening: How far the part stands open [m or rad].
      confidence: How sure it is that there is such a part and that the estimate is right, 0 to 1.
    """

    handle: Float[np.ndarray, "4 4"]
    joint: Literal["hinge", "slide"]
    axis_origin: Float[np.ndarray, "3"]
    axis: Float[np.ndarray, "3"]
    opening: float
    confidence: float


@dataclass(frozen=True)
class ArticulatedEstimator:
    """A trained model that takes clouds of any size.

    Attributes:
      model: The networks.
    """

    model: ArticulatedModel

    @classmethod
    def load(cls) -> ArticulatedEstimator:
        """The estimator of cabinets, microwaves and ovens whose weights ship with the package.

        Raises:
          InputError: There are no weights.
        """
        path = Path(str(resources.files("manipose_mj.ppf_jax"))) / "weights" / WEIGHTS
        if not path.is_file():
            raise InputError(
                f"no weights for furniture at {path}; train some with "
                "`manipose pose train-articulated` and read them with ArticulatedEstimator.from_file"
            )
        keep_compiled()
        return _read_once(path)

    @classmethod
    def from_file(cls, path: Path | str) -> ArticulatedEstimator:
        """The estimator whose weights a training wrote.

        Raises:
          InputError: The file is missing, truncated, of another version or of another estimator.
        """
        model: Any = load_weights(Path(path)).model
        if not isinstance(model, ArticulatedModel):
            raise InputError(f"{path}: weights of an estimator of rigid objects; use PoseEstimator")
        return cls(model)

    def estimate(
        self,
        cloud: AnyCloud,
        *,
        key: PRNGKeyArray,
        up: Sequence[float] = CAMERA_UP,
        least: float = 0.5,
    ) -> list[PartEstimate]:
        """The handles and joints that a cloud shows, the surest first.

        Args:
          cloud: Points with normals, or points alone: normals are then estimated. Camera frame; fused
            clouds in the frame of one of their cameras, with normals towards whichever saw them.
          key: Of all that is drawn; the same key gives the same answer.
          up: Roughly which way is up in the camera frame, within some 60 deg; tells how the body stands and
            a handle's two directions apart.
          least: Confidence from which on a part is reported.

        Raises:
          InputError: The cloud is no cloud of furniture in metres; one line says why.
        """
        return self.estimate_many([cloud], key=key, up=up, least=least)[0]

    def estimate_many(
        self,
        clouds: Sequence[AnyCloud],
        *,
        key: PRNGKeyArray,
        up: Sequence[float] = CAMERA_UP,
        least: float = 0.5,
    ) -> list[list[PartEstimate]]:
        """The same for many clouds at once, padded to the size that the largest needs.

        Raises:
          InputError: One of the clouds cannot be used.
        """
        return [_parts(row, least) for row in estimate_rows(self.model, clouds, key=key, up=up)]


_COLUMNS = ("handle", "hinge", "axis_origin", "axis", "opening", "confidence", "evidence", "body")
Row = dict[str, np.ndarray]


def estimate_rows(
    model: ArticulatedModel,
    clouds: Sequence[AnyCloud],
    *,
    key: PRNGKeyArray,
    up: Sequence[float] = CAMERA_UP,
) -> list[Row]:
    """All that the model finds in each cloud, sound or not, by the fields of `PartEstimates`.

    Raises:
      InputError: One of the clouds cannot be used.
    """
    if len(clouds) == 0:
        return []
    try:
        upwards = np.asarray(up, np.float32)
    except (TypeError, ValueError):
        upwards = np.zeros(0)
    if upwards.shape != (3,) or not np.isfinite(upwards).all() or not upwards.any():
        raise InputError(f"up is {up!r}; expected a direction, three numbers not all zero")
    seeds_of(key)
    checked = []
    for number, cloud in enumerate(clouds):
        try:
            checked.append(checked_furniture(cloud, jax.random.fold_in(key, number)))
        except InputError as error:
            raise InputError(
                f"cloud {number}: {error}" if len(clouds) > 1 else str(error)
            ) from None
    longest = max(len(points) for points, _ in checked)
    size = next(size for size in BUCKETS if longest <= size)
    rows = [_padded(points, normals, size) for points, normals in checked]
    points, normals, mask = (jnp.asarray(np.stack(column)) for column in zip(*rows, strict=True))
    ups = jnp.tile(upwards, (len(rows), 1))
    found = estimate_furniture(model, points, normals, mask, ups, key=key)
    table = {name: np.asarray(getattr(found, name)) for name in _COLUMNS}
    return [{name: rows[i] for name, rows in table.items()} for i in range(len(clouds))]


def _parts(row: Row, least: float) -> list[PartEstimate]:
    order = np.argsort(-row["confidence"], kind="stable")
    return [
        PartEstimate(
            handle=row["handle"][i],
            joint="hinge" if row["hinge"][i] > 0.5 else "slide",
            axis_origin=row["axis_origin"][i],
            axis=row["axis"][i],
            opening=float(row["opening"][i]),
            confidence=float(row["confidence"][i]),
        )
        for i in order
        if row["confidence"][i] >= least
    ]


def checked_furniture(cloud: AnyCloud, key: PRNGKeyArray) -> tuple[np.ndarray, np.ndarray]:
    """At most `CLOUD_POINTS` points and their unit normals, estimated where it has none.

    Raises:
      InputError: The cloud cannot be used.
    """
    points, normals = checked_cloud(
        cloud, fewest=MIN_POINTS, shortest=_SHORTEST, longest=_LONGEST, what="furniture"
    )
    rows = np.random.default_rng(seeds_of(key)).permutation(len(points))[:CLOUD_POINTS]
    points, normals = points[rows], None if normals is None else normals[rows]
    if normals is None:
        return points, cloud_normals(points)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    # Which way they point is left as it is: of a fused cloud each is towards the camera that saw it.
    return points, (normals / np.maximum(lengths, 1e-9)).astype(np.float32)


def _padded(
    points: np.ndarray, normals: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    room = ((0, size - len(points)), (0, 0))
    return np.pad(points, room), np.pad(normals, room), np.arange(size) < len(points)


@lru_cache
def _read_once(path: Path) -> ArticulatedEstimator:
    return ArticulatedEstimator.from_file(path)
