"""Moving a drawer or door with the hand on it: the hand may turn about what it touches on the way.

A hand that holds the bar of a door's handle need not turn with the door: the bar turns in its grip. So
a way is a sequence of openings, each with a tilt of the hand about the bar, or about the joint's axis
where the hand pushes. Inverse kinematics for all of them at once, then the shortest way through the
solutions, layer by layer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from jaxtyping import Float, Int

from manipose_mj.control.grasping.candidates import MIN_DEXTERITY
from manipose_mj.control.motion.batch_ik import forward, seeds_for, solve
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.motion.trajectory import Timing, timed
from manipose_mj.control.scene.articulation import joint_motion, with_part_at
from manipose_mj.control.scene.collision_query import CONTACT, Clearance, CollisionQuery
from manipose_mj.control.scene.scene_estimate import PartEstimate
from manipose_mj.mjcf.panda.reachability import is_reachable
from manipose_mj.tasks.articulated.hand_places import chained

# Between layers: of the joint [rad or m], of any arm joint [rad], of the tilt [rad].
_LAYER = {"hinge": 0.12, "slide": 0.05}
_MAX_TURN = 0.5
_MAX_TILT_STEP = 0.36
_TILT_PRICE = 0.3  # of a tilt against arm joints, both [rad]
_MAX_CHAINS = 12  # looked at in full
_FINE = 6  # poses between layers
_CHECK_EVERY = 2  # of those, for collision
_DUPLICATE = 0.05  # solutions nearer than this are one [rad]
_BACKED_OFF = 0.07  # where an open hand must be free that has let go of a handle [m]
_JERK = 0.25  # largest step of any arm joint between fine poses [rad]
# Of the hand that comes to a handle.
APPROACH = replace(CONTACT, arm=0.002, target=0.0)
_PROMISE_LAYERS, _PROMISE_STEPS = 10, 2
_TIMING = Timing(speed=0.35, linear_speed=0.12)


class Hold(Protocol):
    """A way to touch a part.

    Attributes: tilts: of the hand that it allows [rad]; straight: tilt at which it is not askew [rad]; askew_price: of
    each pose with another, against arm joints, both [rad]; opening: of the gripper meanwhile [m]; opening_before: of
    the gripper as it comes [m].
    """

    @property
    def tilts(self) -> Float[np.ndarray, "n"]: ...

    @property
    def straight(self) -> float: ...

    @property
    def askew_price(self) -> float: ...

    @property
    def opening(self) -> float: ...

    @property
    def opening_before(self) -> float: ...

    def tcp_poses(self, tilts: Float[np.ndarray, "k"]) -> Float[np.ndarray, "k 4 4"]:
        """`T_part_tcp` at these tilts."""
        ...


@dataclass(frozen=True)
class PartWay:
    """A way to move a part.

    Attributes:
      hold: How the hand touches it.
      joints: `(n, 7)`, of the arm [rad], densely.
      openings: `(n,)`, of the part's joint [rad or m].
      tilts: `(n,)`, of the hand [rad].
    """

    hold: Hold
    joints: Float[np.ndarray, "n 7"]
    openings: Float[np.ndarray, "n"]
    tilts: Float[np.ndarray, "n"]

    def targets(self, timestep: float) -> Float[np.ndarray, "t 7"]:
        """Joint targets, one a control step."""
        places = forward(self.joints)[0][:, :3, 3]
        lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
        return timed(self.joints, timestep, _TIMING, lengths=lengths)


@dataclass(frozen=True)
class _Layer:
    """Solutions at one opening: joints `(m, 7)`, tilts `(m,)`."""

    joints: Float[np.ndarray, "m 7"]
    tilts: Float[np.ndarray, "m"]


def find_way(
    planner: MotionPlanner,
    part: PartEstimate,
    hold: Hold,
    opening: float,
    *,
    near: Float[np.ndarray, "7"],
    start: Float[np.ndarray, "7"] | None = None,
    clearance: Clearance = CONTACT,
) -> PartWay | None:
    """The shortest way from the part's opening towards another, as far as the arm can.

    Args:
      planner: Plans in the scene of the estimate.
      part: What is to be moved.
      hold: How.
      opening: Where to [m or rad].
      near: A configuration near which to start [rad].
      start: The configuration at the start, where the hand is there already, straight [rad].
      clearance: How near the hand may be to the part and to what is around it meanwhile.

    Returns:
      The way, which may end short of `opening`; None if there is none at all.
    """
    count = max(2, round(abs(opening - part.opening) / _LAYER[part.joint.kind]) + 1)
    openings = np.linspace(part.opening, opening, count)
    layers = _layers(planner, part, hold, openings, near, clearance)
    if start is not None:
        layers[0] = _Layer(start[None], np.array([hold.straight]))
    askew = [hold.askew_price * np.abs(layer.tilts - hold.straight) for layer in layers]
    broken: set[tuple[int, int, int]] = set()
    kept: list[int] = []
    for _ in range(_MAX_CHAINS):
        chain = _shortest(layers, near, broken, askew)
        if len(chain) <= len(kept):
            break
        way = _refined(planner, part, hold, layers, chain, openings, clearance)
        if isinstance(way, PartWay):
            return way
        # It breaks after so many layers: look for another way through there.
        broken.add((way, chain[way], chain[way + 1]))
        kept = max(kept, chain[: way + 1], key=len)
    way = (
        _refined(planner, part, hold, layers, kept, openings, clearance) if len(kept) > 1 else None
    )
    return way if isinstance(way, PartWay) else None


def promise(part: PartEstimate, hold: Hold, opening: float) -> float:
    """How much of the way to `opening` the table of reachability has poses for; cheap, blind to collisions."""
    tilts = hold.tilts
    local = hold.tcp_poses(tilts)
    openings = np.linspace(part.opening, opening, _PROMISE_LAYERS)
    moved = np.stack([part.base_pose @ joint_motion(part, float(q)) for q in openings])
    reached = chained(is_reachable(moved[:, None] @ local[None])[None], _PROMISE_STEPS)
    return float(reached[0].any(axis=1).mean() + 0.01 * reached[0].mean())


def _layers(
    planner: MotionPlanner,
    part: PartEstimate,
    hold: Hold,
    openings: Float[np.ndarray, "k"],
    near: Float[np.ndarray, "7"],
    clearance: Clearance,
) -> list[_Layer]:
    """Solutions free of collision, layer by layer."""
    tilts = hold.tilts
    local = hold.tcp_poses(tilts)
    moved = [part.base_pose @ joint_motion(part, q) for q in openings]
    targets = np.concatenate([pose @ local for pose in moved])
    seeds = np.concatenate([seeds_for(targets), np.tile(near, (1, len(targets), 1))])
    joints, solved = solve(targets, seeds)
    _, jacobian = forward(joints.reshape(-1, 7))
    least = np.linalg.eigvalsh(jacobian @ jacobian.transpose(0, 2, 1))[:, 0].reshape(solved.shape)
    solved &= least > MIN_DEXTERITY**2
    layers = []
    touching = CollisionQuery(clearance, opening=hold.opening, target=part.geoms)
    coming = CollisionQuery(APPROACH, opening=hold.opening_before, target=part.geoms)
    for k, q in enumerate(openings):
        own, angles = [], []
        moved_planner = planner.within(with_part_at(planner.scene, part, float(q)))
        for j, tilt in enumerate(tilts):
            column = k * len(tilts) + j
            for s in _distinct(joints[:, column], solved[:, column]):
                # The hand comes with its fingers open and has to fit around what it takes.
                opens = k == 0 and hold.opening_before > hold.opening
                if opens and moved_planner.collides(joints[s, column], coming):
                    continue
                if not moved_planner.collides(joints[s, column], touching):
                    own.append(joints[s, column])
                    angles.append(tilt)
        layer = _Layer(np.array(own).reshape(-1, 7), np.array(angles))
        if hold.opening_before > hold.opening and k in (0, len(openings) - 1):
            layer = _with_room_behind(moved_planner, layer, coming)
        layers.append(layer)
    return layers


def _with_room_behind(planner: MotionPlanner, layer: _Layer, query: CollisionQuery) -> _Layer:
    """Those from which the open hand has room to back off, by where it would be then; all where none has."""
    if not len(layer.joints):
        return layer
    back = np.stack([planner.backed_off(joints, _BACKED_OFF) for joints in layer.joints])
    joints, solved = solve(back, layer.joints[None])
    room = np.array(
        [ok and not planner.collides(q, query) for q, ok in zip(joints[0], solved[0], strict=True)]
    )
    return _Layer(layer.joints[room], layer.tilts[room]) if room.any() else layer


def _distinct(joints: Float[np.ndarray, "s 7"], solved: np.ndarray) -> list[int]:
    kept: list[int] = []
    for s in np.flatnonzero(solved):
        if all(np.abs(joints[s] - joints[t]).max() > _DUPLICATE for t in kept):
            kept.append(int(s))
    return kept


def _shortest(
    layers: list[_Layer],
    near: Float[np.ndarray, "7"],
    broken: set[tuple[int, int, int]],
    askew: list[np.ndarray],
) -> list[int]:
    """Index into every layer of the cheapest chain that reaches farthest.

    Args:
      layers: Of solutions.
      near: A configuration near which to start [rad].
      broken: Layers, with an index into each and into the next, that nothing leads between.
      askew: What the tilts of each layer cost, `(m,)` each.
    """
    if not len(layers[0].joints):
        return []
    cost = 0.3 * np.abs(layers[0].joints - near).max(axis=1) + askew[0]
    before: list[Int[np.ndarray, "m"]] = []
    for k, (one, two) in enumerate(zip(layers, layers[1:], strict=False)):
        if not len(two.joints):
            break
        turn = np.abs(two.joints[:, None] - one.joints[None]).max(axis=2)
        tilt = np.abs(two.tilts[:, None] - one.tilts[None])
        step = np.where(
            (turn < _MAX_TURN) & (tilt < _MAX_TILT_STEP), turn + _TILT_PRICE * tilt, np.inf
        )
        for layer, i, j in broken:
            if layer == k:
                step[j, i] = np.inf
        total = step + cost[None] + askew[k + 1][:, None]
        if not np.isfinite(total).any():
            break
        before.append(total.argmin(axis=1))
        cost = total.min(axis=1)
    chain = [int(np.argmin(cost))]
    for parents in reversed(before):
        chain.append(int(parents[chain[-1]]))
    return chain[::-1]


def _refined(
    planner: MotionPlanner,
    part: PartEstimate,
    hold: Hold,
    layers: list[_Layer],
    chain: list[int],
    openings: Float[np.ndarray, "k"],
    clearance: Clearance,
) -> PartWay | int:
    """The chain with poses in between; or after how many of its steps it breaks."""
    knots = np.arange(len(chain))
    fine = np.linspace(0, len(chain) - 1, _FINE * (len(chain) - 1) + 1)
    coarse = np.stack([layers[k].joints[i] for k, i in enumerate(chain)])
    tilts = np.interp(fine, knots, [layers[k].tilts[i] for k, i in enumerate(chain)])
    values = np.interp(fine, knots, openings[: len(chain)])
    seeds = np.stack([np.interp(fine, knots, column) for column in coarse.T], axis=1)
    local = hold.tcp_poses(tilts)
    targets = np.stack(
        [
            part.base_pose @ joint_motion(part, q) @ pose
            for q, pose in zip(values, local, strict=True)
        ]
    )
    solutions, solved = solve(targets, seeds[None])
    joints, solved = solutions[0], solved[0]
    jumps = np.append(False, np.abs(np.diff(joints, axis=0)).max(axis=1) > _JERK)
    bad = ~solved | jumps
    bad[0] = False  # the start is what it is
    touching = CollisionQuery(clearance, opening=hold.opening, target=part.geoms)
    for i in range(_CHECK_EVERY, len(fine), _CHECK_EVERY):
        if bad[: i + 1].any():
            break
        moved = planner.within(with_part_at(planner.scene, part, float(values[i])))
        bad[i] = moved.collides(joints[i], touching)
    if bad.any():
        return int(np.ceil(fine[int(np.argmax(bad))])) - 1
    joints[0] = coarse[0]
    return PartWay(hold, joints, values, tilts)
