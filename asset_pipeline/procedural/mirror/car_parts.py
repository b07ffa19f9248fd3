"""Parts of toy cars: panes, lamps, wheel arches, wheels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import Piece, placed
from asset_pipeline.procedural.solids import ellipse, print_on_face, rounded_rectangle
from asset_pipeline.procedural.specimen import Colour
from asset_pipeline.procedural.tool_handles import ALONG_Y
from asset_pipeline.procedural.turned import turned
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import compose, rotation_about

GLASS: Colour = (0.14, 0.18, 0.24, 1.0)
RUBBER: Colour = (0.10, 0.10, 0.11, 1.0)
CHROME: Colour = (0.80, 0.81, 0.83, 1.0)
LAMP: Colour = (0.97, 0.95, 0.82, 1.0)
TAIL_LAMP: Colour = (0.72, 0.06, 0.06, 1.0)


def pane(face: Sequence[tuple[float, ...]], margin: float) -> Shape:
    """A dark pane on a flat face.

    Args:
      face: Its lower corners, then its upper ones, anticlockwise from outside [m].
      margin: Of the frame around the pane, as a share of the face's shorter length.
    """
    corners = np.array(face)
    centre = corners.mean(axis=0)
    across = corners[1] - corners[0]
    across = across / np.linalg.norm(across)
    out = np.cross(across, corners[2] - corners[1])
    out = out / np.linalg.norm(out)
    facing = np.stack([across, np.cross(out, across), out], axis=1)
    flat = (corners - centre) @ facing[:, :2]
    wide, tall = np.ptp(flat, axis=0)
    frame = 2 * margin * min(wide, tall)
    inner = flat * (1 - frame / np.array([wide, tall]))
    # Corners cut off, so that they look rounded.
    ahead, behind = np.roll(inner, -1, axis=0) - inner, np.roll(inner, 1, axis=0) - inner
    cut = 0.12 * tall
    steps = [cut * v / np.linalg.norm(v, axis=1, keepdims=True) for v in (behind, ahead)]
    outline = np.stack([inner + steps[0], inner + steps[1]], axis=1).reshape(-1, 2)
    return Shape("mesh", mesh=print_on_face(outline, compose(facing, centre), 2), rgba=GLASS)


def lamps(length: float, width: float, heights: tuple[float, float], *, front: bool) -> list[Shape]:
    """Head lamps and a grille, or tail lamps and a number plate; flat prints on the car's end.

    Args:
      length: Of the car [m].
      width: Of the car [m].
      heights: Of the end's lower and upper edge [m].
      front: Which end.
    """
    end, (low, high) = (1.0 if front else -1.0), heights
    facing = np.array([[0.0, 0, end], [end, 0, 0], [0, 1, 0]])
    tall = high - low
    at = np.array([end * length / 2, 0.0, low + 0.52 * tall])
    if front:
        lamp, glow = ellipse((0.16 * tall, 0.16 * tall), 16), LAMP
        plate, rgba = rounded_rectangle((0.17 * width, 0.15 * tall), 1e-4, 1), RUBBER
    else:
        lamp, glow = rounded_rectangle((0.09 * width, 0.10 * tall), 1e-4, 1), TAIL_LAMP
        plate, rgba = rounded_rectangle((0.17 * width, 0.10 * tall), 1e-4, 1), LAMP
    shapes = []
    for side in (-1.0, 1.0):
        pose = compose(facing, at + [0, 0.31 * side * width, 0.05 * tall])
        shapes.append(Shape("mesh", mesh=print_on_face(lamp, pose, 2), rgba=glow))
    pose = compose(facing, at - [0, 0, 0.02 * tall])
    return [*shapes, Shape("mesh", mesh=print_on_face(plate, pose, 2), rgba=rgba)]


def arch(at: Float[np.ndarray, "3"], radius: float, floor: float) -> Shape:
    """A dark print around a wheel on the side that faces away from y = 0.

    Args:
      at: The wheel's axis where it meets the side [m].
      radius: [m].
      floor: Height at which the arch is cut off [m].
    """
    start = np.arcsin(np.clip((floor - at[2]) / radius, -1, 1))
    angles = np.linspace(start, np.pi - start, 20)
    outline = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    side = float(np.sign(at[1]))
    facing = np.array([[-side, 0, 0], [0, 0, side], [0, 1, 0]])
    return Shape("mesh", mesh=print_on_face(outline, compose(facing, at), 1), rgba=RUBBER)


def road_wheel(radius: float, width: float, side: float, *, rims: Colour, density: float) -> Piece:
    """A tyre with a rim, from y = 0 outwards to the side of this sign; its axis is y."""
    r, w = radius, width
    profile = np.array(
        [[0, 0], [0.9 * r, 1e-6], [r, 0.14 * w], [r, 0.86 * w], [0.92 * r, w], [0.70 * r, w + 1e-6]]
        + [[0.62 * r, w + 2e-6], [0.22 * r, w + 3e-6], [0.18 * r, 1.04 * w], [0, 1.04 * w + 1e-6]]
    )
    bands = ((w + 1e-6, RUBBER), (1.0, rims))
    wheel = turned(profile, (0.0, w), bands=bands, density=density, sections=24)
    tyre = Shape("cylinder", (r, w / 2), compose(np.eye(3), np.array([0.0, 0.0, w / 2])))
    turn = rotation_about(np.array([0.0, 0.0, 1.0]), 0.0 if side > 0 else np.pi) @ ALONG_Y[:3, :3]
    return placed(Piece(wheel.visual, (tyre,), wheel.mass), compose(turn, np.zeros(3)))
