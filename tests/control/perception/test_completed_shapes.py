"""Objects of which no like is known: cut into convex parts, completed and found symmetric by what is seen of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull, cKDTree

from manipose_mj import suite
from manipose_mj.assets.visible_shapes import surface, visible_shapes
from manipose_mj.control.perception.estimated import EstimatedPerception
from manipose_mj.control.perception.objects.completed_shape import (
    completed_shape,
    convex_parts,
    looked_through,
    stable_rests,
)
from manipose_mj.control.perception.objects.estimated_symmetry import estimated_symmetry
from manipose_mj.control.perception.objects.object_kinds import object_kind
from manipose_mj.control.perception.pose_sources import sensors_for
from manipose_mj.poses import compose, invert, pose_error, transform
from manipose_mj.tasks.core.config import EnvConfig


def block(lengths: tuple[float, float, float], count: int, rng: np.random.Generator) -> np.ndarray:
    """Random points of the surface of a block about the origin [m]."""
    half = np.array(lengths) / 2
    points = rng.uniform(-half, half, (count, 3))
    axis = rng.integers(3, size=count)
    rows = np.arange(count)
    points[rows, axis] = half[axis] * rng.choice([-1.0, 1.0], count)
    return points


def environment_with(name: str):
    config = EnvConfig(
        "single_object/target_pose",
        obs_mode="state",
        objects=(name,),
        sensors=sensors_for("estimated"),
    )
    environment = suite.make(config, 1)
    environment.reset()
    return environment


@pytest.mark.parametrize(
    ("shift", "size", "center"),
    [(0.0, 0.1, 1.0), (1e9, 0.1, 1e9), (1e9, 1e9, 0.0), (0.0, 1e-6, 0.1), (0.0, 1e6, 5e5)],
    ids=["center outside", "far", "huge", "tiny", "center on a face"],
)
def test_rests_are_found_wherever_the_centre_of_mass_is(shift, size, center):
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size / 2
    rests = stable_rests(corners + [shift, 0.0, 0.0], np.array([center, 0.0, 0.0]))
    assert rests
    assert all(np.isfinite(rest.rotation).all() for rest in rests)


def test_what_is_not_convex_is_cut_where_it_saves_volume():
    rng = np.random.default_rng(0)
    leg = block((0.02, 0.02, 0.10), 400, rng)
    foot = block((0.10, 0.02, 0.02), 400, rng) + [0.04, 0.0, -0.06]
    parts = convex_parts(np.concatenate([leg, foot]))
    volume = sum(ConvexHull(part).volume for part in parts)
    assert 1 < len(parts) <= 8
    assert volume < 0.6 * ConvexHull(np.concatenate([leg, foot])).volume
    assert len(convex_parts(leg)) == 1
    (flat,) = convex_parts(leg * [1.0, 1.0, 0.0])
    assert 0.001 < np.ptp(flat[:, 2]) < 0.003


@pytest.mark.parametrize(
    ("lengths", "turns"), [((0.06, 0.06, 0.06), 24), ((0.12, 0.06, 0.06), 8), ((0.12, 0.08, 0.05), 4)]
)  # fmt: skip
def test_turns_that_nobody_can_tell_apart_are_symmetries(lengths, turns):
    rng = np.random.default_rng(0)
    every = block(lengths, 6000, rng)
    seen = every[(every @ [0.5, 0.3, 0.8] > 0.0)][:600] + rng.normal(0, 0.0005, (600, 3))
    center = np.zeros(3)
    found = estimated_symmetry("mirror", seen, every, center, lambda _: 0.0)
    assert len(found.rotations) == turns and not found.axial
    through = estimated_symmetry("mirror", seen, every, center, lambda _: 0.01)
    assert len(through.rotations) == 1, "a turn to where cameras look through is none"
    knob = block((0.02, 0.02, 0.04), 300, rng) + [lengths[0] / 2, 0.0, 0.0]
    one_end = estimated_symmetry(
        "mirror", np.concatenate([seen, knob]), np.concatenate([every, knob]), center, lambda _: 0.0
    )
    assert (one_end.rotations[:, 0, 0] > 0.5).all(), "its X has one sign"


def test_a_kind_is_told_by_category_and_outside_the_catalogue_by_type():
    environment = environment_with("cup_004")
    asset = environment.task.object.asset
    assert object_kind(asset).in_catalogue
    flat = replace(asset, label=replace(asset.label, object_type="mirror"))
    assert object_kind(flat).object_type == "axial", "the catalogue's type, whatever the object is"
    other = object_kind(replace(flat, category="beaker"))
    assert (other.category, other.object_type, other.in_catalogue) == ("beaker", "mirror", False)


def test_an_object_of_another_kind_is_estimated_and_completed(monkeypatch):
    environment = environment_with("cup_004")
    cup = environment.task.object
    truth, asset = cup.label_pose(environment.physics), cup.asset
    monkeypatch.setattr(cup, "asset", replace(asset, category="beaker"))
    perception = EstimatedPerception(environment.task, environment.physics)
    perception.reset(0)
    found = perception.observe().objects["object"]
    assert found.category == "beaker" and len(found.grasps) > 20 and found.rests
    shift, turn = pose_error(found.label_pose, truth, asset.label.symmetry)
    assert shift < 0.02 and np.sin(float(turn)) < np.sin(np.deg2rad(15.0)), (
        "its ends may be taken for each other"
    )
    assert found.label.symmetry.axial and "kinds" in perception.sources
    shape = perception._known["object"].shape
    true = surface(visible_shapes(asset.folder)).sample(1000, seed=0)
    true = transform(cup.object_pose(environment.physics), np.asarray(true, float))
    off = cKDTree(transform(found.label_pose, shape.surface)).query(true)[0]
    assert off.mean() < 0.006


def test_a_plane_of_symmetry_that_is_wrong_is_looked_through():
    environment = environment_with("toy_car_004")
    car = environment.task.object
    perception = EstimatedPerception(environment.task, environment.physics)
    views = perception._views.of(environment.physics, "object")
    right = car.label_pose(environment.physics)
    wrong = right @ compose(np.eye(3), np.array([0.0, 0.0, 0.03]))
    points = np.concatenate([view.points_world for view in views])
    through = [looked_through("mirror", pose, points, views) for pose in (right, wrong)]
    assert through[0] < 0.0005 < 0.002 < through[1]
    shape = completed_shape("vehicle", "mirror", right, views)
    np.testing.assert_allclose(shape.extents, car.asset.label.extents, atol=0.012)
    assert shape.misfit(transform(invert(right), points)) < 0.002
