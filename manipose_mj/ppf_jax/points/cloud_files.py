"""Files of the cloud cache: some views of one object each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from manipose_mj.poses import SymmetryGroup
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.storage.cache_file import new_cache_file


def write_clouds(path: Path, clouds: Sequence[LabelledCloud]) -> None:
    """Write views of one object.

    Raises:
      InputError: The file cannot be written.
    """
    group = clouds[0].symmetry
    with new_cache_file(path) as scratch:
        np.savez(
            scratch,
            points=np.concatenate([cloud.points for cloud in clouds]),
            normals=np.concatenate([cloud.normals for cloud in clouds]),
            starts=np.cumsum([0, *(len(cloud) for cloud in clouds)]),
            pose=np.stack([cloud.pose for cloud in clouds]),
            extents=clouds[0].extents,
            rotations=group.rotations,
            axial=group.axial,
        )


def read_clouds(path: Path, name: str, category: str, *, first: int = 0) -> list[LabelledCloud]:
    """The views of a file, named by the object and numbered from `first`."""
    with np.load(path) as stored:
        arrays = dict(stored)
    group = SymmetryGroup(arrays["rotations"], bool(arrays["axial"]))
    clouds = []
    for i, pose in enumerate(arrays["pose"]):
        rows = slice(arrays["starts"][i], arrays["starts"][i + 1])
        clouds.append(
            LabelledCloud(
                points=arrays["points"][rows],
                normals=arrays["normals"][rows],
                pose=pose,
                extents=arrays["extents"],
                symmetry=group,
                name=f"{name}/{first + i}",
                category=category,
            )
        )
    return clouds
