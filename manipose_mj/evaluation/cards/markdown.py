"""A card for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.cards.method import method_text
from manipose_mj.evaluation.cards.text import as_text

OWN_CODE = "this repository"


def card_markdown(card: Mapping[str, Any]) -> str:
    """The text of `card.md`."""
    code = card["code_url"]
    lines = [
        f"# {as_text(card['name'])}",
        "",
        f"- Code: {code if code == OWN_CODE else f'<{code}>'}",
        f"- Training data: {as_text(card['training_data'])}",
        f"- Method: {method_text(card['method'])}",
    ]
    for run in card["runs"]:
        lines += ["", *_run_lines(run)]
    return "\n".join(lines) + "\n"


def _coverage(run: Mapping[str, Any]) -> str:
    """How many of the protocol's tasks a run is of, such as `1 of 34`."""
    return f"{len(run['tasks'])} of {len(protocol.load(run['protocol']).tasks)}"


def _run_lines(run: Mapping[str, Any]) -> list[str]:
    seeds = "frozen seeds" if run["resample"] is None else f"seeds resampled from {run['resample']}"
    versions = ", ".join(as_text(f"{name} {value}") for name, value in run["versions"].items())
    rows = [
        f"| `{task}` | {row['n']} | {row['success_at_end']} | {_interval(row['wilson_95'])} | "
        f"{row['success_once']} | {_interval(row['wilson_95_once'])} | {_failures(row['failures'])} |"
        for task, row in run["tasks"].items()
    ]
    return [
        f"## Protocol {run['protocol']}, {seeds}",
        "",
        f"{_coverage(run)} tasks of the protocol. "
        f"Mean over tasks: {run['mean_success_at_end']:.1%} at end, {run['mean_success_once']:.1%} once.",
        "",
        "| task | n | at end | Wilson 95 % | once | Wilson 95 % | failures |",
        "| --- | ---: | ---: | --- | ---: | --- | --- |",
        *rows,
        "",
        f"Protocol sha256 `{run['protocol_sha256'][:16]}`, results sha256 `{run['results_sha256'][:16]}`. "
        f"{versions}; {as_text(run['machine'])}.",
        "",
        *(f"    {line}" for line in run["command"].split("\n")),
    ]


def _interval(bounds: list[float]) -> str:
    return f"{100 * bounds[0]:.0f} - {100 * bounds[1]:.0f} %"


def _failures(failures: Mapping[str, int]) -> str:
    return ", ".join(f"{stage} {count}" for stage, count in failures.items()) or "none"
