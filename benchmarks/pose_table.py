"""Table I: category-level pose from one partial, noisy cloud, ours beside the paper's and the matchers'.

    python benchmarks/pose_table.py [--categories bowl mug] [--setting anywhere] [--views 8]
        [--weights pose] [--no-matchers] [--jobs 1] [--json FILE]

Every method sees the same clouds: views of the catalogue's test objects, which nothing was trained on.
With `--weights DIR`, ours is `DIR/CATEGORY/weights.npz`, as `manipose pose train` writes it, and on original
labels `DIR/CATEGORY-original/weights.npz`; without it, the package's own weights. What is not there is left
out with a line. Matchers see the category's typical object as their template, in the right size of its
kind, and need `pip install 'manipose-mj[pose-bench]'`. Errors are means, medians in brackets; for mugs also
as NOCS counts (free about the axis while the handle is hidden). Times: one object after another, for ours
from bare points, for the matchers with normals given.

`--json` writes one row per category, method and label set; figures that a source does not give are null.
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pose_matchers import MATCHERS, available, template
from rich.console import Console
from rich.table import Table

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.clouds import LabelledCloud
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.evaluation import Answers, answers, catalogue_hulls, categories_of
from manipose_mj.ppf_jax.metrics import pose_errors, summary
from manipose_mj.ppf_jax.source_frames import SourceLabel
from manipose_mj.ppf_jax.view_cache import catalogue_clouds, source_labels
from manipose_mj.ppf_jax.view_settings import view_setting

log = logging.getLogger("pose_table")

# The paper's Table I, column ManiPose: mean origin error [cm], mean orientation error [deg].
PAPER: dict[str, tuple[float, float]] = {
    "bowl": (1.23, 5.1),
    "cup": (0.57, 4.1),
    "mug": (0.80, 8.8),
    "box": (0.81, 8.2),
    "hammer": (1.68, 9.0),
    "razor": (1.20, 12.0),
}
OURS = "ours"
Row = dict[str, Any]


def rows_of(
    category: str, clouds: Sequence[LabelledCloud], weights: Path | None, matchers: bool, jobs: int
) -> Iterator[Row]:
    """The table's rows of one category."""
    if category in PAPER:
        origin, degrees = PAPER[category]
        yield _row(category, "paper", "unified", {"origin_cm_mean": origin, "deg_mean": degrees})
    for labels in ("unified", "original"):
        estimator = _estimator(category, weights, labels)
        if estimator is not None:
            sources = source_labels(clouds, jobs=jobs) if labels == "original" else None
            yield _measured(category, OURS, labels, clouds, answers(estimator, clouds), sources)
    if not matchers:
        return
    shape = template(category)
    for name, matcher in available().items():
        match, poses, spent = matcher(shape), [], []
        for cloud in clouds:
            begin = time.perf_counter()
            poses.append(match(cloud.points, cloud.normals))
            spent.append(time.perf_counter() - begin)
        none = np.full(len(clouds), np.nan)
        found = Answers(np.stack(poses), none, 1e3 * float(np.median(spent)))
        yield _measured(category, name, "unified", clouds, found, None)


def _estimator(category: str, weights: Path | None, labels: str) -> PoseEstimator | None:
    suffix = "" if labels == "unified" else "-original"
    try:
        if weights is not None:
            return PoseEstimator.from_file(weights / f"{category}{suffix}" / "weights.npz")
        return PoseEstimator.load(category) if labels == "unified" else None
    except InputError as error:
        log.warning("%s, %s labels: left out (%s)", category, labels, error)
        return None


def _measured(
    category: str,
    method: str,
    labels: str,
    clouds: Sequence[LabelledCloud],
    found: Answers,
    sources: dict[str, SourceLabel] | None,
) -> Row:
    hulls = catalogue_hulls(clouds) if sources is None else None
    figures = summary(pose_errors(found.poses, clouds, sources=sources, hulls=hulls))
    return _row(category, method, labels, {**figures, "ms_per_object": found.ms_per_object})


def _row(category: str, method: str, labels: str, figures: dict[str, float | int]) -> Row:
    blank = dict.fromkeys(
        ("origin_cm_mean", "origin_cm_median", "deg_mean", "deg_median", "ms_per_object", "n")
    )
    known = {name: value for name, value in figures.items() if not np.isnan(value)}
    return {"category": category, "method": method, "labels": labels, **blank, **known}


def table_of(rows: Sequence[Row], setting: str) -> Table:
    """The rows as people read them: a line for each method, a column for each category."""
    categories = list(dict.fromkeys(row["category"] for row in rows))
    table = Table("method", "labels", title=f"origin cm / orientation deg, {setting}")
    for category in categories:
        table.add_column(category, justify="right")
    table.add_column("ms", justify="right")
    for method, labels in dict.fromkeys((row["method"], row["labels"]) for row in rows):
        own = [row for row in rows if (row["method"], row["labels"]) == (method, labels)]
        found = {row["category"]: row for row in own}
        times = [row["ms_per_object"] for row in own if row["ms_per_object"] is not None]
        ms = f"{np.median(times):.1f}" if times else "-"
        table.add_row(method, labels, *(_cell(found.get(c)) for c in categories), ms)
    return table


def _cell(row: Row | None) -> str:
    if row is None:
        return "-"
    text = f"{row['origin_cm_mean']:.2f} / {row['deg_mean']:.1f}"
    if row["deg_median"] is None:
        return text
    text += f"\n({row['origin_cm_median']:.2f} / {row['deg_median']:.1f})"
    text += f"\nflipped {row['flipped']:.1%}"
    if row["category"] == "mug" and row["labels"] == "unified":
        text += f"\nNOCS {row['nocs_deg_mean']:.1f} ({row['nocs_deg_median']:.1f})"
    return text


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--categories", nargs="+", default=list(PAPER), metavar="NAME")
    parser.add_argument("--setting", default="anywhere")
    parser.add_argument("--views", type=int, default=8, help="of each of the test objects")
    parser.add_argument("--weights", type=Path, metavar="DIR")
    parser.add_argument("--no-matchers", action="store_true")
    parser.add_argument("--jobs", type=int, default=1, help="processes that render")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args(argv)
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    try:
        setting = view_setting(options.setting)
        for category in options.categories:
            categories_of(category)
        rows: list[Row] = []
        for category in options.categories:
            clouds = catalogue_clouds(
                category, "test", setting, views=options.views, jobs=options.jobs
            )
            rows += rows_of(
                category, clouds, options.weights, not options.no_matchers, options.jobs
            )
    except InputError as error:
        print(f"pose_table: {error}", file=sys.stderr)
        return 2
    missing = [] if options.no_matchers else sorted(set(MATCHERS) - set(available()))
    if missing:
        log.warning("not installed, left out: %s (extra pose-bench)", ", ".join(missing))
    width = None if sys.stdout.isatty() else 160
    Console(width=width).print(table_of(rows, options.setting))
    if options.json is not None:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
