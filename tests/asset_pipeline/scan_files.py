"""Small objects in the files of the publishers' layouts, for the readers' tests."""

from __future__ import annotations

import io
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

COLOUR = (200, 40, 10)


def image(size: int = 8) -> bytes:
    """A PNG of one colour."""
    file = io.BytesIO()
    Image.new("RGB", (size, size), COLOUR).save(file, format="PNG")
    return file.getvalue()


def jpeg() -> bytes:
    """A JPEG of one colour."""
    file = io.BytesIO()
    Image.new("RGB", (8, 8), COLOUR).save(file, format="JPEG")
    return file.getvalue()


def box(extents: tuple[float, float, float]) -> trimesh.Trimesh:
    """A box that stands on z = 0."""
    mesh = trimesh.creation.box(extents)
    mesh.apply_translation([0, 0, extents[2] / 2])
    return mesh


def obj(mesh: trimesh.Trimesh) -> bytes:
    """As Wavefront OBJ with texture coordinates."""
    lines = ["mtllib material.mtl", "usemtl material_0"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in mesh.vertices]
    lines += [f"vt {i / len(mesh.vertices):.3f} 0.5" for i in range(len(mesh.vertices))]
    lines += ["f " + " ".join(f"{i}/{i}" for i in face) for face in np.asarray(mesh.faces) + 1]
    return ("\n".join(lines) + "\n").encode()


def meshlab_ply(mesh: trimesh.Trimesh, texture: str | None) -> bytes:
    """As PACE's PLY files: texture coordinates of vertices and of faces, colours of faces."""
    comment = "" if texture is None else f"comment TextureFile {texture}\n"
    uv = np.linspace(0.1, 0.9, len(mesh.vertices))
    rows = [f"{x:f} {y:f} {z:f} {u:f} 0.5" for (x, y, z), u in zip(mesh.vertices, uv, strict=True)]
    for face in np.asarray(mesh.faces):
        corners = " ".join(f"{uv[i]:f} 0.5" for i in face)
        rows.append(f"3 {face[0]} {face[1]} {face[2]} 6 {corners} 255 255 255 255")
    head = (
        f"ply\nformat ascii 1.0\ncomment VCGLIB generated\n{comment}"
        f"element vertex {len(mesh.vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        "property float texture_u\nproperty float texture_v\n"
        f"element face {len(mesh.faces)}\n"
        "property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n"
        "end_header\n"
    )
    return (head + "\n".join(rows) + "\n").encode()


def write_folder(root: Path, files: dict[str, bytes]) -> Path:
    """The files below `root`."""
    for name, content in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return root


def write_archive(path: Path, files: dict[str, bytes]) -> Path:
    """The files in a zip, or in a tar compressed as the name says."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".zip":
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in files.items():
                archive.writestr(name, content)
        return path
    kind = {".xz": "xz", ".bz2": "bz2", ".tar": ""}.get(path.suffix, "gz")
    with tarfile.open(path, f"w:{kind}") as archive:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return path
