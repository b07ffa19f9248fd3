"""Distances in the planner's copy of a scene: those of the shapes, whatever detector the scene steps with."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from manipose_mj.control.scene.collision_model import CollisionModel
from manipose_mj.control.scene.collision_query import CollisionQuery
from manipose_mj.mjcf.panda.kinematics import HOME
from manipose_mj.poses import compose, invert, pose_to_vector
from tests.few_objects import load

_OPENING = 0.0735  # [m]


@pytest.mark.parametrize("back", np.linspace(0.0, 0.025, 6))
def test_pads_beside_a_carton_are_as_far_as_they_are(back):
    environment = load("single_object", "target_pose", seed=0, objects=("drinkbox_029",))
    environment.reset()
    model = environment.physics.model.ptr
    # As scenes of piles step.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)
    collisions = CollisionModel(model, "panda")
    obj = environment.task.objects["object"]
    tcp = collisions.tcp_pose(collisions.positions_of(model, environment.physics.data.qpos), HOME)
    thickness = obj.asset.label.extents[2]
    label_tcp = compose(np.eye(3), np.array([-0.066 - back, -0.03, 0.0])) @ _tcp_along_x()
    pose = tcp @ invert(obj.asset.label.pose @ label_tcp)
    qpos = environment.physics.data.qpos.copy()
    address = collisions.joint_address(model.body("object_0/").id)
    qpos[address : address + 7] = pose_to_vector(pose)
    query = CollisionQuery(opening=_OPENING)
    contacts = collisions.contacts(collisions.positions_of(model, qpos), HOME, query)
    pads = [model.geom(f"panda/{side}_finger_pad").id for side in ("left", "right")]
    loose = collisions.loose[contacts.geoms].any(axis=1)
    beside = loose & np.isin(contacts.geoms, pads).any(axis=1)
    gap = (_OPENING - thickness) / 2
    assert beside.any()
    np.testing.assert_allclose(contacts.distances[beside].min(), gap, atol=1e-3)


def _tcp_along_x() -> np.ndarray:
    """A TCP whose approach is x and whose closing direction is z."""
    return compose(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.zeros(3))
