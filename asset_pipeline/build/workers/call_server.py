"""The process behind `limited_call`: forks for each call, and stops it at its limit."""

from __future__ import annotations

import contextlib
import ctypes
import logging
import os
import pickle
import resource
import select
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from typing import Any, NoReturn

from asset_pipeline.build.workers.call_messages import read_message, write_message
from asset_pipeline.build.workers.limited_call import LimitError, Limits, Outcome

_REQUESTS = 0
_PR_SET_PDEATHSIG = 1


def serve() -> None:
    """Answer the calls that come on standard input, one at a time, until it closes."""
    replies = os.dup(1)
    os.dup2(2, 1)  # what a library prints must not be taken for an answer
    while (request := read_message(_REQUESTS)) is not None:
        call, limits, scratch, environment = pickle.loads(request)
        os.environ.clear()
        os.environ.update(environment)
        try:
            # Loads the modules here, once, and not in every fork.
            function, arguments = pickle.loads(call)
        except Exception as error:
            outcome = pickle.dumps(Outcome(error=_portable(error)))
        else:
            outcome = _forked(function, arguments, limits, scratch)
        write_message(replies, outcome)


def _forked(
    function: Callable[..., Any], arguments: tuple[Any, ...], limits: Limits, scratch: str
) -> bytes:
    """Call in a fork; its pickled `Outcome`, or ours of its end."""
    result, writer = os.pipe()
    server = os.getpid()
    child = os.fork()
    if child == 0:
        os.close(result)
        _call(function, arguments, limits, scratch, writer, server)
    os.close(writer)
    with contextlib.suppress(OSError):
        os.setpgid(child, child)  # whoever comes first
    deadline = time.monotonic() + limits.seconds
    answer = bytearray()
    late = False
    while True:
        ready = select.select([result, _REQUESTS], [], [], max(deadline - time.monotonic(), 0))[0]
        if _REQUESTS in ready:  # nothing is sent during a call: whoever waits for it is gone
            os.killpg(child, signal.SIGKILL)
            sys.exit(1)
        if not ready:
            late = True
            break
        chunk = os.read(result, 1 << 20)
        if not chunk:
            break
        answer += chunk
    os.close(result)
    with contextlib.suppress(OSError):  # none is left to kill
        os.killpg(child, signal.SIGKILL)
    status = os.waitpid(child, 0)[1]
    if late:
        message = f"stopped: not done within its time limit of {limits.seconds:g} s"
    elif answer:
        return bytes(answer)
    elif os.WIFSIGNALED(status):
        message = (
            f"its process died ({signal.Signals(os.WTERMSIG(status)).name}): "
            f"a library crashed on it, or it needs more than {limits.memory / 2**30:g} GiB"
        )
    else:
        message = (
            f"its process ended without a result (exit status {os.waitstatus_to_exitcode(status)})"
        )
    return pickle.dumps(Outcome(error=LimitError(message)))


def _call(
    function: Callable[..., Any],
    arguments: tuple[Any, ...],
    limits: Limits,
    scratch: str,
    writer: int,
    server: int,
) -> NoReturn:
    """In the fork: set the limits, call, send the outcome, end."""
    status = 1
    try:
        with contextlib.suppress(OSError):
            os.setpgid(0, 0)
        _die_with(server)
        resource.setrlimit(resource.RLIMIT_AS, (limits.memory, limits.memory))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.dup2(os.open(os.devnull, os.O_RDONLY), _REQUESTS)
        # MuJoCo writes its log where it is; whatever a kill leaves behind is found and removed here.
        os.chdir(scratch)
        tempfile.tempdir = os.environ["TMPDIR"] = scratch
        kept = _Kept()
        logging.getLogger().addHandler(kept)
        try:
            outcome = Outcome(function(*arguments))
        except MemoryError:
            reason = f"needs more than {limits.memory / 2**30:g} GiB of memory"
            outcome = Outcome(error=LimitError(reason))
        except BaseException as error:
            outcome = Outcome(error=_portable(error))
        outcome = Outcome(outcome.value, outcome.error, tuple(kept.messages))
        data = memoryview(pickle.dumps(outcome))
        while data:
            data = data[os.write(writer, data) :]
        status = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(status)


class _Kept(logging.Handler):
    """Keeps warnings, so that the caller can say them with the rest."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())


def _portable(error: BaseException) -> BaseException:
    """The error with its traceback as a note, or one in its place that can be pickled."""
    text = "".join(traceback.format_exception(error))
    error.add_note(text)
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
        error.add_note(text)
    return error.with_traceback(None)


def _die_with(server: int) -> None:
    """Have the kernel kill this process when the server dies, even by `kill -9` (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != server:
        os._exit(1)
