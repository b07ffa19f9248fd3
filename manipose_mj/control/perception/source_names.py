"""Where the grasps of objects come from, by name; loads nothing."""

from __future__ import annotations

from typing import Literal, get_args

GraspSource = Literal["annotated", "shape", "cloud"]
GRASP_SOURCES: tuple[GraspSource, ...] = get_args(GraspSource)
# What is told about objects whose poses are estimated, for reports.
TOLD_OF_KINDS = "category; object type as well where the catalogue lacks the category"


def default_grasps(pose: str) -> GraspSource:
    """What suits a source of poses: what is estimated has no annotations."""
    return "annotated" if pose == "oracle" else "cloud"
