"""Workers end with their parents."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

WORKER = "from manipose_mj.console.process import end_with_parent; end_with_parent(); print(flush=True); input()"
PARENT = f"""
import subprocess, sys, time
worker = subprocess.Popen([sys.executable, "-c", {WORKER!r}], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
worker.stdout.readline()
print(worker.pid, flush=True)
time.sleep(60)
"""


@pytest.mark.skipif(not hasattr(os, "getppid"), reason="needs a parent's number")
def test_a_worker_ends_with_its_parent_though_that_is_killed():
    # The worker's input stays open, which would keep it.
    held, given = os.pipe()
    script = PARENT.replace("stdin=subprocess.PIPE", f"stdin={held}")
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, pass_fds=[held]
    ) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        os.kill(worker, 0)
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline and is_running(worker):
        time.sleep(0.1)
    assert not is_running(worker)
    os.close(held)
    os.close(given)


def is_running(process: int) -> bool:
    """Whether it is there; one that ended and that nobody waits for is not."""
    try:
        with open(f"/proc/{process}/stat", encoding="utf-8") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
