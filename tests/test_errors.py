"""Messages about misspelt names are short, whatever is known."""

from __future__ import annotations

import inspect
import threading
import warnings

import pytest
from joblib.externals.loky import process_executor

from manipose_mj.assets import categories
from manipose_mj.errors import InputError, unknown_name, worker_deaths


def test_a_near_name_is_offered():
    assert "did you mean bowl?" in str(unknown_name("category", "bowll", ["bowl", "mug"]))


def test_a_short_list_is_spelt_out():
    assert str(unknown_name("mode", "xyz", ["rgb", "depth"])).endswith("; known: depth, rgb")


def test_of_a_long_list_some_are_named_and_where_it_is():
    with pytest.raises(InputError, match=r"known are \d+, such as") as refusal:
        categories.find("qqqqqqqq")
    assert str(refusal.value).endswith("; `manipose list` lists them")
    assert len(str(refusal.value)) < 160


def test_workers_that_joblib_replaces_are_not_warned_of():
    message = "A worker stopped while some jobs were given to the executor"
    assert f'"{message[:50]}' in inspect.getsource(process_executor)  # of this joblib, too

    def told() -> None:
        for text in (f"{message}. By a memory leak.", "a worker is slow"):
            warnings.warn(text, UserWarning, stacklevel=1)

    with pytest.warns(UserWarning) as heard, worker_deaths("nothing is kept"):
        thread = threading.Thread(target=told)  # as joblib's is
        thread.start()
        thread.join()
    assert [str(each.message) for each in heard] == ["a worker is slow"]
