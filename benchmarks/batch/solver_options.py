"""`--set NAME=NUMBER` of measurements: other options of MuJoCo's solver than a model's own."""

from __future__ import annotations

import argparse
from collections.abc import Iterable

import mujoco

Option = tuple[str, float]


def add_set(parser: argparse.ArgumentParser, whose: str) -> None:
    """The argument `--set`; `whose` options they are is said in its help."""
    parser.add_argument(
        "--set",
        nargs="+",
        default=[],
        type=_option,
        metavar="NAME=NUMBER",
        help=f"of `mujoco.MjOption`, {whose}: jacobian=1 is sparse, cone=0 pyramids",
    )


def set_options(model: mujoco.MjModel, options: Iterable[Option]) -> None:
    """Give a model these options, in place."""
    for name, number in options:
        setattr(model.opt, name, type(getattr(model.opt, name))(number))


def _option(text: str) -> Option:
    name, _, number = text.partition("=")
    known = isinstance(getattr(mujoco.MjOption(), name, None), int | float)
    try:
        value = float(number)
    except ValueError:
        known = False
    if not known:
        raise argparse.ArgumentTypeError(f"{text!r} is no NAME=NUMBER of mujoco.MjOption")
    return name, value
