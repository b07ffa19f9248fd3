"""Parallel-jaw grasps sampled on a body: antipodal pairs, room for the hand, the pads' contact, a choice.

    from manipose_mj.grasp_sampling import sample_grasps

    grasps = sample_grasps(body, stable_poses)

`touch_points` puts points on the surface, `antipodal` pairs them, `approaches` turns the hand about each pair,
`gripper_clearance` and `contact_patch` test hand and pads, `grasp_fit` scores, `grasp_choice` picks a few of
every side; `sampler` runs them in this order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from manipose_mj.grasp_sampling.grasp_choice import spread_out
    from manipose_mj.grasp_sampling.sampler import sample_grasps

__all__ = ["sample_grasps", "spread_out"]

__getattr__ = lazy_exports(__name__, __file__)
