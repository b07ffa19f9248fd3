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
from manipose_mj.robustness.variation import DRAWN, Variation, Varied
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
    variation, start = Variation(friction=2.0, shift_cm=3.0), environment.task.start
    varied, rng = Varied(environment, variation), np.random.RandomState(0)
    for _ in range(20):
        other, drawn = varied.draw(start, rng)
        assert set(drawn) == set(DRAWN)
        for name, most in (("friction", 2.0), ("mass", 1.4), ("gains", 1.2)):
            assert 1 / most <= drawn[name] <= most
        for name, most in (("latency_ms", 40.0), ("shift_cm", 3.0), ("turn_deg", 5.0)):
            assert abs(drawn[name]) <= most
        moved = other.objects["object"].pose[:3, 3] - start.objects["object"].pose[:3, 3]
        assert np.linalg.norm(moved) == pytest.approx(drawn["shift_cm"] / 100)
        assert moved[2] == 0 and other.goals is start.goals
        assert other.model.latency == pytest.approx(drawn["latency_ms"] / 1000)


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
    found = [Replay(0, dict(zip(DRAWN, (1.0, 1.0, 1.0, 0, 0, 0), strict=True)), True, True, True)]
    for number in range(40):
        values = rng.uniform(1.1, 1.4, 3), rng.uniform(1, 5, 3)
        drawn = dict(zip(DRAWN, np.concatenate(values).tolist(), strict=True))
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
    with pytest.raises(InputError, match="holds no demonstrations"):
        recorded_plans(TASK, str(tmp_path), 1)
    with pytest.raises(InputError, match="plans is 0"):
        recorded_plans(TASK, str(tmp_path), 0)
    for words, said in (
        ("--plans 8 --worlds 4", "at most one a world: 4"),
        ("--plans -1", "plans is -1"),
        ("--seed -1", "seed is -1"),
    ):
        assert main(["robustness", TASK, *words.split()]) == EXIT_INPUT
        assert said in capsys.readouterr().err


@pytest.mark.full
def test_a_recorded_plan_succeeds_where_it_was_made(tmp_path):
    plans = recorded_plans(TASK, "seeds", 1, objects=("box_000",))
    assert plans.config.control_mode == layout.RECORDED_MODE
    (found,) = replays(plans, Variation(), 1, engine="c")
    assert found.success and found.valid


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
