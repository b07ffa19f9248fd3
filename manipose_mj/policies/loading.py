"""Policies by name: `package.module:Factory`, `ws://host:port`, or `baseline`."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.policies.client import RemotePolicy
from manipose_mj.policies.protocol import Policy
from manipose_mj.user_code import factory_arguments, import_user_module, search_working_folder
from manipose_mj.wire.client import is_address


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
            raise InputError(f"--policy {name}: a server takes no --policy-args; give them to it")
        remote = RemotePolicy(name)
        remote.open()
        return remote
    factory = _factory(name)
    try:
        policy = factory(**keywords)
    except InputError:
        raise
    except Exception as error:  # whatever a stranger's code raises
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"--policy {name}: its factory failed ({reason[:300]})") from error
    for method in ("reset", "infer"):
        if not callable(getattr(policy, method, None)):
            kind = type(policy).__name__
            raise InputError(f"--policy {name}: the {kind} that it makes has no method {method}")
    return policy


def metadata_of(method: object) -> dict[str, Any]:
    """What a policy or estimator says of itself, as far as JSON can hold it; empty for those that say nothing."""
    said = getattr(method, "metadata", {})
    return plain(said) if isinstance(said, dict) else {}


def plain(value: Any) -> Any:
    """What a stranger says, as JSON can hold it: all else, and numbers that are not finite, as text."""
    if isinstance(value, dict):
        return {str(name): plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if value is None or isinstance(value, bool | int | str):
        return value
    return value if isinstance(value, float) and math.isfinite(value) else str(value)


def _factory(name: str) -> Any:
    module_name, colon, attribute = name.partition(":")
    if not (module_name and colon and attribute):
        raise InputError(f"--policy {name}: expected package.module:Factory or ws://host:port")
    search_working_folder()
    module = import_user_module(module_name, f"--policy {name}")
    factory: Any = module
    for part in attribute.split("."):
        if not hasattr(factory, part):
            public = [each for each in dir(factory) if not each.startswith("_")]
            raise unknown_name(f"attribute of {module_name}", part, public)
        factory = getattr(factory, part)
    if not callable(factory):
        raise InputError(
            f"--policy {name}: {attribute} cannot be called; expected a class or function"
        )
    return factory
