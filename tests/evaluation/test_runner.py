"""Evaluations repeat, survive a kill, and refuse what they cannot do."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path

import pytest

import tests.evaluation.fake_episodes as fake
from manipose_mj.errors import InputError, WorkerDiedError
from manipose_mj.evaluation import records, runner
from manipose_mj.evaluation.config import EvaluationConfig, episode_seed
from manipose_mj.evaluation.records import EpisodeResult, read_results, read_trajectory
from manipose_mj.evaluation.runner import evaluate

SCRIPT = Path(fake.__file__)


def timeless(path: Path) -> list[dict]:
    """The lines of a results file in their order, times left out."""
    documents = [json.loads(line) for line in path.read_text().splitlines()]
    for document in documents:
        del document["wall_s"]
        document["policy_s"] = 0.0
    return documents


def config(out: Path, **changes) -> EvaluationConfig:
    return EvaluationConfig(**{"tasks": fake.TASKS, "out": out, "episodes": 6, **changes})


def test_results_do_not_depend_on_the_number_of_jobs(tmp_path: Path) -> None:
    # Uneven sleeps make two workers finish out of order.
    evaluate(config(tmp_path / "one", jobs=1), runner=fake.make_runner(0.01))
    evaluate(config(tmp_path / "two", jobs=2), runner=fake.make_runner(0.01))
    one, two = (timeless(tmp_path / n / "results.jsonl") for n in ("one", "two"))
    assert len(one) == 12
    assert one == two
    for task in fake.TASKS:
        files = [records.trajectory_path(tmp_path / n, task, 5) for n in ("one", "two")]
        assert files[0].read_bytes() == files[1].read_bytes()
    assert not list(tmp_path.rglob(".*")), "staging files were left behind"


def test_seeds_depend_on_base_task_and_episode_only() -> None:
    seeds = {episode_seed(s, task, e) for s in range(3) for task in fake.TASKS for e in range(50)}
    assert len(seeds) == 300
    assert episode_seed(0, "single_object/target_pose", 0) == 478385717, "old results lost"


def test_every_result_is_on_disk_before_the_next_episode_ends(tmp_path: Path) -> None:
    counts = []

    def on_progress(done, total) -> None:
        counts.append((len(read_results(tmp_path / "results.jsonl")[0]), len(done), total))

    evaluate(config(tmp_path), runner=fake.make_runner(), on_progress=on_progress)
    assert counts == [(n, n, 12) for n in range(13)]


@pytest.mark.full
@pytest.mark.parametrize("jobs", [1, 2])
def test_kill_and_resume_loses_and_repeats_nothing(tmp_path: Path, jobs: int) -> None:
    out = tmp_path / "out"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    command = [sys.executable, str(SCRIPT), str(out), str(jobs)]
    process = subprocess.Popen([*command, "fresh"], env=environment)
    deadline = time.monotonic() + 60
    while len(read_results(out / "results.jsonl")[0]) < 8:
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    kept = timeless(out / "results.jsonl")
    assert 8 <= len(kept) < 40
    assert not (out / "summary.json").exists()

    subprocess.run([*command, "resume"], env=environment, check=True, timeout=60)
    resumed = timeless(out / "results.jsonl")
    assert all(line in resumed for line in kept)
    evaluate(
        EvaluationConfig(fake.TASKS, tmp_path / "whole", episodes=20, seed=3),
        runner=fake.make_runner(),
    )
    assert resumed == timeless(tmp_path / "whole" / "results.jsonl")


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_policy_may_change_its_folder(tmp_path: Path, monkeypatch, jobs: int) -> None:
    monkeypatch.chdir(tmp_path)
    plain = fake.make_runner()

    def wandering(*args, **options):
        os.chdir("/")
        return plain(*args, **options)

    results = evaluate(config(Path("out"), jobs=jobs, episodes=2), runner=wandering)
    out = tmp_path / "out"
    assert read_results(out / "results.jsonl")[0] == results
    assert (out / "summary.json").is_file()
    for result in results:
        read_trajectory(records.trajectory_path(out, result.task, result.episode))


def test_resume_runs_only_what_is_missing(tmp_path: Path) -> None:
    diary = tmp_path / "diary"
    out = tmp_path / "out"
    evaluate(config(out), runner=fake.make_runner(diary=diary))
    lines = (out / "results.jsonl").read_bytes().splitlines(keepends=True)
    # As a kill in the middle of a write leaves it: nine whole lines and a part of the tenth.
    (out / "results.jsonl").write_bytes(b"".join(lines[:9]) + lines[9][:40])
    diary.unlink()
    evaluate(config(out), resume=True, runner=fake.make_runner(diary=diary))
    assert len(diary.read_text().splitlines()) == 3
    assert timeless(out / "results.jsonl") == [
        {k: v for k, v in json.loads(line).items() if k != "wall_s"} for line in lines
    ]


def test_a_last_line_without_its_end_is_not_a_result(tmp_path: Path) -> None:
    evaluate(config(tmp_path, episodes=1), runner=fake.make_runner())
    path = tmp_path / "results.jsonl"
    path.write_bytes(path.read_bytes().rstrip(b"\n"))  # whole JSON, but an append would join it
    assert len(read_results(path)[0]) == 1


def test_resume_of_a_finished_evaluation_runs_nothing(tmp_path: Path) -> None:
    first = evaluate(config(tmp_path), runner=fake.make_runner())

    def never(env_config, spec, **options):
        raise AssertionError("ran an episode again")

    assert evaluate(config(tmp_path), resume=True, runner=never) == first


def test_results_are_never_overwritten(tmp_path: Path) -> None:
    evaluate(config(tmp_path), runner=fake.make_runner())
    before = (tmp_path / "results.jsonl").read_bytes()
    with pytest.raises(InputError, match="holds 12 results; add --resume"):
        evaluate(config(tmp_path), runner=fake.make_runner())
    assert (tmp_path / "results.jsonl").read_bytes() == before


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"seed": 1}, "seed"),
        ({"episodes": 5}, "episodes"),
        ({"tasks": fake.TASKS[:1]}, "tasks"),
        ({"objects": ("bowl_000",)}, "objects"),
    ],
)
def test_resume_refuses_another_configuration(tmp_path: Path, change: dict, named: str) -> None:
    evaluate(config(tmp_path), runner=fake.make_runner())
    with pytest.raises(InputError, match=f"its results have {named} "):
        evaluate(config(tmp_path, **change), resume=True, runner=fake.make_runner())


def test_resume_refuses_objects_that_were_built_again(tmp_path: Path) -> None:
    asset = tmp_path / "assets" / "mug"
    asset.mkdir(parents=True)

    def built(generator: str) -> None:
        provenance = {"source": "mesh", "inputs": {"mug.obj": "1"}, "generator": generator}
        document = {"schema_version": 1, "name": "mug", "provenance": provenance}
        (asset / "asset.json").write_text(json.dumps(document))

    built("one")
    asked = config(tmp_path / "out", objects=(str(asset.parent), "bowl_000"))
    evaluate(asked, runner=fake.make_runner())
    evaluate(asked, resume=True, runner=fake.make_runner())
    built("two")
    with pytest.raises(InputError, match="its results have assets sha256 "):
        evaluate(asked, resume=True, runner=fake.make_runner())


def test_resume_adds_tasks_and_episodes(tmp_path: Path) -> None:
    diary = tmp_path / "diary"
    out = tmp_path / "out"
    evaluate(config(out, tasks=fake.TASKS[:1], episodes=2), runner=fake.make_runner())
    more = evaluate(config(out), resume=True, runner=fake.make_runner(diary=diary))
    assert len(diary.read_text().splitlines()) == 10
    whole = evaluate(config(tmp_path / "whole"), runner=fake.make_runner())
    assert [result.seed for result in more] == [result.seed for result in whole]
    assert timeless(out / "results.jsonl") == timeless(tmp_path / "whole" / "results.jsonl")
    run = json.loads((out / "run.json").read_text())
    assert (run["tasks"], run["episodes"]) == (sorted(fake.TASKS), 6)
    assert "--episodes 6" in run["command"]
    assert len(json.loads((out / "summary.json").read_text())["tasks"]) == len(fake.TASKS)


def test_a_broken_line_before_the_last_is_an_error(tmp_path: Path) -> None:
    evaluate(config(tmp_path), runner=fake.make_runner())
    path = tmp_path / "results.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([lines[0], "{}\n", *lines[2:]]))
    with pytest.raises(InputError, match="line 2 is not an episode's result"):
        evaluate(config(tmp_path), resume=True, runner=fake.make_runner())


def test_output_folder_under_a_file_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write there"):
        evaluate(config(tmp_path / "file" / "out"), runner=fake.make_runner())


def test_a_full_disk_is_an_input_error_and_keeps_what_ended(tmp_path: Path, monkeypatch) -> None:
    written = []

    def append(file, result) -> None:
        if len(written) == 5:
            file.write(records.to_line(result).encode()[:30])  # as much as the disk still took
            file.flush()
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written.append(result)
        original(file, result)

    original = runner.append_result
    monkeypatch.setattr(runner, "append_result", append)
    with pytest.raises(InputError, match="No space left on device"):
        evaluate(config(tmp_path), runner=fake.make_runner())
    monkeypatch.undo()
    assert read_results(tmp_path / "results.jsonl")[0] == written
    assert len(evaluate(config(tmp_path), resume=True, runner=fake.make_runner())) == 12


def test_two_evaluations_do_not_share_a_folder(tmp_path: Path) -> None:
    def nested(env_config, spec, **options):
        with pytest.raises(InputError, match="another evaluation is writing there"):
            evaluate(config(tmp_path), runner=fake.make_runner())
        return fake.make_runner()(env_config, spec, **options)

    evaluate(config(tmp_path, episodes=1), runner=nested)


@pytest.mark.parametrize("jobs", [1, 2])
def test_wrong_input_in_an_episode_ends_the_evaluation(tmp_path: Path, jobs: int) -> None:
    def wrong(env_config, spec, **options):
        raise InputError("unknown object 'mgu'; did you mean mug?")

    with pytest.raises(InputError, match="did you mean mug"):
        evaluate(config(tmp_path, jobs=jobs), runner=wrong)


def test_a_crash_is_one_failed_episode(tmp_path: Path) -> None:
    sound = fake.make_runner()

    def crashing(env_config, spec, *, episode, **options):
        if episode == 2:
            raise FloatingPointError("qacc is\nnot finite")
        return sound(env_config, spec, episode=episode, **options)

    results = evaluate(config(tmp_path), runner=crashing)
    crashed = [r for r in results if r.episode == 2]
    assert {(r.failure, r.reason) for r in crashed} == {
        ("error", "FloatingPointError: qacc is not finite")
    }
    assert len(list(tmp_path.rglob("00002.error.txt"))) == 2


def test_half_a_character_in_what_a_stranger_says_costs_one_episode(tmp_path: Path) -> None:
    sound = fake.make_runner()

    def raising(env_config, spec, *, episode, **options):
        if episode == 0:
            raise ValueError("no file bad\udcff")
        result, trajectory = sound(env_config, spec, episode=episode, **options)
        if episode == 1:
            failed = {"success_at_end": False, "failure": "perception", "reason": "bad\udcff"}
            return replace(result, **failed), replace(trajectory, raised="KeyError: bad\udcff")
        return result, trajectory

    results = evaluate(config(tmp_path, episodes=3), runner=raising)
    said = {r.reason for r in results if r.episode < 2}
    assert said == {"ValueError: no file bad\\udcff", "bad\\udcff"}
    assert results == sorted(read_results(tmp_path / "results.jsonl")[0], key=lambda r: r.key)
    notes = sorted(tmp_path.rglob("*.error.txt"))
    assert len(notes) == 4 and all("bad\\udcff" in note.read_text("utf-8") for note in notes)


def test_a_number_that_is_not_finite_costs_one_episode(tmp_path: Path) -> None:
    sound = fake.make_runner()

    def infinite(env_config, spec, *, episode, **options):
        result, trajectory = sound(env_config, spec, episode=episode, **options)
        if episode == 0:
            result = EpisodeResult(**asdict(result) | {"max_penetration": float("nan")})
        return result, trajectory

    results = evaluate(config(tmp_path, episodes=2), runner=infinite)
    assert [r.failure == "error" and r.steps == 0 for r in results if r.episode == 0] == [True] * 2


def test_a_killed_worker_is_named_and_what_ended_is_kept(tmp_path: Path) -> None:
    sound = fake.make_runner()

    def deadly(env_config, spec, *, episode, **options):
        if episode == 4:
            os.kill(os.getpid(), signal.SIGKILL)
        return sound(env_config, spec, episode=episode, **options)

    with pytest.raises(WorkerDiedError, match="repeat with --resume"):
        evaluate(config(tmp_path, jobs=2), runner=deadly)
    assert len(evaluate(config(tmp_path), resume=True, runner=sound)) == 12


def test_trajectories_come_back(tmp_path: Path) -> None:
    evaluate(config(tmp_path), runner=fake.make_runner())
    path = records.trajectory_path(tmp_path, fake.TASKS[0], 3)
    trajectory = read_trajectory(path)
    assert trajectory.qpos.shape == (21, 2)
    assert trajectory.annotations[10] == "grasp_at"
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(InputError, match="not a trajectory"):
        read_trajectory(path)


@pytest.mark.parametrize(
    "changes",
    [{"tasks": ()}, {"tasks": ("a/b", "a/b")}, {"episodes": 0}, {"jobs": 0}, {"seed": -1}],
)
def test_configuration_is_checked(tmp_path: Path, changes: dict) -> None:
    with pytest.raises(InputError):
        config(tmp_path, **changes)
