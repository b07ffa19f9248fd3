"""Scenes as estimates, without a simulator, for plans that are only read and checked."""

from __future__ import annotations

from unittest.mock import Mock

import numpy as np

from manipose_mj.assets.asset import Cavity, GraspSet
from manipose_mj.assets.geometry import Joint
from manipose_mj.assets.label import PoseLabel
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, PartEstimate, SceneEstimate
from manipose_mj.poses import SymmetryGroup, compose, rotation_about

NO_GEOMS = np.zeros(1, bool)
NO_SCENE = Mock(spec=PlanningScene)
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
Y = np.array([0.0, 1.0, 0.0])
BAR = np.array(
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
)  # level, its Y towards the robot


def rigid(
    name: str,
    category: str,
    extents: tuple[float, float, float],
    place: tuple[float, float, float],
    *,
    lying: bool = False,
    graspable: bool = True,
    colours: str = "",
) -> ObjectEstimate:
    """An object with its label's middle at `place` [m]."""
    rotation = rotation_about(Y, np.pi / 2) @ UPRIGHT if lying else UPRIGHT
    label = PoseLabel(
        np.zeros(3), np.eye(3), "axial", np.array(extents, float), SymmetryGroup.about_x()
    )
    count = 6 if graspable else 0
    grasps = GraspSet(
        np.tile(np.eye(4), (count, 1, 1)), np.full(count, 0.05), np.ones((count, 1), bool)
    )
    pose = compose(rotation, np.array(place))
    return ObjectEstimate(
        name,
        pose,
        label,
        lambda: grasps,
        1,
        NO_GEOMS,
        category=category,
        find_colours=lambda: colours,
    )


def drawer(name: str, height: float, opening: float = 0.0) -> PartEstimate:
    """A drawer of a cabinet ahead of the robot that opens towards it by up to 0.2 m."""
    base = compose(np.eye(3), np.array([0.9, 0.0, 0.0]))
    handle = PoseLabel(
        np.array([-0.2, 0.0, height]), BAR, "handle", np.array([0.1, 0.03, 0.01]),
        SymmetryGroup.identity(),
    )  # fmt: skip
    cavity = Cavity(np.array([0.0, 0.0, height]), np.array([0.28, 0.3, 0.12]), moves_with_part=True)
    joint = Joint("slide", np.zeros(3), np.array([-1.0, 0.0, 0.0]), (0.0, 0.2))
    moved = base @ compose(np.eye(3), joint.axis * opening)
    return PartEstimate(name, base, moved, opening, joint, handle, cavity, 2, NO_GEOMS)


def door(name: str, opening: float = 0.0, center: tuple[float, float, float] = (0.0, 0.0, 0.6)):
    """A door in front of a room 0.24 m wide, deep and high."""
    base = compose(np.eye(3), np.array([0.9, 0.0, 0.0]))
    handle = PoseLabel(
        np.array([-0.2, -0.1, center[2]]), BAR, "handle", np.array([0.1, 0.03, 0.01]),
        SymmetryGroup.identity(),
    )  # fmt: skip
    cavity = Cavity(np.array(center), np.full(3, 0.24), moves_with_part=False)
    joint = Joint("hinge", np.array([-0.2, 0.15, 0.0]), np.array([0.0, 0.0, -1.0]), (0.0, 1.6))
    return PartEstimate(name, base, base, opening, joint, handle, cavity, 2, NO_GEOMS)


def scene(objects: list[ObjectEstimate], parts: list[PartEstimate]) -> SceneEstimate:
    """All of it in one estimate; the hand is empty."""
    return SceneEstimate(
        np.zeros(7),
        0.08,
        {each.name: each for each in objects},
        {each.name: each for each in parts},
        NO_SCENE,
    )


def kitchen() -> SceneEstimate:
    """Two cans, a mug and a pan on the table; three shut drawers and a door that is ajar."""
    return scene(
        [
            rigid("red_can", "can", (0.12, 0.066, 0.066), (0.45, 0.1, 0.06)),
            rigid("blue_can", "can", (0.10, 0.066, 0.066), (0.5, -0.1, 0.05)),
            rigid("mug", "mug", (0.09, 0.11, 0.08), (0.4, 0.25, 0.045)),
            rigid("pan", "pan", (0.07, 0.42, 0.28), (0.5, -0.35, 0.035)),
        ],
        [
            drawer("top_drawer", 0.45),
            drawer("middle_drawer", 0.3),
            drawer("bottom_drawer", 0.15),
            door("cabinet_door", 0.2),
        ],
    )


def kitchenette() -> SceneEstimate:
    """A microwave, shut, with a bowl in it; its drawer is open with a spoon in it; a cup on the table."""
    spoon = rigid("spoon", "spoon", (0.16, 0.04, 0.02), (0.75, 0.0, 0.16), lying=True)
    return scene(
        [
            rigid("bowl", "bowl", (0.06, 0.15, 0.15), (0.9, 0.0, 0.6)),
            spoon,
            rigid("cup", "cup", (0.1, 0.08, 0.08), (0.45, 0.2, 0.05)),
        ],
        [door("microwave_door"), drawer("drawer", 0.15, 0.19)],
    )


def counter() -> SceneEstimate:
    """Two cans and a mug that only their colours and kinds tell apart; three shut drawers."""
    return scene(
        [
            rigid("clutter_0", "can", (0.10, 0.066, 0.066), (0.5, -0.1, 0.05), colours="blue"),
            rigid(
                "object", "can", (0.12, 0.066, 0.066), (0.45, 0.1, 0.06), colours="red and white"
            ),
            rigid("clutter_1", "mug", (0.09, 0.11, 0.08), (0.4, 0.25, 0.045), colours="red"),
        ],
        [drawer("part_0", 0.15), drawer("middle_drawer", 0.3), drawer("part_2", 0.45)],
    )


def desk() -> SceneEstimate:
    """No furniture: a hammer, two boxes, and a helmet that is too large for the gripper."""
    return scene(
        [
            rigid("hammer", "hammer", (0.3, 0.1, 0.03), (0.5, 0.1, 0.015), lying=True),
            rigid("tea_box", "box", (0.12, 0.08, 0.05), (0.45, -0.1, 0.06)),
            rigid("pill_box", "box", (0.06, 0.05, 0.02), (0.4, -0.25, 0.03)),
            rigid("helmet", "helmet", (0.2, 0.28, 0.22), (0.6, 0.3, 0.1), graspable=False),
        ],
        [],
    )


SCENES = {"counter": counter, "kitchen": kitchen, "kitchenette": kitchenette, "desk": desk}
