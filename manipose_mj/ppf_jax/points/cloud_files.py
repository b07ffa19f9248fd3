"""Files of clouds: some views of one object each, in the cache or in a folder with an index."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.assets.label import ObjectType
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.storage.cache_file import new_cache_file

INDEX = "scans.json"  # of a folder: the category and the object type of each file


@dataclass(frozen=True)
class ScanViews:
    """The views of one scan.

    Attributes: name; category; object_type, the label's rule; clouds, whose poses are of the same label frame.
    """

    name: str
    category: str
    object_type: ObjectType
    clouds: tuple[LabelledCloud, ...]

    @property
    def symmetry(self) -> SymmetryGroup:
        """Of the shape."""
        return self.clouds[0].symmetry

    @property
    def in_catalogue(self) -> bool:
        """Whether training had the kind."""
        row = CATALOGUE.get(self.category)
        return row is not None and row.object_type == self.object_type


def read_views(folder: Path) -> list[ScanViews]:
    """All scans that `benchmarks/flips/scan_views.py` rendered into a folder.

    Raises:
      InputError: There are none, the index is none, or a file of it is missing or damaged.
    """
    try:
        index = json.loads((folder / INDEX).read_text())
    except (OSError, ValueError):
        raise InputError(f"{folder}: no views of scans; render some with scan_views.py") from None
    if not isinstance(index, dict) or not all(map(_is_kind, index.values())):
        raise InputError(
            f"{folder / INDEX}: expected a dictionary of scans, [category, object type] each; "
            "render them again with scan_views.py"
        )
    return [_read_scan(folder, name, *kind) for name, kind in sorted(index.items())]


def _is_kind(value: Any) -> bool:
    return (
        isinstance(value, list) and len(value) == 2 and all(isinstance(each, str) for each in value)
    )


def _read_scan(folder: Path, name: str, category: str, kind: Any) -> ScanViews:
    path = folder / f"{name}.npz"
    try:
        clouds = tuple(read_clouds(path, name, category))
    except FileNotFoundError:
        raise InputError(f"{path}: missing, though {INDEX} names it; render it again") from None
    except Exception as error:  # whatever a damaged file makes the readers raise
        raise InputError(f"{path}: not a whole file of views ({error}); render it again") from None
    if not clouds:
        raise InputError(f"{path}: a scan without views; render it again")
    return ScanViews(name, category, kind, clouds)


def write_clouds(path: Path, clouds: Sequence[LabelledCloud]) -> None:
    """Write views of one object.

    Raises:
      InputError: The file cannot be written.
    """
    group = clouds[0].symmetry
    eyes = [cloud.eyes for cloud in clouds if cloud.eyes is not None]
    arrays: dict[str, Any] = {
        "points": np.concatenate([cloud.points for cloud in clouds]),
        "normals": np.concatenate([cloud.normals for cloud in clouds]),
        "starts": np.cumsum([0, *(len(cloud) for cloud in clouds)]),
        "pose": np.stack([cloud.pose for cloud in clouds]),
        "extents": clouds[0].extents,
        "rotations": group.rotations,
        "axial": group.axial,
    }
    if eyes:
        arrays["eyes"] = np.concatenate(eyes)
    with new_cache_file(path) as scratch:
        np.savez(scratch, **arrays)


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
                eyes=arrays["eyes"][rows] if "eyes" in arrays else None,
            )
        )
    return clouds
