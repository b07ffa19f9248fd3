"""A training learns, comes out the same twice, and goes on where it was broken off."""

from __future__ import annotations

import dataclasses
import json
from types import SimpleNamespace

import equinox as eqx
import jax
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.points.clouds import batch_clouds
from manipose_mj.ppf_jax.points.symmetry import common_symmetry
from manipose_mj.ppf_jax.rigid.model import ModelConfig, PoseModel
from manipose_mj.ppf_jax.rigid.network import NetworkConfig
from manipose_mj.ppf_jax.rigid.refinement import RefinementConfig
from manipose_mj.ppf_jax.rigid.voting import VotingConfig
from manipose_mj.ppf_jax.training import loop
from manipose_mj.ppf_jax.training.loop import (
    CURVE_FILE,
    TrainingConfig,
    evaluate,
    learning_rate,
    mean_weights,
    train,
)
from manipose_mj.ppf_jax.training.losses import LossConfig
from manipose_mj.ppf_jax.training.saved_state import STATE_FILE, check_resumable
from tests.ppf_jax.half_visible import half_visible_clouds

STEPS, POINTS = 30, 64
CONFIG = TrainingConfig(
    steps=STEPS,
    warmup=3,
    log_every=1,
    evaluate_every=100,
    save_every=0.0,
    loss=LossConfig(pairs=200),
)


@dataclasses.dataclass(frozen=True)
class Tiny:
    """The configuration of `Weights`."""


@dataclasses.dataclass(frozen=True)
class Deep:
    """Of another."""

    depth: int = 3


class Weights(eqx.Module):
    """The smallest model."""

    values: jax.Array
    config: Tiny = eqx.field(static=True)

    def __init__(self, config, *, rng):
        self.values, self.config = jax.numpy.asarray(rng.normal(size=3)), config


class Broken(Exception):
    """Stands for whatever ends a process."""


@pytest.fixture(scope="module")
def bowls():
    return half_visible_clouds("bowl", [0, 1], 6, points=100)


@pytest.fixture(scope="module")
def model_config(bowls):
    return ModelConfig(
        symmetry=common_symmetry([bowls[0].symmetry]),
        network=NetworkConfig(neighbours=6, anchors=8),
        voting=VotingConfig(coarse_votes=200, directions=200),
        refinement=RefinementConfig(widths=(32, 64), steps=2, free_points=16),
        pairs=300,
        points=POINTS,
    )


def _batches(bowls, *, breaks_at=None):
    def from_step(start):
        for step in range(start, STEPS):
            if step == breaks_at:
                raise Broken
            rng = np.random.default_rng([1, step])
            chosen = [bowls[i] for i in rng.integers(0, len(bowls), 4)]
            yield batch_clouds(chosen, rng=rng, points=POINTS)

    return from_step


@pytest.fixture(scope="module")
def whole(bowls, model_config, tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    held_out = [batch_clouds(bowls[:4], rng=np.random.default_rng(0), points=POINTS)]
    model = train(_batches(bowls), model_config, CONFIG, folder, held_out=held_out)
    return model, json.loads((folder / CURVE_FILE).read_text()), held_out


def _without_time(curve):
    kept = ("step", "loss", "mu", "nu", "x", "refine", "score")
    return [{name: row[name] for name in kept} for row in curve]


@pytest.mark.full
def test_every_part_of_the_loss_falls(whole):
    _, curve, _ = whole
    assert [row["step"] for row in curve] == list(range(STEPS))
    for part in ("mu", "nu", "x", "extents", "refine", "score"):
        first, last = (np.mean([row[part] for row in some]) for some in (curve[:3], curve[-5:]))
        assert last < first, part
    assert all(row["y"] == 0 for row in curve)  # an axis of revolution has no Y to learn


@pytest.mark.full
def test_held_out_batches_are_measured_at_the_end(whole):
    model, curve, held_out = whole
    measured = evaluate(model, held_out)
    assert measured == {name: curve[-1][name] for name in measured}
    assert 0 <= measured["flips"] <= 1
    assert measured["oracle_deg"] <= measured["deg_mean"] <= 180


@pytest.mark.full
def test_a_broken_training_goes_on_as_if_it_had_not(bowls, model_config, whole, tmp_path):
    model, curve, held_out = whole
    with pytest.raises(Broken):
        train(_batches(bowls, breaks_at=11), model_config, CONFIG, tmp_path, held_out=held_out)
    assert (tmp_path / STATE_FILE).is_file()
    again = train(_batches(bowls), model_config, CONFIG, tmp_path, held_out=held_out)
    assert _without_time(json.loads((tmp_path / CURVE_FILE).read_text())) == _without_time(curve)
    for one, other in zip(jax.tree.leaves(model), jax.tree.leaves(again), strict=True):
        assert np.array_equal(one, other)
    finished = train(_batches(bowls, breaks_at=0), model_config, CONFIG, tmp_path)
    assert np.array_equal(jax.tree.leaves(finished)[0], jax.tree.leaves(again)[0])

    other_seed = dataclasses.replace(CONFIG, seed=5)
    with pytest.raises(InputError, match=r"training with seed 0 \(now 5\); give the same"):
        train(_batches(bowls), model_config, other_seed, tmp_path)
    with pytest.raises(InputError, match=r"training with --views None \(now 8\); give"):
        train(_batches(bowls), model_config, CONFIG, tmp_path, about={"--views": 8})
    state = (tmp_path / STATE_FILE).read_bytes()
    (tmp_path / STATE_FILE).write_bytes(state[: len(state) // 2])
    with pytest.raises(InputError, match="not a whole training state"):
        train(_batches(bowls), model_config, CONFIG, tmp_path)


@pytest.mark.full
def test_it_starts_from_weights_of_the_same_sizes(bowls, model_config, whole, tmp_path):
    model = train(_batches(bowls), model_config, CONFIG, tmp_path, initial=whole[0], minutes=1e-9)
    for mine, theirs in zip(jax.tree.leaves(model), jax.tree.leaves(whole[0]), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    narrow = dataclasses.replace(
        model_config, network=dataclasses.replace(model_config.network, width=8)
    )
    with pytest.raises(InputError, match="other sizes"):
        train(_batches(bowls), narrow, CONFIG, tmp_path / "b", initial=whole[0], minutes=1e-9)


@pytest.mark.full
def test_the_mean_of_weights_is_of_one_model_s_sizes(model_config, whole):
    other = PoseModel(model_config, rng=np.random.default_rng(3))
    mean = mean_weights([whole[0], other])
    for found, *both in zip(*map(jax.tree.leaves, (mean, whole[0], other)), strict=True):
        np.testing.assert_allclose(found, np.mean(both, axis=0), atol=1e-6)
    narrow = dataclasses.replace(
        model_config, network=dataclasses.replace(model_config.network, width=8)
    )
    with pytest.raises(InputError, match="other sizes"):
        mean_weights([other, PoseModel(narrow, rng=np.random.default_rng(3))])


def test_no_time_means_no_steps(bowls, model_config, tmp_path):
    train(_batches(bowls, breaks_at=0), model_config, CONFIG, tmp_path, minutes=1e-9)
    assert json.loads((tmp_path / CURVE_FILE).read_text()) == []


def test_weights_of_other_sizes_leave_no_folder(tmp_path):
    folder, initial = tmp_path / "out", [np.zeros(2)]
    with pytest.raises(InputError, match="other sizes"):
        train(lambda _: iter(()), Tiny(), CONFIG, folder, build=Weights, initial=initial)
    assert not folder.exists()


@pytest.fixture
def timed(bowls, monkeypatch, tmp_path):
    """Trains for some seconds of a clock by which each step takes one; gives the curve."""
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(loop.time, "monotonic", lambda: clock.now)
    monkeypatch.setattr(loop, "evaluate", lambda *_: {"deg_median": 1.0})
    held_out = [batch_clouds(bowls[:2], rng=np.random.default_rng(0), points=POINTS)]

    def stepped(state, *_):
        clock.now += 1.0
        return dataclasses.replace(state, step=state.step + 1), {"loss": 0.0}

    monkeypatch.setattr(loop, "_step", stepped)

    def curve(seconds, breaks_at=None):
        config = dataclasses.replace(CONFIG, log_every=4, save_every=1e9)
        batches = _batches(bowls, breaks_at=breaks_at)
        minutes = seconds / 60
        train(batches, Tiny(), config, tmp_path, build=Weights, held_out=held_out, minutes=minutes)
        return json.loads((tmp_path / CURVE_FILE).read_text())

    return curve


def test_time_that_is_over_ends_the_curve_with_held_out_errors(timed, tmp_path):
    curve = timed(7)
    assert [(row["step"], row["seconds"]) for row in curve] == [(0, 1), (4, 5), (6, 7)]
    assert ["deg_median" in row for row in curve] == [False, False, True]
    # Called again there is no time left.
    assert timed(7, breaks_at=7) == curve
    # More of it goes on, with a row of its own where a usual one had no errors.
    curve = timed(9)
    assert [row["step"] for row in curve] == [0, 4, 6, 8]
    assert "deg_median" in curve[-1]


def test_a_state_that_does_not_say_its_seconds_is_read(timed, tmp_path):
    curve = timed(6)
    head, rest = (tmp_path / STATE_FILE).read_bytes().split(b"\n", 1)
    old = json.loads(head)
    del old["seconds"]
    (tmp_path / STATE_FILE).write_bytes(json.dumps(old).encode() + b"\n" + rest)
    assert timed(6, breaks_at=6) == curve


def test_a_state_of_another_training_is_refused_with_what_differs(timed, tmp_path):
    timed(6)
    (tmp_path / "empty").mkdir()
    config = dataclasses.replace(CONFIG, log_every=4, save_every=1e9)
    other = dataclasses.replace(config, seed=5, loss=LossConfig(pairs=300))
    words = (
        r"--views None \(now \[8\]\), loss.pairs 200 \(now 300\), seed 0 \(now 5\); give the same"
    )
    with pytest.raises(InputError, match=f"state.eqx: the state of a training with {words}"):
        check_resumable(tmp_path, other, {"--views": (8,)})
    with pytest.raises(InputError, match=r"with depth None \(now 3\)"):
        check_resumable(tmp_path, config, {}, Deep())
    for folder, given, model in (
        (tmp_path, config, None),
        (tmp_path, config, Tiny()),
        (tmp_path / "empty", other, Deep()),
    ):
        check_resumable(folder, given, {}, model)
    many = dataclasses.replace(config, seed=5, steps=7, warmup=1, log_every=2, save_every=0.5)
    with pytest.raises(InputError, match="and 1 more; give"):
        check_resumable(tmp_path, many, {})
    (tmp_path / STATE_FILE).write_bytes(b"{}")
    with pytest.raises(InputError, match="not a whole training state"):
        check_resumable(tmp_path, config, {})


def test_the_learning_rate_rises_holds_and_falls():
    config = TrainingConfig(steps=1000, warmup=10, cooldown=0.5)
    rates = [learning_rate(config, step, step / 1000) for step in range(1000)]
    assert rates[0] == pytest.approx(config.learning_rate / 10)
    assert rates[10] == rates[499] == pytest.approx(config.learning_rate)
    assert np.all(np.diff(rates[500:]) <= 0) and rates[-1] < 0.01 * config.learning_rate
