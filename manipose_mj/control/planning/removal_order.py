"""Which object to move first, so that another one comes free in the fewest moves."""

from __future__ import annotations

from collections.abc import Callable

# Sets of objects; without those of any one of them a hand gets at an object. None at all: it never does.
Blockers = tuple[frozenset[str], ...]

_MAX_MOVES = 5
_MAX_STATES = 600  # sets of moved objects looked at


def first_removals(
    target: str,
    blockers: Callable[[str], Blockers],
    in_place: frozenset[str] = frozenset(),
) -> list[str]:
    """Objects that may be moved first, those of the shortest orders first; the target itself if it is free.

    A breadth-first search over the sets of objects that have been moved away. An object can be moved once all of
    one of its blockers have been.

    Args:
      target: What shall come free.
      blockers: Of an object; asked for only where the answer matters.
      in_place: Objects that have to go whatever else does, such as those where the target shall be put.

    Returns:
      Names; none if no order was found.
    """
    if _is_free(target, frozenset(), blockers) and not in_place:
        return [target]
    shortest: dict[str, int] = {}
    layer: dict[frozenset[str], tuple[str, ...]] = {frozenset(): ()}
    seen = 1
    for moves in range(1, _MAX_MOVES + 1):
        following: dict[frozenset[str], tuple[str, ...]] = {}
        for moved, firsts in layer.items():
            for name in _worth_moving(target, moved, blockers, in_place):
                if not _is_free(name, moved, blockers):
                    continue
                after = moved | {name}
                started = firsts or (name,)
                if in_place <= after and _is_free(target, after, blockers):
                    for first in started:
                        shortest.setdefault(first, moves)
                elif seen < _MAX_STATES:
                    seen += after not in following
                    known = following.get(after, ())
                    following[after] = tuple(dict.fromkeys((*known, *started)))
        layer = following
    return sorted(shortest, key=lambda name: (shortest[name], name))


def smallest(sets: list[frozenset[str]], most: int) -> Blockers:
    """The sets that contain no other, the smallest first; at most so many."""
    kept: list[frozenset[str]] = []
    for each in sorted(set(sets), key=lambda s: (len(s), sorted(s))):
        if not any(other <= each for other in kept):
            kept.append(each)
    return tuple(kept[:most])


def _is_free(name: str, moved: frozenset[str], blockers: Callable[[str], Blockers]) -> bool:
    return any(each <= moved for each in blockers(name))


def _worth_moving(
    target: str,
    moved: frozenset[str],
    blockers: Callable[[str], Blockers],
    in_place: frozenset[str],
) -> list[str]:
    """What keeps the target from coming free, or keeps from moving what does, and is still there."""
    found = sorted(in_place - moved)
    waiting = [target, *found]
    for name in waiting:
        if name != target and _is_free(name, moved, blockers):
            continue
        for other in sorted(frozenset().union(*blockers(name)) - moved):
            if other not in found and other != target:
                found.append(other)
                waiting.append(other)
    return found
