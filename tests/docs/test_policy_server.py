"""The server of the guide on policies, with NumPy in the place of PyTorch: it plays with the evaluator's client."""

from __future__ import annotations

import socket
import subprocess
import sys
import time

import numpy as np

from manipose_mj.errors import InputError
from manipose_mj.policies.client import RemotePolicy
from manipose_mj.policies.protocol import checked_answer
from tests.docs.pages import DOCS, blocks
from tests.policies.test_remote import EPISODE, OBSERVATION

PAGE = DOCS / "guides" / "own_policy.md"
TORCH = """
import contextlib
import types
import numpy as np
float32, float64, int32, uint8 = np.float32, np.float64, np.int32, np.uint8
frombuffer, manual_seed, no_grad = np.frombuffer, np.random.seed, contextlib.nullcontext
nn = types.SimpleNamespace(Linear=lambda n, m: lambda x: x @ np.ones((n, m), np.float32))
"""


def test_the_guides_server_plays_with_the_client(tmp_path):
    (block,) = blocks(PAGE, "py")
    assert len(block.code.splitlines()) <= 33 and "numpy" not in block.code
    with socket.socket() as free:
        free.bind(("localhost", 0))
        port = free.getsockname()[1]
    (tmp_path / "torch.py").write_text(TORCH, encoding="utf-8")
    script = tmp_path / "server.py"
    script.write_text(block.code.replace("8000", str(port)), encoding="utf-8")
    process = subprocess.Popen([sys.executable, str(script)], cwd=tmp_path)
    try:
        remote = RemotePolicy(f"ws://localhost:{port}")
        deadline = time.monotonic() + 30
        while remote.metadata.get("model") != "linear":
            assert time.monotonic() < deadline and process.poll() is None
            try:
                remote.open()
            except InputError:
                time.sleep(0.1)
        remote.reset(**EPISODE)
        actions = checked_answer(remote.infer(OBSERVATION), 8).actions
        np.testing.assert_allclose(actions, np.full((1, 8), OBSERVATION["agent_pos"].sum()))
        remote.close()
    finally:
        process.kill()
        process.wait()
