"""What the label viewer draws: an object's visuals, the marks of its label, and handles to drag it by."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from manipose_mj.assets.asset import Asset, GraspSet
from manipose_mj.assets.geometry import Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.label_marks import Box, area_boxes, label_lines, symmetry_planes
from manipose_mj.assets.visible_shapes import visible_shapes
from manipose_mj.poses import pose_to_vector, vector_to_pose

SHOWN_GRASPS = 40
GREY, DARK = (0.7, 0.7, 0.7), (60, 60, 60)


class LabelScene:
    """Draws into the scene of a viser server; a second call replaces what the first drew."""

    def __init__(self, scene: Any, dragged: Callable[[Float[np.ndarray, "4 4"]], None]) -> None:
        """An empty scene.

        Args:
          scene: Of the server.
          dragged: Called with `T_mesh_label` when a person drags the label.
        """
        self._scene = scene
        scene.set_up_direction("+z")
        self._visuals: list[Any] = []
        self._marks: list[Any] = []
        self._gizmo = scene.add_transform_controls("/gizmo", depth_test=False, opacity=0.6)
        self._gizmo.on_update(lambda _: dragged(self._gizmo_pose()))

    def draw_visuals(self, folder: Path, opacity: float) -> None:
        """The visual meshes of an asset; textures only where nothing is to be seen through them."""
        for handle in self._visuals:
            handle.remove()
        shapes = [s for own in visible_shapes(folder).values() for s in own]
        self._visuals = [
            self._add_visual(f"/object/{index}", shape, opacity)
            for index, shape in enumerate(shapes)
        ]

    def draw_marks(self, asset: Asset, saved: PoseLabel, shown: Iterable[str]) -> None:
        """The label's marks.

        Args:
          asset: With the label as it is moved.
          saved: The label that the asset's areas are in.
          shown: Of `"planes"`, `"areas"` and `"grasps"`.
        """
        for handle in self._marks:
            handle.remove()
        self._marks = []
        lines = label_lines(asset)
        colours = np.array([(line.colour, line.colour) for line in lines])
        self._segments(
            "axes",
            [(line.start, line.end) for line in lines],
            np.round(255 * colours).astype(np.uint8),
            4.0,
        )
        size = float(asset.label.extents.max())
        if "planes" in shown:
            self._boxes("planes", symmetry_planes(asset.label), 0.002 * size)
        if "areas" in shown:
            self._boxes("areas", area_boxes(asset.areas, saved), 0.0)
        if "grasps" in shown and asset.grasps is not None:
            self._segments("grasps", _grasp_lines(asset.grasps), DARK, 1.5)

    def place_gizmo(self, label: PoseLabel, visible: bool) -> None:
        """Handles at the label's frame, to drag it by."""
        vector = pose_to_vector(label.pose)
        self._gizmo.position, self._gizmo.wxyz = vector[:3], vector[3:]
        self._gizmo.scale = 0.4 * float(label.extents.max())
        self._gizmo.visible = visible

    def _gizmo_pose(self) -> Float[np.ndarray, "4 4"]:
        return vector_to_pose(np.concatenate([self._gizmo.position, self._gizmo.wxyz]))

    def _add_visual(self, name: str, shape: Shape, opacity: float) -> Any:
        if shape.texture is not None and opacity == 1:
            return self._scene.add_mesh_trimesh(name, _textured(shape, shape.texture))
        mesh, alpha = shape.surface(), opacity * shape.rgba[3]
        return self._scene.add_mesh_simple(
            name,
            np.asarray(mesh.vertices, np.float32),
            np.asarray(mesh.faces, np.uint32),
            color=GREY if shape.texture is not None else shape.rgba[:3],
            opacity=None if alpha == 1 else alpha,
            flat_shading=True,
            side="double",
        )

    def _segments(
        self, name: str, ends: list[tuple[np.ndarray, np.ndarray]], colours: Any, thickness: float
    ) -> None:
        if ends:
            self._marks.append(
                self._scene.add_line_segments(
                    f"/label/{name}",
                    np.array(ends, np.float32),
                    colours,
                    thickness=thickness,
                    thickness_units="screen",
                )
            )

    def _boxes(self, name: str, boxes: tuple[Box, ...], thickness: float) -> None:
        for index, box in enumerate(boxes):
            vector = pose_to_vector(box.pose)
            lengths = np.maximum(box.extents, max(thickness, 1e-5))
            self._marks.append(
                self._scene.add_box(
                    f"/label/{name}/{index}",
                    color=box.colour,
                    dimensions=tuple(map(float, lengths)),
                    opacity=0.3,
                    cast_shadow=False,
                    receive_shadow=False,
                    position=vector[:3],
                    wxyz=vector[3:],
                )
            )


def _grasp_lines(grasps: GraspSet) -> list[tuple[np.ndarray, np.ndarray]]:
    """Two short lines a grasp: between the pads, and the way that the hand comes."""
    lines = []
    for pose, width in zip(grasps.poses[:SHOWN_GRASPS], grasps.widths, strict=False):
        origin, half, approach = pose[:3, 3], width / 2 * pose[:3, 1], 0.05 * pose[:3, 2]
        lines += [(origin - half, origin + half), (origin - approach, origin)]
    return lines


def _textured(shape: Shape, texture: Path) -> trimesh.Trimesh:
    mesh: Any = shape.surface()
    with Image.open(texture) as image:
        material = PBRMaterial(
            baseColorTexture=image.convert("RGB"), metallicFactor=0.0, roughnessFactor=0.9
        )
    visual = TextureVisuals(uv=mesh.visual.uv, material=material)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, visual=visual, process=False)
