"""Where on the table an object may rest: label poses that a goal or a placement on the way allows."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import StablePose
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.collision_query import CONTACT
from manipose_mj.control.scene.scene_estimate import ObjectEstimate
from manipose_mj.mjcf.panda.robot import HOME
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.scene.overhang import lifts_with_room, poses_over_edge
from manipose_mj.tasks.scene.resting import placements_joining

UP = np.array([0.0, 0.0, 1.0])
# An object is let go this high above the table [m].
DROP_HEIGHT = 0.002
# Of the label's origin, best first: where the arm works most easily [m].
PLACES = tuple(
    (x, y) for x, y in (
        (0.48, 0.0), (0.46, 0.2), (0.46, -0.2), (0.58, 0.1), (0.58, -0.1), (0.40, 0.32),
        (0.40, -0.32), (0.36, 0.1), (0.36, -0.1),
    )
)  # fmt: skip
YAWS = tuple(float(yaw) for yaw in np.linspace(-np.pi, np.pi, 8, endpoint=False))
_UPRIGHT = 0.97  # cosine to the vertical from which on a rest counts as upright
_SETTLES = (
    0.02,
    np.deg2rad(15.0),
)  # how far from a pose at rest what is asked for may seem to be [m, rad]
# Cosine between verticals from which on one rest tips into the other.
_SHALLOW = np.cos(np.deg2rad(30.0))
_SAME_REST = 0.995  # cosine between verticals from which on two rests are one


def resting_rotation(obj: ObjectEstimate, rest: StablePose, yaw: float) -> Float[np.ndarray, "3 3"]:
    """`R_world_label` in a stable pose, turned about the vertical."""
    return rotation_about(UP, yaw) @ rest.rotation @ obj.label.rotation


def resting_height(obj: ObjectEstimate, rotation: Float[np.ndarray, "3 3"]) -> float:
    """Of the label's origin above the table when the label is turned as `rotation` [m].

    That of the stable pose with the same side down; without one, by the bounding box.
    """
    index = rest_of(obj, rotation)
    if index is None:
        return float(obj.label.reach(rotation)[2])
    rest = obj.rests[index]
    return rest.height + float(rest.rotation[2] @ obj.label.origin)


def rest_of(obj: ObjectEstimate, rotation: Float[np.ndarray, "3 3"]) -> int | None:
    """Index of the stable pose with the side down that is down when the label is turned so."""
    down = rotation[2] @ obj.label.rotation.T
    alike = [float(rest.rotation[2] @ down) for rest in obj.rests]
    return int(np.argmax(alike)) if alike and max(alike) > _SAME_REST else None


def _is_shallow(obj: ObjectEstimate, rotation: Float[np.ndarray, "3 3"]) -> bool:
    """Whether the rest with this side down is so near to another that a drop of millimetres tips the object over.

    Nobody knows that of a shape that is estimated: its rests are its kind's.
    """
    index = rest_of(obj, rotation)
    if index is None or obj.uncertainty > 0:
        return False
    ups = np.stack([rest.rotation[2] for rest in obj.rests])
    near = ups @ ups[index] > _SHALLOW
    return int(near.sum()) > 1


def poses_with_rotation(
    obj: ObjectEstimate, rotation: Float[np.ndarray, "3 3"]
) -> tuple[Float[np.ndarray, "4 4"], ...]:
    """`T_world_label` all over the table, turned as `rotation`, nearest to the object first."""
    height = resting_height(obj, rotation)
    if not _is_shallow(obj, rotation):
        height += DROP_HEIGHT
    own = obj.label_pose[:2, 3]
    order = sorted(PLACES, key=lambda place: float(np.linalg.norm(np.array(place) - own)))
    return tuple(compose(rotation, np.array([x, y, height])) for x, y in order)


def poses_at_edge(
    obj: ObjectEstimate, rotation: Float[np.ndarray, "3 3"]
) -> tuple[tuple[Float[np.ndarray, "4 4"], ...], ...]:
    """`T_world_label` over the table's edge, from where the object sinks until it is turned as `rotation`.

    In groups, those first from where it sinks least.
    None where grasps that are clear of the table lead there, or where it is not known which side is down.
    """
    now, then = rest_of(obj, obj.label_pose[:3, :3]), rest_of(obj, rotation)
    if now is None or then is None or placements_joining(obj.grasps.clear, 1)[now, then] >= 0:
        return ()
    poses = poses_over_edge(obj.label, rotation)
    poses[..., 2, 3] += DROP_HEIGHT
    lifts = lifts_with_room(obj.label, rotation, obj.grasps, now)
    return tuple(tuple(poses[lift]) for lift in lifts)


def settled(obj: ObjectEstimate, label_pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
    """The pose next to `label_pose` in which an object of a guessed frame lies still on what it lies on now.

    What is asked for is a pose at rest. An estimate that is some degrees off would have one end in the table there.
    """
    now = _nearest_rest(obj, obj.label_pose[:3, :3])
    then = _nearest_rest(obj, label_pose[:3, :3])
    if now is None or then is None:
        return label_pose
    heights = [rest.height + float(rest.rotation[2] @ obj.label.origin) for rest in (now, then)]
    up = obj.label.rotation.T @ then.rotation[2]  # of the world, in the label's frame
    asked = label_pose[2, :3]
    axis = np.cross(asked, up)
    angle = np.arctan2(np.linalg.norm(axis), asked @ up)
    turn = np.eye(3) if angle < 1e-6 else rotation_about(axis / np.linalg.norm(axis), -angle)
    found = compose(label_pose[:3, :3] @ turn, label_pose[:3, 3].copy())
    height = obj.label_pose[2, 3] - heights[0] + heights[1] + DROP_HEIGHT
    if abs(height - label_pose[2, 3]) < _SETTLES[0]:
        found[2, 3] = height
    return found


def _nearest_rest(obj: ObjectEstimate, rotation: Float[np.ndarray, "3 3"]) -> StablePose | None:
    """The stable pose that a label turned so is nearest to, if it is near."""
    down = rotation[2] @ obj.label.rotation.T
    best = max(obj.rests, key=lambda rest: float(rest.rotation[2] @ down), default=None)
    near = best is not None and float(best.rotation[2] @ down) > np.cos(_SETTLES[1])
    return best if near else None


def upright_poses(obj: ObjectEstimate) -> tuple[Float[np.ndarray, "4 4"], ...]:
    """`T_world_label` all over the table with the label's X up, turned every way about it."""
    rests = [r for r in obj.rests if (r.rotation @ obj.label.rotation)[2, 0] > _UPRIGHT]
    upright = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    turns = YAWS[:1] if obj.label.symmetry.axial else YAWS
    rotations = [
        resting_rotation(obj, rests[0], yaw) if rests else rotation_about(UP, yaw) @ upright
        for yaw in turns
    ]
    by_turn = [poses_with_rotation(obj, rotation) for rotation in rotations]
    # Every turn at the first place, then at the second: no turn is left out of the first few.
    return tuple(pose for at_place in zip(*by_turn, strict=True) for pose in at_place)


def is_free(
    planner: MotionPlanner,
    obj: ObjectEstimate,
    label_pose: Float[np.ndarray, "4 4"],
    joints: Float[np.ndarray, "7"] = HOME,
) -> bool:
    """Whether the object would touch nothing but its support there, the arm at `joints` [rad]."""
    return not planner.collides(joints, obj.placed_at(label_pose).query(CONTACT))
