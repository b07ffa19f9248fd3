"""A bicycle helmet: a foam shell with vents, a darker lower edge and a visor in front.

Real sizes: helmets for heads of 52-62 cm are 255-310 mm long with their visor, 180-220 mm wide and 125-160 mm tall,
their foam is 18-28 mm thick, and they weigh 220-400 g (EN 1078 tests them on heads of 570 mm). Straps are left out.
Up is X; the visor makes the front reach out farther, so by the rule of the bulge it is on Y's side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from asset_pipeline.procedural.pieces import AreaBox, Piece, rigid_specimen
from asset_pipeline.procedural.sheet import sheet
from asset_pipeline.procedural.shell import offset_loops, shell_piece
from asset_pipeline.procedural.solids import ellipse, loft
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng, uniform
from manipose_mj.assets.geometry import Shape
from manipose_mj.poses import SymmetryGroup

POINTS = 48
RINGS = 15
LIFT = 0.0012  # of the vents' dark patches off the shell [m]
VISOR_THICKNESS = 0.004  # [m]
VISOR_HALF = np.deg2rad(58.0)
DARK: Colour = (0.07, 0.07, 0.08, 1.0)


@dataclass(frozen=True)
class Helmet:
    """Sizes [m] and colours.

    Attributes: length and width of the shell; height of its top above the widest level; foam, thickness;
    power of its superellipsoid; egg, share by which the front is narrower; depth, by how much the lower
    edge lies below the widest level in front and behind; arch, by how much it is higher over the ears; visor, its reach; density of the foam with its skin
    [kg/m^3]; vents in each row: the middle row, and the rows beside it; shell's, edge's and visor's colours.
    """

    length: float = 0.254
    width: float = 0.208
    height: float = 0.112
    foam: float = 0.022
    power: float = 2.25
    egg: float = 0.10
    depth: float = 0.020
    arch: float = 0.008
    visor: float = 0.040
    density: float = 160.0
    vents: tuple[int, int] = (2, 3)
    colour: Colour = (0.80, 0.12, 0.10, 1.0)
    edge: Colour = (0.12, 0.12, 0.13, 1.0)
    peak: Colour = (0.12, 0.12, 0.13, 1.0)

    def height_at(self, plan: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n"]:
        """Of the outside above the widest level, at points seen from above."""
        x, y = plan[..., 0] / (self.length / 2), plan[..., 1] / (self.width / 2)
        rho = np.hypot(x, y / (1 - self.egg * x))
        return self.height * np.clip(1 - rho**self.power, 0, 1) ** (1 / self.power)


_BLACK: Colour = (0.13, 0.13, 0.14, 1.0)
_WHITE: Colour = (0.94, 0.94, 0.93, 1.0)
# Shell, lower edge, visor.
_PAINTS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((0.15, 0.36, 0.66, 1.0), _WHITE, (0.15, 0.36, 0.66, 1.0)),
    (_WHITE, (0.55, 0.57, 0.60, 1.0), _BLACK),
    ((0.90, 0.78, 0.12, 1.0), _BLACK, _BLACK),
    ((0.34, 0.36, 0.38, 1.0), _BLACK, (0.86, 0.36, 0.10, 1.0)),
    ((0.24, 0.56, 0.36, 1.0), _BLACK, (0.24, 0.56, 0.36, 1.0)),
    ((0.90, 0.46, 0.58, 1.0), _WHITE, _WHITE),
    ((0.46, 0.72, 0.78, 1.0), (0.20, 0.30, 0.36, 1.0), (0.20, 0.30, 0.36, 1.0)),
)


def design(index: int) -> Helmet:
    """The sizes of instance `index`; 0 is an adult's."""
    if index == 0:
        return Helmet()
    rng = specimen_rng("helmet", index)
    length = rng.uniform(0.228, 0.260)
    colour, edge, peak = in_turn(index, _PAINTS)
    return Helmet(
        length=round(float(length), 4),
        width=round(float(length * rng.uniform(0.79, 0.86)), 4),
        height=round(float(length * rng.uniform(0.41, 0.47)), 4),
        foam=uniform(rng, 0.018, 0.026),
        power=round(float(rng.uniform(2.1, 2.6)), 2),
        egg=round(float(rng.uniform(0.05, 0.14)), 3),
        depth=uniform(rng, 0.014, 0.026),
        arch=uniform(rng, 0.003, 0.012),
        visor=uniform(rng, 0.034, 0.048),
        density=round(float(rng.uniform(140.0, 185.0)), 0),
        vents=((2, 3), (3, 3), (1, 2), (2, 2))[index % 4],
        colour=colour,
        edge=edge,
        peak=peak,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`: front along +x."""
    helmet = design(index)
    tip = helmet.length / 2 + helmet.visor
    return rigid_specimen(
        "helmet",
        [_shell(helmet), _visor(helmet)],
        object_type="mirror",
        symmetry=SymmetryGroup.identity(),
        areas=(
            AreaBox(
                "grip",
                (-helmet.length / 2, -0.05, -helmet.depth),
                (-0.3 * helmet.length, 0.05, 0.02),
            ),
            AreaBox("grip", (tip - 0.02, -0.05, -0.012), (tip, 0.05, 0.03)),
        ),
    )


def _rim(helmet: Helmet, angle: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Depth of the lower edge below the widest level."""
    return helmet.depth - helmet.arch * np.sin(angle) ** 2


def _plan(helmet: Helmet, rho: np.ndarray, angle: np.ndarray) -> Float[np.ndarray, "*n 2"]:
    """Points seen from above at a share `rho` of the way from the top to the widest level."""
    x = rho * np.cos(angle)
    y = rho * np.sin(angle) * (1 - helmet.egg * x)
    return np.stack([x * helmet.length / 2, y * helmet.width / 2], axis=-1)


def _outside(helmet: Helmet) -> Float[np.ndarray, "rings points 3"]:
    """Rings from the top to the lower edge, which lies at another height all around."""
    angle = np.arange(POINTS) * (2 * np.pi / POINTS)
    depth = _rim(helmet, angle)
    last = np.pi / 2 + np.arcsin(np.clip(depth / helmet.height, -1, 1))
    polar = np.linspace(0.02, 1, RINGS)[:, None] * last
    rho = np.abs(np.sin(polar)) ** (2 / helmet.power)
    z = helmet.height * np.sign(np.cos(polar)) * np.abs(np.cos(polar)) ** (2 / helmet.power)
    # Below the widest level the sides go on nearly straight down.
    below = np.minimum(z, 0)
    rho = np.where(z < 0, 1 + 0.25 * below / helmet.height, rho)
    return np.concatenate([_plan(helmet, rho, angle), z[..., None]], axis=-1)


def _shell(helmet: Helmet) -> Piece:
    outer = _outside(helmet)
    inner = offset_loops(outer, helmet.foam)
    inner[-1, :, 2] = outer[-1, :, 2]
    piece = shell_piece(
        outer,
        inner,
        cuts=(0, 3, 6, 10, RINGS - 1),
        wedges=(8, 12, 16, 16),
        colours=((RINGS - 3, helmet.colour), (RINGS - 1, helmet.edge)),
        inside=DARK,
        density=helmet.density,
    )
    return Piece((*piece.visual, *_vents(helmet)), piece.collision, piece.mass)


def _vents(helmet: Helmet) -> list[Shape]:
    """Dark patches along the head, in a middle row and two rows on either side."""
    shapes = []
    middle, beside = helmet.vents
    rows = ((0.0, middle, 0.095), (0.36, beside, 0.085), (-0.36, beside, 0.085))
    rows += ((0.68, 2, 0.065), (-0.68, 2, 0.065))
    for y, count, width in rows:
        span = 1.62 * np.sqrt(1 - y**2)
        half = np.array([0.43 * span / count * helmet.length / 2, width * helmet.width / 2])
        for x in (np.arange(count) + 0.5) / count * span - span / 2:
            centre = np.array([x * helmet.length, y * (1 - helmet.egg * x) * helmet.width]) / 2
            outline = ellipse((half[0], half[1]), 24)
            rings = np.stack([centre + share * outline for share in (1.0, 1.0, 0.7, 0.4, 0.1)])
            z = helmet.height_at(rings)
            z[1:] += LIFT
            mesh = loft(np.concatenate([rings, z[..., None]], axis=-1), caps=(False, True))
            shapes.append(Shape("mesh", mesh=mesh, rgba=DARK))
    return shapes


def _visor(helmet: Helmet) -> Piece:
    """A bent plate from near the lower edge of the front outwards."""
    angle = np.linspace(-VISOR_HALF, VISOR_HALF, 25)
    share = np.linspace(0, 1, 5)
    root = _plan(helmet, np.full(25, 0.97), angle)
    z = -_rim(helmet, angle) + 0.014
    reach = helmet.visor * np.cos(angle * (np.pi / 2 / VISOR_HALF)).clip(0.08) ** 0.6
    x = root[:, :1] + share * (reach[:, None] + 0.003)
    y = np.broadcast_to(root[:, 1:], x.shape)
    height = np.broadcast_to(z[:, None], x.shape)
    middle = np.stack([x, y, height], axis=-1)
    cuts = ((0, 6, 1), (6, 12, 1), (12, 18, 1), (18, 24, 1))
    thickness = np.full(x.shape, VISOR_THICKNESS)
    return sheet(middle, thickness, cuts=cuts, rgba=helmet.peak, density=900.0)
