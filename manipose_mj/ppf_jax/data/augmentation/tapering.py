"""Objects that the catalogue does not have: meshes that are wider at one end of X than at the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from manipose_mj.assets.label import PoseLabel

_BASE = 0.05  # share of the length along X that counts as the end it stands on


def taperable(label: PoseLabel) -> bool:
    """Whether an object stays of its kind: its X points up, and no symmetry turns it over."""
    upright = label.object_type in ("axial", "mirror")
    return upright and bool(np.all(label.symmetry.rotations[:, 0, 0] > 0))


def tapered(
    mesh: trimesh.Trimesh, label: PoseLabel, share: float
) -> tuple[trimesh.Trimesh, PoseLabel]:
    """An object `1 + share` times as wide at its upper end, `1 - share` times at its lower, with its label.

    Widths are about the line along X through the middle of what it stands on: a mug's wall stays upright,
    and its handle goes along.

    Args:
      mesh: In any frame [m].
      label: In the same frame.
      share: Between -1 and 1.
    """
    own = (np.asarray(mesh.vertices) - label.origin) @ label.rotation
    low, high = own[:, 0].min(), own[:, 0].max()
    base = own[own[:, 0] <= low + _BASE * (high - low), 1:]
    middle = (base.min(axis=0) + base.max(axis=0)) / 2
    factor = 1 + share * (2 * (own[:, :1] - low) / (high - low) - 1)
    own[:, 1:] = middle + factor * (own[:, 1:] - middle)
    bounds = np.stack([own.min(axis=0), own.max(axis=0)])
    vertices = label.origin + own @ label.rotation.T
    origin = label.origin + label.rotation @ bounds.mean(axis=0)
    changed = trimesh.Trimesh(vertices, mesh.faces, process=False)
    return changed, replace(label, origin=origin, extents=np.ptp(bounds, axis=0))
