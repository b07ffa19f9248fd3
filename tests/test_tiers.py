"""Samples for the quick tier are spread over what they are taken from."""

from __future__ import annotations

import pytest

from tests.tiers import spread


@pytest.mark.parametrize(
    ("n", "count", "places"),
    [(1, 7, {0}), (2, 7, {0, 6}), (3, 7, {0, 3, 6}), (9, 4, {0, 1, 2, 3}), (4, 4, {0, 1, 2, 3})],
)
def test_a_sample_reaches_from_the_first_to_the_last(n, count, places):
    assert spread(n, count) == places


@pytest.mark.parametrize("count", [34, 102, 272])
def test_a_sample_is_as_large_as_asked_for(count):
    assert all(len(spread(n, count)) == n for n in range(1, count))
