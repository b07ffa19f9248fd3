"""How far a part is open, from points of its front."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.opened_part import seen_open
from manipose_mj.control.furniture.opening_search import as_held, found_opening, misfit
from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.control.furniture.shapes.boxes import no_boxes
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.control.furniture.shapes.handle_shape import handle_label
from manipose_mj.poses import compose, invert, transform

FRONT = 0.2
PANEL = np.array([[0.18, -0.2, 0.1], [FRONT, 0.2, 0.25]])
TURN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def plane(low, high, step: float = 0.006) -> np.ndarray:
    """Noisy points of a box without a third side."""
    axes = [
        np.arange(a, b, step) if b - a > 1e-9 else np.array([a])
        for a, b in zip(low, high, strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return points + np.random.default_rng(0).normal(0, 0.0015, points.shape)


def bar() -> np.ndarray:
    return plane([FRONT + 0.03, -0.06, 0.17], [FRONT + 0.036, 0.06, 0.182], 0.003)


def a_part(kind: str) -> PartModel:
    front = plane([FRONT, -0.2, 0.1], [FRONT, 0.2, 0.25])
    points = np.concatenate([front, bar()])
    label, seen = handle_label(points, compose(TURN, np.array([FRONT + 0.03, 0.01, 0.174])), FRONT)
    assert seen
    axis, origin = np.array([1.0, 0.0, 0.0]), label.origin
    if kind == "hinge":
        axis, origin = np.array([0.0, 0.0, -1.0]), np.array([FRONT, -0.2, 0.17])
    joint = Joint(kind, origin, axis, (0.0, 0.32 if kind == "slide" else 1.8))
    return PartModel(
        MovingPart("it", joint, label, None), PANEL.copy(), no_boxes(), 0.0, 0.9, points
    )


def test_a_bar_is_as_long_and_where_its_points_are():
    handle = a_part("slide").part.handle
    assert handle is not None
    np.testing.assert_allclose(handle.origin, [FRONT + 0.032, 0.0, 0.176], atol=0.004)
    assert handle.extents[0] == pytest.approx(0.12, abs=0.01)


@pytest.mark.parametrize(("kind", "truth", "off", "most"), [
    ("slide", 0.30, 0.02, 0.004), ("slide", 0.0, 0.05, 0.004), ("hinge", 1.2, 0.3, 0.05)
])  # fmt: skip
def test_an_opening_is_found_near_where_the_hand_left_the_part(kind, truth, off, most):
    part = a_part(kind)
    points = transform(part.motion(truth), part.looks)
    assert found_opening(part.at(truth + off), points) == pytest.approx(truth, abs=most)


@pytest.mark.parametrize(("kind", "truth", "left"), [("hinge", 0.25, 1.7), ("slide", 0.02, 0.3)])
def test_what_the_arm_has_swept_along_is_found_anywhere(kind, truth, left):
    part = a_part(kind)
    points = transform(part.motion(truth), part.looks)
    assert found_opening(part.at(left), points) == pytest.approx(truth, abs=0.01)
    # But what fits nowhere well is where it was: it is out of sight.
    other = plane([FRONT - 0.1, -0.2, 0.1], [FRONT - 0.1, 0.2, 0.25])
    assert found_opening(part.at(left), other) == left


@pytest.mark.parametrize(("truth", "left", "before"), [(0.0, 0.0, 1.2), (1.2, 1.2, 0.0)])
def test_what_stands_still_by_the_hinge_does_not_keep_a_door_where_it_was(truth, left, before):
    part = a_part("hinge")
    still = plane([FRONT, -0.2, 0.1], [FRONT + 0.06, -0.19, 0.25], 0.003)
    taken_for_it = transform(invert(part.motion(1.2)), still)
    own = part.looks[:: max(1, round(3 * len(part.looks) / len(still)))]
    assert len(own) < 0.4 * len(still)
    polluted = replace(part, looks=np.concatenate([taken_for_it, own])[_shuffled(still, own)])
    points = np.concatenate([transform(part.motion(truth), part.looks), still])
    found = found_opening(polluted.at(left), points, before=before)
    assert found == pytest.approx(truth, abs=0.06)


def _shuffled(*parts: np.ndarray) -> np.ndarray:
    return np.random.default_rng(0).permutation(sum(map(len, parts)))


@pytest.mark.parametrize(("assumed", "found"), [(0.302, 0.302), (0.27, 0.30), (0.0, 0.30)])
def test_what_nobody_touched_is_where_it_was_if_it_fits_there(assumed, found):
    part = a_part("slide")
    points = transform(part.motion(0.30), part.looks)
    tree = cKDTree(points)
    seen = found_opening(part.at(assumed), points, before=0.30, tree=tree, touched=False)
    assert seen == pytest.approx(found, abs=1e-9 if assumed == found else 0.004)


def test_a_drawer_that_is_open_shows_its_floor_and_sides():
    part, opening = a_part("slide").at(0.25), 0.25
    floor = plane([FRONT - opening, -0.18, 0.12], [0.18, 0.18, 0.12])
    side = plane([FRONT - opening, -0.18, 0.12], [0.18, -0.18, 0.22])
    other = side * [1, -1, 1]
    front = plane([FRONT, -0.2, 0.1], [FRONT, 0.2, 0.25])
    ways = ([0, 0, 1], [0, 1, 0], [0, -1, 0], [1, 0, 0])
    shut = [floor, side, other, front]
    normals = np.concatenate(
        [np.tile(way, (len(p), 1)).astype(float) for way, p in zip(ways, shut, strict=True)]
    )
    points = np.concatenate(shut) + [opening, 0, 0]
    model = FurnitureModel(np.eye(4), no_boxes(), (part,), "cabinet")
    found = seen_open(model, part, SceneCloud(points, normals, np.ones(len(points), int)))
    assert found.seen_inside and found.part.cavity is not None
    low = found.part.cavity.center - found.part.cavity.extents / 2
    high = found.part.cavity.center + found.part.cavity.extents / 2
    np.testing.assert_allclose(low[1:], [-0.18, 0.12], atol=0.008)
    assert high[1] == pytest.approx(0.18, abs=0.008)
    assert low[0] == pytest.approx(FRONT - opening, abs=0.01)


def test_a_door_behind_the_arm_is_not_gone():
    part = a_part("hinge").at(1.5)
    part = replace(part, looks=np.random.default_rng(0).permutation(part.looks))
    # The arm hides most of the door; where it would be less open, a shelf's edge is seen.
    placed = transform(part.motion(1.5), part.looks)
    decoy = transform(part.motion(1.15), part.looks)
    edge = decoy[part.looks[:, 2] < np.percentile(part.looks[:, 2], 35)]
    points = np.concatenate([placed[::80], edge])

    def hidden(points: np.ndarray) -> np.ndarray:
        return cKDTree(placed).query(points)[0] < 0.03

    assert found_opening(part, points) < 1.3
    assert found_opening(part, points, hidden) == pytest.approx(1.5, abs=0.05)


def test_a_push_that_moved_nothing_is_noticed():
    part = a_part("hinge")
    points = transform(part.motion(1.4), part.looks)
    assert found_opening(part.at(0.0), points) == 0.0
    assert found_opening(part.at(0.0), points, before=1.5) == pytest.approx(1.4, abs=0.05)


@pytest.mark.parametrize("opening", [0.0, 0.05, 0.083, 0.15])
def test_a_door_that_is_not_quite_shut_is_measured_by_its_tilt(opening):
    part = a_part("hinge")
    seen = transform(part.motion(opening), part.looks)
    seen = seen + np.random.default_rng(1).normal(0, 0.001, seen.shape)
    # Its body, beside and behind it.
    body = plane([FRONT - 0.004, -0.3, 0.0], [FRONT - 0.004, 0.3, 0.1])
    found = found_opening(part.at(0.0), np.concatenate([seen, body]))
    assert found == pytest.approx(opening, abs=0.012)


def test_a_door_fits_best_as_it_stands():
    door = a_part("hinge")
    seen = transform(door.motion(1.5), door.looks)
    fits = [misfit(door.at(opening), seen) for opening in (1.3, 1.45, 1.5, 1.55, 1.7)]
    assert int(np.argmin(fits)) == 2
    turned = replace(
        door, part=replace(door.part, joint=replace(door.part.joint, origin=np.zeros(3)))
    )
    assert misfit(turned.at(1.5), seen) > 2 * misfit(door.at(1.5), seen)


def knob(y: float, z: float, panel: np.ndarray) -> PartModel:
    """A part that was found by its handle, and the front that it was thought to shut."""
    part = a_part("hinge")
    assert part.part.handle is not None
    handle = replace(part.part.handle, origin=np.array([FRONT + 0.03, y, z]))
    return replace(part, panel=panel, part=replace(part.part, name="knob", handle=handle))


@pytest.mark.parametrize("asked", [(), ("knob",)])
def test_what_an_open_door_shut_is_no_front_of_a_knob_beside_it(asked):
    door = a_part("hinge")
    over = np.array([[0.18, -0.2, 0.1], [FRONT, 0.05, 0.35]])
    above, beside = knob(0.0, 0.3, over), knob(0.3, 0.2, over + [[0, 0.45, 0], [0, 0.45, 0]])
    model = FurnitureModel(np.eye(4), np.zeros((0, 2, 3)), (door, above), "oven")
    left = model.without_fronts_over(door, asked)
    assert [part.name for part in left.parts] == ["it", "knob"]
    np.testing.assert_allclose(left.parts[1].panel, [[0.18, -0.2, 0.25], [FRONT, 0.05, 0.35]])
    # One that is not over the door stays.
    model = replace(model, parts=(door, beside))
    assert model.without_fronts_over(door, asked).parts == (door, beside)


def test_a_part_found_on_an_open_door_is_gone_unless_it_is_asked_for():
    door, on = a_part("hinge"), knob(0.0, 0.2, PANEL.copy())
    model = FurnitureModel(np.eye(4), np.zeros((0, 2, 3)), (door, on), "oven")
    assert model.without_fronts_over(door, ()).parts == (door,)
    assert model.without_fronts_over(door, ("knob",)).parts == (door, on)


@pytest.mark.parametrize(("kind", "opening"), [("slide", 0.15), ("hinge", 0.5)])
def test_a_part_whose_handle_the_hand_holds_is_as_open_as_the_hand_has_it(kind, opening):
    part = a_part(kind)
    handle = part.part.handle
    assert handle is not None
    place = transform(part.motion(opening), handle.origin[None])[0] + [0.0, 0.004, 0.0]
    assert as_held(part, place).opening == pytest.approx(opening, abs=0.02)
    # Fingers may be anywhere along a bar: what was seen stands.
    seen = part.at(opening)
    beside = transform(part.motion(opening), handle.origin[None] + [[0.0, 0.05, 0.0]])[0]
    assert as_held(seen, beside).opening == opening
    # A hand that is nowhere near it tells nothing.
    assert as_held(part, place + [0.0, 0.0, 0.4]).opening == 0.0
