"""A card says what its results say, and nothing that was edited passes the check."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import tests.evaluation.fake_episodes as fake
from manipose_mj.cli.main import main
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.cards.card import check_card
from manipose_mj.evaluation.cards.method import NEEDED, method_of, method_text
from manipose_mj.evaluation.config import EvaluationConfig
from manipose_mj.evaluation.records import from_line, to_line
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.evaluation.statistics import wilson_interval

TASK = "single_object/target_pose"
WORDS = ["--name", "Ours", "--code-url", "https://example.org/a", "--training-data", "none"]


def frozen_runner():
    """The fake runner, with the objects that the protocol has."""
    run = fake.make_runner()

    def runner(config, spec, *, episode, pose):
        result, trajectory = run(config, spec, episode=episode, pose=pose)
        objects = protocol.load("v1").episode(config.task, episode).objects
        document = json.loads(to_line(result)) | {"object": objects[0]}
        return from_line(json.dumps(document)), trajectory

    return runner


def evaluated(out: Path, **changes) -> Path:
    tasks = (TASK, "articulated/store_chips_can_middle_drawer")
    settings = {"tasks": tasks, "out": out, "episodes": 6, "protocol": "v1", **changes}
    evaluate(EvaluationConfig(**settings), runner=frozen_runner())
    return out


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return evaluated(tmp_path_factory.mktemp("cards") / "run")


@pytest.fixture
def card(results, tmp_path):
    out = tmp_path / "card"
    assert main(["card", str(results), *WORDS, "--out", str(out)]) == 0
    return out


def refusal(folder: Path, capsys) -> str:
    """What the check says of a card: one line, exit 2."""
    capsys.readouterr()
    assert main(["card", "--check", str(folder)]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1 and said.err.startswith("manipose: ") and not said.out
    return said.err


def test_a_card_states_both_rates_with_intervals_protocol_and_hash(card, results):
    content = json.loads((card / "card.json").read_text())
    (run,) = content["runs"]
    lines = [from_line(line) for line in (results / "results.jsonl").read_text().splitlines()]
    own = [line for line in lines if line.task == TASK]
    row = run["tasks"][TASK]
    at_end = sum(line.success_at_end for line in own)
    assert (row["n"], row["success_at_end"]) == (6, at_end)
    assert row["success_once"] == sum(line.success_once for line in own) >= at_end
    assert row["wilson_95"] == pytest.approx(wilson_interval(at_end, 6))
    assert sum(row["failures"].values()) == 6 - at_end
    assert run["protocol"] == "v1" and run["protocol_sha256"] == protocol.load("v1").sha256
    assert run["resample"] is None and "mujoco" in run["versions"]
    assert content["method"]["pose"] == "oracle" and content["name"] == "Ours"
    rates = [run["tasks"][task]["success_at_end"] / 6 for task in run["tasks"]]
    assert run["mean_success_at_end"] == pytest.approx(sum(rates) / 2)
    text = (card / "card.md").read_text()
    assert "true poses" in text and f"`{TASK}` | 6" in text and "https://example.org/a" in text


def test_a_card_says_how_many_of_the_tasks_it_covers(card):
    assert "\n2 of 34 tasks of the protocol. Mean over tasks: " in (card / "card.md").read_text()


def test_an_untouched_card_passes(card, capsys):
    assert check_card(card) == 12
    assert main(["card", "--check", str(card), str(card)]) == 0
    assert capsys.readouterr().out.count("agrees with its 12 episodes") == 2


def test_a_card_beside_its_results_passes(results, tmp_path):
    beside = tmp_path / "run"
    shutil.copytree(results, beside)
    assert main(["card", str(beside), *WORDS]) == 0
    assert (beside / "card.json").is_file() and not (beside / "runs").exists()
    assert check_card(beside) == 12


def edit_line(path: Path, number: int, **changes) -> None:
    lines = path.read_text().splitlines()
    lines[number] = json.dumps(json.loads(lines[number]) | changes)
    path.write_text("\n".join(lines) + "\n")


def test_an_edited_line_is_refused(card, capsys):
    path = card / "runs" / "0" / "results.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    failed = next(i for i, line in enumerate(lines) if not line["success_at_end"])
    done = {"success_at_end": True, "success_once": True, "failure": None, "reason": ""}
    edit_line(path, failed, **done, translation_error=0.0, rotation_error=0.0)
    assert "the results are not those the card was made of" in refusal(card, capsys)


def test_a_missing_seed_is_refused_and_named(card, capsys):
    path = card / "runs" / "0" / "results.jsonl"
    lines = path.read_text().splitlines()
    gone = json.loads(lines.pop(8))
    path.write_text("\n".join(lines) + "\n")
    message = refusal(card, capsys)
    assert (
        f"episode {gone['episode']} of {gone['task']}, seed {gone['seed']}, is missing" in message
    )


@pytest.mark.parametrize(
    ("line", "changes", "message"),
    [
        (2, {"seed": 7}, "has seed 7; protocol v1 has"),
        (8, {"object": "mug_000"}, "is about mug_000; the protocol has"),
        (2, {"episode": 9}, "is missing"),
        (2, {"steps": "many", "extra": 1}, "line 3 is not an episode's result"),
    ],
)
def test_lines_that_the_protocol_does_not_have_are_refused(card, capsys, line, changes, message):
    edit_line(card / "runs" / "0" / "results.jsonl", line, **changes)
    assert message in refusal(card, capsys)


def test_a_line_too_many_and_half_a_line_are_refused(card, capsys):
    path = card / "runs" / "0" / "results.jsonl"
    before = path.read_text()
    extra = json.loads(before.splitlines()[0]) | {"episode": 6}
    path.write_text(before + json.dumps(extra) + "\n")
    assert "is not of this run" in refusal(card, capsys)
    path.write_text(before + before[:40])
    assert "line 13 is not an episode's whole result" in refusal(card, capsys)


def nested(content, *path):
    for step in path[:-1]:
        content = content[step]
    return content, path[-1]


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("runs", 0, "results_sha256"), "0" * 64, "the card states 000000000000"),
        (("runs", 0, "tasks", TASK, "success_at_end"), 99, "success_at_end: 99; the results say"),
        (("runs", 0, "tasks", TASK, "wilson_95"), [0.9, 1.0], "wilson_95: 0: 0.9; the results say"),
        (("runs", 0, "protocol_sha256"), "abc", "protocol_sha256: 'abc'; the results say"),
        (("runs", 0, "versions", "mujoco"), "4.0", "versions: mujoco: '4.0'"),
        (("runs", 0, "folder"), "../other", "lies outside of the card's"),
        (("runs", 0, "folder"), "runs/1", "No such file"),
        (("method", "pose"), "estimated", "method: pose: 'estimated'; the results say 'oracle'"),
        (("schema_version",), 2, "schema_version is 2; expected 1"),
        (("name",), "", "name is ''"),
        (("code_url",), "example.org", "expected https://"),
        (("praise",), "best", "praise is not of a card"),
    ],
)
def test_a_card_that_says_something_else_is_refused(card, capsys, path, value, message):
    content = json.loads((card / "card.json").read_text())
    holder, last = nested(content, *path)
    holder[last] = value
    (card / "card.json").write_text(json.dumps(content))
    assert message in refusal(card, capsys)


def test_a_card_without_a_field_or_with_another_text_is_refused(card, capsys):
    before = (card / "card.json").read_text()
    content = json.loads(before)
    del content["runs"][0]["machine"]
    (card / "card.json").write_text(json.dumps(content))
    assert "runs: 0: machine is missing" in refusal(card, capsys)
    (card / "card.json").write_text("{")
    assert "not JSON" in refusal(card, capsys)
    (card / "card.json").write_text("{}")
    assert "not a card" in refusal(card, capsys)
    (card / "card.json").write_text(before)
    (card / "card.md").write_text("# Best\n")
    assert "not the text of card.json" in refusal(card, capsys)


def test_a_folder_without_a_card_is_told(tmp_path, capsys):
    assert f"{tmp_path}: no card; `manipose card` writes one" in refusal(tmp_path, capsys)
    assert f"{tmp_path}/none: no such folder" in refusal(tmp_path / "none", capsys)


def test_a_run_of_another_protocol_is_refused(card, capsys):
    path = card / "runs" / "0" / "run.json"
    run = json.loads(path.read_text())
    path.write_text(json.dumps(run | {"protocol sha256": "0" * 64}))
    assert "the run is of 000000000000" in refusal(card, capsys)
    path.write_text(json.dumps(run | {"protocol": None}))
    assert "no run of a protocol" in refusal(card, capsys)


def test_every_bad_card_of_several_gets_its_line(card, tmp_path, capsys):
    capsys.readouterr()
    assert main(["card", "--check", str(tmp_path / "a"), str(card), str(tmp_path / "b")]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 2 and "agrees" in said.out


def test_what_no_card_can_be_made_of_leaves_nothing(results, tmp_path, capsys):
    free = tmp_path / "free"
    evaluate(EvaluationConfig((TASK,), free, episodes=2), runner=fake.make_runner())
    out = tmp_path / "out"
    for words, message in (
        ([str(free), *WORDS, "--out", str(out)], "no run of a protocol"),
        ([str(tmp_path / "none"), *WORDS], "No such file"),
        ([str(results), "--name", "a"], "a card needs --code-url, --training-data"),
        ([str(results), str(results), *WORDS], "2 folders of results need --out"),
        ([str(results), str(results), *WORDS, "--out", str(out)], "two of the runs are the same"),
        ([str(results), *WORDS, "--out", str(free)], "exists; choose another --out"),
        ([str(results), "--check", "--name", "a"], "leave out --name"),
        ([], "no folder given"),
    ):
        capsys.readouterr()
        assert main(["card", *words]) == 2
        said = capsys.readouterr().err
        assert message in said and said.count("\n") == 1, said
    assert not out.exists() and not (results / "card.json").exists()


def test_runs_of_different_methods_make_no_card(results, tmp_path, capsys):
    other = evaluated(tmp_path / "other", pose="estimated")
    assert main(["card", str(results), str(other), *WORDS, "--out", str(tmp_path / "out")]) == 2
    assert "different methods" in capsys.readouterr().err


MASKS = "from true instance masks"
RULES = {"kind": "rules"}
ATTACHED = {"pose_source": "oracle", "mask_source": "oracle"}


@pytest.mark.parametrize(
    ("run", "pose", "masks", "text"),
    [
        ({}, "oracle", "none", "the baseline planner with true poses"),
        (
            {"pose": "estimated"},
            "estimated",
            "oracle",
            f"the baseline planner with poses estimated by the package's weights {MASKS}",
        ),
        (
            {"pose": "estimated", "estimator": {"name": "a:B", "given CAD": True}},
            "estimated",
            "oracle",
            f"poses estimated by `a:B` {MASKS} and the objects' meshes",
        ),
        (
            {"pose": "estimated_objects", "estimator": {"name": "a:B", "arguments": {"k": 1}}},
            "estimated_objects",
            "oracle",
            "with true poses of furniture, and poses of objects estimated by `a:B` with arguments "
            f'`{{"k": 1}}` {MASKS}',
        ),
        (
            {"planner": {"kind": "llm", "model": "m-1", "instruction": "Go\nthere."}},
            "oracle",
            "none",
            "the baseline with plans of the language model `m-1`, told `Go there.`, with true poses",
        ),
        (
            {"planner": {"kind": "replay", "replay sha256": "ab" * 32}},
            "oracle",
            "none",
            "the baseline with recorded plans `abababababababab` of a language model with true poses",
        ),
        (
            {"assets sha256": "cd" * 32},
            "oracle",
            "none",
            "with true poses; builds of own assets `cdcdcdcdcdcdcdcd`",
        ),
        (
            {"policy": {"obs_mode": "state+rgb", "arguments": '{"a": 1}'}},
            "none",
            "none",
            'policy `a:B` with arguments `{"a": 1}`, observations `state+rgb`',
        ),
        (
            {"policy": {"obs_mode": "state+pose"}, "batch": {"engine": "warp", "worlds": 8}},
            "oracle",
            "none",
            "observations `state+pose`, true poses among them; batched worlds of engine `warp`",
        ),
        (
            {"policy": {"obs_mode": "state+pointcloud"}},
            "none",
            "oracle",
            "observations `state+pointcloud`, true instance masks among them",
        ),
        (
            {"policy": {"obs_mode": "pose+segmentation"}},
            "oracle",
            "oracle",
            "`pose+segmentation`, true poses and true instance masks among them",
        ),
        (
            {"policy": {"obs_mode": "state", "attachment": ATTACHED}},
            "oracle",
            "oracle",
            "observations `state`; it was given the simulator, from which it says to take true poses "
            "and true instance masks",
        ),
        (
            {
                "policy": {
                    "obs_mode": "state",
                    "attachment": {**ATTACHED, "pose_source": "estimated"},
                }
            },
            "estimated",
            "oracle",
            "from which it says to take true instance masks and poses `estimated`",
        ),
    ],
)
def test_a_method_is_described_with_what_it_was_told(run, pose, masks, text):
    whole = {**dict.fromkeys(NEEDED), "pose": "oracle", "planner": RULES, **run}
    if whole["policy"]:
        whole["policy"] = {"name": "a:B", **whole["policy"]}
    method = method_of(whole)
    assert (method["pose"], method["masks"]) == (pose, masks)
    assert method_text(method).endswith(text)


def edit_run(card: Path, **changes) -> None:
    path = card / "runs" / "0" / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        (
            {"planner": {"kind": "llm", "model": "m"}},
            "planner: kind: 'rules'; the results say 'llm'",
        ),
        ({"batch": {"engine": "warp", "worlds": 2}}, "engine: None"),
        ({"assets sha256": "ab"}, "assets sha256: None"),
        ({"estimator metadata": {"weights": "b"}}, "estimator metadata is missing"),
    ],
)
def test_methods_that_differ_in_more_than_poses_are_two(
    card, results, tmp_path, capsys, changes, name
):
    other = tmp_path / "other"
    shutil.copytree(results, other)
    run = json.loads((other / "run.json").read_text())
    (other / "run.json").write_text(json.dumps(run | changes))
    assert main(["card", str(results), str(other), *WORDS, "--out", str(tmp_path / "two")]) == 2
    assert "different methods" in capsys.readouterr().err
    edit_run(card, **changes)
    assert f"method: {name}" in refusal(card, capsys)


def test_a_run_that_does_not_tell_its_method_is_refused(card, capsys):
    path = card / "runs" / "0" / "run.json"
    run = json.loads(path.read_text())
    del run["planner"]
    path.write_text(json.dumps(run))
    assert "lacks 'planner', so that it does not tell its method" in refusal(card, capsys)


def test_a_run_that_tells_of_less_than_its_episodes_got_is_refused(card, capsys):
    edit_run(card, policy={"name": "a:B", "obs_mode": "state"})
    assert "has pose_source 'oracle'; run.json tells of 'none'" in refusal(card, capsys)
    edit_run(card, policy={"name": "a:B", "obs_mode": "state+pose"})
    assert "method: policy: None; the results say" in refusal(card, capsys)
    edit_run(card, policy={"nome": "a:B"})
    assert "policy is {'nome': 'a:B'}; expected null or an object" in refusal(card, capsys)
    edit_run(card, policy={"name": "a:B", "obs_mode": "state", "hz": "fast"})
    assert "run.json: policy: no settings of a policy" in refusal(card, capsys)
