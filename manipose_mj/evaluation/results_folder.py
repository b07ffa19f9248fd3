"""The folder of an evaluation: one writer at a time, a line a result, and what was kept of a run that ended early."""

from __future__ import annotations

import errno
import json
import logging
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from manipose_mj.errors import InputError, WorkerDiedError
from manipose_mj.evaluation.records import EpisodeResult, read_results, to_line
from manipose_mj.policies.loading import telling

RESULTS_FILE = "results.jsonl"
SUMMARY_FILE = "summary.json"
RUN_FILE = "run.json"
METADATA = ("policy metadata", "estimator metadata")
_DISK_FAILURES = {errno.ENOSPC, errno.EIO, errno.EROFS, errno.EDQUOT, errno.EFBIG}

logger = logging.getLogger(__name__)


@contextmanager
def results_file(out: Path) -> Iterator[IO[bytes]]:
    """The open and locked results file; a disk that refuses becomes an `InputError`.

    What ends the evaluation before its first result leaves no file behind, nor the folder if it is new; but what can be
    resumed stays.
    """
    new = not out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
        file = (out / RESULTS_FILE).open("ab")
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{out}: cannot write there ({reason}); choose another --out") from None
    try:
        with file:
            lock(file, out, "evaluation")
            try:
                yield file
            except WorkerDiedError:  # its advice is to resume
                raise
            except BaseException:
                _remove_if_empty(file, out, new)
                raise
    except OSError as error:
        if not _is_of(error, out):
            raise
        raise InputError(
            f"{out}: cannot write results there ({error.strerror or error}); "
            "those of finished episodes are safe: make room, then --resume goes on"
        ) from None


def _is_of(error: OSError, out: Path) -> bool:
    """Whether it was the results that could not be written; a full disk is told without a name."""
    if error.filename is None:
        return error.errno in _DISK_FAILURES
    return Path(os.fsdecode(error.filename)).absolute().is_relative_to(out.absolute())


def _remove_if_empty(file: IO[bytes], out: Path, new: bool) -> None:
    """Undo an evaluation that has no result."""
    if os.fstat(file.fileno()).st_size:
        return
    for name in (RESULTS_FILE, RUN_FILE):
        (out / name).unlink(missing_ok=True)
    if new:
        with suppress(OSError):  # somebody else's file is there
            out.rmdir()


def lock(file: IO[bytes], out: Path, what: str) -> None:
    """Keep a second writer out of a folder; the lock goes with the process, however it ends.

    Args:
      file: In the folder, which every writer opens.
      out: The folder.
      what: Writes there.

    Raises:
      InputError: Another one is writing.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"{out}: another {what} is writing there; wait for it") from None


def check_folder(out: Path, *, resume: bool) -> None:
    """Find out early whether an evaluation can use a folder; nothing is left there.

    Args:
      out: The folder.
      resume: Whether results may be there.

    Raises:
      InputError: Nobody can write there, another evaluation is writing, the results are not an evaluation's, or there
        are some and `resume` is False.
    """
    new = not out.exists()
    with results_file(out) as file:
        _results_before(out, resume=resume)
        _remove_if_empty(file, out, new)


def _results_before(out: Path, *, resume: bool) -> tuple[list[EpisodeResult], int]:
    """As `read_results`; raises InputError where there are some and `resume` is False."""
    results, size = read_results(out / RESULTS_FILE)
    if results and not resume:
        raise InputError(
            f"{out}: holds {len(results)} results; add --resume or choose another --out"
        )
    return results, size


def kept_results(
    out: Path,
    identity: dict[str, Any],
    seeds: Mapping[tuple[str, int], int],
    file: IO[bytes],
    *,
    resume: bool,
) -> list[EpisodeResult]:
    """The results to keep, with an unfinished last line cut off the file.

    Args:
      out: The folder.
      identity: Of this run; it may have more tasks and more episodes a task than the results were asked for.
      seeds: Of every episode that this run asks for, by task and number.
      file: The open results file.
      resume: Whether results may be there.

    Raises:
      InputError: There are results and `resume` is False, or they belong to another configuration, or one is of an
        episode or a seed that this run does not ask for; the file stays as it is.
    """
    results, size = _results_before(out, resume=resume)
    if results:
        before = _run_before(out)
        for name, value in identity.items():
            old = before.get(name)
            if name in METADATA:
                _tell_changed(out, name, old, value)
                old, value = telling(old), telling(value)
            if not _goes_on(name, old, value):
                raise InputError(
                    f"{out}: its results have {name} {old!r}, this run has "
                    f"{value!r}; resume with the same configuration, of which tasks and episodes "
                    "may be more, or choose another --out"
                )
    for number, result in enumerate(results, start=1):
        if seeds.get(result.key) != result.seed:
            known = seeds.get(result.key)
            asked = "does not ask for it" if known is None else f"has seed {known} there"
            raise InputError(
                f"{out / RESULTS_FILE}: line {number} is episode {result.episode} of {result.task} with seed "
                f"{result.seed}; this run {asked}: restore the file or choose another --out"
            )
    file.truncate(size)
    return results


def _tell_changed(out: Path, name: str, before: Any, now: dict[str, Any]) -> None:
    """Say what of a method's metadata is another than before, which is no reason to stop."""
    before = before if isinstance(before, dict) else {}
    keys = sorted({*before, *now} - {*telling(before), *telling(now)})
    if changed := [key for key in keys if before.get(key) != now.get(key)]:
        logger.warning("%s: other %s than before: %s", out, name, ", ".join(changed))


def holds_results(out: Path) -> bool:
    """Whether the folder holds a result, of this run or one before."""
    path = out / RESULTS_FILE
    return path.exists() and path.stat().st_size > 0


def is_asked_for(out: Path, identity: dict[str, Any]) -> bool:
    """Whether what the folder's results were asked for is this, and no less."""
    before = _run_before(out)
    return all(before.get(name) == value for name, value in identity.items())


def _run_before(out: Path) -> dict[str, Any]:
    """What the folder's results were asked for."""
    try:
        before = json.loads((out / RUN_FILE).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        before = None
    if not isinstance(before, dict):
        raise InputError(
            f"{out / RUN_FILE}: missing or unreadable, so that its results cannot be "
            "continued; choose another --out"
        )
    return before


def _goes_on(name: str, before: Any, now: Any) -> bool:
    """Whether results of one configuration are also some of another, which asks for no less."""
    if name == "tasks" and isinstance(before, list):
        return all(task in now for task in before)
    if name == "episodes" and isinstance(before, int):
        return before <= now
    return before == now


def append_result(file: IO[bytes], result: EpisodeResult) -> None:
    """Add a line; it is on the disk when this returns."""
    file.write(to_line(result).encode("utf-8"))
    file.flush()
    os.fsync(file.fileno())
