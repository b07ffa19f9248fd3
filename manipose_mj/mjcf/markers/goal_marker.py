"""Three coloured axes that show a goal pose to people and to no sensor."""

from __future__ import annotations

import numpy as np

from manipose_mj.mjcf.markers.marker import Marker

_COLOURS = ([0.9, 0.1, 0.1, 0.9], [0.1, 0.75, 0.1, 0.9], [0.15, 0.25, 0.95, 0.9])


class GoalMarker(Marker):
    """A movable frame: X red, Y green, Z blue; neither touched nor seen by sensors."""

    def _build(self, name: str = "goal", length: float = 0.09) -> None:
        super()._build(name)
        for axis, rgba in enumerate(_COLOURS):
            tip = np.zeros(3)
            tip[axis] = length
            self._add(
                name="xyz"[axis], type="capsule", fromto=[0, 0, 0, *tip], size=[0.004], rgba=rgba
            )
