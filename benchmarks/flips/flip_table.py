"""How often estimates are flipped, with one view and with several scored together, and whether confidence is right.

    python benchmarks/flips/scan_views.py ycb PATH --out VIEWS/ycb
    python benchmarks/flips/flip_table.py VIEWS/ycb [VIEWS/gso ...] [--views 1 2 3] [--scans] [--records FILE] [--fused]

Views of a scan are taken three by three: with two cameras, the first two of each three are scored together, their poses
to one another known. A scan is estimated by the network of its category where that knows its symmetry, else by that of
its type; where the catalogue's objects are round and the scan is not, by the category's, and only its axis counts. An
estimate is right within 15 deg, flipped beyond 90. `--records` is what `fit_confidence.py` reads. Reliability is of
estimates with the pose scorer's own probability, and with the calibrated one. `--fused` asks the networks that look
through several cameras about the views as one cloud.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import jax
import numpy as np
from rich.console import Console
from rich.table import Table

from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, invert, pose_error
from manipose_mj.ppf_jax.confidence import Calibration, shipped_calibration
from manipose_mj.ppf_jax.estimator import PoseEstimator, view_scores
from manipose_mj.ppf_jax.fused_views import FusedViewEstimator, fused_cloud
from manipose_mj.ppf_jax.multi_view import score_together
from manipose_mj.ppf_jax.points.cloud_files import ScanViews, read_views
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.ppf_jax.weight_files import Cameras

GROUP = 3  # consecutive views that are scored together
RIGHT, FLIPPED = np.deg2rad(15.0), np.pi / 2
RIGHT_ORIGIN = 0.02  # [m]
BINS = (0.0, 0.2, 0.5, 0.8, 0.9, 0.95, 1.0)


@dataclass(frozen=True)
class Record:
    """One estimate.

    Attributes: scan; in_catalogue, whether training had the kind; views that were scored together; turn [rad] and
    shift [m] from the truth; raw, the pose scorer's probability; confidence, as calibrated; features of the scores.
    """

    scan: str
    in_catalogue: bool
    views: int
    turn: float
    shift: float
    raw: float
    confidence: float
    features: tuple[float, ...]

    @property
    def right(self) -> bool:
        """As confidence means it."""
        return self.turn <= RIGHT and self.shift <= RIGHT_ORIGIN


def network_of(scan: ScanViews, cameras: Cameras = "one") -> tuple[PoseEstimator, SymmetryGroup]:
    """The estimator of a scan, and the turns that do not count.

    Raises:
      InputError: There is none.
    """
    row, group = CATALOGUE.get(scan.category), scan.symmetry
    if row is not None and row.object_type == "axial" and not group.axial:
        return PoseEstimator.load(scan.category, cameras=cameras), SymmetryGroup.about_x()
    if scan.in_catalogue and row is not None and row.symmetry == "axis" and not group.axial:
        group = SymmetryGroup.about_x()
    names = [scan.category] if scan.in_catalogue else []
    for name in (*names, scan.object_type):
        estimator = PoseEstimator.load(name, cameras=cameras)
        if estimator.trained.model.config.symmetry.holds(group):
            return estimator, group
    raise InputError(f"{scan.name}: no network knows its symmetry")


def calibration_of(estimator: PoseEstimator) -> Calibration:
    """That of its weights, which ship."""
    return estimator.calibration or shipped_calibration()


def records_of(
    scan: ScanViews, counts: Sequence[int], cameras: Cameras = "one"
) -> Iterator[Record]:
    """Every estimate of a scan."""
    estimator, group = network_of(scan, cameras)
    for count in counts:
        step = 1 if count == 1 else GROUP
        for start in range(0, len(scan.clouds) - count + 1, step):
            yield _record(scan, estimator, group, scan.clouds[start : start + count], start)


def _record(
    scan: ScanViews,
    estimator: PoseEstimator,
    group: SymmetryGroup,
    views: Sequence[LabelledCloud],
    seed: int,
) -> Record:
    key = jax.random.fold_in(jax.random.key(0), seed)
    truths = [view.pose.astype(float) for view in views]
    if estimator.trained.cameras == "several":
        frames = np.stack([truths[0] @ invert(truth) for truth in truths])
        cloud, T_first_cloud = fused_cloud(views, frames, rng=np.random.default_rng(seed))
        pose, scores = FusedViewEstimator(estimator).scores(cloud, key=key)
        pose = T_first_cloud @ pose.astype(float)
    elif len(views) == 1:
        pose, scores = view_scores(estimator, views[0], key=key)
    else:
        frames = np.stack([truths[0] @ invert(truth) for truth in truths])
        found = score_together(estimator, views, frames, key=key)
        pose, scores = found.poses[0], found.scores
    shift, turn = pose_error(pose.astype(float), truths[0], group)
    return Record(
        scan.name,
        scan.in_catalogue,
        len(views),
        float(turn),
        float(shift),
        scores.score,
        calibration_of(estimator).probability(scores),
        tuple(scores.features().tolist()),
    )


def table_of(records: Sequence[Record]) -> Table:
    """Flips and reliability by kind and number of views."""
    table = Table("kinds", "views", title="flipped and right estimates")
    heads = ("scans", "n", "flipped", "within 15 deg", "median deg")
    for head in (*heads, "score > 0.9", "right", "confidence > 0.9", "right"):
        table.add_column(head, justify="right")
    for known in (True, False):
        for count in sorted({record.views for record in records}):
            some = [r for r in records if r.in_catalogue == known and r.views == count]
            if not some:
                continue
            turn = np.array([r.turn for r in some])
            cells = [str(len({r.scan for r in some})), str(len(some))]
            cells += [f"{(turn > FLIPPED).mean():.1%}", f"{(turn <= RIGHT).mean():.1%}"]
            cells.append(f"{np.degrees(np.median(turn)):.1f}")
            for values in ([r.raw for r in some], [r.confidence for r in some]):
                sure = turn[np.array(values) > 0.9]
                cells.append(str(len(sure)))
                cells.append(f"{(sure <= RIGHT).mean():.1%}" if len(sure) else "-")
            table.add_row("catalogue" if known else "others", str(count), *cells)
    return table


def reliability_of(records: Sequence[Record]) -> Table:
    """The share of right estimates by confidence."""
    table = Table("kinds", "probability", title="reliability: share within 15 deg and 2 cm (n)")
    for low, high in zip(BINS[:-1], BINS[1:], strict=True):
        table.add_column(f"{low:g} to {high:g}", justify="right")
    for known in (True, False):
        some = [r for r in records if r.in_catalogue == known]
        right = np.array([r.right for r in some])
        for name, values in (
            ("score", [r.raw for r in some]),
            ("confidence", [r.confidence for r in some]),
        ):
            bins = np.clip(np.digitize(values, BINS) - 1, 0, len(BINS) - 2)
            shares = [right[bins == i] for i in range(len(BINS) - 1)]
            cells = [f"{s.mean():.0%} ({len(s)})" if len(s) else "-" for s in shares]
            table.add_row("catalogue" if known else "others", name, *cells)
    return table


def scans_of(records: Sequence[Record]) -> Table:
    """Of each scan with flips, with one view."""
    table = Table("scan", "flipped", "median deg", "mean score", "mean confidence")
    single = [r for r in records if r.views == 1]
    for name in sorted({r.scan for r in single}):
        some = [r for r in single if r.scan == name]
        turn = np.array([r.turn for r in some])
        if (turn > FLIPPED).any():
            figures = [f"{(turn > FLIPPED).mean():.0%}", f"{np.degrees(np.median(turn)):.1f}"]
            for values in ([r.raw for r in some], [r.confidence for r in some]):
                figures.append(f"{np.mean(values):.2f}")
            table.add_row(name, *figures)
    return table


def main(argv: Sequence[str] | None = None) -> int:
    """Print the tables; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR", help="of views")
    parser.add_argument("--views", nargs="+", type=int, default=[1, 2, 3], metavar="N")
    parser.add_argument("--scans", action="store_true", help="print each scan with flips as well")
    parser.add_argument("--fused", action="store_true", help="views as one cloud")
    parser.add_argument("--records", type=Path, metavar="FILE", help="to write all estimates to")
    options = parser.parse_args(argv)
    try:
        if not all(1 <= count <= GROUP for count in options.views):
            raise InputError(f"--views {options.views}; expected numbers from 1 to {GROUP}")
        records: list[Record] = []
        for folder in options.folders:
            for scan in read_views(folder):
                try:
                    cameras = "several" if options.fused else "one"
                    records += records_of(scan, options.views, cameras)
                except InputError as error:
                    print(f"left out: {error}", file=sys.stderr)
    except InputError as error:
        print(f"flip_table: {error}", file=sys.stderr)
        return 2
    if options.records is not None:
        options.records.write_text(json.dumps([asdict(record) for record in records]) + "\n")
    console = Console(width=None if sys.stdout.isatty() else 150)
    console.print(table_of(records))
    console.print(reliability_of(records))
    if options.scans:
        console.print(scans_of(records))
    return 0


if __name__ == "__main__":
    sys.exit(main())
