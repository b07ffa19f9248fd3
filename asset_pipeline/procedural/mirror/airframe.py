"""Parts of toy aeroplanes: wings and fins, propellers, wheels on legs, engines."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece, placed, solid_piece
from asset_pipeline.procedural.revolution import convex_part
from asset_pipeline.procedural.solids import ellipse, print_on_face
from asset_pipeline.procedural.specimen import Colour
from asset_pipeline.procedural.swept import loft_outwards
from asset_pipeline.procedural.tool_handles import ALONG_X, ALONG_Y, superellipse
from asset_pipeline.procedural.turned import turned
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import compose, rotation_about

RUBBER: Colour = (0.11, 0.11, 0.12, 1.0)
METAL: Colour = (0.72, 0.73, 0.75, 1.0)


def fin(
    sections: Float[np.ndarray, "2 4"], upright: bool, *, rgba: Colour, density: float
) -> Piece:
    """A wing, tailplane or fin between two sections: x of the middle, chord, thickness, place along it.

    Along y it is made at z = 0, `upright` along z at y = 0; the last section is rounded off.
    """
    root, tip = sections
    along = np.array([0.0, 0.90, 0.97, 1.0])
    shrink = np.array([1.0, 1.0, 0.90, 0.66])
    loops = []
    for share, small in zip(along, shrink, strict=True):
        x, chord, thick, place = root + share * (tip - root)
        flat = superellipse(2.6, 16) * np.array([chord, thick]) / 2 * small + [x, 0.0]
        out = np.full(16, place)
        loops.append(
            np.stack([flat[:, 0], *((flat[:, 1], out) if upright else (out, flat[:, 1]))], 1)
        )
    stack = np.stack(loops)
    parts = [convex_part(stack[[0, 1]].reshape(-1, 3)), convex_part(stack[[1, 3]].reshape(-1, 3))]
    return solid_piece(loft_outwards(stack), parts, rgba=rgba, density=density)


def propeller(
    nose: float, girth: float, blades: int, *, rgba: Colour, density: float
) -> list[Piece]:
    """A spinner and blades: an upright pair, or three of which one points up.

    Args:
      nose: x of the fuselage's front [m].
      girth: Of the fuselage [m]; the propeller is in proportion.
      blades: How many.
      rgba: The spinner's colour.
      density: [kg/m^3].
    """
    r = 0.15 * girth
    profile = np.array([[0, 0], [r, 0], [0.94 * r, 0.5 * r], [0.6 * r, 1.3 * r], [0, 1.7 * r]])
    levels = (0, 0.5 * r, 1.3 * r, 1.7 * r)
    spinner = turned(profile, levels, bands=((1.0, rgba),), density=density, sections=24)
    spinner = placed(spinner, compose(ALONG_X[:3, :3], np.array([nose, 0.0, 0.0])))
    ends = [[0.0, 0.0030, 0.16 * girth, 0.2 * r], [0.0, 0.0026, 0.20 * girth, 0.72 * girth]]
    blade = fin(np.array(ends), True, rgba=METAL, density=density)
    hub, x_axis = np.array([nose + 0.5 * r, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    turns = [rotation_about(x_axis, 2 * np.pi * k / blades) for k in range(blades)]
    return [spinner, *(placed(blade, compose(turn, hub)) for turn in turns)]


def wheel_on_leg(
    at: Float[np.ndarray, "3"], radius: float, half_width: float, top: float, *, density: float
) -> tuple[Piece, Piece]:
    """A wheel about y and its leg.

    Args:
      at: The wheel's middle [m].
      radius: [m].
      half_width: Of the wheel [m].
      top: Height of the leg's upper end [m].
      density: [kg/m^3].
    """
    r, w = radius, half_width
    profile = np.array([[0, -1], [0.8 * r, -1], [r, -0.6], [r, 0.6], [0.8 * r, 1], [0, 1]])
    profile[:, 1] = w * profile[:, 1] + np.arange(len(profile)) * 1e-6
    levels = (-w, -0.6 * w, 0.6 * w, w)
    wheel = turned(profile, levels, bands=((np.inf, RUBBER),), density=density, sections=24)
    ends = np.array([[at[0], 0.006, 0.004, top], [at[0], 0.006, 0.004, at[2]]])
    leg = fin(ends, True, rgba=METAL, density=density)
    return (
        placed(wheel, compose(ALONG_Y[:3, :3], at)),
        placed(leg, compose(np.eye(3), np.array([0.0, at[1], 0.0]))),
    )


def nacelle(at: Float[np.ndarray, "3"], girth: float, *, rgba: Colour, density: float) -> Piece:
    """A jet engine along x with a dark intake.

    Args:
      at: Its middle [m].
      girth: Of the fuselage [m]; the engine is in proportion.
      rgba: Its colour; the lip is bare metal.
      density: [kg/m^3].
    """
    r, half = 0.26 * girth, 0.36 * girth
    profile = np.array([[0, -1], [0.6 * r, -1], [r, -0.1], [r, 0.8], [0.86 * r, 1], [0, 1]])
    profile[:, 1] = half * profile[:, 1] + np.arange(len(profile)) * 1e-6
    levels = (-half, -0.1 * half, 0.8 * half, half)
    bands = ((0.6 * half, rgba), (1.0, METAL))
    engine = turned(profile, levels, bands=bands, density=density, sections=28)
    face = compose(np.eye(3), np.array([0.0, 0.0, half]))
    hole = print_on_face(ellipse((0.7 * r, 0.7 * r), 24), face, 3)
    visuals = (*engine.visual, Shape("mesh", mesh=hole, rgba=RUBBER))
    return placed(
        Piece(visuals, engine.collision, engine.mass), compose(ALONG_X[:3, :3], np.asarray(at))
    )
