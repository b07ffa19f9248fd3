"""A table-top cabinet: a column of three drawers and, beside it, a column behind a door.

Real sizes. Sold desk-top drawer cabinets are 250-400 mm deep and 300-450 mm tall, of boards of
12-18 mm; bar handles stand 30-40 mm off the front. The drawers run on full-extension slides, so that
a drawer comes out by nearly its own depth; they shut by the slides' friction.

Frame: z up, origin at the centre of the carcass's bottom face, front towards -x, door on the +y side.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians

import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.assets import Cavity, MovingPart
from asset_pipeline.geometry import Body, Joint, Shape
from asset_pipeline.labelling.label import PoseLabel
from asset_pipeline.mass import shape_mass_properties
from asset_pipeline.procedural.articulated.bar_handle import BarHandle, bar_handle
from asset_pipeline.procedural.solids import box, rounded_box
from asset_pipeline.procedural.specimen import Colour, Specimen, in_turn, specimen_rng
from manipose_mj.poses import SymmetryGroup

WOOD = 680.0  # [kg/m^3], between particle board and beech
ALUMINIUM = 2700.0
DRAWERS = ("bottom_drawer", "middle_drawer", "top_drawer")


@dataclass(frozen=True)
class Cabinet:
    """Sizes [m], colours, and how the joints resist.

    Attributes:
      depth, height: Of the carcass.
      drawer_column, door_column: Widths; the first counts both boards beside the drawers, the second
        the outer board of the door's side.
      board, front: Thickness of the carcass's boards and of the drawers' fronts and the door.
      gap: Between all that moves and all else.
      wall, wall_height: Of a drawer's sides and back; its floor is as thick.
      inner_depth: Of a drawer.
      travel: Of a drawer [m]; swing: of the door [rad].
      drawer_friction [N], drawer_damping [N s/m], door_friction [N m], door_damping [N m s/rad].
      handle: On every front; wood, front_rgba, inside: colours.
    """

    depth: float = 0.400
    height: float = 0.420
    drawer_column: float = 0.380
    door_column: float = 0.260
    board: float = 0.012
    front: float = 0.012
    gap: float = 0.003
    wall: float = 0.007
    wall_height: float = 0.055
    inner_depth: float = 0.340
    travel: float = 0.320
    swing: float = radians(110)
    drawer_friction: float = 2.0
    drawer_damping: float = 8.0
    door_friction: float = 0.25
    door_damping: float = 0.3
    handle: BarHandle = BarHandle()
    wood: Colour = (0.86, 0.73, 0.55, 1.0)
    front_rgba: Colour = (0.76, 0.58, 0.39, 1.0)
    inside: Colour = (0.91, 0.83, 0.69, 1.0)

    @property
    def width(self) -> float:
        """Of the carcass."""
        return self.drawer_column + self.door_column

    @property
    def split(self) -> float:
        """Where the board between the columns has its middle, along y."""
        return -self.width / 2 + self.drawer_column - self.board / 2

    def opening_heights(self, row: int) -> tuple[float, float]:
        """Lower and upper end of the space between the boards of a drawer's row."""
        clear = (self.height - 4 * self.board) / 3
        low = self.board + row * (clear + self.board)
        return low, low + clear


_WOODS: tuple[tuple[Colour, Colour, Colour, Colour], ...] = (
    (
        (0.93, 0.92, 0.90, 1.0),
        (0.80, 0.84, 0.86, 1.0),
        (0.95, 0.94, 0.92, 1.0),
        (0.20, 0.20, 0.21, 1.0),
    ),
    (
        (0.50, 0.34, 0.22, 1.0),
        (0.58, 0.40, 0.26, 1.0),
        (0.70, 0.55, 0.39, 1.0),
        (0.12, 0.11, 0.10, 1.0),
    ),
    (
        (0.85, 0.76, 0.62, 1.0),
        (0.42, 0.55, 0.48, 1.0),
        (0.90, 0.84, 0.73, 1.0),
        (0.17, 0.16, 0.15, 1.0),
    ),
    (
        (0.78, 0.62, 0.43, 1.0),
        (0.90, 0.88, 0.83, 1.0),
        (0.86, 0.75, 0.58, 1.0),
        (0.25, 0.23, 0.22, 1.0),
    ),
    (
        (0.88, 0.78, 0.60, 1.0),
        (0.30, 0.38, 0.50, 1.0),
        (0.92, 0.85, 0.72, 1.0),
        (0.14, 0.14, 0.16, 1.0),
    ),
)


def design(index: int) -> Cabinet:
    """The sizes of instance `index`; every one takes a lying chips can in each of its drawers."""
    if index == 0:
        return Cabinet()
    rng = specimen_rng("cabinet", index)
    wood, front, inside, metal = in_turn(index, _WOODS)
    standard = Cabinet()
    return replace(
        standard,
        height=round(float(rng.uniform(0.396, 0.420)), 3),
        drawer_column=round(float(rng.uniform(0.345, 0.390)), 3),
        door_column=round(float(rng.uniform(0.230, 0.280)), 3),
        wall_height=round(float(rng.uniform(0.050, 0.060)), 3),
        inner_depth=round(float(rng.uniform(0.335, 0.345)), 3),
        travel=round(float(rng.uniform(0.315, 0.325)), 3),
        drawer_friction=round(float(rng.uniform(1.5, 3.0)), 2),
        drawer_damping=round(float(rng.uniform(5.0, 10.0)), 1),
        handle=BarHandle(
            length=round(float(rng.uniform(0.120, 0.140)), 3),
            thickness=round(float(rng.uniform(0.010, 0.012)), 4),
            standoff=round(float(rng.uniform(0.035, 0.040)), 4),
            rgba=metal,
        ),
        wood=wood,
        front_rgba=front,
        inside=inside,
    )


def generate(index: int = 0) -> Specimen:
    """Instance `index`, everything shut."""
    cabinet = design(index)
    drawers = [_drawer(cabinet, row) for row in range(len(DRAWERS))]
    moving = [*drawers, _door(cabinet)]
    bodies = (_carcass(cabinet), *(body for body, _ in moving))
    surface = trimesh.util.concatenate([body.surface() for body in bodies])
    low, high = surface.bounds
    # X up, Y out of the front, Z to the drawers' side.
    rotation = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    label = PoseLabel(
        origin=(low + high) / 2,
        rotation=rotation,
        object_type="articulated",
        extents=np.abs(rotation.T @ (high - low)),
        symmetry=SymmetryGroup.identity(),
    )
    return Specimen(label, bodies, tuple(part for _, part in moving))


def _carcass(c: Cabinet) -> Body:
    x, y, t = c.depth / 2, c.width / 2, c.board
    sides = [
        ((-x, -y, t), (x, -y + t, c.height - t)),
        ((-x, c.split - t / 2, t), (x, c.split + t / 2, c.height - t)),
        ((-x, y - t, t), (x, y, c.height - t)),
    ]
    shelves = [
        (
            (-x, -y + t, c.opening_heights(row)[1]),
            (x - t, c.split - t / 2, c.opening_heights(row)[1] + t),
        )
        for row in range(2)
    ]
    backs = [
        ((x - t, -y + t, t), (x, c.split - t / 2, c.height - t)),
        ((x - t, c.split + t / 2, t), (x, y - t, c.height - t)),
    ]
    covers = [((-x, -y, 0.0), (x, y, t)), ((-x, -y, c.height - t), (x, y, c.height))]
    shapes = [box(*ends, c.wood) for ends in (*covers, *sides)]
    shapes += [box(*ends, c.inside) for ends in (*shelves, *backs)]
    return Body("base", tuple(shapes), tuple(shapes), shape_mass_properties(shapes, WOOD))


def _drawer(c: Cabinet, row: int) -> tuple[Body, MovingPart]:
    low, high = c.opening_heights(row)
    face = -c.depth / 2 - c.gap  # the inner side of the front
    side = -c.width / 2 + c.board + c.gap, c.split - c.board / 2 - c.gap
    floor, back = low + c.gap + c.wall, face + c.inner_depth
    top = low + c.gap + c.wall + c.wall_height
    panel_z = (
        c.gap if row == 0 else low - c.board / 2 + c.gap / 2,
        c.height if row == 2 else high + c.board / 2 - c.gap / 2,
    )
    panel = (
        np.array([face - c.front, -c.width / 2, panel_z[0]]),
        np.array([face, c.split - c.gap / 2, panel_z[1]]),
    )
    inner = side[0] + c.wall, side[1] - c.wall
    boards = [
        ((face, side[0], low + c.gap), (back + c.wall, side[1], floor)),
        ((face, side[0], floor), (back + c.wall, inner[0], top)),
        ((face, inner[1], floor), (back + c.wall, side[1], top)),
        ((back, inner[0], floor), (back + c.wall, inner[1], top)),
    ]
    cavity_low = np.array([face, inner[0], floor])
    cavity_high = np.array([back, inner[1], high])
    cavity = Cavity((cavity_low + cavity_high) / 2, cavity_high - cavity_low, moves_with_part=True)
    joint = Joint(
        kind="slide",
        origin=np.array([face, (side[0] + side[1]) / 2, low]),
        axis=np.array([-1.0, 0.0, 0.0]),
        range=(0.0, c.travel),
        frictionloss=c.drawer_friction,
        damping=c.drawer_damping,
    )
    foot = (panel[0] + panel[1]) / 2
    foot[0] = face - c.front
    boxes = [box(*ends, c.inside) for ends in boards]
    return _moving(c, DRAWERS[row], panel, boxes, foot, "level", joint, cavity)


def _door(c: Cabinet) -> tuple[Body, MovingPart]:
    face = -c.depth / 2 - c.gap
    y, t = c.width / 2, c.board
    panel = (
        np.array([face - c.front, c.split + c.gap / 2, c.gap]),
        np.array([face, y, c.height]),
    )
    cavity_low = np.array([-c.depth / 2, c.split + t / 2, t])
    cavity_high = np.array([c.depth / 2 - t, y - t, c.height - t])
    cavity = Cavity((cavity_low + cavity_high) / 2, cavity_high - cavity_low, moves_with_part=False)
    # About the inner outer edge, the door swings clear of the carcass.
    joint = Joint(
        kind="hinge",
        origin=np.array([face, y, c.height / 2]),
        axis=np.array([0.0, 0.0, -1.0]),
        range=(0.0, c.swing),
        frictionloss=c.door_friction,
        damping=c.door_damping,
    )
    foot = np.array([face - c.front, panel[0][1] + 0.032, (panel[0][2] + panel[1][2]) / 2])
    return _moving(c, "door", panel, [], foot, "upright", joint, cavity)


def _moving(
    c: Cabinet,
    name: str,
    panel: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]],
    boxes: list[Shape],
    foot: Float[np.ndarray, "3"],
    direction,
    joint: Joint,
    cavity: Cavity,
) -> tuple[Body, MovingPart]:
    """A front panel with its handle and whatever boards hang on it."""
    grip, grip_looks, handle = bar_handle(c.handle, foot, direction)
    collision = (box(*panel, c.front_rgba), *boxes, *grip)
    densities = [WOOD] * (1 + len(boxes)) + [ALUMINIUM] * len(grip)
    body = Body(
        name=name,
        collision=collision,
        visual=(rounded_box(*panel, 0.002, c.front_rgba), *boxes, *grip_looks),
        mass_properties=shape_mass_properties(collision, densities),
        joint=joint,
    )
    return body, MovingPart(name, joint, handle, cavity)
