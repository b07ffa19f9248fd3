"""A scanned object as a source delivers it, and the checks that its mesh has to pass."""

from __future__ import annotations

import hashlib
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from jaxtyping import Float
from PIL import Image

from asset_pipeline.geometry.repair import drop_flaps, open_edges, spikes, turn_outwards
from asset_pipeline.sources.files.images import as_rgb, why_unreadable
from asset_pipeline.sources.files.wavefront_lines import for_readers
from manipose_mj.assets.asset import Provenance
from manipose_mj.assets.label import ObjectType
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

# A tabletop object: what is larger or smaller is almost surely given in another unit [m].
MAX_EXTENT = 3.0
MIN_EXTENT = 0.003
USUAL_EXTENT = (0.01, 1.0)  # a warning is due beyond
# The least extent over the greatest, below which nothing is solid; a sheet of paper has 3e-4.
FLATNESS = 1e-4
# From the origin of the frame to the object, along one axis: a free body that hangs on a long lever is unstable.
MAX_OFFSET = 0.5
MAX_EMPTY = 0.01  # of the faces without area; scans as published have 1e-4
MAX_TEXTURE_PIXELS = 1024


@dataclass(frozen=True)
class ScanItem:
    """One object that a source offers.

    Attributes:
      name: The object's.
      path: The archive or folder that holds it, alone or with others.
      member: Its mesh file, relative to `path`, where that does not follow from the name.
    """

    name: str
    path: Path
    member: str = ""

    @property
    def files(self) -> tuple[Path, ...]:
        """What is read of it, as far as it is known before it is opened: its mesh, or the archive that holds it."""
        return (self.path / self.member if self.member and self.path.is_dir() else self.path,)

    @property
    def where(self) -> str:
        """What messages name: the object's own folder, or the archive that holds it."""
        return str(
            (self.path / self.member).parent if self.member and self.path.is_dir() else self.path
        )


@dataclass(frozen=True)
class Scan:
    """One scanned rigid object, in metres, in the frame its publisher chose, z up.

    Attributes:
      name: Of the asset to build.
      category: What kind of object it is, such as `"bottle"`.
      object_type: Which labelling rule applies.
      mesh: Surface in the mesh frame [m], with `uv` where it has a texture.
      texture: The image that the `uv` refer to, or None.
      up: `(3,)` unit vector in the mesh frame, up when the object stands upright.
      mass: [kg], or None where it is not published.
      provenance: Source, item, licence and hashes of the input files.
      fill: `"solid"`: the mass fills what the mesh encloses; `"shell"`: it lies in the surface
        (blow-moulded and hollow things whose inside the scanner could not see).
      functional: `(3,)`, roughly from grip to functional end, in the mesh frame; tools only.
      rgba: Colour of what has no texture.
    """

    name: str
    category: str
    object_type: ObjectType
    mesh: trimesh.Trimesh
    texture: Path | None
    up: Float[np.ndarray, "3"]
    mass: float | None
    provenance: Provenance
    fill: Literal["solid", "shell"] = "solid"
    functional: Float[np.ndarray, "3"] | None = None
    rgba: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0)


def load_scan_mesh(path: Path, *, unit: float = 1.0) -> trimesh.Trimesh:
    """Read a mesh file, vertices only scaled (no merging, so that seams keep their `uv`).

    Args:
      path: The file.
      unit: Length of its unit [m].

    Returns:
      The mesh in metres, in the frame of the file.

    Raises:
      InputError: The file is missing or unreadable, or its mesh cannot be an object on a table.
    """
    try:
        with for_readers(path) as file:
            mesh = trimesh.load(
                file,
                file_type=path.suffix[1:].lower(),
                force="mesh",
                process=False,
                skip_materials=True,
            )
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; expected a mesh") from None
    except Exception as error:  # each of trimesh's readers fails in its own way
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"{path}: cannot be read as a mesh ({reason})") from None
    assert isinstance(mesh, trimesh.Trimesh)
    mesh.vertices = np.asarray(mesh.vertices) * unit
    check_scan_mesh(mesh, str(path), unit=unit)
    return mesh


def check_scan_mesh(mesh: trimesh.Trimesh, where: str, *, unit: float = 1.0) -> None:
    """Refuse a mesh that cannot be an object on a table; mend it, and say what looks damaged.

    Faces that point inwards are turned, and a mesh far from the origin is moved there, axis by axis.

    Args:
      mesh: In metres; changed in place.
      where: Opens the messages.
      unit: Length of the unit it was given in [m].

    Raises:
      InputError: As `check_mesh`.
    """
    check_mesh(mesh, where, unit=unit)
    offset = _offset(mesh)
    if offset.any():
        mesh.vertices -= offset
        moved = " ".join(f"{0.0 - each:.3g}" for each in offset)
        log.warning("%s: the origin is far from the object; moved it by %s m", where, moved)
    if flaps := drop_flaps(mesh):
        log.warning("%s: %d faces hung on the surface by one edge only; left out", where, flaps)
    if turned := turn_outwards(mesh):
        log.warning("%s: %d of %d faces pointed inwards; turned", where, turned, len(mesh.faces))
    for defect in _defects(mesh):
        log.warning("%s: %s; is the file damaged?", where, defect)
    if holes := open_edges(mesh):
        log.warning(
            "%s: the surface has holes (%d open edges); contacts and mass need them closed",
            where,
            holes,
        )


def _offset(mesh: trimesh.Trimesh) -> Float[np.ndarray, "3"]:
    """Where the middle of the mesh is, along axes along which the origin is far from it; 0 along others [m]."""
    bounds = np.asarray(mesh.bounds)
    apart = np.maximum(bounds[0], -bounds[1])
    return np.where(apart > MAX_OFFSET, bounds.mean(axis=0), 0.0)


def _defects(mesh: trimesh.Trimesh) -> list[str]:
    """What no scan has as published, and numbers that were damaged bring about."""
    found = []
    count = len(mesh.faces)
    empty = int(
        (np.asarray(mesh.area_faces) <= 1e-12 * float(np.ptp(mesh.bounds, axis=0).max()) ** 2).sum()
    )
    if empty > MAX_EMPTY * count:
        found.append(f"{empty} of {count} faces have no area")
    if needles := spikes(mesh):
        found.append(
            "1 vertex sticks out of the surface like a needle"
            if needles == 1
            else f"{needles} vertices stick out of the surface like needles"
        )
    return found


def check_mesh(mesh: trimesh.Trimesh, where: str, *, unit: float = 1.0) -> None:
    """Refuse a mesh that cannot be a tabletop object in metres.

    Args:
      mesh: In metres.
      where: Opens the message.
      unit: Length of the unit it was given in [m], which the message questions if the size is wrong.

    Raises:
      InputError: No faces, faces that name missing vertices, NaN or infinite vertices, no size, or
        extents that betray another unit.
    """
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if len(faces) == 0:
        raise InputError(f"{where}: mesh has no faces; expected a triangle surface")
    if vertices.shape[1:] != (3,) or faces.shape[1:] != (3,):
        raise InputError(
            f"{where}: its rows are of {vertices.shape[-1]} coordinates and {faces.shape[-1]} corners; "
            "expected 3 and 3"
        )
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{where}: a face names vertex {faces.max()} of {len(vertices)}")
    bad = ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        raise InputError(
            f"{where}: {int(bad.sum())} of {len(vertices)} vertices are NaN or infinite "
            f"(first: vertex {int(bad.argmax())}); expected finite coordinates in metres"
        )
    extents = np.ptp(vertices[np.unique(faces)], axis=0)
    size = " x ".join(f"{e:.3g}" for e in extents)
    flat = f"{where}: mesh has zero size ({size}); expected an object in metres"
    if extents.max() <= 0:
        raise InputError(flat)
    name = {1.0: "metres", 0.001: "millimetres"}.get(unit, f"units of {unit:g} m")
    if extents.max() > MAX_EXTENT:
        hint = "is it in millimetres? " if unit == 1.0 else ""
        raise InputError(
            f"{where}: mesh measures {size} m; a tabletop object is below {MAX_EXTENT:g} m: "
            f"{hint}expected {name}"
        )
    if extents.max() < MIN_EXTENT:
        hint = ": is it in metres?" if unit < 1.0 else ";"
        raise InputError(
            f"{where}: mesh measures {size} m, which is too small to handle{hint} expected {name}"
        )
    if not float(mesh.area) > 0:
        raise InputError(flat)
    if extents.min() < FLATNESS * extents.max():
        raise InputError(
            f"{where}: mesh is flat ({size} m); expected the surface of a solid object"
        )
    if not USUAL_EXTENT[0] <= extents.max() <= USUAL_EXTENT[1]:
        log.warning("%s: mesh measures %s m, unusual for a tabletop object", where, size)


def write_texture(source: Path, target: Path) -> Path:
    """Copy an image as PNG, its longer side at most 1024 pixels.

    Raises:
      InputError: `source` is missing or no image.
    """
    try:
        with Image.open(source) as image:
            image.verify()  # checksums, which reading the pixels leaves out
        with Image.open(source) as image:
            image = as_rgb(image)
            image.thumbnail((MAX_TEXTURE_PIXELS, MAX_TEXTURE_PIXELS))
            image.save(target, format="PNG")
    except FileNotFoundError:
        raise InputError(f"{source}: no such file; expected the scan's texture") from None
    except Exception as error:
        raise InputError(
            f"{source}: cannot be read as an image ({why_unreadable(error)})"
        ) from None
    return target


def sha256(path: Path) -> str:
    """The hash of a file's content, in hex.

    Raises:
      InputError: The file cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
