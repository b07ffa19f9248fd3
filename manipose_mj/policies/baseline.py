"""The baseline as a policy: it reads its environment instead of observations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from dm_control import composer

from manipose_mj.control.baseline import MAX_PLANS, Baseline
from manipose_mj.control.perception.perturbed import UNPERTURBED, PosePerturbation
from manipose_mj.control.perception.pose_sources import check_pose_source
from manipose_mj.control.perception.source_names import GraspSource, masks_of
from manipose_mj.control.planning.planner import TaskPlanner
from manipose_mj.errors import InputError
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.policies.protocol import ActionSpace

_MODE = "pd_joint_pos"


class BaselinePolicy:
    """Plans in the environment that it is attached to; one action an answer.

    Attributes:
      pose_source: Where it takes object poses from.
      mask_source: Where it takes instance masks from.
    """

    def __init__(
        self,
        pose: str = "oracle",
        planner: TaskPlanner | None = None,
        plans: int = MAX_PLANS,
        estimator: EstimatorSettings | None = None,
        errors: PosePerturbation = UNPERTURBED,
        grasps: GraspSource | None = None,
    ) -> None:
        """Acts in no environment yet.

        Args:
          pose: Where it takes object poses from.
          planner: Makes its plans; by default by rules.
          plans: How many it may try.
          estimator: Whose estimates `"estimated"` are; None: those of the package's weights.
          errors: Made to the poses of objects on purpose.
          grasps: Where those of objects come from; by default what suits `pose`.

        Raises:
          InputError: There is no such source of poses.
        """
        check_pose_source(pose)
        self.pose_source, self.mask_source = pose, masks_of(pose)
        self._planner, self._plans = planner, plans
        self._estimator, self._errors = estimator, errors
        self._grasps: GraspSource | None = grasps
        self._environment: composer.Environment | None = None
        self._baseline: Baseline | None = None
        self._actions: Iterator[np.ndarray] = iter(())

    @property
    def baseline(self) -> Baseline:
        """Of the environment that it is attached to."""
        assert self._baseline is not None, "attach comes first"
        return self._baseline

    @property
    def status(self) -> str:
        """What it is doing."""
        return self.baseline.status

    def name_episode(self, task: str, episode: int) -> None:
        """This episode of an evaluation comes next."""
        if self._planner is not None:
            self._planner.name_episode(task, episode)

    def attach(self, environment: composer.Environment) -> None:
        """Act in this environment, after its first reset, from now on."""
        if environment is not self._environment:
            self._environment = environment
            self._baseline = Baseline(
                environment,
                self.pose_source,
                self._planner,
                self._estimator,
                self._errors,
                self._grasps,
            )
        self.baseline.status = ""  # the generator of actions resets it too late for a first record

    def reset(self, *, task: str, instruction: str, seed: int, action_space: ActionSpace) -> None:
        """Plan anew.

        Raises:
          InputError: Actions are not those it makes, or it was attached to no environment.
        """
        if self._environment is None:
            raise InputError("the baseline acts in an environment; call attach(environment) first")
        timestep = self._environment.task.control_timestep
        if action_space.control_mode != _MODE or round(action_space.hz * timestep, 9) != 1:
            raise InputError(
                f"the baseline acts in {_MODE} at {1 / timestep:g} Hz; got {action_space.control_mode} "
                f"at {action_space.hz:g} Hz"
            )
        self._actions = self.baseline.actions(seed, self._plans)

    def infer(self, obs: Mapping[str, Any]) -> dict[str, Any]:
        """The next action.

        Raises:
          StageFailure: It gives up.
        """
        action = next(self._actions, None)
        if action is None:
            return {"actions": np.zeros((0, 8)), "done": True}
        return {"actions": action[None]}
