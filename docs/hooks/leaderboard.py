"""Fill the leaderboard's page from the cards in `leaderboard/` while the site is built."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
LEADERBOARD = ROOT / "leaderboard"
# Read, not imported: the site is built where the package is not installed.
PROTOCOLS = ROOT / "manipose_mj" / "evaluation" / "protocol"
PAGE, PLACE = "results/leaderboard.md", "<!-- cards -->"
METHOD = "- Method: "  # the line of `card.md` that tells it


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The page with its tables."""
    return markdown.replace(PLACE, tables()) if page.file.src_uri == PAGE else markdown


def tables(folder: Path = LEADERBOARD) -> str:
    """A table of all runs, and each card's text below it."""
    rows, texts = [], []
    for path in sorted(folder.glob("*/card.json")):
        card = json.loads(path.read_text(encoding="utf-8"))
        text = path.with_name("card.md").read_text(encoding="utf-8")
        rows += [_row(card, run, _method(text)) for run in card["runs"]]
        # One level lower: the page has a title of its own.
        texts.append(
            "\n".join(f"#{line}" if line.startswith("#") else line for line in text.splitlines())
        )
    head = "| method | seeds | tasks | episodes | at end | once | what it is and was told | training data |"
    rule = "| --- | --- | ---: | ---: | ---: | ---: | --- | --- |"
    return "\n".join([head, rule, *rows]) + "\n\n" + "\n\n".join(texts)


def _method(text: str) -> str:
    """What `card.md` says of the method, for a cell of a table."""
    (line,) = [each for each in text.splitlines() if each.startswith(METHOD)]
    return _cell(line.removeprefix(METHOD))


def _text(said: str) -> str:
    """What somebody said, as Markdown that is neither HTML nor a link, code or attributes; as cards have it."""
    return re.sub(r"[\\`\[\]<>{}]", lambda found: f"\\{found[0]}", said)


def _cell(text: str) -> str:
    """Text that ends no cell of a table."""
    return text.replace("|", "\\|")


def _row(card: dict[str, Any], run: dict[str, Any], method: str) -> str:
    seeds = "frozen" if run["resample"] is None else f"resampled from {run['resample']}"
    episodes = sum(task["n"] for task in run["tasks"].values())
    protocol = json.loads((PROTOCOLS / f"{run['protocol']}.json").read_text(encoding="utf-8"))
    covered = f"{len(run['tasks'])} of {len(protocol['tasks'])}"
    url = card["code_url"]
    name = _text(card["name"])
    name = f"[{name}]({url})" if url.startswith("https://") else name
    return (
        f"| {_cell(name)} | {run['protocol']}, {seeds} | {covered} | {episodes} | "
        f"{run['mean_success_at_end']:.1%} | {run['mean_success_once']:.1%} | {method} | "
        f"{_cell(_text(card['training_data']))} |"
    )
