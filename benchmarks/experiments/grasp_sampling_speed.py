"""Print how long grasps of some objects take to sample, and a digest of them: the same grasps, the same digest.

python benchmarks/experiments/grasp_sampling_speed.py [OBJECT ...]

Processor time of one core, which other programs do not stretch as they do the clock's.
"""

from __future__ import annotations

import hashlib
import sys
import time

from manipose_mj.assets import catalogue
from manipose_mj.grasp_sampling.sampler import sample_grasps

OBJECTS = ("mug_009", "hammer_009", "can_011", "box_012", "fork_009", "bowl_009", "teapot_010")


def main(names: list[str]) -> None:
    """A line for each object, and the sum."""
    total = 0.0
    for name in names or OBJECTS:
        category, _, number = name.rpartition("_")
        body = catalogue.generate(category, int(number)).bodies[0]
        started = time.process_time()
        grasps = sample_grasps(body, ())
        taken = time.process_time() - started
        total += taken
        digest = hashlib.sha256(grasps.poses.tobytes() + grasps.widths.tobytes()).hexdigest()[:12]
        print(f"{name:12} {taken:6.2f} s  {len(grasps.widths)} grasps  {digest}", flush=True)
    print(f"{'all':12} {total:6.2f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
