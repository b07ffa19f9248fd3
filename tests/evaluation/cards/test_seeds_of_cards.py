"""A card counts every episode once, and holds those of the frozen seeds."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from manipose_mj.errors import InputError
from manipose_mj.evaluation.cards.card import About, check_card, make_card
from tests.evaluation.cards.test_cards import TASK, evaluated

ABOUT = About("ours", "https://a.org", "none")


@pytest.fixture(scope="module")
def frozen(tmp_path_factory) -> Path:
    return evaluated(tmp_path_factory.mktemp("runs") / "frozen")


@pytest.fixture(scope="module")
def resampled(tmp_path_factory) -> Path:
    return evaluated(tmp_path_factory.mktemp("runs") / "resampled", resample=1)


def test_the_same_episodes_with_other_times_are_no_second_run(frozen, tmp_path):
    again = Path(shutil.copytree(frozen, tmp_path / "again"))
    path = again / "results.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    later = [json.dumps(line | {"wall_s": line["wall_s"] + 0.001}) + "\n" for line in lines]
    path.write_text("".join(later))
    with pytest.raises(InputError, match="two of the runs are the same: both play episode 0 of "):
        make_card([frozen, again], ABOUT, tmp_path / "out")


def test_some_of_a_runs_episodes_are_no_second_run(frozen, tmp_path):
    part = evaluated(tmp_path / "part", tasks=(TASK,), episodes=2)
    with pytest.raises(InputError, match=f"both play episode 0 of {TASK}"):
        make_card([frozen, part], ABOUT, tmp_path / "out")


def test_runs_of_different_tasks_or_seeds_are_several(frozen, resampled, tmp_path):
    out = make_card([frozen, resampled], ABOUT, tmp_path / "out")
    assert check_card(out) == 24
    tasks = (TASK,), ("articulated/open_oven",)
    parts = [evaluated(tmp_path / f"part{i}", tasks=names) for i, names in enumerate(tasks)]
    assert check_card(make_card(parts, ABOUT, tmp_path / "parts")) == 12


def test_a_card_without_the_frozen_seeds_is_refused(resampled, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(InputError, match="resampled from 1 only; a card needs one on the frozen"):
        make_card([resampled], ABOUT, out)
    assert not out.exists()
