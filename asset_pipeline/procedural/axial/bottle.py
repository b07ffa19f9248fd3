"""A closed bottle: water, wine, beer, sauce or detergent.

Real sizes, of things on sale: 500 ml water bottles are 62-68 mm wide and 200-235 mm tall with the 28 mm neck (PCO 1881);
Bordeaux bottles of 750 ml 73-76 mm and 295-325 mm with a 29 mm neck (CETIE data sheets); 330 ml longneck beer
bottles 61 mm and 229 mm with a 26 mm crown finish; squeeze bottles 58-70 mm and 160-200 mm (the YCB mustard
bottle: 190 mm tall, 603 g, Calli et al. 2015); detergent bottles up to 74 mm and 250 mm. They weigh as two fifths full.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from asset_pipeline.procedural.filled import filled
from asset_pipeline.procedural.pieces import Piece, rigid_specimen
from asset_pipeline.procedural.revolution import fillet
from asset_pipeline.procedural.specimen import (
    Colour,
    Specimen,
    in_turn,
    mixed,
    specimen_rng,
    uniform,
)
from manipose_mj.poses import SymmetryGroup

CONTENT = 430.0  # mean of wall, content and air [kg/m^3]
CAP = 500.0  # caps are hollow [kg/m^3]
PUNT = 0.0018  # under the bottom [m]


@dataclass(frozen=True)
class Bottle:
    """Sizes [m] and colours.

    Attributes: cap, its kind; diameter; height, over all; neck, its diameter; shoulder, where the
    body ends, and throat, where the neck begins, as shares of the height; body, label (None has
    none), stripe on the label, and lid colours.
    """

    cap: Literal["screw", "cork", "crown", "nozzle"] = "screw"
    diameter: float = 0.065
    height: float = 0.215
    neck: float = 0.0255
    shoulder: float = 0.62
    throat: float = 0.86
    body: Colour = (0.62, 0.80, 0.90, 0.6)
    label: Colour | None = (0.12, 0.36, 0.72, 1.0)
    stripe: Colour = (0.93, 0.95, 0.97, 1.0)
    lid: Colour = (0.12, 0.36, 0.72, 1.0)


@dataclass(frozen=True)
class _Kind:
    cap: Literal["screw", "cork", "crown", "nozzle"]
    diameter: tuple[float, float]
    height: tuple[float, float]
    neck: tuple[float, float]
    shoulder: tuple[float, float]
    throat: tuple[float, float]
    bodies: tuple[Colour, ...]


_KINDS = (
    _Kind(
        "cork",
        (0.0725, 0.0755),
        (0.290, 0.325),
        (0.028, 0.030),
        (0.56, 0.62),
        (0.70, 0.76),
        ((0.07, 0.17, 0.09, 0.92), (0.24, 0.14, 0.06, 0.92), (0.52, 0.62, 0.36, 0.75)),
    ),
    _Kind(
        "nozzle",
        (0.058, 0.070),
        (0.160, 0.200),
        (0.026, 0.032),
        (0.58, 0.66),
        (0.74, 0.80),
        ((0.76, 0.07, 0.06, 1.0), (0.95, 0.78, 0.10, 1.0), (0.92, 0.89, 0.80, 1.0)),
    ),
    _Kind(
        "crown",
        (0.0600, 0.0625),
        (0.205, 0.240),
        (0.0255, 0.0270),
        (0.48, 0.54),
        (0.74, 0.80),
        ((0.36, 0.18, 0.05, 0.9), (0.10, 0.32, 0.14, 0.9), (0.30, 0.14, 0.04, 0.9)),
    ),
    _Kind(
        "screw",
        (0.064, 0.074),
        (0.175, 0.250),
        (0.030, 0.040),
        (0.66, 0.74),
        (0.80, 0.85),
        ((0.90, 0.90, 0.92, 1.0), (0.25, 0.55, 0.62, 1.0), (0.86, 0.50, 0.16, 1.0)),
    ),
    _Kind(
        "screw",
        (0.062, 0.070),
        (0.200, 0.240),
        (0.0250, 0.0260),
        (0.58, 0.66),
        (0.83, 0.87),
        ((0.66, 0.84, 0.92, 0.6), (0.70, 0.88, 0.76, 0.6), (0.90, 0.62, 0.30, 0.7)),
    ),
)
_LABELS: tuple[tuple[Colour, Colour, Colour], ...] = (  # label, stripe, lid
    ((0.93, 0.91, 0.84, 1.0), (0.55, 0.12, 0.16, 1.0), (0.45, 0.08, 0.12, 1.0)),
    ((0.14, 0.34, 0.60, 1.0), (0.93, 0.93, 0.95, 1.0), (0.92, 0.92, 0.94, 1.0)),
    ((0.86, 0.72, 0.24, 1.0), (0.14, 0.14, 0.16, 1.0), (0.78, 0.64, 0.22, 1.0)),
    ((0.16, 0.44, 0.24, 1.0), (0.95, 0.86, 0.36, 1.0), (0.16, 0.44, 0.24, 1.0)),
)


def design(index: int) -> Bottle:
    """The sizes of instance `index`; 0 is a half-litre water bottle."""
    if index == 0:
        return Bottle()
    rng = specimen_rng("bottle", index)
    kind = in_turn(mixed(index), _KINDS)
    label, stripe, lid = in_turn(index, _LABELS)
    bottle = Bottle(
        cap=kind.cap,
        diameter=uniform(rng, *kind.diameter),
        height=uniform(rng, *kind.height),
        neck=uniform(rng, *kind.neck),
        shoulder=uniform(rng, *kind.shoulder),
        throat=uniform(rng, *kind.throat),
        body=in_turn(index // len(_KINDS) + 1, kind.bodies),
        label=label,
        stripe=stripe,
        lid=lid,
    )
    return replace(bottle, label=None) if index % 11 == 10 else bottle


def generate(index: int = 0) -> Specimen:
    """Instance `index`, with its frame at the centre of the bounding box."""
    bottle = design(index)
    cap_height = {"screw": 0.016, "cork": 0.0, "crown": 0.0062, "nozzle": 0.034}[bottle.cap]
    profile = _profile(bottle, bottle.height - cap_height)
    body, label = bottle.body, bottle.label or bottle.body
    stripe = bottle.stripe if bottle.label else body
    low, high = 0.14 * bottle.height, 0.92 * bottle.shoulder * bottle.height
    cuts = low + np.array([0.0, 0.68, 0.80, 1.0]) * (high - low)
    bands = [*zip(cuts, (body, label, stripe, label), strict=True)]
    if bottle.cap == "cork":  # a foil capsule
        bands += [(0.80 * bottle.height, body), (bottle.height, bottle.lid)]
    else:
        bands.append((bottle.height, body))
    pieces = [filled(profile, density=CONTENT, bands=bands), *_cap(bottle, cap_height)]
    return rigid_specimen("bottle", pieces, object_type="axial", symmetry=SymmetryGroup.about_x())


def _profile(bottle: Bottle, top: float) -> np.ndarray:
    """Punt, side, shoulder and neck, up to the mouth."""
    r, neck = bottle.diameter / 2, bottle.neck / 2
    start, end = bottle.shoulder * bottle.height, bottle.throat * bottle.height
    t = np.linspace(0, 1, 18)
    shoulder = np.column_stack(
        [neck + (r - neck) * (0.5 + 0.5 * np.cos(np.pi * t**1.15)), start + (end - start) * t]
    )
    foot = np.array([[0, PUNT], [0.68 * r, PUNT], [0.78 * r, 0], [r, 0]])
    ring = neck + 0.0016  # the finish, below the cap
    mouth = np.array([[neck, top - 0.009], [ring, top - 0.0075], [ring, top - 0.001]])
    last = np.array([[ring - 0.001, top], [0, top]])
    return fillet(np.concatenate([foot, shoulder, mouth, last]), {3: 0.005}, 4)


def _cap(bottle: Bottle, height: float) -> tuple[Piece, ...]:
    low, high = bottle.height - height, bottle.height
    neck = bottle.neck / 2
    if bottle.cap == "cork":
        return ()
    if bottle.cap == "nozzle":
        corners = [[0, low], [neck + 0.006, low], [neck + 0.004, low + 0.012]]
        corners += [[0.0055, low + 0.016], [0.0030, high], [0, high]]
        profile = fillet(np.array(corners), {2: 0.003, 3: 0.002}, 4)
    else:
        edge = neck + (0.0034 if bottle.cap == "screw" else 0.0032)
        corners = [[0, low], [edge, low], [edge - 0.0006, high], [0, high]]
        if bottle.cap == "crown":
            corners[2] = [edge - 0.0025, high]
        profile = fillet(np.array(corners), {2: 0.0015}, 4)
    return (
        filled(profile, density=CAP, bands=[(high, bottle.lid)], tolerance=0.0006, sections=48),
    )
