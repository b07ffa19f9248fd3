"""Where the grasps of objects come from, by name; loads nothing."""

from __future__ import annotations

from typing import Literal, get_args

GraspSource = Literal["annotated", "shape", "cloud"]
GRASP_SOURCES: tuple[GraspSource, ...] = get_args(GraspSource)
# By the source of poses.
DEFAULT_GRASPS: dict[str, GraspSource] = {"oracle": "annotated", "estimated": "shape"}
