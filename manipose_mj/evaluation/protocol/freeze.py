"""Writes a protocol's file from the tasks as they are: `python -m manipose_mj.evaluation.protocol.freeze v1`.

Tasks that the file already has keep their seeds, those drawn again too; what follows from the seeds is written anew.
`--anew` draws every start for the first time instead: certificates of starts drawn again then lapse.

For `v1-real`, folders of built assets follow: all that they hold of the three data sets enters, and every start is new.

Only before a version is released: afterwards a change of any task is a new version.
"""

from __future__ import annotations

import hashlib
import json
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.asset_json import read_asset
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.evaluation.protocol.frozen import (
    EPISODES,
    VERSIONS,
    digest,
    evaluation_seed,
    load,
    protocol_path,
    read_episode,
)
from manipose_mj.evaluation.protocol.own_assets import BuiltAsset, built_assets
from manipose_mj.tasks import registered  # noqa: F401  (registers the tasks)
from manipose_mj.tasks.articulated.registered import OPENABLES
from manipose_mj.tasks.clutter.object_draw import require_fit_for_piles
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.registry import TaskSpec, all_tasks, task_spec
from manipose_mj.tasks.core.scene_source import SceneSource
from manipose_mj.tasks.scene.resting import require_graspable

# With a user's objects it stores any of them, as `store_middle_drawer` does.
_SAME_WITH_SCANS = ("articulated/store_chips_can_middle_drawer",)


def builtin_tasks() -> list[TaskSpec]:
    """The tasks of this package, whatever else is registered."""
    specs = [task_spec(*task) for task in all_tasks()]
    return [spec for spec in specs if spec.factory.__module__.startswith("manipose_mj.tasks.")]


def frozen_settings(
    spec: TaskSpec, config: EnvConfig | None = None, asked: EpisodeSpec | None = None
) -> dict[str, Any]:
    """What the protocol's file says of a task's configuration, from the task itself.

    Args:
      spec: The task.
      config: The environment; by default that of evaluations with built-in assets.
      asked: Of an episode whose objects are at hand, as the task is made with some; they change no setting.
    """
    scenes = SceneSource(spec, config or evaluation_config(spec))
    asked = asked or EpisodeSpec(seed=0)
    task = scenes.build(scenes.draw(np.random.RandomState(asked.seed), asked))
    return {
        "horizon": task.config.horizon,
        "tolerance": asdict(task.config.tolerance),
        "settings": hashlib.sha256(repr(task.config).encode("utf-8")).hexdigest()[:16],
    }


def frozen_episodes(
    version: str,
    spec: TaskSpec,
    config: EnvConfig | None = None,
    known: Sequence[Mapping[str, Any]] = (),
) -> list[dict[str, Any]]:
    """The entries of a task's episodes: every group of its objects comes equally often.

    Args:
      version: Whose number of episodes it is.
      spec: The task.
      config: The environment; by default that of evaluations with built-in assets.
      known: Entries of the first episodes. What is asked of these stays, their seeds too; what these draw is written anew.
    """
    scenes = SceneSource(spec, config or evaluation_config(spec))
    entries = [
        frozen_entry(scenes, EpisodeSpec(**read_episode(entry).asked))
        for entry in known[: EPISODES[version]]
    ]
    groups = scenes.strata() if len(entries) < EPISODES[version] else [()]
    if not groups:
        raise InputError("no object is of use")
    for i in range(len(entries), EPISODES[version]):
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


def evaluation_config(spec: TaskSpec, objects: Sequence[Asset] | None = None) -> EnvConfig:
    """The environment that evaluations take place in."""
    return EnvConfig(spec.full_name, obs_mode="state", split="test", objects=objects)


def document(version: str, before: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The content of the version's file, from the tasks.

    Args:
      version: Such as `"v1"`.
      before: The content so far: its tasks keep what is asked of their episodes. None draws all starts for the first time.
    """
    known = {} if before is None else before["tasks"]
    tasks = {}
    for spec in builtin_tasks():
        entries = known.get(spec.full_name, {}).get("episodes", ())
        episodes = frozen_episodes(version, spec, known=entries)
        tasks[spec.full_name] = {**frozen_settings(spec), "episodes": episodes}
    return stated({"version": version, "tasks": dict(sorted(tasks.items()))})


def document_of_assets(version: str, assets: Sequence[BuiltAsset]) -> dict[str, Any]:
    """The content of the file of a version whose assets users build; tasks that can use none of them are left out.

    Raises:
      InputError: Two assets have the same name.
    """
    own = sorted((asset for asset in assets if asset.data_set), key=lambda a: (a.data_set, a.name))
    names = [asset.name for asset in own]
    if len(set(names)) < len(names):
        raise InputError(f"several assets are called {max(names, key=names.count)}")
    loaded = [read_asset(asset.folder) for asset in own]
    tasks, used = {}, set()
    for spec in sorted(builtin_tasks(), key=lambda spec: spec.full_name):
        pool = pool_for(spec, loaded)
        config = evaluation_config(spec, pool)
        try:
            if not pool or spec.full_name in _SAME_WITH_SCANS:
                raise InputError(
                    f"{spec.full_name}: it is another task's twin, or there is nothing for it"
                )
            episodes = frozen_episodes(version, spec, config)
            settings = frozen_settings(spec, config)
        except InputError as error:
            sys.stderr.write(f"left out: {spec.full_name}: {error}\n")
            continue
        named = {entry.get("furniture") for entry in episodes}
        # Pieces without the part in question are of no use to anybody.
        pooled = [each.name for each in pool if each.kind == "rigid" or each.name in named]
        used |= set(pooled)
        tasks[spec.full_name] = {**settings, "pool": pooled, "episodes": episodes}
    lists: dict[str, list[str]] = {}
    for asset in own:
        if asset.name in used:
            lists.setdefault(asset.data_set, []).append(asset.name)
    return stated({"version": version, "assets": lists, "tasks": tasks})


def pool_for(spec: TaskSpec, assets: Sequence[Asset]) -> list[Asset]:
    """Of the assets those that a task may draw: what a hand can hold, and furniture of the kind that it is about."""
    require = require_fit_for_piles if spec.domain == "clutter" else require_graspable
    rigid = [each for each in assets if each.graspable is not False and _meets(require, each)]
    if "articulated" not in spec.tags:
        return rigid
    kinds = next(each.requested.own for part, each in OPENABLES.items() if spec.name.endswith(part))
    pieces = [
        each
        for each in assets
        if each.kind == "articulated"
        and each.category in kinds
        and any(part.handle is not None for part in each.parts)
    ]
    if {"store", "take_out"} & set(spec.tags):
        return pieces and [*pieces, *rigid]
    return pieces


def _meets(require: Callable[[Asset], None], asset: Asset) -> bool:
    if asset.kind != "rigid":
        return False
    try:
        require(asset)
    except InputError:
        return False
    return True


def stated(content: dict[str, Any]) -> dict[str, Any]:
    """A version's content with the hash of it, ahead of the tasks."""
    tasks = content.pop("tasks")
    return {**content, "sha256": digest({**content, "tasks": tasks}), "tasks": tasks}


def main(arguments: list[str]) -> int:
    """Write the file of the version named, or of the first; of folders of assets, where some follow."""
    anew = "--anew" in arguments
    version, *folders = [each for each in arguments if each != "--anew"] or [VERSIONS[0]]
    if version not in VERSIONS:
        raise unknown_name("protocol", version, VERSIONS)
    if folders:
        content = document_of_assets(version, built_assets(folders))
    else:
        known = not anew and protocol_path(version).exists()
        content = document(version, _stored(version) if known else None)
    path = write_protocol(version, content)
    sys.stdout.write(f"{path}: {len(content['tasks'])} tasks, sha256 {content['sha256']}\n")
    return 0


def _stored(version: str) -> dict[str, Any]:
    load(version)  # refuses a file that was edited
    return json.loads(protocol_path(version).read_text(encoding="utf-8"))


def write_protocol(version: str, content: dict[str, Any]) -> Path:
    """Write a version's file.

    Raises:
      InputError: It cannot be written.
    """
    lines = json.dumps(content, indent=1)
    # An episode a line.
    lines = re.sub(r"\n {5,}", " ", lines).replace("\n    }", " }")
    path = protocol_path(version)
    try:
        path.write_text(lines + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
    return path


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
