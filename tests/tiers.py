"""Two tiers of tests: the quick one runs in minutes and touches everything; `full` marks what it leaves out.

`@pytest.mark.full` leaves out a test, `@pytest.mark.sample(n)` all but n of its parametrisations. Which tests
those are follows from processor time, measured: `pytest --durations=0`.
"""

from __future__ import annotations

from collections import defaultdict

import pytest

MARKERS = (
    "full: too long for the quick tier",
    "sample(n): the quick tier runs n of the parametrisations, spread evenly over them",
)


def spread(n: int, count: int) -> set[int]:
    """n of `count` places, evenly spread, the first and the last among them; the first where n is 1."""
    if n >= count:
        return set(range(count))
    return {round(i * (count - 1) / max(n - 1, 1)) for i in range(n)}


def mark_left_out(items: list[pytest.Item]) -> None:
    """Mark as `full` what samples leave out."""
    sampled: dict[tuple[str, int], list[pytest.Item]] = defaultdict(list)
    for item in items:
        marker = item.get_closest_marker("sample")
        if marker is not None:
            sampled[item.nodeid.partition("[")[0], marker.args[0]].append(item)
    for (_, n), group in sampled.items():
        kept = spread(n, len(group))
        for i, item in enumerate(group):
            if i not in kept:
                item.add_marker(pytest.mark.full)


def order(items: list[pytest.Item]) -> None:
    """Files with long tests first, so that the workers end at about the same time."""
    long = {item.path for item in items if item.get_closest_marker("full")}
    items.sort(key=lambda item: (item.path not in long, item.path))
