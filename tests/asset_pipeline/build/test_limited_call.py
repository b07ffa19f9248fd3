"""A call in a process of its own ends at its limit, whatever it does, and the next one works."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from asset_pipeline.build.workers.limited_call import LimitError, Limits, limited_call
from manipose_mj.errors import InputError, unknown_name
from tests.places import ROOT

SHORT = Limits(seconds=1.0)
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")


def test_value_error_and_warnings_come_back(tmp_path):
    assert limited_call(len, "abc", limits=SHORT, scratch=tmp_path).value == 3
    outcome = limited_call(os.listdir, "/nowhere", limits=SHORT, scratch=tmp_path)
    assert isinstance(outcome.error, FileNotFoundError)
    assert "Traceback" in outcome.error.__notes__[0]
    outcome = limited_call(unknown_name, "fruit", "aple", ["apple"], limits=SHORT, scratch=tmp_path)
    assert isinstance(outcome.value, InputError) and "apple" in str(outcome.value)
    outcome = limited_call(logging.warning, "holes %d", 3, limits=SHORT, scratch=tmp_path)
    assert outcome.warnings == ("holes 3",)


@pytest.mark.parametrize(
    ("function", "arguments", "message"),
    [
        (time.sleep, (60,), "time limit of 1 s"),
        (os.system, ("sleep 60 & sleep 60",), "time limit of 1 s"),
        (bytes, (100 * 2**30,), "4 GiB"),
        (os.abort, (), "SIGABRT"),
        (os._exit, (3,), "exit status 3"),
        (os.kill, (0, 9), "SIGKILL"),
    ],
)
def test_bad_call_ends_alone(tmp_path, function, arguments, message):
    start = time.monotonic()
    outcome = limited_call(function, *arguments, limits=SHORT, scratch=tmp_path)
    assert time.monotonic() - start < 10
    assert isinstance(outcome.error, LimitError) and message in str(outcome.error)
    assert limited_call(len, "ab", limits=SHORT, scratch=tmp_path).value == 2


def test_call_works_in_its_scratch_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SOME_VARIABLE", "seen")
    for function, arguments, expected in (
        (os.getcwd, (), str(tmp_path)),
        (tempfile.gettempdir, (), str(tmp_path)),
        (os.getenv, ("SOME_VARIABLE",), "seen"),
    ):
        assert limited_call(function, *arguments, limits=SHORT, scratch=tmp_path).value == expected
    assert os.getcwd() != str(tmp_path) and tempfile.gettempdir() != str(tmp_path)


def test_what_it_prints_is_no_answer(tmp_path):
    for _ in range(2):
        outcome = limited_call(os.write, 1, b"x" * 100, limits=SHORT, scratch=tmp_path)
        assert outcome.value == 100


def test_killed_server_is_replaced(tmp_path):
    server = limited_call(os.getppid, limits=SHORT, scratch=tmp_path).value
    outcome = limited_call(os.kill, server, 9, limits=SHORT, scratch=tmp_path)
    assert isinstance(outcome.error, LimitError)
    assert limited_call(os.getppid, limits=SHORT, scratch=tmp_path).value != server


def test_interpreter_leaves_no_process(tmp_path):
    code = (
        "import os, sys; from pathlib import Path; "
        "from asset_pipeline.build.workers.limited_call import Limits, limited_call; "
        "print(limited_call(os.getppid, limits=Limits(), scratch=Path(sys.argv[1])).value)"
    )
    out = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], cwd=ROOT, capture_output=True, check=True
    )
    deadline = time.monotonic() + 5
    while _runs(int(out.stdout)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not _runs(int(out.stdout))


def _runs(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().split()[2]
    except OSError:
        return False
