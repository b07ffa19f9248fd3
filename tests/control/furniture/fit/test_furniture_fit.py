"""What is made of parts that were sensed not quite right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from manipose_mj.control.furniture.fit.furniture_fit import fit_furniture
from manipose_mj.control.furniture.sensing.part_sensing import SensedFurniture, SensedPart
from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.control.furniture.shapes.furniture_model import PartModel
from manipose_mj.control.furniture.shapes.handle_shape import ACROSS_FRONT, UP_FRONT, handle_label
from manipose_mj.poses import compose, rotation_about, transform
from tests.control.furniture.synthetic import FRONT, HALF, HEIGHT, body, cloud, door, rectangle

X, Y, Z = np.eye(3)


def sensed(kind: str, place: list[float], **changed) -> SensedPart:
    """A shut part with its handle there, an upright bar."""
    handle = compose(UP_FRONT, np.array(place))
    usual = {"origin": handle[:3, 3], "axis": X, "opening": 0.0, "confidence": 0.5}
    return SensedPart(**{"handle": handle, "kind": kind, **usual, **changed})


@pytest.mark.parametrize("thought", [1.5, 1.9])
def test_an_open_door_faces_where_its_panel_does(thought):
    """And so does its handle, which was taken to be as far open as was thought."""
    opening, origin = 1.7, np.array([FRONT, -HALF, 0.0])
    shut = np.array([FRONT + 0.05, -0.15 * HALF, 0.25])
    handle = rotation_about(-Z, opening) @ (shut - origin) + origin
    part = sensed(
        "hinge",
        [0.0, 0.0, 0.0],
        handle=compose(rotation_about(-Z, thought) @ UP_FRONT, handle),
        origin=origin,
        axis=-Z,
        opening=thought,
    )
    model = fit_furniture(
        cloud(body() + door(-HALF, opening, "outer inner")), SensedFurniture(X, (part,)), "cabinet"
    )
    assert model.parts[0].opening == pytest.approx(opening, abs=0.01)
    label = model.parts[0].part.handle
    assert label is not None
    np.testing.assert_allclose(label.rotation, UP_FRONT, atol=1e-6)


@pytest.mark.parametrize(("category", "turns"), [("cabinet", Z), ("oven", X)])
def test_where_nothing_has_knobs_what_turns_like_one_is_a_door(category, turns):
    parts = (sensed("hinge", [FRONT + 0.03, 0.05, 0.2]), sensed("slide", [FRONT + 0.03, -0.1, 0.2]))
    model = fit_furniture(cloud(body()), SensedFurniture(X, parts), category)
    axes = [np.abs(part.part.joint.axis) for part in model.parts if part.hinged]
    assert len(axes) == 1
    np.testing.assert_allclose(axes[0], turns, atol=1e-6)


def test_two_handles_do_not_take_up_one_place_though_their_drawers_are_open_by_different_ways():
    out = rectangle(np.array([FRONT + 0.25, -0.2, 0.2]), 0.4 * Y, 0.15 * Z, X)
    knob = rectangle(np.array([FRONT + 0.28, -0.015, 0.26]), 0.03 * Y, 0.03 * Z, X)
    place = [FRONT + 0.28, 0.0, 0.275]
    sure = sensed("slide", place, opening=0.25, confidence=0.6)
    other = sensed("slide", [*place[:2], 0.26], opening=0.19, confidence=0.2)
    below = sensed("slide", [FRONT + 0.03, 0.0, 0.05], confidence=0.5)
    model = fit_furniture(
        cloud([*body(), out, knob]), SensedFurniture(X, (sure, other, below)), "cabinet"
    )
    assert sorted(part.opening for part in model.parts) == pytest.approx([0.0, 0.25], abs=0.005)


def test_how_a_knob_is_turned_says_nothing():
    points, _ = rectangle(np.array([FRONT + 0.03, -0.012, 0.19]), 0.024 * Y, 0.024 * Z, X)
    askew = compose(rotation_about(X, 0.8) @ ACROSS_FRONT, np.array([FRONT + 0.03, 0.0, 0.2]))
    fine = np.repeat(points, 4, axis=0) + np.random.default_rng(1).normal(
        0, 1e-3, (4 * len(points), 3)
    )
    label, seen = handle_label(fine, askew, FRONT)
    assert seen
    assert label.extents[0] < 0.045
    np.testing.assert_allclose(label.rotation, ACROSS_FRONT)


def test_doors_side_by_side_are_told_apart_by_where_their_knobs_are():
    knobs = [
        rectangle(np.array([FRONT + 0.03, y - 0.01, 0.29]), 0.02 * Y, 0.02 * Z, X)
        for y in (-0.05, 0.05)
    ]
    # The estimates have one knob above the other, rather than beside it.
    parts = tuple(
        sensed("hinge", [FRONT + 0.03, y, z], origin=np.array([FRONT, 2 * HALF, 0.0]), axis=Z)
        for y, z in ((-0.035, 0.34), (0.035, 0.26))
    )
    model = fit_furniture(cloud([*body(), *knobs]), SensedFurniture(X, parts), "cabinet")
    assert len(model.parts) == 2
    for part in model.parts:
        own = -HALF if part.handle[:, :, 1].mean() < 0 else HALF
        assert part.part.joint.origin[1] == pytest.approx(own, abs=0.03)


def knob(y: float) -> tuple[np.ndarray, np.ndarray]:
    """Before the front, seen from ahead."""
    return rectangle(np.array([FRONT + 0.03, y - 0.012, 0.29]), 0.024 * Y, 0.024 * Z, X)


def surer(seen: SceneCloud, part: SensedPart) -> list[PartModel]:
    """Of what is made of one sensed part, that whose kind and place something other than a bump of the front tells."""
    model = fit_furniture(seen, SensedFurniture(X, (part,)), "cabinet")
    return [found for found in model.parts if found.confidence >= 0.15]


def test_the_other_knob_of_double_doors_is_found_though_it_was_not_sensed():
    part = sensed("hinge", [FRONT + 0.03, -0.035, 0.30])
    model = fit_furniture(
        cloud([*body(), knob(-0.035), knob(0.035)]), SensedFurniture(X, (part,)), "cabinet"
    )
    hinges = sorted(found.part.joint.origin[1] for found in model.parts)
    assert hinges == pytest.approx([-HALF, HALF], abs=0.03)
    for found in model.parts:
        np.testing.assert_allclose(np.abs(found.part.joint.axis), Z, atol=1e-6)


def test_a_handle_alone_has_no_twin_and_neither_has_a_drawer():
    alone = sensed("hinge", [FRONT + 0.03, -0.035, 0.30])
    assert len(surer(cloud([*body(), knob(-0.035)]), alone)) == 1
    drawer = sensed("slide", [FRONT + 0.03, -0.035, 0.30])
    pair = cloud([*body(), knob(-0.035), knob(0.035)])
    assert len(surer(pair, drawer)) == 1


def test_a_bar_that_shows_more_of_its_side_than_of_its_front_is_as_wide_as_its_front():
    bar = np.array([FRONT + 0.05, -0.007, 0.1])
    front, _ = rectangle(bar, 0.014 * Y, 0.15 * Z, X)
    side = [rectangle(bar + [-0.04, 0.014, 0.0], 0.04 * X, 0.15 * Z, Y)[0] for _ in range(4)]
    askew = compose(UP_FRONT, np.array([FRONT + 0.04, -0.006, 0.17]))
    label, seen = handle_label(np.concatenate([front, *side]), askew, FRONT)
    assert seen
    assert label.origin[1] == pytest.approx(0.0, abs=0.003)
    assert label.extents[2] == pytest.approx(0.014, abs=0.004)


def test_a_stray_point_between_two_knobs_makes_no_bar_of_them():
    stray = (np.array([[FRONT + 0.03, 0.0, 0.30]]), X[None])
    level = compose(ACROSS_FRONT, np.array([FRONT + 0.03, -0.03, 0.30]))
    part = sensed("hinge", [0.0, 0.0, 0.0], handle=level)
    dense = [
        (points + shift, normals)
        for points, normals in (knob(-0.03), knob(0.03))
        for shift in 0.001 * np.array([[0, a, b] for a in range(4) for b in range(4)])
    ]
    model = fit_furniture(cloud([*body(), *dense, stray]), SensedFurniture(X, (part,)), "cabinet")
    widths = [found.part.handle.extents[0] for found in model.parts if found.part.handle]
    assert len(widths) == 2
    assert max(widths) < 0.04


def test_a_handle_that_was_sensed_elsewhere_is_found_where_it_stands_out():
    part = sensed("hinge", [FRONT + 0.03, 0.1, 0.12], origin=np.array([FRONT, HALF, 0.0]), axis=Z)
    model = fit_furniture(cloud([*body(), knob(-0.1)]), SensedFurniture(X, (part,)), "cabinet")
    (found,) = model.parts
    assert found.part.handle is not None
    (place,) = transform(model.pose, found.part.handle.origin[None])
    np.testing.assert_allclose(place[1:], [-0.1, 0.30], atol=0.006)
    assert found.confidence == part.confidence
    unseen = fit_furniture(cloud(body()), SensedFurniture(X, (part,)), "cabinet")
    assert unseen.parts[0].confidence < 0.5 * part.confidence


def test_what_stands_out_of_a_frame_on_the_front_is_a_handle_and_the_frame_is_none():
    """As a bar on the frame of a glass door: of the pane, more shows than of the frame."""
    low, high, wide = -0.28, 0.28, 0.09
    pane = rectangle(np.array([FRONT, low + wide, 0.0]), (high - low - 2 * wide) * Y, HEIGHT * Z, X)
    frame = [
        rectangle(np.array([FRONT + 0.02, y, 0.0]), wide * Y, HEIGHT * Z, X)
        for y in (low, high - wide)
    ]
    fine = 0.002 * np.array([[0, a, b] for a in range(3) for b in range(3)])
    points, normals = rectangle(np.array([FRONT + 0.055, high - 0.05, 0.22]), 0.016 * Y, 0.2 * Z, X)
    upright = [(points + shift, normals) for shift in fine]
    part = sensed("hinge", [FRONT + 0.05, 0.1, 0.1], origin=np.array([FRONT, -HALF, 0.0]), axis=-Z)
    model = fit_furniture(
        cloud([pane, *body()[1:], *frame, *upright]), SensedFurniture(X, (part,)), "refrigerator"
    )
    (found,) = model.parts
    assert found.part.handle is not None
    (place,) = transform(model.pose, found.part.handle.origin[None])
    np.testing.assert_allclose(place[1:], [high - 0.042, 0.32], atol=0.008)
    assert found.part.handle.extents[0] == pytest.approx(0.2, abs=0.015)


def test_what_nobody_sensed_is_a_part_of_little_confidence_where_a_handle_stands_out():
    part = sensed("slide", [FRONT + 0.03, 0.0, 0.40], handle=compose(ACROSS_FRONT, np.zeros(3)))
    part.handle[:3, 3] = [FRONT + 0.03, 0.0, 0.40]
    model = fit_furniture(
        cloud([*body(), bar(0.40), knob(-0.2)]), SensedFurniture(X, (part,)), "cabinet"
    )
    other = min(model.parts, key=lambda each: each.confidence)
    assert other.confidence < 0.15
    assert other.part.handle is not None
    (place,) = transform(model.pose, other.part.handle.origin[None])
    np.testing.assert_allclose(place[1:], [-0.2, 0.302], atol=0.008)


@pytest.mark.parametrize("turn", [ACROSS_FRONT, ACROSS_FRONT * [-1.0, 1.0, -1.0]])
def test_a_cup_pull_that_was_sensed_elsewhere_keeps_its_side_up(turn):
    """Z of its handle is up or down, as it was sensed."""
    pull = rectangle(np.array([FRONT + 0.03, 0.03, 0.30]), 0.12 * Y, 0.014 * Z, X)
    handle = compose(turn, np.array([FRONT + 0.03, 0.0, 0.2]))
    part = sensed("slide", [0.0, 0.0, 0.0], handle=handle)
    model = fit_furniture(cloud([*body(), pull]), SensedFurniture(X, (part,)), "cabinet")
    label = model.parts[0].part.handle
    assert label is not None
    (place,) = transform(model.pose, label.origin[None])
    np.testing.assert_allclose(place[1:], [0.09, 0.307], atol=0.01)
    np.testing.assert_allclose(label.rotation, turn, atol=1e-6)


def test_a_bar_that_was_sensed_askew_is_level_or_upright():
    bar = rectangle(np.array([FRONT + 0.03, -0.006, 0.2]), 0.012 * Y, 0.12 * Z, X)
    askew = compose(rotation_about(X, 0.7) @ UP_FRONT, np.array([FRONT + 0.03, 0.0, 0.26]))
    part = sensed("slide", [FRONT + 0.03, 0.0, 0.26], handle=askew)
    model = fit_furniture(cloud([*body(), bar]), SensedFurniture(X, (part,)), "cabinet")
    label = model.parts[0].part.handle
    assert label is not None
    np.testing.assert_allclose(label.rotation, UP_FRONT, atol=1e-6)
    assert label.extents[0] == pytest.approx(0.12, abs=0.01)


def bar(height: float, middle: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A level one, before the front."""
    return rectangle(
        np.array([FRONT + 0.03, middle - 0.06, height - 0.006]), 0.12 * Y, 0.012 * Z, X
    )


@pytest.fixture
def drawer() -> SensedPart:
    return sensed("slide", [0.0, 0.0, 0.0], handle=level(0.25))


def level(height: float) -> np.ndarray:
    """A level handle before the front, `T_world_handle`."""
    return compose(ACROSS_FRONT, np.array([FRONT + 0.03, 0.0, height]))


def test_drawers_of_a_column_are_found_by_the_handle_of_one(drawer):
    unsure = replace(drawer, handle=level(0.10), confidence=0.1)
    bars = [bar(0.10), bar(0.25), bar(0.40)]
    model = fit_furniture(cloud([*body(), *bars]), SensedFurniture(X, (drawer, unsure)), "cabinet")
    heights = sorted(
        (transform(model.pose, found.part.handle.origin[None])[0, 2], found.confidence)
        for found in model.parts
        if found.part.handle
    )
    assert [height for height, _ in heights] == pytest.approx([0.10, 0.25, 0.40], abs=0.01)
    # Those that look like it are nearly as sure.
    assert [confidence for _, confidence in heights] == pytest.approx([0.4, 0.5, 0.4])


def test_what_is_beside_the_column_longer_or_without_a_front_around_it_is_no_drawer_of_it(drawer):
    moulding = rectangle(np.array([FRONT + 0.03, -HALF, 0.40]), 2 * HALF * Y, 0.012 * Z, X)
    for other in (bar(0.40, 0.15), moulding, bar(HEIGHT + 0.05)):
        found = cloud([*body(), bar(0.25), other])
        assert len(surer(found, drawer)) == 1
    column = cloud([*body(), bar(0.25), bar(0.40)])
    unsure = replace(drawer, confidence=0.2)
    assert len(surer(column, unsure)) == 1


@pytest.mark.parametrize(("tilt", "hinged"), [(0.5, 0), (0.0, 1)])
def test_what_has_a_drawers_handle_beside_it_slides_too_unless_its_hinge_is_a_doors(tilt, hinged):
    knobs = [
        rectangle(np.array([FRONT + 0.03, y - 0.012, 0.188]), 0.024 * Y, 0.024 * Z, X)
        for y in (0.15, -0.15)
    ]
    drawer = sensed("slide", [FRONT + 0.03, -0.15, 0.2])
    turn = rotation_about(X, tilt)
    beside = replace(
        sensed("hinge", [FRONT + 0.03, 0.15, 0.2]),
        origin=np.array([FRONT, 0.0, 0.2]),
        axis=-turn @ Z,
    )
    model = fit_furniture(cloud([*body(), *knobs]), SensedFurniture(X, (drawer, beside)), "cabinet")
    assert sum(part.hinged for part in model.parts) == hinged


def test_a_hinge_that_was_sensed_askew_is_upright_and_at_the_edge():
    way = rotation_about(X, 0.4) @ Z
    part = sensed("hinge", [FRONT + 0.03, -0.2, 0.3], origin=np.array([FRONT, 0.2, 0.3]), axis=way)
    (found,) = fit_furniture(
        cloud([*body(), knob(-0.2)]), SensedFurniture(X, (part,)), "cabinet"
    ).parts
    np.testing.assert_allclose(found.part.joint.axis, Z, atol=1e-6)
    assert found.part.joint.origin[1] == pytest.approx(HALF, abs=0.02)


def surest(seen: SceneCloud, parts: tuple[SensedPart, ...], category: str) -> PartModel:
    """What is made of sensed parts, the surest."""
    model = fit_furniture(seen, SensedFurniture(X, parts), category)
    return max(model.parts, key=lambda part: part.confidence)


def test_where_nothing_stands_out_nobody_has_a_neighbour():
    real = sensed("hinge", [FRONT + 0.03, -0.2, 0.3])
    phantom = sensed("hinge", [FRONT + 0.03, 0.0, 0.3], confidence=0.3)
    found = surest(cloud([*body(), knob(-0.2)]), (real, phantom), "cabinet")
    assert found.part.joint.origin[1] == pytest.approx(HALF, abs=0.03)
    assert found.panel[1, 1] == pytest.approx(HALF, abs=0.03)
    two = cloud([*body(), knob(-0.2), knob(0.1)])
    beside = replace(phantom, handle=compose(UP_FRONT, np.array([FRONT + 0.03, 0.1, 0.3])))
    found = surest(two, (real, beside), "cabinet")
    assert found.panel[1, 1] == pytest.approx(-0.05, abs=0.03)


def test_an_ovens_long_bar_is_no_knob():
    wide = rectangle(np.array([FRONT + 0.03, -0.2, 0.42]), 0.4 * Y, 0.012 * Z, X)
    part = sensed("hinge", [FRONT + 0.03, 0.0, 0.426], handle=level(0.426))
    found = surest(cloud([*body(), wide]), (part,), "oven")
    np.testing.assert_allclose(found.part.joint.axis, Y, atol=1e-6)
    assert found.part.joint.origin[2] == pytest.approx(-HEIGHT / 2, abs=0.03)


def test_the_door_of_an_oven_ends_above_the_bar_of_the_drawer_below():
    bars = [
        rectangle(np.array([FRONT + 0.03, -0.2, z]), 0.4 * Y, 0.012 * Z, X) for z in (0.42, 0.1)
    ]
    door = sensed("hinge", [FRONT + 0.03, 0.0, 0.426], handle=level(0.426))
    below = sensed("slide", [0.0, 0.0, 0.0], handle=level(0.106), confidence=0.08)
    found = surest(cloud([*body(), *bars]), (door, below), "oven")
    np.testing.assert_allclose(found.part.joint.axis, Y, atol=1e-6)
    assert found.part.joint.origin[2] == pytest.approx(0.106 + 0.05 - HEIGHT / 2, abs=0.01)


def test_no_knob_ends_the_door_of_an_oven_below_its_bar():
    wide = rectangle(np.array([FRONT + 0.03, -0.2, 0.42]), 0.4 * Y, 0.012 * Z, X)
    door = sensed("hinge", [FRONT + 0.03, 0.0, 0.426], handle=level(0.426))
    phantom = sensed("hinge", [FRONT + 0.03, 0.0, 0.3], confidence=0.4)
    found = surest(cloud([*body(), wide, knob(0.0)]), (door, phantom), "oven")
    np.testing.assert_allclose(found.part.joint.axis, Y, atol=1e-6)
    assert found.part.joint.origin[2] == pytest.approx(-HEIGHT / 2, abs=0.03)


def test_double_doors_are_as_wide_though_pictures_end_before_one_does():
    knobs = [knob(-0.05), knob(0.05)]
    parts = tuple(
        sensed("hinge", [FRONT + 0.03, y, 0.3], origin=np.array([FRONT, 0.0, 0.3]), axis=X)
        for y in (-0.05, 0.05)
    )
    seen = [(p[p[:, 1] < 0.27], n[p[:, 1] < 0.27]) for p, n in body()]
    model = fit_furniture(
        cloud([*(each for each in seen if len(each[0])), *knobs]),
        SensedFurniture(X, parts),
        "cabinet",
    )
    places = sorted(
        float(transform(model.pose, part.part.joint.origin[None])[0, 1]) for part in model.parts
    )
    np.testing.assert_allclose(places, [-HALF, HALF], atol=0.02)


def test_the_far_end_of_a_bar_counts_though_few_points_show_it():
    at = compose(ACROSS_FRONT, np.array([FRONT + 0.03, 0.0, 0.25]))
    near = rectangle(np.array([FRONT + 0.03, -0.3, 0.244]), 0.4 * Y, 0.012 * Z, X)[0]
    far = rectangle(np.array([FRONT + 0.03, 0.1, 0.244]), 0.35 * Y, 0.012 * Z, X)[0]
    dense = np.repeat(near, 20, axis=0) + np.random.default_rng(1).normal(
        0, 1e-3, (20 * len(near), 3)
    )
    label, seen = handle_label(np.concatenate([dense, far]), at, FRONT)
    assert seen
    assert label.extents[0] == pytest.approx(0.75, abs=0.02)
    assert label.origin[1] == pytest.approx(0.075, abs=0.01)


@pytest.mark.parametrize(("thought", "is_at"), [(0.45, HALF), (0.22, HALF), (0.31, 0.31)])
def test_a_hinge_is_at_the_edge_of_its_front_but_for_small_errors(thought, is_at):
    origin = np.array([FRONT, thought, 0.2])
    part = sensed("hinge", [FRONT + 0.03, -0.2, 0.3], origin=origin, axis=Z)
    found = surest(cloud([*body(), knob(-0.2)]), (part,), "cabinet")
    assert found.part.joint.origin[1] == pytest.approx(is_at, abs=0.02)


@pytest.mark.parametrize("across", [True, False])
def test_what_bulges_around_where_a_bar_was_sensed_is_none(across):
    rotation = ACROSS_FRONT if across else UP_FRONT
    at = compose(rotation, np.array([FRONT + 0.03, 0.0, 0.25]))
    bulge = rectangle(np.array([FRONT + 0.02, -0.25, 0.05]), 0.5 * Y, 0.4 * Z, X)[0]
    assert not handle_label(bulge, at, FRONT)[1]
    way = Y if across else Z
    lying = rectangle(
        at[:3, 3] - 0.2 * way - 0.006 * (Y + Z - way), 0.4 * way, 0.012 * (Y + Z - way), X
    )[0]
    assert handle_label(lying, at, FRONT)[1]
    # Two bars side by side are two.
    pair = np.concatenate([lying, lying + 0.045 * (Y + Z - way)])
    assert handle_label(pair, at, FRONT)[1]
