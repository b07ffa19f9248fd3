"""The server of the guide on policies plays whole episodes with PyTorch, in the Python that TORCH_PYTHON names.

By default in this one, to which `make conformance` brings PyTorch. The server needs PyTorch, `websockets` and `msgpack`.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time

import pytest

from manipose_mj.errors import InputError
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.policies.client import RemotePolicy
from tests.docs.pages import DOCS, blocks
from tests.few_objects import few

TASK = "single_object/target_pose"
PYTHON = os.environ.get("TORCH_PYTHON", sys.executable)


@pytest.fixture
def address(tmp_path):
    """Of the guide's server in a process of its own, outside this repository."""
    needed = [PYTHON, "-c", "import torch, websockets, msgpack"]
    if subprocess.run(needed, capture_output=True, check=False).returncode:
        pytest.skip(f"{PYTHON} lacks torch, websockets or msgpack")
    (block,) = blocks(DOCS / "guides" / "own_policy.md", "py")
    with socket.socket() as free:
        free.bind(("localhost", 0))
        port = free.getsockname()[1]
    script = tmp_path / "server.py"
    script.write_text(block.code.replace("8000", str(port)), encoding="utf-8")
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    process = subprocess.Popen([PYTHON, str(script)], cwd=tmp_path, env=environment)
    deadline = time.monotonic() + 120
    remote = RemotePolicy(f"ws://localhost:{port}")
    try:
        while not remote.metadata:
            assert process.poll() is None and time.monotonic() < deadline
            try:
                remote.open()
            except InputError:
                time.sleep(0.2)
        remote.close()
        yield remote.address
    finally:
        process.kill()
        process.wait()


def test_a_network_in_pytorch_plays_episodes_to_their_end(address, tmp_path):
    settings = PolicySettings(address, hz=10.0)
    config = EvaluationConfig((TASK,), tmp_path, 2, objects=few(TASK), policy=settings)
    for result in evaluate(config):
        assert result.failure == "timeout" and result.decisions == 400
