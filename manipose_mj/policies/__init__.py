"""Policies of anybody: what one is, loading it from a module or reaching it over a websocket, serving it.

    from manipose_mj.policies import ActionSpace, Policy, serve

| module | holds |
|---|---|
| `protocol.py` | what a policy is, and the check of its answers |
| `loading.py` | policies by name: `package.module:Factory`, `ws://host:port` |
| `client.py`, `server.py` | both ends of a websocket, in the framing of `manipose_mj.wire` |
| `baseline.py` | the baseline as a policy |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from manipose_mj.policies.baseline import BaselinePolicy
    from manipose_mj.policies.client import RemotePolicy
    from manipose_mj.policies.loading import load_policy
    from manipose_mj.policies.protocol import ActionSpace, Policy
    from manipose_mj.policies.server import PolicyServer, serve

__all__ = [
    "ActionSpace",
    "BaselinePolicy",
    "Policy",
    "PolicyServer",
    "RemotePolicy",
    "load_policy",
    "serve",
]

__getattr__ = lazy_exports(__name__, __file__)
