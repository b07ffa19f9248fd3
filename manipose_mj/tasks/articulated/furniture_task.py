"""What all tasks with furniture share: the piece of an episode, and the part of it in question."""

from __future__ import annotations

from collections.abc import Mapping

from dm_control.composer.observation import observable

from manipose_mj.assets.asset import MovingPart
from manipose_mj.mjcf.objects import ArticulatedObject
from manipose_mj.tasks.articulated.furniture import FurnitureInQuestion
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.observations.frames import BodyFrame


class FurnitureTask(ManipulationTask):
    """One piece of furniture of several, with the drawer or door that the task is about.

    Attributes:
      pieces: The furniture; a subclass's constructor sets it.
    """

    pieces: FurnitureInQuestion

    @property
    def furniture(self) -> ArticulatedObject:
        """The piece of furniture of this episode."""
        return self.pieces.entities[self._piece]

    @property
    def part(self) -> MovingPart:
        """The drawer or door in question."""
        return self.pieces.parts[self._piece]

    @property
    def observed_furniture(self) -> tuple[ArticulatedObject, ...]:
        return ()  # but for the part in question, which every piece has

    @property
    def extra_frames(self) -> Mapping[str, BodyFrame]:
        return self.pieces.frames(self._piece)

    @property
    def extra_observables(self) -> Mapping[str, observable.Observable]:
        return {"opening": observable.Generic(lambda p: self.pieces.opening(p, self._piece))}

    @property
    def _piece(self) -> int:
        return 0 if self.start is None else self.start.furniture[0].index
