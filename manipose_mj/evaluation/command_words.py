"""Values as words of a command line that repeats an evaluation."""

from __future__ import annotations


def number_word(value: float) -> str:
    """A number as it is read back exactly: short where that loses nothing."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)
