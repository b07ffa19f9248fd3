"""`clutter/occluded`: no camera sees much of the target at the start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dm_control import mjcf

from manipose_mj.tasks.clutter import Clutter, ClutterConfig
from manipose_mj.tasks.pile import Pile
from manipose_mj.tasks.visibility import visible_share

_IMAGE = (60, 80)  # height, width [pixels]
CAMERAS = ("front", "left", "right", "overview", "panda/wrist")


@dataclass(frozen=True)
class OccludedConfig(ClutterConfig):
    """Attributes: max_visible: share of the target that any of the scene's cameras may see, less
    than the task promises, because the pile settles a little more."""

    max_visible: float = 0.38


class ClutterOccluded(Clutter):
    """Bring a target to its goal of which every camera sees 40 % at most when the episode starts."""

    buried = True

    def _choose(
        self, physics: mjcf.Physics, pile: Pile, random_state: np.random.RandomState
    ) -> tuple[int, ...]:
        config = self.task_config
        assert isinstance(config, OccludedConfig)
        # Piles are dropped so that the first is hidden from all around; here is how well, in this
        # place, from these cameras.
        if 0 not in self._possible(pile):
            return ()
        physics.forward()
        entity = self._pool.entities[int(pile.objects[0])]
        mask = np.zeros(physics.model.ngeom, bool)
        mask[physics.bind(entity.mjcf_model.find_all("geom")).element_id] = True
        share = visible_share(physics.model.ptr, physics.data.ptr, mask, CAMERAS, *_IMAGE)
        return (0,) if share <= config.max_visible else ()
