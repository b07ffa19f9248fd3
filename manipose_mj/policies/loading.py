"""Policies by name: `package.module:Factory`, `ws://host:port`, or `baseline`."""

from __future__ import annotations

import json
from functools import lru_cache
from typing import Any

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.policies.client import RemotePolicy
from manipose_mj.policies.protocol import Policy
from manipose_mj.user_code import import_user_module, search_working_folder
from manipose_mj.wire.client import is_address


def policy_arguments(text: str | None) -> dict[str, Any]:
    """The keyword arguments of a factory.

    Args:
      text: A JSON object; None: no arguments.

    Raises:
      InputError: It is none.
    """
    if text is None:
        return {}
    try:
        arguments = json.loads(text)
    except ValueError as error:
        raise InputError(f"--policy-args {text}: no JSON ({error})") from None
    if not isinstance(arguments, dict):
        raise InputError(
            f'--policy-args {text}: expected a JSON object, such as {{"path": "a.pt"}}'
        )
    return arguments


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
    keywords = policy_arguments(arguments)
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


def metadata_of(policy: Policy) -> dict[str, Any]:
    """What a policy says of itself, as far as JSON can hold it; empty for those that say nothing."""
    said = getattr(policy, "metadata", {})
    if not isinstance(said, dict):
        return {}
    return json.loads(json.dumps(said, default=str))


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
