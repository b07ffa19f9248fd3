"""How far parts open: whether one that went no further is at its end, and whether one that goes on has one."""

from __future__ import annotations

from typing import Literal

import numpy as np

_END: dict[str, float] = {
    "slide": 0.5,
    "hinge": 0.8,
}  # of the usual range, from which on a stop may be its end
# A hand slips off drawers on their way too: short of this share of the usual range they stop twice within so much [m].
_SURE_END, _SAME_END = 0.85, 0.03
# A door that goes along with a push to within so much of its end, near the end of the usual range or beyond, is not at its
# own; one that stays behind by so much is [rad]. How much further it is taken to go meanwhile, and any door at most [rad].
_ALONG, _BEHIND, _NEAR_END = 0.08, 0.12, 0.9
_FURTHER, _WIDEST = 0.7, np.pi


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


class Swings:
    """Finds out how far doors open that go on beyond what is usual: they are pushed until they stop."""

    def __init__(self) -> None:
        self._aims: dict[str, float] = {}
        self._beyond: set[str] = set()
        self._reached: dict[str, float] = {}  # how far they have been open [rad]

    def pushed(self, name: str, aim: float) -> None:
        """A door was pushed, to where it should be open by `aim` [rad]."""
        self._aims[name] = aim

    def end(self, name: str, opening: float, known: float) -> float:
        """How far a door is taken to open now [rad].

        Args:
          name: Of the door.
          opening: Seen after a push.
          known: What it was taken for.
        """
        aim = self._aims.pop(name, None)
        if aim is None:
            return known
        if aim > _NEAR_END * known and opening > aim - _ALONG:
            return self.led(name, opening, known)
        swept_back = opening < self._reached.get(name, 0.0) - _BEHIND
        if not self.goes_on(name) or opening > aim - _BEHIND or swept_back:
            return known
        self._beyond.remove(name)
        return opening

    def ends(self, name: str) -> None:
        """Nothing leads a door any further."""
        self._beyond.discard(name)

    def goes_on(self, name: str) -> bool:
        """Whether a door was led as far as is usual, or further, and did not stop."""
        return name in self._beyond

    def led(self, name: str, opening: float, known: float) -> float:
        """The same, of a door that a hand or a push led there without a stop."""
        self._reached[name] = max(opening, self._reached.get(name, 0.0))
        if opening < _NEAR_END * _WIDEST:
            self._beyond.add(name)
        else:
            self._beyond.discard(name)
        return float(min(max(opening, known) + _FURTHER, _WIDEST))
