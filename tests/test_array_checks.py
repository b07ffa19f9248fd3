"""Arrays of wrong shapes and types are told in the tests, however often a function was called before."""

from __future__ import annotations

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from manipose_mj.poses import invert, rotation_angle
from tests.array_checks import EVERY, FIRST_CALLS


def test_a_wrong_shape_and_a_wrong_type_are_told():
    assert "pose" in what_is_told(invert, np.eye(3))
    assert "pose" in what_is_told(invert, np.eye(4, dtype=int))
    assert what_is_told(invert, np.eye(4)) == ""


def what_is_told(function, *arguments):
    """What the check of one of the next calls says; the others answer what NumPy says of it."""
    for _ in range(EVERY):
        try:
            function(*arguments)
        except TypeCheckError as error:
            return str(error)
        except IndexError:
            continue
    return ""


def test_what_was_called_often_is_checked_again_and_again():
    for _ in range(FIRST_CALLS + 1):
        rotation_angle(np.eye(3), np.eye(3))
    told = 0
    for _ in range(3 * EVERY):
        try:
            rotation_angle(np.zeros((2, 3, 3)), np.zeros((5, 3, 3)))
        except TypeCheckError:
            told += 1
        except ValueError:  # what NumPy says of it
            continue
    assert told == 3


@pytest.mark.usefixtures("wrong_arrays")
def test_a_test_may_hand_over_wrong_arrays():
    assert invert(np.eye(4, dtype=int)).shape == (4, 4)
