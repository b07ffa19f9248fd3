"""Print where objects begin to fall in piles, and how much room they are given beside their goals.

python benchmarks/starts/pile_drops.py [pen_006 pencil_000 ...] [--drops 100]

Both take the origin of an object's label for the middle of its box. That of a tool is elsewhere.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.spatial.transform import Rotation

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset
from manipose_mj.tasks.clutter.pile_scene import PileScene
from manipose_mj.tasks.clutter.task import _reach

NAMES = ("pen_006", "pencil_000", "marker_000", "cutter_004", "spoon_000", "box_000")
_WALL, _GAP = 0.13, 0.012  # of a pile [m]


def main() -> None:
    """Print a row for each object."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", default=NAMES, help="built-in objects")
    parser.add_argument("--drops", type=int, default=100)
    arguments = parser.parse_args()
    print("| object | begins in the table | lowest [mm] | room [mm] | needed [mm] |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for name in arguments.names:
        asset = catalogue.load_by_name(name)
        lowest = [1e3 * _lowest(asset, k) for k in range(arguments.drops)]
        inside = np.mean([each < 0 for each in lowest])
        room, needed = 1e3 * _reach(asset), 1e3 * _farthest(asset)
        print(f"| `{name}` | {inside:.0%} | {min(lowest):.0f} | {room:.0f} | {needed:.0f} |")


def _lowest(asset: Asset, seed: int) -> float:
    """Where the box's lowest corner is as the first object of a pile begins to fall, over the table [m]."""
    scene = PileScene([asset], _WALL)
    rotation = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    scene.drop(0, rotation, np.zeros(2), _GAP, 0.0)
    label = scene.poses()[0] @ asset.label.pose
    middle = label[2, 3] + label[2, :3] @ asset.label.center
    return float(middle - np.abs(label[2, :3]) @ asset.label.extents / 2)


def _farthest(asset: Asset) -> float:
    """How far the box reaches from the label's origin where the object lies flat on one of its sides [m]."""
    low, high = asset.label.bounds
    reach = np.maximum(np.abs(low), np.abs(high))
    return float(np.linalg.norm(np.sort(reach)[1:]))


if __name__ == "__main__":
    main()
