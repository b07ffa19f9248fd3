"""Whether other scans of an object's kind say which way its label points.

    python benchmarks/flips/scan_views.py google_scanned_objects PATH --kinds benchmarks/flips/kinds.yaml --only-every 3 --out VIEWS
    python benchmarks/flips/same_kind.py VIEWS PATH --kinds benchmarks/flips/kinds.yaml --skip-every 3

The best estimate of a view is turned in all 24 ways that exchange axes. An other scan of the kind, of those that the split
leaves, is moved and stretched along its axes until it is next to the cloud; the turn with the least distance is taken, of
at most three scans. Prints how often the network's estimate, this turn and the best of the 24 are flipped and right, as
`flip_table.py` means it.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import jax
import numpy as np
import trimesh
from flip_table import FLIPPED, RIGHT, network_of
from jaxtyping import Float
from scan_views import SOURCES, chosen
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from asset_pipeline.labelling.overrides.reading import read_overrides
from asset_pipeline.labelling.scan_label import scan_label
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, invert, pose_error, transform
from manipose_mj.ppf_jax.estimator import view_scores
from manipose_mj.ppf_jax.points.cloud_files import read_views

SOURCE = "google_scanned_objects"
POINTS, OF_SCAN, SCANS = 250, 1200, 3
ROUNDS, FREE_ROUNDS = 8, 5  # of matching; the last of them stretch as well
NEAR = 0.9  # share of the cloud that is matched
STRETCH = 0.6, 1.6  # along an axis, of the mean
FAR = 0.1  # of the scan's size, beyond which distances count as this
TURNS = Rotation.create_group("O").as_matrix().round()  # a cube's


def main() -> None:
    """Print a row for catalogue kinds and one for others."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("views", type=Path, help="of the scans that are estimated")
    parser.add_argument("path", type=Path, help="the data set")
    parser.add_argument("--kinds", type=Path, required=True, help="categories and types, YAML")
    parser.add_argument("--skip-every", type=int, default=3)
    parser.add_argument("--views-each", type=int, default=6)
    options = parser.parse_args()
    scans = list(read_views(options.views))
    others = surfaces(options.path, options.kinds, options.skip_every, {s.category for s in scans})
    turns: dict[bool, list[list[float]]] = defaultdict(list)
    for scan in scans:
        if scan.category not in others:
            continue
        estimator, group = network_of(scan)
        for number, view in enumerate(scan.clouds[: options.views_each]):
            key = jax.random.fold_in(jax.random.key(0), number)
            pose, truth = view_scores(estimator, view, key=key)[0], view.pose.astype(float)
            drawn = np.random.default_rng(0).permutation(len(view.points))[:POINTS]
            seen = transform(invert(pose.astype(float)), view.points[drawn].astype(float))
            apart = [[distance(seen @ turn, o) for turn in TURNS] for o in others[scan.category]]
            errors = [turn_error(pose, turn, truth, group) for turn in TURNS]
            chosen_turn = int(np.argmin(np.min(apart, axis=0)))
            found = turn_error(pose, np.eye(3), truth, group), errors[chosen_turn], min(errors)
            turns[scan.in_catalogue].append(list(found))
    print("| kinds | views | flipped: network, by other scans, best turn | right |")
    print("| --- | ---: | ---: | ---: |")
    for known, rows in sorted(turns.items(), reverse=True):
        off = np.array(rows)
        shares = [(off > FLIPPED).mean(axis=0), (off <= RIGHT).mean(axis=0)]
        cells = [", ".join(f"{share:.0%}" for share in row) for row in shares]
        print(f"| {'catalogue' if known else 'others'} | {len(off)} | {cells[0]} | {cells[1]} |")


def surfaces(
    path: Path, kinds: Path, skip: int, wanted: set[str]
) -> dict[str, list[Float[np.ndarray, "n 3"]]]:
    """Points on scans of some kinds, in their label frames [m], by kind."""
    said, found = read_overrides(kinds), defaultdict(list)
    for item in chosen(SOURCES[SOURCE].items(path), skip, 0):
        own = said.get(item.name)
        if own is None or own.category not in wanted or len(found[own.category]) == SCANS:
            continue
        try:
            with SOURCES[SOURCE].opened(item) as scan:
                label, _ = scan_label(
                    scan.mesh,
                    own.object_type or scan.object_type,
                    scan.up,
                    category=own.category,
                    textured=False,
                    functional=scan.functional,
                )
                points = trimesh.sample.sample_surface(scan.mesh, OF_SCAN, seed=0)[0]
        except InputError:
            continue
        found[own.category].append(transform(invert(label.pose), np.asarray(points)))
    return {kind: clouds for kind, clouds in found.items() if clouds}


def distance(seen: Float[np.ndarray, "n 3"], scan: Float[np.ndarray, "m 3"]) -> float:
    """From a cloud to a scan that was moved and stretched to it, on average, of the scan's size."""
    scan = scan - (scan.max(axis=0) + scan.min(axis=0)) / 2
    lengths = np.ptp(scan, axis=0)
    stretch = np.full(3, np.max(np.ptp(seen, axis=0) / lengths))
    middle = (seen.max(axis=0) + seen.min(axis=0)) / 2
    for number in range(ROUNDS):
        away, nearest = cKDTree(scan * stretch + middle).query(seen)
        near = away <= np.quantile(away, NEAR)
        there, here = scan[nearest[near]], seen[near]
        if number >= ROUNDS - FREE_ROUNDS:
            spread = there.var(axis=0)
            slope = ((there - there.mean(0)) * (here - here.mean(0))).mean(axis=0)
            low, high = (limit * stretch.mean() for limit in STRETCH)
            fitted = np.clip(slope / np.maximum(spread, 1e-8), low, high)
            stretch = np.where(spread > 1e-8, fitted, stretch)
        middle = (here - stretch * there).mean(axis=0)
    size = float(np.linalg.norm(lengths * stretch))
    away, _ = cKDTree(scan * stretch + middle).query(seen)
    return float(np.minimum(away, FAR * size).mean() / size)


def turn_error(
    pose: Float[np.ndarray, "4 4"],
    turn: Float[np.ndarray, "3 3"],
    truth: Float[np.ndarray, "4 4"],
    group: SymmetryGroup,
) -> float:
    """How far an estimate whose axes were exchanged is turned from the truth [rad]."""
    turned = truth.copy()
    turned[:3, :3] = pose[:3, :3].astype(float) @ turn
    return float(pose_error(turned, truth, group)[1])


if __name__ == "__main__":
    main()
