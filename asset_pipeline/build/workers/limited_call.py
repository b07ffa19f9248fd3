"""Call a function in a process of its own that is stopped at a limit: for input nobody vouches for.

Native code (CoACD, mesh readers, MuJoCo) can neither be interrupted in a thread nor be kept from
crashing, and a worker of a pool must not die. So every thread that calls keeps one server process, which
has the libraries loaded and forks for each call (`call_server`): a call costs milliseconds more, not the
second of a new interpreter.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import select
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from asset_pipeline.build.workers.call_messages import read_message, write_message

# How often a waiting worker polls whether the process that it works for is still there [s].
POLL_EVERY = 0.5
# For a server to load the libraries, and to stop a call that has passed its limit [s].
GRACE = 120.0


@dataclass(frozen=True)
class Limits:
    """What one call may use up.

    Attributes:
      seconds: Wall time; the slowest published scan takes about 20 on an idle core.
      memory: Address space [bytes]; the largest published scans need less than 1 GiB.
    """

    seconds: float = 300.0
    memory: int = 4 * 2**30


class LimitError(RuntimeError):
    """A call passed a limit, or its process died."""


@dataclass(frozen=True)
class Outcome:
    """How a call ended.

    Attributes:
      value: What it returned.
      error: What it raised, or a `LimitError`; its notes hold the traceback.
      warnings: What it logged at level WARNING and above.
    """

    value: Any = None
    error: BaseException | None = None
    warnings: tuple[str, ...] = ()


def limited_call(
    function: Callable[..., Any], *arguments: Any, limits: Limits, scratch: Path
) -> Outcome:
    """Call `function(*arguments)` in another process and wait for it.

    The process has `scratch` as its working directory and its place for temporary files, and dies with
    this one; a worker of a process pool whose pool is gone ends itself. Where there is no `fork`
    (Windows) the call is made in this process, without limits.

    Args:
      function: Importable by name; what it returns and raises must be picklable, as the arguments.
      limits: Where to stop it.
      scratch: An existing folder, which the caller removes.
    """
    if not hasattr(os, "fork"):
        return _called_here(function, arguments)
    request = pickle.dumps(
        (pickle.dumps((function, arguments)), limits, str(scratch), dict(os.environ))
    )
    if _held.server is None or not _held.server.alive:
        _held.server = _Server()
    answer = _held.server.ask(request, limits.seconds + GRACE)
    if answer is None:
        return Outcome(error=LimitError("the process that it was built in was killed"))
    return pickle.loads(answer)


def end_if_orphaned() -> None:
    """End this process if it is a worker of a pool whose process is gone (killed, say).

    Nobody would have its results, and whoever runs the same again should not have to race with it.
    """
    first = _first_parent(os.getpid())
    if multiprocessing.parent_process() is not None and first != os.getppid():
        if _held.server is not None:
            _held.server.stop()
        os._exit(1)


@cache
def _first_parent(_process: int) -> int:
    """The parent of this process when it was first asked for."""
    return os.getppid()


def _called_here(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Outcome:
    try:
        return Outcome(value=function(*arguments))
    except Exception as error:
        return Outcome(error=error)


class _Server:
    """A process that answers one call at a time; it ends with this object or this process."""

    def __init__(self) -> None:
        one_thread = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
        # Modules as this process sees them: installed, in a checkout, or sent along by a cluster.
        code = f"import sys; sys.path[:] = {sys.path!r}; import asset_pipeline.build.workers.call_server as s; s.serve()"
        self._process = subprocess.Popen(
            [sys.executable, "-c", code],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for us; the server ends when its input does
            env={**one_thread, **os.environ},
        )
        self._owner = os.getpid()
        self.stop = weakref.finalize(self, _stop, self._process, self._owner)

    @property
    def alive(self) -> bool:
        """Whether it can be asked."""
        return self._owner == os.getpid() and self._process.poll() is None

    def ask(self, request: bytes, patience: float) -> bytes | None:
        """The answer; None if the server is gone, or as good as gone after `patience` seconds."""
        assert self._process.stdin is not None and self._process.stdout is not None
        answer = None
        try:
            write_message(self._process.stdin.fileno(), request)
            if self._await(self._process.stdout.fileno(), time.monotonic() + patience):
                answer = read_message(self._process.stdout.fileno())
        except BrokenPipeError:
            pass
        finally:
            if answer is None:  # also when interrupted: its answer must not be the next call's
                self.stop()
        return answer

    def _await(self, pipe: int, deadline: float) -> bool:
        while not select.select([pipe], [], [], POLL_EVERY)[0]:
            end_if_orphaned()
            if time.monotonic() > deadline:
                return False
        return True


def _stop(process: subprocess.Popen[bytes], owner: int) -> None:
    if owner != os.getpid():  # inherited in a fork
        return
    with contextlib.suppress(OSError):
        os.killpg(process.pid, signal.SIGKILL)  # what it forked dies with it
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
    process.wait()


class _Held(threading.local):
    """The server of this thread."""

    server: _Server | None = None


_held = _Held()
