"""A remote control of a television, a player or a set-top box.

Real sizes: remotes on sale are 120-225 mm long, 38-60 mm wide and 15-32 mm thick and weigh 0.06-0.17 kg with their
cells; the cells are in the hand's end, which is the thicker and broader one. It lies on its flat back, buttons up:
X. The hand's end has most of the surface, so by the rule of the bulge Y points to the slim end, which is pointed at
the television.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.moulded import (
    facing,
    moulded,
    printed,
    raised,
    rectangle,
    rounded_polygon,
    slab_loops,
)
from asset_pipeline.procedural.pieces import AreaBox, rigid_specimen
from asset_pipeline.procedural.solids import ellipse
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

RED: Colour = (0.82, 0.12, 0.12, 1.0)
WHITE: Colour = (0.93, 0.93, 0.92, 1.0)
INFRARED: Colour = (0.22, 0.03, 0.06, 1.0)
RISE = 0.0016  # of the buttons [m]
COLOURED: tuple[Colour, ...] = (
    RED,
    (0.16, 0.58, 0.28, 1.0),
    (0.94, 0.78, 0.12, 1.0),
    (0.16, 0.34, 0.72, 1.0),
)
Style = Literal["television", "player", "streamer"]


@dataclass(frozen=True)
class Remote:
    """Sizes [m] and colours.

    Attributes: style, the set of buttons; length; broad and slim, widths at the hand's end and the other;
    thick and thin, heights there; corner, radius of the outline; edge, rounding; density [kg/m^3]; case's,
    back's and buttons' colours.
    """

    style: Style = "television"
    length: float = 0.185
    broad: float = 0.056
    slim: float = 0.036
    thick: float = 0.030
    thin: float = 0.014
    corner: float = 0.012
    edge: float = 0.004
    density: float = 620.0
    case: Colour = (0.15, 0.15, 0.16, 1.0)
    back: Colour = (0.11, 0.11, 0.12, 1.0)
    button: Colour = (0.58, 0.59, 0.61, 1.0)


_BLACK: Colour = (0.13, 0.13, 0.14, 1.0)
# Case, back, buttons.
_COLOURS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.70, 0.71, 0.73, 1.0), (0.50, 0.51, 0.53, 1.0), (0.20, 0.20, 0.22, 1.0)),
    (WHITE, (0.80, 0.80, 0.80, 1.0), (0.62, 0.63, 0.65, 1.0)),
    (_BLACK, _BLACK, WHITE),
    ((0.30, 0.32, 0.35, 1.0), _BLACK, (0.75, 0.76, 0.78, 1.0)),
    ((0.16, 0.22, 0.36, 1.0), (0.12, 0.16, 0.26, 1.0), (0.80, 0.82, 0.86, 1.0)),
    ((0.84, 0.80, 0.72, 1.0), (0.72, 0.68, 0.60, 1.0), (0.40, 0.34, 0.30, 1.0)),
    (_BLACK, (0.42, 0.20, 0.50, 1.0), (0.42, 0.20, 0.50, 1.0)),
)
_STYLES: tuple[Style, ...] = ("streamer", "player", "television")


def design(index: int) -> Remote:
    """The sizes of instance `index`; 0 is a television's, the styles take turns after it."""
    if index == 0:
        return Remote()
    rng = specimen_rng("remote", index)
    style: Style = in_turn(index, _STYLES)
    low, high = {
        "television": (0.170, 0.222),
        "player": (0.145, 0.180),
        "streamer": (0.122, 0.155),
    }[style]
    length = uniform(rng, low, high)
    broad = uniform(rng, 0.050, 0.060) if style != "streamer" else uniform(rng, 0.042, 0.050)
    thick = uniform(rng, 0.026, 0.032)
    return Remote(
        style,
        length,
        broad,
        round(broad * float(rng.uniform(0.60, 0.67)), 4),
        thick,
        round(thick * float(rng.uniform(0.42, 0.50)), 4),
        corner=uniform(rng, 0.006, 0.016),
        edge=uniform(rng, 0.0025, 0.006),
        density=round(float(rng.uniform(540.0, 680.0)), 0),
        **dict(zip(("case", "back", "button"), in_turn(index, _COLOURS), strict=True)),
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: slim end along +x, back on z = 0."""
    remote = design(index)
    x, y = remote.length / 2, remote.broad / 2
    corners = np.array([[x, remote.slim / 2], [-x, y], [-x, -y], [x, -remote.slim / 2]])
    edges = (0.6 * remote.edge, remote.edge)
    seam = 0.42
    loops = slab_loops(
        corners, remote.corner, 0.0, remote.thick, edges=edges, cuts=(seam * remote.thick,), steps=7
    )
    loops[..., 2] *= _height(remote, loops[..., 0]) / remote.thick
    case = moulded(
        loops,
        ((seam, remote.back), (1.0, remote.case)),
        density=remote.density,
        prints=(*_buttons(remote), _window(remote)),
    )
    grip = AreaBox("grip", (-x, -y, 0.0), (0.0, y, remote.thick))
    return rigid_specimen(
        "remote",
        [case],
        object_type="mirror",
        symmetry=SymmetryGroup.identity(),
        areas=(grip,),
    )


def _height(remote: Remote, x: float | Float[np.ndarray, "*n"]) -> float | Float[np.ndarray, "*n"]:
    """Of the upper side, which slopes evenly."""
    return remote.thick + (remote.thin - remote.thick) * (x / remote.length + 0.5)


def _window(remote: Remote) -> Shape:
    """The dark window at the slim end."""
    face = facing((1, 0, 0), (remote.length / 2, 0.0, 0.5 * remote.thin))
    half = remote.slim / 2 - remote.corner
    return printed(
        rounded_polygon(rectangle(0.9 * half, 0.25 * remote.thin), 0.002), face, INFRARED
    )


def _buttons(remote: Remote) -> list[Shape]:
    """From the slim end to the hand: power, colours or inputs, ring, rockers, digits."""
    shapes: list[Shape] = []
    x, w = remote.length, 0.8 * remote.slim / 2
    small = min(0.0042, 0.19 * w + 0.0008)

    def put(outline: np.ndarray, share: float, side: float, rgba: Colour, height: float = RISE):
        shapes.append(raised(outline, _on_top(remote, x * (0.5 - share), side), height, rgba))

    disc, pill = (
        ellipse((small, small), 14),
        rounded_polygon(rectangle(1.3 * small, 0.7 * small), 0.0015),
    )
    tall = rounded_polygon(rectangle(1.1 * small, 2.9 * small), 0.9 * small)
    put(disc, 0.07, 0.62 * w if remote.style == "television" else 0.0, RED)
    if remote.style == "television":
        put(disc, 0.07, -0.62 * w, remote.button)
        _grid(put, pill, 0.145, 0.05, 1, w, remote.button)
        _ring(remote, shapes, 0.30, 0.78 * w)
        for side in (-0.72, 0.72):
            put(tall, 0.475, side * w, remote.button)
        put(disc, 0.475, 0.0, remote.button)
        _grid(put, pill, 0.585, 0.052, 4, w, WHITE if remote.button != WHITE else remote.button)
        for k, rgba in enumerate(COLOURED):
            put(pill, 0.80, (k - 1.5) * 0.58 * w, rgba)
    elif remote.style == "player":
        _ring(remote, shapes, 0.27, 0.85 * w)
        _grid(put, disc, 0.47, 0.068, 3, w, remote.button)
        _grid(put, pill, 0.69, 0.05, 2, w, remote.button)
    else:
        _ring(remote, shapes, 0.28, 0.92 * w)
        _grid(put, disc, 0.50, 0.085, 2, w, remote.button)
        for side in (-0.5, 0.5):
            put(tall, 0.715, side * w, remote.button)
    return shapes


def _grid(put, outline: np.ndarray, start: float, step: float, rows: int, w: float, rgba: Colour):
    for row in range(rows):
        for side in (-0.68, 0.0, 0.68):
            put(outline, start + row * step, side * w, rgba)


def _ring(remote: Remote, shapes: list[Shape], share: float, radius: float) -> None:
    """A four-way ring with a button in its middle."""
    face = _on_top(remote, remote.length * (0.5 - share), 0.0)
    shapes.append(raised(ellipse((radius, radius), 32), face, 0.0010, remote.button, shrink=0.94))
    face = _on_top(remote, remote.length * (0.5 - share), 0.0, 0.0010)
    hub = 0.42 * radius
    shapes.append(raised(ellipse((1.25 * hub, 1.25 * hub), 24), face, 0.0002, remote.case))
    shapes.append(raised(ellipse((hub, hub), 20), face, 0.0008, remote.button))


def _on_top(remote: Remote, x: float, side: float, above: float = 0.0) -> Float[np.ndarray, "4 4"]:
    """The frame of the upper side at a place: x across, y towards the slim end."""
    slope = (remote.thin - remote.thick) / remote.length
    at = (x, side, float(_height(remote, x)) + above)
    return facing((-slope, 0.0, 1.0), at, up=(1.0, 0.0, 0.0))
