"""An evaluation on a protocol is refused where a task is not what the protocol froze."""

from __future__ import annotations

from dataclasses import replace

import pytest

from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.protocol.present_settings import check_settings
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.tasks.core import registry

TASK = "articulated/close_microwave"
KEY = ("articulated", "close_microwave")


@pytest.fixture
def changed(monkeypatch):
    """Registers the task with other settings."""

    def change(**fields):
        spec = registry.task_spec(*KEY)

        def factory(env_config, objects):
            task = spec.factory(env_config, objects)
            tolerance = replace(task.config.tolerance, **fields.get("tolerance", {}))
            task.config = replace(task.config, **fields | {"tolerance": tolerance})
            return task

        monkeypatch.setitem(registry._TASKS, KEY, replace(spec, factory=factory))

    return change


@pytest.mark.parametrize("pose", ["oracle", "estimated"])
def test_a_task_as_it_was_frozen_passes(tmp_path, pose):
    config = EvaluationConfig((TASK,), tmp_path, episodes=1, protocol="v1", pose=pose)
    check_settings(protocol.load("v1"), config.env_config(TASK))


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"horizon": 400.0}, "fixes horizon 40.0, here it is 400.0"),
        ({"tolerance": {"shut": 0.5}}, "fixes tolerance of shut 0.01, here it is 0.5"),
        ({"settle": 3.0}, "fixes settings '"),
    ],
)
def test_another_task_is_refused_before_anything_is_written(tmp_path, changed, fields, said):
    changed(**fields)
    out = tmp_path / "out"
    with pytest.raises(InputError) as refusal:
        evaluate(EvaluationConfig((TASK,), out, episodes=1, protocol="v1"))
    message = str(refusal.value)
    assert message.startswith(f"{TASK}: protocol v1 {said}") and "\n" not in message
    assert not out.exists()
