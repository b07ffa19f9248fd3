"""Build many asset folders, in parallel, each whole or not at all; what fails does not stop the rest."""

from __future__ import annotations

import logging
import re
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from joblib import Parallel, delayed

from asset_pipeline.build.replaceable import check_replaceable
from asset_pipeline.build.workers.limited_call import (
    LimitError,
    Limits,
    Outcome,
    end_if_orphaned,
    limited_call,
)
from manipose_mj.errors import InputError
from manipose_mj.storage.staging import PREFIX, clear_staging, put_in_place, staging

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class BuildJob:
    """One object to build.

    Attributes:
      name: The object.
      folder: Its asset folder, absolute.
      where: What messages about it name: the folder or archive it comes from.
      build: `build(*arguments, folder, target)` writes the asset folder `target` and returns True, or
        False where `folder` is up to date. Importable by name; runs in another process.
      arguments: Of `build`.
      limits: Where to stop it; None for code of ours, which is called without.
      sources: Files that it is built from: `folder` must not hold them, for it is replaced whole.
    """

    name: str
    folder: Path
    where: str
    build: Callable[..., bool]
    arguments: tuple[Any, ...]
    limits: Limits | None
    sources: tuple[Path, ...] = ()


@dataclass(frozen=True)
class BuildResult:
    """What became of one object.

    Attributes:
      name: The object.
      status: `"built"`, `"skipped"` (up to date) or `"failed"`.
      folder: Its asset folder.
      seconds: Wall time.
      reason: One line, when it failed.
      warnings: What had to be repaired or left out.
    """

    name: str
    status: Literal["built", "skipped", "failed"]
    folder: Path
    seconds: float
    reason: str = ""
    warnings: tuple[str, ...] = ()


def run_jobs(
    builds: Sequence[BuildJob],
    *,
    jobs: int = 1,
    progress: Callable[[BuildResult, int], None] | None = None,
) -> list[BuildResult]:
    """Build all objects, through whatever backend joblib is configured for.

    That is `loky`, processes of this machine, or inside `joblib.parallel_config(backend="dask")` the
    workers of a `dask.distributed` cluster, which have to see the same files.

    Args:
      builds: The objects.
      jobs: Worker processes; a cluster uses all it has.
      progress: Called with each result as it comes, and the number of objects in all.

    Returns:
      One result an object, sorted by name.
    """
    parents = {job.folder.parent for job in builds}
    results = []
    calls = (delayed(_run)(job) for job in builds)
    try:
        _clear(parents)
        for result in Parallel(n_jobs=jobs, return_as="generator_unordered")(calls):
            results.append(result)
            for warning in result.warnings:
                log.warning("%s: %s", result.name, warning)
            if progress is not None:
                progress(result, len(builds))
    except BaseException:  # the workers are killed when we are interrupted
        _clear(parents)
        raise
    return sorted(results, key=lambda r: r.name)


def _clear(parents: set[Path]) -> None:
    for parent in parents:
        clear_staging(parent)


def _run(job: BuildJob) -> BuildResult:
    end_if_orphaned()
    start = time.perf_counter()
    outcome = _outcome(job)
    status, reason = "built" if outcome.value else "skipped", ""
    if outcome.error is not None:
        status, reason = "failed", _reason(job, outcome.error)
    seconds = time.perf_counter() - start
    warnings = tuple(_named(job, warning) for warning in outcome.warnings)
    return BuildResult(job.name, status, job.folder, seconds, reason, warnings)


def _outcome(job: BuildJob) -> Outcome:
    try:
        check_replaceable(job.folder, job.sources)
        with staging(job.folder) as scratch:
            target = scratch / job.folder.name
            arguments = (*job.arguments, job.folder, target)
            if job.limits is None:
                outcome = Outcome(job.build(*arguments))
            else:
                outcome = limited_call(job.build, *arguments, limits=job.limits, scratch=scratch)
            if outcome.value:
                put_in_place(target, job.folder)
            return outcome
    except Exception as error:  # whatever an object does to a library, the others go on
        return Outcome(error=error)


def _reason(job: BuildJob, error: BaseException) -> str:
    message = str(error)
    if not isinstance(error, InputError | LimitError):
        log.info("%s:\n%s", job.where, "".join(traceback.format_exception(error)))
        message = f"{type(error).__name__}: {message}"
    return _named(job, message)


def _named(job: BuildJob, message: str) -> str:
    """One line that names the folder or archive that the object comes from, and no passing folder."""
    passing = (
        re.escape(f"{job.folder.parent}/{PREFIX}{job.folder.name}-") + r"\w+(/[\w-]+/unpacked)?"
    )
    line = " ".join(re.sub(passing, lambda _: job.where, message).split())
    line = line.removeprefix(f"{job.name}: ")  # which stands before it anyway
    return line if job.where in line else f"{job.where}: {line}"
