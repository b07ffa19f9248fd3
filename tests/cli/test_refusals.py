"""Numbers that no command can use end in one line, before anything is loaded or written."""

from __future__ import annotations

import pytest

import tests.evaluation.fake_episodes as fake
from manipose_mj.cli.main import EXIT_INPUT, main
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.results_folder import RESULTS_FILE
from manipose_mj.evaluation.runner import evaluate as run_evaluation

TASK = "single_object/target_pose"
IN_PARALLEL = (
    "demo",
    f"evaluate {TASK}",
    f"robustness {TASK}",
    "protocol verify v1",
    "protocol certify v1 --out certificates.json",
    f"demos record {TASK} --out demos",
    "demos replay demos.h5 --out replayed.h5",
    "assets build ycb . --out built",
    "assets check .",
    "assets grasps .",
    "assets sheet mug --out mug.png",
    "pose train mug --out weights",
    "pose train-articulated --out weights",
    "pose evaluate mug",
    "pose evaluate-articulated",
    "pose export mug --out views",
)


def complaint(capsys) -> str:
    """What the last command wrote on standard error: one line."""
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    return line.removeprefix("manipose: ")


@pytest.mark.parametrize("jobs", [0, -3])
@pytest.mark.parametrize("command", IN_PARALLEL)
def test_jobs_are_at_least_one(command, jobs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([*command.split(), "--jobs", str(jobs)]) == EXIT_INPUT
    assert complaint(capsys) == f"jobs is {jobs}; expected at least 1"
    assert not list(tmp_path.iterdir())


def test_a_picture_of_no_seed_leaves_no_file(tmp_path, capsys):
    out = tmp_path / "a.png"
    assert main(["render", TASK, "--out", str(out), "--seed", "-1"]) == EXIT_INPUT
    assert complaint(capsys) == "seed is -1; expected a whole number from 0 to 4294967295"
    assert not out.exists()


@pytest.mark.parametrize("limit", ["inf", "nan", "1e10", "0"])
def test_a_time_limit_is_one_that_can_be_waited_for(limit, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    command = ["assets", "build", "ycb", ".", "--out", "built", "--jobs", "1", "--limit-s", limit]
    assert main(command) == EXIT_INPUT
    assert complaint(capsys) == (
        f"--limit-s is {float(limit):g}; expected seconds, more than 0 and at most 1e+06"
    )
    assert not list(tmp_path.iterdir())


SERVERS = "servers of methods have addresses with ws:// or wss://"


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("--policy http://localhost:8000", SERVERS),
        ("--pose estimated --estimator http://localhost:8000", SERVERS),
        (
            "--protocol v1 --episodes 101",
            f"episodes is 101; protocol v1 has 100 episodes of {TASK}",
        ),
        ("--resample 3", "resample 3: there is no protocol whose seeds it replaces"),
        ("--protocol v1 --resample -3", "resample is -3; expected a whole number, at least 0"),
    ],
)
def test_evaluations_that_cannot_be_leave_no_folder(wrong, said, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("manipose_mj.cli.builtin_objects.load_objects", lambda names, jobs: [])
    out = tmp_path / "out"
    assert main(f"evaluate {TASK} --jobs 1 --out {out} {wrong}".split()) == EXIT_INPUT
    assert said in complaint(capsys)
    assert not out.exists()


@pytest.fixture
def building(monkeypatch):
    """Building objects, which must not begin."""

    def build(names, jobs):
        raise AssertionError("objects are built")

    monkeypatch.setattr("manipose_mj.cli.builtin_objects.load_objects", build)


def test_a_folder_with_results_is_refused_before_objects_are_built(building, tmp_path, capsys):
    config = EvaluationConfig(fake.TASKS[:1], tmp_path, episodes=2)
    run_evaluation(config, runner=fake.make_runner())
    before = (tmp_path / RESULTS_FILE).read_bytes()
    assert main(f"evaluate {TASK} --jobs 1 --out {tmp_path}".split()) == EXIT_INPUT
    assert complaint(capsys) == (
        f"{tmp_path}: holds 2 results; add --resume or choose another --out"
    )
    assert (tmp_path / RESULTS_FILE).read_bytes() == before


@pytest.mark.parametrize("command", [f"evaluate {TASK}", "demo"])
def test_a_place_that_is_no_folder_is_refused_before_objects_are_built(
    command, building, tmp_path, capsys
):
    out = tmp_path / "file"
    out.touch()
    assert main(f"{command} --jobs 1 --out {out}/r".split()) == EXIT_INPUT
    assert complaint(capsys) == (
        f"{out}/r: cannot write there (Not a directory); choose another --out"
    )


@pytest.mark.parametrize("command", [f"evaluate {TASK}", "demo"])
def test_a_wrong_menagerie_is_refused_before_objects_are_built(
    command, building, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path / "nowhere"))
    assert main(f"{command} --jobs 1 --out {tmp_path}/r".split()) == EXIT_INPUT
    assert complaint(capsys).startswith(f"MENAGERIE_ROOT={tmp_path}/nowhere: no ")
    assert not list(tmp_path.iterdir())


def test_the_folder_is_as_it_was_while_objects_are_built(tmp_path, monkeypatch):
    found = []
    monkeypatch.setattr(
        "manipose_mj.cli.builtin_objects.load_objects",
        lambda names, jobs: found.extend(tmp_path.iterdir()),
    )
    monkeypatch.setattr("manipose_mj.cli.evaluate.run_and_report", lambda config, resume: 0)
    assert main(f"evaluate {TASK} --jobs 1 --out {tmp_path}/r".split()) == 0
    assert not found


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("evalute", "unknown command 'evalute'; did you mean evaluate?"),
        ("assets bild", "unknown assets command 'bild'; did you mean build?"),
        (
            f"evaluate {TASK} --object mug_000 --episods 3",
            "unknown option of evaluate '--episods'; did you mean --episodes, --pose, --worlds?",
        ),
        (
            f"evaluate {TASK} --pose_error_c=3",
            "unknown option of evaluate '--pose_error_c'; did you mean --pose-error-cm, --pose-error-deg, --pose?",
        ),
        (
            "assets build meshes x --typ axial",
            "unknown option of assets build '--typ'; did you mean --type, --up, --out?",
        ),
        ("doctor --everything", "unknown option of doctor '--everything'; known: --help"),
    ],
)
def test_misspelt_words_of_the_command_line_are_told_in_one_line(line, said, capsys):
    assert main(line.split()) == EXIT_INPUT
    assert complaint(capsys) == said


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        (f"evaluate {TASK} --pose guessed --episods 3", "guessed"),
        ("doctor now", "now"),
        ("demos", "record"),
    ],
)
def test_what_else_is_wrong_tyro_tells(line, shown, capsys):
    with pytest.raises(SystemExit) as end:
        main(line.split())
    told = capsys.readouterr().err
    assert end.value.code == EXIT_INPUT and shown in told and "unknown option" not in told


@pytest.mark.parametrize(
    "command",
    [
        f"evaluate {TASK}",
        f"robustness {TASK}",
        f"render {TASK} --out a.png",
        f"view {TASK}",
        f"demos record {TASK} --out demos",
        f"train ppo {TASK}",
    ],
)
def test_one_object_may_be_called_object(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([*command.split(), "--object", "mugg_000"]) == EXIT_INPUT
    assert "did you mean mug_000" in complaint(capsys)
    assert not list(tmp_path.iterdir())
