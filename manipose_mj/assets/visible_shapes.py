"""What is seen of a built asset, and what touches, read back from its `model.xml`: the inverse of what `emit` writes."""

from __future__ import annotations

from pathlib import Path
from typing import cast
from xml.etree import ElementTree

import numpy as np
import trimesh

from manipose_mj.assets.asset import MODEL_FILE
from manipose_mj.assets.geometry import Shape
from manipose_mj.assets.physics import COLLISION_GROUP, VISUAL_GROUP
from manipose_mj.errors import InputError
from manipose_mj.poses import vector_to_pose


def visible_shapes(folder: Path) -> dict[str, tuple[Shape, ...]]:
    """The visual shapes of every body by its name, in the object frame with all joints at zero.

    Raises:
      InputError: The model or a mesh it names cannot be read.
    """
    return _shapes(folder, VISUAL_GROUP)


def collision_shapes(folder: Path) -> dict[str, tuple[Shape, ...]]:
    """The collision shapes of every body by its name, in the object frame with all joints at zero.

    Raises:
      InputError: The model or a mesh it names cannot be read.
    """
    return _shapes(folder, COLLISION_GROUP)


def _shapes(folder: Path, group: int) -> dict[str, tuple[Shape, ...]]:
    path = folder / MODEL_FILE
    try:
        root = ElementTree.parse(path).getroot()
        meshes, images = (
            {each.attrib["name"]: folder / each.attrib["file"] for each in root.findall(kind)}
            for kind in ("asset/mesh", "asset/texture")
        )
        materials = {
            each.attrib["name"]: images[each.attrib["texture"]]
            for each in root.findall("asset/material")
        }
        return {
            body.attrib["name"]: tuple(
                _shape(geom, meshes, materials)
                for geom in body.findall("geom")
                if geom.get("group") == str(group)
            )
            for body in root.iter("body")
        }
    except (OSError, KeyError, ValueError, ElementTree.ParseError) as error:
        raise InputError(f"{path}: cannot be read as the model of an asset ({error})") from None


def surface(shapes: dict[str, tuple[Shape, ...]]) -> trimesh.Trimesh:
    """All of an object as one mesh without colours or textures, in the object frame."""
    meshes = [shape.surface() for own in shapes.values() for shape in own]
    bare = [trimesh.Trimesh(m.vertices, m.faces, process=False) for m in meshes]
    return cast(trimesh.Trimesh, trimesh.util.concatenate(bare))


def _shape(geom: ElementTree.Element, meshes: dict[str, Path], materials: dict[str, Path]) -> Shape:
    kind, numbers = geom.attrib["type"], geom.get("rgba", "0.7 0.7 0.7 1").split()
    r, g, b, a = map(float, numbers)
    material = geom.get("material")
    texture = None if material is None else materials[material]
    if kind == "mesh":
        file = meshes[geom.attrib["mesh"]]
        mesh = trimesh.load(file, force="mesh", process=False, skip_materials=True)
        return Shape("mesh", mesh=cast(trimesh.Trimesh, mesh), rgba=(r, g, b, a), texture=texture)
    vector = [*geom.attrib["pos"].split(), *geom.attrib["quat"].split()]
    return Shape(
        kind,  # pyright: ignore[reportArgumentType]
        size=tuple(map(float, geom.attrib["size"].split())),
        pose=vector_to_pose(np.array(vector, float)),
        rgba=(r, g, b, a),
    )
