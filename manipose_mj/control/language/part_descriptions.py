"""Words for drawers and doors, as people tell them from one another."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from manipose_mj.assets.asset import MovingPart
from manipose_mj.control.scene.scene_estimate import PartEstimate
from manipose_mj.tasks.instructions.names import part_words_among


def words_for_parts(parts: Mapping[str, PartEstimate]) -> dict[str, str]:
    """Such as `top left drawer`, by the parts' names.

    A part that was found by what an instruction calls it has those words, and no other of its piece of furniture has them
    too: it is only a drawer or a door then.

    Args:
      parts: All of a scene, by name; those with one `base_pose` are of one piece.
    """
    found = {}
    for name, part in parts.items():
        piece = [other for other in parts.values() if np.allclose(other.base_pose, part.base_pose)]
        words = part.called or part_words_among([_moving(each) for each in piece], _moving(part))
        taken = not part.called and any(words == other.called for other in piece)
        found[name] = ("drawer" if "drawer" in words.split() else "door") if taken else words
    return found


def _moving(part: PartEstimate) -> MovingPart:
    return MovingPart(part.name, part.joint, part.handle, part.cavity)
