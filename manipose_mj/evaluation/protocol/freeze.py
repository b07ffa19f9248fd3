"""Writes a protocol's file from the tasks as they are: `python -m manipose_mj.evaluation.protocol.freeze v1`.

Only before a version is released: afterwards a change of any task is a new version.
"""

from __future__ import annotations

import hashlib
import json
import sys
from dataclasses import asdict
from typing import Any

from manipose_mj.assets.categories import Split
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.evaluation.protocol.frozen import (
    EPISODES,
    VERSIONS,
    digest,
    evaluation_seed,
    protocol_path,
)
from manipose_mj.mjcf.objects import ArticulatedObject, RigidObject
from manipose_mj.tasks import registered  # noqa: F401  (registers the tasks)
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.registry import TaskSpec, all_tasks, task_spec
from manipose_mj.tasks.core.task import ManipulationTask


def builtin_tasks() -> list[TaskSpec]:
    """The tasks of this package, whatever else is registered."""
    specs = [task_spec(*task) for task in all_tasks()]
    return [spec for spec in specs if spec.factory.__module__.startswith("manipose_mj.tasks.")]


def frozen_fields(version: str, spec: TaskSpec) -> dict[str, Any]:
    """What the version's file says of a task, from the task itself."""
    train, test = _built(spec, "train"), _built(spec, "test")
    return {
        "horizon": test.config.horizon,
        "tolerance": asdict(test.config.tolerance),
        "settings": hashlib.sha256(repr(test.config).encode("utf-8")).hexdigest()[:16],
        "train_objects": object_names(train),
        "test_objects": object_names(test),
        "seeds": [evaluation_seed(version, spec.full_name, i) for i in range(EPISODES)],
    }


def object_names(task: ManipulationTask) -> list[str]:
    """The assets of a task's scene, used by an episode or waiting, sorted."""
    kinds = (RigidObject, ArticulatedObject)
    entities = task.root_entity.iter_entities()
    return sorted({entity.asset.name for entity in entities if isinstance(entity, kinds)})


def document(version: str) -> dict[str, Any]:
    """The content of the version's file, from the tasks."""
    tasks = {spec.full_name: frozen_fields(version, spec) for spec in builtin_tasks()}
    content: dict[str, Any] = {"version": version, "tasks": dict(sorted(tasks.items()))}
    return {"version": version, "sha256": digest(content), "tasks": content["tasks"]}


def main(arguments: list[str]) -> int:
    """Write the file of the version named, or of the newest."""
    version = arguments[0] if arguments else VERSIONS[-1]
    if version not in VERSIONS:
        raise unknown_name("protocol", version, VERSIONS)
    content = document(version)
    lines = json.dumps(content, indent=1).replace("\n    ", " ").replace("\n   ]", " ]")
    path = protocol_path(version)
    try:
        path.write_text(lines + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
    sys.stdout.write(f"{path}: {len(content['tasks'])} tasks, sha256 {content['sha256']}\n")
    return 0


def _built(spec: TaskSpec, split: Split) -> ManipulationTask:
    return spec.factory(EnvConfig(spec.full_name, obs_mode="state", split=split))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
