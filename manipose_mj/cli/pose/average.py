"""`manipose pose average`: one file of weights from several trainings'."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from manipose_mj.errors import InputError

if TYPE_CHECKING:
    from manipose_mj.ppf_jax.weight_files import TrainedModel

Files = Annotated[Positional[tuple[Path, ...]], arg(metavar="FILE FILE...")]


def average_weights(
    files: Files, /, *, out: Annotated[Path, arg(metavar="FILE", help_behavior_hint="")]
) -> int:
    """Average the weights of trainings that started from the same ones, or from one another.

    On objects unlike those of either, the average can do better than both. Everything else in the file is
    the first one's.

    Args:
      files: Two or more, of one kind and of the same sizes.
      out: File to write.
    """
    if len(files) < 2:
        raise InputError(f"{len(files)} files of weights to average; expected at least 2")
    from manipose_mj.ppf_jax.training.loop import mean_weights
    from manipose_mj.ppf_jax.weight_files import load_weights, save_weights

    first, *others = (load_weights(path) for path in files)
    for path, other in zip(files[1:], others, strict=True):
        if _kind(other) != _kind(first):
            raise InputError(
                f"{path}: weights of {', '.join(_kind(other))}; expected {', '.join(_kind(first))} as "
                f"{files[0]} has"
            )
    try:
        model = mean_weights([first.model, *(other.model for other in others)])
    except InputError as error:
        raise InputError(f"{', '.join(map(str, files))}: {error}") from None
    save_weights(out, replace(first, model=model))
    return 0


def _kind(trained: TrainedModel) -> tuple[str, ...]:
    """What weights must share to be averaged, in words."""
    categories = ", ".join(trained.categories)
    return trained.method, categories, f"{trained.labels} labels", f"{trained.cameras} camera"
