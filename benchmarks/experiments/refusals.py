"""Count the objects that tasks refuse, and why.

    python benchmarks/experiments/refusals.py [--tasks "single_object/*" ...] [--each N] [--split test]

A task is asked for every object of the split (or `--each` so many of a category), once with every part of every piece of
furniture that it may be about; it refuses the object if it takes it with none. One line a task, then one a reason
with its categories. Objects are built at their first use.
"""

from __future__ import annotations

import argparse
import logging
import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from manipose_mj.assets.categories import Split
from manipose_mj.errors import InputError
from manipose_mj.evaluation.protocol.freeze import builtin_tasks
from manipose_mj.tasks.core.candidates import Candidate, builtin, rigid_rows
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.registry import TaskSpec, tasks_named
from manipose_mj.tasks.core.scene_source import SceneSource

_OPENS_ALONE = ("open", "close")  # tags of tasks that are about no rigid object


@dataclass(frozen=True)
class Refusal:
    """Attributes: name: of the object; category; reason: without names and figures."""

    name: str
    category: str
    reason: str


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--tasks", nargs="+", default=["*"], help="names or patterns; all by default"
    )
    parser.add_argument("--each", type=int, default=0, help="so many of a category; 0: all")
    parser.add_argument("--split", default="test", choices=("train", "test"))
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    for spec in counted_tasks(options.tasks):
        asked = objects_asked(spec, options.split, options.each)
        refusals = refused(spec, asked, options.split)
        print("\n".join(lines_of(spec.full_name, len(asked), refusals)), flush=True)


def counted_tasks(patterns: Sequence[str]) -> list[TaskSpec]:
    """The tasks of this package with these names or patterns that are about rigid objects.

    Raises:
      InputError: There is none of a name, or a pattern fits none.
    """
    about_objects = {
        spec.full_name: spec for spec in builtin_tasks() if not set(_OPENS_ALONE) & set(spec.tags)
    }
    return [about_objects[name] for name in tasks_named(patterns, about_objects)]


def objects_asked(spec: TaskSpec, split: Split, each: int) -> list[Candidate]:
    """The objects of the split of the categories that a task draws from."""
    rows = [row for row in rigid_rows() if "mug" not in spec.name or row.name == "mug"]
    if "chips_can" in spec.name:
        rows = [row for row in rows if row.name == "chips_can"]
    taken: Counter[str] = Counter()
    found = []
    for candidate in builtin(split, rows):
        taken[candidate.category] += 1
        if not each or taken[candidate.category] <= each:
            found.append(candidate)
    return found


def refused(spec: TaskSpec, asked: Sequence[Candidate], split: Split) -> list[Refusal]:
    """The objects that a task takes with none of its pieces of furniture."""
    scenes = SceneSource(spec, EnvConfig(spec.full_name, obs_mode="state", split=split))
    pieces = [EpisodeSpec()]
    if "articulated" in spec.tags:
        pieces = [spec for group in scenes.strata() for spec in group]
    found = []
    for candidate in asked:
        reasons: Counter[str] = Counter()
        for piece in pieces:
            try:
                scenes.draw(np.random.RandomState(0), replace(piece, object=candidate.name))
                break
            except InputError as error:
                reasons[cause_of(str(error), candidate.name)] += 1
        else:
            found.append(Refusal(candidate.name, candidate.category, reasons.most_common(1)[0][0]))
    return found


def cause_of(reason: str, name: str) -> str:
    """A reason without the object's name and figures."""
    if reason.startswith("unknown object"):
        return "its whole category is too long"
    words = re.sub(r"^\S+: ", "", reason).replace(name, "it").split(";")[0]
    words = re.sub(r"\d+(\.\d+)?( x \d+(\.\d+)?)*", "#", words)
    return re.sub(r"(part )?'\w+'", "the part", words)


def lines_of(task: str, asked: int, refusals: Sequence[Refusal]) -> list[str]:
    """A task's counts as people read them."""
    lines = [f"{task}: refuses {len(refusals)} of {asked}"]
    by_reason: defaultdict[str, list[Refusal]] = defaultdict(list)
    for refusal in refusals:
        by_reason[refusal.reason].append(refusal)
    for reason, those in sorted(by_reason.items(), key=lambda item: -len(item[1])):
        categories = Counter(each.category for each in those)
        which = ", ".join(f"{category} {count}" for category, count in categories.most_common())
        lines.append(f"  {len(those)}: {reason}: {which}")
    return lines


if __name__ == "__main__":
    main()
