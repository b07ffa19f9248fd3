"""The table of poses that the arm can take, made anew: `manipose_mj/mjcf/panda/reachability.npz`.

    python benchmarks/experiments/reachability_table.py [--samples 20000000] [--seed 0]

Samples joint angles evenly, away from limits and singularities, and marks the cells of their TCP poses.
"""

from __future__ import annotations

import argparse

import numpy as np

from manipose_mj.control.grasping.candidates import MIN_DEXTERITY
from manipose_mj.control.motion.batch_ik import forward
from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.mjcf.panda.reachability import SHAPE, cells_of, with_margin, write_table

_BATCH = 200_000
_LIMIT_MARGIN = 0.10  # [rad]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--samples", type=int, default=20_000_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    low, high = (POSITION_LIMITS + [_LIMIT_MARGIN, -_LIMIT_MARGIN]).T
    hit = np.zeros(SHAPE, bool)
    for _ in range(options.samples // _BATCH):
        joints = rng.uniform(low, high, (_BATCH, 7))
        joints[:, 0] = 0.0
        poses, jacobian = forward(joints)
        least = np.linalg.eigvalsh(jacobian @ jacobian.transpose(0, 2, 1))[:, 0]
        cells, inside = cells_of(poses[least > MIN_DEXTERITY**2])
        hit[tuple(cells[inside].T)] = True
    table = with_margin(hit)
    write_table(table)
    print(f"{hit.mean():.1%} of {hit.size} cells hit, {table.mean():.1%} with margin")


if __name__ == "__main__":
    main()
