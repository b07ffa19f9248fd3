"""What is seen of a link: one mesh for each colour or texture, with no more faces than rendering needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import numpy as np
import trimesh
from trimesh.visual import TextureVisuals

from asset_pipeline.geometry.vertex_clustering import coarser
from asset_pipeline.sources.articulated_scan import PartMesh, Surface
from asset_pipeline.sources.scan import write_texture
from manipose_mj.assets.geometry import Shape

MAX_FACES = 8000  # of one mesh; only untextured meshes are made coarser ...
MAX_CELL = 0.004  # ... and no point of them moves much farther than this [m]


@dataclass(frozen=True)
class Textures:
    """Textures of an object as PNG in one folder, those of one name from different places side by side.

    Attributes:
      folder: Must outlast the shapes.
      written: Files there by the images that they are of.
    """

    folder: Path
    written: dict[Path, Path] = field(default_factory=dict)

    def png(self, image: Path) -> Path:
        """The file of an image, written once.

        Raises:
          InputError: The image is missing or none.
        """
        if image not in self.written:
            target, numbers = self.folder / f"{image.stem}.png", count(2)
            while target.exists():
                target = self.folder / f"{image.stem}-{next(numbers)}.png"
            self.written[image] = write_texture(image, target)
        return self.written[image]


def link_visuals(parts: Sequence[PartMesh], textures: Textures) -> tuple[Shape, ...]:
    """Visual shapes: the surfaces of all parts, joined where colour or texture is the same.

    Args:
      parts: Of one link.
      textures: Of the whole object.
    """
    groups: dict[tuple[Path | None, tuple[float, ...]], list[Surface]] = {}
    for surface in (s for part in parts for s in part.surfaces):
        rgba = (1.0, 1.0, 1.0, 1.0) if surface.texture else surface.rgba
        groups.setdefault((surface.texture, rgba), []).append(surface)
    shapes = []
    for (texture, _), surfaces in groups.items():
        mesh = _joined(surfaces)
        if not len(mesh.faces):
            continue
        image = None
        if texture is not None:
            image = textures.png(texture)
        elif len(mesh.faces) > MAX_FACES:
            mesh = coarser(mesh, MAX_FACES, MAX_CELL)
        shapes.append(Shape("mesh", mesh=mesh, rgba=surfaces[0].rgba, texture=image))
    return tuple(shapes)


def _joined(surfaces: Sequence[Surface]) -> trimesh.Trimesh:
    vertices = np.concatenate([np.asarray(s.mesh.vertices) for s in surfaces])
    starts = np.cumsum([0, *(len(s.mesh.vertices) for s in surfaces)])
    faces = [np.asarray(s.mesh.faces) + n for s, n in zip(surfaces, starts, strict=False)]
    mesh = trimesh.Trimesh(vertices, np.concatenate(faces), process=False)
    if surfaces[0].texture is not None:
        uv = [s.mesh.visual.uv for s in surfaces if isinstance(s.mesh.visual, TextureVisuals)]
        mesh.visual = TextureVisuals(uv=np.concatenate(uv))
    mesh.update_faces(np.asarray(mesh.area_faces) > 1e-12)
    mesh.remove_unreferenced_vertices()
    return mesh
