"""A coloured area on the table that shows a goal to people and to no sensor."""

from __future__ import annotations

from manipose_mj.mjcf.markers.marker import Marker

_COLOUR = (0.10, 0.75, 0.10, 0.6)
_HALF_THICKNESS = 0.0006  # [m]


class GoalArea(Marker):
    """A movable rectangle, lying in the frame's XY plane; neither touched nor seen by sensors."""

    def _build(self, half_sides: tuple[float, float], name: str = "goal") -> None:
        super()._build(name)
        self._add(name="area", type="box", size=[*half_sides, _HALF_THICKNESS], rgba=_COLOUR)
