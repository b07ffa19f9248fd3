"""Protocol v1 is what it was frozen as, and the tasks are still what it says."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.assets import catalogue
from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.protocol import freeze, frozen
from manipose_mj.evaluation.protocol.freeze import (
    builtin_tasks,
    evaluation_config,
    frozen_entry,
    frozen_settings,
)
from manipose_mj.tasks.core.config import EpisodeSpec
from manipose_mj.tasks.core.scene_source import SceneSource

V1 = json.loads(frozen.protocol_path("v1").read_text(encoding="utf-8"))
RULE = "a released protocol never changes: undo the change of the task, or add a version"
TASK = "single_object/target_pose"
UNMOVABLE_CATEGORIES = 2  # none of whose test objects one grasp can join two stable poses of


def test_the_file_has_the_hash_it_states():
    loaded = protocol.load("v1")
    assert loaded.sha256 == frozen.digest(V1) == V1["sha256"]


def test_an_edited_file_is_refused(tmp_path, monkeypatch):
    document = json.loads(json.dumps(V1))
    document["tasks"][TASK]["horizon"] += 1
    (tmp_path / "v1.json").write_text(json.dumps(document), encoding="utf-8")
    monkeypatch.setattr(frozen, "protocol_path", lambda version: tmp_path / "v1.json")
    with pytest.raises(InputError, match="v1.json: its content does not have the sha256") as caught:
        frozen.load.__wrapped__("v1")
    assert "\n" not in str(caught.value)


def test_it_has_every_task_of_this_package_and_no_other():
    assert set(V1["tasks"]) == {spec.full_name for spec in builtin_tasks()}, RULE


@pytest.mark.sample(2)
@pytest.mark.parametrize("spec", builtin_tasks(), ids=lambda spec: spec.full_name)
def test_a_task_is_as_it_was_frozen(spec):
    frozen_task = V1["tasks"][spec.full_name]
    assert frozen_settings(spec).items() <= frozen_task.items(), RULE
    scenes = SceneSource(spec, evaluation_config(spec))
    for entry in frozen_task["episodes"][:2]:
        asked = EpisodeSpec(**frozen.read_episode(entry).asked)
        assert frozen_entry(scenes, asked) == entry, RULE


def test_freezing_again_keeps_starts_that_were_drawn_again(monkeypatch):
    task = "single_object/position"
    entries = V1["tasks"][task]["episodes"]
    redrawn = next(
        i for i in range(100) if entries[i]["seed"] != frozen.evaluation_seed("v1", task, i)
    )
    monkeypatch.setitem(frozen.EPISODES, "v1", redrawn + 1)
    specs = [s for s in builtin_tasks() if s.full_name == task]
    monkeypatch.setattr(freeze, "builtin_tasks", lambda: specs)
    again = freeze.document("v1", V1)
    assert again["tasks"][task] == {**V1["tasks"][task], "episodes": entries[: redrawn + 1]}
    # Which objects there are for further episodes takes building all of them.
    asked = EpisodeSpec(object=entries[0]["object"])
    monkeypatch.setattr(freeze.SceneSource, "strata", lambda scenes: [(asked,)])
    first = {"tasks": {task: {**V1["tasks"][task], "episodes": entries[:redrawn]}}}
    longer = freeze.document("v1", first)["tasks"][task]["episodes"]
    assert longer[:redrawn] == entries[:redrawn]
    assert longer[redrawn]["seed"] == frozen.evaluation_seed("v1", task, redrawn)


@pytest.mark.parametrize("name", V1["tasks"])
def test_seeds_are_100_different_ones_with_names(name):
    seeds = protocol.load("v1").task(name).seeds
    assert len(seeds) == len(set(seeds.values())) == 100
    assert list(seeds)[7] == f"v1/{name}/007"
    assert seeds[f"v1/{name}/007"] == frozen.evaluation_seed("v1", name, 7)
    assert all(0 <= seed < 2**32 for seed in seeds.values())


def test_seeds_stay_what_they_are():
    assert protocol.load("v1").episode(TASK, 0).seed == 1815592966
    assert protocol.load("v1").episode(TASK, 99).seed == frozen.evaluation_seed("v1", TASK, 99)


@pytest.mark.parametrize("name", V1["tasks"])
def test_episodes_use_test_objects_only(name):
    objects = protocol.load("v1").task(name).objects
    assert objects
    for category, index in map(catalogue.find, objects):
        assert catalogue.CATALOGUE[category].split(index) == "test"


def test_every_category_and_every_test_piece_of_furniture_appears():
    tasks = protocol.load("v1").tasks
    rows = catalogue.CATALOGUE.values()
    rigid = {row.name for row in rows if row.object_type != "articulated"}
    moved = {catalogue.find(each.object)[0] for each in tasks[TASK].episodes.values()}
    assert len(rigid - moved) <= UNMOVABLE_CATEGORIES
    used = {name for task in tasks.values() for name in task.objects}
    assert {catalogue.find(name)[0] for name in used} == set(catalogue.CATALOGUE)
    pieces = {
        row.instance(index)
        for row in rows
        for index in range(row.instances)
        if row.object_type == "articulated" and row.split(index) == "test"
    }
    assert pieces <= used and len(pieces) == 20


def test_another_configuration_shows():
    spec = next(s for s in builtin_tasks() if s.full_name == TASK)

    def slower(options, objects):
        task = spec.factory(options, objects)
        object.__setattr__(task.config, "horizon", task.config.horizon + 1)
        return task

    changed = frozen_settings(replace(spec, factory=slower))
    assert changed["horizon"] == V1["tasks"][TASK]["horizon"] + 1
    assert changed["settings"] != V1["tasks"][TASK]["settings"]


def test_unknown_names_are_one_line():
    for wrong in (
        lambda: protocol.load("v2"),
        lambda: protocol.load("v1").task("single_object/target_pos"),
        lambda: protocol.load("v1").episode(TASK, 100),
    ):
        with pytest.raises(InputError, match="v1") as caught:
            wrong()
        assert "\n" not in str(caught.value)


def test_an_evaluation_takes_seeds_and_objects_from_it(tmp_path):
    config = EvaluationConfig((TASK,), tmp_path, episodes=100, protocol="v1")
    assert config.split == "test"
    seeds = list(protocol.load("v1").task(TASK).seeds.values())
    assert [config.episode_seed(TASK, i) for i in range(100)] == seeds
    assert config.identity["protocol sha256"] == V1["sha256"]
    assert "--protocol v1" in config.command and "--seed" not in config.command
    plain = EvaluationConfig((TASK,), tmp_path)
    assert plain.split == "train" and plain.identity["protocol"] is None


def test_a_frozen_episode_is_played_with_the_objects_that_it_names():
    environment = suite.load(*TASK.split("/"), split="test", obs_mode="state")
    for episode in list(protocol.load("v1").task(TASK).episodes.values())[:3]:
        environment.reset(EpisodeSpec(**episode.asked))
        assert environment.task.object_name == episode.object == episode.objects[0]
        assert np.isfinite(environment.physics.data.qpos).all()
