"""Whether the tasks that are installed are still what a protocol fixes about them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from manipose_mj.errors import InputError
from manipose_mj.evaluation.protocol.freeze import frozen_settings
from manipose_mj.evaluation.protocol.frozen import FrozenTask, Protocol
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.registry import named_task


def check_settings(frozen: Protocol, config: EnvConfig) -> None:
    """Nothing, if a task has the time limit, the tolerance and all else that the protocol fixes; loads its first objects.

    Args:
      frozen: The protocol.
      config: The environment that the task's episodes take place in.

    Raises:
      InputError: It has another, or the protocol lacks the task.
    """
    first = EpisodeSpec(**frozen.episode(config.task, 0).asked)
    present = _fields(frozen_settings(named_task(config.task), config, first))
    for name, value in _fields(_stated(frozen.task(config.task))).items():
        if present.get(name) != value:
            raise InputError(
                f"{config.task}: protocol {frozen.version} fixes {name} {value!r}, here it is {present.get(name)!r}; "
                "results would not be the protocol's: undo the change of the task, or leave out --protocol"
            )


def _stated(task: FrozenTask) -> dict[str, Any]:
    """What the protocol's file says, as `frozen_settings` says it."""
    return {"horizon": task.horizon, "tolerance": task.tolerance, "settings": task.settings}


def _fields(settings: Mapping[str, Any]) -> dict[str, Any]:
    """With a tolerance's numbers one by one; the digest of all comes last."""
    tolerance = {f"tolerance of {name}": each for name, each in settings["tolerance"].items()}
    return {"horizon": settings["horizon"], **tolerance, "settings": settings["settings"]}
