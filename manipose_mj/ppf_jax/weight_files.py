"""Files of trained weights: half-precision arrays and the configuration that gives them their shapes."""

from __future__ import annotations

import dataclasses
import json
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args, get_type_hints

import jax
import jax.numpy as jnp
import numpy as np

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.articulated.model import ArticulatedConfig, ArticulatedModel
from manipose_mj.ppf_jax.cppf.model import CppfModel
from manipose_mj.ppf_jax.cppf.voting import CppfConfig
from manipose_mj.ppf_jax.rigid.model import EstimatingModel, ModelConfig, PoseModel
from manipose_mj.storage.staging import replacing

FORMAT_VERSION = 2  # of the configuration's names and of the arrays' order
_HEADER = "header"
_NUMBERS: dict[type, tuple[type, ...]] = {int: (int,), float: (float, int), bool: (bool,)}
# What a damaged file makes its readers raise; the zip's, for one of another compression or with a password, too.
_DAMAGED = (
    OSError,
    EOFError,
    LookupError,
    TypeError,
    ValueError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
)
MethodName: TypeAlias = Literal["ours", "cppf"]
LabelSet: TypeAlias = Literal["unified", "original"]
Cameras: TypeAlias = Literal["one", "several"]


@dataclass(frozen=True)
class TrainedModel:
    """A model and what it was trained on.

    Attributes:
      model: The networks.
      categories: Of the objects it was trained on.
      labels: What it was trained to find: unified labels, or the frames of the objects' sources.
      cameras: How many saw each of the clouds that it was trained on.
    """

    model: EstimatingModel
    categories: tuple[str, ...]
    labels: LabelSet = "unified"
    cameras: Cameras = "one"

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
        "cameras": trained.cameras,
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
    except _DAMAGED:
        raise InputError(
            f"{path}: not a whole file of weights; copy it again or train again"
        ) from None
    if not isinstance(header, dict):
        raise InputError(f"{path}: a header that is no dictionary; train again")
    if header.get("format") != FORMAT_VERSION:
        raise InputError(
            f"{path}: weights of format {header.get('format')}; this version reads "
            f"{FORMAT_VERSION}: train again or install the version that wrote them"
        )
    if header.get("kind") not in tuple(_KINDS):  # a list is in no dictionary
        raise InputError(
            f"{path}: weights of method {header.get('kind')!r}; this version knows {', '.join(_KINDS)}"
        )
    try:
        build, config = _KINDS[header["kind"]]
        blank = build(_config(config, header["config"]), rng=np.random.default_rng(0))
        shapes, structure = jax.tree.flatten(blank)
        if [leaf.shape for leaf in shapes] != [array.shape for array in arrays]:
            raise ValueError("shapes")
        categories = tuple(header["categories"])
        labels = header["labels"]
        cameras = header.get("cameras", "one")  # files of single views do not say
        if labels not in get_args(LabelSet) or cameras not in get_args(Cameras):
            raise ValueError("labels or cameras")
        finite = all(np.isfinite(array).all() for array in arrays)
    except Exception:  # whatever values of other types make the networks raise
        raise InputError(
            f"{path}: the weights do not fit their configuration; train again"
        ) from None
    if not finite:
        raise InputError(f"{path}: weights that are not finite; copy it again or train again")
    model = jax.tree.unflatten(structure, [jnp.asarray(a, jnp.float32) for a in arrays])
    return TrainedModel(model, categories, labels, cameras)


def _config(kind: Any, stored: dict[str, Any]) -> Any:
    """A dataclass from what `dataclasses.asdict` made of it, after JSON, which has no tuples.

    Raises:
      KeyError: It has no such field.
      TypeError: It lacks a field, or one is of another type.
    """
    types = get_type_hints(kind)
    values = {}
    for name, value in stored.items():
        if dataclasses.is_dataclass(types[name]):
            value = _config(types[name], value)
        elif types[name] in _NUMBERS and type(value) not in _NUMBERS[types[name]]:
            raise TypeError(f"{name} is {value!r}")
        values[name] = tuple(value) if isinstance(value, list) else value
    return kind(**values)


_KINDS: dict[str, tuple[Callable[..., Any], type]] = {
    "ours": (PoseModel, ModelConfig),
    "cppf": (CppfModel, CppfConfig),
    "articulated": (ArticulatedModel, ArticulatedConfig),
}
