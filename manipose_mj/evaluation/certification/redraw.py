"""Draws starts that nobody solved anew: `python -m manipose_mj.evaluation.certification.redraw v1 [CERTIFICATES]`.

An episode keeps its place in the protocol: the same object, piece of furniture and part, another seed. The certificates
keep the reason why the start before was given up, so that such starts are counted and not hidden.

Only before a version is released, as freezing it.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from manipose_mj.errors import InputError
from manipose_mj.evaluation.certification.certificates import (
    Certificates,
    certificates_path,
    load_certificates,
    save_certificates,
)
from manipose_mj.evaluation.protocol.freeze import (
    evaluation_config,
    frozen_entry,
    stated,
    write_protocol,
)
from manipose_mj.evaluation.protocol.frozen import evaluation_seed, load, protocol_path
from manipose_mj.tasks.core.config import EpisodeSpec
from manipose_mj.tasks.core.registry import task_spec
from manipose_mj.tasks.core.scene_source import SceneSource


def redrawn(
    document: Mapping[str, Any], known: Certificates
) -> tuple[dict[str, Any], Certificates]:
    """A protocol's document with other seeds where no attempt solved the start, and the certificates that go with it.

    Args:
      document: The content of the protocol's file, its assets built in.
      known: Certificates of it.
    """
    tasks = {name: dict(fields) for name, fields in document["tasks"].items()}
    refused = dict(known.refused)
    for name in sorted({task for task, _ in known.unsolved}):
        scenes = SceneSource(spec := task_spec(*name.split("/")), evaluation_config(spec))
        episodes = list(tasks[name]["episodes"])
        for (task, number), reason in known.unsolved.items():
            if task != name:
                continue
            refused[task, number] = (*refused.get((task, number), ()), reason)
            before = {k: v for k, v in episodes[number].items() if k != "objects"}
            draw = len(refused[task, number])
            seed = evaluation_seed(known.version, task, number, draw)
            episodes[number] = frozen_entry(scenes, replace(EpisodeSpec(**before), seed=seed))
        tasks[name]["episodes"] = episodes
    content = {key: value for key, value in document.items() if key != "sha256"}
    return stated({**content, "tasks": tasks}), replace(known, unsolved={}, refused=refused)


def main(arguments: list[str]) -> int:
    """Write the protocol and its certificates, which are of this package or in the file named."""
    version, *files = arguments or ["v1"]
    protocol = load(version)
    if protocol.sources:
        raise InputError(
            f"{version}: its assets are built by users; freeze it again with their folders"
        )
    known = load_certificates(protocol, Path(files[0]) if files else None)
    document = json.loads(protocol_path(version).read_text(encoding="utf-8"))
    content, certificates = redrawn(document, known)
    write_protocol(version, content)
    load.cache_clear()
    save_certificates(certificates, load(version), certificates_path(version))
    sys.stdout.write(
        f"{protocol_path(version)}: {len(known.unsolved)} starts drawn again, sha256 {content['sha256']}\n"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
