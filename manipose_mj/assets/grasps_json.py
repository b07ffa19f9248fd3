"""Writing and reading `grasps.json`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from manipose_mj.assets.asset import GraspSet
from manipose_mj.assets.json_fields import read_json, write_columns
from manipose_mj.errors import InputError
from manipose_mj.poses import pose_to_vector, vector_to_pose


def write_grasps(path: Path, grasps: GraspSet) -> None:
    """Write `grasps.json`: lengths to 10 micrometres, one grasp a line.

    Half a catalogue's size were digits that nobody needs.
    """
    vectors = pose_to_vector(grasps.poses) if len(grasps) else np.empty((0, 7))
    columns = {
        "poses": [[*np.round(v[:3], 5).tolist(), *np.round(v[3:], 6).tolist()] for v in vectors],
        "widths": np.round(grasps.widths, 5).tolist(),
        "clear": grasps.clear.astype(int).tolist(),
    }
    counts = {"held": grasps.held, "tried": grasps.tried}
    write_columns(path, counts, columns)


def read_grasps(path: Path, stable_poses: int) -> GraspSet | None:
    """The grasps of an asset with so many stable poses; None where there is no such file.

    Raises:
      InputError: A field is missing or wrong.
    """
    if not path.is_file():
        return None
    document = read_json(path)
    count = len(document.entries("widths"))
    widths = document.array("widths", count)
    vectors = document.array("poses", count, 7) if count else np.empty((0, 7))
    clear = document.array("clear", count, stable_poses) if count else None
    norms = np.linalg.norm(vectors[:, 3:], axis=1)
    if (np.abs(norms - 1) > 1e-3).any():
        raise document.wrong("poses", "positions and unit wxyz quaternions")
    held, tried = document.values.get("held", 0), document.values.get("tried")
    if tried is None:
        held = 0
    elif not (type(held) is type(tried) is int and 0 <= held <= min(tried, count)):
        raise InputError(
            f"{path}: fields 'held' and 'tried' are {held!r} and {tried!r}; expected whole numbers, "
            f"held not above tried or the {count} grasps"
        )
    vectors[:, 3:] /= norms[:, None]
    return GraspSet(
        poses=vector_to_pose(vectors) if count else np.empty((0, 4, 4)),
        widths=widths,
        clear=np.empty((0, stable_poses), bool) if clear is None else clear.astype(bool),
        held=held,
        tried=tried,
    )
