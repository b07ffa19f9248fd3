"""Leading a drawer or door by its handle where the joint is an estimate: the hand follows it and corrects it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from manipose_mj.control.execution.executor import Action, Actions, Executor
from manipose_mj.control.grasping.part_motion import PartWay
from manipose_mj.control.grasping.part_pick import HELD, ending_free, way_in_hand
from manipose_mj.control.motion.batch_ik import forward
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.scene.scene_estimate import PartEstimate, SceneEstimate
from manipose_mj.failures import StageFailure

_EVERY = 4  # control steps between looks at where the hand is
_BESIDE = 0.004  # how far the hand may be beside its path before the joint is corrected [m]
# Up and down with a drawer, which slides level: the pull lifts the hand by some millimetres.
_LIFTED = 0.012
# Way after which the joint is corrected whatever it is [m], and how often: fingers that are led astray slide on a bar, and
# tell nothing any more.
_FIRST, _AT_FIRST = 0.02, 4
_STUCK = 0.030  # how far the hand may stay behind its path [m]
_STILL = 0.0015  # and move meanwhile, in a quarter of a second [m]
_PATIENCE = 12  # control steps
# By how much the gripper closes as it loses the handle: between two looks [m], since it closed on it [m], and the same as
# a share of its opening then. A bar that is not round is of another width as it turns in the grip.
_SLIPS, _SLIPPED, _SLIPPED_SHARE = 0.002, 0.003, 0.4
_MOST = 14  # corrections
_FURTHER = {"slide": 1.35, "hinge": 1.15}  # of what is asked for: how far a part opens is a guess
_BEYOND_SHUT = {"slide": 0.008, "hinge": 0.08}  # how far a part is led that shall be shut [m, rad]
_ENOUGH = {
    "slide": 0.35,
    "hinge": 0.25,
}  # of it, from which on a stop is the end of the part's range


@dataclass
class _Trace:
    """Attributes: path: `T_world_tcp`; width: of the gripper once it had closed on the handle [m];
    last_width: the same at the last look [m]; stopped: whether the part went no further."""

    path: list[np.ndarray]
    width: float
    last_width: float
    stopped: bool = False

    def slips(self, width: float) -> bool:
        """Whether a gripper that is open so far [m] by now loses the handle."""
        most = max(_SLIPPED, _SLIPPED_SHARE * self.width)
        slips = self.last_width - width > _SLIPS or self.width - width > most
        self.last_width = width
        return slips


def lead_part(executor: Executor, planner: MotionPlanner, name: str, opening: float) -> Actions:
    """Lead a part that the hand holds towards an opening, and beyond while it goes.

    Small steps, after each of which the joint is fitted to the way that the hand went; the arm then gives way to
    where the part has led it.

    Args:
      executor: Of actions.
      planner: Says what to assume.
      name: Of the part.
      opening: Where to [m or rad].

    Raises:
      StageFailure: The hand cannot lead it on, far from the opening.
    """
    estimate = executor.observe()
    width = executor.opening()
    trace = _Trace([_tcp(executor.joints())], width, width)
    started = estimate.parts[name].opening
    for count in range(_MOST):
        part = estimate.parts[name]
        way = _way(planner.within(estimate.scene), estimate, part, started, opening)
        if way is None:
            break
        hinge = part.joint.kind == "hinge"
        short = count < (_AT_FIRST if hinge else 1)
        heeded = np.array([1.0, 1.0, 1.0 if hinge else _BESIDE / _LIFTED])
        done = yield from _follow(executor, way, trace, short, heeded)
        executor.feel(name, np.array(trace.path), trace.stopped)
        yield from executor.relax()
        estimate = executor.observe()
        if done or trace.stopped:
            break
    reached = estimate.parts[name].opening
    asked = opening - started
    share = (reached - started) / asked if asked else 1.0
    if share < _ENOUGH[estimate.parts[name].joint.kind]:
        raise StageFailure(
            "motion", f"{name} is at {reached:.3f} of {opening:.3f}, the hand leads it no further"
        )


def _way(
    planner: MotionPlanner,
    estimate: SceneEstimate,
    part: PartEstimate,
    started: float,
    opening: float,
) -> PartWay | None:
    """As far beyond the opening as a part may go, or as the arm can."""
    beyond = started + _FURTHER[part.joint.kind] * (opening - started)
    if opening <= part.joint.range[0]:
        beyond = opening - _BEYOND_SHUT[part.joint.kind]
    if abs(beyond - part.opening) < 0.01:
        return None
    way = way_in_hand(planner, estimate, part, beyond, HELD)
    return None if way is None else ending_free(planner, part, way, HELD)


def _follow(
    executor: Executor, way: PartWay, trace: _Trace, short: bool, heeded: Float[np.ndarray, "3"]
) -> Iterator[Action]:
    """Go along a way until it ends, the hand leaves it, or goes no further; a `short` piece of it at most.

    `heeded` are the weights of how far the hand is off its way, along x, y and z.

    Returns:
      Whether it came to the end.
    """
    targets = way.targets(executor.timestep)
    places = forward(targets)[0][:, :3, 3]
    begun = trace.path[-1][:3, 3]
    recent: list[np.ndarray] = []
    for step, target in enumerate(targets):
        yield executor.send(target)
        if step % _EVERY:
            continue
        now = _tcp(executor.joints())
        if trace.slips(executor.opening()):
            # It slips off what goes no further.
            trace.path = trace.path[:-1] if len(trace.path) > 2 else trace.path
            trace.stopped = True
            return False
        trace.path.append(now)
        place = now[:3, 3]
        recent = [*recent, place][-(_PATIENCE // _EVERY) - 1 :]
        beside = float(np.linalg.norm(heeded * (places[: step + 1] - place), axis=1).min())
        behind = float(np.linalg.norm(places[step] - place))
        still = len(recent) > _PATIENCE // _EVERY and _reach(recent) < _STILL
        if behind > _STUCK and still:
            trace.stopped = True
            return False
        if beside > _BESIDE or (short and float(np.linalg.norm(place - begun)) > _FIRST):
            return False
    for _ in range(_PATIENCE):
        yield executor.command
    trace.path.append(_tcp(executor.joints()))
    return True


def _reach(points: list[np.ndarray]) -> float:
    return float(np.linalg.norm(np.array(points) - points[0], axis=1).max())


def _tcp(joints: Float[np.ndarray, "7"]) -> Float[np.ndarray, "4 4"]:
    return forward(joints[None])[0][0]
