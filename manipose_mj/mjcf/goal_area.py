"""A coloured area on the table that shows a goal to people and to no sensor."""

from __future__ import annotations

import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float

from manipose_mj.mjcf.arena import MARKER_GROUP
from manipose_mj.poses import pose_to_vector

_COLOUR = (0.10, 0.75, 0.10, 0.6)
_HALF_THICKNESS = 0.0006  # [m]


class GoalArea(composer.Entity):
    """A movable rectangle, lying in the frame's XY plane; neither touched nor seen by sensors."""

    def _build(self, half_sides: tuple[float, float], name: str = "goal") -> None:
        self._mjcf_root = mjcf.RootElement(model=name)
        self._mjcf_root.worldbody.add(
            "geom", name="area", type="box", size=[*half_sides, _HALF_THICKNESS], rgba=_COLOUR,
            group=MARKER_GROUP, contype=0, conaffinity=0, mass=0,
        )  # fmt: skip

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        return self._mjcf_root

    def place(self, physics: mjcf.Physics, pose: Float[np.ndarray, "4 4"]) -> None:
        """Show `T_world_area`."""
        vector = pose_to_vector(pose)
        frame = physics.bind(mjcf.get_attachment_frame(self._mjcf_root))
        frame.pos, frame.quat = vector[:3], vector[3:]
