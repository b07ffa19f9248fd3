"""`manipose card`: results cards, made and checked."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from manipose_mj.errors import InputError


def card(
    folders: Annotated[Positional[tuple[Path, ...]], arg(metavar="DIR...", help_behavior_hint="")],
    /,
    *,
    check: Annotated[bool, arg(help_behavior_hint="")] = False,
    name: Annotated[str | None, arg(metavar="TEXT", help_behavior_hint="")] = None,
    code_url: Annotated[str | None, arg(metavar="URL", help_behavior_hint="")] = None,
    training_data: Annotated[str | None, arg(metavar="TEXT", help_behavior_hint="")] = None,
    out: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None,
) -> int:
    """Write card.json and card.md of evaluations on a protocol, or check cards against their results.

    Args:
      folders: Of evaluations by `manipose evaluate --protocol`; with --check, folders of cards.
      check: Recompute each card from its results and from the frozen protocol.
      name: Of the method.
      code_url: Where its code is: https://..., or 'this repository'.
      training_data: What it was trained on, or none.
      out: New folder for the card and copies of the results; by default the evaluation's own.
    """
    from manipose_mj.console import output
    from manipose_mj.evaluation.cards.card import About, check_card, make_card

    if not folders:
        raise InputError("no folder given")
    told = {"--name": name, "--code-url": code_url, "--training-data": training_data}
    if check:
        given = [option for option, value in {**told, "--out": out}.items() if value is not None]
        if given:
            raise InputError(f"--check takes folders of cards alone; leave out {', '.join(given)}")
        return _checked(folders)
    missing = [option for option, value in told.items() if value is None]
    if missing:
        raise InputError(f"a card needs {', '.join(missing)}")
    written = make_card(folders, About(str(name), str(code_url), str(training_data)), out)
    count = check_card(written)
    output.standard_output().print(f"card of {count} episodes: {written}", soft_wrap=True)
    return 0


def _checked(folders: tuple[Path, ...]) -> int:
    """Check every card; a line for each."""
    from manipose_mj.console import output
    from manipose_mj.evaluation.cards.card import check_card

    wrong = 0
    for folder in folders:
        try:
            count = check_card(folder)
        except InputError as error:
            output.fail_line(str(error))
            wrong += 1
        else:
            told = f"{folder}: agrees with its {count} episodes"
            output.standard_output().print(told, soft_wrap=True)
    return 2 if wrong else 0
