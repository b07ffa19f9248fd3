"""What tasks share that bring an object into or out of a cavity that a drawer or door shuts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.tasks.articulated.cavity_placement import CavityPlacement, OwnPlace
from manipose_mj.tasks.articulated.furniture import FurnitureInQuestion
from manipose_mj.tasks.articulated.furniture_task import FurnitureTask
from manipose_mj.tasks.articulated.placement import Standing, side
from manipose_mj.tasks.core.config import EnvConfig, TaskConfig
from manipose_mj.tasks.core.preview import Preview
from manipose_mj.tasks.core.start import EpisodeStart, NoStartError, PlacedFurniture, PlacedObject


class CavityTask(FurnitureTask):
    """Furniture with a part that shuts a cavity, an object for it, and others that lie in it."""

    def __init__(
        self,
        objects: Sequence[Asset],
        furniture: Asset,
        part: MovingPart,
        config: TaskConfig,
        env_config: EnvConfig,
        *,
        standing: Standing,
        max_fillers: int,
        taken: bool,
    ) -> None:
        """Build furniture and objects.

        Args:
          objects: The first is what episodes are about; others may lie in the cavity.
          furniture: That all episodes use.
          part: Of it, the one in question, with a handle and a cavity.
          config: Of the task.
          env_config: Of the user.
          standing: Where the furniture stands.
          max_fillers: How many other objects may lie in the cavity.
          taken: Whether the object is taken out of the cavity, rather than put in.

        Raises:
          InputError: An object does not fit the cavity.
        """
        super().__init__(config, env_config)
        self.pieces = FurnitureInQuestion(self.scene, (furniture,), (part,), standing)
        self.pool = self.scene.add_objects(objects)
        self.placement = CavityPlacement(self.pool, part, taken=taken)
        self.max_fillers = max_fillers

    @property
    def observed_objects(self) -> tuple[str, ...]:
        return ("object", *(f"filler_{k}" for k in range(self.max_fillers)))

    def cavity_pose(self, physics: mjcf.Physics) -> Float[np.ndarray, "4 4"]:
        """`T_world_cavity` of the part in question."""
        return self.pieces.cavity_pose(physics, self._piece)

    def write(self, physics: mjcf.Physics, start: EpisodeStart) -> None:
        """Put a simulation where an episode starts.

        Raises:
          NoStartError: An object does not come to rest: some roll on an oven's grid.
        """
        super().write(physics, start)
        for name, entity in self.objects.items():
            speed = float(entity.speeds(physics)[0])
            if speed > self.config.tolerance.linear_speed:
                raise NoStartError(
                    f"{name}, {entity.asset.name}, still moves at {1000 * speed:.0f} mm/s after "
                    f"{self.config.settle:g} s in {self.furniture.asset.name}"
                )

    def sample_place(
        self,
        rng: np.random.RandomState,
        x_range: tuple[float, float],
        y_range: tuple[float, float],
    ) -> Float[np.ndarray, "2"]:
        """A place on the table [m], y mirrored for doors hinged on the right."""
        place = np.array([rng.uniform(*x_range), rng.uniform(*y_range)])
        place[1] *= side(self.part)
        return place

    def sample_fillers(
        self, rng: np.random.RandomState, own: OwnPlace | None = None
    ) -> dict[int, Float[np.ndarray, "4 4"]]:
        """Draw other objects for the cavity.

        Args:
          rng: Draws how many, which and where.
          own: Where the object lies in the cavity; None: room is kept for it.

        Returns:
          Their indices in the pool, with `T_cavity_object` of each.
        """
        return self.placement.beside(rng, int(rng.randint(self.max_fillers + 1)), own)

    def cavity_of(self, preview: Preview, furniture: PlacedFurniture) -> Float[np.ndarray, "4 4"]:
        """`T_world_cavity` of the part in question while a piece stands so."""
        shown = preview.show(EpisodeStart(goals=(), furniture=(furniture,)))
        return self.pieces.cavity_pose(shown, furniture.index)


def placed_objects(
    pose: Float[np.ndarray, "4 4"],
    fillers: Mapping[int, Float[np.ndarray, "4 4"]],
    cavity: Float[np.ndarray, "4 4"],
) -> dict[str, PlacedObject]:
    """The object that an episode is about, and those that lie in the cavity, by name.

    Args:
      pose: `T_world_object` of the object, the first of the pool.
      fillers: `T_cavity_object` of the others by their indices.
      cavity: `T_world_cavity`.
    """
    others = {
        f"filler_{k}": PlacedObject(i, cavity @ inside)
        for k, (i, inside) in enumerate(fillers.items())
    }
    return {"object": PlacedObject(0, pose), **others}
