"""Certificates: found, kept whole, replayed, and refused where they are of something else."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest

from manipose_mj.cli.main import main
from manipose_mj.control.baseline import MAX_PLANS
from manipose_mj.errors import InputError
from manipose_mj.evaluation import protocol
from manipose_mj.evaluation.certification import search
from manipose_mj.evaluation.certification.certificates import (
    Certificate,
    Certificates,
    causes,
    load_certificates,
    save_certificates,
)
from manipose_mj.evaluation.certification.redraw import redrawn
from manipose_mj.evaluation.certification.search import UNDRAWN, attempts, chosen_starts, verify
from manipose_mj.evaluation.protocol.frozen import digest, evaluation_seed, protocol_path
from manipose_mj.failures import STAGES
from manipose_mj.tasks.core.start import NoStartError

V1 = protocol.load("v1")
SHIPPED = load_certificates(V1)
TASK = "single_object/target_pose"
# One certified start a task, at places spread over the file.
SAMPLE = [
    min((key for key in SHIPPED.solved if key[0] == task), key=lambda key: (key[1] * 37 + i) % 100)
    for i, task in enumerate(sorted({task for task, _ in SHIPPED.solved}))
]


def test_the_file_comes_back_as_it_was_written(tmp_path):
    known = Certificates("v1").with_outcome((TASK, 3), Certificate(7, 5))
    known = known.with_outcome((TASK, 4), "plan: no grasp").with_outcome(
        (TASK, 5), "grasp: it slipped"
    )
    known = known.with_outcome((TASK, 5), Certificate(9, 10))
    known = replace(known, refused={(TASK, 5): ("plan: no path", "timeout: not done after 40 s")})
    save_certificates(known, V1, tmp_path / "c.json")
    again = load_certificates(V1, tmp_path / "c.json")
    assert again == known
    assert again.solved == {(TASK, 3): Certificate(7, 5), (TASK, 5): Certificate(9, 10)}
    assert again.unsolved == {(TASK, 4): "plan: no grasp"}
    assert load_certificates(V1, tmp_path / "none.json") == Certificates("v1")
    assert causes(again) == {(TASK, "plan"): 2, (TASK, "timeout"): 1}


def test_a_certificate_goes_with_its_start_and_stays_while_others_change(tmp_path):
    known = Certificates("v1").with_outcome((TASK, 0), Certificate(1, 5))
    known = known.with_outcome((TASK, 1), Certificate(2, 5)).with_outcome((TASK, 2), "plan: none")
    save_certificates(known, V1, tmp_path / "c.json")
    task = V1.task(TASK)
    names = list(task.episodes)
    episodes = {**task.episodes, names[1]: replace(task.episodes[names[1]], seed=1)}
    changed = replace(V1, tasks={**V1.tasks, TASK: replace(task, episodes=episodes)})
    some = load_certificates(changed, tmp_path / "c.json")
    assert some.solved == {(TASK, 0): Certificate(1, 5)} and some.lapsed == {(TASK, 1)}
    assert not some.with_outcome((TASK, 1), Certificate(3, 5)).lapsed
    longer = replace(V1, tasks={**V1.tasks, TASK: replace(task, horizon=task.horizon + 1)})
    lapsed = frozenset({(TASK, 0), (TASK, 1)})
    assert load_certificates(longer, tmp_path / "c.json") == Certificates("v1", lapsed=lapsed)


def test_starts_that_nobody_solved_are_drawn_again_in_their_place_and_counted():
    document = json.loads(protocol_path("v1").read_text(encoding="utf-8"))
    known = Certificates("v1").with_outcome((TASK, 3), "plan: no grasp")
    known = known.with_outcome((TASK, 4), Certificate(1, 5))
    content, left = redrawn(document, known)
    before, after = (each["tasks"][TASK]["episodes"] for each in (document, content))
    assert [i for i in range(100) if before[i] != after[i]] == [3]
    assert after[3]["object"] == before[3]["object"] and after[3]["seed"] == evaluation_seed(
        "v1", TASK, 3, 1
    )
    assert content["sha256"] == digest(content) != document["sha256"]
    assert left.refused == {(TASK, 3): ("plan: no grasp",)} and not left.unsolved
    again, _ = redrawn(content, left.with_outcome((TASK, 3), "grasp: it slipped"))
    assert again["tasks"][TASK]["episodes"][3]["seed"] == evaluation_seed("v1", TASK, 3, 2)


def _document(solved: str, unsolved: str = "{}", refused: str = "{}") -> str:
    fields = f'"solved": {solved}, "unsolved": {unsolved}, "refused": {refused}'
    return f'{{"version": "v1", {fields}}}'


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not a file of certificates"),
        ("[]", r"not a file of certificates; it is \[\]; expected 'version', 'solved', 'unsolved'"),
        ('{"version": "v1", "solved": {}}', "it has no 'unsolved'; expected 'version', 'solved'"),
        (_document("[]"), r"'solved' is \[\]; expected tasks with their episodes"),
        (_document('{"a": 3}'), "'solved', 'a' is 3; expected episodes by number"),
        (_document('{"a": {"x": {}}}'), "'solved', 'a' is {'x': {}}; expected episodes by number"),
        (
            _document('{"a": {"0": {"start": ""}}}'),
            """'solved', 'a', '0' is {'start': ''}; expected {"start", "planner_seed", "plans"}""",
        ),
        (_document("{}", '{"a": {"0": []}}'), "'unsolved', 'a', '0' is .*; expected {\"start\""),
        (_document("{}", "{}", '{"a": {"0": 1}}'), "'refused', 'a', '0' is 1; expected a list"),
        (
            '{"version": "v0", "solved": {}, "unsolved": {}, "refused": {}}',
            "of protocol v0, not of v1",
        ),
    ],
)
def test_other_files_are_refused(tmp_path, content, message):
    path = tmp_path / "c.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        load_certificates(V1, path)
    assert "c.json" in str(caught.value) and "\n" not in str(caught.value)


def test_starts_are_chosen_by_task_and_number():
    assert len(chosen_starts(V1)) == 100 * len(V1.tasks)
    assert chosen_starts(V1, [TASK], 2) == [(TASK, 0), (TASK, 1)]
    shelf = chosen_starts(V1, ["single_object/target_pose*", TASK], 1)
    assert shelf == [(TASK, 0), (f"{TASK}_shelf", 0)]
    with pytest.raises(InputError, match="no task fits"):
        chosen_starts(V1, ["none/*"])
    for wrong in (0, 101):
        with pytest.raises(InputError, match=f"episodes is {wrong}; expected 1 to 100"):
            chosen_starts(V1, [TASK], wrong)


def test_the_first_attempt_is_what_an_evaluation_plays():
    assert attempts(2**32 - 1)[0] == Certificate(2**32 - 1, MAX_PLANS)
    assert attempts(2**32 - 1)[1].planner_seed == 0
    assert attempts(0)[-1].plans > MAX_PLANS
    assert attempts(0, 2)[:3] == attempts(0)
    assert [each.planner_seed for each in attempts(0, 2)] == list(range(6))


def test_every_start_of_v1_is_certified_and_draws_before_it_are_counted():
    assert SHIPPED.solved.keys() == set(chosen_starts(V1))
    assert not SHIPPED.unsolved
    stages = {*STAGES, UNDRAWN}
    reasons = [reason for given in SHIPPED.refused.values() for reason in given]
    assert reasons and all(reason.partition(":")[0] in stages for reason in reasons)


@pytest.mark.sample(1)
@pytest.mark.parametrize("start", SAMPLE, ids=lambda start: f"{start[0]}-{start[1]}")
def test_a_shipped_certificate_solves_its_start(start):
    assert list(verify("v1", SHIPPED, [start], jobs=1)) == [(start, SHIPPED.solved[start])]


def test_a_file_that_is_not_there_is_no_file_without_certificates(tmp_path, capsys):
    words = ["protocol", "verify", "--tasks", TASK, "--episodes", "1"]
    assert main([*words, "--certificates", str(tmp_path / "typo.json")]) == 2
    assert "typo.json: no such file of certificates" in capsys.readouterr().err


@pytest.mark.full
def test_commands_find_and_replay(tmp_path, capsys):
    out = str(tmp_path / "c.json")
    chosen = ["--tasks", TASK, "--episodes", "1", "--jobs", "1"]
    assert main(["protocol", "certify", "--out", out, *chosen]) == 0
    assert "1 certified, 0 unsolved" in capsys.readouterr().out
    assert main(["protocol", "verify", "--certificates", out, *chosen]) == 0
    assert (
        "1 of 1 certificates hold, 0 starts are solved by other samples, 0 by none"
        in capsys.readouterr().out
    )
    assert main(["protocol", "certify", "--out", str(tmp_path / "no" / "c.json"), *chosen]) == 2


def test_a_certificate_that_no_longer_holds_is_exit_1_with_its_reason(
    tmp_path, capsys, monkeypatch
):
    known = Certificates("v1")
    for number in (0, 1, 3):
        known = known.with_outcome((TASK, number), Certificate(number, MAX_PLANS))
    save_certificates(known.with_outcome((TASK, 2), "plan: no grasp"), V1, tmp_path / "c.json")
    outcomes = [((TASK, 1), known.solved[TASK, 1]), ((TASK, 3), Certificate(9, 15))]
    monkeypatch.setattr(search, "verify", lambda *_: iter(outcomes))
    words = ["--tasks", TASK, "--episodes", "5", "--certificates", str(tmp_path / "c.json")]
    assert main(["protocol", "verify", *words]) == 0
    said, told = capsys.readouterr()
    other = f"{TASK} 3: its certificate does not hold here; solved by planner seed 9 and 15 plans"
    assert other in said and other in told  # as it is found
    outcomes.append(((TASK, 0), "grasp: it slipped"))
    assert main(["protocol", "verify", *words]) == 1
    said, told = capsys.readouterr()
    assert f"{TASK} 0: grasp: it slipped" in said and f"{TASK} 0: grasp: it slipped" in told
    assert (
        "1 of 3 certificates hold, 1 starts are solved by other samples, 1 by none; of 5 starts, "
        "1 are known as unsolved and 1 untried" in said
    )


def test_a_certificate_of_another_start_has_lapsed_and_is_exit_1(tmp_path, capsys, monkeypatch):
    known = Certificates("v1").with_outcome((TASK, 0), Certificate(0, MAX_PLANS))
    path = tmp_path / "c.json"
    save_certificates(known.with_outcome((TASK, 1), Certificate(1, MAX_PLANS)), V1, path)
    document = json.loads(path.read_text(encoding="utf-8"))
    document["solved"][TASK]["001"]["start"] = "0" * 12
    path.write_text(json.dumps(document), encoding="utf-8")
    monkeypatch.setattr(search, "verify", lambda *_: iter([((TASK, 0), known.solved[TASK, 0])]))
    words = ["--tasks", f"{TASK[:-1]}?", "--episodes", "3", "--certificates", str(path)]
    assert main(["protocol", "verify", *words]) == 1
    said = capsys.readouterr().out
    assert f"{TASK} 1: its certificate has lapsed" in said
    assert (
        "1 of 1 certificates hold, 0 starts are solved by other samples, 0 by none; of 3 starts, the certificates of 1 "
        "have lapsed, 0 are known as unsolved and 1 untried" in said
    )


def test_where_a_certificate_does_not_hold_other_samples_are_tried(monkeypatch):
    played = []

    def solved_by_the_last(config, spec, *, planner_seed, plans, **_):
        played.append(Certificate(planner_seed, plans))
        succeeded = plans == attempts(0)[-1].plans
        return SimpleNamespace(success_at_end=succeeded, failure="grasp", reason="slipped"), None

    monkeypatch.setattr(search, "run_episode", solved_by_the_last)
    start = (TASK, 0)
    tried = attempts(V1.episode(*start).seed)
    assert search._outcome("v1", start, tried[0]) == (start, tried[-1])
    assert played == list(tried)
    assert search._outcome("v1", start, tried[-1]) == (start, tried[-1])
    monkeypatch.setattr(search, "attempts", lambda seed, rounds=1: tried[:2])
    assert search._outcome("v1", start, tried[1]) == (start, "grasp: slipped")


def test_a_start_that_cannot_be_drawn_is_unsolved_and_stops_nothing(monkeypatch):
    def draw_none(*_, **__):
        raise NoStartError("a spoon lies where no hand gets at it")

    monkeypatch.setattr(search, "run_episode", draw_none)
    found = search._outcome("v1", (TASK, 0), None)
    assert found == ((TASK, 0), "start: a spoon lies where no hand gets at it")
