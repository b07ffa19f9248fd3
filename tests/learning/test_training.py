"""Trainings from a task's name to a file that `manipose evaluate` plays."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import equinox as eqx
import jax
import pytest

from manipose_mj.batch.drawing import draw_pool
from manipose_mj.cli.main import EXIT_INPUT, EXIT_INTERRUPTED, main
from manipose_mj.errors import InputError
from manipose_mj.learning import trained, training
from manipose_mj.learning.frames import frame_of
from manipose_mj.learning.ppo import PpoConfig
from manipose_mj.learning.trained import Trained
from manipose_mj.learning.training import POLICY_FILE, TrainingConfig, check_folder, training_pool
from tests.few_objects import few
from tests.places import ROOT

WEIGHTS = Path(trained.__file__).parent / "weights"
TASK, PIECES = "articulated/open_middle_drawer", ("cabinet_000", "cabinet_003")


def test_starts_are_kept_in_a_file_with_shorter_episodes(tmp_path):
    config = TrainingConfig(TASK, starts=2, objects=PIECES, episode=4.0)
    told = []
    pool = training_pool(config, tmp_path / "starts", lambda *counts: told.append(counts))
    assert pool.layout.horizon == 200 and told == [(1, 2), (2, 2)]
    again = training_pool(config, tmp_path / "starts")
    assert again.seeds == pool.seeds == (0, 1)
    other = TrainingConfig("articulated/close_middle_drawer", starts=2, objects=PIECES)
    with pytest.raises(InputError, match="of another task or mode"):
        training_pool(other, tmp_path / "starts")
    brief = TrainingConfig(TASK, starts=2, objects=PIECES, episode=0.1)
    with pytest.raises(InputError, match=r"episode is 0.1 s; .* 0.2 s"):
        training_pool(brief, tmp_path / "starts")


@pytest.mark.parametrize(
    ("task", "options", "message"),
    [
        ("articulated/store_middle_drawer", {}, "has no grip frame to learn in"),
        (TASK, {"episode": 0.1}, r"episode is 0.1 s; .* 0.2 s"),
        (TASK, {"ppo": PpoConfig(minibatches=99)}, "2 worlds are too few for 99 minibatches"),
        (TASK, {"policy": Path("nowhere.npz")}, "nowhere.npz: no trained policy"),
        (TASK, {"policy": WEIGHTS / "lift.npz"}, "was trained on example/lift, about"),
    ],
)
def test_what_cannot_be_trained_is_refused_before_the_starts_are_drawn(
    task, options, message, tmp_path, monkeypatch
):
    def draw(config, seeds):
        assert len(seeds) == 1
        return draw_pool(config, seeds)

    monkeypatch.setattr(training, "draw_pool", draw)
    kept = tmp_path / "starts"
    config = TrainingConfig(task, worlds=2, starts=9, objects=few(task), **options)
    with pytest.raises(InputError, match=message):
        training_pool(config, kept)
    assert not kept.exists()


def test_tasks_with_an_object_and_a_handle_are_refused():
    posed = {"object", "handle", "joint"}
    with pytest.raises(InputError, match="opens or shuts one drawer or door or a task about one"):
        frame_of("articulated/store_middle_drawer", posed)
    assert frame_of("articulated/open_oven", {"handle", "joint"}) == "handle"
    assert frame_of("single_object/target_pose_shelf", {"object", "shelf"}) == "object"


def test_the_help_names_the_tasks_that_have_a_frame(capsys):
    assert frame_of("clutter/pick", {"object", "clutter_1"}) == "object"
    with pytest.raises(SystemExit):
        main(["train", "ppo", "--help"])
    told = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "or one about an object and no furniture, also in clutter or of your own" in told


@pytest.mark.parametrize(
    ("option", "value"),
    [("minutes", "nan"), ("episode", "nan"), ("episode", "inf"), ("until", "2"), ("worlds", "0")],
)
def test_numbers_with_which_no_training_ends_are_refused(option, value, capsys):
    assert main(["train", "ppo", TASK, f"--{option}", value]) == EXIT_INPUT
    assert f"--{option} is {value}" in capsys.readouterr().err


def test_a_training_replaces_no_policy_but_that_it_goes_on_from(tmp_path):
    kept = tmp_path / "some" / "new" / POLICY_FILE
    check_folder(kept.parent)
    assert not list(tmp_path.iterdir())
    kept.parent.mkdir(parents=True)
    kept.write_bytes(b"")
    with pytest.raises(InputError, match="is there already; choose another --out"):
        check_folder(kept.parent, tmp_path / "other.npz")
    check_folder(kept.parent, kept)
    assert list(kept.parent.iterdir()) == [kept]
    with pytest.raises(InputError, match="cannot write there"):
        check_folder(kept)


def test_bad_numbers_end_in_one_line(capsys):
    missing = ["--engine", "c", "--starts", "1", "--objects", PIECES[0], "--policy", "nowhere.npz"]
    assert main(["train", "ppo", TASK, *missing]) == EXIT_INPUT
    assert "nowhere.npz: no trained policy" in capsys.readouterr().err
    assert main(["train", "ppo", "articulated/open_midle_drawer"]) == EXIT_INPUT
    assert "open_middle_drawer" in capsys.readouterr().err


def test_a_policy_about_something_else_is_no_beginning(tmp_path, capsys):
    shipped = str(WEIGHTS / "open_middle_drawer.npz")
    words = [
        "single_object/target_pose",
        "--engine",
        "c",
        "--worlds",
        "2",
        "--starts",
        "1",
        "--objects",
        "box_000",
    ]
    out = ["--out", str(tmp_path / "ppo")]
    assert main(["train", "ppo", *words, *out, "--policy", shipped]) == EXIT_INPUT
    (said,) = capsys.readouterr().err.splitlines()
    assert "about a task that opens or shuts one drawer or door" in said and "one object" in said


def test_the_engine_has_as_many_threads_as_there_are_jobs(tmp_path, monkeypatch, capsys):
    seen = {}

    def made(pool, worlds, engine, *, threads):
        seen.update(worlds=worlds, engine=engine, threads=threads)
        raise InputError("enough")

    monkeypatch.setattr(training, "from_pool", made)
    words = ["--engine", "c", "--worlds", "2", "--starts", "1", "--objects", "box_000"]
    words += ["--out", str(tmp_path / "ppo"), "--jobs", "3"]
    assert main(["train", "ppo", "single_object/target_pose", *words]) == EXIT_INPUT
    assert seen == {"worlds": 2, "engine": "c", "threads": 3}
    note, _ = capsys.readouterr().err.splitlines()
    assert "the policy does not see where the object shall go" in note
    assert main(["train", "ppo", TASK, "--jobs", "0"]) == EXIT_INPUT
    assert "jobs is 0; expected at least 1" in capsys.readouterr().err


@pytest.mark.parametrize("kept", [False, True])
def test_an_interruption_says_what_is_kept(kept, tmp_path, monkeypatch, capsys):
    """Of starts that are being drawn, then of an update before the first policy."""

    def interrupted(*given, **options):
        raise KeyboardInterrupt

    starts = tmp_path / "starts"
    monkeypatch.setattr(training, "from_pool" if kept else "draw_pool", interrupted)
    words = ["--engine", "c", "--worlds", "2", "--starts", "1", "--objects", PIECES[0]]
    words += ["--out", str(tmp_path / "ppo"), "--pool", str(starts)]
    assert main(["train", "ppo", TASK, *words]) == EXIT_INTERRUPTED
    said = f"kept: {starts}" if kept else "nothing was written yet"
    assert capsys.readouterr().err.splitlines()[-1] == f"manipose: interrupted; {said}"


@pytest.mark.full
def test_a_training_leaves_a_policy_that_evaluate_plays(tmp_path, capsys):
    words = [
        "train",
        "ppo",
        TASK,
        "--worlds",
        "4",
        "--starts",
        "2",
        "--updates",
        "1",
        "--engine",
        "c",
    ]
    out, results = tmp_path / "ppo", tmp_path / "results"
    assert main([*words, "--objects", *PIECES, "--out", str(out)]) == 0
    curve = json.loads((out / "curve.json").read_text())
    assert curve["rows"][-1]["actions"] == 4 * 16
    assert curve["starts"]["seeds"] == [0, 1] and {*curve["starts"]["objects"]} <= {*PIECES}
    on = ["--policy", str(out / POLICY_FILE), "--out", str(tmp_path / "on")]
    assert main([*words, "--objects", *PIECES, *on]) == 0
    actor, before = (
        jax.tree.leaves(eqx.filter(Trained.load(folder / POLICY_FILE).network.actor, eqx.is_array))
        for folder in (tmp_path / "on", out)
    )
    away = [float(abs(a - b).max()) for a, b in zip(actor, before, strict=True)]
    assert 0 < max(away) < 0.05  # another training's weights differ by 0.1 and more
    words = ["evaluate", TASK, "--objects", PIECES[0], "--episodes", "2", "--out", str(results)]
    words += ["--policy", "manipose_mj.learning:TrainedPolicy", "--hz", "5"]
    words += ["--policy-args", json.dumps({"path": str(out / POLICY_FILE)})]
    words += ["--obs-mode", "state+pose", "--control-mode", "pd_ee_pose"]
    assert main([*words, "--engine", "c", "--worlds", "2"]) == 0
    lines = (results / "results.jsonl").read_text().splitlines()
    assert [json.loads(line)["steps"] for line in lines] == [2000, 2000]


@pytest.mark.full
def test_a_task_of_ones_own_about_an_object_is_learnt_and_played(tmp_path, monkeypatch):
    """Each command in a process of its own, as the variable is read when the tasks are registered."""
    monkeypatch.setenv("MANIPOSE_TASKS", "lift_task")
    out, objects = tmp_path / "lift", ("--objects", "box_000")
    command = (sys.executable, "-m", "manipose_mj.cli.main")
    learn = ("train", "ppo", "example/lift", "--worlds", "4", "--starts", "2", "--updates", "1")
    play = ("evaluate", "example/lift", "--episodes", "1", "--obs-mode", "state+pose", "--hz", "5")
    policy = ("--policy", "manipose_mj.learning:TrainedPolicy", "--control-mode", "pd_ee_pose")
    path = ("--policy-args", json.dumps({"path": str(out / POLICY_FILE)}))
    for words in (
        (*learn, "--engine", "c", *objects, "--out", str(out)),
        (*play, *policy, *path, *objects, "--out", str(tmp_path / "results")),
    ):
        done = subprocess.run(
            [*command, *words], cwd=ROOT / "benchmarks" / "batch", capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
    assert Trained.load(out / POLICY_FILE).frame == "object"
    (line,) = (tmp_path / "results" / "results.jsonl").read_text().splitlines()
    assert json.loads(line)["steps"] == pytest.approx(1000, abs=1)
