"""Taking a drawer or door by its handle so that it can be moved all the way, or a fair share of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.control.grasping.handle_grasps import Grip, GripKind, grip_now, grips
from manipose_mj.control.grasping.part_motion import APPROACH, PartWay, find_way
from manipose_mj.control.grasping.retreat import HANDLE_RETREATS
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.articulation import with_part_at
from manipose_mj.control.scene.collision_query import CONTACT, Clearance, CollisionQuery
from manipose_mj.control.scene.scene_estimate import PartEstimate, SceneEstimate
from manipose_mj.failures import StageFailure

_STANDOFFS = (0.10, 0.07, 0.05)  # from which a handle is approached [m]
# A grip that moves a part by less than this share of what is asked is of no use; a door is pushed
# the rest of the way.
_MIN_SHARE = {"hinge": 0.35, "slide": 0.98}
_AJAR = 0.5  # of a door, enough to reach behind it [rad]
# A way that ends sooner is worth it where none goes on: the hand takes hold again from there [m or rad].
_STAGE = {"hinge": 0.2, "slide": 0.04}
_STEP_BACK = 6  # poses of a way
_ALONG_HINGE = 0.9  # cosine between what the hand tilts about and a door's hinge, at least
_MAX_TRIES = 12  # ways for which an approach is looked for
# How much wider than usual the gripper is open as it comes to a handle that may be beside its estimate, the first that there
# is room for [m].
_WIDER = (0.030, 0.020, 0.010)
_EVERY = 4  # poses of a path, of which one is looked at
# A hand that holds a handle is where the estimate may have the handle itself.
HELD = replace(CONTACT, arm=-0.004, target=-0.02)
# How a handle is taken, the first that will do; in stages what slipped out of a usual grip is to be held better.
_KINDS: tuple[GripKind, ...] = ("usual", "fingertips")
_FIRM_KINDS: tuple[GripKind, ...] = ("deep", *_KINDS, "aside")


@dataclass(frozen=True)
class HandleGrip:
    """How to take a handle: joint targets to where the approach starts, and along it; the
    gripper's opening on approach, and its expected one once closed [m]."""

    free_path: Float[np.ndarray, "t 7"]
    approach: Float[np.ndarray, "s 7"]
    opening: float
    width: float


def grip_handle(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    part: PartEstimate,
    opening: float | None,
    *,
    in_stages: bool = False,
    following: bool = False,
) -> HandleGrip:
    """A grip of the handle that can be approached and moves the part as far as any, and get off there.

    Args:
      planner: Plans in the scene of the estimate.
      estimate: What is where.
      part: What to take.
      opening: Where it shall go [m or rad]; None: nobody knows yet.
      in_stages: Knobs are to be held deeper than usual, even if that leads less far; bars may be held anywhere.
      following: The same, and rather such that the hand turns with a door: its joint is an estimate, and a knob slips out
        of fingers that are led beside its way.

    Raises:
      StageFailure: None moves it by a fair share of the way.
    """
    anywhere = opening is None
    if opening is None:
        low, high = part.joint.range
        opening = high if part.opening - low < high - part.opening else low

    def best_first(way: PartWay) -> tuple[float, bool, float]:
        share = share_of(way, part, opening)
        return -round(share, 1), following and not _turns_along(way, part), _turned(way)

    ways: list[PartWay] = []
    shut_in: list[PartWay] = []
    kinds = _FIRM_KINDS if in_stages or following else _KINDS
    wide = any(hold.askew_price for hold in grips(part))
    for askew, kind in product((False, True) if wide else (False,), kinds):
        led = (
            find_way(planner, part, hold, opening, near=estimate.joints)
            for hold in (_turning(hold) if askew else hold for hold in grips(part, kind))
        )
        held = [
            way
            for way in led
            if way is not None and (kind != "aside" or _closes_on(planner, part, way))
        ]
        free = [ending_free(planner, part, way) for way in held]
        shut_in += [way for way, end in zip(held, free, strict=True) if end is None]
        found = [way for way in free if way is not None]
        found.sort(key=best_first)
        ways += found
        far = [way for way in found if anywhere or leads_enough(way, part, opening)]
        grip = _approached(planner, estimate, part, far, wider=following)
        if grip is not None:
            return grip
    if following and not ways:
        # What is estimated may be off by as much as is missing for the hand to get off.
        freed = (ending_free(planner, part, way, HELD) for way in shut_in)
        ways = sorted((way for way in freed if way is not None), key=best_first)
    stages = [way for way in ways if is_a_stage(way, part)]
    grip = _approached(planner, estimate, part, stages, wider=following)
    if grip is not None:
        return grip
    raise StageFailure(
        "plan",
        f"no grip of {part.name}'s handle works: {len(stages)} could move it, none can be approached",
    )


def _turning(hold: Grip) -> Grip:
    """The same, where the hand may turn about a bar that pries its fingers open: if nothing else will do."""
    return replace(hold, askew_price=0.0)


def _closes_on(planner: MotionPlanner, part: PartEstimate, way: PartWay) -> bool:
    """Whether fingers that close where a way begins meet the part: a bent bar is not all where its middle is."""
    closed = CollisionQuery(CONTACT, opening=0.0, target=part.geoms)
    return bool(planner.obstacles(way.joints[0], closed)[part.geoms].any())


def _approached(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    part: PartEstimate,
    ways: list[PartWay],
    *,
    wider: bool,
) -> HandleGrip | None:
    """The first of the ways that the hand can come to; `wider`: with its fingers open as wide as there is room for."""
    # At low handles the wrist is within millimetres of the table: only if nothing else will do.
    for tight in (False, True):
        for way in ways[:_MAX_TRIES]:
            wide = way.hold.opening_before
            approach = _backwards(planner, part, way.joints[0], wide, _STANDOFFS)
            if approach is None:
                continue
            free_path = planner.free_path(
                estimate.joints, approach[0], CollisionQuery(opening=wide), tight=tight
            )
            if free_path is not None:
                if wider:
                    wide = _widest(planner, part, free_path, approach, wide)
                return HandleGrip(free_path, approach, wide, way.hold.opening)
    return None


def _widest(
    planner: MotionPlanner,
    part: PartEstimate,
    free_path: Float[np.ndarray, "t 7"],
    approach: Float[np.ndarray, "s 7"],
    opening: float,
) -> float:
    """How wide the gripper may be open on its way to a handle, at least so wide [m]."""
    for more in _WIDER:
        wide = min(opening + more, MAX_OPENING)
        free = CollisionQuery(opening=wide)
        near = CollisionQuery(APPROACH, opening=wide, target=part.geoms)
        if not any(planner.collides(joints, free) for joints in free_path[::_EVERY]) and not any(
            planner.collides(joints, near) for joints in approach[::_EVERY]
        ):
            return wide
    return opening


def way_in_hand(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    part: PartEstimate,
    opening: float,
    clearance: Clearance = CONTACT,
) -> PartWay | None:
    """The way to lead a part towards another opening by its handle, as the hand holds that now.

    It may end short of `opening` [m or rad]; None if there is none at all. `clearance` is how near the hand
    may be to the part and to what is around it.
    """
    hold = grip_now(part, planner.tcp_pose(estimate.joints), estimate.opening)
    for each in (hold, _turning(hold)) if hold.askew_price else (hold,):
        way = find_way(
            planner,
            part,
            each,
            opening,
            near=estimate.joints,
            start=estimate.joints,
            clearance=clearance,
        )
        if way is not None:
            return way
    return None


def ending_free(
    planner: MotionPlanner, part: PartEstimate, way: PartWay, clearance: Clearance = APPROACH
) -> PartWay | None:
    """As much of a grip's way as leads to where the open hand can back off; None if nowhere.

    `clearance` is how near it may be to the part and to what is around it then.
    """
    for count in range(len(way.openings), 1, -_STEP_BACK):
        shorter = PartWay(way.hold, way.joints[:count], way.openings[:count], way.tilts[:count])
        if _can_get_off(planner, part, shorter, clearance):
            return shorter
    return None


def share_of(way: PartWay, part: PartEstimate, opening: float) -> float:
    """How much of the way to `opening` it goes."""
    return float((way.openings[-1] - part.opening) / (opening - part.opening))


def leads_enough(way: PartWay, part: PartEstimate, opening: float) -> bool:
    """Whether a grip's way is of use towards `opening`: a push may do the rest of a door's."""
    share = share_of(way, part, opening)
    if share >= _MIN_SHARE[part.joint.kind]:
        return True
    return part.joint.kind == "hinge" and float(way.openings[-1] - part.opening) >= _AJAR


def is_a_stage(way: PartWay, part: PartEstimate) -> bool:
    """Whether a grip's way is worth letting go at its end and taking hold again."""
    return abs(float(way.openings[-1]) - part.opening) >= _STAGE[part.joint.kind]


def _turned(way: PartWay) -> float:
    """How much the arm turns on the way, with a price on starting tilted [rad]."""
    return float(np.abs(np.diff(way.joints, axis=0)).max(axis=1).sum() + 0.5 * abs(way.tilts[0]))


def _turns_along(way: PartWay, part: PartEstimate) -> bool:
    """Whether the hand can tilt about the axis that a door turns about; a drawer turns about none."""
    bar = way.hold.bar[:3, 0] if isinstance(way.hold, Grip) else part.joint.axis
    return part.joint.kind == "slide" or abs(float(bar @ part.joint.axis)) > _ALONG_HINGE


def _can_get_off(
    planner: MotionPlanner, part: PartEstimate, way: PartWay, clearance: Clearance
) -> bool:
    """Whether the open hand can back off from the handle at the end."""
    opening = way.hold.opening_before
    at_end = planner.within(with_part_at(planner.scene, part, float(way.openings[-1])))
    standoffs = (HANDLE_RETREATS[-1],)
    back = _backwards(at_end, part, way.joints[-1], opening, standoffs, clearance)
    return back is not None


def _backwards(
    planner: MotionPlanner,
    part: PartEstimate,
    joints: Float[np.ndarray, "7"],
    opening: float,
    standoffs: tuple[float, ...],
    clearance: Clearance = APPROACH,
) -> Float[np.ndarray, "t 7"] | None:
    """A straight approach along the hand's own axis, which ends at `joints`."""
    touched = frozenset({planner.body_name(part.body)})
    query = CollisionQuery(clearance, opening=opening, target=part.geoms)
    for standoff in standoffs:
        goal = planner.backed_off(joints, standoff)
        back = planner.line(joints, goal, query, touched=touched)
        if back is not None:
            return np.concatenate([back[::-1], joints[None]])
    return None
