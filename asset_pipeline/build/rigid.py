"""The last steps of every rigid asset: how it rests, how to grasp it, and its folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from asset_pipeline.build.emit import write_asset
from asset_pipeline.build.grasp_trial import with_trials
from asset_pipeline.build.scratch_model import scratch_model
from asset_pipeline.build.steady_body import steadied
from manipose_mj.assets.asset import Area, Asset, Provenance
from manipose_mj.assets.geometry import Body
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.label_quality import LabelQuality
from manipose_mj.grasp_sampling.sampler import sample_grasps


def finish_rigid(
    folder: Path,
    *,
    name: str,
    category: str,
    label: PoseLabel,
    up: Float[np.ndarray, "3"],
    body: Body,
    provenance: Provenance,
    areas: tuple[Area, ...] = (),
    label_quality: LabelQuality | None = None,
) -> Asset:
    """Compute the rest poses and the grasps of a rigid object and write its asset folder.

    Args:
      folder: Where to write; replaced whole if it is there.
      name: The asset's name.
      category: Its category, which estimators are told.
      label: The pose label, in the object frame.
      up: `(3,)` unit vector, up in the object frame.
      body: Collision shapes, visuals and mass.
      provenance: Where it came from.
      areas: Where it is held and where it does its work, in the label frame.
      label_quality: How sure a measured label is.

    Returns:
      The asset as read back from its folder.

    Raises:
      InputError: The object has no volume or no pose in which it rests.
    """
    label = replace(label, center=box_center(body, label))
    body, poses = steadied(body, label)
    with scratch_model(body) as model_path:
        grasps = with_trials(sample_grasps(body, poses), poses, model_path)
    asset = Asset(
        folder=Path(folder),
        name=name,
        kind="rigid",
        category=category,
        label=label,
        up=np.asarray(up, float),
        mass_properties=body.mass_properties,
        stable_poses=poses,
        provenance=provenance,
        areas=areas,
        grasps=grasps,
        label_quality=label_quality,
    )
    return write_asset(asset, (body,))


def box_center(body: Body, label: PoseLabel) -> Float[np.ndarray, "3"]:
    """The middle of the bounding box along the label's axes, in the label frame [m].

    Args:
      body: What collides.
      label: In the same frame.
    """
    points = np.concatenate([shape.surface().vertices for shape in body.collision])
    along = (points - label.origin) @ label.rotation
    return (along.min(axis=0) + along.max(axis=0)) / 2
