"""What a moving link is for: by its name, by the names of its parts, and where they say nothing by its shape."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from asset_pipeline.sources.articulated_scan import LinkRole

# Of what slides, and of what turns.
_SLIDES: dict[str, LinkRole] = {
    "drawer": "drawer",  # it may have a part named knob
    "button": "button", "knob": "button", "switch": "button",
    "tray": "tray", "rack": "tray", "grid": "tray", "shelf": "tray", "turntable": "tray",
}  # fmt: skip
_TURNS: dict[str, LinkRole] = {
    "door": "door", "lid": "lid", "cover": "lid",
    "button": "knob", "knob": "knob", "switch": "knob", "dial": "knob",
    "tray": "tray", "turntable": "tray", "plate": "tray",
}  # fmt: skip
# A panel turns about an edge: its axis is this share of its half length from its middle, or more.
AT_EDGE = 0.5


def named_role(slides: bool, link: str, parts: Iterable[str]) -> LinkRole | None:
    """The role that the first telling word stands for; None where there is none.

    Args:
      slides: Whether the joint is prismatic.
      link: What `semantics.txt` calls the link, such as `"rotation_door"`; it counts before
      parts: the names of its parts, such as `"control_button"`. What hangs on a door is part of the door.
    """
    roles = _SLIDES if slides else _TURNS
    texts = [re.findall(r"[a-z]+", text.lower()) for text in (link, " ".join(parts))]
    if slides and "door" in texts[0]:
        return "door"
    if slides and "door" in texts[1]:
        return None
    found: list[LinkRole] = [
        role for words in texts for word, role in roles.items() if word in words
    ]
    return found[0] if found else None


def shaped_role(
    bounds: Float[np.ndarray, "2 3"], origin: Float[np.ndarray, "3"], axis: Float[np.ndarray, "3"]
) -> LinkRole:
    """The role of a link that turns without end, by how it lies to its axis: a door about an edge, a tray about the
    vertical through its middle, a knob about any other line.

    Args:
      bounds: Of its meshes.
      origin: A point on the axis.
      axis: Unit vector.
    """
    half = np.ptp(bounds, axis=0) / 2
    off = bounds.mean(axis=0) - origin
    off = off - (off @ axis) * axis
    along = np.abs(off) / np.maximum(half, 1e-9)
    if float(along[int(np.abs(off).argmax())]) >= AT_EDGE:
        return "door"
    return "tray" if abs(axis[2]) > np.cos(np.deg2rad(20)) else "knob"
