"""The estimators that can be trained: ours, and CPPF as published, which tables compare it with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from manipose_mj.ppf_jax.clouds import SAMPLE_POINTS, LabelledCloud
from manipose_mj.ppf_jax.cppf import CppfLoss, CppfModel, cppf_config
from manipose_mj.ppf_jax.cppf_voting import CppfConfig
from manipose_mj.ppf_jax.model import ModelConfig, PoseModel
from manipose_mj.ppf_jax.symmetry import common_symmetry
from manipose_mj.ppf_jax.training import TrainingConfig
from manipose_mj.ppf_jax.weights import MethodName


@dataclass(frozen=True)
class Method:
    """How a kind of estimator is trained.

    Attributes:
      build: Makes its model from a configuration and `rng`.
      configured: The model's configuration for a training set.
      training: Its rates and loss; steps and seed are the caller's.
      points: Of each cloud of a batch.
      checks: Clouds of the test objects that the curve is measured on.
    """

    build: Callable[..., Any]
    configured: Callable[[Sequence[LabelledCloud]], Any]
    training: TrainingConfig
    points: int
    checks: int


def _ours(clouds: Sequence[LabelledCloud]) -> ModelConfig:
    return ModelConfig(symmetry=common_symmetry(cloud.symmetry for cloud in clouds))


METHODS: dict[MethodName, Method] = {
    "ours": Method(PoseModel, _ours, TrainingConfig(), SAMPLE_POINTS, checks=256),
    # On a CPU it votes for seconds over each cloud: the curve gets fewer errors, of fewer clouds.
    "cppf": Method(
        CppfModel,
        cppf_config,
        TrainingConfig(learning_rate=1e-3, loss=CppfLoss(), evaluate_every=5000),
        CppfConfig.points,
        checks=32,
    ),
}
