"""Where poses, instance masks and grasps of objects come from, by name; loads nothing."""

from __future__ import annotations

from typing import Literal, get_args

# Everything true; everything estimated; objects estimated and all else true.
POSE_SOURCES = ("oracle", "estimated", "estimated_objects")
MaskSource = Literal["oracle", "none"]
MASK_SOURCES: tuple[MaskSource, ...] = get_args(MaskSource)
GraspSource = Literal["annotated", "shape", "cloud"]
GRASP_SOURCES: tuple[GraspSource, ...] = get_args(GraspSource)
# What is told about objects whose poses are estimated, for reports.
TOLD_OF_KINDS = "category; object type as well where the catalogue lacks the category"


def default_grasps(pose: str) -> GraspSource:
    """What suits a source of poses: what is estimated has no annotations."""
    return "annotated" if pose == "oracle" else "cloud"


def masks_of(pose: str) -> MaskSource:
    """Where the baseline's instance masks come from: its estimators read the simulator's, true poses need none."""
    return "none" if pose == "oracle" else "oracle"
