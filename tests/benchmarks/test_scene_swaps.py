"""Resets to other objects: timed for every kind of task, over episodes whose objects are built before."""

from __future__ import annotations

import pytest

from benchmarks.experiments import scene_swaps
from manipose_mj.evaluation.protocol.freeze import builtin_tasks
from manipose_mj.tasks.core.config import EpisodeSpec
from tests.few_objects import few


def test_every_family_and_every_verb_of_furniture_is_timed():
    timed = {*scene_swaps.RIGID, *scene_swaps.CLUTTER, *scene_swaps.FURNITURE}
    known = {spec.full_name: spec for spec in builtin_tasks()}
    verbs = {"open", "store", "take_out"}  # one closes what another opens
    tags = {tag for name in timed for tag in known[name].tags}
    assert verbs <= tags
    assert {name.split("/")[0] for name in timed} == {spec.domain for spec in known.values()}


@pytest.mark.parametrize("task", ["clutter/pick", "articulated/take_out_cabinet_door"])
def test_the_objects_that_episodes_draw_are_built_before(task, monkeypatch):
    drawn = []
    scenes = scene_swaps.SceneSource(
        scene_swaps.named_task(task), scene_swaps.EnvConfig(task, objects=few(task))
    )
    draw = scenes.draw
    monkeypatch.setattr(scenes, "draw", lambda rng, spec: drawn.append(draw(rng, spec)))
    monkeypatch.setattr(scene_swaps, "_scenes", lambda task: scenes)
    specs = [EpisodeSpec(0), EpisodeSpec(1)]
    if task.startswith("articulated"):
        specs = scene_swaps.pieces(task)
        assert [spec.seed for spec in specs] == [0, 1]
    assert scene_swaps.built(task, specs) == specs
    assert [scene is not None for scene in drawn] == [True, True]
