"""What the saved state of a training is of: an interrupted one is gone on from with the same options only."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from manipose_mj.errors import InputError, brief

STATE_FILE = "state.eqx"
_TOLD = 4  # differences that an error spells out


def described(
    config: Any, about: Mapping[str, Any], model_config: Any = None
) -> dict[str, dict[str, Any]]:
    """What the header of a state says, as it reads back: JSON has no tuples.

    Args:
      config: How is trained, a dataclass.
      about: What batches and first weights are.
      model_config: What is trained, a dataclass; None where it is not known yet.
    """
    parts = {"about": dict(about), "training": dataclasses.asdict(config)}
    if model_config is not None:
        parts["model"] = dataclasses.asdict(model_config)
    return json.loads(json.dumps(parts))


def check_resumable(
    folder: Path, config: Any, about: Mapping[str, Any], model_config: Any = None
) -> None:
    """Raise where a folder holds another training's state; arguments are those of `described`.

    Raises:
      InputError: It does, or the state is damaged.
    """
    path = folder / STATE_FILE
    if path.is_file():
        with state_read(path, described(config, about, model_config)):
            pass


@contextmanager
def state_read(
    path: Path, now: Mapping[str, dict[str, Any]]
) -> Iterator[tuple[IO[bytes], dict[str, Any]]]:
    """The open state, after its header, and the header; what goes wrong inside becomes an `InputError`.

    Args:
      path: Of the state.
      now: What it shall be of.

    Raises:
      InputError: It is of something else, which is told, or damaged.
    """
    try:
        with open(path, "rb") as file:
            header = json.loads(file.readline())
            model, training = header["config"]
            _check_same(path, {"about": header["about"], "training": training, "model": model}, now)
            yield file, header
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes the readers raise
        raise InputError(f"{path}: not a whole training state ({error}); remove it") from None


def _check_same(
    path: Path, then: Mapping[str, dict[str, Any]], now: Mapping[str, dict[str, Any]]
) -> None:
    told = []
    for part, fields in now.items():
        before, after = _flat(then[part]), _flat(fields)
        names = sorted(n for n in {**before, **after} if before.get(n) != after.get(n))
        told += [f"{n} {brief(before.get(n))} (now {brief(after.get(n))})" for n in names]
    if told:
        more = f" and {len(told) - _TOLD} more" if len(told) > _TOLD else ""
        raise InputError(
            f"{path}: the state of a training with {', '.join(told[:_TOLD])}{more}; give the same options to go on, "
            "or another folder"
        )


def _flat(fields: Mapping[str, Any], within: str = "") -> dict[str, Any]:
    """Fields of fields by their whole names, such as `loss.pairs`."""
    found: dict[str, Any] = {}
    for name, value in fields.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{within}{name}.")
        else:
            found[within + name] = value
    return found
