"""The frames that data sets give their objects, for the table's "original labels".

Each catalogue object is assigned to one of the three sources whose categories the catalogue has, a third
to each (our choice), and labelled in a frame as that source has them. What is known of the sources:

- YCB, google_16k: z up, standing or lying on z = 0 as scanned (median -0.7 mm), not centred: measured on 24 of
  the published meshes, the box's centre is at (-1.2 +- 1.9, -0.7 +- 2.9) cm. Of the twelve whose heading shows,
  seven lie along the scanner's x or y within 4 deg, the others anyhow.
- PACE: BOP's format, whose description has z up for an object that stands upright and the origin at the
  centre of the bounding box; bottles are longest along z and the published symmetry axes of bowls are z.
- OmniObject3D: y up (its authors' renderer imports the files so), its scans of a category mostly aligned.

Assumed, for want of a statement: tools lie flat in YCB (its fork, knife, scissors and screwdriver do), and
stand along the up axis in the other two; OmniObject3D's origin is the box's centre; headings are the same
for all objects of PACE and of OmniObject3D, with the label's Y along the first horizontal axis.

All frames get their axes renamed alike, `(z, x, y)` becomes `(X, Y, Z)`, so that two sources of three have
up where the unified label has it: the original labels' best case.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup, compose, rotation_about, transform
from manipose_mj.ppf_jax.points.clouds import LabelledCloud

SourceName = Literal["YCB", "PACE", "OmniObject3D"]
SOURCES: tuple[SourceName, ...] = ("YCB", "PACE", "OmniObject3D")
_YCB_OFFSET, _YCB_SPREAD = np.array([-0.012, -0.007]), np.array([0.019, 0.029])  # [m]
_YCB_ALONG = 7 / 12  # share of the objects that lie along an axis of the scanner
_TURNS = 24  # stand for an axis of revolution that is not the frame's X


@dataclass(frozen=True)
class SourceLabel:
    """An object's frame as its source has it, seen from its unified label.

    Attributes:
      source: Whose frame.
      T_label_source: `(4, 4)`, axes renamed.
      extents: `(3,)` [m], of the label's box along the source's axes.
      symmetry: The object's group, in the source's frame.
    """

    source: SourceName
    T_label_source: Float[np.ndarray, "4 4"]
    extents: Float[np.ndarray, "3"]
    symmetry: SymmetryGroup


def assigned_source(name: str) -> SourceName:
    """The source that an object of this name counts as; for ever the same."""
    return SOURCES[zlib.crc32(f"source of {name}".encode()) % len(SOURCES)]


def source_label(
    name: str, label: PoseLabel, bounds: Float[np.ndarray, "2 3"], source: SourceName | None = None
) -> SourceLabel:
    """The frame that an object gets from its source.

    Args:
      name: Of the object; also seeds what a source leaves to chance.
      label: Its unified label.
      bounds: Of its surface in the label frame [m].
      source: Another than `assigned_source(name)`.
    """
    source = assigned_source(name) if source is None else source
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    centre, size = bounds.mean(axis=0), np.ptp(bounds, axis=0)
    up, ahead = np.eye(3)[0], np.eye(3)[1]
    if source == "YCB" and label.object_type == "functional":
        # Flat on the table: the thinner of the two cross directions is vertical.
        up, ahead = (
            (np.eye(3)[1], np.eye(3)[0]) if size[1] < size[2] else (np.eye(3)[2], np.eye(3)[0])
        )
    if source == "YCB":
        heading = rng.uniform(-np.pi, np.pi)
        if rng.random() < _YCB_ALONG:
            heading = np.round(heading / (np.pi / 2)) * (np.pi / 2)
        ahead = rotation_about(up, heading) @ ahead
    aside = np.cross(up, ahead)
    if source == "OmniObject3D":
        # The file's y is up and its z, which is renamed X, is horizontal.
        axes = np.stack([aside * -1.0, ahead, up], axis=1)
    else:
        axes = np.stack([up, ahead, aside], axis=1)
    if source == "YCB":
        offset = _YCB_OFFSET + _YCB_SPREAD * rng.standard_normal(2)
        # The centre is at this offset above the base, so the origin is opposite.
        height = 0.5 * float(np.abs(up) @ size)
        origin = centre - axes @ np.array([height, *offset])
    else:
        origin = centre
    return SourceLabel(
        source,
        compose(axes, origin),
        np.abs(axes).T @ size,
        _turned(label.symmetry, axes),
    )


def with_source_frames(
    clouds: Sequence[LabelledCloud], labels: Mapping[str, SourceLabel]
) -> list[LabelledCloud]:
    """The same clouds, labelled as the sources do.

    Args:
      clouds: With unified labels; the object's name is a cloud's up to the slash.
      labels: By the object's name.
    """
    relabelled = []
    for cloud in clouds:
        label = labels[cloud.name.split("/")[0]]
        relabelled.append(
            replace(
                cloud,
                pose=(cloud.pose @ label.T_label_source).astype(np.float32),
                extents=label.extents.astype(np.float32),
                symmetry=label.symmetry,
            )
        )
    return relabelled


def label_bounds(
    label: PoseLabel, vertices_mesh: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "2 3"]:
    """The surface's bounds in the label frame."""
    placed = transform(np.linalg.inv(label.pose), vertices_mesh)
    return np.stack([placed.min(axis=0), placed.max(axis=0)])


def _turned(group: SymmetryGroup, axes: Float[np.ndarray, "3 3"]) -> SymmetryGroup:
    """The group seen from a turned frame; an axis other than X becomes a list of turns."""
    if group.axial and abs(axes[0, 0]) < 1 - 1e-9:
        return SymmetryGroup(axes.T @ group.sampled(_TURNS) @ axes)
    return SymmetryGroup(axes.T @ group.rotations @ axes, axial=group.axial)
