"""Run by a Python with openpi-client and without this package: serves a policy by openpi's own server code.

Usage: openpi_server.py SERVER.py PORT, where SERVER.py is openpi's src/openpi/serving/websocket_policy_server.py
"""

import importlib.util
import sys

import numpy as np
from openpi_client import base_policy


class Nodding(base_policy.BasePolicy):
    """Turns the first joint to and fro around where it is."""

    def __init__(self):
        self.asked = 0

    def infer(self, obs):
        self.asked += 1
        target = np.append(obs["agent_pos"][:7], 0.08)
        chunk = np.tile(target.astype(np.float32), (8, 1))
        chunk[:, 0] += 0.1 * np.sin(np.arange(8) + self.asked)
        return {"actions": chunk}


if importlib.util.find_spec("manipose_mj") is not None:
    raise SystemExit("manipose_mj is installed here; openpi's server shall do without")
spec = importlib.util.spec_from_file_location("websocket_policy_server", sys.argv[1])
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
server = module.WebsocketPolicyServer(
    Nodding(), host="localhost", port=int(sys.argv[2]), metadata={"model": "nodding"}
)
server.serve_forever()
