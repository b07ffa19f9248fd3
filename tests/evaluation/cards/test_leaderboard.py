"""Every card of the leaderboard agrees with the results beside it, and the site shows all of them."""

from __future__ import annotations

import importlib.util
import json
from types import SimpleNamespace

import pytest

from manipose_mj.evaluation.cards.card import check_card
from manipose_mj.evaluation.cards.method import method_text
from manipose_mj.evaluation.cards.text import as_text
from tests.places import ROOT

CARDS = sorted(path.parent for path in (ROOT / "leaderboard").glob("*/card.json"))


def test_every_folder_is_a_card():
    folders = [path for path in (ROOT / "leaderboard").iterdir() if path.is_dir()]
    assert sorted(folders) == CARDS and len(CARDS) >= 2


@pytest.mark.parametrize("card", CARDS, ids=lambda card: card.name)
def test_a_card_agrees_with_its_results(card):
    assert check_card(card) > 0


@pytest.fixture(scope="module")
def hook():
    file = ROOT / "docs" / "hooks" / "leaderboard.py"
    spec = importlib.util.spec_from_file_location("leaderboard_hook", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_shows_every_card(hook):
    page = SimpleNamespace(file=SimpleNamespace(src_uri=hook.PAGE))
    source = (ROOT / "docs" / hook.PAGE).read_text(encoding="utf-8")
    assert hook.PLACE in source
    shown = hook.on_page_markdown(source, page)
    assert hook.PLACE not in shown
    for card in CARDS:
        content = json.loads((card / "card.json").read_text(encoding="utf-8"))
        name, url = content["name"], content["code_url"]
        linked = f"[{name}]({url})" if url.startswith("https://") else name
        assert f"| {linked} |" in shown and f"\n## {content['name']}\n" in shown
        assert f" | {method_text(content['method'])} | " in shown
        for run in content["runs"]:
            assert f" | {len(run['tasks'])} of 34 | " in shown
            assert f"results sha256 `{run['results_sha256'][:16]}`" in shown


def test_bars_in_what_makers_say_end_no_cell(hook):
    card = {"name": "a|b", "code_url": "https://a.org/", "training_data": "c | d"}
    run = json.loads((CARDS[0] / "card.json").read_text(encoding="utf-8"))["runs"][0]
    row = hook._row(card, run, "method")
    assert row.startswith("| [a\\|b](https://a.org/) | ") and row.endswith(" | c \\| d |")


def test_what_makers_say_is_neither_html_nor_a_link(hook):
    said = "<b>x</b> [here](https://b.org) `c` {onclick=d} \\<e>"
    card = {"name": said, "code_url": "https://a.org/", "training_data": said}
    run = json.loads((CARDS[0] / "card.json").read_text(encoding="utf-8"))["runs"][0]
    row = hook._row(card, run, "method")
    escaped = r"\<b\>x\</b\> \[here\](https://b.org) \`c\` \{onclick=d\} \\\<e\>"
    assert row.count(escaped) == 2 and row.count("<b>") == 0
    assert as_text(said) == escaped


def test_other_pages_stay_as_they_are(hook):
    page = SimpleNamespace(file=SimpleNamespace(src_uri="index.md"))
    assert hook.on_page_markdown(f"a {hook.PLACE}", page) == f"a {hook.PLACE}"
