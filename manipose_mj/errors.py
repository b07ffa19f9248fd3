"""The errors that the command line reports in one line, without a traceback."""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

_AT_MOST = 60  # names that an error spells out
_MOST = 60  # letters of a value that it shows
_REPLACED = "A worker stopped while some jobs were given to the executor"  # joblib's words


class InputError(ValueError):
    """Input that cannot be used; the message is one line: what, where, and what would be right.

    The command line prints it without a traceback and exits with code 2.
    """


class RecordError(InputError):
    """What shall be on record cannot be written: it ends the run, and is no episode's failure."""


class ServerAbsentError(InputError):
    """Nobody answers at the address of a method's server, or somebody else does."""


def brief(value: object) -> str:
    """What a value looks like, in one short line for messages."""
    text = " ".join(repr(value).split())
    return text if len(text) <= _MOST else f"{text[:_MOST]}..."


def check_count(what: str, value: object, *, least: int = 0) -> None:
    """Raises InputError for what is no whole number from `least` on; `what` names it in the message."""
    index = getattr(type(value), "__index__", None)
    if index is None or isinstance(value, bool) or index(value) < least:
        raise InputError(f"{what} is {value!r}; expected a whole number, at least {least}")


def unknown_name(kind: str, name: str, valid: Iterable[str], *, listed_by: str = "") -> InputError:
    """An `InputError` for a misspelt name, offering the nearest valid ones; where none is near, all, if they are few.

    Args:
      kind: What the name stands for, such as `"task"`.
      name: The name as it was given.
      valid: Every name that would have been right.
      listed_by: Command that lists them, where they are many.
    """
    names = sorted(valid)
    near = difflib.get_close_matches(str(name), names, n=3, cutoff=0.5)
    if near:
        return InputError(f"unknown {kind} {name!r}; did you mean {', '.join(near)}?")
    if len(names) <= _AT_MOST:
        return InputError(f"unknown {kind} {name!r}; known: {', '.join(names) or 'none'}")
    some = difflib.get_close_matches(name, names, n=3, cutoff=0.0)
    where = f"; `{listed_by}` lists them" if listed_by else ""
    return InputError(
        f"unknown {kind} {name!r}; known are {len(names)}, such as {', '.join(some)}{where}"
    )


def how_to_install(extra: str) -> str:
    """The command that installs an extra of this package, which is on no index, for errors."""
    return f'pip install -e ".[{extra}]" in the clone of manipose-mj'


class WorkerDiedError(RuntimeError):
    """A worker process ended without a result: killed for memory, or crashed in native code.

    Nobody's input is wrong: the command line prints the message and exits with code 1.
    """


class ServerLostError(WorkerDiedError):
    """The server of somebody's method went away, or failed, in the middle of work.

    Nothing that was asked of it counts as its failure: the command line prints the message and exits with code 1.
    """


@contextmanager
def worker_deaths(kept: str) -> Iterator[None]:
    """Inside, the death of one of joblib's worker processes is a `WorkerDiedError`; `kept`: what of the work is, where.

    Nothing is said of workers that joblib replaces because they have grown: their tasks are done.
    """
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", _REPLACED, UserWarning)
            yield
    except TerminatedWorkerError as error:
        raise WorkerDiedError(
            f"a worker process died ({' '.join(str(error).split())[:200]}); {kept}, and fewer --jobs if memory ran out"
        ) from None
