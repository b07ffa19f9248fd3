"""Writes a protocol's file from the tasks as they are: `python -m manipose_mj.evaluation.protocol.freeze v1`.

Only before a version is released: afterwards a change of any task is a new version.
"""

from __future__ import annotations

import hashlib
import json
import re
import sys
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.evaluation.protocol.frozen import (
    EPISODES,
    VERSIONS,
    digest,
    evaluation_seed,
    protocol_path,
)
from manipose_mj.tasks import registered  # noqa: F401  (registers the tasks)
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.registry import TaskSpec, all_tasks, task_spec
from manipose_mj.tasks.core.scene_source import SceneSource


def builtin_tasks() -> list[TaskSpec]:
    """The tasks of this package, whatever else is registered."""
    specs = [task_spec(*task) for task in all_tasks()]
    return [spec for spec in specs if spec.factory.__module__.startswith("manipose_mj.tasks.")]


def frozen_settings(spec: TaskSpec) -> dict[str, Any]:
    """What the protocol's file says of a task's configuration, from the task itself."""
    scenes = SceneSource(spec, evaluation_config(spec))
    task = scenes.build(scenes.draw(np.random.RandomState(0), EpisodeSpec()))
    return {
        "horizon": task.config.horizon,
        "tolerance": asdict(task.config.tolerance),
        "settings": hashlib.sha256(repr(task.config).encode("utf-8")).hexdigest()[:16],
    }


def frozen_episodes(version: str, spec: TaskSpec) -> list[dict[str, Any]]:
    """The entries of a task's episodes: every group of its objects comes equally often."""
    scenes = SceneSource(spec, evaluation_config(spec))
    groups = scenes.strata()
    entries = []
    for i in range(EPISODES):
        group = groups[i % len(groups)]
        asked = group[i // len(groups) % len(group)]
        seed = evaluation_seed(version, spec.full_name, i)
        entries.append(frozen_entry(scenes, replace(asked, seed=seed)))
    return entries


def frozen_entry(scenes: SceneSource, asked: EpisodeSpec) -> dict[str, Any]:
    """The file's entry of an episode: what is asked of it, and the objects that its seed draws."""
    drawn = scenes.draw(np.random.RandomState(asked.seed), asked)
    names = () if drawn is None else tuple(asset.name for asset in drawn.assets)
    entry = {name: value for name, value in asdict(asked).items() if value is not None}
    return {**entry, "objects": list(dict.fromkeys(names))}


def evaluation_config(spec: TaskSpec) -> EnvConfig:
    """The environment that evaluations take place in."""
    return EnvConfig(spec.full_name, obs_mode="state", split="test")


def document(version: str) -> dict[str, Any]:
    """The content of the version's file, from the tasks."""
    tasks = {
        spec.full_name: {**frozen_settings(spec), "episodes": frozen_episodes(version, spec)}
        for spec in builtin_tasks()
    }
    content: dict[str, Any] = {"version": version, "tasks": dict(sorted(tasks.items()))}
    return {"version": version, "sha256": digest(content), "tasks": content["tasks"]}


def main(arguments: list[str]) -> int:
    """Write the file of the version named, or of the newest."""
    version = arguments[0] if arguments else VERSIONS[-1]
    if version not in VERSIONS:
        raise unknown_name("protocol", version, VERSIONS)
    content = document(version)
    lines = json.dumps(content, indent=1)
    # An episode a line.
    lines = re.sub(r"\n {5,}", " ", lines).replace("\n    }", " }")
    path = protocol_path(version)
    try:
        path.write_text(lines + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
    sys.stdout.write(f"{path}: {len(content['tasks'])} tasks, sha256 {content['sha256']}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
