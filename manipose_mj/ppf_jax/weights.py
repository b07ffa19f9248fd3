"""Files of trained weights: half-precision arrays and the configuration that gives them their shapes."""

from __future__ import annotations

import dataclasses
import json
import os
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np

from asset_pipeline.staging import staging
from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.articulated_model import ArticulatedConfig, ArticulatedModel
from manipose_mj.ppf_jax.close_look import CloseLook
from manipose_mj.ppf_jax.cppf import CppfModel
from manipose_mj.ppf_jax.cppf_voting import CppfConfig
from manipose_mj.ppf_jax.front_edges import FrontEdgesConfig
from manipose_mj.ppf_jax.handle_fit import HandleFitConfig
from manipose_mj.ppf_jax.model import EstimatingModel, ModelConfig, PoseModel
from manipose_mj.ppf_jax.network import NetworkConfig
from manipose_mj.ppf_jax.part_network import PartNetworkConfig
from manipose_mj.ppf_jax.part_voting import PartVotingConfig
from manipose_mj.ppf_jax.refinement import RefinementConfig
from manipose_mj.ppf_jax.revolution import RevolutionConfig
from manipose_mj.ppf_jax.symmetry import CommonSymmetry
from manipose_mj.ppf_jax.voting import VotingConfig

FORMAT_VERSION = 1
_HEADER = "header"
MethodName: TypeAlias = Literal["ours", "cppf"]
LabelSet: TypeAlias = Literal["unified", "original"]


@dataclass(frozen=True)
class TrainedModel:
    """A model and what it was trained on.

    Attributes:
      model: The networks.
      categories: Of the objects it was trained on.
      labels: What it was trained to find: unified labels, or the frames of the objects' sources.
    """

    model: EstimatingModel
    categories: tuple[str, ...]
    labels: LabelSet = "unified"

    @property
    def method(self) -> MethodName:
        """Whose model it is."""
        return next(name for name, (build, _) in _KINDS.items() if type(self.model) is build)  # pyright: ignore[reportReturnType]


def save_weights(path: Path, trained: TrainedModel) -> None:
    """Write a model to a file, whole or not at all."""
    header = {
        "format": FORMAT_VERSION,
        "categories": trained.categories,
        "kind": trained.method,
        "labels": trained.labels,
        "config": dataclasses.asdict(trained.model.config),
    }
    leaves = jax.tree.leaves(trained.model)
    arrays: dict[str, Any] = {
        f"leaf_{i:03d}": np.asarray(leaf, np.float16) for i, leaf in enumerate(leaves)
    }
    arrays[_HEADER] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as scratch, open(scratch, "wb") as file:
        np.savez_compressed(file, **arrays)


def load_weights(path: Path) -> TrainedModel:
    """Read a model.

    Raises:
      InputError: The file is missing, truncated, of another version or no file of weights at all.
    """
    try:
        with np.load(path) as stored:
            header = json.loads(bytes(stored[_HEADER]))
            arrays = [stored[name] for name in sorted(stored.files) if name != _HEADER]
    except FileNotFoundError:
        raise InputError(f"{path}: no such file of weights") from None
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile, zlib.error):
        raise InputError(
            f"{path}: not a whole file of weights; copy it again or train anew"
        ) from None
    if header.get("format") != FORMAT_VERSION:
        raise InputError(
            f"{path}: weights of format {header.get('format')}; this version reads "
            f"{FORMAT_VERSION}: train anew or install the version that wrote them"
        )
    if header.get("kind") not in _KINDS:
        raise InputError(
            f"{path}: weights of method {header.get('kind')!r}; this version knows {', '.join(_KINDS)}"
        )
    try:
        build, configured = _KINDS[header["kind"]]
        blank = build(configured(header["config"]), rng=np.random.default_rng(0))
        shapes, structure = jax.tree.flatten(blank)
        if [leaf.shape for leaf in shapes] != [array.shape for array in arrays]:
            raise ValueError("shapes")
        categories = tuple(header["categories"])
        labels = header.get("labels", "unified")  # older files are all of unified labels
    except (KeyError, TypeError, ValueError):
        raise InputError(
            f"{path}: the weights do not fit their configuration; train anew"
        ) from None
    model = jax.tree.unflatten(structure, [jnp.asarray(a, jnp.float32) for a in arrays])
    return TrainedModel(model, categories, labels)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A scratch path that takes the place of `path` at once when all went well."""
    with staging(path) as folder:
        scratch = folder / path.name
        yield scratch
        os.replace(scratch, path)


def _model_config(stored: dict[str, Any]) -> ModelConfig:
    return ModelConfig(
        symmetry=CommonSymmetry(**stored["symmetry"]),
        network=NetworkConfig(**stored["network"]),
        voting=VotingConfig(**stored["voting"]),
        refinement=RefinementConfig(**_tuples(stored["refinement"])),
        revolution=RevolutionConfig(**_known(RevolutionConfig, stored.get("revolution", {}))),
        pairs=stored["pairs"],
        points=stored["points"],
    )


def _cppf_config(stored: dict[str, Any]) -> CppfConfig:
    return CppfConfig(**_tuples(stored | {"symmetry": CommonSymmetry(**stored["symmetry"])}))


def _articulated_config(stored: dict[str, Any]) -> ArticulatedConfig:
    own = {
        "body": NetworkConfig(**stored["body"]),
        "body_voting": VotingConfig(**stored["body_voting"]),
        "edges": FrontEdgesConfig(**_known(FrontEdgesConfig, stored.get("edges", {}))),
        "network": PartNetworkConfig(**_tuples(stored["network"])),
        "voting": PartVotingConfig(**_known(PartVotingConfig, stored["voting"])),
        "close": CloseLook(**_known(CloseLook, stored.get("close", {}))),
        "fit": HandleFitConfig(**_known(HandleFitConfig, stored.get("fit", {}))),
    }
    return ArticulatedConfig(**(_known(ArticulatedConfig, stored) | own))


def _known(kind: type, stored: dict[str, Any]) -> dict[str, Any]:
    """What a dataclass still has: older files say more."""
    fields = {field.name for field in dataclasses.fields(kind)}
    return _tuples({name: value for name, value in stored.items() if name in fields})


def _tuples(stored: dict[str, Any]) -> dict[str, Any]:
    """JSON's lists as the tuples they were."""
    return {k: tuple(v) if isinstance(v, list) else v for k, v in stored.items()}


_KINDS: dict[str, tuple[Callable[..., Any], Callable[[dict[str, Any]], Any]]] = {
    "ours": (PoseModel, _model_config),
    "cppf": (CppfModel, _cppf_config),
    "articulated": (ArticulatedModel, _articulated_config),
}
