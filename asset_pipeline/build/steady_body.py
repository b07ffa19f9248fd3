"""The rest poses of a body, and collision shapes that lie still in them."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import cast

import numpy as np
import trimesh

from asset_pipeline.build.scratch_model import scratch_model
from asset_pipeline.geometry.convexify import ConvexSettings
from asset_pipeline.geometry.hull_reduction import halves, reduced_hull
from asset_pipeline.geometry.settling import dropped
from asset_pipeline.geometry.stable_poses import stable_poses, verified
from manipose_mj.assets.asset import StablePose
from manipose_mj.assets.geometry import Body, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.rest_scene import rest_scene

log = logging.getLogger(__name__)

# Of round collision shapes: their rest heights are then right to 0.02 mm.
SECTIONS = 96


def steadied(body: Body, label: PoseLabel) -> tuple[Body, tuple[StablePose, ...]]:
    """The body and the poses in which it rests; a single hull that trembles in one becomes two halves.

    MuJoCo gives a convex mesh three contacts with a plane. Where a bottom has four corners that differ in height
    by less than a contact gives way, it takes now these three and now those, with a kick each time. Two halves have
    six contacts, and together the same surface.

    Raises:
      InputError: The body has no volume or no pose in which it rests.
    """
    poses = _rest_poses(body, label)
    hull, *others = body.collision
    if others or hull.kind != "mesh" or _still(body, poses):
        return body, poses
    corners = np.asarray(hull.surface().vertices)
    meshes = [reduced_hull(half, ConvexSettings().max_vertices) for half in halves(corners)]
    cut = replace(body, collision=tuple(Shape("mesh", mesh=mesh) for mesh in meshes))
    poses_of_cut = _rest_poses(cut, label)
    if not _still(cut, poses_of_cut):
        return body, poses
    log.info("%s: its hull trembles at rest; cut in two", body.name)
    return cut, poses_of_cut


def _rest_poses(body: Body, label: PoseLabel) -> tuple[StablePose, ...]:
    surfaces = [shape.surface(SECTIONS) for shape in body.collision]
    touching = cast(trimesh.Trimesh, trimesh.util.concatenate(surfaces))
    poses = stable_poses(touching, body.mass_properties.center_of_mass, label=label)
    with scratch_model(body) as path:
        return verified(poses, path, label=label)


def _still(body: Body, poses: tuple[StablePose, ...]) -> bool:
    """Whether it comes to rest in every pose."""
    with scratch_model(body) as path:
        model = rest_scene(path)
        return all(np.isfinite(dropped(model, pose)[1]) for pose in poses)
