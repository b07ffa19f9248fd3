"""Objects of which an episode uses some: the others wait high above, weightless.

A change of objects then needs no new model.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float

from manipose_mj.assets.asset import Asset
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.mjcf.objects import RigidObject
from manipose_mj.poses import compose

PARKING_HEIGHT = 50.0


class ObjectPool:
    """The rigid objects of a task.

    Attributes:
      entities: All of them, `object_0`, `object_1` and so on, in the order of the assets.
    """

    def __init__(self, assets: Sequence[Asset], arena: composer.Arena) -> None:
        """Attach an entity for each asset; the same asset may come twice.

        Raises:
          InputError: There is none.
        """
        if not assets:
            raise InputError("a task takes at least one object; got none")
        self.entities = tuple(
            RigidObject(asset, name=f"object_{index}") for index, asset in enumerate(assets)
        )
        for index, entity in enumerate(self.entities):
            # Parked in the model too: objects that begin in one place would burst apart.
            frame = arena.add_free_entity(entity)
            frame.pos = _parking_place(index)
            # Left to itself MuJoCo puts the frame's 10 mg at `pos` from it: a lever of 50 m.
            frame.add("inertial", pos=[0, 0, 0], mass=1e-5, diaginertia=[1e-11] * 3)
            for body in entity.mjcf_model.find_all("body"):
                body.gravcomp = 1

    def choose(
        self,
        rng: np.random.RandomState,
        name: str | None,
        among: Sequence[int] | None = None,
    ) -> int:
        """Draw the object that an episode is about.

        Args:
          rng: Draws, unless there is nothing to choose.
          name: Of the asset it shall be; None: any.
          among: Indices of those that it may be; None: all.

        Raises:
          InputError: No object that it may be has this name; the nearest names are offered.
        """
        indices = range(len(self.entities)) if among is None else among
        if name is None:
            return int(indices[rng.randint(len(indices))]) if len(indices) > 1 else indices[0]
        named = {self.entities[index].asset.name: index for index in indices}
        if name not in named:
            raise unknown_name("object", name, named)
        return named[name]

    def use(self, physics: mjcf.Physics, indices: Sequence[int]) -> None:
        """Give these their weight and park all; the caller then places those that are used."""
        for index, entity in enumerate(self.entities):
            entity.place(physics, compose(np.eye(3), _parking_place(index)))
            # The frame too: with the least weight what is parked would never come to rest.
            frame = mjcf.get_attachment_frame(entity.mjcf_model)
            bodies = physics.bind([frame, *entity.mjcf_model.find_all("body")])
            bodies.gravcomp = float(index not in indices)


def _parking_place(index: int) -> Float[np.ndarray, "3"]:
    return np.array([float(index), 0.0, PARKING_HEIGHT])
