"""Which role a moving PartNet-Mobility link has, and how large an oven is."""

import numpy as np
import pytest

from asset_pipeline.sources.partnet_mobility.roles import named_role, shaped_role
from asset_pipeline.sources.partnet_mobility.sizes import SIZES, likely_scale

SLIDES, TURNS = True, False


@pytest.mark.parametrize(
    ("slides", "link", "parts", "role"),
    [
        (TURNS, "door", ["door_frame", "glass", "handle"], "door"),
        (TURNS, "rotation_door", ["cabinet_door_surface", "knob"], "door"),
        (TURNS, "rotation_lid", ["cover"], "lid"),
        (TURNS, "control_button", ["control_button"], "knob"),
        (TURNS, "", ["tray"], "tray"),
        (TURNS, "frame", ["frame"], None),
        (SLIDES, "button", ["knob"], "button"),
        (SLIDES, "drawer", ["drawer_front", "knob"], "drawer"),
        (SLIDES, "tray", ["tray"], "tray"),
        (SLIDES, "translation_door", ["cabinet_door_surface", "knob"], "door"),
        (SLIDES, "", ["drawer_front", "knob"], "drawer"),
        (SLIDES, "", ["cabinet_door_surface"], None),
    ],
)
def test_names_tell_the_role(slides, link, parts, role):
    assert named_role(slides, link, parts) == role


@pytest.mark.parametrize(
    ("low", "high", "origin", "axis", "role"),
    [
        ((-0.02, 0, 0), (0.02, 1, 1), (0, 0, 0), (0, 0, 1), "door"),
        ((-0.02, 0, 0), (0.02, 1, 1), (0, 0.5, 0.02), (0, 1, 0), "door"),
        ((-0.4, -0.4, 0), (0.4, 0.4, 0.02), (0.02, 0, 0), (0, 0, -1), "tray"),
        ((-0.05, -0.1, -0.1), (0.05, 0.1, 0.1), (0, 0.01, 0), (1, 0, 0), "knob"),
    ],
)
def test_shape_tells_the_role_where_names_do_not(low, high, origin, axis, role):
    bounds = np.array([low, high], float)
    assert shaped_role(bounds, np.array(origin, float), np.array(axis, float)) == role


@pytest.mark.parametrize(
    ("proportions", "width"),
    [
        ((0.56, 0.595, 0.595), 0.595),  # built in
        ((0.60, 0.595, 0.595), 0.595),  # ... its handle drawn as one with the door
        ((0.55, 0.595, 0.455), 0.595),  # ... compact
        ((0.68, 0.76, 0.92), 0.76),  # a free-standing range
        ((0.75, 0.76, 1.14), 0.76),  # ... with a backguard
        ((0.60, 0.90, 0.92), 0.90),  # range cookers
        ((0.70, 1.50, 0.92), 1.50),
        ((0.60, 0.76, 1.30), 0.76),  # two in a wall
        ((0.36, 0.47, 0.28), 0.47),  # on the counter
    ],
)
@pytest.mark.parametrize("unit", [0.3, 1.0, 2.0])
def test_ovens_have_the_size_that_their_proportions_say(proportions, width, unit):
    drawn = np.array(proportions) * unit
    assert likely_scale(drawn, SIZES["Oven"].builds) * drawn[1] == pytest.approx(width, rel=0.05)


def test_what_has_one_known_side_has_that_side():
    drawn = np.array([1.0, 2.0, 3.0])
    assert likely_scale(drawn, SIZES["StorageFurniture"].builds) == pytest.approx(0.42)
    assert likely_scale(drawn, SIZES["Microwave"].builds) == pytest.approx(0.24)
