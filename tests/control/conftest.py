"""A scene with a cabinet and a can, as planners see it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from manipose_mj.control.grasping.candidates import reachable
from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.scene.collision_model import CollisionModel
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.mjcf.panda.kinematics import HOME
from manipose_mj.poses import compose
from tests.few_objects import load

DOWN = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def environment():
    environment = load("articulated", "store_chips_can_middle_drawer", seed=1, obs_mode="state")
    environment.reset()
    return environment


@pytest.fixture
def scene(environment) -> PlanningScene:
    model, qpos = environment.physics.model.ptr, environment.physics.data.qpos
    collision_model = CollisionModel(model, "panda")
    return PlanningScene(collision_model, collision_model.positions_of(model, qpos))


@pytest.fixture(scope="module")
def arm(environment) -> ArmModel:
    return ArmModel(environment.task.root_entity.mjcf_model)


@pytest.fixture(scope="session")
def tcp_at() -> Callable[..., np.ndarray]:
    """Configurations with the TCP at a point, the hand looking down."""

    def joints(position) -> np.ndarray:
        reach = reachable(compose(DOWN, np.array(position))[None], HOME, extra_seeds=HOME[None])
        assert len(reach.index)
        return reach.joints[0]

    return joints
