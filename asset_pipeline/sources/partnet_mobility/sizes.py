"""How large things on sale are, and the scale that makes a drawn one as large."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float


class Length(NamedTuple):
    """Of one side of the bounding box, everything shut, handles left out (of appliances, those with that name): the mean [m], and how much it varies
    as a share of it."""

    mean: float
    spread: float = 0.05


@dataclass(frozen=True)
class Build:
    """One way in which things of a category are built. A side that says nothing is None."""

    depth: Length | None = None
    width: Length | None = None
    height: Length | None = None

    @property
    def sides(self) -> tuple[Length | None, Length | None, Length | None]:
        """In the order of the object frame's axes."""
        return self.depth, self.width, self.height


@dataclass(frozen=True)
class CategorySize:
    """How large things of a category are.

    Attributes:
      category: Our name of it.
      builds: Ways to build it, told apart by their proportions: either one, or all with three sides.
      appliance: Whether the walls are sheet metal around foam and air; else they are board.
    """

    category: str
    builds: tuple[Build, ...]
    appliance: bool = False


# Where one side is known it is the one that varies least among things on sale.
# StorageFurniture: heights and widths vary fivefold, depths do not: IKEA's BESTA cabinets with doors
# are 42 cm deep, most sideboards and bookcases with doors 35 to 45 cm. Table: EN 527-1 has fixed desk
# tops at 740 mm. Microwave: counter-top ones are 19 in wide and 10.5 in high (appliance size guides).
# Dishwasher, Refrigerator, WashingMachine: the module of kitchens, 24 in or 600 mm (EN 1116), is their width; the
# fridge is then one that fits under a counter.
SIZES: dict[str, CategorySize] = {
    "StorageFurniture": CategorySize("cabinet", (Build(depth=Length(0.42)),)),
    "Table": CategorySize("table", (Build(height=Length(0.74)),)),
    "Microwave": CategorySize("microwave", (Build(width=Length(0.48)),), appliance=True),
    "Oven": CategorySize(
        "oven",
        (
            # Free-standing ranges are 30 in wide and 36 in high, with a backguard 45 in.
            Build(Length(0.68, 0.12), Length(0.76, 0.03), Length(0.92, 0.05)),
            Build(Length(0.70, 0.15), Length(0.76, 0.03), Length(1.14, 0.06)),
            # Range cookers of 36 to 60 in, as high as the counter.
            Build(Length(0.66, 0.15), Length(1.15, 0.25), Length(0.92, 0.05)),
            # Built in, for the module of 600 mm: whole and compact, up to 550 mm deep behind the front. Two above
            # each other have the proportions of a range with a backguard, which is commoner.
            Build(Length(0.56, 0.08), Length(0.595, 0.02), Length(0.595, 0.03)),
            Build(Length(0.56, 0.08), Length(0.595, 0.02), Length(0.455, 0.03)),
            # Built into a wall, 30 in wide: one, and two above each other.
            Build(Length(0.60, 0.08), Length(0.755, 0.02), Length(0.73, 0.03)),
            Build(Length(0.60, 0.08), Length(0.755, 0.02), Length(1.30, 0.05)),
            # On the counter.
            Build(Length(0.36, 0.15), Length(0.47, 0.12), Length(0.28, 0.12)),
        ),
        appliance=True,
    ),
    "Dishwasher": CategorySize("dishwasher", (Build(width=Length(0.60)),), appliance=True),
    "Refrigerator": CategorySize("refrigerator", (Build(width=Length(0.60)),), appliance=True),
    "WashingMachine": CategorySize("washing_machine", (Build(width=Length(0.60)),), appliance=True),
}
# The body of tables is called that of furniture, too.
TABLE = ("Table", "StorageFurniture")
# What the heavy link is called where `meta.json` does not say the category.
BODIES = {
    "microwave_body": "Microwave",
    "oven_body": "Oven",
    "dishwasher_body": "Dishwasher",
    "refrigerator_body": "Refrigerator",
    "furniture_body": "StorageFurniture",
}


def likely_scale(extents: Float[np.ndarray, "3"], builds: tuple[Build, ...]) -> float:
    """The most likely length of the drawing's unit [m], of the build that the proportions fit best.

    Lengths vary log-normally. A build's scale is the mean of its sides' scales, weighted by how little they vary;
    builds compare by their likelihood with the scale integrated out.

    Args:
      extents: Depth, width and height of the drawing, in its unit.
      builds: At least one, each with at least one side.
    """
    scored = []
    for build in builds:
        known = [(s, e) for s, e in zip(build.sides, extents, strict=True) if s is not None]
        logs = np.array([np.log(side.mean / extent) for side, extent in known])
        weights = np.array([side.spread**-2.0 for side, _ in known])
        mean = float((weights * logs).sum() / weights.sum())
        misfit = float((weights * (logs - mean) ** 2).sum())
        likelihood = np.log(weights).sum() - misfit - np.log(weights.sum())
        scored.append((likelihood, mean))
    return float(np.exp(max(scored)[1]))
