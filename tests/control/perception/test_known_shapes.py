"""What stands in for objects of a category may lie as most of its objects do, where it lies still so."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.control.perception.objects.known_shapes import known_shapes, shape_of

UP_OF_HANDLE = np.array([0.0, 1.0, 0.0])  # of a mug's label


def ways_up(rests) -> np.ndarray:
    return np.array([rest.rotation[2] for rest in rests])


def test_a_mug_whose_own_handle_lets_it_roll_may_lie_with_the_handle_up():
    (shape,) = [shape for shape in known_shapes("mug") if shape.name == "mug_007"]
    own = shape_of(catalogue.load_by_name("mug_007"))
    assert (ways_up(own.rests) @ UP_OF_HANDLE).max() < 0.5
    assert (ways_up(shape.rests) @ UP_OF_HANDLE).max() > 0.9
    np.testing.assert_allclose(ways_up(shape.rests)[: len(own.rests)], ways_up(own.rests))


@pytest.mark.parametrize("category", ["mug", "hammer", "bowl"])
def test_the_lowest_corner_is_on_the_plane_and_the_centre_of_mass_above_the_support(category):
    for shape in known_shapes(category):
        assert len(shape.rests) <= len(shape_of(catalogue.load_by_name(shape.name)).rests) + 3
        corners = np.concatenate(shape.hulls)
        for rest in shape.rests:
            heights = corners @ rest.rotation[2] + rest.height
            assert heights.min() == pytest.approx(0.0, abs=1.5e-3)
            below = (corners @ rest.rotation.T)[heights < 0.006, :2]
            center = rest.rotation[:2] @ shape.mass.center_of_mass
            assert (below.min(axis=0) - 0.006 < center).all()
            assert (center < below.max(axis=0) + 0.006).all()
