"""Parses the command line before anything runs; a misspelt command or option is told in one line."""

from __future__ import annotations

import inspect
import io
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr
from dataclasses import is_dataclass
from functools import partial, wraps
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import tyro
from tyro.extras import SubcommandApp

from manipose_mj.errors import InputError, unknown_name

Command = Callable[..., Any]
_UNKNOWN = "Unrecognized options"  # tyro's words


class CommandApp(SubcommandApp):
    """Commands and groups of them, by name; parsing finds one and does not run it."""

    def __init__(self) -> None:
        """No command yet."""
        super().__init__()
        self.commands: dict[str, Command | CommandApp] = {}

    def add(self, name: str, command: Command | CommandApp, what: str | None = None) -> None:
        """Add a command or a group; `what` says what a group is for."""
        self.commands[name] = command
        if isinstance(command, CommandApp):
            self.command(command, name=name, help=what)
        else:
            self.command(name=name)(_deferred(command))


def _deferred(command: Command) -> Command:
    """The command as something that takes its arguments and does not run yet."""

    @wraps(command)
    def bound(*arguments: Any, **options: Any) -> Command:
        return partial(command, *arguments, **options)

    return bound


def parse(app: CommandApp, argv: Sequence[str] | None, *, prog: str, description: str) -> Command:
    """The command that a line asks for, with its arguments; takes none any more.

    Args:
      app: Every command.
      argv: The line's words after the program's name; None: this process's.
      prog: The program's name.
      description: What it is, for `--help`.

    Raises:
      InputError: A command or option is unknown.
      SystemExit: Help was asked for, or something else is wrong, which tyro has told.
    """
    words = sys.argv[1:] if argv is None else list(argv)
    told, config = io.StringIO(), (tyro.conf.FlagCreatePairsOff,)
    try:
        with redirect_stderr(told):
            return app.cli(prog=prog, description=description, args=words, config=config)
    except SystemExit:
        misspelt = _misspelt(app, words) if _UNKNOWN in told.getvalue() else None
        if misspelt is not None:
            told = io.StringIO()
            raise misspelt from None
        raise
    finally:
        sys.stderr.write(told.getvalue())


def _misspelt(app: CommandApp, words: Sequence[str]) -> InputError | None:
    """The first command or option that there is not, where that is what is wrong."""
    command: Command | CommandApp = app
    rest = list(words)
    path = []
    while isinstance(command, CommandApp):
        if not rest or rest[0].startswith("-"):
            return None
        name = rest.pop(0)
        if name not in command.commands:
            return unknown_name(" ".join([*path, "command"]), name, command.commands)
        path.append(name)
        command = command.commands[name]
    known = {"--help", *_options(_hints_of(command))}
    for word in rest:
        option = word.partition("=")[0].replace("_", "-")
        if option.startswith("--") and option not in known:
            return unknown_name(f"option of {' '.join(path)}", word.partition("=")[0], known)
    return None


def _hints_of(command: Command) -> dict[str, Any]:
    """The types of what is given by name."""
    hints = get_type_hints(command, include_extras=True)
    parameters = inspect.signature(command).parameters.values()
    return {p.name: hints[p.name] for p in parameters if p.kind is p.KEYWORD_ONLY}


def _options(hints: dict[str, Any]) -> Iterator[str]:
    """What they are called on the command line; a dataclass stands for its fields."""
    for name, hint in hints.items():
        settings: list[Any] = []
        if get_origin(hint) is Annotated:
            hint, *settings = get_args(hint)
        if is_dataclass(hint):
            yield from _options(get_type_hints(hint, include_extras=True))
            continue
        names = [getattr(setting, "name", None) for setting in settings]
        yield "--" + next(filter(None, names), name).replace("_", "-")
        for setting in settings:
            yield from getattr(setting, "aliases", None) or ()
