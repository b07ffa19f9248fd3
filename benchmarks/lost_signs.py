"""What estimators lose by pointing an axis the wrong way: errors as they are, and with all signs given.

    python benchmarks/lost_signs.py [--categories bowl mug] [--settings anywhere clean resting]
        [--method cppf|ours] [--weights DIR] [--views 8] [--jobs 1] [--json FILE]

Views of the catalogue's test objects, unified labels, weights as of `pose_table.py`. "Signs given" is the error
where half turns about the label's axes count for nothing. An axis is reversed where, beside the nearest of the
equivalent true poses, it points backwards.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import numpy as np
from pose_table import PAPER, WEIGHTS, estimator_of
from pose_tables.options import check_categories, check_files, one_camera_setting, write_rows
from rich.console import Console
from rich.table import Table

from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, pose_error, rotation_angle
from manipose_mj.ppf_jax.data.view_cache import catalogue_clouds
from manipose_mj.ppf_jax.evaluation.pose_predictions import predict
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.ppf_jax.weight_files import MethodName

Row = dict[str, str | float]
_HALF_TURNS = SymmetryGroup.three_planes().rotations


def signs_given(group: SymmetryGroup) -> SymmetryGroup:
    """The group with half turns about the label's axes besides."""
    members = np.concatenate([group.rotations @ turn for turn in _HALF_TURNS])
    return SymmetryGroup(members, axial=group.axial)


def reversed_axes(
    estimate: np.ndarray, truth: np.ndarray, group: SymmetryGroup
) -> tuple[bool, bool]:
    """Whether X, and whether Y, points backwards; of an axis of revolution, X alone can.

    Args:
      estimate: `(3, 3)`, `R_camera_label`.
      truth: `(3, 3)`, the same.
      group: Of the object.
    """
    equivalents = truth @ group.rotations
    if group.axial:
        return bool(np.all(equivalents[:, :, 0] @ estimate[:, 0] < 0)), False
    nearest = equivalents[np.argmin(rotation_angle(estimate, equivalents))]
    return bool(nearest[:, 0] @ estimate[:, 0] < 0), bool(nearest[:, 1] @ estimate[:, 1] < 0)


def row_of(category: str, setting: str, clouds: Sequence[LabelledCloud], poses: np.ndarray) -> Row:
    """One row of the table, angles in deg."""
    own, free, backwards = [], [], []
    for cloud, pose in zip(clouds, poses.astype(float), strict=True):
        truth, group = cloud.pose.astype(float), cloud.symmetry
        own.append(pose_error(pose, truth, group)[1])
        free.append(pose_error(pose, truth, signs_given(group))[1])
        backwards.append(reversed_axes(pose[:3, :3], truth[:3, :3], group))
    x_reversed, y_reversed = np.mean(backwards, axis=0)
    row: Row = {"category": category, "setting": setting, "n": len(clouds)}
    for name, angles in (("deg", own), ("signs_given_deg", free)):
        row[f"{name}_mean"] = float(np.degrees(np.mean(angles)))
        row[f"{name}_median"] = float(np.degrees(np.median(angles)))
    row |= {"x_reversed": float(x_reversed), "y_reversed": float(y_reversed)}
    return row


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--categories", nargs="+", default=list(PAPER), metavar="NAME")
    parser.add_argument("--settings", nargs="+", default=["anywhere"], metavar="NAME")
    parser.add_argument("--method", choices=get_args(MethodName), default="cppf")
    parser.add_argument("--weights", type=Path, default=WEIGHTS, metavar="DIR")
    parser.add_argument("--views", type=int, default=8, help="of each of the test objects")
    parser.add_argument("--jobs", type=int, default=1, help="processes that render")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args(argv)
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    table = Table("category", "setting", "views", "deg", "signs given", "X reversed", "Y reversed")
    rows: list[Row] = []
    try:
        settings = [one_camera_setting(name) for name in options.settings]
        check_categories(options.categories)
        check_files(options.json)
        for category in options.categories:
            estimator = estimator_of(category, options.weights, options.method, "unified")
            if estimator is None:
                continue
            batch = min(32, estimator.trained.model.at_once)
            for setting in settings:
                clouds = catalogue_clouds(
                    category, "test", setting, views=options.views, jobs=options.jobs
                )
                found = predict(estimator, clouds, batch=batch, timed=0)
                row = row_of(category, setting.name, clouds, found.poses)
                rows.append(row)
                table.add_row(
                    category,
                    setting.name,
                    str(row["n"]),
                    f"{row['deg_mean']:.1f} ({row['deg_median']:.1f})",
                    f"{row['signs_given_deg_mean']:.1f} ({row['signs_given_deg_median']:.1f})",
                    f"{row['x_reversed']:.0%}",
                    f"{row['y_reversed']:.0%}",
                )
        Console(width=None if sys.stdout.isatty() else 120).print(table)
        if options.json is not None:
            write_rows(options.json, rows)
    except InputError as error:
        print(f"lost_signs: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
