"""What says which planner makes plans: mistakes in it are told before anything runs."""

from __future__ import annotations

import pytest

from manipose_mj.errors import InputError
from manipose_mj.evaluation.planner_settings import PlannerSettings


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"kind": "llm", "model": " "}, "model: ' '; expected words"),
        ({"kind": "llm", "model": "m", "instruction": ""}, "instruction: ''; expected words"),
        ({"kind": "llm", "model": "m", "instruction": "open \udcff"}, "instruction: .* expected words"),
        ({"kind": "llm", "model": "m", "base_url": ""}, "--base-url '': expected an address such as"),
        ({"kind": "llm", "model": "m", "base_url": "http://me:pw@h:x/v1"}, "--base-url 'http://h:x/v1': expected"),
        ({"kind": "llm"}, "--planner llm needs one"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line(given, words):
    with pytest.raises(InputError, match=words) as caught:
        PlannerSettings(**given)
    assert "\n" not in str(caught.value)


def test_an_address_that_is_none_is_told_before_a_planner_is_made():
    with pytest.raises(InputError, match="expected an address"):
        PlannerSettings("llm", "m", "localhost:8000")


def test_an_empty_file_of_records_is_told_before_a_planner_is_made(tmp_path):
    (tmp_path / "none.jsonl").touch()
    with pytest.raises(InputError, match="holds no recorded exchange"):
        PlannerSettings("replay", replay=tmp_path / "none.jsonl").language_model()


def test_results_of_two_endpoints_do_not_belong_together():
    one, other = (
        PlannerSettings("llm", model="m", base_url=f"http://me:key@localhost:{port}/v1")
        for port in (1, 2)
    )
    assert one.identity != other.identity and "key" not in str(one.identity)


def test_an_address_from_the_variable_counts_as_one_that_was_given(monkeypatch):
    monkeypatch.setenv("OPENAI_BASE_URL", "http://localhost:1/v1")
    assert PlannerSettings("llm", "m") == PlannerSettings("llm", "m", "http://localhost:1/v1")
    assert PlannerSettings("llm", "m", "http://localhost:2/v1").base_url == "http://localhost:2/v1"
    assert PlannerSettings().base_url is None
    monkeypatch.setenv("OPENAI_BASE_URL", "localhost:1")
    with pytest.raises(InputError, match="OPENAI_BASE_URL 'localhost:1': expected an address"):
        PlannerSettings("llm", "m")


def test_the_folder_of_an_evaluation_holds_its_exchanges(tmp_path):
    (tmp_path / "exchanges").mkdir()
    assert PlannerSettings("replay", replay=tmp_path).replay == tmp_path / "exchanges"


def test_words_hold_no_secrets():
    words = PlannerSettings("llm", "m", "http://me:pw@host:1/v1?api-key=s").words
    assert words[words.index("--base-url") + 1] == "http://host:1/v1"
