"""What an evaluation finds in its folder it keeps, goes on with, or refuses; nobody's file is lost."""

from __future__ import annotations

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
