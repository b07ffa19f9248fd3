"""Policies in batched worlds: the verdicts of the tasks' own environments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from manipose_mj.batch import make
from manipose_mj.cli.main import EXIT_INPUT, main
from manipose_mj.errors import InputError
from manipose_mj.evaluation.batched import batched_results
from manipose_mj.evaluation.config import BatchSettings, EvaluationConfig
from manipose_mj.evaluation.injected_errors import InjectedErrors
from manipose_mj.evaluation.policy_settings import PolicySettings
from manipose_mj.evaluation.runner import evaluate
from manipose_mj.learning import grip, handle_frame
from manipose_mj.mjcf.panda.robot import HOME
from manipose_mj.poses import compose, invert, vector_to_pose
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec, TaskConfig
from manipose_mj.tasks.core.preview import Preview
from manipose_mj.tasks.core.start import EpisodeStart, PlacedObject
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.goals import Goal
from tests.conformance.own_tasks import registered

TASK = "articulated/open_middle_drawer"
_NEAR, _SHUT = 0.03, 0.03


class Puller:
    """Goes before the handle, to it, shuts the gripper and pulls: a function of the present alone."""

    def reset(self, **episode) -> None: ...

    def act(self, observation: Mapping[str, Array]) -> Array:
        frame = handle_frame.grip_frame(observation)
        now = invert(frame) @ vector_to_pose(jnp.asarray(observation["panda/tcp_pose"]))
        place, turn = now[:, :3, 3], grip.rotation_vector(now[:, :3, :3])
        aside = jnp.linalg.norm(place[:, :2], axis=-1)
        before = (aside < _NEAR) & (jnp.linalg.norm(turn, axis=-1) < 0.2)
        there = before & (jnp.abs(place[:, 2]) < _NEAR)
        shut = there & (observation["panda/gripper_opening"][:, 0] < _SHUT)
        forth = jnp.where(shut, -0.8, jnp.where(before, 0.0, -0.7))
        none = jnp.zeros_like(forth)
        columns = [none, none, forth, none, none, none, jnp.where(there, -1.0, 1.0)]
        return handle_frame.command(observation, jnp.stack(columns, axis=-1))

    def infer(self, obs):
        seen = {name: jnp.asarray(obs[name], jnp.float32)[None] for name in handle_frame.SEEN}
        return {"actions": np.asarray(compiled_act(seen), float)}


compiled_act = jax.jit(Puller().act)


class Alone:
    """A policy that acts in one world only."""

    def reset(self, **episode) -> None: ...

    def infer(self, obs):
        return {"actions": np.zeros((1, 8))}


class Raising(Alone):
    """A policy with a mistake in it."""

    def act(self, observation):
        raise KeyError("weights")


class Narrow(Alone):
    """A policy that leaves the gripper out."""

    def act(self, observation):
        return jnp.zeros((2, 6))


class Nothing(Alone):
    """A policy that answers no numbers."""

    def infer(self, obs):
        return {"actions": np.full((1, 7), np.nan)}

    def act(self, observation):
        return jnp.full((len(observation["panda/tcp_pose"]), 7), jnp.nan)


class Unready(Puller):
    """A policy that cannot begin."""

    def reset(self, **episode):
        raise RuntimeError("no\nweights")


def config(out: Path, policy: str, batch: BatchSettings | None, **changes) -> EvaluationConfig:
    settings = {"obs_mode": "state+pose", "control_mode": "pd_ee_pose", "hz": 5.0}
    return EvaluationConfig(
        (TASK,),
        out,
        episodes=3,
        objects=("cabinet_000", "cabinet_003"),
        policy=PolicySettings(f"tests.evaluation.test_batched:{policy}", **{**settings, **changes}),
        batch=batch,
    )


@pytest.mark.full
@pytest.mark.parametrize("stop", ["success", "horizon"])
def test_verdicts_are_those_of_single_environments(tmp_path, stop):
    alone = evaluate(config(tmp_path / "alone", "Puller", None, stop=stop))
    batch = BatchSettings("c", 2)
    together = evaluate(replace(config(tmp_path / "together", "Puller", batch, stop=stop), jobs=2))
    assert any(result.success_at_end for result in together)
    for one, other in zip(alone, together, strict=True):
        for name in ("seed", "object", "success_once", "success_at_end", "failure", "pose_source"):
            assert getattr(one, name) == getattr(other, name), name
        assert abs(one.steps - other.steps) <= 10  # trajectories differ in their last digits
        assert other.max_penetration is None
    again = evaluate(config(tmp_path / "together", "Puller", batch, stop=stop), resume=True)
    assert again == together


@dataclass(frozen=True)
class HighGoal(Goal):
    """The gripper above a height."""

    object: str
    height: float = 0.33

    def met(self, state, tolerance):
        return state.tcp_pose[..., 2, 3] > self.height

    def progress(self, state, tolerance):
        return state.tcp_pose[..., 2, 3].clip(0, 1)


class HighTask(ManipulationTask):
    """A goal that the arm has met before it moves."""

    def __init__(self, env_config: EnvConfig) -> None:
        super().__init__(TaskConfig(horizon=4.0), env_config)
        self.pool = self.scene.add_objects(env_config.assets())

    def sample(self, rng, spec: EpisodeSpec, preview: Preview) -> EpisodeStart:
        rest = self.pool.entities[0].asset.stable_poses[0]
        pose = compose(rest.rotation, np.array([0.5, 0.0, rest.height]))
        return EpisodeStart(goals=(HighGoal("object"),), objects={"object": PlacedObject(0, pose)})


class Lowering(Alone):
    """Goes down."""

    def infer(self, obs):
        return {"actions": np.asarray(self.act({"panda/joint_positions": HOME[None]}))}

    def act(self, observation):
        low = jnp.array([0.0, 1.2, 0.0, -2.0, 0.0, 3.2, 0.8, 0.08])
        return jnp.tile(low, (len(observation["panda/joint_positions"]), 1))


class Silent(Alone):
    """Shuts the gripper and answers no numbers then."""

    def infer(self, obs):
        seen = {name: np.asarray(obs[name])[None] for name in obs if name.startswith("panda/")}
        return {"actions": np.asarray(self.act(seen), float)}

    def act(self, observation):
        joints = jnp.asarray(observation["panda/joint_positions"])
        shut = observation["panda/gripper_opening"][:, :1] < 0.05
        return jnp.where(shut, jnp.nan, jnp.pad(joints, ((0, 0), (0, 1))))


@pytest.mark.full
@pytest.mark.parametrize(
    ("policy", "hz", "stop", "latency"),
    [("Lowering", 1.0, "success", 600.0), ("Silent", 10.0, "horizon", 0.0)],
)
def test_what_holds_while_an_action_is_held_counts(policy, hz, stop, latency, tmp_path):
    """The gripper is high for half a second, and low when the action ends; or the policy ends while it is high."""
    with registered("high", HighTask) as name:
        alone = EvaluationConfig(
            ("/".join(name),),
            tmp_path / "alone",
            episodes=1,
            objects=("box_000",),
            policy=PolicySettings(
                f"tests.evaluation.test_batched:{policy}", hz=hz, stop=stop, obs_mode="state"
            ),
            errors=InjectedErrors(latency_ms=latency),
        )
        (one,) = evaluate(alone)
        (other,) = evaluate(replace(alone, out=tmp_path / "many", batch=BatchSettings("c", 1)))
    assert one.success_once and one.success_at_end == (policy == "Lowering")
    for field in ("failure", "reason", "steps", "success_at_end", "success_once", "decisions"):
        assert getattr(one, field) == getattr(other, field), field


@pytest.mark.full
def test_a_task_that_raises_costs_its_own_episodes_only(tmp_path):
    def broken(env_config):
        """Find no drawer."""
        return next(iter(()))

    with registered("high", HighTask) as sound, registered("broken", broken) as other:
        results = evaluate(
            EvaluationConfig(
                ("/".join(other), "/".join(sound)),
                tmp_path,
                episodes=2,
                objects=("box_000",),
                policy=PolicySettings("tests.evaluation.test_batched:Lowering", obs_mode="state"),
                batch=BatchSettings("c", 2),
            )
        )
    of_task = {name: [r for r in results if r.task == "/".join(name)] for name in (sound, other)}
    assert all(r.success_once for r in of_task[sound])
    assert [(r.failure, r.steps) for r in of_task[other]] == [("error", 0)] * 2
    assert of_task[other][0].reason.startswith("StopIteration")
    notes = sorted(tmp_path.rglob("*.error.txt"))
    assert len(notes) == 2
    assert "next(iter(()))" in notes[0].read_text()


class NumpyGoal(HighGoal):
    """Computes with NumPy what JAX would have to see."""

    def met(self, state, tolerance):
        return np.linalg.norm(np.asarray(state.tcp_pose[..., :3, 3]), axis=-1) > self.height


class NumpyTask(HighTask):
    """Its goal cannot be traced."""

    def sample(self, rng, spec: EpisodeSpec, preview: Preview) -> EpisodeStart:
        return replace(super().sample(rng, spec, preview), goals=(NumpyGoal("object"),))


def test_a_goal_that_cannot_be_traced_is_named():
    with registered("numpy", NumpyTask) as name:
        worlds = make("/".join(name), worlds=1, engine="c", objects=("box_000",))
        state = worlds.reset(jax.random.key(0))
        with pytest.raises(InputError, match=r"goals NumpyGoal: cannot be traced .*namespace"):
            worlds.step(state, jnp.zeros((1, 8)))


@pytest.mark.full
def test_what_is_no_number_is_the_policys_failure_in_one_world_and_in_many(tmp_path):
    alone = evaluate(config(tmp_path / "alone", "Nothing", None))
    together = evaluate(config(tmp_path / "together", "Nothing", BatchSettings("c", 2)))
    for one, other in zip(alone, together, strict=True):
        assert one.failure == "policy" and one.steps == 0
        for name in ("failure", "reason", "steps", "success_at_end", "success_once", "decisions"):
            assert getattr(one, name) == getattr(other, name), name


def test_policies_that_act_in_one_world_and_odd_rates_are_refused(tmp_path):
    batch = BatchSettings("c", 2)
    for policy, changes, said in (
        ("Alone", {}, "has no method act"),
        ("Puller", {"hz": 7.0}, "a divisor of 50"),
    ):
        asked = config(tmp_path, policy, batch, **changes)
        with pytest.raises(InputError, match=said):
            list(
                batched_results(asked, batch, [(TASK, 0)], lambda *raised: pytest.fail(str(raised)))
            )


@pytest.mark.parametrize(
    ("policy", "said"),
    [
        ("Raising", r"Raising: act failed \(KeyError: 'weights'\)"),
        ("Narrow", r"Narrow: act answered with shape \(2, 6\); expected \(2, 7\)"),
        ("Unready", r"Unready: reset failed \(RuntimeError: no weights\)"),
        ("Alone", "has no method act"),
    ],
)
def test_a_refused_policy_is_named_and_leaves_no_results(policy, said, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(InputError, match=said):
        evaluate(config(out, policy, BatchSettings("c", 2)))
    assert not out.exists()


@pytest.mark.parametrize(
    ("engine", "changes", "said"),
    [("c", {"hz": 7.0}, "a divisor of 50"), ("warp", {}, "engine 'warp' cannot run here")],
)
def test_an_evaluation_that_cannot_begin_leaves_no_results(
    engine, changes, said, tmp_path, monkeypatch
):
    monkeypatch.setattr("manipose_mj.batch.making.missing_for_warp", lambda: "no GPU")
    kept = tmp_path / "notes.txt"
    kept.write_text("mine")
    with pytest.raises(InputError, match=said):
        evaluate(config(tmp_path, "Puller", BatchSettings(engine, 2), **changes))
    assert list(tmp_path.iterdir()) == [kept]


def test_worlds_need_an_engine_and_a_policy(tmp_path, capsys):
    assert main(["evaluate", TASK, "--worlds", "4"]) == EXIT_INPUT
    assert "--worlds needs --engine" in capsys.readouterr().err
    assert main(["evaluate", TASK, "--engine", "c"]) == EXIT_INPUT
    assert "batched worlds play policies" in capsys.readouterr().err
    with pytest.raises(InputError, match="worlds is 0"):
        config(tmp_path, "Puller", BatchSettings("c", 0))
    batch = BatchSettings("c", 2)
    with pytest.raises(InputError, match="a policy gives one action at a time"):
        config(tmp_path, "Puller", batch, execute=2)
    with pytest.raises(InputError, match="leave out --engine"):
        replace(config(tmp_path, "Puller", batch), dask="tcp://localhost:1")
