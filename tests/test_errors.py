"""Messages about misspelt names are short, whatever is known."""

from __future__ import annotations

import pytest

from manipose_mj.assets import categories
from manipose_mj.errors import InputError, unknown_name


def test_a_near_name_is_offered():
    assert "did you mean bowl?" in str(unknown_name("category", "bowll", ["bowl", "mug"]))


def test_a_short_list_is_spelt_out():
    assert str(unknown_name("mode", "xyz", ["rgb", "depth"])).endswith("; known: depth, rgb")


def test_of_a_long_list_some_are_named_and_where_it_is():
    with pytest.raises(InputError, match=r"known are \d+, such as") as refusal:
        categories.find("qqqqqqqq")
    assert str(refusal.value).endswith("; `manipose list` lists them")
    assert len(str(refusal.value)) < 160
