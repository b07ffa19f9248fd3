"""Print how far the gripper's pads are from cartons beside them, as MuJoCo's two detectors of convex shapes say.

python benchmarks/experiments/convex_detectors.py [--cartons 10]

The open gripper stands astride a carton, 6 mm from either side, and backs away along it. Pairs within the planner's detection
distance are reported; distances below zero are overlaps.
"""

from __future__ import annotations

import argparse

import mujoco
import numpy as np
from jaxtyping import Float

from manipose_mj import suite
from manipose_mj.control.scene.collision_model import CollisionModel
from manipose_mj.control.scene.collision_query import CollisionQuery
from manipose_mj.mjcf.panda.kinematics import HOME
from manipose_mj.mjcf.panda.robot import MAX_OPENING
from manipose_mj.poses import compose, invert, pose_to_vector

GAP = 0.006  # between a pad and the carton's side [m]
BACK = np.linspace(0.0, 0.025, 6)  # from the grasp [m]
OFF = int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)
# Approach along the carton's first axis, closing direction along its third.
ASTRIDE = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def distances(carton: str) -> dict[str, Float[np.ndarray, "k"]] | None:
    """The least distance of a pad from the carton at each position [m]; None if it is too wide."""
    environment = suite.load("single_object", "target_pose", seed=0, objects=(carton,))
    environment.reset()
    model, qpos = environment.physics.model.ptr, environment.physics.data.qpos.copy()
    label = environment.task.objects["object"].asset.label
    opening = float(label.extents[2]) + 2 * GAP
    if opening > MAX_OPENING:
        return None
    collisions = CollisionModel(model, "panda")
    tcp = collisions.tcp_pose(collisions.positions_of(model, qpos), HOME)
    address = collisions.joint_address(model.body("object_0/").id)
    pads = [model.geom(f"panda/{side}_finger_pad").id for side in ("left", "right")]
    found: dict[str, list[float]] = {"native": [], "other": []}
    for back in BACK:
        at = np.array([-0.35 * label.extents[0] - back, 0.0, 0.0])
        label_tcp = compose(ASTRIDE, at)
        qpos[address : address + 7] = pose_to_vector(tcp @ invert(label.pose @ label_tcp))
        for name, flags in (("native", 0), ("other", OFF)):
            collisions.model.opt.disableflags = flags
            positions = collisions.positions_of(model, qpos)
            contacts = collisions.contacts(positions, HOME, CollisionQuery(opening=opening))
            mine = collisions.loose[contacts.geoms].any(axis=1)
            mine &= np.isin(contacts.geoms, pads).any(axis=1)
            found[name].append(float(contacts.distances[mine].min(initial=np.inf)))
    return {name: np.array(values) for name, values in found.items()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cartons", type=int, default=10, help="of the built-in ones")
    arguments = parser.parse_args()
    print("| carton | native: least distance, mm | other: least distance, mm |")
    print("| --- | --- | --- |")
    for k in range(arguments.cartons):
        name = f"drinkbox_{k:03d}"
        found = distances(name)
        if found is not None:
            least = (f"{1000 * found[each].min():.1f}" for each in ("native", "other"))
            print(f"| `{name}` | {' | '.join(least)} |")


if __name__ == "__main__":
    main()
