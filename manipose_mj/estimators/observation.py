"""What an estimator gets: one object as one camera sees it, as a dictionary that can be sent anywhere.

| key | value |
|---|---|
| `category` | such as `"mug"`: all that is told about the object |
| `cloud` | `(n, 3)` float32, points on the object, camera frame [m] |
| `normals` | `(n, 3)` float32, unit, towards the camera |
| `colours` | `(n, 3)` uint8, of the points |
| `depth` | `(height, width)` float32, along the optical axis [m]; 0 where nothing was measured |
| `rgb` | `(height, width, 3)` uint8 |
| `mask` | `(height, width)` bool, the object's pixels as a segmentation reports them |
| `intrinsics` | `(3, 3)`, K; a pixel's centre has whole coordinates |
| `camera_pose` | `(4, 4)`, `T_world_camera`; the identity where there is no world |
| `seed` | of what the estimator may draw |
| `mesh` | only if asked for: `{"vertices": (v, 3) float32, "faces": (f, 3) int32}`, frame of the label [m] |

The camera frame is OpenCV's: x right, y down, z forward.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Bool, Float, UInt8

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.visible_shapes import surface, visible_shapes
from manipose_mj.poses import invert, transform

Observation = dict[str, Any]


def object_observation(
    *,
    category: str,
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    depth: Float[np.ndarray, "height width"],
    rgb: UInt8[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"],
    intrinsics: Float[np.ndarray, "3 3"],
    camera_pose: Float[np.ndarray, "4 4"],
    seed: int,
    mesh: Mapping[str, np.ndarray] | None,
) -> Observation:
    """The observation of one object; the keys are the module's, colours are those of the points' pixels.

    All arrays are the estimator's own, which may change them.
    """
    cloud = np.array(points, np.float32)
    image = cloud.astype(float) @ intrinsics.T
    column, row = np.round(image[:, :2] / image[:, 2:]).astype(int).T
    height, width = depth.shape
    colours = rgb[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    found = {
        "category": category,
        "cloud": cloud,
        "normals": np.array(normals, np.float32),
        "colours": colours,
        "depth": np.array(depth, np.float32),
        "rgb": np.array(rgb),
        "mask": np.array(mask),
        "intrinsics": np.array(intrinsics, float),
        "camera_pose": np.array(camera_pose, float),
        "seed": seed,
    }
    if mesh is None:
        return found
    return {**found, "mesh": {name: np.array(values) for name, values in mesh.items()}}


def sent_mesh(mesh: trimesh.Trimesh) -> dict[str, np.ndarray]:
    """A mesh in the frame of the label as observations hold it."""
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    return {"vertices": vertices.astype(np.float32), "faces": faces.astype(np.int32)}


def asset_mesh(asset: Asset) -> dict[str, np.ndarray]:
    """The visible surface of an asset in the frame of its label, as observations hold it.

    Raises:
      InputError: Its model or a mesh cannot be read.
    """
    mesh = surface(visible_shapes(asset.folder))
    placed = transform(invert(asset.label.pose), np.asarray(mesh.vertices, float))
    return sent_mesh(trimesh.Trimesh(placed, mesh.faces, process=False))
