"""What shows a goal to people and to no sensor: geoms that move with a frame and touch nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float

from manipose_mj.mjcf.arena import MARKER_GROUP
from manipose_mj.poses import pose_to_vector


class Marker(composer.Entity):
    """Movable and weightless, neither touched nor seen by sensors; subclasses add its geoms."""

    def _build(self, name: str) -> None:
        self._mjcf_root = mjcf.RootElement(model=name)

    def _add(self, **geom: Any) -> None:
        """A geom of the marker, given what MJCF says of its name, shape and colour."""
        self._mjcf_root.worldbody.add(
            "geom", **geom, group=MARKER_GROUP, contype=0, conaffinity=0, mass=0
        )

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """The marker's MJCF."""
        return self._mjcf_root

    def place(self, physics: mjcf.Physics, pose: Float[np.ndarray, "4 4"]) -> None:
        """Show `T_world_marker`."""
        vector = pose_to_vector(pose)
        frame = physics.bind(mjcf.get_attachment_frame(self._mjcf_root))
        frame.pos, frame.quat = vector[:3], vector[3:]
