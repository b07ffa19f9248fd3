"""Under `jit` and `vmap`, worlds with different objects, goals and parts answer as each does by itself."""

from __future__ import annotations

from dataclasses import make_dataclass, replace
from typing import Literal

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from manipose_mj.poses import SymmetryGroup, compose
from manipose_mj.tasks.goals import (
    InsideGoal,
    OnTableGoal,
    OpenGoal,
    OrientationGoal,
    PoseGoal,
    ShutGoal,
    TakenOutGoal,
    Tolerance,
    UprightGoal,
    reward,
    success,
)
from manipose_mj.tasks.pytrees import register
from manipose_mj.tasks.scene.indices import find_indices, shapes_of
from manipose_mj.tasks.scene.read import PhysicsArrays, read
from manipose_mj.tasks.scene.reader import arrays
from manipose_mj.tasks.scene.state import ObjectState, PartState, SceneState
from tests.few_objects import load

TOLERANCE = Tolerance()
MEMBERS = 8
SYMMETRIES = (
    SymmetryGroup.identity(),
    SymmetryGroup.about_x(),
    SymmetryGroup.about_x(ends_alike=True),
    SymmetryGroup.two_planes(),
    SymmetryGroup.three_planes(),
)
KINDS = ("pose", "orientation", "upright", "inside", "taken out", "drawer", "on table")
WORLDS = 96


def stacked(worlds: list):
    """Trees of one structure as one tree with a leading axis."""
    return jax.tree.map(lambda *leaves: np.stack([np.asarray(leaf) for leaf in leaves]), *worlds)


def padded(state: SceneState) -> SceneState:
    """The same state with room for the largest symmetry group, so that worlds can be stacked."""
    objects = {
        name: replace(obj, symmetry=obj.symmetry.padded(MEMBERS))
        for name, obj in state.objects.items()
    }
    return replace(state, objects=objects)


def random_pose(rng: np.random.Generator, spread: float = 0.3) -> np.ndarray:
    rotation = Rotation.random(rng=rng).as_matrix()
    return compose(rotation, rng.uniform(-spread, spread, 3))


def near(rng: np.random.Generator, pose: np.ndarray) -> np.ndarray:
    """The pose itself, or one that is off by some of the tolerance or by much."""
    scale = rng.choice([0.0, 0.5, 2.0, 20.0])
    turn = Rotation.from_rotvec(scale * rng.uniform(-0.1, 0.1, 3)).as_matrix()
    return compose(turn @ pose[:3, :3], pose[:3, 3] + scale * rng.uniform(-0.01, 0.01, 3))


def world(seed: int) -> tuple[SceneState, dict[str, tuple]]:
    """A state and goals of every kind; many are met, many all but met."""
    rng = np.random.default_rng(seed)
    goal, cavity = random_pose(rng), random_pose(rng)
    goal[2, 3] = cavity[2, 3] = rng.uniform(0.05, 0.3)
    symmetry = SYMMETRIES[seed % len(SYMMETRIES)]
    member = symmetry.rotations[rng.integers(len(symmetry.rotations))]
    where = rng.integers(3)
    pose = near(rng, (goal @ compose(member, np.zeros(3)), cavity, random_pose(rng))[where])
    if rng.random() < 0.3:  # upright
        pose[:3, :3] = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
    speeds = np.full(2, rng.choice([0.0, 0.005, 0.005, 0.5]))
    low, length = rng.uniform(-0.1, 0.1), rng.uniform(0.1, 1.5)
    obj = ObjectState(
        extents=rng.uniform(0.02, 0.2, 3),
        symmetry=symmetry,
        label_pose=pose,
        linear_speed=speeds[0],
        angular_speed=speeds[1],
        touched=np.asarray(rng.random() < 0.3),
        held=np.asarray(rng.random() < 0.3),
        center=rng.uniform(-0.02, 0.02, 3),
    )
    part = PartState(
        range=np.array([low, low + length]),
        cavity_extents=rng.uniform(0.1, 0.5, 3),
        has_cavity=np.asarray(rng.random() < 0.8),
        opening=low + length * rng.choice([0.0, 0.01, 0.5, 0.85, 1.0]),
        handle_pose=random_pose(rng),
        cavity_pose=cavity,
        touched=np.asarray(False),
    )
    scene = SceneState(random_pose(rng), np.asarray(0.04), {"object": obj}, {"part": part})
    fraction = rng.uniform(0.3, 0.95)
    goals = {
        "pose": (PoseGoal("object", goal),),
        "orientation": (OrientationGoal("object", goal[:3, :3]),),
        "upright": (UprightGoal("object"),),
        "inside": (InsideGoal("object", "part"), ShutGoal("part")),
        "taken out": (
            TakenOutGoal("object", "part", rng.uniform(-0.3, 0.3, 2), rng.uniform(0.05, 0.4, 2)),
            ShutGoal("part", fraction),
        ),
        "drawer": (OpenGoal("part", fraction),),
        "on table": (OnTableGoal("object"), PoseGoal("object", goal)),
    }
    return scene, goals


WORLDS_AND_GOALS = [world(seed) for seed in range(WORLDS)]


@pytest.mark.parametrize(
    ("kind", "how"),
    [*((kind, "vmap") for kind in KINDS), ("pose", "batch"), ("taken out", "batch")],
)
def test_success_and_rewards_are_those_of_each_world(kind, how):
    def all_three(goals, state):
        return (
            success(goals, state, TOLERANCE),
            reward(goals, state, TOLERANCE, "sparse"),
            reward(goals, state, TOLERANCE, "dense"),
        )

    goals = stacked([goals[kind] for _, goals in WORLDS_AND_GOALS])
    states = stacked([padded(state) for state, _ in WORLDS_AND_GOALS])
    found = jax.jit(jax.vmap(all_three) if how == "vmap" else all_three)(goals, states)
    singles = [all_three(goals[kind], state) for state, goals in WORLDS_AND_GOALS]
    for own, expected in zip(found, zip(*singles, strict=True), strict=True):
        assert own.shape == (WORLDS,)
        np.testing.assert_allclose(own, np.array(expected, float), rtol=0, atol=1e-5)


def test_the_worlds_differ_in_what_they_answer():
    for kind in KINDS:
        rewards = [reward(goals[kind], s, TOLERANCE, "dense") for s, goals in WORLDS_AND_GOALS]
        assert 0 < rewards.count(1.0) < WORLDS and np.ptp(rewards) > 0.2, kind


@jax.jit
@jax.vmap
def _dense(goals, state):
    return reward(goals, state, TOLERANCE, "dense")


@settings(deadline=None, max_examples=40)
@given(st.lists(st.integers(0, 10**6), min_size=4, max_size=4))
def test_any_worlds_side_by_side_get_the_reward_of_each(seeds):
    worlds = [world(seed) for seed in seeds]
    goals = stacked([goals["inside"] for _, goals in worlds])
    found = _dense(goals, stacked([padded(state) for state, _ in worlds]))
    single = [float(reward(g["inside"], s, TOLERANCE, "dense")) for s, g in worlds]
    # Within 1e-5 of a threshold single precision may answer differently.
    clear = [_clear(s) for s, _ in worlds]
    np.testing.assert_allclose(np.array(found)[clear], np.array(single)[clear], rtol=0, atol=1e-5)


def _clear(state: SceneState) -> bool:
    """Whether the object is clearly in the cavity or clearly not, for any rounding."""
    part, obj = state.parts["part"], state.objects["object"]
    answers = {
        bool(InsideGoal("object", "part").met(_grown(state, obj, part, by), TOLERANCE))
        for by in (-1e-5, 0.0, 1e-5)
    }
    return len(answers) == 1


def _grown(state: SceneState, obj: ObjectState, part: PartState, by: float) -> SceneState:
    still = replace(
        obj, linear_speed=np.zeros(()), angular_speed=np.zeros(()), touched=np.asarray(False)
    )
    larger = replace(part, cavity_extents=part.cavity_extents + by)
    return replace(state, objects={"object": still}, parts={"part": larger})


def test_own_goals_are_registered_by_their_annotations():
    goal = OpenGoal("part", np.array([0.3, 0.5]))
    register(OpenGoal)  # a second time changes nothing
    leaves, structure = jax.tree.flatten(goal)
    assert len(leaves) == 1 and jax.tree.unflatten(structure, leaves).part == "part"


@pytest.mark.parametrize("written", [False, True])
def test_names_and_numbers_of_own_goals_are_no_arrays_however_they_are_annotated(written):
    kinds = {"object": str, "count": int, "high": bool, "part": str | None, "also": tuple[str, ...]}
    kinds |= {"how": Literal["in", "on"]}
    told = {"object": "str", "count": "int"} if written else {}
    annotated = [(name, told.get(name, kind)) for name, kind in kinds.items()]
    cls = make_dataclass("Lifted", [*annotated, ("at", np.ndarray)], frozen=True)
    register(cls)
    leaves = jax.tree.leaves(cls("a", 2, True, None, ("b",), "in", np.zeros(3)))
    assert len(leaves) == 1 and leaves[0].shape == (3,)


@pytest.fixture(scope="module")
def scenes():
    """Two environments with other objects, at the start of an episode."""
    environments = [load("articulated", "store_middle_drawer", seed) for seed in (0, 1)]
    for environment in environments:
        environment.reset()
    return environments


def test_reading_many_worlds_reads_each(scenes):
    task, physics = scenes[0].task, scenes[0].physics
    indices = find_indices(physics, task.robot, task.objects, task.articulated_objects)
    shapes = shapes_of(list(task.objects.values()), task.articulated_objects)
    rng, single = np.random.default_rng(0), []
    robot = int(np.flatnonzero(indices.owners == 0)[0])
    pads = [int(np.flatnonzero(indices.owners == pad)[0]) for pad in (1, 2)]
    own = [int(np.flatnonzero(indices.owners == owner)[0]) for owner in indices.owned]
    pairs = ([robot, own[0]], [own[-1], pads[0]], [pads[0], own[0]], [own[0], pads[1]], own[:2])
    base, worlds, kinds = arrays(physics), [], []
    for i in range(8):
        chosen = np.array([pairs[k] for k in rng.integers(len(pairs), size=4)])
        valid = rng.random(4) < 0.5
        data = PhysicsArrays(
            qpos=base.qpos + rng.normal(size=base.qpos.shape),
            qvel=rng.normal(size=base.qvel.shape),
            xpos=base.xpos + rng.normal(size=base.xpos.shape),
            xmat=Rotation.random(len(base.xmat), rng=rng).as_matrix(),
            site_xpos=base.site_xpos,
            site_xmat=base.site_xmat,
            contact_geoms=chosen,
            contact_valid=valid,
        )
        kind = replace(
            shapes,
            frames=shapes.frames @ random_pose(rng),
            extents=shapes.extents * rng.uniform(0.5, 2.0),
            symmetries=tuple(SYMMETRIES[i % 5].padded(MEMBERS) for _ in shapes.symmetries),
            ranges=shapes.ranges * rng.uniform(0.5, 2.0),
        )
        worlds.append(data)
        kinds.append(kind)
        single.append(
            read(indices, kind, data._replace(contact_geoms=chosen[valid], contact_valid=None))
        )
    many = stacked(worlds), stacked(kinds)
    read_all = jax.jit(jax.vmap(lambda kind, data: read(indices, kind, data)))
    for found in (read_all(many[1], many[0]), read(indices, many[1], many[0])):
        jax.tree.map(
            lambda a, b: np.testing.assert_allclose(a, b, rtol=0, atol=1e-5), found, stacked(single)
        )
    touched = [bool(state.objects["object"].touched) for state in single]
    assert 0 < sum(touched) < len(touched)


def test_the_reader_reads_what_the_simulator_says(scenes):
    for task, physics in ((each.task, each.physics) for each in scenes):
        state = task.scene_state(physics)
        entity = task.objects["object"]
        label_pose = entity.label_pose(physics)
        np.testing.assert_allclose(state.objects["object"].label_pose, label_pose, atol=1e-12)
        np.testing.assert_allclose(state.tcp_pose, task.robot.tcp_pose(physics), atol=0)
        for entity, part in ((e, p) for e in task.articulated_objects for p in e.asset.parts):
            joint = physics.bind(entity.joint(part.name))
            assert state.parts[part.name].opening == joint.qpos
            assert tuple(state.parts[part.name].range) == tuple(part.joint.range)
            assert bool(state.parts[part.name].has_cavity) is (part.cavity is not None)
