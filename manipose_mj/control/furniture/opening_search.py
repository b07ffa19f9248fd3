"""How far a known part stands open, from a cloud: the opening at which its looks fit what is seen."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from manipose_mj.control.furniture.furniture_model import PartModel
from manipose_mj.poses import transform

_FAR = 0.02  # a point further off counts as this far [m]
_STEPS = {"slide": (0.01, 0.002), "hinge": (0.06, 0.01)}  # of the search, coarse and fine
_BEYOND = {"slide": 0.04, "hinge": 0.25}  # openings beyond the usual that are looked at
_WITHIN = {"slide": 0.12, "hinge": 0.5}  # from where the hand has left it
_BETTER = 0.85  # of the misfit that is left, for another opening to replace the present one
_SHUT = {"slide": 0.006, "hinge": 0.03}  # openings below count as shut
_THICKNESS = 0.018  # of a panel, whose other side may be all that shows [m]
_SEEN = 0.75  # share of the points that has to be seen at best: some are hidden
_MOST = 300


def found_opening(part: PartModel, points: Float[np.ndarray, "n 3"]) -> float:
    """The opening [m or rad] near the present one that fits best; the present one where none is clearly better.

    A door that stands wide open hardly shows; what it shut then looks much like it, shut.

    Args:
      part: With its looks.
      points: Of the furniture now, object frame [m].
    """
    looks = part.looks[:_MOST]
    if len(looks) < 20 or len(points) < 50:
        return part.opening
    kind = part.part.joint.kind
    tree = cKDTree(points)
    # A door that stands wide open turns its other side to the cameras; a drawer never does.
    sides = [looks] if kind == "slide" else [looks, looks - [_THICKNESS, 0.0, 0.0]]

    def misfit(opening: float) -> float:
        motion = part.motion(opening)
        off = [
            np.minimum(tree.query(transform(motion, each), distance_upper_bound=_FAR)[0], _FAR)
            for each in sides
        ]
        nearest = np.sort(np.min(off, axis=0))
        return float(nearest[: max(int(_SEEN * len(nearest)), 1)].mean())

    coarse, fine = _STEPS[kind]
    least = max(part.opening - _WITHIN[kind], 0.0)
    most = min(part.part.joint.range[1] + _BEYOND[kind], part.opening + _WITHIN[kind])
    tried = [*np.arange(least, most, coarse).tolist(), part.opening]
    best = min(tried, key=misfit)
    near = np.arange(max(best - coarse, 0.0), best + coarse + fine / 2, fine).tolist()
    best = min([best, *near], key=misfit)
    if misfit(best) > _BETTER * misfit(part.opening):
        best = part.opening
    return 0.0 if best < _SHUT[kind] else float(best)
