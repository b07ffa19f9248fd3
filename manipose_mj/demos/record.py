"""Records demonstrations of tasks: in parallel, resumable, the same for any number of jobs."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from manipose_mj.demos.layout import (
    RECORDED_MODE,
    DemoEpisode,
    DemoSet,
    current_protocol,
    current_versions,
    frozen_seeds,
    read_set,
    recorded_name,
    refuse_test_objects,
    task_folder,
    write_description,
    writing,
)
from manipose_mj.errors import InputError, brief, worker_deaths
from manipose_mj.evaluation.config import episode_seed
from manipose_mj.evaluation.protocol.own_assets import digest_of_objects
from manipose_mj.evaluation.records import write_atomically
from manipose_mj.evaluation.results_folder import lock

if TYPE_CHECKING:
    from manipose_mj.tasks.core.config import EnvConfig

PARTS = "attempts"
_IDENTITY = "run.json"
_LOCK = ".lock"  # there while a recording runs
# Attempts for one success, before a task counts as too hard.
_PATIENCE = 10


@dataclass(frozen=True)
class RecordConfig:
    """What to record.

    Attributes:
      task: `"domain/name"`.
      out: Folder of all tasks' demonstrations.
      episodes: Successes wanted.
      seed: Base seed, from which every attempt's own follows.
      failures: Keep the failed attempts before the last success too, with their stage.
      jobs: Attempts at the same time. What is recorded does not depend on it.
      objects: What to use instead of the built-in training objects: names, asset folders, or folders of them.
    """

    task: str
    out: Path
    episodes: int = 100
    seed: int = 1
    failures: bool = False
    jobs: int = 1
    objects: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        for name, least in (("episodes", 1), ("seed", 0), ("jobs", 1)):
            if getattr(self, name) < least:
                raise InputError(f"{name} is {getattr(self, name)}; expected at least {least}")

    @property
    def folder(self) -> Path:
        """Of this task."""
        return task_folder(self.out, self.task)

    @property
    def path(self) -> Path:
        """Of the HDF5 file."""
        return self.folder / recorded_name()

    @property
    def parts(self) -> Path:
        """Of what attempts leave until all have ended."""
        return self.folder / PARTS

    @property
    def stated_objects(self) -> list[str] | None:
        """As the files name them: folders by their whole path, so that a replay finds them from anywhere."""
        from manipose_mj.tasks.core.object_selection import is_folder

        if self.objects is None:
            return None
        return [str(Path(each).absolute()) if is_folder(each) else each for each in self.objects]

    @property
    def assets_digest(self) -> str | None:
        """Which builds of the user's assets episodes are of; None where all are built in."""
        return digest_of_objects(self.objects)

    @property
    def identity(self) -> dict[str, Any]:
        """What two runs must share for their attempts to belong together."""
        return {
            "task": self.task,
            "seed": self.seed,
            "failures": self.failures,
            "objects": self.stated_objects,
            "assets sha256": self.assets_digest,
            "versions": current_versions(),
            "protocol": current_protocol(),
        }

    def env_config(self) -> EnvConfig:
        """The environment of the episodes: training objects only."""
        from manipose_mj.tasks.core.config import EnvConfig  # loads the simulator: workers only

        return EnvConfig(self.task, obs_mode="state", objects=self.objects, split="train")

    def seeds(self) -> Iterator[tuple[int, int]]:
        """Number and seed of every attempt; never a protocol's."""
        frozen = frozen_seeds(self.task)
        number = 0
        while True:
            seed = episode_seed(self.seed, self.task, number)
            if seed not in frozen:
                yield number, seed
            number += 1


def _ignore(done: int, total: int) -> None: ...


def record(
    config: RecordConfig,
    *,
    resume: bool = False,
    for_training: bool = True,
    on_progress: Callable[[int, int], None] = _ignore,
) -> DemoSet:
    """Record until so many attempts have succeeded.

    Every attempt leaves its files as it ends; in the end they are made into one HDF5 file and its JSON.

    Args:
      config: What to record.
      resume: Go on with what the folder holds: attempts, or demonstrations, to which those that lack are added.
      for_training: Whether policies may learn from them: test objects are refused then.
      on_progress: Called with the number of successes so far and that wanted.

    Raises:
      InputError: The folder holds demonstrations and `resume` is False, or others; another recording is writing
        there; an object is for tests; or the baseline fails too often.
    """
    if for_training:
        refuse_test_objects(config.objects or ())
    new = [folder for folder in (config.parts, config.folder, config.out) if not folder.exists()]
    try:
        with _alone(config):
            try:
                return _record(config, resume, on_progress)
            except InputError:
                if config.parts in new and not any(config.parts.glob("[0-9]*")):
                    shutil.rmtree(config.parts, ignore_errors=True)
                raise
    except InputError:
        for folder in new:
            with suppress(OSError):  # it holds something, or is gone
                folder.rmdir()
        raise


@contextmanager
def _alone(config: RecordConfig) -> Iterator[None]:
    """Inside, no other recording writes into the task's folder.

    Raises:
      InputError: Another one does, or the folder cannot be written.
    """
    path = config.folder / _LOCK
    try:
        config.folder.mkdir(parents=True, exist_ok=True)
        file = path.open("ab")
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{config.folder}: cannot write there ({reason})") from None
    with file:
        lock(file, config.folder, "recording")
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def _record(config: RecordConfig, resume: bool, on_progress: Callable[[int, int], None]) -> DemoSet:
    seeds = config.seeds()
    planned: list[tuple[int, int]] = []
    if config.path.exists():
        demos = _recorded(config, resume)
        if sum(each.success for each in demos.episodes) >= config.episodes:
            if _holds_all(config, demos):
                shutil.rmtree(config.parts, ignore_errors=True)
            return demos
        _claim(config, resume)
        planned = _taken_apart(config, demos, seeds)
    else:
        _claim(config, resume)
    while True:
        ended = [_outcome(config, number) for number, _ in planned]
        wins = sum(each.success for each in ended)
        on_progress(min(wins, config.episodes), config.episodes)
        if wins >= config.episodes:
            break
        if len(ended) > _PATIENCE * (wins + 2):
            stage, count = Counter(each.failure for each in ended if each.failure).most_common(1)[0]
            raise InputError(
                f"{config.task}: the baseline succeeded in {wins} of {len(ended)} attempts, too few to record "
                f"demonstrations; {count} failed in {stage}: `manipose evaluate {config.task}` says why"
            )
        more = [next(seeds) for _ in range(config.episodes - wins)]
        planned += more
        for count in _attempted(config, more):
            on_progress(min(wins + count, config.episodes), config.episodes)
    return _assembled(config, ended)


def _recorded(config: RecordConfig, resume: bool) -> DemoSet:
    """The set that is there already, if it is the beginning of what is asked for."""
    demos = read_set(config.path)
    digest = config.assets_digest
    wins = sum(each.success for each in demos.episodes)
    if not resume:
        raise InputError(
            f"{config.path}: holds {wins} successes; add --resume for more, or choose another --out"
        )
    if demos.env_kwargs["objects"] != config.stated_objects:
        before, now = (brief(each) for each in (demos.env_kwargs["objects"], config.stated_objects))
        raise InputError(
            f"{config.path}: its objects are {before}, this run has {now}; resume with the same, in their order, or "
            "choose another --out"
        )
    if demos.assets_sha256 != digest:
        raise InputError(f"{config.path}: its objects were built otherwise; choose another --out")
    attempts = islice(config.seeds(), (_PATIENCE + 1) * (wins + 2))
    planned = {seed: number for number, seed in attempts}
    if not all(each.episode_seed in planned for each in demos.episodes):
        raise InputError(f"{config.path}: was recorded with another --seed; choose another --out")
    if wins >= config.episodes:
        return demos
    for name, value in (("versions", demos.versions), ("protocol", demos.protocol)):
        if value != config.identity[name]:
            raise InputError(
                f"{config.path}: was recorded with {name} {value}, this run has "
                f"{config.identity[name]}; choose another --out for more"
            )
    if not config.failures and wins < len(demos.episodes):
        raise InputError(f"{config.path}: holds failures too; add --failures for more of both")
    last = max((planned[each.episode_seed] for each in demos.episodes), default=-1)
    if config.failures and len(demos.episodes) < sum(n <= last for n in planned.values()):
        raise InputError(f"{config.path}: lacks its failures; leave out --failures for more")
    return demos


def _holds_all(config: RecordConfig, demos: DemoSet) -> bool:
    """Whether the set has all successes that attempts have left; a longer recording may have been cut short."""
    kept = {each.episode_seed for each in demos.episodes}
    left = [_outcome(config, int(file.stem)) for file in config.parts.glob("[0-9]*.json")]
    return all(each.episode_seed in kept for each in left if each.success)


def _taken_apart(
    config: RecordConfig, demos: DemoSet, seeds: Iterator[tuple[int, int]]
) -> list[tuple[int, int]]:
    """The attempts whose demonstrations are there, made into their files again; `seeds` goes on after the last."""
    from manipose_mj.demos.attempts import split_off

    by_seed = {each.episode_seed: each for each in demos.episodes}
    taken: list[tuple[int, int]] = []
    while len(taken) < len(by_seed):
        number, seed = next(seeds)
        if seed in by_seed:
            split_off(demos, by_seed[seed], config.parts, number)
            taken.append((number, seed))
    return taken


def _claim(config: RecordConfig, resume: bool) -> None:
    """Make the folder of the attempts, or see that those in it belong to this run."""
    mark = config.parts / _IDENTITY
    try:
        config.parts.mkdir(parents=True, exist_ok=True)
        if not mark.exists():
            write_atomically(mark, f"{json.dumps(config.identity, indent=1)}\n".encode())
            return
        before = json.loads(mark.read_text(encoding="utf-8"))
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{config.parts}: cannot write there ({reason})") from None
    except ValueError:
        raise InputError(f"{mark}: unreadable; choose another --out") from None
    if not resume:
        raise InputError(f"{config.parts}: holds attempts; add --resume or choose another --out")
    for name, value in config.identity.items():
        if before.get(name) != value:
            raise InputError(
                f"{config.parts}: its attempts have {name} {before.get(name)!r}, this run has "
                f"{value!r}; resume with the same or choose another --out"
            )


def _outcome(config: RecordConfig, number: int) -> DemoEpisode:
    from manipose_mj.demos.attempts import attempt_file

    text = attempt_file(config.parts, number).read_text(encoding="utf-8")
    return DemoEpisode(**json.loads(text))


def _attempted(config: RecordConfig, planned: Sequence[tuple[int, int]]) -> Iterator[int]:
    """Run the attempts that have not ended before; gives the number of successes as they end."""
    from manipose_mj.demos.attempts import attempt_file

    missing = [each for each in planned if not attempt_file(config.parts, each[0]).exists()]
    wins = sum(_outcome(config, n).success for n, _ in planned if (n, _) not in missing)
    yield wins
    for succeeded in _run(config, missing):
        wins += succeeded
        yield wins


def _run(config: RecordConfig, missing: Sequence[tuple[int, int]]) -> Iterator[bool]:
    if config.jobs == 1 or len(missing) < 2:
        for number, seed in missing:
            yield _attempt(config, number, seed)
        return
    import joblib

    with joblib.parallel_config(backend="loky", inner_max_num_threads=1):
        options: Any = {"return_as": "generator_unordered", "batch_size": 1}
        pool: Any = joblib.Parallel(n_jobs=min(config.jobs, len(missing)), **options)
        outcomes = pool(joblib.delayed(_attempt)(config, *each) for each in missing)
    with worker_deaths(f"finished attempts are kept in {config.parts}: repeat with --resume"):
        yield from outcomes


def _attempt(config: RecordConfig, number: int, seed: int) -> bool:
    from manipose_mj.demos.attempts import attempt

    attempt(config.env_config(), seed, number, config.parts, failures=config.failures)
    return _outcome(config, number).success


def _assembled(config: RecordConfig, ended: list[DemoEpisode]) -> DemoSet:
    """One HDF5 file of the attempts up to the last success that is wanted."""
    from manipose_mj.demos.attempts import copy_arrays

    wanted: list[DemoEpisode] = []
    for each in ended:
        if each.success or config.failures:
            wanted.append(each)
        if sum(e.success for e in wanted) == config.episodes:
            break
    env_kwargs = {
        "obs_mode": "state",
        "control_mode": RECORDED_MODE,
        "objects": config.stated_objects,
        "split": "train",
    }
    episodes = tuple(replace(each, episode_id=i) for i, each in enumerate(wanted))
    identity = config.identity
    demos = DemoSet(
        config.path,
        config.task,
        env_kwargs,
        identity["versions"],
        identity["protocol"],
        episodes,
        assets_sha256=identity["assets sha256"],
    )
    # What a set held that was there before is among the attempts.
    config.path.unlink(missing_ok=True)
    # The description first: without arrays it is none, and the next run writes both again.
    write_description(demos)
    with writing(config.path) as file:
        for episode, each in zip(episodes, wanted, strict=True):
            copy_arrays(config.parts, each.episode_id, file, episode.episode_id)
    shutil.rmtree(config.parts, ignore_errors=True)
    return demos
