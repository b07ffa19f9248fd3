"""A toy car: saloon, hatchback, sports car, van or pick-up.

Real sizes: die-cast cars at 1:64 are 65-80 mm long, at 1:43 about 95-110 mm and 1:32 130-150 mm, plastic ones up to 200 mm;
widths 0.38-0.46 and heights 0.28-0.42 of the length; 0.035-0.30 kg. Up is X. Cabin and roof lie behind the middle, so by the
rule of the bulge the bonnet, the front, is on Y's side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from asset_pipeline.geometry.mass import solid_mass_properties
from asset_pipeline.procedural.mirror.car_parts import CHROME, arch, lamps, pane, road_wheel
from asset_pipeline.procedural.pieces import AreaBox, Piece, placed, rigid_specimen, solid_piece
from asset_pipeline.procedural.revolution import convex_part, halves
from asset_pipeline.procedural.solids import (
    box,
    loft,
    rounded_box,
    rounded_rectangle,
)
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, mixed, specimen_rng
from asset_pipeline.procedural.swept import convex_chunks, loft_outwards
from asset_pipeline.procedural.tool_handles import superellipse
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup, compose

Style = Literal["saloon", "hatchback", "sports", "van", "pickup"]


@dataclass(frozen=True)
class Car:
    """Sizes [m] and colours.

    Attributes: style; length, width; clearance under the body; belt, height of the doors' upper edge; roof,
    height; nose and boot, heights of the front and the rear end; screen and back, places of the
    windscreen's and the rear window's lower edge from the front as shares of the length; front and rear,
    of the roof's ends; wheel, radius; tyre, its width; base, distance of the axles as a share; density
    [kg/m^3]; body's, roof's and rims' colours.
    """

    style: Style = "saloon"
    length: float = 0.105
    width: float = 0.044
    clearance: float = 0.006
    belt: float = 0.021
    roof: float = 0.034
    nose: float = 0.017
    boot: float = 0.020
    screen: float = 0.36
    front: float = 0.50
    rear: float = 0.77
    back: float = 0.92
    wheel: float = 0.0082
    tyre: float = 0.007
    base: float = 0.60
    density: float = 1500.0
    colour: Colour = (0.78, 0.10, 0.10, 1.0)
    top: Colour = (0.78, 0.10, 0.10, 1.0)
    rims: Colour = CHROME

    def x(self, share: float) -> float:
        """Of a place from the front."""
        return self.length * (0.5 - share)


_WHITE: Colour = (0.94, 0.94, 0.93, 1.0)
# Body, roof, rims.
_PAINTS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.14, 0.34, 0.66, 1.0), _WHITE, CHROME),
    ((0.95, 0.76, 0.14, 1.0), (0.95, 0.76, 0.14, 1.0), (0.24, 0.24, 0.26, 1.0)),
    ((0.20, 0.50, 0.30, 1.0), _WHITE, CHROME),
    ((0.90, 0.46, 0.12, 1.0), (0.16, 0.16, 0.17, 1.0), (0.70, 0.70, 0.72, 1.0)),
    (_WHITE, _WHITE, (0.30, 0.31, 0.33, 1.0)),
    ((0.50, 0.76, 0.82, 1.0), (0.96, 0.94, 0.88, 1.0), CHROME),
    ((0.46, 0.20, 0.46, 1.0), (0.46, 0.20, 0.46, 1.0), CHROME),
    ((0.20, 0.21, 0.24, 1.0), (0.20, 0.21, 0.24, 1.0), (0.80, 0.16, 0.14, 1.0)),
)
_STYLES: tuple[Style, ...] = ("pickup", "hatchback", "van", "sports", "saloon")


def design(index: int) -> Car:
    """The sizes of instance `index`; 0 is a red saloon at 1:43, the styles take turns after it."""
    if index == 0:
        return Car()
    rng = specimen_rng("toy_car", index)
    style: Style = in_turn(mixed(index), _STYLES)
    length = float(np.exp(rng.uniform(np.log(0.072), np.log(0.185))))
    # Belt, roof, nose, boot as shares of the length; screen, front, rear, back; wheel.
    belt, roof, nose, boot, screen, front, rear, back, wheel = {
        "saloon": (0.20, 0.32, 0.16, 0.19, 0.37, 0.50, 0.77, 0.92, 0.075),
        "hatchback": (0.23, 0.38, 0.19, 0.22, 0.36, 0.48, 0.88, 0.985, 0.086),
        "sports": (0.18, 0.27, 0.145, 0.18, 0.40, 0.56, 0.74, 0.97, 0.070),
        "van": (0.25, 0.45, 0.21, 0.25, 0.24, 0.38, 0.97, 0.995, 0.084),
        "pickup": (0.24, 0.37, 0.21, 0.170, 0.36, 0.46, 0.64, 0.67, 0.082),
    }[style]
    vary = rng.uniform(0.95, 1.05, 5)
    colour, top, rims = in_turn(index, _PAINTS)
    return Car(
        style=style,
        length=round(length, 4),
        width=round(float(length * rng.uniform(0.40, 0.46)), 4),
        clearance=round(float(length * rng.uniform(0.05, 0.065)), 4),
        belt=round(float(length * belt * vary[0]), 4),
        roof=round(float(length * roof * vary[1]), 4),
        nose=round(float(length * nose * vary[0]), 4),
        boot=round(float(length * boot * vary[0]), 4),
        screen=screen,
        front=round(float(front + rng.uniform(-0.015, 0.015)), 3),
        rear=round(float(rear + rng.uniform(-0.015, 0.0)), 3),
        back=back,
        wheel=round(float(length * wheel * vary[3]), 4),
        tyre=round(float(length * 0.065 * vary[4]), 4),
        base=round(float(rng.uniform(0.57, 0.62)), 3),
        density=round(float(rng.uniform(900.0, 1500.0) * (0.08 / length) ** 0.9), 0),
        colour=colour,
        top=top,
        rims=rims,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: front along +x, wheels on z = 0."""
    car = design(index)
    pieces = [_body(car), _cabin(car)]
    for end in (-0.5, 0.5):
        for side in (-1.0, 1.0):
            wheel = road_wheel(car.wheel, car.tyre, side, rims=car.rims, density=car.density)
            out = side * (car.width / 2 - 0.82 * car.tyre)
            at = np.array([end * car.base * car.length, out, car.wheel])
            pieces.append(placed(wheel, compose(np.eye(3), at)))
    if car.style == "pickup":
        pieces += _bed(car)
    return rigid_specimen(
        "toy_car",
        pieces,
        object_type="mirror",
        symmetry=SymmetryGroup.identity(),
        areas=(
            AreaBox(
                "grip",
                (car.x(car.back), -car.width / 2, car.clearance),
                (car.x(car.screen), car.width / 2, car.belt),
            ),
        ),
    )


def _levels(car: Car, share: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Height of the body's upper side: bonnet, belt, boot or bed."""
    if car.style == "pickup":
        table = (
            (0, car.nose),
            (car.screen, car.belt),
            (car.back, car.belt),
            (car.back + 0.005, car.boot),
            (1, car.boot),
        )
    else:
        table = ((0, car.nose), (car.screen, car.belt), (0.75, car.belt), (1.0, car.boot))
    places, heights = zip(*table, strict=True)
    return np.interp(share, places, heights)


def _body(car: Car) -> Piece:
    """Rounded-rectangular sections from the front to the rear bumper."""
    ends = np.array([0.0, 0.006, 0.02, 0.05])
    stations = np.unique(
        np.concatenate(
            [ends, [car.screen, car.back, car.back + 0.005], np.linspace(0.08, 0.92, 13), 1 - ends]
        )
    )
    stations = stations[stations <= 1]
    inset = np.interp(np.minimum(stations, 1 - stations), ends, [0.16, 0.09, 0.04, 0.0])
    top = _levels(car, stations) - 0.5 * inset * car.belt
    low = car.clearance + 0.8 * inset * car.belt
    half = np.stack([np.full_like(stations, car.width / 2) * (1 - inset), (top - low) / 2], axis=1)
    ring = superellipse(7.0, 24)
    across = half[:, None] * ring + np.stack([0 * low, (top + low) / 2], axis=1)[:, None]
    x = np.broadcast_to(car.length * (0.5 - stations)[:, None, None], (len(stations), 24, 1))
    loops = np.concatenate([x, across], axis=2)
    stops = [0.02, 0.05, car.screen, 0.75, 0.95, 0.98]
    if car.style == "pickup":
        stops = [0.02, 0.05, car.screen, car.back, car.back + 0.005, 0.95, 0.98]
    cuts = tuple(int(np.argmin(np.abs(stations - s))) for s in stops)
    body = solid_piece(
        loft_outwards(loops),
        [half for chunk in convex_chunks(loops, cuts) for half in halves(chunk)],
        rgba=car.colour,
        density=car.density,
    )
    visuals = lamps(car.length, car.width, (car.clearance, car.nose), front=True)
    visuals += lamps(car.length, car.width, (car.clearance, car.boot), front=False)
    floor = car.clearance + 0.12 * (car.belt - car.clearance)
    for side in (-1.0, 1.0):
        for end in (-0.5, 0.5):
            at = np.array([end * car.base * car.length, side * car.width / 2, car.wheel])
            visuals.append(arch(at, 1.12 * car.wheel, floor))
    return Piece((*body.visual, *visuals), body.collision, body.mass)


def _cabin(car: Car) -> Piece:
    """A frustum from the doors' upper edge to the roof, with four windows."""
    low, high = 0.94 * car.width / 2, (0.86 if car.style == "van" else 0.78) * car.width / 2
    sink = 0.12 * car.belt
    base = np.array([(car.x(car.back), car.x(car.screen)), (-low, low)])
    lid = np.array([(car.x(car.rear), car.x(car.front)), (-high, high)])
    edge = 0.05 * car.width
    rise = car.roof - car.belt
    loops = []
    for t, inset in (
        (-sink / rise, 0.0),
        (0.0, 0.0),
        (1 - edge / rise, 0.0),
        (1 - 0.3 * edge / rise, 0.3),
        (1.0, 1.0),
    ):
        sides = base + np.clip(t, 0, 1) * (lid - base)
        half = (sides[:, 1] - sides[:, 0]) / 2 - 0.8 * inset * edge
        outline = rounded_rectangle((half[0], half[1]), edge, steps=3) + [sides[0].mean(), 0]
        loops.append(np.column_stack([outline, np.full(len(outline), car.belt + t * rise)]))
    rings = np.stack(loops)
    parts = [
        convex_part(rings[[0, 2], :].reshape(-1, 3)),
        *halves(convex_part(rings[[2, 4], :].reshape(-1, 3))),
    ]
    mass = solid_mass_properties(loft(rings), 0.4 * car.density * float(loft(rings).volume))
    visuals = [
        Shape("mesh", mesh=loft(rings[:3], caps=(True, False)), rgba=car.colour),
        Shape("mesh", mesh=loft(rings[2:], caps=(False, True)), rgba=car.top),
    ]
    (xb, xs), (xr, xf) = base[0], lid[0]
    b, t = car.belt, car.roof
    screen = [(xs, -low, b), (xs, low, b), (xf, high, t), (xf, -high, t)]
    rear = [(xb, low, b), (xb, -low, b), (xr, -high, t), (xr, high, t)]
    visuals += [pane(screen, 0.12), pane(rear, 0.14)]
    for s in (-1.0, 1.0):
        panes = ((0.0, 0.46), (0.46, 1.0))
        if car.style == "van":
            panes = ((0.70, 1.0),)
        elif car.style in ("sports", "pickup"):
            panes = ((0.0, 1.0),)
        for start, stop in panes:
            xs_low, xs_high = (
                xb + np.array([start, stop]) * (xs - xb),
                xr + np.array([start, stop]) * (xf - xr),
            )
            corners = [
                (xs_low[0], s * low, b),
                (xs_low[1], s * low, b),
                (xs_high[1], s * high, t),
                (xs_high[0], s * high, t),
            ]
            visuals.append(pane(corners if s < 0 else [corners[k] for k in (1, 0, 3, 2)], 0.10))
    return Piece(tuple(visuals), tuple(parts), mass)


def _bed(car: Car) -> list[Piece]:
    """A pick-up's side walls and tailgate."""
    wall = max(0.002, 0.035 * car.width)
    y, z, top = 0.49 * car.width, car.boot - 0.1 * car.belt, car.belt
    head, tail = car.x(car.back), car.x(0.985)
    corners = (
        ((tail, y - wall, z), (head, y, top)),
        ((tail, -y, z), (head, wall - y, top)),
        ((tail, wall - y, z), (tail + wall, y - wall, top)),
    )
    pieces = []
    for low, high in corners:
        shape = rounded_box(np.array(low), np.array(high), 0.3 * wall, car.colour)
        assert shape.mesh is not None
        pieces.append(
            solid_piece(shape.mesh, (box(low, high),), rgba=car.colour, density=car.density)
        )
    return pieces
