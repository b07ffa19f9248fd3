"""The benchmark of handles makes vessels of every kind and fails when one is missed."""

import importlib

import numpy as np
import pytest


@pytest.fixture(scope="module")
def vessels():
    return importlib.import_module("handled_vessels")


def test_handles_are_small_and_large_and_along_x(vessels):
    made = [vessels.vessel(index) for index in range(100)]
    reaches = np.array([reach for _, _, reach in made])
    assert reaches.min() < 0.010 and reaches.max() > 0.055
    assert len({what for _, what, _ in made}) == len(vessels.BODIES) * len(vessels.HANDLES)
    for mesh, what, reach in made[:25]:
        low, high = mesh.bounds
        assert high[0] > -low[0] + 0.1 * reach, (
            what
        )  # the handle stands out, a bowl's below its rim
        assert high[1] == pytest.approx(-low[1], abs=1e-6), what


@pytest.mark.parametrize(("angle", "axial"), [(0.3, False), (5.3, False), (0.3, True)])
def test_a_missed_handle_is_an_exit_code(vessels, monkeypatch, capsys, angle, axial):
    outcome = vessels.Outcome(0, "mug, loop", 0.03, angle, 0.1, axial, 1.0)
    monkeypatch.setattr(vessels, "examine", lambda _: outcome)
    right = angle < 5 and not axial
    assert vessels.main(["--count", "3"]) == (not right)
    assert f"{3 * right} of 3 within" in capsys.readouterr().out
