"""Ours or a library's? Four places where either would do, each measured: python benchmarks/experiments/library_choices.py.

Needs `pip install ompl jsonschema msgspec` beside the package; what is missing is left out.
"""

from __future__ import annotations

import copy
import json
import logging
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import tyro

from manipose_mj import suite
from manipose_mj.control.motion import free_motion, motion_planner
from manipose_mj.control.planning.plan import plan_from_json, plan_schema
from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.episode import run_episode
from manipose_mj.mjcf.panda.kinematics import POSITION_LIMITS
from manipose_mj.ppf_jax.rigid.network import Dense
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

TASKS = (
    "single_object/target_pose_shelf",
    "articulated/store_middle_drawer",
    "articulated/take_out_cabinet_door",
)
POSE = [0.5, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0]
# What language models and people get wrong in a plan.
BROKEN: dict[str, Any] = {
    "a misspelt primitive": [{"primitive": "grasp", "subject": "object"}],
    "an object that is not there": [{"primitive": "grasp_at", "subject": "objekt"}],
    "a move without a place": [{"primitive": "move_to", "subject": "object"}],
    "a move with two": [
        {"primitive": "move_to", "subject": "object", "poses": [POSE], "opening": 0.1}
    ],
    "a pose of six numbers": [{"primitive": "move_to", "subject": "object", "poses": [POSE[:6]]}],
    "a quaternion of length 2": [
        {"primitive": "move_to", "subject": "object", "poses": [[*POSE[:3], 2.0, 0.0, 0.0, 0.0]]}
    ],
    "an unknown field": [{"primitive": "release", "subject": "object", "force": 3}],
    "no list": {"primitive": "release", "subject": "object"},
}


def main(starts: int = 2) -> None:
    """Print what each alternative does.

    Args:
      starts: Frozen starts of each task whose free paths are planned.
    """
    logging.getLogger("absl").setLevel(logging.ERROR)
    _free_paths(starts)
    _checked_plans()
    _affine_maps()
    _copied_models()


def _free_paths(starts: int) -> None:
    """Every free path of some episodes, planned by our RRT-Connect and by OMPL's, with the same collision checker."""
    try:
        from ompl import util
    except ImportError:
        print("ompl: not installed\n")
        return
    util.noOutputHandler()
    ours = free_motion.plan_path
    rows: list[tuple[Any, Any]] = []

    def both(start, goal, collides, rng):
        straight = free_motion.edge_is_free(start, goal, collides, 0.025)
        counted = _Counted(collides)
        begin = time.perf_counter()
        path = ours(start, goal, counted, rng)
        own = (path, counted.calls, time.perf_counter() - begin)
        if not straight:
            rows.append((own, _by_ompl(start, goal, collides)))
        return path

    motion_planner.plan_path = both
    try:
        for task in TASKS:
            for number in range(starts):
                asked = protocol.load("v1").episode(task, number).asked
                config = EnvConfig(task, obs_mode="state", split="test")
                run_episode(config, EpisodeSpec(**asked), episode=number)
    finally:
        motion_planner.plan_path = ours
    print(f"free paths that are not straight: {len(rows)}")
    print("| planner | found | collision checks | time [ms] | length [rad] |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for i, name in enumerate(("ours", "OMPL RRT-Connect, 1,500 iterations, simplified")):
        found = [row[i] for row in rows if row[0][0] is not None and row[1][0] is not None]
        print(
            f"| {name} | {sum(row[i][0] is not None for row in rows)} of {len(rows)} "
            f"| {median(each[1] for each in found):.0f} | {1e3 * median(each[2] for each in found):.0f} "
            f"| {median(_length(each[0]) for each in found):.2f} |"
        )
    print()


def _by_ompl(start: np.ndarray, goal: np.ndarray, collides: Callable[[np.ndarray], bool]) -> Any:
    from ompl import base, geometric, util

    space = base.RealVectorStateSpace(7)
    bounds = base.RealVectorBounds(7)
    for i, (low, high) in enumerate(POSITION_LIMITS):
        bounds.setLow(i, float(low))
        bounds.setHigh(i, float(high))
    space.setBounds(bounds)
    information = base.SpaceInformation(space)
    counted = _Counted(collides)
    information.setStateValidityChecker(lambda s: not counted(np.array([s[i] for i in range(7)])))
    information.setStateValidityCheckingResolution(0.025 / space.getMaximumExtent())
    information.setup()
    problem = base.ProblemDefinition(information)
    ends = information.allocState(), information.allocState()
    for i in range(7):
        ends[0][i], ends[1][i] = float(start[i]), float(goal[i])
    problem.setStartAndGoalStates(*ends)
    util.RNG.setSeed(1)  # says that it comes too late, and is heeded
    planner = geometric.RRTConnect(information)
    planner.setRange(free_motion.FreeMotionConfig.step)
    planner.setProblemDefinition(problem)
    planner.setup()
    iterations = iter(range(free_motion.FreeMotionConfig.max_nodes))
    begin = time.perf_counter()
    planner.solve(base.PlannerTerminationCondition(lambda: next(iterations, None) is None))
    if not problem.hasExactSolution():
        return None, counted.calls, time.perf_counter() - begin
    path = problem.getSolutionPath()
    simplifier = geometric.PathSimplifier(information)
    simplifier.reduceVertices(path)
    simplifier.ropeShortcutPath(path)
    points = np.array([[state[i] for i in range(7)] for state in path.getStates()])
    return points, counted.calls, time.perf_counter() - begin


class _Counted:
    """A collision checker that counts its calls."""

    def __init__(self, collides: Callable[[np.ndarray], bool]) -> None:
        self._collides = collides
        self.calls = 0

    def __call__(self, joints: np.ndarray) -> bool:
        self.calls += 1
        return self._collides(joints)


def _length(path: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _checked_plans() -> None:
    """What each checker says of broken plans."""
    subjects = {"object", "top_drawer"}
    checkers: dict[str, Callable[[Any], Any]] = {
        "ours": lambda plan: plan_from_json(json.dumps(plan), subjects)
    }
    try:
        import jsonschema

        best = jsonschema.Draft202012Validator(plan_schema(subjects))

        def by_schema(plan: Any) -> None:
            error = jsonschema.exceptions.best_match(best.iter_errors(plan))
            if error is not None:
                raise ValueError(f"{error.json_path}: {error.message}")

        checkers["jsonschema"] = by_schema
    except ImportError:
        print("jsonschema: not installed")
    try:
        import msgspec

        step = msgspec.defstruct(
            "Step",
            [
                ("primitive", Any),
                ("subject", str),
                ("poses", list[list[float]], ()),
                ("opening", float | None, None),
            ],
            forbid_unknown_fields=True,
        )
        checkers["msgspec"] = lambda plan: msgspec.json.decode(json.dumps(plan), type=list[step])
    except ImportError:
        print("msgspec: not installed")
    print("| broken plan | " + " | ".join(checkers) + " |")
    print("| --- |" + " --- |" * len(checkers))
    for name, plan in BROKEN.items():
        said = []
        for check in checkers.values():
            try:
                check(plan)
                said.append("(accepted)")
            except (InputError, ValueError) as error:
                said.append(str(error).replace("|", "/")[:150])
        print(f"| {name} | " + " | ".join(said) + " |")
    print()


def _affine_maps() -> None:
    """Our affine map of the last axis and `equinox.nn.Linear`, mapped over the axes before, compiled."""
    rng = np.random.default_rng(0)
    own = Dense(64, 64, rng=rng)
    theirs = eqx.nn.Linear(64, 64, key=jax.random.key(0))
    theirs = eqx.tree_at(lambda m: (m.weight, m.bias), theirs, (own.weight.T, own.bias))
    x = jnp.asarray(rng.normal(size=(256, 24, 64)), jnp.float32)
    functions = {
        "ours": jax.jit(lambda x: own(x)),
        "equinox.nn.Linear": jax.jit(lambda x: jax.vmap(jax.vmap(theirs))(x)),
    }
    difference = max(
        float(jnp.abs(functions["ours"](x) - each(x)).max()) for each in functions.values()
    )
    times = {name: [] for name in functions}
    for _ in range(50):
        for name, function in functions.items():
            begin = time.perf_counter()
            function(x).block_until_ready()
            times[name].append(1e6 * (time.perf_counter() - begin))
    print(
        ", ".join(f"{name}: {median(each):.0f} us" for name, each in times.items())
        + f"; largest difference {difference:.1e}\n"
    )


def _copied_models() -> None:
    """How long a private copy of a scene's model takes, which casting rays would need at every look."""
    env = suite.load("articulated", "store_middle_drawer", seed=0)
    env.reset()
    model = env.physics.model.ptr
    times = []
    for _ in range(20):
        begin = time.perf_counter()
        copy.copy(model)
        times.append(1e3 * (time.perf_counter() - begin))
    print(f"copy of the model of store_middle_drawer: {median(times):.1f} ms")


if __name__ == "__main__":
    tyro.cli(main)
