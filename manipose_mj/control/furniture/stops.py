"""Whether a part that went no further in the hand is at its end, or the hand slipped off it."""

from __future__ import annotations

from typing import Literal

_END: dict[str, float] = {
    "slide": 0.5,
    "hinge": 0.8,
}  # of the usual range, from which on a stop may be its end
# A hand slips off drawers on their way too: short of this share of the usual range they stop twice within so much [m].
_SURE_END, _SAME_END = 0.85, 0.03


class Stops:
    """Remembers where drawers stopped."""

    def __init__(self) -> None:
        self._last: dict[str, float] = {}

    def is_end(
        self, name: str, kind: Literal["slide", "hinge"], opening: float, usual: float
    ) -> bool:
        """Whether a part that stopped is open as far as it goes.

        Args:
          name: Of the part.
          kind: Of its joint.
          opening: At which it stopped [m or rad].
          usual: How far such parts open [m or rad].
        """
        if opening <= _END[kind] * usual:
            return False
        if kind == "hinge" or opening >= _SURE_END * usual:
            return True
        last = self._last.get(name)
        self._last[name] = opening
        return last is not None and abs(opening - last) < _SAME_END
