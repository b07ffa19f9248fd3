"""A card's text holds what strangers say in its place: no HTML, no line of its own."""

from __future__ import annotations

import json
from html.parser import HTMLParser

import pytest

from manipose_mj.evaluation.cards.markdown import card_markdown
from manipose_mj.evaluation.cards.method import NEEDED, method_of
from tests.places import ROOT

markdown = pytest.importorskip("markdown", reason="needs the extra docs")

CARD = json.loads((ROOT / "leaderboard/ppo_open_middle_drawer/card.json").read_text("utf-8"))
EVIL = "a`b\n\n<script>c</script>\n# d {onclick=e} [f](https://g.org) \\<h i=j>"


def tags(card) -> list[str]:
    """The elements of the card's page, as the site makes it."""
    found = []

    class Elements(HTMLParser):
        def handle_starttag(self, tag, attrs):
            found.append(f"{tag} {attrs}")

    extensions = ["attr_list", "md_in_html", "tables"]
    Elements().feed(markdown.markdown(card_markdown(card), extensions=extensions))
    return found


@pytest.mark.parametrize(
    "change",
    [
        {"policy": {**CARD["method"]["policy"], "name": EVIL}},
        {"policy": {**CARD["method"]["policy"], "arguments": EVIL}},
        {"policy": {**CARD["method"]["policy"], "obs_mode": "state", "attachment": {}}},
        {"policy": None, "pose": "estimated", "estimator": {"name": EVIL, "arguments": EVIL}},
        {"policy": None, "planner": {"kind": "llm", "model": EVIL, "instruction": EVIL}},
    ],
    ids=["policy", "arguments", "attachment", "estimator", "planner"],
)
def test_a_method_is_in_one_line_and_is_no_html(change):
    if "attachment" in (change["policy"] or {}):
        attachment = {"pose_source": EVIL, "mask_source": "none"}
        change = {"policy": {**change["policy"], "attachment": attachment}}
    planner = {"kind": "rules"}
    method = method_of({**dict.fromkeys(NEEDED), "pose": "oracle", "planner": planner, **change})
    text = card_markdown({**CARD, "method": method})
    plain = card_markdown(CARD)
    assert text.count("\n") == plain.count("\n")
    made = [tag for tag in tags({**CARD, "method": method}) if tag != "code []"]
    assert made == [tag for tag in tags(CARD) if tag != "code []"]


def test_machine_versions_and_command_are_no_html():
    line = " ".join(EVIL.split())
    runs = [
        {**run, "machine": line, "versions": {line: line}, "command": EVIL} for run in CARD["runs"]
    ]
    assert tags({**CARD, "runs": runs, "name": line, "training_data": line}) == tags(CARD)
