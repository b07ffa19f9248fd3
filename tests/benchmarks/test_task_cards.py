"""The cards in docs/tasks say what the tasks say: `python benchmarks/pictures/task_cards.py` writes them."""

from __future__ import annotations

import importlib
import io

import numpy as np
import pytest
from PIL import Image

from manipose_mj.evaluation.protocol.freeze import builtin_tasks
from tests.places import ROOT

CARDS = ROOT / "docs" / "tasks"
WHOLE = ("single_object/target_pose", "articulated/store_chips_can_middle_drawer")
HINT = "cards are out of date: python benchmarks/pictures/task_cards.py"
SPECS = {spec.full_name: spec for spec in builtin_tasks()}


@pytest.fixture(scope="module")
def script():
    return importlib.import_module("task_cards")


@pytest.mark.parametrize("name", SPECS)
def test_every_task_has_a_current_card_with_a_small_picture(script, name):
    text = (CARDS / f"{name}.md").read_text(encoding="utf-8")
    assert text.startswith(script.head(SPECS[name])), HINT
    assert "## Goals" in text and "| `panda/tcp_pose` |" in text
    assert (CARDS / f"{name}.png").stat().st_size < 60_000
    with Image.open(CARDS / f"{name}.png") as picture:
        assert picture.size == (script.WIDTH, script.HEIGHT)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", WHOLE)
def test_goals_and_observations_are_those_of_the_task(script, name):
    environment = script.built(SPECS[name])
    text = (CARDS / f"{name}.md").read_text(encoding="utf-8")
    assert text == script.card(SPECS[name], environment), HINT
    with Image.open(io.BytesIO(script.picture(environment))) as fresh:
        assert np.asarray(fresh.convert("RGB")).std() > 20


def test_no_card_is_left_of_a_task_that_is_gone(script):
    assert (CARDS / "README.md").read_text(encoding="utf-8") == script.index(), HINT
    cards = {f"{path.parent.name}/{path.stem}" for path in CARDS.glob("*/*.md")}
    assert cards == set(SPECS)
