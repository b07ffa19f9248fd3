"""Policies by name: `package.module:Factory`, `ws://host:port`, or `baseline`."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from manipose_mj.errors import InputError
from manipose_mj.policies.client import RemotePolicy
from manipose_mj.policies.protocol import Policy
from manipose_mj.user_code import factory_arguments, made_by_user
from manipose_mj.wire.address import shown
from manipose_mj.wire.client import is_address

# What of a method's metadata tells it from others; all else, such as when its server started, may change.
TELLING = ("name", "model", "version", "checkpoint", "commit")


@lru_cache(maxsize=1)
def load_policy(name: str, arguments: str | None = None) -> Policy:
    """The policy of a name, made once a process.

    Args:
      name: `package.module:Factory`, looked for in the present folder too, or `ws://host:port`.
      arguments: Of the factory, as JSON.

    Raises:
      InputError: There is no such module or factory, it fails, or what it makes is no policy; nobody serves
        one at the address, or there are arguments for it.
    """
    keywords = factory_arguments(arguments, "--policy-args")
    if is_address(name):
        if keywords:
            raise InputError(
                f"--policy {shown(name)}: a server takes no --policy-args; give them to it"
            )
        remote = RemotePolicy(name)
        remote.open()
        return remote
    return made_by_user(name, "--policy", keywords, ("reset", "infer"))


def metadata_of(method: object) -> dict[str, Any]:
    """What a policy or estimator says of itself, as far as JSON can hold it; empty for those that say nothing."""
    said = getattr(method, "metadata", {})
    return plain(said) if isinstance(said, dict) else {}


def telling(metadata: Any) -> dict[str, Any]:
    """What of a method's metadata results belong to."""
    said = metadata if isinstance(metadata, dict) else {}
    return {name: said[name] for name in TELLING if name in said}


def plain(value: Any) -> Any:
    """What a stranger says, as JSON can hold it: all else, and numbers that are not finite, as text."""
    if isinstance(value, dict):
        return {str(name): plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if value is None or isinstance(value, bool | int | str):
        return value
    return value if isinstance(value, float) and math.isfinite(value) else str(value)
