"""From pose scores to a probability: how sure the pose scorer is, and how far the best hypothesis is ahead of its rivals.

The scorer is too sure of shapes that it has never seen. `Calibration` weighs its score and that of the best rival, the
flips and turns among them. Its coefficients ship beside the weights; `benchmarks/flips/fit_confidence.py` writes them.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, pose_error
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry

NEAR = (0.02, np.deg2rad(15.0))  # what confidence is about [m, rad]
FEATURES = (
    "score",
    "rival score",
    "lead",
    "expected error",
    "axial",
    "box",
    "views",
    "views x score",
)
FILE = "confidence.json"  # beside the weights
_SURE = 1e-4  # a score of the pose scorer is not believed to be nearer to 0 or 1
_NO_RIVAL = np.deg2rad(110.0)  # expected rotation error of a rival where there is none [rad]


@dataclass(frozen=True)
class Scores:
    """What is known of the best hypothesis.

    Attributes:
      score: Its probability by the pose scorer.
      rival: That of the best hypothesis elsewhere; 0 without one.
      expected_error: Its expected rotation error [rad].
      rival_error: The least elsewhere [rad].
      symmetry: That the network knows.
      elsewhere: `(h,)`, which hypotheses, this one the first, are rivals.
      views: That were scored together.
    """

    score: float
    rival: float
    expected_error: float
    rival_error: float
    symmetry: CommonSymmetry
    elsewhere: Bool[np.ndarray, "h"]
    views: int = 1

    def features(self) -> Float[np.ndarray, "f"]:
        """Of `FEATURES`, in order."""
        score, rival = _logit(self.score), _logit(self.rival)
        views = float(np.log2(self.views))
        return np.array(
            [
                score,
                rival,
                self.rival_error - self.expected_error,
                self.expected_error,
                float(self.symmetry.axial),
                float(_box(self.symmetry)),
                views,
                views * score,
            ]
        )


@dataclass(frozen=True)
class Calibration:
    """A logistic regression on `FEATURES`.

    Attributes:
      mean: Of each feature in its fit; scale: its deviation; weights: of the scaled ones; bias.
    """

    mean: tuple[float, ...]
    scale: tuple[float, ...]
    weights: tuple[float, ...]
    bias: float

    def probability(self, scores: Scores) -> float:
        """Of the pose's being within 15 deg and 2 cm."""
        return self.of_features(scores.features())

    def of_features(self, features: Float[np.ndarray, "f"] | Sequence[float]) -> float:
        """`probability` of `FEATURES`."""
        scaled = (np.asarray(features) - self.mean) / self.scale
        return float(1 / (1 + np.exp(-(self.bias + scaled @ np.asarray(self.weights)))))

    def of_all(self, confidence: Float[np.ndarray, "h"], scores: Scores) -> Float[np.ndarray, "h"]:
        """Of every hypothesis, the best first: rivals have at most what it leaves, the others at most as much."""
        if confidence[0] <= 0:  # what the networks make nothing of
            return confidence
        first = self.probability(scores)
        most = np.where(scores.elsewhere, 1.0 - first, first)
        return np.append(first, np.minimum(confidence, most)[1:])

    def write(self, path: Path) -> None:
        """Write it as JSON."""
        path.write_text(json.dumps({"features": FEATURES, **asdict(self)}, indent=1) + "\n")

    @classmethod
    def read(cls, path: Path) -> Calibration:
        """Of a file that `write` wrote.

        Raises:
          InputError: It is missing, or of other features.
        """
        try:
            stored = json.loads(path.read_text())
            if tuple(stored.pop("features")) != FEATURES:
                raise ValueError
            mean, scale, weights = (tuple(stored[key]) for key in ("mean", "scale", "weights"))
            return cls(mean, scale, weights, float(stored["bias"]))
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            raise InputError(f"{path}: no calibration of this version's features") from None


def shipped_calibration() -> Calibration:
    """That of the weights that ship with the package."""
    found = calibration_in(Path(str(resources.files("manipose_mj.ppf_jax"))) / "weights")
    assert found is not None  # it ships
    return found


@lru_cache
def calibration_in(folder: Path) -> Calibration | None:
    """The calibration beside the weights in a folder, read once; None without one.

    Raises:
      InputError: The file is of other features.
    """
    path = folder / FILE
    return Calibration.read(path) if path.is_file() else None


def scores_of(
    poses: Float[np.ndarray, "h 4 4"],
    confidence: Float[np.ndarray, "h"],
    expected_error: Float[np.ndarray, "h"],
    symmetry: CommonSymmetry,
    views: int = 1,
) -> Scores:
    """Of hypotheses, the best first.

    Args:
      poses: Of all [m].
      confidence: By the pose scorer.
      expected_error: [rad].
      symmetry: That the network knows.
      views: That were scored together.
    """
    elsewhere = ~alike(poses, poses[0], symmetry)
    if not elsewhere.any():
        rival, rival_error = 0.0, float(_NO_RIVAL)
    else:
        rival, rival_error = confidence[elsewhere].max(), expected_error[elsewhere].min()
    return Scores(
        float(confidence[0]),
        float(rival),
        float(expected_error[0]),
        float(rival_error),
        symmetry,
        elsewhere,
        views,
    )


def alike(
    poses: Float[np.ndarray, "h 4 4"], pose: Float[np.ndarray, "4 4"], symmetry: CommonSymmetry
) -> Bool[np.ndarray, "h"]:
    """Which poses are within 15 deg and 2 cm of a pose, or of one that the symmetry takes for the same."""
    return near(poses, np.broadcast_to(pose, poses.shape), symmetry)


def near(
    poses: Float[np.ndarray, "*#b 4 4"],
    others: Float[np.ndarray, "*#b 4 4"],
    symmetry: CommonSymmetry,
) -> Bool[np.ndarray, "*#b"]:
    """`alike` of poses and others that broadcast."""
    group = SymmetryGroup(_equivalent(symmetry), axial=symmetry.axial)
    shift, turn = pose_error(poses.astype(float), others.astype(float), group)
    return (shift < NEAR[0]) & (turn < NEAR[1])


def _box(symmetry: CommonSymmetry) -> bool:
    return symmetry.unsigned_x and symmetry.unsigned_y


def _equivalent(symmetry: CommonSymmetry) -> Float[np.ndarray, "k 3 3"]:
    """The discrete turns that a network of this symmetry takes for none."""
    half_turns = [np.diag(signs) for signs in ((1.0, -1, -1), (-1.0, 1, -1), (-1.0, -1, 1))]
    members = [np.eye(3)]
    if symmetry.unsigned_y:
        members += half_turns[:1]
    if symmetry.unsigned_x and (symmetry.unsigned_y or symmetry.axial):
        members += half_turns[1:]
    return np.array(members)


def _logit(probability: float) -> float:
    p = min(max(probability, _SURE), 1 - _SURE)
    return float(np.log(p / (1 - p)))
