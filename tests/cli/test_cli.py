"""The command line: fast help, one clear line for bad input, exit codes that scripts can rely on."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import joblib
import pytest

import tests.evaluation.fake_episodes as fake
from manipose_mj.cli.builtin_objects import load_objects
from manipose_mj.cli.diagnosis import Finding
from manipose_mj.cli.main import main
from manipose_mj.evaluation.records import read_results

COMMANDS = (
    "demo",
    "evaluate",
    "list",
    "render",
    "view",
    "doctor",
    "card",
    "pose export",
    "pose score",
    "assets",
    "assets build",
    "assets check",
    "assets fetch",
    "assets label",
    "assets list",
    "assets relabel",
    "assets sheet",
    "assets show",
)


@pytest.fixture
def fake_episodes(monkeypatch) -> None:
    """Episodes without a simulator, and nothing built."""
    monkeypatch.setattr("manipose_mj.evaluation.episode.run_episode", fake.make_runner())
    monkeypatch.setattr("manipose_mj.evaluation.episode.scene_model", fake.scene)
    monkeypatch.setattr("manipose_mj.cli.builtin_objects.load_objects", lambda names, jobs: [])
    monkeypatch.setattr("manipose_mj.evaluation.report.film.STILL_SIZE", (20, 30))
    monkeypatch.setattr("manipose_mj.evaluation.report.html.WITHOUT_GL", None)
    monkeypatch.setattr("manipose_mj.evaluation.report.html.WITH_GL", None)


def complaint(capsys) -> str:
    """What the last command wrote on standard error: one line and nothing else."""
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert len(lines) == 1, captured.err
    assert lines[0].startswith("manipose: ")
    assert captured.out == ""
    return lines[0]


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys\n"
        "from manipose_mj.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit as end: assert end.code == 0\n"
        "heavy = {'numpy', 'mujoco', 'scipy', 'jax', 'matplotlib', 'dm_control', 'rich', 'joblib'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    shown = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert shown.returncode == 0, shown.stderr
    for command in COMMANDS:
        assert command.split()[0] in shown.stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command: str, capsys) -> None:
    with pytest.raises(SystemExit) as end:
        main([*command.split(), "--help"])
    assert end.value.code == 0
    text = capsys.readouterr().out
    assert f"usage: manipose {command}" in text
    assert len(text.splitlines()) > 5


def test_evaluate_has_the_documented_flags(capsys) -> None:
    with pytest.raises(SystemExit):
        main(["evaluate", "--help"])
    text = capsys.readouterr().out
    for flag in ("episodes", "seed", "pose", "jobs", "out", "resume", "objects"):
        assert f"--{flag}" in text


@pytest.mark.parametrize(
    "argv",
    [
        "evaluate single_object/target_pose --episodes many",
        "evaluate single_object/target_pose --pose guessed",
        "render single_object/target_pose",
        "assets",
    ],
)
def test_bad_flags_exit_with_2(argv: str, capsys) -> None:
    with pytest.raises(SystemExit) as end:
        main(argv.split())
    assert end.value.code == 2
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        ("evaluate single_object/target_pse", "did you mean single_object/target_pose"),
        (
            "evaluate single_object/target_pose --protocol v0",
            "unknown protocol 'v0'; did you mean v1",
        ),
        (
            "evaluate single_object/target_pse --protocol v1",
            "did you mean single_object/target_pose",
        ),
        ("evaluate single_object/target_pose --protocol v1 --seed 2", "leave out seed"),
        ("evaluate single_object/target_pose --protocol v1 --episodes 101", "has 100 episodes"),
        ("view single_object/target_pse", "did you mean"),
        ("view single_object/target_pose", "a window needs a display"),
        ("evaluate", "`manipose list` names them"),
        ("evaluate single_object/target_pose --resume", "--resume needs --out"),
        ("evaluate single_object/target_pose --episodes 0", "episodes is 0; expected at least 1"),
        ("evaluate single_object/target_pose --jobs 0", "jobs is 0; expected at least 1"),
        ("evaluate single_object/target_pose --seed -1", "seed is -1; expected at least 0"),
        ("evaluate single_object/target_pose --objects mgu_000", "did you mean mug_000"),
        ("evaluate single_object/target_pose --objects {tmp}/none", "no such folder"),
        ("render single_object/target_pse --out {tmp}/a.png", "did you mean"),
        ("render single_object/target_pose --out {tmp}/a.xyz", "try .png"),
        ("render single_object/target_pose --out {tmp}/a.png --width 0", "nothing to show"),
        ("assets list {tmp}/none", "no such folder"),
        ("assets list {tmp}", "holds no asset folder"),
        (
            "assets list {tmp}/broken/model.xml",
            "model.xml: is a file; expected a folder of an asset or of assets",
        ),
        (
            "evaluate single_object/target_pose --protocol v1-real --assets {tmp}/broken/model.xml",
            "model.xml: is a file; expected a folder of assets",
        ),
        (
            "demos replay {tmp}/demoss",
            "demoss: no such folder or file; expected what `manipose demos record` wrote",
        ),
        ("demos replay {tmp}/a.h5", "a.h5: no such folder or file; expected"),
        ("assets check {tmp}/none", "no such folder"),
        ("assets show {tmp}/broken", "field 'category' is missing"),
        ("assets show mgu_000", "did you mean mug_000"),
        ("assets build ycbb {tmp} --out {tmp}/out", "did you mean ycb"),
        ("assets build ycb {tmp}/none --out {tmp}/out", "none"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(argv: str, said: str, tmp_path, capsys) -> None:
    (tmp_path / "broken").mkdir()
    document = {"schema_version": 1, "kind": "rigid", "mass_properties": {}}
    document["mass_properties"] = {
        "mass": 1.0,
        "center_of_mass": [0, 0, 0],
        "inertia": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    }
    document |= {"stable_poses": [], "parts": [], "name": "broken"}
    document["provenance"] = {"source": "", "item": "", "licence": "", "inputs": {}}
    document["provenance"]["generator"] = ""
    (tmp_path / "broken" / "asset.json").write_text(json.dumps(document))
    (tmp_path / "broken" / "model.xml").write_text("<mujoco/>")
    if "show" not in argv:
        (tmp_path / "broken" / "asset.json").unlink()
    assert main([word.format(tmp=tmp_path) for word in argv.split()]) == 2
    assert said in complaint(capsys)
    assert not (tmp_path / "a.png").exists()


def test_check_of_an_unreadable_asset_names_file_and_field(tmp_path: Path, capsys) -> None:
    (tmp_path / "mug").mkdir()
    (tmp_path / "mug" / "asset.json").write_text('{"schema_version": "one"}')
    assert main(["assets", "check", str(tmp_path), "--jobs", "1"]) == 2
    line = complaint(capsys)
    assert str(tmp_path / "mug" / "asset.json") in line and "'schema_version'" in line


def test_build_of_a_truncated_archive_is_one_line(tmp_path: Path, capsys) -> None:
    archive, out = tmp_path / "006_mustard_bottle_google_16k.tgz", tmp_path / "new" / "out"
    archive.write_bytes(b"\x1f\x8b\x08\x00" + bytes(30))
    code = main(["assets", "build", "ycb", str(tmp_path), "--out", str(out), "--jobs", "1"])
    error = capsys.readouterr().err
    assert code == 2
    assert archive.name in error and len(error.splitlines()) == 1
    assert list(tmp_path.iterdir()) == [archive]


@pytest.mark.usefixtures("fake_episodes")
def test_evaluate_writes_everything_and_resumes(tmp_path: Path, capsys) -> None:
    out = tmp_path / "out"
    argv = ["evaluate", *fake.TASKS, "--episodes", "3", "--jobs", "1", "--out", str(out)]
    assert main(argv) == 0
    shown = capsys.readouterr()
    assert str(out / "report.html") in shown.out and fake.TASKS[0] in shown.out
    assert "failed in error" not in shown.out
    summary = json.loads((out / "summary.json").read_text())
    assert set(summary["tasks"]) == set(fake.TASKS)
    assert {
        "episodes",
        "success_at_end",
        "success_once",
        "wilson_95",
        "failures",
        "median_wall_s",
    } <= set(summary["tasks"][fake.TASKS[0]])
    assert (out / "report.html").exists()

    assert main(argv) == 2
    assert "holds 6 results; add --resume" in complaint(capsys)

    lines = (out / "results.jsonl").read_bytes().splitlines(keepends=True)
    (out / "results.jsonl").write_bytes(b"".join(lines[:4]) + lines[4][:10])
    assert main([*argv, "--resume"]) == 0
    assert len(read_results(out / "results.jsonl")[0]) == 6


@pytest.mark.usefixtures("fake_episodes")
def test_an_evaluation_in_which_nothing_could_be_played_fails(tmp_path, capsys, monkeypatch):
    def broken(config, spec, **options):
        raise KeyError("objekt")

    monkeypatch.setattr("manipose_mj.evaluation.episode.run_episode", broken)
    argv = ["evaluate", fake.TASKS[0], "--episodes", "2", "--jobs", "1"]
    assert main([*argv, "--out", str(tmp_path / "out")]) == 1
    assert "failed in error, 2 of 2: KeyError: 'objekt'" in capsys.readouterr().out


@pytest.mark.usefixtures("fake_episodes")
def test_evaluate_into_a_place_that_is_no_folder(tmp_path: Path, capsys) -> None:
    (tmp_path / "file").write_text("")
    assert (
        main(["evaluate", *fake.TASKS, "--jobs", "1", "--out", str(tmp_path / "file" / "out")]) == 2
    )
    assert "cannot write there" in complaint(capsys)


@pytest.mark.full
@pytest.mark.usefixtures("fake_episodes")
def test_demo_repeats_itself_and_spares_other_results(tmp_path: Path, capsys) -> None:
    demo = ["demo", "--jobs", "1", "--out"]
    assert main([*demo, str(tmp_path / "demo")]) == 0
    assert main([*demo, str(tmp_path / "demo")]) == 0
    other = tmp_path / "other"
    main(["evaluate", *fake.TASKS, "--episodes", "1", "--jobs", "1", "--out", str(other)])
    before = (other / "results.jsonl").read_bytes()
    capsys.readouterr()
    assert main([*demo, str(other)]) == 2
    assert "holds results that are not a demo's; choose another --out" in complaint(capsys)
    assert (other / "results.jsonl").read_bytes() == before


def test_list_is_complete_and_machine_readable(capsys) -> None:
    assert main(["list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert {row["task"] for row in listed["tasks"]} >= set(fake.TASKS)
    assert all(row["description"] for row in listed["tasks"])
    assert "mug_000" in listed["objects"]["mug"]


def test_show_takes_the_names_that_are_listed(capsys) -> None:
    assert main(["assets", "show", "mug_000", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["name"] == "mug_000"


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (KeyboardInterrupt(), 130),
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/full/file"), 2),
        (PermissionError(errno.EACCES, os.strerror(errno.EACCES), "/closed/file"), 2),
    ],
)
def test_interrupts_and_disks_end_in_one_line(error, code, monkeypatch, capsys) -> None:
    def fail(*names):
        raise error

    monkeypatch.setattr("manipose_mj.suite.describe", fail)
    assert main(["list"]) == code
    line = complaint(capsys)
    if isinstance(error, OSError):
        assert error.filename in line and os.strerror(error.errno) in line


@pytest.mark.parametrize(("status", "code"), [("ok", 0), ("absent", 0), ("missing", 1)])
def test_doctor_fails_only_for_what_is_needed(status, code, monkeypatch, capsys) -> None:
    findings = [Finding("engines", "MuJoCo C", status, "install [extra]")]
    monkeypatch.setattr("manipose_mj.cli.diagnosis.examine", lambda: findings)
    assert main(["doctor"]) == code
    shown = capsys.readouterr().out
    assert "install [extra]" in shown
    assert ("needed and missing: MuJoCo C" in shown) == (code == 1)


def test_building_objects_leaves_no_worker_to_what_comes_next(monkeypatch) -> None:
    def workers() -> set[int]:
        return set(joblib.Parallel(n_jobs=2)(joblib.delayed(os.getpid)() for _ in range(8)))

    monkeypatch.setattr("manipose_mj.assets.catalogue.is_built", lambda *name: False)
    before = workers()
    assert load_objects(["mug_000"], 2)[0].name == "mug_000"
    assert before.isdisjoint(workers())
