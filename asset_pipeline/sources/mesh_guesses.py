"""Which unit and which up axis a mesh has that nobody stated: by its size, its kind and the way it lies."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.geometry.toppling import resting_faces
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.assets.label import ObjectType
from manipose_mj.errors import InputError

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
# Those that meshes are in which say nothing, and the one that is next where none of them suits.
GUESSED_UNITS, RARE_UNIT = ("m", "cm", "mm"), "in"
# Longest side of what lies on tables [m].
TABLETOP = (0.03, 0.5)
# A guess may miss the range of the category's sizes by this factor.
SLACK = 2.0
AXES = {
    "x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0), "-y": (0.0, -1.0, 0.0), "-z": (0.0, 0.0, -1.0),
}  # fmt: skip
# How often meshes have which axis up: scanners and CAD write z, modelling programs y, and glTF demands y.
USUAL_UP = {"z": 0.6, "y": 0.35, "x": 0.02, "-z": 0.01, "-y": 0.01, "-x": 0.01}
STATED = (
    20.0  # times likelier than usual is the axis that the file states, which programs get wrong
)
# Two sides of a body of revolution differ by this share, as a standard deviation.
ROUND = 0.05
NEAR_UP = np.cos(np.deg2rad(10.0))
NEVER_RESTS = 0.01  # the least probability that counts: a damaged foot still is a foot
# How far the probability of resting so counts: an upright packet mostly falls over, and stands all the same.
REST_POWER = 0.3
# Who draws an object to stand puts the ground at 0: so many times likelier, to this share of the height.
ON_GROUND, GROUND = 10.0, 0.02


def suits(longest: float, category: str) -> bool:
    """Whether a thing of the category may have this longest side [m]."""
    low, high = _sizes(category)
    return low / SLACK <= longest <= high * SLACK


def guess_unit(longest: float, category: str) -> str:
    """The unit in which a length suits the category; the nearest to the middle of what it measures.

    Args:
      longest: Side of the bounding box, in the unknown unit.
      category: By our name; others are taken to fit on a table.

    Raises:
      InputError: It suits in no unit.
    """
    low, high = _sizes(category)
    middle = np.sqrt(low * high)
    unit = min(GUESSED_UNITS, key=lambda u: abs(np.log(UNITS[u] * longest / middle)))
    for found in (unit, RARE_UNIT):
        if suits(UNITS[found] * longest, category):
            return found
    sizes = ", ".join(f"{UNITS[u] * longest:.3g} m in {u}" for u in (*GUESSED_UNITS, RARE_UNIT))
    what = category if category in CATALOGUE else "tabletop object"
    raise InputError(
        f"the longest side is {longest:.4g}: {sizes}; a {what} has {low / SLACK:g} to {high * SLACK:g} m; "
        "say --unit, also as a number of metres"
    )


def guess_up(mesh: trimesh.Trimesh, object_type: ObjectType, stated: str | None = None) -> str:
    """The axis that is up, of six: how usual it is, whether the ground is at 0 along it, how likely the mesh rests so,
    and whether it is round about it.

    Args:
      mesh: In any unit.
      object_type: Axial objects are round about their up axis.
      stated: The axis that the format or the file says is up.
    """
    rests = _rest_probabilities(mesh)
    extents = np.asarray(mesh.extents)
    scores = {}
    for name, share in USUAL_UP.items():
        usual = share * (STATED if name == stated else 1.0)
        across = extents[np.array(AXES[name]) == 0]
        uneven = float(np.log(across[0] / across[1])) if across.min() > 0 else np.inf
        roundness = np.exp(-0.5 * (uneven / ROUND) ** 2) + 1e-3 if object_type == "axial" else 1.0
        heights = np.asarray(mesh.bounds) @ np.array(AXES[name])
        grounded = abs(float(heights.min())) < GROUND * float(np.ptp(heights))
        rest = max(rests[name], NEVER_RESTS) ** REST_POWER
        scores[name] = usual * roundness * rest * (ON_GROUND if grounded else 1.0)
    return max(scores, key=scores.__getitem__)


def _sizes(category: str) -> tuple[float, float]:
    """Of the longest side, from and to [m]."""
    return CATALOGUE[category].size if category in CATALOGUE else TABLETOP


def _rest_probabilities(mesh: trimesh.Trimesh) -> dict[str, float]:
    """How likely the mesh comes to rest with each axis up; nothing is known of what has no volume."""
    try:
        hull = mesh.convex_hull
        normals, shares = resting_faces(hull, np.asarray(hull.center_mass))
    except Exception:  # qhull's own type, for flat input
        return dict.fromkeys(AXES, 1.0)
    return {name: _share_up(normals, shares, np.array(axis)) for name, axis in AXES.items()}


def _share_up(
    normals: Float[np.ndarray, "k 3"], shares: Float[np.ndarray, "k"], up: Float[np.ndarray, "3"]
) -> float:
    return float(shares[-normals @ up > NEAR_UP].sum())
