"""From the cloud of one object to its pose: `PoseEstimator.load("mug").estimate(cloud, key=key)`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.assets.label import OBJECT_TYPES
from manipose_mj.errors import InputError, brief, unknown_name
from manipose_mj.ppf_jax.compilation_cache import keep_compiled
from manipose_mj.ppf_jax.confidence import (
    Calibration,
    Scores,
    calibration_in,
    near,
    scores_of,
)
from manipose_mj.ppf_jax.points.cloud_input import AnyCloud, checked_cloud, listed_clouds, seeds_of
from manipose_mj.ppf_jax.points.cloud_normals import cloud_normals
from manipose_mj.ppf_jax.points.clouds import MAX_POINTS, SAMPLE_POINTS
from manipose_mj.ppf_jax.points.outlier_removal import not_alone
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry
from manipose_mj.ppf_jax.pose_estimate import PoseEstimate
from manipose_mj.ppf_jax.rigid.model import (
    Estimates,
    EstimatingModel,
    PoseModel,
    estimate_batch,
    estimate_sample,
)
from manipose_mj.ppf_jax.weight_files import (
    Cameras,
    LabelSet,
    MethodName,
    TrainedModel,
    load_weights,
)

SEVERAL = "several"  # folder of the weights of networks that look through several cameras
BUCKETS = (SAMPLE_POINTS, 512, MAX_POINTS)  # sizes that clouds are padded to; one compilation each
MIN_POINTS = 32
_OF_FURNITURE = ("articulated", "handle")  # types of labels that no rigid object has
LONGEST, SHORTEST = 5.0, 1e-3  # of clouds that can be in metres [m]


@dataclass(frozen=True)
class PoseEstimator:
    """A trained model that takes clouds of any size.

    Attributes:
      trained: The networks, and the categories they were trained on.
      calibration: Makes probabilities of pose scores; None leaves these as they are.
    """

    trained: TrainedModel
    calibration: Calibration | None = None

    @classmethod
    def load(cls, name: str, *, cameras: Cameras = "one") -> PoseEstimator:
        """The estimator of a category or of an object type, from the weights shipped with the package.

        A category without weights of its own gets its type's. Files are read once.

        Args:
          name: Such as `"mug"` or `"axial"`.
          cameras: How many see a cloud; for clouds of several see `FusedViewEstimator`.

        Raises:
          InputError: No such category or type; or there are no weights for it.
        """
        if cameras not in ("one", "several"):
            raise unknown_name("number of cameras", str(cameras), ("one", "several"))
        if not isinstance(name, str):
            raise InputError(f"category or type is {brief(name)}; expected a name, such as 'mug'")
        if (CATALOGUE[name].object_type if name in CATALOGUE else name) in _OF_FURNITURE:
            raise InputError(
                f"{name}: furniture has handles and joints; ArticulatedEstimator.load() of manipose_mj.ppf_jax finds "
                "them, `manipose pose evaluate-articulated` says how well"
            )
        if name not in CATALOGUE and name not in OBJECT_TYPES:
            rigid = [each for each in OBJECT_TYPES if each not in _OF_FURNITURE]
            raise unknown_name("category or type", name, [*rigid, *CATALOGUE])
        stems = [name, CATALOGUE[name].object_type] if name in CATALOGUE else [name]
        folder = Path(str(resources.files("manipose_mj.ppf_jax"))) / "weights"
        calibration = calibration_in(folder)
        if cameras == "several":
            folder /= SEVERAL
            calibration = calibration_in(folder) or calibration
        keep_compiled()
        for stem in stems:
            if (folder / f"{stem}.npz").is_file():
                return cls(_read_once(folder / f"{stem}.npz"), calibration)
        raise InputError(
            f"no weights for {name} in {folder}; train some with `manipose pose train {name}` "
            "and read them with PoseEstimator.from_file"
        )

    @classmethod
    def from_file(
        cls,
        path: Path | str,
        *,
        method: MethodName | None = None,
        labels: LabelSet | None = None,
    ) -> PoseEstimator:
        """The estimator whose weights a training wrote.

        Args:
          path: Of the file.
          method: What the weights have to be of, if that matters.
          labels: What they have to be trained on, if that matters.

        Raises:
          InputError: The file is missing, truncated, of another version, or not what was asked for.
        """
        trained = load_weights(Path(path))
        if trained.method == "articulated":
            raise InputError(f"{path}: weights of furniture; ArticulatedEstimator reads them")
        if method is not None and trained.method != method:
            raise InputError(f"{path}: weights of method {trained.method}; expected {method}")
        if labels is not None and trained.labels != labels:
            raise InputError(
                f"{path}: weights trained on {trained.labels} labels; expected {labels}"
            )
        return cls(trained)

    def estimate(self, cloud: AnyCloud, *, key: PRNGKeyArray) -> PoseEstimate:
        """The pose of the object that a cloud shows.

        Args:
          cloud: Points with normals, or points alone: normals are then estimated. Camera frame.
          key: Of all that is drawn; the same key gives the same answer.

        Raises:
          InputError: The cloud is no cloud of an object in metres, or of several cameras; one line says why.
        """
        model = self.trained.model
        if not isinstance(model, PoseModel):
            points, normals = _checked(cloud, key)
            normals = cloud_normals(points) if normals is None else normals
            found = _estimate(model, *_padded(points, normals, bucket(len(points))), key=key)
            return self.as_estimate(found)
        sample = prepared_sample(model, cloud, key=key)
        return self.as_estimate(_estimate_sample(model, *sample, key=key))

    def estimate_many(self, clouds: Iterable[AnyCloud], *, key: PRNGKeyArray) -> list[PoseEstimate]:
        """The poses of many objects at once, padded to the size that the largest needs.

        One compilation for every size and number of clouds.

        Raises:
          InputError: One of the clouds cannot be used.
        """
        clouds = listed_clouds(clouds)
        if not clouds:
            return []
        seeds_of(key)
        checked = []
        for number, cloud in enumerate(clouds):
            try:
                points, normals = _checked(cloud, jax.random.fold_in(key, number))
                checked.append((points, cloud_normals(points) if normals is None else normals))
            except InputError as error:
                raise InputError(f"cloud {number}: {error}") from None
        size = bucket(max(len(points) for points, _ in checked))
        rows = [_padded(points, normals, size) for points, normals in checked]
        columns = (jnp.asarray(np.stack(column)) for column in zip(*rows, strict=True))
        found = jax.tree.map(np.asarray, estimate_batch(self.trained.model, *columns, key=key))
        return [self.as_estimate(_row(found, i)) for i in range(len(rows))]

    def as_estimate(self, found: Estimates) -> PoseEstimate:
        """What the networks found, with a calibrated confidence, hypotheses that are alike last."""
        poses, extents, confidence = (
            np.asarray(leaf) for leaf in (found.poses, found.extents, found.confidence)
        )
        symmetry = self.trained.model.config.symmetry
        if self.calibration is not None and found.expected_error is not None:
            error = np.asarray(found.expected_error)
            scores = scores_of(poses, confidence, error, symmetry)
            confidence = self.calibration.of_all(confidence, scores)
        each = [PoseEstimate(*row) for row in zip(poses, extents, confidence.tolist(), strict=True)]
        order = distinct_first(poses, symmetry)
        first = each[0]
        others = tuple(each[i] for i in order[1:])
        return PoseEstimate(first.pose, first.extents, first.confidence, others)


def view_scores(
    estimator: PoseEstimator, cloud: AnyCloud, *, key: PRNGKeyArray
) -> tuple[Float[np.ndarray, "4 4"], Scores]:
    """The pose that `PoseEstimator.estimate` finds, and what its confidence is made of.

    Raises:
      InputError: The cloud cannot be used, or the estimator has no pose scorer.
    """
    model = estimator.trained.model
    if not isinstance(model, PoseModel):
        raise InputError("only our networks score poses")
    return scores_found(
        estimator, _estimate_sample(model, *prepared_sample(model, cloud, key=key), key=key)
    )


def scores_found(
    estimator: PoseEstimator, found: Estimates
) -> tuple[Float[np.ndarray, "4 4"], Scores]:
    """The likeliest pose, and what its confidence is made of."""
    poses, confidence, error = (
        np.asarray(leaf) for leaf in (found.poses, found.confidence, found.expected_error)
    )
    symmetry = estimator.trained.model.config.symmetry
    return poses[0], scores_of(poses, confidence, error, symmetry)


def prepared_sample(
    model: PoseModel, cloud: AnyCloud, *, key: PRNGKeyArray
) -> tuple[Float[np.ndarray, "sample 3"], Float[np.ndarray, "seen 3"], Bool[np.ndarray, "sample"]]:
    """Points, normals and mask of a cloud as `estimate_sample` takes them.

    Raises:
      InputError: The cloud is no cloud of an object in metres.
    """
    points, normals = _checked(cloud, key)
    size = bucket(len(points))
    # Only of the rows that are used: normals take longer than all else outside the networks.
    sampled = np.asarray(_sample_rows(model, np.arange(size) < len(points), key=key))
    rows = sampled[sampled < len(points)]
    first = rows[: model.config.points]
    normals = cloud_normals(points, first) if normals is None else normals[first]
    kept, mask = filled(points[rows], model.config.sample)
    return kept, filled(normals, model.config.points)[0], mask


def bucket(count: int) -> int:
    """The padded size of a cloud of `count` points.

    Raises:
      InputError: They are more than `MAX_POINTS`.
    """
    if count > BUCKETS[-1]:
        raise InputError(f"cloud of {count} points; expected at most {BUCKETS[-1]}")
    return next(size for size in BUCKETS if count <= size)


# Not `eqx.filter_jit`: every leaf is an array, and sorting that out takes a millisecond a call.
@jax.jit
def _estimate(
    model: EstimatingModel,
    points: Float[Array, "n 3"],
    normals: Float[Array, "n 3"],
    mask: Bool[Array, "n"],
    *,
    key: PRNGKeyArray,
) -> Estimates:
    return model.estimate(points, normals, mask, key=key)


_estimate_sample = jax.jit(estimate_sample)


@jax.jit
def _sample_rows(model: PoseModel, mask: Bool[Array, "n"], *, key: PRNGKeyArray) -> Int[Array, "m"]:
    return model.sample_rows(mask, key=key)


def _checked(cloud: AnyCloud, key: PRNGKeyArray) -> tuple[np.ndarray, np.ndarray | None]:
    """At most `MAX_POINTS` points and their unit normals, towards the camera; None without any."""
    seeds = seeds_of(key)
    if np.any(getattr(cloud, "eyes", None)):
        raise InputError(
            "cloud of several cameras (it has eyes); expected what one sees: FusedViewEstimator takes it"
        )
    points, normals = checked_cloud(
        cloud, fewest=MIN_POINTS, shortest=SHORTEST, longest=LONGEST, what="an object"
    )
    if len(points) > MAX_POINTS:
        rows = np.random.default_rng(seeds).permutation(len(points))[:MAX_POINTS]
        points, normals = points[rows], None if normals is None else normals[rows]
    if normals is None:
        kept = not_alone(points)
        points = points[kept] if kept.sum() >= MIN_POINTS else points
        return points, None
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.maximum(lengths, 1e-9)
    away = np.sum(normals * points, axis=1, keepdims=True) > 0
    return points, np.where(away, -normals, normals).astype(np.float32)


def _padded(
    points: np.ndarray, normals: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    padded, mask = filled(points, size)
    return padded, filled(normals, size)[0], mask


def filled(rows: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows of zeros after these, up to `size`; and which are not."""
    return np.pad(rows, ((0, size - len(rows)), (0, 0))), np.arange(size) < len(rows)


def _row(found: Estimates, index: int) -> Estimates:
    return jax.tree.map(lambda leaf: leaf[index], found)


def distinct_first(poses: Float[np.ndarray, "h 4 4"], symmetry: CommonSymmetry) -> list[int]:
    """Rows in their order, but after all others those that are alike to one before them.

    Args:
      poses: Of all [m].
      symmetry: That the network knows.
    """
    said = near(poses[:, None], poses[None], symmetry)
    distinct: list[int] = []
    for row in range(len(poses)):
        if not said[row, distinct].any():
            distinct.append(row)
    return distinct + [row for row in range(len(poses)) if row not in distinct]


@lru_cache
def _read_once(path: Path) -> TrainedModel:
    return load_weights(path)
