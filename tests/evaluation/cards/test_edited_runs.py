"""A run whose files were edited is refused in one line that names the file and the field."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from manipose_mj.errors import InputError
from manipose_mj.evaluation.cards.run_record import read_run
from tests.evaluation.cards.test_cards import evaluated


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return evaluated(tmp_path_factory.mktemp("runs") / "run")


def edited_success(run: Path, **changes) -> tuple[Path, int]:
    """The results of a run whose first success was changed, and its number among the lines, from 0."""
    path = run / "results.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    number = next(i for i, line in enumerate(lines) if line["success_at_end"])
    lines[number] |= changes
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path, number


@pytest.fixture
def run(whole, tmp_path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "run"))


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("protocol", ["v1"], "unknown protocol"),
        ("tasks", 3, "expected a list of names"),
        ("tasks", ["single_object/none"], "unknown task of protocol v1"),
        ("episodes", 6.0, "expected a whole number"),
        ("episodes", 101, "protocol v1 has 100 episodes"),
        ("seed", 3, "protocol v1 fixes seeds and objects"),
        ("objects", ["mug_000"], "protocol v1 fixes seeds and objects"),
        ("resample", 1.5, "expected null or a whole number"),
        ("resample", -1, "expected a whole number, at least 0"),
        ("pose", [], "expected a name"),
        ("policy", "a:B", "expected null or an object with name and obs_mode"),
        ("planner", None, "expected an object with the kind rules, llm or replay"),
        ("planner", {"kind": "llm"}, "and what that needs"),
        ("estimator", 1, "expected null or an object with a name"),
        ("batch", {"worlds": 2}, "expected null or an object with an engine"),
        ("assets sha256", 1, "expected null or a text"),
        ("injected errors", [1], "expected null or an object"),
        ("injected errors", {"<b>": 1.0}, "expected null or an object of errors that can be made"),
        ("injected errors", {"pose_error_cm": "<b>"}, "expected null or an object of errors"),
        ("injected errors", {"cameras": ["<b>"]}, "expected null or an object of errors"),
        ("grasps", {}, "expected null or one of annotated, shape, cloud"),
        ("grasps", "<b>", "expected null or one of annotated, shape, cloud"),
        ("machine", "a\nb", "expected one line of text"),
        ("machine", None, "expected one line of text"),
        ("command", "a\x1bb", "expected a command line"),
        ("command", "manipose 'evaluate", "has program []; the run has ['manipose', 'evaluate']"),
        ("numpy version", "1\n2", "a version is 'numpy version 1\\n2'; expected one line of text"),
        ("x\ny version", "1", "a version is 'x\\ny version 1'; expected one line of text"),
    ],
)
def test_a_field_of_another_form_is_named(run, field, value, said):
    path = run / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {field: value}))
    with pytest.raises(InputError) as refusal:
        read_run(run)
    message = str(refusal.value)
    assert message.startswith(f"{path}: ") and said in message and "\n" not in message
    assert repr(field)[1:-1].split()[0].removesuffix("s") in message


@pytest.mark.parametrize(
    ("stated", "other", "said"),
    [
        ("--episodes 6", "--episodes 5", "command has episodes '5'; the run has '6'"),
        ("--protocol v1", "--seed 0", "command has protocol None; the run has 'v1'"),
        (
            "--protocol v1",
            "--protocol v1 --resample 2",
            "command has resample '2'; the run has None",
        ),
        ("single_object/target_pose", "clutter/pick", "command has tasks ['articulated/"),
    ],
)
def test_a_command_of_another_run_is_refused(run, stated, other, said):
    path = run / "run.json"
    document = json.loads(path.read_text())
    assert stated in document["command"]
    document["command"] = document["command"].replace(stated, other)
    path.write_text(json.dumps(document))
    with pytest.raises(InputError) as refusal:
        read_run(run)
    assert said in str(refusal.value) and "\n" not in str(refusal.value)


@pytest.mark.parametrize("field", ["command", "machine", "mujoco version"])
def test_a_run_that_cannot_be_repeated_is_refused(run, field):
    path = run / "run.json"
    document = json.loads(path.read_text())
    del document[field]
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=f"lacks '{field}', so that it cannot be repeated"):
        read_run(run)


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("task", [], "task is []; expected str"),
        ("episode", True, "episode is True; expected int"),
        ("success_once", None, "success_once is None; expected bool"),
        ("translation_error", "none", "translation_error is 'none'; expected float | None"),
        ("wall_s", float("nan"), "wall_s is nan; expected float"),
        ("decisions", 1.5, "decisions is 1.5; expected int"),
        ("success_once", False, "success_at_end is true and success_once is not"),
    ],
)
def test_a_value_of_another_type_is_named_with_its_line(run, field, value, said):
    path, number = edited_success(run, **{field: value})
    with pytest.raises(InputError) as refusal:
        read_run(run)
    assert str(refusal.value) == f"{path}: line {number + 1} is not an episode's result: {said}"
