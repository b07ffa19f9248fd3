"""Policies for tests: what a user might write, right and wrong."""

from __future__ import annotations

import os
import sys
import time
from typing import Any

import numpy as np

from manipose_mj.failures import StageFailure


class Reaching:
    """Deterministic; moves joint targets a little towards a posture that its seed draws."""

    def __init__(self, horizon: int = 4, beyond: float = 0.0, decisions: int = 5) -> None:
        self.horizon, self.beyond, self.decisions = horizon, beyond, decisions
        self.metadata = {"name": "reaching"}

    def reset(self, *, task: str, instruction: str, seed: int, action_space: Any) -> None:
        assert task and instruction.endswith(".")
        assert action_space.control_mode == "pd_joint_pos"
        self.rng, self.asked = np.random.default_rng(seed), 0

    def infer(self, obs: Any) -> dict[str, Any]:
        self.asked += 1
        joints = np.asarray(obs["agent_pos"][:7], float)
        steps = self.rng.uniform(-0.05, 0.05, (self.horizon, 7)).cumsum(axis=0)
        opening = np.full((self.horizon, 1), 0.08 + self.beyond)
        done = self.asked == self.decisions
        return {"actions": np.concatenate([joints + steps, opening], axis=1), "done": done}


class Answering:
    """Answers every observation with the same."""

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def reset(self, **episode: Any) -> None: ...

    def infer(self, obs: Any) -> Any:
        return self.answer


class Raising:
    """A policy with a mistake in it."""

    def reset(self, **episode: Any) -> None: ...

    def infer(self, obs: Any) -> Any:
        raise KeyError("weights")


class Peeking(Raising):
    """A policy that asks for the simulator, and fails."""

    def attach(self, environment: Any) -> None: ...


class Unattached(Raising):
    """A policy that fails when it is given the simulator."""

    def attach(self, environment: Any) -> None:
        raise KeyError("panda")


class GivingUp(Raising):
    """A policy that says so."""

    def infer(self, obs: Any) -> Any:
        raise StageFailure("plan", "no way")


class LongGivingUp(GivingUp):
    """A policy that says so after it has thought for a while."""

    def infer(self, obs: Any) -> Any:
        time.sleep(0.2)
        return super().infer(obs)


class Dying(Reaching):
    """Ends its process in the third episode."""

    def __init__(self) -> None:
        super().__init__()
        self.episodes = 0

    def reset(self, **episode: Any) -> None:
        super().reset(**episode)
        self.episodes += 1

    def infer(self, obs: Any) -> Any:
        if self.episodes == 3 and self.asked == 2:
            os._exit(9)
        return super().infer(obs)


class Narrowing:
    """Answers without a gripper after some episodes."""

    def __init__(self, after: int = 1) -> None:
        self.after = after

    def reset(self, **episode: Any) -> None:
        self.after -= 1

    def infer(self, obs: Any) -> Any:
        return {"actions": np.zeros((1, 8 if self.after >= 0 else 7)), "done": True}


class Reporting(Reaching):
    """Has a `status` of its own, which is nobody's business."""

    made = 0

    def __init__(self) -> None:
        super().__init__()
        type(self).made += 1

    @property
    def status(self) -> str:
        """What only a programmer wants to read.

        Raises:
          ZeroDivisionError: Always.
        """
        raise ZeroDivisionError


class Breaking:
    """Stays where it is, once, and then breaks in one of several ways."""

    def __init__(self, how: str = "raise") -> None:
        self.how = how

    def reset(self, **episode: Any) -> None:
        self.asked = 0

    def infer(self, obs: Any) -> Any:
        self.asked += 1
        if self.asked == 1:
            return {"actions": np.append(obs["agent_pos"][:7], 0.08)[None]}
        if self.how == "raise":
            raise KeyError("weights")
        return {"actions": np.full((1, 8), np.nan) if self.how == "nan" else np.zeros((1, 7))}


class WithoutInfer:
    """No policy."""

    def reset(self, **episode: Any) -> None: ...


def failing_factory() -> None:
    """Raises what a missing file raises."""
    raise FileNotFoundError("no weights.pt\nin this folder")


class Once(Answering):
    """Moves the first joint by a tenth of a radian, once, and waits a second."""

    def __init__(self) -> None:
        move = np.zeros((10, 8))
        move[0, 0] = 1.0
        super().__init__({"actions": move, "done": True})


def answering_nan() -> Answering:
    """No number."""
    return Answering({"actions": np.full((1, 8), np.nan)})


def answering_flat() -> Answering:
    """An action instead of several."""
    return Answering({"actions": np.zeros(8)})


def answering_narrow() -> Answering:
    """Actions without a gripper."""
    return Answering({"actions": np.zeros((1, 7))})


if __name__ == "__main__":  # a server in a process of its own: NAME PORT
    from manipose_mj.policies.server import PolicyServer

    server = PolicyServer(globals()[sys.argv[1]](), port=int(sys.argv[2]))
    sys.stdout.write(f"{server.address}\n")
    sys.stdout.flush()
    server.run()
