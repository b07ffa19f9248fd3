"""Write an asset folder: meshes, `model.xml`, `asset.json`, all or nothing."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh

from manipose_mj.assets.asset import MODEL_FILE, Asset
from manipose_mj.assets.asset_json import read_asset, write_asset_json
from manipose_mj.assets.geometry import Body, MassProperties, Shape
from manipose_mj.assets.physics import COLLISION_GROUP, SOLIMP, SOLREF, VISUAL_GROUP
from manipose_mj.poses import pose_to_vector
from manipose_mj.storage.staging import put_in_place


def write_asset(asset: Asset, bodies: tuple[Body, ...]) -> Asset:
    """Write the folder `asset.folder` and return the asset as read back from it.

    The folder appears whole by one rename, so a reader never sees half of it and a killed writer
    leaves the old one. The first body is the base; a rigid object has only that one.

    Args:
      asset: What `asset.json` will say; its `folder` is where to write.
      bodies: The base and, for articulated objects, one body per moving part.
    """
    folder = asset.folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        root = model_element(asset.name, bodies, staging)
        ElementTree.indent(root, " ")
        ElementTree.ElementTree(root).write(staging / MODEL_FILE, encoding="unicode")
        write_asset_json(replace(asset, folder=staging))
        staging.chmod(0o755)
        put_in_place(staging, folder)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return read_asset(folder)


def model_element(name: str, bodies: tuple[Body, ...], folder: Path) -> ElementTree.Element:
    """The MJCF of an object; its meshes and textures are written under `folder/meshes`.

    A rigid object's base has a free joint; an articulated object's base is fixed to the world.
    """
    (folder / "meshes").mkdir(exist_ok=True)
    root = ElementTree.Element("mujoco", model=name)
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    assets = ElementTree.SubElement(root, "asset")
    world = ElementTree.SubElement(root, "worldbody")
    base, *parts = bodies
    base_element = _body_element(world, assets, base, folder)
    if not parts:
        base_element.insert(0, ElementTree.Element("freejoint", name="free"))
    for part in parts:
        assert part.joint is not None
        element = _body_element(base_element, assets, part, folder)
        joint = ElementTree.Element(
            "joint",
            name=part.name,
            type=part.joint.kind,
            pos=numbers(part.joint.origin),
            axis=numbers(part.joint.axis),
            range=numbers(part.joint.range),
            frictionloss=numbers([part.joint.frictionloss]),
            damping=numbers([part.joint.damping]),
            armature="0.001",
            # A stop that gives way under a pull lets a drawer creep out of its cabinet.
            solreflimit="0.01 1",
        )
        element.insert(0, joint)
    pairs = [(part.name, other) for part in parts for other in part.excluded]
    if pairs:
        contact = ElementTree.SubElement(root, "contact")
        for one, other in pairs:
            ElementTree.SubElement(contact, "exclude", body1=one, body2=other)
    return root


def _body_element(
    parent: ElementTree.Element, assets: ElementTree.Element, body: Body, folder: Path
) -> ElementTree.Element:
    element = ElementTree.SubElement(parent, "body", name=body.name)
    if body.balanced:
        element.set("gravcomp", numbers([body.balanced]))
    element.append(_inertial_element(body.mass_properties))
    for index, shape in enumerate(body.collision):
        geom = _geom_element(element, assets, shape, f"{body.name}_collision_{index:02d}", folder)
        geom.set("group", str(COLLISION_GROUP))
        geom.set("condim", "6" if body.friction[2] > 0 else "4")
        geom.set("friction", numbers(body.friction))
        geom.set("solref", numbers(SOLREF))
        geom.set("solimp", numbers(SOLIMP))
        geom.set("rgba", "0.3 0.6 0.9 0.4")
    for index, shape in enumerate(body.visual):
        geom = _geom_element(element, assets, shape, f"{body.name}_visual_{index:02d}", folder)
        geom.set("group", str(VISUAL_GROUP))
        geom.set("contype", "0")
        geom.set("conaffinity", "0")
        geom.set("mass", "0")
        if shape.texture is None:
            geom.set("rgba", numbers(shape.rgba))
    return element


def _inertial_element(properties: MassProperties) -> ElementTree.Element:
    i = properties.inertia
    return ElementTree.Element(
        "inertial",
        pos=numbers(properties.center_of_mass),
        mass=numbers([properties.mass]),
        fullinertia=numbers([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]),
    )


def _geom_element(
    parent: ElementTree.Element,
    assets: ElementTree.Element,
    shape: Shape,
    name: str,
    folder: Path,
) -> ElementTree.Element:
    geom = ElementTree.SubElement(parent, "geom", name=name, type=shape.kind)
    if shape.kind != "mesh":
        vector = pose_to_vector(shape.pose)
        geom.set("size", numbers(shape.size))
        geom.set("pos", numbers(vector[:3]))
        geom.set("quat", numbers(vector[3:]))
        return geom
    assert shape.mesh is not None
    file = f"meshes/{name}.obj"
    # Generated visuals need no more than 10 um; a scan stays as published, other data refer to its frame.
    exact = "_collision_" in name or shape.texture is not None
    write_obj(shape.mesh, folder / file, digits=6 if exact else 5)
    ElementTree.SubElement(assets, "mesh", name=name, file=file, inertia="shell")
    geom.set("mesh", name)
    if shape.texture is not None:
        image = f"meshes/{name}.png"
        shutil.copyfile(shape.texture, folder / image)
        (folder / image).chmod(0o644)
        ElementTree.SubElement(assets, "texture", name=name, type="2d", file=image)
        ElementTree.SubElement(assets, "material", name=name, texture=name, specular="0.2")
        geom.set("material", name)
    return geom


def write_obj(mesh: trimesh.Trimesh, path: Path, *, digits: int) -> None:
    """A Wavefront OBJ with so many decimals [m] and, where the mesh has them, texture coordinates."""
    vertices = np.round(np.asarray(mesh.vertices), digits) + 0.0  # no negative zeros
    text = _rows("v %g %g %g\n", vertices)
    uv = getattr(mesh.visual, "uv", None)
    faces = np.asarray(mesh.faces) + 1
    if uv is None:
        text += _rows("f %d %d %d\n", faces)
    else:
        text += _rows("vt %.5f %.5f\n", np.asarray(uv))
        text += _rows("f %d/%d %d/%d %d/%d\n", faces.repeat(2, axis=1))
    path.write_text(text, encoding="ascii")


def _rows(template: str, values: np.ndarray) -> str:
    """The template once for each row, written at once: that takes half the time."""
    return template * len(values) % tuple(values.ravel().tolist())


def numbers(values: Iterable[float]) -> str:
    """Numbers as an MJCF attribute, to nine digits."""
    return " ".join(f"{float(v):.9g}" for v in values)
