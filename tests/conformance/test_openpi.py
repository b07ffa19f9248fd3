"""openpi's unmodified server code plays an episode, where OPENPI_PYTHON and OPENPI_SERVER say where it is.

    python3 -m venv .venv-openpi && .venv-openpi/bin/pip install openpi-client
    OPENPI_PYTHON=.venv-openpi/bin/python OPENPI_SERVER=openpi/src/openpi/serving/websocket_policy_server.py \
        python -m pytest tests/conformance/test_openpi.py
"""

from __future__ import annotations

import os
import socket
import subprocess
import time
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import pytest

from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.runner import evaluate
from tests.few_objects import few

TASK = "single_object/target_pose"
SCRIPT = Path(__file__).with_name("openpi_server.py")


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """Of openpi's server, in its own environment and in a folder of its own."""
    python, server = os.environ.get("OPENPI_PYTHON"), os.environ.get("OPENPI_SERVER")
    if python is None or server is None:
        pytest.skip("OPENPI_PYTHON and OPENPI_SERVER name no openpi")
    with socket.socket() as free:
        free.bind(("localhost", 0))
        port = free.getsockname()[1]
    process = subprocess.Popen(
        [Path(python).absolute(), SCRIPT, Path(server).absolute(), str(port)],
        cwd=tmp_path_factory.mktemp("openpi"),
        env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"},
    )
    deadline = time.monotonic() + 60
    try:
        while True:
            assert process.poll() is None and time.monotonic() < deadline
            try:
                assert urlopen(f"http://localhost:{port}/healthz").read() == b"OK\n"
                break
            except URLError:
                time.sleep(0.1)
        yield f"ws://localhost:{port}"
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("jobs", [1, 2])
def test_openpis_server_plays_episodes_to_their_end(address, jobs, tmp_path):
    settings = PolicySettings(address, hz=10.0)
    config = EvaluationConfig(
        (TASK,), tmp_path, jobs, objects=few(TASK), jobs=jobs, policy=settings
    )
    for result in evaluate(config):
        assert result.failure == "timeout" and result.sim_time > 39
        assert result.decisions == 400 / 8 and result.clipped_actions == 0
