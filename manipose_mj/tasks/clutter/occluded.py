"""`clutter/occluded`: no camera sees much of the target at the start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from manipose_mj.tasks.clutter.lying_pile import LyingPile
from manipose_mj.tasks.clutter.task import Clutter, ClutterConfig
from manipose_mj.tasks.core.preview import Preview
from manipose_mj.tasks.core.start import EpisodeStart
from manipose_mj.tasks.observations.visibility import visible_share

_IMAGE = (60, 80)  # height, width [pixels]
CAMERAS = ("front", "left", "right", "overview", "panda/wrist")


@dataclass(frozen=True)
class OccludedConfig(ClutterConfig):
    """Attributes: max_visible: share of the target that any of the scene's cameras may see, less
    than the task promises, because the pile settles a little more."""

    max_visible: float = 0.38


class ClutterOccluded(Clutter):
    """Bring a target to its goal of which every camera sees 40 % at most when the episode starts."""

    def choose_targets(
        self, rng: np.random.RandomState, lying: LyingPile, preview: Preview
    ) -> tuple[int, ...]:
        config = self.task_config
        assert isinstance(config, OccludedConfig)
        # Piles are dropped so that the first is hidden from all around; here is how well, in this
        # place, from these cameras.
        if 0 not in self.possible_targets(lying):
            return ()
        objects = {f"clutter_{k}": placed for k, placed in enumerate(lying.placed())}
        physics = preview.show(EpisodeStart(goals=(), objects=objects))
        entity = self.pool.entities[int(lying.pile.objects[0])]
        mask = np.zeros(physics.model.ngeom, bool)
        mask[physics.bind(entity.mjcf_model.find_all("geom")).element_id] = True
        share = visible_share(physics.model.ptr, physics.data.ptr, mask, CAMERAS, *_IMAGE)
        return (0,) if share <= config.max_visible else ()
