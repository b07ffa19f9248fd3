"""Colours in words, of pictures and of surfaces: the same of both, in light and in shade."""

from __future__ import annotations

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from manipose_mj.assets import catalogue
from manipose_mj.control.perception.objects.colour_words import (
    LEAST_PIXELS,
    SeenColours,
    colour_words,
    surface_colour_words,
)
from manipose_mj.control.perception.objects.object_views import ObjectViews
from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.control.perception.pose_sources import sensors_for
from manipose_mj.errors import InputError
from tests.few_objects import load


def pixels(*colours: tuple[tuple[int, int, int], int]) -> np.ndarray:
    return np.concatenate([np.tile(np.array(c, np.uint8), (count, 1)) for c, count in colours])


@pytest.mark.parametrize(
    ("colour", "word"),
    [
        ((200, 30, 40), "red"),
        ((230, 130, 30), "orange"),
        ((110, 70, 35), "brown"),
        ((235, 200, 40), "yellow"),
        ((40, 130, 60), "green"),
        ((40, 80, 190), "blue"),
        ((100, 50, 150), "purple"),
        ((240, 150, 170), "pink"),
        ((250, 250, 250), "white"),
        ((110, 112, 115), "grey"),
        ((30, 30, 32), "black"),
    ],
)
def test_a_colour_has_its_word_in_light_and_in_some_shade(colour, word):
    assert colour_words(pixels((colour, 100))) == word
    shaded = tuple(int(0.85 * c) for c in colour)
    assert colour_words(pixels((colour, 60), (shaded, 40))) == word  # pyright: ignore[reportArgumentType]


def test_a_second_colour_counts_where_it_is_large():
    red, white, shade = (200, 30, 40), (245, 245, 245), (150, 150, 152)
    assert colour_words(pixels((red, 60), (white, 40))) == "red and white"
    assert colour_words(pixels((red, 60), (white, 20), (shade, 20))) == "red and white"
    assert colour_words(pixels((red, 90), (white, 10))) == "red"
    four = ((200, 30, 40), (40, 80, 190), (40, 130, 60), (235, 200, 40))
    assert colour_words(pixels(*((each, 25) for each in four))) == "many-coloured"
    assert colour_words(pixels((red, LEAST_PIXELS - 1))) == ""


PILED = {
    "box_010": "purple",
    "box_016": "green",
    "box_028": "yellow",
    "box_046": "green",
    "computer_mouse_000": "black",
    "drinkbox_001": "white",
    "steel_tape_000": "yellow",
}


def test_pictures_and_surfaces_of_a_pile_have_the_same_word():
    environment = load(
        "clutter", "occluded", seed=1, obs_mode="state", sensors=sensors_for("estimated")
    )
    environment.reset()
    task, physics = environment.task, environment.physics
    views = ObjectViews(task.task_observables, ("front", "left", "right"))
    seen = SeenColours(lambda name: views.of(physics, name))
    true = OraclePerception(task, physics).observe().objects
    assets = {name: entity.asset.name for name, entity in task.objects.items()}
    told = {assets[name]: seen.of(name) for name in assets}
    assert {name: words.split()[0] for name, words in told.items() if words} == PILED
    first = {assets[name]: obj.colours.split()[0] for name, obj in true.items()}
    assert {name: first[name] for name in PILED} == PILED


@pytest.mark.parametrize(
    ("name", "word"),
    [("apple_000", "red"), ("pan_000", "black"), ("wallet_000", "brown"), ("mug_000", "blue and white")],
)  # fmt: skip
def test_a_surface_has_a_word(name, word):
    model = mujoco.MjModel.from_xml_path(str(catalogue.load_by_name(name).model_path))
    assert surface_colour_words(model, np.ones(model.ngeom, bool)) == word
    assert surface_colour_words(model, np.zeros(model.ngeom, bool)) == ""


def test_where_nothing_renders_there_is_no_word():
    def rgb():
        raise InputError("no renderer")

    image = SimpleNamespace(mask=np.ones((20, 20), bool), rgb=rgb)
    views = {"object": [SimpleNamespace(image=image)], "hidden": []}
    seen = SeenColours(lambda name: views[name])
    assert seen.of("object") == seen.of("hidden") == ""
    image.rgb = lambda: np.tile(np.array([200, 30, 40], np.uint8), (20, 20, 1))
    assert seen.of("object") == "red"
    image.rgb = rgb
    assert seen.of("object") == "red"  # throughout an episode
    seen.forget()
    assert seen.of("object") == ""
