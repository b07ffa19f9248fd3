"""What an evaluation finds in its folder it keeps, goes on with, or refuses; nobody's file is lost."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import pytest

import tests.evaluation.fake_episodes as fake
from manipose_mj.errors import InputError
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.results_folder import RESULTS_FILE
from manipose_mj.evaluation.runner import evaluate


def config(out: Path, **changes) -> EvaluationConfig:
    return EvaluationConfig(**{"tasks": fake.TASKS, "out": out, "episodes": 2, **changes})


@pytest.mark.parametrize("resume", [False, True])
@pytest.mark.parametrize(
    "content", [b"what somebody noted\n", b'{"loss": 0.5}\n', b"\n", b"\xff\n"]
)
def test_a_line_of_somebody_elses_file_is_refused_and_stays(tmp_path, content, resume):
    path = tmp_path / RESULTS_FILE
    path.write_bytes(content)
    with pytest.raises(InputError, match="line 1 is not an episode's result") as refusal:
        evaluate(config(tmp_path), resume=resume, runner=fake.make_runner())
    assert path.read_bytes() == content and "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"seed": 7}, "with seed 7; this run has seed "),
        ({"episode": 9}, "; this run does not ask for it"),
        ({"task": "single_object/position"}, "; this run does not ask for it"),
    ],
)
def test_a_kept_line_that_the_run_does_not_ask_for_is_refused_and_stays(tmp_path, changes, said):
    evaluate(config(tmp_path), runner=fake.make_runner())
    path = tmp_path / RESULTS_FILE
    first, *others = path.read_text().splitlines(keepends=True)
    edited = "".join([*others, json.dumps(json.loads(first) | changes) + "\n"]) + first[:30]
    path.write_text(edited)
    with pytest.raises(InputError, match="line 4 is episode ") as refusal:
        evaluate(config(tmp_path), resume=True, runner=fake.make_runner())
    assert said in str(refusal.value) and "\n" not in str(refusal.value)
    assert path.read_text() == edited


@pytest.mark.parametrize(
    ("name", "number", "ours"),
    [
        ("r-beside/mug.obj", errno.ENOENT, False),
        (None, errno.ECONNRESET, False),
        ("r/trajectories/x.npz", errno.EACCES, True),
        (None, errno.EIO, True),
    ],
)
def test_only_a_failure_of_the_folder_is_told_as_one(tmp_path, name, number, ours):
    def failing(config, spec, *, episode, pose):
        raise OSError(number, "it failed", None if name is None else str(tmp_path / name))

    with pytest.raises(InputError if ours else OSError) as failure:
        evaluate(config(tmp_path / "r"), runner=failing)
    assert ("cannot write results there" in str(failure.value)) is ours


@pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt])
def test_what_ends_before_the_first_result_leaves_no_new_folder(tmp_path, failure):
    def interrupted(results, total):
        raise failure

    out = tmp_path / "new" / "r"
    with pytest.raises(failure):
        evaluate(config(out), runner=fake.make_runner(), on_progress=interrupted)
    assert not out.exists()
