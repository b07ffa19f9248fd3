"""The estimators that can be trained: ours, and CPPF as published, which tables compare it with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from manipose_mj.ppf_jax.cppf.model import CppfLoss, CppfModel, cppf_config
from manipose_mj.ppf_jax.points.clouds import CloudBatch, LabelledCloud
from manipose_mj.ppf_jax.rigid.model import PoseModel
from manipose_mj.ppf_jax.rigid.model_sizes import model_config
from manipose_mj.ppf_jax.training.ambiguity_penalty import choose_ambiguity_penalty
from manipose_mj.ppf_jax.training.loop import TrainingConfig
from manipose_mj.ppf_jax.weight_files import MethodName


@dataclass(frozen=True)
class Method:
    """How a kind of estimator is trained.

    Attributes:
      build: Makes its model from a configuration and `rng`.
      configured: The model's configuration for a training set; `points` is of each cloud of a batch.
      training: Its rates and loss; steps and seed are the caller's.
      checks: Clouds of the test objects that the curve is measured on.
      tuned: What is left to choose of a trained model on batches of training views; None for nothing.
    """

    build: Callable[..., Any]
    configured: Callable[[Sequence[LabelledCloud]], Any]
    training: TrainingConfig
    checks: int
    tuned: Callable[[Any, Sequence[CloudBatch]], Any] | None = None


METHODS: dict[MethodName, Method] = {
    "ours": Method(
        PoseModel, model_config, TrainingConfig(), checks=256, tuned=choose_ambiguity_penalty
    ),
    # On a CPU it votes for seconds over each cloud: the curve gets fewer errors, of fewer clouds.
    "cppf": Method(
        CppfModel,
        cppf_config,
        TrainingConfig(learning_rate=1e-3, loss=CppfLoss(), evaluate_every=5000),
        checks=32,
    ),
}
