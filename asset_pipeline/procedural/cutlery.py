"""What spoons and forks have in common: the flat handle of pressed steel or moulded plastic."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece
from asset_pipeline.procedural.sheet import sheet
from asset_pipeline.procedural.specimen import Colour, uniform

STEEL, PLASTIC = 7850.0, 1100.0  # [kg/m^3]
STEEL_GREY: Colour = (0.74, 0.75, 0.77, 1.0)
BRASS: Colour = (0.83, 0.68, 0.38, 1.0)
BLACK_STEEL: Colour = (0.22, 0.22, 0.24, 1.0)
COLUMNS = 9  # points across a handle
SIDE = 0.84  # how thick the sides are, as a share


@dataclass(frozen=True)
class FlatHandle:
    """A flat handle along x that ends at the joint, x = 0. Sizes [m].

    Attributes: length; end and neck, its widths; waist, the share of the length over which it widens
    from the neck to the end; thick; round, how pointed its end is: length of the rounding over half
    the end's width.
    """

    length: float = 0.115
    end: float = 0.019
    neck: float = 0.0075
    waist: float = 0.85
    thick: float = 0.0026
    round: float = 1.0


class Cutlery(Protocol):
    """A fork or a spoon: a dataclass with a handle, besides `wall`, `density` and `rgba`."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def handle(self) -> FlatHandle:
        """What the hand holds."""
        ...


Tool = TypeVar("Tool", bound=Cutlery)


def sample_handle(
    rng: np.random.Generator,
    *,
    length: float,
    end: float,
    neck: float,
    thick: tuple[float, float],
) -> FlatHandle:
    """A handle of pressed steel: waist, thickness in this range and rounding as `rng` draws them [m]."""
    return FlatHandle(
        length=length,
        end=end,
        neck=neck,
        waist=round(float(rng.uniform(0.55, 0.95)), 3),
        thick=uniform(rng, *thick),
        round=round(float(rng.choice((0.35, 0.7, 1.0, 1.5))), 2),
    )


def in_plastic(tool: Tool, colour: Colour) -> Tool:
    """The same fork or spoon in plastic, which takes more material: the neck wider, handle and wall thicker."""
    handle = replace(tool.handle, neck=tool.handle.neck + 0.002, thick=tool.handle.thick + 0.001)
    return replace(tool, handle=handle, wall=0.0026, density=PLASTIC, rgba=colour)


def flat_handle(handle: FlatHandle, *, rgba: Colour, density: float) -> Piece:
    """The handle in the xy plane, its middle on the x axis."""
    rounding = handle.round * handle.end / 2
    turn = np.linspace(0.12, np.pi / 2, 9)
    x = np.concatenate(
        [rounding * (1 - np.cos(turn)), np.linspace(rounding, handle.length, 14)[1:]]
    )
    x = x - handle.length
    share = np.clip(-x / (handle.waist * handle.length), 0, 1)
    widening = share**2 * (3 - 2 * share)
    half = (handle.neck + (handle.end - handle.neck) * widening) / 2
    half[:9] *= np.sin(turn)
    line = np.column_stack([x, np.zeros_like(x)])
    v = across(COLUMNS)
    thickness = np.tile(handle.thick * side_profile(v), (len(x), 1))
    return sheet(
        spread(line, half, v), thickness, cuts=_stretches(len(x)), rgba=rgba, density=density
    )


def across(count: int) -> Float[np.ndarray, "v"]:
    """Places across a sheet from -1 to 1, denser at the sides."""
    return np.sin(np.linspace(-np.pi / 2, np.pi / 2, count))


def side_profile(v: Float[np.ndarray, "v"]) -> Float[np.ndarray, "v"]:
    """The share of the full thickness at places across a sheet with rounded sides."""
    return SIDE + (1 - SIDE) * np.sqrt(1 - v**6)


def spread(
    line: Float[np.ndarray, "u 2"], half: Float[np.ndarray, "u"], v: Float[np.ndarray, "v"]
) -> Float[np.ndarray, "u v 3"]:
    """A surface that is level across.

    Args:
      line: x and z of its middle [m].
      half: Its half width along y [m].
      v: Places across it from -1 to 1.
    """
    surface = np.empty((len(line), len(v), 3))
    surface[..., 0], surface[..., 2] = line[:, :1], line[:, 1:]
    surface[..., 1] = half[:, None] * v
    return surface


def _stretches(stations: int) -> tuple[tuple[int, int, int], ...]:
    ends = [0, 4, 8, *np.round(np.linspace(8, stations - 1, 5)).astype(int).tolist()[1:]]
    return tuple((a, b, 1) for a, b in zip(ends[:-1], ends[1:], strict=True))


def dip(
    x: Float[np.ndarray, "u"], slope: float, bend: float, curl: float = 0.0
) -> Float[np.ndarray, "u"]:
    """How a head runs on from a straight handle [m]: it bends down over `bend`, and curls up again.

    Args:
      x: From the joint [m].
      slope: Of what follows the bend.
      bend: Its length [m].
      curl: Curvature of the way up again [1/m].
    """
    bent = np.clip(x, 0, bend)
    return -slope * (bent**2 / (2 * bend) + np.clip(x - bend, 0, None)) + curl / 2 * x**2
