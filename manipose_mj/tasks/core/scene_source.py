"""Where an environment's scenes come from: the objects of an episode, and the task that has them."""

from __future__ import annotations

from typing import cast

import numpy as np

from manipose_mj.errors import InputError, brief
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec
from manipose_mj.tasks.core.registry import DrawnTaskFactory, TaskFactory, TaskSpec
from manipose_mj.tasks.core.scene_objects import SceneObjects, Strata
from manipose_mj.tasks.core.task import ManipulationTask


class SceneSource:
    """The scenes of one registered task under one configuration."""

    def __init__(self, spec: TaskSpec, config: EnvConfig) -> None:
        """Loads what the user chose.

        Raises:
          InputError: Some of it does not exist.
        """
        self._spec, self._config = spec, config
        self._draw = None if spec.draws is None else spec.draws(config)

    def draw(self, rng: np.random.RandomState, spec: EpisodeSpec) -> SceneObjects | None:
        """The objects of an episode; None where all episodes have the same.

        Raises:
          InputError: `spec` asks for an object that there is not, or none can be used.
        """
        return None if self._draw is None else self._draw(rng, spec)

    def strata(self) -> Strata:
        """What evaluations take equally often; one group of one where all episodes have the same objects."""
        return ((EpisodeSpec(),),) if self._draw is None else self._draw.strata()

    def build(self, objects: SceneObjects | None) -> ManipulationTask:
        """The task with these objects in its scene, not compiled yet.

        Raises:
          InputError: The task cannot use them, or the factory makes no task.
        """
        if objects is None:
            task = cast(TaskFactory, self._spec.factory)(self._config)
        else:
            task = cast(DrawnTaskFactory, self._spec.factory)(self._config, objects)
        if not isinstance(task, ManipulationTask):
            raise InputError(
                f"the factory of {self._spec.full_name} returned {brief(task)}; expected a ManipulationTask"
            )
        if not hasattr(task, "scene"):
            raise InputError(
                f"the task {self._spec.full_name} has no scene; "
                f"expected super().__init__(config, env_config) in {type(task).__name__}.__init__"
            )
        return task
