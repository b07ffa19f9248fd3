"""Three coloured axes that show a goal pose to people and to no sensor."""

from __future__ import annotations

import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float

from manipose_mj.mjcf.arena import MARKER_GROUP
from manipose_mj.poses import pose_to_vector

_COLOURS = ([0.9, 0.1, 0.1, 0.9], [0.1, 0.75, 0.1, 0.9], [0.15, 0.25, 0.95, 0.9])


class GoalMarker(composer.Entity):
    """A movable frame: X red, Y green, Z blue; neither touched nor seen by sensors."""

    def _build(self, name: str = "goal", length: float = 0.09) -> None:
        self._mjcf_root = mjcf.RootElement(model=name)
        self._body = self._mjcf_root.worldbody
        for axis, rgba in enumerate(_COLOURS):
            tip = np.zeros(3)
            tip[axis] = length
            self._body.add(
                "geom",
                name="xyz"[axis],
                type="capsule",
                fromto=[0, 0, 0, *tip],
                size=[0.004],
                rgba=rgba,
                group=MARKER_GROUP,
                contype=0,
                conaffinity=0,
                mass=0,
            )

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        return self._mjcf_root

    def place(self, physics: mjcf.Physics, pose: Float[np.ndarray, "4 4"]) -> None:
        """Show `T_world_marker`."""
        vector = pose_to_vector(pose)
        frame = physics.bind(mjcf.get_attachment_frame(self._mjcf_root))
        frame.pos, frame.quat = vector[:3], vector[3:]
