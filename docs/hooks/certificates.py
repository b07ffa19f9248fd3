"""Fill the page of protocol v1 with what is known of its starts while the site is built."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

# Read, not imported: the site is built where the package is not installed.
EVALUATION = Path(__file__).parents[2] / "manipose_mj" / "evaluation"
PAGE, PLACE = "results/protocol_v1.md", "<!-- certificates -->"


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The page with its table."""
    return markdown.replace(PLACE, table()) if page.file.src_uri == PAGE else markdown


def table(version: str = "v1") -> str:
    """By task, how many starts are certified, how many draws nobody solved and why, and how many are untried."""
    protocol = _read(EVALUATION / "protocol" / f"{version}.json")
    known = _read(EVALUATION / "certification" / f"{version}.json")
    rows = [
        "| task | certified | draws unsolved, by stage | untried |",
        "| --- | ---: | --- | ---: |",
    ]
    totals: dict[str, int] = defaultdict(int)
    for task in sorted(protocol["tasks"]):
        starts = len(protocol["tasks"][task]["episodes"])
        certified = len(known["solved"].get(task, {}))
        unsolved = [each["reason"] for each in known["unsolved"].get(task, {}).values()]
        refused = [r for reasons in known["refused"].get(task, {}).values() for r in reasons]
        stages = Counter(reason.partition(":")[0] for reason in (*unsolved, *refused))
        causes = ", ".join(f"{n} {stage}" for stage, n in stages.most_common()) or "-"
        untried = starts - certified - len(unsolved)
        rows.append(f"| `{task}` | {certified} of {starts} | {causes} | {untried} |")
        counts = {"starts": starts, "certified": certified, "untried": untried}
        for name, count in {**counts, "unsolved": sum(stages.values())}.items():
            totals[name] += count
    rows.append(
        f"| all | {totals['certified']} of {totals['starts']} | {totals['unsolved']} | {totals['untried']} |"
    )
    return "\n".join(rows)


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))
