"""A piece of furniture as boxes, with parts that move: what clouds of it are made into.

The object frame is upright: X out of the front, Z up. All boxes are of that frame, with the parts shut.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from itertools import count

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Cavity, MovingPart
from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.shapes.boxes import Boxes, no_boxes, without
from manipose_mj.poses import compose, rotation_about

_TRAY_FLOOR, _TRAY_SIDE = 0.008, 0.012  # of drawers [m]
_TRAY_BEHIND = (
    0.04  # of a drawer that the body still covers when it is wide open: its back does not show [m]
)
_EDGE = 0.02  # by which panels overlap at their edges without being over one another [m]
_BEFORE_FRONT = 0.03  # by how much a hole reaches out of the front [m]


@dataclass(frozen=True)
class PartModel:
    """A drawer or door.

    Attributes:
      part: Its name, joint, handle and cavity, object frame.
      panel: What shuts the opening, without the handle: low and high corner [m].
      handle: Boxes of the handle.
      opening: As it stands [m or rad].
      confidence: Of its estimate.
      looks: `(n, 3)`, points that were seen on it, as if it were shut [m].
      seen_inside: Whether the cavity was measured; else it is a guess.
      extra: Boxes of what else was seen on it: the hand has to keep clear of it.
    """

    part: MovingPart
    panel: Float[np.ndarray, "2 3"]
    handle: Boxes
    opening: float
    confidence: float
    looks: Float[np.ndarray, "n 3"]
    seen_inside: bool = False
    extra: Boxes = field(default_factory=no_boxes)

    @property
    def name(self) -> str:
        """What plans call it."""
        return self.part.name

    @property
    def hinged(self) -> bool:
        """Whether it turns."""
        return self.part.joint.kind == "hinge"

    @property
    def boxes(self) -> Boxes:
        """All that moves."""
        boxes = [self.panel[None], self.handle]
        cavity = self.part.cavity
        if cavity is not None and cavity.moves_with_part:
            boxes.append(_tray(cavity, self.panel))
        return np.concatenate(boxes)

    def motion(self, opening: float) -> Float[np.ndarray, "4 4"]:
        """How it has moved at another opening [m or rad], object frame."""
        joint = self.part.joint
        if joint.kind == "slide":
            return compose(np.eye(3), joint.axis * opening)
        rotation = rotation_about(joint.axis, opening)
        return compose(rotation, joint.origin - rotation @ joint.origin)

    def at(self, opening: float) -> PartModel:
        """The same, as far open [m or rad]."""
        return replace(self, opening=opening)

    def opening_to(self, most: float) -> PartModel:
        """The same, taken to open so far [m or rad]."""
        joint = replace(self.part.joint, range=(self.part.joint.range[0], most))
        return replace(self, part=replace(self.part, joint=joint))


@dataclass(frozen=True)
class FurnitureModel:
    """A piece of furniture.

    Attributes:
      pose: `T_world_object`.
      solid: Boxes of all that stands still, as if there were no cavities.
      parts: That move.
      category: Such as `"cabinet"`.
    """

    pose: Float[np.ndarray, "4 4"]
    solid: Boxes
    parts: tuple[PartModel, ...]
    category: str

    @property
    def fixed(self) -> Boxes:
        """What stands still, with a hole for every part and its cavity."""
        boxes = self.solid
        for part in self.parts:
            hole = part.panel.copy()
            hole[1, 0] += _BEFORE_FRONT
            boxes = without(boxes, hole)
            cavity = part.part.cavity
            if cavity is not None:
                low, high = cavity.center - cavity.extents / 2, cavity.center + cavity.extents / 2
                boxes = without(
                    boxes, np.array([low, [max(high[0], part.panel[1, 0]), high[1], high[2]]])
                )
        return boxes

    @property
    def front(self) -> float:
        """Where the fronts of shut parts are, along X [m]."""
        fronts: Float[np.ndarray, "k"] = np.array([part.panel[1, 0] for part in self.parts])
        return float(np.median(fronts)) if len(fronts) else float(self.solid[:, 1, 0].max())

    def with_another(self, part: PartModel) -> FurnitureModel:
        """The same with one more part; what had its name is kept under another."""
        names = {each.name for each in self.parts}
        other = next(name for i in count(len(names)) if (name := f"part_{i}") not in names)
        others = [
            replace(each, part=replace(each.part, name=other)) if each.name == part.name else each
            for each in self.parts
        ]
        return replace(self, parts=(*others, part))

    def with_part(self, part: PartModel) -> FurnitureModel:
        """The same with another state of the part of that name."""
        return replace(self, parts=tuple(part if p.name == part.name else p for p in self.parts))

    def without_fronts_over(self, opened: PartModel, asked: Collection[str]) -> FurnitureModel:
        """The same once a part has left the front: what it shut is no other part's.

        A knob above an oven's door may have been taken for the handle of one that reaches over it.

        Args:
          opened: The part, its panel measured.
          asked: Names of parts that are kept whatever their panel is.
        """
        parts = []
        for part in self.parts:
            if part.name != opened.name and _overlap(part.panel, opened.panel):
                panel = _beside(part, opened.panel)
                if panel is not None:
                    part = replace(part, panel=panel)
                elif part.name not in asked:
                    continue
            parts.append(part)
        return replace(self, parts=tuple(parts))


def _overlap(one: Float[np.ndarray, "2 3"], other: Float[np.ndarray, "2 3"]) -> bool:
    """Whether panels have more than their edges in common."""
    low, high = np.maximum(one[0], other[0]), np.minimum(one[1], other[1])
    return bool((high - low > _EDGE)[1:].all())


def _beside(part: PartModel, opening: Float[np.ndarray, "2 3"]) -> Float[np.ndarray, "2 3"] | None:
    """The largest of what an opening leaves of a panel to one of its sides; with the handle, or None."""
    assert part.part.handle is not None
    handle = part.part.handle.origin
    left = []
    for axis in (1, 2):
        for end in (0, 1):
            rest = part.panel.copy()
            if end == 0:
                rest[1, axis] = min(rest[1, axis], opening[0, axis])
            else:
                rest[0, axis] = max(rest[0, axis], opening[1, axis])
            if ((handle > rest[0]) & (handle < rest[1]))[1:].all():
                left.append(rest)
    return max(left, key=lambda rest: np.prod((rest[1] - rest[0])[1:]), default=None)


def _tray(cavity: Cavity, panel: Float[np.ndarray, "2 3"]) -> Boxes:
    """Floor, sides and back of a drawer around its cavity."""
    low, high = cavity.center - cavity.extents / 2, cavity.center + cavity.extents / 2
    low[0] -= _TRAY_BEHIND
    end = panel[0, 0]
    top = high[2] - 0.015
    floor = [[low[0], low[1], low[2] - _TRAY_FLOOR], [end, high[1], low[2]]]
    left = [[low[0], low[1] - _TRAY_SIDE, low[2]], [end, low[1], top]]
    right = [[low[0], high[1], low[2]], [end, high[1] + _TRAY_SIDE, top]]
    back = [[low[0] - _TRAY_SIDE, low[1], low[2]], [low[0], high[1], top]]
    return np.array([floor, left, right, back])


def motion_of(joint: Joint, opening: float) -> Float[np.ndarray, "4 4"]:
    """How a part moves that opens so far [m or rad], object frame."""
    empty = np.zeros((0, 2, 3))
    moving = MovingPart("", joint, None, None)
    return PartModel(moving, np.zeros((2, 3)), empty, 0.0, 0.0, np.zeros((0, 3))).motion(opening)
