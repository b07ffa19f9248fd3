"""Which estimator an evaluation asks, and what it may know."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from manipose_mj.errors import InputError
from manipose_mj.user_code import factory_arguments
from manipose_mj.wire.address import shown
from manipose_mj.wire.client import is_address


@dataclass(frozen=True)
class EstimatorSettings:
    """An estimator by name.

    Attributes:
      name: `package.module:factory` or `ws://host:port`.
      arguments: Keyword arguments of the factory, a JSON object; None: none.
      give_cad: Whether observations hold the mesh of the very object that is seen.

    Raises:
      InputError: The arguments are no JSON object, or are given to a server.
    """

    name: str
    arguments: str | None = None
    give_cad: bool = False

    def __post_init__(self) -> None:
        if self.arguments is None:
            return
        if is_address(self.name):
            raise InputError(
                f"--estimator {shown(self.name)}: a server takes no --estimator-args; give them to it"
            )
        _ = self.keywords  # if they are none

    @property
    def keywords(self) -> dict[str, Any]:
        """The factory's arguments."""
        return factory_arguments(self.arguments, "--estimator-args")

    @property
    def identity(self) -> dict[str, Any]:
        """What two runs must share for their results to belong together, without secrets; reports show it."""
        return {"name": shown(self.name), "arguments": self.keywords, "given CAD": self.give_cad}

    @property
    def source(self) -> str:
        """Where poses come from, for people."""
        return f"estimated by {shown(self.name)}" + (", given CAD" if self.give_cad else "")

    @property
    def words(self) -> list[str]:
        """Its options on the command line, but for a user, password or query in an address."""
        words = ["--estimator", shown(self.name)]
        if self.arguments is not None:
            words += ["--estimator-args", self.arguments]
        return [*words, "--give-cad"] if self.give_cad else words


def chosen_estimator(
    name: str | None, arguments: str | None, give_cad: bool
) -> EstimatorSettings | None:
    """The settings that options of the command line mean; None where no estimator is named.

    Raises:
      InputError: There are arguments without an estimator.
    """
    if name is not None:
        return EstimatorSettings(name, arguments, give_cad)
    if arguments is not None or give_cad:
        option = "--give-cad" if give_cad else "--estimator-args"
        raise InputError(f"{option} is for an estimator of yours; name it by --estimator")
    return None
