"""The results of an evaluation on a protocol, held against its frozen seeds."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.cards.episode_rules import broken_rules
from manipose_mj.evaluation.cards.method import sources_of
from manipose_mj.evaluation.cards.run_forms import check_forms
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.records import EpisodeResult, read_results
from manipose_mj.evaluation.results_folder import RESULTS_FILE, RUN_FILE


@dataclass(frozen=True)
class RunRecord:
    """A finished evaluation.

    Attributes:
      run: The content of its `run.json`.
      results: Every episode, in the order of task and episode.
      sha256: Of its `results.jsonl`.
    """

    run: dict[str, Any]
    results: tuple[EpisodeResult, ...]
    sha256: str


def read_run(folder: Path) -> RunRecord:
    """The evaluation in a folder, complete and on the seeds that its protocol fixes.

    Raises:
      InputError: A file is missing or broken, the run follows no protocol of this version or does not tell its
        method, or an episode is missing, superfluous, of another seed, against the protocol's rules or told other
        things than the run; one line says which.
    """
    run = _run_file(folder / RUN_FILE)
    path = folder / RESULTS_FILE
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    content = path.read_bytes()
    results, size = read_results(path)
    if size < len(content):
        raise InputError(f"{path}: line {len(results) + 1} is not an episode's whole result")
    _check_episodes(path, _config(folder, run), results)
    _check_told(folder, run, results)
    _check_command(folder / RUN_FILE, run)
    ordered = tuple(sorted(results, key=lambda result: result.key))
    return RunRecord(run, ordered, hashlib.sha256(content).hexdigest())


def _run_file(path: Path) -> dict[str, Any]:
    try:
        run = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error})") from None
    if not isinstance(run, dict) or not run.get("protocol"):
        raise InputError(
            f"{path}: no run of a protocol; a card is of `manipose evaluate --protocol v1`"
        )
    try:
        frozen = protocol.load(str(run["protocol"]))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if run.get("protocol sha256") != frozen.sha256:
        raise InputError(
            f"{path}: protocol {frozen.version} has sha256 {frozen.sha256[:12]}..., "
            f"the run is of {str(run.get('protocol sha256'))[:12]}..."
        )
    check_forms(path, run)
    for name in ("seed", "objects"):
        if run.get(name):
            raise InputError(
                f"{path}: {name} is {run[name]!r:.80}; protocol {frozen.version} fixes seeds and objects"
            )
    return run


def _check_told(folder: Path, run: dict[str, Any], results: Sequence[EpisodeResult]) -> None:
    """Episodes and run agree on where poses and instance masks came from."""
    try:
        pose, masks = sources_of(run)
    except InputError as error:
        raise InputError(f"{folder / RUN_FILE}: policy: {error}") from None
    for result in results:
        for name, found, expected in (
            ("pose_source", result.pose_source, pose),
            ("mask_source", result.mask_source, masks),
        ):
            if found not in (expected, None):
                raise InputError(
                    f"{folder / RESULTS_FILE}: episode {result.episode} of {result.task} has {name} "
                    f"{found!r}; {RUN_FILE} tells of {expected!r}: evaluate again"
                )


def _check_command(path: Path, run: dict[str, Any]) -> None:
    """The command that repeats the run asks for its episodes."""
    try:
        words = shlex.split(run["command"])
    except ValueError:
        words = []
    first = next((i for i, word in enumerate(words) if word.startswith("--")), len(words))
    options = dict(pairwise(words))
    resample = run.get("resample")
    for name, said, ran in (
        ("program", words[:2], ["manipose", "evaluate"]),
        ("tasks", sorted(words[2:first]), sorted(run["tasks"])),
        ("episodes", options.get("--episodes"), str(run["episodes"])),
        ("protocol", options.get("--protocol"), run["protocol"]),
        ("resample", options.get("--resample"), None if resample is None else str(resample)),
    ):
        if said != ran:
            raise InputError(
                f"{path}: command has {name} {said!r:.80}; the run has {ran!r:.80}: evaluate again"
            )


def _config(folder: Path, run: dict[str, Any]) -> EvaluationConfig:
    """What the run says it ran, as far as seeds depend on it."""
    resampled = {} if run.get("resample") is None else {"resample": run["resample"]}
    try:
        return EvaluationConfig(
            tasks=tuple(run["tasks"]),
            out=folder,
            episodes=run["episodes"],
            protocol=run["protocol"],
            **resampled,
        )
    except (KeyError, TypeError) as error:
        raise InputError(f"{folder / RUN_FILE}: cannot be read as a run ({error!r})") from None
    except InputError as error:
        raise InputError(f"{folder / RUN_FILE}: {error}") from None


def _check_episodes(path: Path, config: EvaluationConfig, results: Sequence[EpisodeResult]) -> None:
    """Every episode of the run is there, on its own seed and by the protocol's rules, and no other."""
    found = {result.key: result for result in results}
    assert config.protocol is not None
    frozen = protocol.load(config.protocol)
    for task in sorted(config.tasks):
        for episode in range(config.episodes):
            seed, result = config.episode_seed(task, episode), found.pop((task, episode), None)
            if result is None:
                raise InputError(f"{path}: episode {episode} of {task}, seed {seed}, is missing")
            if result.seed != seed:
                raise InputError(
                    f"{path}: episode {episode} of {task} has seed {result.seed}; "
                    f"protocol {config.protocol} has {seed}"
                )
            fixed = frozen.episode(task, episode)
            for broken in broken_rules(frozen.task(task), fixed, result):
                raise InputError(f"{path}: episode {episode} of {task}: {broken}")
    for task, episode in found:
        raise InputError(f"{path}: episode {episode} of {task} is not of this run")
