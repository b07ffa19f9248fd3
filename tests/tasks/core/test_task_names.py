"""Tasks by names and patterns of names."""

from __future__ import annotations

import pytest

from manipose_mj import suite
from manipose_mj.cli.main import EXIT_INPUT, main
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.registry import register_task, tasks_named

TASK = "single_object/target_pose"


def test_patterns_stand_for_all_that_fit_each_once():
    taken = tasks_named(["articulated/take_out_*", "articulated/take_out_oven", TASK])
    assert len(taken) == 7 and taken[-1] == TASK
    assert tasks_named(["*"]) == tuple(map("/".join, suite.ALL_TASKS))
    assert tasks_named([]) == ()


def test_what_fits_no_task_is_refused():
    with pytest.raises(InputError, match="unknown task .*; did you mean single_object/target_pose"):
        tasks_named(["single_object/target_pse"])
    with pytest.raises(InputError, match="no task fits 'articulated/take_.*`manipose list`"):
        tasks_named([TASK, "articulated/take_*_everything"])


def test_evaluate_takes_patterns(monkeypatch, tmp_path, capsys):
    asked = []
    monkeypatch.setattr("manipose_mj.cli.builtin_objects.load_objects", lambda names, jobs: [])
    monkeypatch.setattr(
        "manipose_mj.cli.evaluate.run_and_report", lambda config, resume: asked.append(config) or 0
    )
    words = ["evaluate", "clutter/*", "--protocol", "v1", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    family = {"clutter/pick", "clutter/stacked", "clutter/occluded", "clutter/multi"}
    assert set(asked[0].tasks) == family
    assert main(["evaluate", "cluter/*", "--out", str(tmp_path / "out")]) == EXIT_INPUT
    assert (
        capsys.readouterr().err == "manipose: no task fits 'cluter/*'; `manipose list` names them\n"
    )


@pytest.mark.parametrize(
    ("domain", "name", "said"),
    [
        ("mine", "target_pose", "which is single_object/target_pose's"),
        ("mine", "pick up", "the name is 'pick up'; expected lower case words"),
        ("mine/x", "slashed", "the domain is 'mine/x'; expected lower case words"),
        ("single_object", "target_pose", "registered already"),
        ("mine", 5, "the name is 5; expected lower case words"),
        (None, "named", "the domain is None; expected lower case words"),
    ],
)
def test_names_that_a_front_door_cannot_tell_apart_are_refused(domain, name, said):
    before = suite.ALL_TASKS
    with pytest.raises(ValueError, match=said):
        register_task(domain, name)(lambda env_config: None)
    assert before == suite.ALL_TASKS


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"tags": "rigid"}, "tags is 'rigid'; expected a tuple of words"),
        ({"tags": ("rigid", 5)}, "tags is .*; expected a tuple of words"),
        ({"draws": ()}, "draws is .*; expected a function"),
    ],
)
def test_options_of_a_task_of_other_kinds_are_refused(options, said):
    def factory(env_config):
        """Nothing to do."""

    before = suite.ALL_TASKS
    with pytest.raises(ValueError, match=f"^task mine/own: {said}"):
        register_task("mine", "own", **options)(factory)
    assert before == suite.ALL_TASKS
