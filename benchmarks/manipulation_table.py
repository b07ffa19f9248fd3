"""Print what evaluations of the baseline come to: by family, task, object type, source of grasps and planner.

    python benchmarks/manipulation_table.py RUN...                     # tables of evaluations with --protocol v1
    python benchmarks/manipulation_table.py --play 2 --out RUNS        # play two episodes of every task first
    python benchmarks/manipulation_table.py --strips docs/results/failures --page docs/results/protocol_v1.md \\
        --csv docs/plots/protocol_v1.csv                               # the page of the documentation

A RUN is a folder that `manipose evaluate --protocol v1` wrote; by default those of the baseline's cards in `leaderboard/`.
A column is a method: what it was told of objects, then what differs from the baseline's defaults, such as an estimator,
a language model, errors made on purpose or a policy. `--strips` draws each failure from its trajectory; where the run
left none, the episode is played once more.
"""

from __future__ import annotations

import csv
import io
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro
from pictures.failure_strips import Run, draw_strips, strip_name
from pictures.run_labels import check_labels, grasps_of, in_order, label_of, planner_of, poses_of
from tyro.conf import Positional

from manipose_mj.assets import categories
from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.cards.run_record import RunRecord, read_run
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.records import EpisodeResult, write_atomically
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.evaluation.statistics import wilson_interval
from manipose_mj.failures import STAGES

LEADERBOARD = Path(__file__).parents[1] / "leaderboard"
# The baseline's cards, and which of their runs.
RUNS = (("baseline_true_poses", 0), ("baseline_true_poses", 1), ("baseline_estimated_poses", 0))
# What tasks are alike in, by how their names begin.
FAMILIES = {
    "single object": ("single_object/",),
    "open": ("articulated/open_",),
    "close": ("articulated/close_",),
    "store": ("articulated/store_",),
    "take out": ("articulated/take_out_",),
    "clutter": ("clutter/",),
}
# What is always told; the others where they tell episodes apart.
ALWAYS = ("family", "task")
# Of these the columns differ in what was told of objects only.
OF_METHODS = ("source of grasps", "planner")
HEAD = Path(__file__).with_name("manipulation_page.md")


@dataclass(frozen=True)
class Arguments:
    """Attributes: runs: folders that `manipose evaluate --protocol v1` wrote; play: episodes of every task of protocol v1 to play first; out: where to; jobs; strips:
    folder for pictures of failures; page, csv: files to write."""

    runs: Positional[tuple[Path, ...]] = ()
    play: int = 0
    out: Path = Path("manipulation_runs")
    jobs: int = 1
    strips: Path | None = None
    page: Path | None = None
    csv: Path | None = None


@dataclass(frozen=True)
class Played:
    """An episode and what its run says of it: `label`, of its method; `poses`, told; `grasps`; `planner`."""

    result: EpisodeResult
    label: str
    poses: str
    grasps: str
    planner: str

    @property
    def family(self) -> str:
        """What the task is about; its domain, if that is none of `FAMILIES`."""
        task = self.result.task
        known = (name for name, starts in FAMILIES.items() if task.startswith(starts))
        return next(known, task.partition("/")[0])

    @property
    def object_type(self) -> str:
        """The labelling rule of the object in question; `scan` where it is none of ours."""
        try:
            category, _ = categories.find(self.result.object)
        except InputError:
            return "scan"
        return categories.CATALOGUE[category].object_type


GROUPS: dict[str, Callable[[Played], str]] = {
    "family": lambda played: played.family,
    "task": lambda played: f"`{played.result.task}`",
    "object type": lambda played: played.object_type,
    "source of grasps": lambda played: played.grasps,
    "planner": lambda played: played.planner,
}


def main(arguments: Arguments) -> None:
    """Play, read, draw, print, write: what was asked for."""
    folders = [*arguments.runs, *(_played(arguments) if arguments.play else ())]
    strips = arguments.strips
    if not folders:
        folders = baseline_folders()
        strips = strips or LEADERBOARD.parent / "docs" / "results" / "failures"
    runs: list[Run] = [(folder, read_run(folder)) for folder in folders]
    check_labels([record for _, record in runs])
    episodes = [each for _, record in runs for each in episodes_of(record)]
    if arguments.strips is not None:
        draw_strips(runs, arguments.strips)
    sys.stdout.write(tables(episodes))
    if arguments.page is not None:
        write_atomically(arguments.page, page(episodes, strips).encode("utf-8"))
    if arguments.csv is not None:
        write_atomically(arguments.csv, table_csv(episodes).encode("utf-8"))


def baseline_folders() -> list[Path]:
    """Folders of the runs that the page of the documentation is about."""
    return [LEADERBOARD / card / "runs" / str(number) for card, number in RUNS]


def baseline_records() -> list[RunRecord]:
    """Those runs."""
    return [read_run(folder) for folder in baseline_folders()]


def episodes_of(record: RunRecord) -> list[Played]:
    """The episodes of a run."""
    run = record.run
    grasps = "policy" if run.get("policy") else grasps_of(run)
    told = (label_of(run), poses_of(run), grasps, planner_of(run))
    return [Played(result, *told) for result in record.results]


def tables(episodes: Sequence[Played]) -> str:
    """A table for each way to group them that is of `ALWAYS` or tells any apart, Markdown."""
    telling = [
        name
        for name, group in GROUPS.items()
        if name in ALWAYS or len({group(e) for e in episodes}) > 1
    ]
    return "\n".join(f"## By {name}\n\n{table(episodes, name)}" for name in telling)


def table(episodes: Sequence[Played], by: str) -> str:
    """Success and failures by method, a row for each group; by what methods differ in, two columns for each source of poses."""
    groups: dict[str, list[Played]] = {}
    for each in episodes:
        groups.setdefault(GROUPS[by](each), []).append(each)
    order = [*(FAMILIES if by == "family" else ()), *sorted(groups)]

    def column(each: Played) -> str:
        return each.poses if by in OF_METHODS else each.label

    shown = in_order([column(each) for each in episodes])
    titles = [f"{name} | failures" for name in shown]
    lines = [f"| {by} | {' | '.join(titles)} |", "| --- |" + " --- |" * 2 * len(shown)]
    for name in dict.fromkeys(order):
        if name in groups:
            cells = [_cells([e for e in groups[name] if column(e) == title]) for title in shown]
            lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cells(episodes: Sequence[Played]) -> str:
    if not episodes:
        return "- | -"
    results = [each.result for each in episodes]
    won = sum(result.success_at_end for result in results)
    low, high = wilson_interval(won, len(results))
    return f"{won}/{len(results)} ({100 * low:.0f}-{100 * high:.0f}%) | {_stages(results)}"


def _stages(results: Iterable[EpisodeResult]) -> str:
    counts = Counter(result.failure for result in results if result.failure)
    return ", ".join(f"{counts[stage]} {stage}" for stage in STAGES if counts[stage]) or "-"


def page(episodes: Sequence[Played], strips: Path | None) -> str:
    """`docs/results/protocol_v1.md`: the tables, and every failure with its pictures if there are any."""
    lines = ["| task | start | object | poses | why |", "| --- | --- | --- | --- | --- |"]
    for each in episodes:
        result = each.result
        if result.failure is None:
            continue
        why = f"{result.failure}: {result.reason}"
        picture = strip_name(result, each.label)
        if strips is not None and (strips / picture).is_file():
            why = f"[{result.failure}]({strips.name}/{picture}): {result.reason}"
        lines.append(
            f"| `{result.task}` | {result.episode} | `{result.object}` | {each.label} | {why} |"
        )
    head = HEAD.read_text(encoding="utf-8")
    return head.replace("<!-- tables -->\n", tables(episodes)).replace(
        "<!-- failures -->", "\n".join(lines)
    )


def table_csv(episodes: Iterable[Played]) -> str:
    """What `docs/plots/draw.py` draws."""
    groups: dict[tuple[str, str], list[EpisodeResult]] = {}
    for each in episodes:
        groups.setdefault((each.label, each.result.task), []).append(each.result)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(("poses", "task", "successes", "episodes", "failures", "deepest_contact_mm"))
    for (poses, task), results in groups.items():
        won, failures = sum(r.success_at_end for r in results), _stages(results)
        # Batched worlds do not measure it.
        depths = [r.max_penetration for r in results if r.max_penetration is not None]
        deepest = f"{1000 * max(depths):.1f}" if depths else ""
        writer.writerow(
            (poses, task, won, len(results), "" if failures == "-" else failures, deepest)
        )
    return stream.getvalue()


def _played(arguments: Arguments) -> list[Path]:
    """Folders of runs of every task with true and with estimated poses; what is there already is not played again."""
    folders = []
    for pose in ("oracle", "estimated"):
        config = EvaluationConfig(
            tuple(protocol.load("v1").tasks),
            arguments.out / pose,
            episodes=arguments.play,
            pose=pose,
            jobs=arguments.jobs,
            protocol="v1",
        )
        evaluate(config, resume=True)
        folders.append(config.out)
    return folders


if __name__ == "__main__":
    try:
        main(tyro.cli(Arguments))
    except InputError as error:
        sys.exit(str(error))
