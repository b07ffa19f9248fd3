"""A block and a cupboard with labels, as asset folders, for tests of what people do to labels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

import tests.asset_pipeline.scan_files as files
from asset_pipeline.build.emit import write_asset
from manipose_mj.assets.asset import Area, Asset, GraspSet, MovingPart, Provenance, StablePose
from manipose_mj.assets.geometry import Body, Joint, MassProperties, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.label_quality import LabelQuality
from manipose_mj.poses import SymmetryGroup

UP = np.array([0.0, 0.0, 1.0])
MASS = MassProperties(0.5, np.array([0.0, 0.0, 0.1]), np.diag([1e-3, 2e-3, 2.5e-3]))
# X up, Y and Z along the mesh's own x and y.
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
SIZE = (0.06, 0.04, 0.2)


def label(kind: str = "mirror", symmetry: SymmetryGroup | None = None) -> PoseLabel:
    """Of a box of `SIZE` that stands on z = 0."""
    group = SymmetryGroup.two_planes() if symmetry is None else symmetry
    extents = np.array([SIZE[2], SIZE[0], SIZE[1]])
    return PoseLabel(np.array([0.0, 0.0, 0.1]), UPRIGHT, kind, extents, group)


def block(folder: Path, *, confidence: float | None = 0.6) -> Asset:
    """A textured box with a rest pose, a grasp and an area."""
    mesh = files.box(SIZE)
    image = folder.parent / f"{folder.name}.png"
    folder.parent.mkdir(parents=True, exist_ok=True)
    image.write_bytes(files.image())
    uv = np.linspace(0, 1, 2 * len(mesh.vertices)).reshape(-1, 2)
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv)
    shape = Shape("mesh", mesh=mesh, texture=image)
    asset = Asset(
        folder=folder,
        name=folder.name,
        kind="rigid",
        category="box",
        label=label(),
        up=UP,
        mass_properties=MASS,
        stable_poses=(StablePose(np.eye(3), 0.0, 1.0),),
        provenance=Provenance("test", "block", "none", {"a.obj": "0" * 64}),
        areas=(Area("grip", np.array([0.05, 0.0, 0.0]), np.array([0.1, 0.06, 0.04])),),
        grasps=GraspSet(np.eye(4)[None], np.array([0.04]), np.array([[True]])),
        label_quality=None if confidence is None else LabelQuality(confidence, {"axis": 0.002}),
    )
    collision = Shape("box", size=tuple(s / 2 for s in SIZE))
    return write_asset(asset, (Body("block", (collision,), (shape,), MASS),))


def cupboard(folder: Path) -> Asset:
    """A box with a drawer that has a handle, and a door that has none."""
    handle = PoseLabel(
        np.array([-0.3, 0.0, 0.1]),
        np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
        "handle",
        np.array([0.1, 0.02, 0.01]),
        SymmetryGroup.identity(),
    )
    parts = (
        MovingPart("drawer", Joint("slide", np.zeros(3), -np.eye(3)[0], (0.0, 0.3)), handle, None),
        MovingPart("door", Joint("hinge", np.eye(3)[0], UP, (0.0, 1.5)), None, None),
    )
    asset = Asset(
        folder=folder,
        name=folder.name,
        kind="articulated",
        category="cabinet",
        label=label("articulated", SymmetryGroup.identity()),
        up=UP,
        mass_properties=MASS,
        stable_poses=(),
        provenance=Provenance("test", "cupboard", "none"),
        parts=parts,
    )
    shape = (Shape("box", size=(0.03, 0.02, 0.1), rgba=(0.2, 0.4, 0.6, 1.0)),)
    bodies = [Body(p.name, shape, shape, MASS, joint=p.joint) for p in parts]
    return write_asset(asset, (Body("base", shape, shape, MASS), *bodies))
