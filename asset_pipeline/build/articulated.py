"""From a drawn articulated object to an asset that opens, shuts and holds things."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from asset_pipeline.build.emit import write_asset
from asset_pipeline.build.link_shapes import link_shapes
from asset_pipeline.build.link_visuals import Textures, link_visuals
from asset_pipeline.geometry.mass import shape_mass_properties
from asset_pipeline.labelling.articulated_label import articulated_label
from asset_pipeline.labelling.cavities import cavity_behind
from asset_pipeline.labelling.handle_label import handle_label
from asset_pipeline.sources.articulated_scan import HANDLE, ArticulatedScan, LinkRole, ScanLink
from asset_pipeline.sources.drawn_handle import face_normal, mesh_bounds, with_handle
from manipose_mj.assets.asset import Asset, Cavity, MovingPart
from manipose_mj.assets.geometry import Body, Joint, MassProperties, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.physics import GRAVITY

# Densities [kg/m^3]. An appliance's walls and doors are sheets around foam, glass wool and air: a
# counter-top microwave weighs 10-15 kg, a dishwasher 40 kg.
BOARD, WALL, GLASS, METAL, PLASTIC = 680.0, 400.0, 2500.0, 2700.0, 1100.0
# Where an appliance is drawn as a sheet thinner than this [m], it is steel of 1 mm [kg/m^2].
SHEET, SHEET_MASS = 0.008, 7.85


@dataclass(frozen=True)
class JointResistance:
    """How a joint resists. Attributes: friction [N or N m]; damping [N s/m or N m s/rad]."""

    friction: float
    damping: float


# Of the built-in cabinet's drawers and door; of kitchen appliances' knobs and buttons.
RESISTANCE: dict[LinkRole, JointResistance] = {
    "drawer": JointResistance(2.0, 8.0),
    "door": JointResistance(0.25, 0.3),
    "lid": JointResistance(0.25, 0.3),
    "knob": JointResistance(0.02, 0.005),
    "button": JointResistance(0.5, 2.0),
    "tray": JointResistance(0.1, 0.1),
}
# A door that its weight would open or shut with more than this hangs on springs [N m] ...
HEAVY = 0.2
# ... that carry this share of it.
BALANCED = 0.95
# Friction exceeds what is left of the weight by this factor, so that a part stays where it is put.
HOLD = 1.3
# Two parts this near to each other when shut may brush past each other [m].
NEAR = 0.01


def build_articulated(scan: ArticulatedScan, folder: Path) -> Asset:
    """Give shape, mass, joints, handles and cavities to a scan, and write its asset folder.

    A moving part makes no contact with the base, nor with a part whose bounding box is within 1 cm of
    its own while both are shut: drawn doors and carcasses overlap by millimetres. Both still collide with all else.
    A handle that is drawn as one part with its door becomes a part of its own, and a knob that nobody turns a handle.
    Links that are knobs become hinges of one full turn, and buttons slides without a spring; none of them, nor a tray,
    has a handle.
    """
    base = mesh_bounds([part.mesh for part in scan.base.parts])
    scan = replace(scan, moving=tuple(with_handle(link, base) for link in scan.moving))
    links = (scan.base, *scan.moving)
    shapes = {link.name: link_shapes(link) for link in links}
    flat = {name: [s for group in own.values() for s in group] for name, own in shapes.items()}
    boxes = {name: _bounds(own) for name, own in flat.items()}
    parts = []
    with tempfile.TemporaryDirectory(prefix="manipose-texture-") as scratch:
        bodies, textures = [], Textures(Path(scratch))
        for link in links:
            mass = _mass(link, shapes[link.name], scan.appliance)
            joint, balanced = _joint(link, mass)
            bodies.append(
                Body(
                    name=link.name,
                    collision=tuple(flat[link.name]),
                    visual=link_visuals(link.parts, textures),
                    mass_properties=mass,
                    joint=joint,
                    excluded=_excluded(link, scan, boxes),
                    balanced=balanced,
                )
            )
            if joint is not None:
                outwards = face_normal(link, boxes["base"])
                handle = _handle(link, outwards)
                cavity = _cavity(link, flat, boxes, outwards)
                parts.append(MovingPart(link.name, joint, handle, cavity))
        asset = Asset(
            folder=Path(folder),
            name=scan.name,
            kind="articulated",
            category=scan.category,
            label=articulated_label(bodies),
            up=np.array([0.0, 0.0, 1.0]),
            mass_properties=bodies[0].mass_properties,
            stable_poses=(),
            provenance=scan.provenance,
            parts=tuple(parts),
        )
        return write_asset(asset, tuple(bodies))


def _mass(link: ScanLink, shapes: dict[str, tuple[Shape, ...]], appliance: bool) -> MassProperties:
    """Of what the collision shapes fill; where walls cross, twice."""

    def density(name: str, shape: Shape) -> float:
        if name == HANDLE:
            return METAL
        if name == "glass":
            return GLASS
        if link.role in ("knob", "button"):
            return PLASTIC
        if not appliance:
            return BOARD
        thickness = 2 * min(shape.size) if shape.kind == "box" else SHEET
        return SHEET_MASS / thickness if thickness < SHEET else WALL

    pairs = [(name, shape) for name, own in shapes.items() for shape in own]
    return shape_mass_properties([s for _, s in pairs], [density(*pair) for pair in pairs])


def _joint(link: ScanLink, mass: MassProperties) -> tuple[Joint | None, float]:
    """The joint, and the share of the part's weight that springs carry."""
    if link.joint is None or link.role is None:
        return None, 0.0
    joint = link.joint
    # A door that slides resists as a drawer does: the figures of the others are those of hinges.
    sliding_door = link.role == "door" and joint.kind == "slide"
    resistance = RESISTANCE["drawer" if sliding_door else link.role]
    weight = GRAVITY * mass.mass
    if joint.kind == "slide":
        load = weight * abs(joint.axis[2])
    else:
        arm = mass.center_of_mass - joint.origin
        arm = arm - (arm @ joint.axis) * joint.axis
        load = weight * float(np.linalg.norm(arm)) * float(np.sqrt(max(1 - joint.axis[2] ** 2, 0)))
    balanced = BALANCED if joint.kind == "hinge" and load > HEAVY else 0.0
    return Joint(
        kind=joint.kind,
        origin=joint.origin,
        axis=joint.axis + 0.0,
        range=(0.0, joint.travel),
        frictionloss=resistance.friction + HOLD * (1 - balanced) * load,
        damping=resistance.damping,
    ), balanced


def _excluded(
    link: ScanLink, scan: ArticulatedScan, boxes: dict[str, Float[np.ndarray, "2 3"]]
) -> tuple[str, ...]:
    """The base, and the parts before this one that it meets when shut."""
    if link.joint is None:
        return ()
    own = boxes[link.name]
    earlier = scan.moving[: scan.moving.index(link)]
    near = [
        other.name
        for other in earlier
        if (own[0] < boxes[other.name][1] + NEAR).all()
        and (boxes[other.name][0] < own[1] + NEAR).all()
    ]
    return (scan.base.name, *near)


def _handle(link: ScanLink, outwards: Float[np.ndarray, "3"]) -> PoseLabel | None:
    """The label of the largest handle of what opens."""
    handles = [p.mesh for p in link.parts if p.name == HANDLE]
    if not handles or link.role not in ("door", "drawer", "lid"):
        return None
    return handle_label(max(handles, key=lambda m: float(np.ptp(m.bounds, axis=0).max())), outwards)


def _cavity(
    link: ScanLink,
    shapes: dict[str, list[Shape]],
    boxes: dict[str, Float[np.ndarray, "2 3"]],
    outwards: Float[np.ndarray, "3"],
) -> Cavity | None:
    own = shapes[link.name]
    others = [s for name, group in shapes.items() if name != link.name for s in group]
    if link.role == "drawer":
        down = np.array([0.0, 0.0, -1.0])
        return cavity_behind(others, own, boxes[link.name], down, moves_with_part=True)
    if link.role not in ("door", "lid"):
        return None
    axis = int(np.abs(outwards).argmax())
    region = boxes[link.name].copy()
    far = 0 if outwards[axis] > 0 else 1
    region[far, axis] = boxes["base"][far, axis]
    return cavity_behind(own, others, region, -outwards, moves_with_part=False)


def _bounds(shapes: list[Shape]) -> Float[np.ndarray, "2 3"]:
    bounds = np.array([s.surface().bounds for s in shapes])
    return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])
