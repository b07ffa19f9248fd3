"""Where in a drawer or behind a door an object can be set down."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.control.planning.regrasp import Poses
from manipose_mj.control.planning.table_places import (
    DROP_HEIGHT,
    rest_of,
    resting_height,
    resting_rotation,
)
from manipose_mj.control.scene.articulation import joint_motion
from manipose_mj.control.scene.cavity_mouth import outwards
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, PartEstimate, SceneEstimate
from manipose_mj.poses import compose, invert, rotation_about
from manipose_mj.tasks.articulated.cavity_placement import MIN_GRASPS
from manipose_mj.tasks.articulated.hand_room import (
    STRAIGHT,
    TILTED,
    Placement,
    count_clear,
    hands_around,
)

CAVITY_MARGIN = np.array([0.010, 0.010, 0.004])  # in all, along each axis [m]
# Where in the cavity, as a share of the free way from its middle to its front: the hand that sets
# something down needs room in front of what is above, or beside, or both.
_DRAWER_FRONT = (0.35, 0.5, 0.2, 0.7, 0.95, 0.0, -0.3, -0.6)
_DOOR_FRONT = (0.95, 0.75, 0.5, 0.25)
_SIDEWAYS = (0.0, 0.3, -0.3, 0.6, -0.6, 0.95, -0.95)
_MAX_PER_WAY = 3  # places in the cavity for each way to lie
_AT_LEAST_DRAWN = 0.01  # a drawer that somebody reaches into [m]
_ENOUGH_HANDS = 8  # grasps with room for the hand, from which on more make no place better
_APART = 0.008  # between objects that lie side by side [m]
_SAME_SIDE = 0.95  # cosine from which on two verticals are one
_UP = np.array([0.0, 0.0, 1.0])


def poses_in_cavity(
    obj: ObjectEstimate,
    part: PartEstimate,
    opening: float,
    estimate: SceneEstimate | None = None,
    *,
    others: bool = False,
) -> Poses:
    """Label poses in which the object's bounding box rests on the cavity's floor and fits it.

    Args:
      obj: What to store.
      part: The drawer or door.
      opening: Joint position while the object is put in [m or rad].
      estimate: What else there is; what lies in the cavity is kept clear of.
      others: Of an object that fits in some orientation, those in which it fits if it is smaller than its estimate, by
        what that is uncertain by.

    Returns:
      `T_world_label`: those first that keep the side that is down now, then lying ones, which are
      easiest to shut away; towards the front.
    """
    cavity = part.cavity
    if cavity is None:
        return ()
    carrier = part.base_pose
    if cavity.moves_with_part and part.joint.kind == "slide":
        carrier = part.base_pose @ joint_motion(part, opening)
    front = outwards(part)
    across = np.cross(_UP, front)
    shares = _DRAWER_FRONT if cavity.moves_with_part else _DOOR_FRONT
    taken = [] if estimate is None else _boxes_inside(estimate, obj, part)
    open_side = _UP if cavity.moves_with_part else front
    down = obj.label_pose[2, :3]
    drawn = None
    if cavity.moves_with_part and part.joint.kind == "slide":
        drawn = front[:2] * max(opening - part.joint.range[0], _AT_LEAST_DRAWN)
    found = []
    rotations = _ways_to_turn(obj)
    towards = _hand_towards(obj, rotations, open_side)
    room = (cavity.extents - CAVITY_MARGIN) / 2
    boxes = [(rotation @ obj.label.center, obj.label.reach(rotation)) for rotation in rotations]
    if estimate is not None and not any((reach <= room).all() for _, reach in boxes):
        # A box around a box that is tilted is larger than one around what tapers.
        boxes = [obj.box_around(estimate.scene, rotation) for rotation in rotations]
    fit = [bool((reach <= room).all()) for _, reach in boxes]
    if others and not any(fit):
        return ()  # they are found without
    if obj.uncertainty > 0 and (others or not any(fit)):
        room = room + obj.uncertainty  # it may be that much smaller
    for rotation, (middle, reach), fits in zip(rotations, boxes, fit, strict=True):
        slack = room - reach
        if (slack < 0).any() or (others and fits):
            continue
        height = resting_height(obj, rotation) if obj.rests else reach[2]
        floor = np.array([0.0, 0.0, height + DROP_HEIGHT - cavity.extents[2] / 2])
        other_side = float(rotation[2] @ down) < _SAME_SIDE
        hands = _hands(obj, rotation, open_side, towards)
        # From the middle of its box to the label's origin, and on to the object's.
        to_label = -middle * [1, 1, 0]
        to_object = to_label - rotation @ obj.label.rotation.T @ obj.label.origin
        places = []
        for sideways in _SIDEWAYS:
            for share in shares:
                place_ = (share * front + sideways * across) * slack
                if _meets(place_, reach, taken):
                    continue
                # Without grasps that are known to come from there, any place is as good.
                at = floor + place_ + to_object
                clear = count_clear(hands, at, cavity, open_side, taken, drawn)
                places.append((-min(clear, _ENOUGH_HANDS), abs(sideways), -share, place_))
        # Stable: of places with as much room those come first that come first above.
        places.sort(key=lambda entry: entry[0])
        for clear, off, back, place_ in places[:_MAX_PER_WAY]:
            pose = carrier @ compose(rotation, cavity.center + floor + place_ + to_label)
            found.append((other_side, clear, round(reach[2], 4), off, back, pose))
    found.sort(key=lambda entry: entry[:5])
    return tuple(entry[5] for entry in found)


def lies_inside(obj: ObjectEstimate, part: PartEstimate) -> bool:
    """Whether the object's middle is in the part's cavity."""
    if part.cavity is None:
        return False
    carrier = part.pose if part.cavity.moves_with_part else part.base_pose
    place_ = (invert(carrier) @ obj.label_pose)[:3, 3] - part.cavity.center
    return bool((np.abs(place_) < part.cavity.extents / 2).all())


def _hand_towards(
    obj: ObjectEstimate,
    rotations: list[Float[np.ndarray, "3 3"]],
    open_side: Float[np.ndarray, "3"],
) -> float:
    """`STRAIGHT`; `TILTED` where too few grasps lead straight through an open side in front."""
    from_above = open_side[2] > _SAME_SIDE
    straight = (len(_hands(obj, turned, open_side, STRAIGHT)) for turned in rotations)
    return STRAIGHT if from_above or any(count >= MIN_GRASPS for count in straight) else TILTED


def _hands(
    obj: ObjectEstimate,
    rotation: Float[np.ndarray, "3 3"],
    open_side: Float[np.ndarray, "3"],
    towards: float,
) -> Float[np.ndarray, "k b 8 3"]:
    """The hand at the grasps that are left when the object's label is turned so in a cavity."""
    rest = rest_of(obj, rotation)
    if rest is None:
        return np.zeros((0, 3, 8, 3))
    return hands_around(obj.grasps, rest, rotation @ obj.label.rotation.T, open_side, towards)


def _boxes_inside(
    estimate: SceneEstimate, obj: ObjectEstimate, part: PartEstimate
) -> list[Placement]:
    """What lies in the cavity."""
    assert part.cavity is not None
    carrier = part.pose if part.cavity.moves_with_part else part.base_pose
    boxes = []
    for other in estimate.objects.values():
        if other.name != obj.name and lies_inside(other, part):
            pose = invert(carrier) @ other.label_pose
            reach = other.label.reach(pose[:3, :3])
            middle = pose[:3, :3] @ other.label.center + pose[:3, 3]
            boxes.append(Placement((middle - part.cavity.center)[:2], reach))
    return boxes


def _meets(
    place_: Float[np.ndarray, "3"], reach: Float[np.ndarray, "3"], taken: list[Placement]
) -> bool:
    return any(
        (np.abs(place_[:2] - other.place) < reach[:2] + other.reach[:2] + _APART).all()
        for other in taken
    )


def _ways_to_turn(obj: ObjectEstimate) -> list[Float[np.ndarray, "3 3"]]:
    """Stable poses in quarter turns; where none are known the 24 rotations of a cube, of an axial
    label those that differ."""
    if obj.rests:
        return [
            resting_rotation(obj, rest, quarter * np.pi / 2)
            for rest in obj.rests
            for quarter in range(4)
        ]
    quarter = [
        [rotation_about(np.eye(3)[axis], k * np.pi / 2) for k in range(4)] for axis in (0, 2)
    ]
    tilts = [rotation_about(np.eye(3)[1], k * np.pi / 2) for k in (1, 3)]
    first = [x for x in quarter[0]] + tilts
    rotations = [np.round(z @ x) for x in first for z in quarter[1]]
    if not obj.label.symmetry.axial:
        return rotations
    return [
        rotation
        for i, rotation in enumerate(rotations)
        if not any(np.allclose(rotation[:, 0], other[:, 0]) for other in rotations[:i])
    ]
