"""Small valid objects in every publisher's layout, their files as the publisher writes them."""

from __future__ import annotations

import json
from functools import lru_cache

import numpy as np
import trimesh

import tests.asset_pipeline.scan_files as files

Files = dict[str, bytes]
SIZE = (0.11, 0.09, 0.12)  # too wide to grasp: quick
FINE = 4  # subdivisions: 3,072 triangles of some 5 mm


@lru_cache(maxsize=16)
def valid(source: str, subdivisions: int = FINE) -> Files:
    """An undamaged object, its files written as the publisher's are."""
    box = scanned_box(subdivisions)
    if source == "ycb":
        home = "001_thing/google_16k/"
        return {
            f"{home}textured.obj": obj(box, "textured.mtl", normals=True, counts=True),
            f"{home}textured.mtl": b"newmtl material_0\n# shader_type beckmann\nmap_Kd texture_map.png\n\n",
            f"{home}texture_map.png": files.image(),
        }
    if source == "google_scanned_objects":
        home = "models/Thing/"
        return {
            f"{home}model.obj": obj(box, "material_0.mtl").rstrip(b"\n"),
            f"{home}texture.png": files.image(),
        }
    if source == "omniobject3d":
        home = "raw_scans/box/box_001/Scan/Scan"
        return {f"{home}.obj": obj(box.apply_scale(1000), "Scan.mtl"), f"{home}.jpg": files.jpeg()}
    if source == "pace":
        size = {f"size_{axis}": 1000 * s for axis, s in zip("xyz", SIZE, strict=True)}
        info = {"1": {"identifier": "box/001", "diameter": 185.9, **size}}
        return {
            "models/obj_000001.ply": files.meshlab_ply(box.apply_scale(1000), "obj_000001.png"),
            "models/obj_000001.png": files.image(),
            "models/models_info.json": json.dumps(info).encode(),
        }
    return _cabinet("dataset/4711/")


def scanned_box(subdivisions: int) -> trimesh.Trimesh:
    """A box in small triangles, as scans are: 12, times 4 for each subdivision."""
    box = files.box(SIZE)
    for _ in range(subdivisions):
        box = box.subdivide()
    return box


def obj(
    mesh: trimesh.Trimesh, library: str, *, normals: bool = False, counts: bool = False
) -> bytes:
    """As Wavefront OBJ: vertices, texture coordinates, normals where wanted, faces.

    Args:
      mesh: Flat-sided; each corner gets its face's normal.
      library: The material library that it names.
      normals: Whether to write them.
      counts: Whether to open with comments that state the numbers of vertices and faces.
    """
    faces = np.asarray(mesh.faces) + 1
    lines = [f"mtllib {library}"]
    if counts:
        lines = [f"# Vertices: {len(mesh.vertices)}", f"# Faces: {len(faces)}", *lines]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in mesh.vertices]
    lines += [f"vt {i / len(mesh.vertices):.4f} 0.5" for i in range(len(mesh.vertices))]
    across = [""] * len(faces)
    if normals:
        rows, index = np.unique(np.round(mesh.face_normals, 6) + 0.0, axis=0, return_inverse=True)
        lines += [f"vn {x:g} {y:g} {z:g}" for x, y, z in rows]
        across = [f"/{i + 1}" for i in index.reshape(-1)]
    lines.append("usemtl material_0")
    for face, normal in zip(faces, across, strict=True):
        lines.append("f " + " ".join(f"{i}/{i}{normal}" for i in face))
    return ("\n".join(lines) + "\n").encode()


SOURCES = ("ycb", "google_scanned_objects", "omniobject3d", "pace", "partnet_mobility")

URDF = """<?xml version="1.0"?>
<robot name="thing">
<link name="base"/>
<link name="link_0"><visual name="body-0"><origin xyz="0 0 0"/>
  <geometry><mesh filename="textured_objs/original-0.obj"/></geometry></visual></link>
<link name="link_1"><visual name="cabinet_door_surface-1"><origin xyz="-0.5 0 -0.5"/>
  <geometry><mesh filename="textured_objs/original-1.obj"/></geometry></visual></link>
<joint name="joint_0" type="fixed"><origin rpy="1.5707963 0 -1.5707963" xyz="0 0 0"/>
  <child link="link_0"/><parent link="base"/></joint>
<joint name="joint_1" type="revolute"><origin xyz="0.5 0 0.5"/><axis xyz="0 1 0"/>
  <child link="link_1"/><parent link="link_0"/><limit lower="0" upper="1.5707963"/></joint>
</robot>
"""
MOBILITY = [
    {
        "id": 0, "parent": -1, "joint": "heavy", "name": "cabinet_frame",
        "parts": [{"id": 0, "name": "body", "children": []}], "jointData": {},
    },
    {
        "id": 1, "parent": 0, "joint": "hinge", "name": "cabinet_door",
        "parts": [{"id": 1, "name": "cabinet_door_surface", "children": []}],
        "jointData": {"axis": {"origin": [0.5, 0, 0.5], "direction": [0, 1, 0]},
                      "limit": {"a": 0, "b": 90, "noLimit": False}},
    },
]  # fmt: skip


def _cabinet(home: str) -> Files:
    body, door = files.box((1.0, 0.9, 1.0)), files.box((1.0, 0.9, 0.05))
    body.apply_translation([0, 0, -0.5])
    door.apply_translation([0, 0, 0.5])
    return {
        f"{home}mobility.urdf": URDF.encode(),
        f"{home}textured_objs/original-0.obj": obj(body, "material.mtl", normals=True),
        f"{home}textured_objs/original-1.obj": obj(door, "material.mtl", normals=True),
        f"{home}textured_objs/material.mtl": b"newmtl material_0\nKd 1 1 1\nmap_Kd ../images/wood.png\n",
        f"{home}images/wood.png": files.image(),
        f"{home}semantics.txt": b"link_0 heavy furniture_body\nlink_1 hinge rotation_door\n",
        f"{home}meta.json": b'{"model_cat": "StorageFurniture"}',
        f"{home}mobility_v2.json": json.dumps(MOBILITY).encode(),
        f"{home}bounding_box.json": b'{"min": [-0.5, -0.45, -0.5], "max": [0.5, 0.45, 0.55]}',
    }
