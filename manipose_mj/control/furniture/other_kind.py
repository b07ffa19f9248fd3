"""Parts that words call by another kind than was seen: a drawer that was taken for a door, a door for a drawer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.fit.door_hinge import is_straight, likely_hinge
from manipose_mj.control.furniture.fit.furniture_fit import (
    TYPICAL_DRAWER,
    cavity_behind,
    usual_swing,
)
from manipose_mj.control.furniture.shapes.furniture_model import PartModel

# Cosine between a hinge and the way out of the front, from which on a part would turn as a knob does.
_AS_KNOBS = 0.7


def as_drawer(part: PartModel) -> PartModel:
    """The same part, known to slide: straight out of the front."""
    handle, panel = part.part.handle, part.panel
    assert handle is not None
    joint = Joint("slide", handle.origin, np.array([1.0, 0.0, 0.0]), (0.0, TYPICAL_DRAWER))
    cavity = cavity_behind(panel, "slide", TYPICAL_DRAWER, 0.0)
    return replace(part, part=replace(part.part, joint=joint, cavity=cavity), opening=0.0)


def as_door(part: PartModel, category: str, rear: float) -> PartModel:
    """The same part, known to turn: about a hinge that a door can have.

    Args:
      part: That stands shut, or was taken to slide.
      category: Of the furniture.
      rear: Its back, along X [m].
    """
    handle, joint, panel = part.part.handle, part.part.joint, part.panel
    assert handle is not None
    turns = part.hinged and abs(float(joint.axis @ handle.rotation[:, 1])) < _AS_KNOBS
    if turns and (part.opening > 0.0 or is_straight(joint.axis)):
        return part
    origin, axis = likely_hinge(handle.pose, panel, float(handle.extents[0]))
    hinge = Joint("hinge", origin, axis, (0.0, usual_swing(axis, category)))
    cavity = cavity_behind(panel, "hinge", 0.0, rear)
    return replace(part, part=replace(part.part, joint=hinge, cavity=cavity), opening=0.0)
