"""Recorded plans in other worlds: what is drawn, the world that a plan was made in, the maps, and the command."""

import json
from pathlib import Path

import numpy as np
import pytest

from manipose_mj import suite
from manipose_mj.batch.drawing import draw_pool
from manipose_mj.cli.main import EXIT_INPUT, main
from manipose_mj.demos import layout
from manipose_mj.errors import InputError
from manipose_mj.robustness import replay
from manipose_mj.robustness.plans import Plans, RecordedPlan, recorded_plans
from manipose_mj.robustness.replay import Replay, replays
from manipose_mj.robustness.success_maps import document, draw
from manipose_mj.robustness.variation import DRAWN, ERRORS, FACTORS, Variation, Varied
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec

TASK, SEED = "single_object/target_pose", 3
CONFIG = EnvConfig(TASK, obs_mode="state", objects=("box_000",))


@pytest.fixture(scope="module")
def environment():
    """At the start of the episode."""
    made = suite.make(CONFIG, SEED)
    made.reset(EpisodeSpec(seed=SEED))
    return made


def test_draws_stay_within_their_bounds_and_move_object_but_not_goal(environment):
    variation = Variation(friction=2.0, shift_cm=3.0, object_shift_cm=0.0, object_turn_deg=0.0)
    start = environment.task.start
    varied, rng = Varied(environment, variation), np.random.RandomState(0)
    for _ in range(20):
        other, drawn = varied.draw(start, rng)
        assert set(drawn) == set(DRAWN)
        for name, most in (("friction", 2.0), ("pad_friction", 1.5), ("mass", 1.4)):
            assert 1 / most <= drawn[name] <= most
        assert 1 / 1.2 <= drawn["gains"] <= 1.2
        for name, most in (("latency_ms", 40.0), ("shift_cm", 3.0), ("turn_deg", 5.0)):
            assert abs(drawn[name]) <= most
        assert drawn["object_shift_cm"] == drawn["object_turn_deg"] == 0.0
        moved = other.objects["object"].pose[:3, 3] - start.objects["object"].pose[:3, 3]
        assert np.linalg.norm(moved) == pytest.approx(drawn["shift_cm"] / 100)
        assert moved[2] == 0 and other.goals is start.goals
        assert other.model.latency == pytest.approx(drawn["latency_ms"] / 1000)


def test_the_pads_grip_is_drawn_apart_from_other_friction(environment):
    pads = environment.physics.bind(environment.task.robot.pad_geoms).element_id
    others = np.setdiff1d(np.arange(environment.physics.model.ngeom), pads)
    compiled = np.array(environment.physics.model.geom_friction)
    rng, start = np.random.RandomState(0), environment.task.start
    other, drawn = Varied(environment, Variation(friction=1.0, pad_friction=4.0)).draw(start, rng)
    friction = other.model.fields["geom_friction"]
    assert drawn["friction"] == 1.0 and abs(np.log(drawn["pad_friction"])) > 0.1
    np.testing.assert_allclose(friction[pads, 0], drawn["pad_friction"] * compiled[pads, 0])
    np.testing.assert_array_equal(friction[others], compiled[others])
    alone = Variation(1.0, 4.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    other, drawn = Varied(environment, alone).draw(start, rng)
    np.testing.assert_array_equal(other.model.fields["geom_friction"][pads, 1:], compiled[pads, 1:])
    assert set(other.model.fields) >= {"body_mass", "actuator_gainprm"}


def test_objects_have_errors_of_their_own_and_are_not_put_into_others():
    made = suite.make(EnvConfig("clutter/pick", obs_mode="state"), 1)
    made.reset(EpisodeSpec(seed=1))
    start, rng = made.task.start, np.random.RandomState(0)
    variation = Variation(shift_cm=0.0, turn_deg=0.0, object_shift_cm=6.0, object_turn_deg=40.0)
    varied, moves = Varied(made, variation), []
    before = varied.depth(start)
    for _ in range(3):
        other, drawn = varied.draw(start, rng)
        assert varied.depth(other) < before + 0.001
        shifts = {}
        for name, placed in other.objects.items():
            shifts[name] = placed.pose[:3, 3] - start.objects[name].pose[:3, 3]
        moves.append(np.linalg.norm(list(shifts.values()), axis=1))
        assert all(abs(shift[2]) < 1e-12 for shift in shifts.values())
        first = next(iter(start.objects))
        assert 100 * np.linalg.norm(shifts[first]) == pytest.approx(drawn["object_shift_cm"])
        turn = other.objects[first].pose[:3, :3] @ start.objects[first].pose[:3, :3].T
        angle = np.rad2deg(np.arctan2(turn[1, 0], turn[0, 0]))
        assert turn[2, 2] == pytest.approx(1) and angle == pytest.approx(drawn["object_turn_deg"])
    assert np.ptp(moves, axis=1).min() > 0.005 and np.max(moves) <= 0.06
    bare = Variation(shift_cm=0.0, turn_deg=0.0, object_shift_cm=30.0)
    crowded = [Varied(made, bare).draw(start, rng)[0] for _ in range(3)]
    assert all(varied.depth(each) < before + 0.001 for each in crowded)


def test_the_world_of_a_plan_is_that_of_its_episode_whatever_was_drawn_before():
    def vary(environment, start):
        varied, rng = Varied(environment, Variation()), np.random.RandomState(0)
        for nominal in (True, False, True):
            yield varied.draw(start, rng, nominal=nominal)[0]

    expected = draw_pool(CONFIG, [SEED]).starts[0]
    first, other, again = draw_pool(CONFIG, [SEED], vary).starts
    assert (
        not first.model and not again.model and set(other.model) >= {"geom_friction", "body_mass"}
    )
    for start in (first, again):
        np.testing.assert_array_equal(start.simulation, expected.simulation)
    assert first.simulation.shape == other.simulation.shape
    assert np.abs(first.simulation - other.simulation).max() > 1e-4


@pytest.mark.full
def test_plans_that_do_nothing_succeed_nowhere_and_worlds_are_shared_out(monkeypatch):
    monkeypatch.setattr(replay, "_AT_ONCE", 2)
    still = np.tile(np.append(np.zeros(7), 0.08), (3, 1))
    plans = Plans(CONFIG, (RecordedPlan(SEED, still), RecordedPlan(4, still[:2])))
    found = replays(plans, Variation(), 3, engine="c")
    assert sorted(each.plan for each in found) == [SEED, SEED, 4]
    assert all(each.valid and not each.success and not each.once for each in found)
    planned = [each for each in found if each.drawn["friction"] == 1.0]
    assert {each.plan for each in planned} == {SEED, 4} and len(planned) == 2
    with pytest.raises(InputError, match="1 worlds for 2 plans"):
        replays(plans, Variation(), 1, engine="c")


def test_maps_count_valid_worlds_alone(tmp_path):
    rng = np.random.default_rng(0)
    nothing = dict.fromkeys(FACTORS, 1.0) | dict.fromkeys(ERRORS, 0.0)
    found = [Replay(0, nothing, True, True, True)]
    for number in range(40):
        values = rng.uniform(1.1, 1.4, len(FACTORS)), rng.uniform(1, 5, len(ERRORS))
        drawn: dict[str, float] = dict(zip(DRAWN, np.concatenate(values).tolist(), strict=True))
        good = drawn["shift_cm"] < 3
        found.append(Replay(0, drawn, good, good, number > 0))
    said = document(TASK, Variation(), found, engine="c")
    assert said["as_planned"]["successes"] == 1 and said["varied"]["worlds"] == 39
    assert said["varied"]["invalid"] == 1
    rows = said["by_value"]["shift_cm"]
    assert rows[0]["share"] == 1.0 and rows[-1]["share"] == 0.0
    assert json.loads(json.dumps(said))["worlds"][0]["plan"] == 0
    draw(said, tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_wrong_input_is_one_line(tmp_path, capsys):
    with pytest.raises(InputError, match="--friction is 0.5; expected a factor of 1 or more"):
        Variation(friction=0.5)
    with pytest.raises(InputError, match="--shift-cm is -1"):
        Variation(shift_cm=-1.0)
    with pytest.raises(InputError, match="--latency-ms is 60000; expected less than 10000"):
        Variation(latency_ms=60000)
    with pytest.raises(InputError, match="--object-turn-deg is nan; expected 0 or more"):
        Variation(object_turn_deg=float("nan"))
    with pytest.raises(InputError, match="holds no demonstrations"):
        recorded_plans(TASK, str(tmp_path), 1)
    with pytest.raises(InputError, match="demoss: no such folder or file; expected"):
        recorded_plans(TASK, "demoss", 1)
    with pytest.raises(InputError, match="plans is 0"):
        recorded_plans(TASK, str(tmp_path), 0)
    for words, said in (
        ("--plans 8 --worlds 4", "at most one a world: 4"),
        ("--plans -1", "plans is -1"),
        ("--seed -1", "seed is -1"),
    ):
        assert main(["robustness", TASK, *words.split()]) == EXIT_INPUT
        assert said in capsys.readouterr().err


@pytest.fixture(scope="module")
def plans():
    return recorded_plans(TASK, "seeds", 1, objects=("box_000",))


@pytest.mark.full
def test_a_recorded_plan_succeeds_where_it_was_made(plans):
    assert plans.config.control_mode == layout.RECORDED_MODE
    (found,) = replays(plans, Variation(), 1, engine="c")
    assert found.success and found.valid


@pytest.mark.full
def test_a_plan_fails_with_slippery_pads_and_waits_for_late_set_points(plans):
    slippery = Variation(1.0, 1e4, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    found = replays(plans, slippery, 9, engine="c")
    assert not any(each.success for each in found if each.drawn["pad_friction"] < 0.01)
    assert all(each.success for each in found if each.drawn["pad_friction"] > 0.8)
    assert 2 <= sum(each.drawn["pad_friction"] < 0.1 for each in found) <= 6
    late = Variation(1.0, 1.0, 1.0, 1.0, 5000.0, 0.0, 0.0, 0.0, 0.0)
    found = replays(plans, late, 5, engine="c")
    assert all(each.success for each in found)
    assert max(each.drawn["latency_ms"] for each in found) > 1000


@pytest.mark.full
def test_the_command_writes_a_document_and_a_picture(tmp_path, capsys):
    from manipose_mj.cli.robustness import robustness

    out = Path(tmp_path) / "out"
    robustness(TASK, plans=1, worlds=2, engine="c", out=out, objects=("box_000",), jobs=1)
    assert "as planned: 1 of 1" in capsys.readouterr().out
    assert {path.name for path in out.iterdir()} == {"robustness.json", "robustness.png"}
    with pytest.raises(
        InputError, match=r"robustness.json: is there already; choose another --out"
    ):
        robustness(TASK, plans=1, worlds=2, engine="c", out=out, objects=("box_000",), jobs=1)
