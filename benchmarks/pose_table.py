"""Table I: category-level pose from one partial, noisy cloud: ours, CPPF as published, matchers, the paper's.

    python benchmarks/pose_table.py [--categories bowl mug] [--setting anywhere|resting|tasks]
        [--views 8] [--weights DIR] [--no-matchers] [--jobs 1] [--json FILE]

Every method sees the same clouds: views of the catalogue's test objects, which nothing was trained on.
Weights are read from `DIR/FOLDER/weights.npz`, FOLDER being what `manipose pose train` names its folder:
CATEGORY for ours on unified labels, CATEGORY-original, CATEGORY-cppf, CATEGORY-cppf-original. Without
`--weights` they are those beside this file, for the paper's six categories. Ours on unified labels are the
package's own where DIR has none. What is not there is left out with a line.
On original labels each estimate is held against the object's frame as its source has it; of an axis of
revolution, wherever that frame has it, only the direction counts, as with unified labels. How much these
labels differ from one another, whatever the estimator: the row of what knows every pose and gives all objects
the same of the sources' frames, the best one.

Matchers see the category's typical object as their template, in the right size of its kind, and need
`pip install -e ".[pose-bench]"`. Errors are means, medians in brackets; for mugs also as NOCS counts
(free about the axis while the handle is hidden). Times: one object after another, for networks from bare
points and on the device that JAX runs on, for matchers on the CPU with normals given. CPPF takes
seconds an object: all of it about an hour on two cores.

`--json` writes one row per category, method and label set; figures that a source does not give are null.
"""

from __future__ import annotations

import argparse
import logging
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pose_matchers import Matcher, available, template
from pose_tables.options import check_categories, check_files, one_camera_setting, write_rows
from rich.console import Console
from rich.table import Table

from manipose_mj.cli.pose.train import WEIGHTS_FILE, folder_name
from manipose_mj.errors import InputError
from manipose_mj.poses import compose
from manipose_mj.ppf_jax.data.source_frames import SourceLabel
from manipose_mj.ppf_jax.data.view_cache import catalogue_clouds, source_labels
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.evaluation.pose_metrics import pose_errors, summary
from manipose_mj.ppf_jax.evaluation.pose_predictions import (
    Predictions,
    catalogue_hulls,
    predict,
)
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.ppf_jax.weight_files import LabelSet, MethodName

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
WEIGHTS = Path(__file__).parent / "pose_table_weights"
Row = dict[str, Any]
# As rows are called, by whose weights they are.
NETWORKS: dict[MethodName, str] = {"cppf": "CPPF as published", "ours": "ours"}
ONE_FRAME = "true pose, one frame for all"
SHOWN_RECALLS = ((5, 2), (10, 2), (10, 5))  # [deg, cm]
LABEL_SETS: tuple[LabelSet, ...] = ("unified", "original")


def rows_of(
    category: str,
    clouds: Sequence[LabelledCloud],
    weights: Path,
    matchers: dict[str, Matcher],
    jobs: int,
) -> Iterator[Row]:
    """The table's rows of one category."""
    if category in PAPER:
        origin, degrees = PAPER[category]
        yield _row(category, "paper", "unified", {"origin_cm_mean": origin, "deg_mean": degrees})
    frames = source_labels(clouds, jobs=jobs)
    yield _measured(category, ONE_FRAME, "original", clouds, _one_frame(clouds, frames), frames)
    for method, name in NETWORKS.items():
        for labels in LABEL_SETS:
            estimator = estimator_of(category, weights, method, labels)
            if estimator is None:
                continue
            sources = frames if labels == "original" else None
            # The last batch is filled up, which costs a slow method most.
            batch = min(32, estimator.trained.model.at_once)
            found = predict(estimator, clouds, batch=batch)
            yield _measured(category, name, labels, clouds, found, sources)
    shape = template(category) if matchers else None
    for name, matcher in matchers.items():
        assert shape is not None
        match, poses, spent = matcher(shape), [], []
        for cloud in clouds:
            begin = time.perf_counter()
            pose = match(cloud.points, cloud.normals)
            spent.append(time.perf_counter() - begin)
            found = np.isfinite(pose).all()
            poses.append(pose if found else compose(np.eye(3), cloud.points.mean(axis=0)))
        none = np.full(len(clouds), np.nan)
        predicted = Predictions(np.stack(poses), none, 1e3 * float(np.median(spent)))
        yield _measured(category, name, "unified", clouds, predicted, None)


def estimator_of(
    category: str, weights: Path, method: MethodName, labels: LabelSet
) -> PoseEstimator | None:
    """From a folder of trainings, else from the package; None, with a line, where there is none."""
    path = weights / folder_name(category, method, labels) / WEIGHTS_FILE
    try:
        if (method, labels) == ("ours", "unified") and not path.is_file():
            return PoseEstimator.load(category)
        return PoseEstimator.from_file(path, method=method, labels=labels)
    except InputError as error:
        log.warning("%s, %s, %s labels: left out (%s)", category, method, labels, error)
    return None


def _one_frame(clouds: Sequence[LabelledCloud], frames: dict[str, SourceLabel]) -> Predictions:
    """What knows every unified pose and says one source's frame for all objects: the best such frame.

    What no cloud tells is from which source an object is.
    """
    found = []
    for frame in frames.values():
        poses = np.stack([cloud.pose for cloud in clouds]) @ frame.T_label_source
        errors = pose_errors(poses, clouds, sources=frames)
        # Frames that differ in their origins only are equally good but for rounding.
        found.append((round(errors.rotation.mean(), 4), errors.origin.mean(), poses))
    _, _, poses = min(found, key=lambda row: row[:2])
    none = np.full(len(clouds), np.nan)
    return Predictions(poses, none, float("nan"))


def _measured(
    category: str,
    method: str,
    labels: str,
    clouds: Sequence[LabelledCloud],
    found: Predictions,
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
    limits = ", ".join(f"{deg} deg {cm} cm" for deg, cm in SHOWN_RECALLS)
    title = f"origin cm / orientation deg, {setting}; recall at {limits} in %"
    table = Table("method", "labels", title=title)
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


def _recall(degrees: int, cm: int) -> str:
    return f"recall_{degrees}deg_{cm}cm"


def _cell(row: Row | None) -> str:
    if row is None:
        return "-"
    text = f"{row['origin_cm_mean']:.2f} / {row['deg_mean']:.1f}"
    if row["deg_median"] is None:
        return text
    text += f"\n({row['origin_cm_median']:.2f} / {row['deg_median']:.1f})"
    text += "\n" + " ".join(f"{100 * row[_recall(*limit)]:.0f}" for limit in SHOWN_RECALLS)
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
    parser.add_argument("--setting", default="anywhere", help="such as anywhere, resting, tasks")
    parser.add_argument("--views", type=int, default=8, help="of each of the test objects")
    parser.add_argument("--weights", type=Path, default=WEIGHTS, metavar="DIR")
    parser.add_argument("--no-matchers", action="store_true")
    parser.add_argument("--jobs", type=int, default=1, help="processes that render")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args(argv)
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    try:
        setting = one_camera_setting(options.setting)
        check_categories(options.categories)
        check_files(options.json)
        matchers, lacking = ({}, {}) if options.no_matchers else available()
        for name, why in lacking.items():
            log.warning("%s: left out (%s; extra pose-bench)", name, why)
        rows: list[Row] = []
        with Console(stderr=True).status("") as status:
            for category in options.categories:
                status.update(f"{category}: views")
                clouds = catalogue_clouds(
                    category, "test", setting, views=options.views, jobs=options.jobs
                )
                for row in rows_of(category, clouds, options.weights, matchers, options.jobs):
                    rows.append({**row, "setting": options.setting})
                    status.update(f"{category}: after {row['method']}, {row['labels']} labels")
        width = None if sys.stdout.isatty() else 160
        Console(width=width).print(table_of(rows, options.setting))
        if options.json is not None:
            write_rows(options.json, rows)
    except InputError as error:
        print(f"pose_table: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
