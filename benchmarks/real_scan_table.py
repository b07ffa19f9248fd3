"""Poses of real scans: networks of categories saw the procedural catalogue only, those of types 82 Google scans too.

    manipose assets build ycb PATH --out SCANS/ycb
    python benchmarks/real_scan_table.py SCANS/ycb [SCANS/gso ...] [--setting anywhere] [--views 24]
        [--weights pose] [--only NAME ...] [--worst 10 --pictures DIR] [--json FILE]

Built assets are rendered as the catalogue is for the other tables. A scan is estimated by the network of
its category where there is one that knows its symmetry, else by that of its label's type, or by both where the
catalogue's objects of its kind are round and it is not; one that has neither is left out with a line. With
`--weights DIR`, these are `DIR/NAME/weights.npz`, as `manipose pose train` writes them; without, the package's
own. The bar is the paper's ManiPose column of the same category, or the mean over its two categories of the
same type: the mean must not pass it, nor the median half of it; turns about the axis do not count where the
category's label leaves them open. A bar counts where the catalogue has the scan's category with its object type; the others' are told
in a line of their own. Exits with 1 if one that counts is missed. Which scans networks were trained on:
docs/experiments/shipped_weights.md.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np
from pictures.scan_pictures import draw_view
from pose_table import PAPER
from pose_tables.options import (
    check_files,
    check_folder,
    network_of,
    one_camera_setting,
    write_rows,
)
from rich.console import Console
from rich.table import Table

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.asset_json import list_assets, read_asset
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup
from manipose_mj.ppf_jax.data.asset_views import views_of
from manipose_mj.ppf_jax.data.view_settings import ViewSetting
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.evaluation.pose_metrics import PoseErrors, pose_errors, summary
from manipose_mj.ppf_jax.evaluation.pose_predictions import predict
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.ppf_jax.two_network_fusion import TwoNetworkFusion

log = logging.getLogger("real_scan_table")


@dataclass(frozen=True)
class Row:
    """One scan.

    Attributes: scan; category; network, the weights' name; in_catalogue, whether the catalogue has the category
    with the scan's object type;
    n views; origin and orientation errors [cm, deg], of mugs also as NOCS counts, and up to the symmetry of
    shape and print (textured); flipped, a share;
    the means [cm, deg] that are the bar.
    """

    scan: str
    category: str
    network: str
    in_catalogue: bool
    n: int
    origin_cm_mean: float
    origin_cm_median: float
    deg_mean: float
    deg_median: float
    nocs_deg_mean: float
    textured_deg_mean: float
    flipped: float
    bar_cm: float
    bar_deg: float

    @property
    def within(self) -> bool:
        """Whether means and medians are within the bar."""
        means = self.origin_cm_mean <= self.bar_cm and self.deg_mean <= self.bar_deg
        return (
            means
            and self.origin_cm_median <= self.bar_cm / 2
            and self.deg_median <= self.bar_deg / 2
        )


def estimator_of(
    asset: Asset, weights: Path | None
) -> tuple[str, PoseEstimator | TwoNetworkFusion] | None:
    """The network for an asset, with its name; None where there are no weights."""
    kind, row = asset.label.object_type, CATALOGUE.get(asset.category)
    names = [asset.category, kind] if row is not None and row.object_type == kind else [kind]
    for name in names:
        estimator = _network(name, weights)
        if estimator is None or not fits(kind_symmetry(asset), estimator):
            continue
        if row is not None and (row.object_type, kind) == ("axial", "mirror"):
            upright = _network(asset.category, weights) or _network("axial", weights)
            if upright is not None:
                return "axial, mirror", TwoNetworkFusion(upright, estimator)
        # The package gives a category without weights its type's.
        only = estimator.trained.categories == (asset.category,)
        return (asset.category if only else kind), estimator
    return None


def _network(name: str, weights: Path | None) -> PoseEstimator | None:
    try:
        return network_of(name, weights)
    except InputError:
        return None


def fits(group: SymmetryGroup, estimator: PoseEstimator) -> bool:
    """Whether a label of this symmetry can be what a network was trained to find.

    A network of boxes takes half turns for no change; a carton with a sloping lid has a front, by which
    its axes are named.
    """
    return estimator.trained.model.config.symmetry.holds(group)


def bar_of(category: str, object_type: str) -> tuple[float, float]:
    """The paper's mean origin [cm] and orientation [deg] errors that a scan is held against."""
    if category in PAPER:
        return PAPER[category]
    alike = [row for name, row in PAPER.items() if CATALOGUE[name].object_type == object_type]
    return float(np.mean([cm for cm, _ in alike])), float(np.mean([deg for _, deg in alike]))


def kind_symmetry(asset: Asset) -> SymmetryGroup:
    """The turns that do not count: the scan's, or all about the axis where its whole category has one.

    A real screwdriver's grip has six sides or a name on it, by which a scan's Y is found; no network
    can know that of a category whose label is free to turn.
    """
    row = CATALOGUE.get(asset.category)
    own = asset.label.symmetry
    if row is None or row.object_type != asset.label.object_type or own.axial:
        return own
    return SymmetryGroup.about_x() if row.symmetry == "axis" else own


def row_of(asset: Asset, network: str, errors: PoseErrors) -> Row:
    """The table's row of one scan."""
    figures = summary(errors)
    kind, known = asset.label.object_type, CATALOGUE.get(asset.category)
    names = ("n", "origin_cm_mean", "origin_cm_median", "deg_mean", "deg_median")
    names += ("nocs_deg_mean", "textured_deg_mean")
    bar_cm, bar_deg = bar_of(asset.category, kind)
    return Row(
        asset.name,
        asset.category,
        network,
        known is not None and known.object_type == kind,
        *(figures[name] for name in names),  # pyright: ignore[reportArgumentType]
        flipped=figures["flipped"],
        bar_cm=bar_cm,
        bar_deg=bar_deg,
    )


def table_of(rows: Sequence[Row], setting: str) -> Table:
    """The rows as people read them; what the catalogue does not have is in brackets."""
    table = Table("scan", "category", "network", title=f"real scans, {setting}")
    for head in (
        "n",
        "cm",
        "median",
        "deg",
        "median",
        "with print",
        "flipped",
        "paper: cm / deg",
        "within",
    ):
        table.add_column(head, justify="right")
    for row in rows:
        table.add_row(
            row.scan,
            row.category if row.in_catalogue else f"({row.category})",
            row.network,
            str(row.n),
            f"{row.origin_cm_mean:.2f}",
            f"{row.origin_cm_median:.2f}",
            f"{row.deg_mean:.1f}"
            + (f" ({row.nocs_deg_mean:.1f})" if row.category == "mug" else ""),
            f"{row.deg_median:.1f}",
            f"{row.textured_deg_mean:.1f}",
            f"{row.flipped:.0%}",
            f"{row.bar_cm:.2f} / {row.bar_deg:.1f}",
            "yes" if row.within else "no",
        )
    return table


def verdict(rows: Sequence[Row]) -> list[str]:
    """What bars come to: of the scans that do not count, a line if there are any; of those that do."""
    counted = [row for row in rows if row.in_catalogue]
    others = [f"{r.scan} ({'met' if r.within else 'missed'})" for r in rows if not r.in_catalogue]
    lines = []
    if others:
        lines.append(
            f"bars of {len(others)} scans not counted, the catalogue has none of their category and object type: "
            + ", ".join(others)
        )
    missed = [row.scan for row in counted if not row.within]
    if missed:
        lines.append(f"missed: {', '.join(missed)}")
    else:
        lines.append(
            f"all bars of {len(counted)} counted scans met" if counted else "no bar counts"
        )
    return lines


def draw_worst(
    folder: Path,
    count: int,
    clouds: Sequence[LabelledCloud],
    poses: np.ndarray,
    errors: PoseErrors,
) -> list[str]:
    """Draw the views with the largest orientation errors; returns a line about each."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = []
    for rank, index in enumerate(np.argsort(-errors.rotation, kind="stable")[:count], 1):
        degrees, cm = np.degrees(errors.rotation[index]), 100 * errors.origin[index]
        line = f"{clouds[index].name}: {degrees:.1f} deg, {cm:.2f} cm, {len(clouds[index])} points"
        draw_view(folder / f"worst_{rank:02d}.png", clouds[index], poses[index], line)
        lines.append(f"{rank:2d}. {line}")
    return lines


def scans(folders: Sequence[Path], only: Sequence[str]) -> list[Asset]:
    """The rigid assets of these folders, all or those of these names."""
    found = [read_asset(path) for folder in folders for path in list_assets(folder)]
    rigid = [asset for asset in found if asset.kind == "rigid"]
    missing = sorted(set(only) - {asset.name for asset in rigid})
    if missing:
        raise InputError(f"no rigid asset named {missing[0]!r} in {', '.join(map(str, folders))}")
    return [asset for asset in rigid if not only or asset.name in only]


def measured(
    assets: Sequence[Asset], setting: ViewSetting, options: argparse.Namespace
) -> tuple[list[Row], list[LabelledCloud], np.ndarray, PoseErrors]:
    """All rows; the views, their estimates and errors.

    Raises:
      InputError: There are no weights for any of the assets.
    """
    rows, clouds, poses, parts = [], [], [], []
    for asset in assets:
        chosen = estimator_of(asset, options.weights)
        if chosen is None:
            log.warning(
                "%s: left out, no weights for %s or %s",
                asset.name,
                asset.category,
                asset.label.object_type,
            )
            continue
        seen = views_of(asset, setting, options.views)
        found = predict(chosen[1], seen, timed=0)
        group = kind_symmetry(asset)
        errors = pose_errors(
            found.poses,
            [replace(cloud, symmetry=group) for cloud in seen],
            textured={asset.name: asset.label.symmetry_textured},
        )
        rows.append(row_of(asset, chosen[0], errors))
        clouds += seen
        poses.append(found.poses)
        parts.append(errors)
    if not rows:
        raise InputError("no weights for any of these scans; give --weights DIR")
    columns = (field.name for field in fields(PoseErrors))
    joined = (np.concatenate([getattr(part, name) for part in parts]) for name in columns)
    return rows, clouds, np.concatenate(poses), PoseErrors(*joined)


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("assets", nargs="+", type=Path, metavar="DIR", help="of built assets")
    parser.add_argument("--setting", default="anywhere")
    parser.add_argument("--views", type=int, default=24, help="of each scan")
    parser.add_argument("--weights", type=Path, metavar="DIR")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--worst", type=int, default=10, help="views to draw")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="to draw them in")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args(argv)
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    try:
        if options.views < 1:
            raise InputError(f"--views is {options.views}; expected at least 1")
        setting = one_camera_setting(options.setting)
        check_files(options.json)
        check_folder(options.pictures)
        rows, clouds, poses, errors = measured(
            scans(options.assets, options.only), setting, options
        )
        width = None if sys.stdout.isatty() else 170
        Console(width=width).print(table_of(rows, options.setting))
        if options.json is not None:
            write_rows(options.json, [asdict(row) | {"within": row.within} for row in rows])
    except InputError as error:
        print(f"real_scan_table: {error}", file=sys.stderr)
        return 2
    if options.pictures is not None:
        for line in draw_worst(options.pictures, options.worst, clouds, poses, errors):
            print(line)
    print("\n".join(verdict(rows)))
    return 1 if any(row.in_catalogue and not row.within for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
