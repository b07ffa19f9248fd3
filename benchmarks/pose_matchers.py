"""Classical matchers of a cloud against one template of its category, for the pose table.

Each matcher is a function from a template to a function from a cloud to `T_camera_label`. Their libraries
are optional: `pip install -e ".[pose-bench]"`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from manipose_mj.assets import catalogue
from manipose_mj.poses import compose, invert, transform

TEMPLATE_POINTS = 2000
TEMPLATE_INDEX = 0  # a category's typical object, which is in the training split
STARTS = 60
_NEAR = 0.05  # of the template's diameter: a match's reach


@dataclass(frozen=True)
class Template:
    """A category's typical object.

    Attributes:
      points: `(n, 3)` [m], label frame, all round.
      normals: `(n, 3)`, outwards.
      diameter: Of its bounding box [m].
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    diameter: float


Match = Callable[[np.ndarray, np.ndarray], Float[np.ndarray, "4 4"]]
Matcher = Callable[[Template], Match]


def template(category: str) -> Template:
    """The template of a category."""
    specimen = catalogue.generate(category, TEMPLATE_INDEX)
    surface = specimen.bodies[0].surface()
    points, faces = trimesh.sample.sample_surface(surface, TEMPLATE_POINTS, seed=0)[:2]
    placed = invert(specimen.label.pose)
    diameter = float(np.linalg.norm(np.ptp(surface.bounds, axis=0)))
    normals = surface.face_normals[faces] @ placed[:3, :3].T
    return Template(transform(placed, points), normals, diameter)


def available() -> tuple[dict[str, Matcher], dict[str, str]]:
    """The matchers whose libraries can be loaded; of the others, why not."""
    found: dict[str, Matcher] = {}
    lacking: dict[str, str] = {}
    for name, (library, matcher) in MATCHERS.items():
        try:
            importlib.import_module(library)
        except (ImportError, OSError) as error:  # not installed; or a system library is missing
            lacking[name] = str(error)
        else:
            found[name] = matcher
    return found, lacking


def opencv_ppf(model: Template) -> Match:
    """OpenCV's `ppf_match_3d` (Drost et al. 2010): the closest fit of its first five, with and without ICP."""
    cv2: Any = importlib.import_module("cv2")
    # Half this sampling step trains for more than a minute.
    detector = cv2.ppf_match_3d_PPF3DDetector(0.1, 0.05)
    trained = np.hstack([model.points, model.normals]).astype(np.float32)
    detector.trainModel(trained)
    icp, misfit = cv2.ppf_match_3d_ICP(50, 0.005, 2.5, 5), _misfit(model)

    def match(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        scene = np.hstack([points, normals]).astype(np.float32)
        poses = detector.match(scene, 0.2, 0.05)[:5]
        if not len(poses):
            return compose(np.eye(3), points.mean(axis=0))
        found = [np.array(pose.pose) for pose in poses]
        _, poses = icp.registerModelToScene(trained, scene, poses)
        # Its ICP sometimes throws the template far away, with a small residual of its own.
        found += [np.array(pose.pose) for pose in poses]
        return min(found, key=lambda pose: misfit(invert(pose), points))

    return match


def fpfh_ransac_icp(model: Template) -> Match:
    """Open3D: FPFH features, RANSAC over three correspondences, point-to-plane ICP."""
    import open3d as o3d

    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    registration: Any = o3d.pipelines.registration
    voxel = model.diameter / 30
    check = registration.CorrespondenceCheckerBasedOnEdgeLength(0.9)
    near = registration.CorrespondenceCheckerBasedOnDistance(1.5 * voxel)

    def prepared(points: np.ndarray, normals: np.ndarray) -> tuple[Any, Any]:
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(float)))
        cloud.normals = o3d.utility.Vector3dVector(normals.astype(float))
        cloud = cloud.voxel_down_sample(voxel)
        around = o3d.geometry.KDTreeSearchParamHybrid(radius=5 * voxel, max_nn=100)
        return cloud, registration.compute_fpfh_feature(cloud, around)

    target, target_features = prepared(model.points, model.normals)

    def match(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        o3d.utility.random.seed(0)
        source, features = prepared(points, normals)
        coarse = registration.registration_ransac_based_on_feature_matching(
            source, target, features, target_features, True, 1.5 * voxel,
            registration.TransformationEstimationPointToPoint(False), 3, [check, near],
            registration.RANSACConvergenceCriteria(20_000, 0.999),
        )  # fmt: skip
        fine = registration.registration_icp(
            source, target, voxel, coarse.transformation,
            registration.TransformationEstimationPointToPlane(),
        )  # fmt: skip
        # Sliding along a plane leaves ICP's equations singular.
        lost = (
            np.linalg.norm(fine.transformation[:3, 3] - coarse.transformation[:3, 3])
            > model.diameter
        )
        return invert(np.array((coarse if lost else fine).transformation))

    return match


def multi_start_icp(model: Template) -> Match:
    """small_gicp: point-to-plane ICP from 60 orientations spread over SO(3); the closest fit."""
    import small_gicp

    target, tree = small_gicp.preprocess_points(model.points, model.diameter / 60)
    misfit = _misfit(model)
    turns = Rotation.random(STARTS, random_state=0).as_matrix()

    def match(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        points = points.astype(float)
        source, _ = small_gicp.preprocess_points(points, model.diameter / 40)
        middle = points.mean(axis=0)
        view = middle / np.linalg.norm(middle)
        best, least = np.eye(4), np.inf
        for turn in turns:
            # The centre of what the camera would see of the template, turned so.
            shown = (model.normals @ turn.T) @ view < 0
            start = invert(compose(turn, middle - turn @ model.points[shown].mean(axis=0)))
            found = small_gicp.align(
                target, source, tree, start, registration_type="PLANE_ICP",
                max_correspondence_distance=4 * _NEAR * model.diameter, max_iterations=20,
            )  # fmt: skip
            pose = np.array(found.T_target_source)
            score = misfit(pose, points)
            if score < least:
                best, least = pose, score
        return invert(best)

    return match


def _misfit(model: Template) -> Callable[[np.ndarray, np.ndarray], float]:
    """Mean distance of a cloud from the template under `T_label_camera`, strays cut off."""
    nearest = cKDTree(model.points)

    def misfit(T_label_camera: np.ndarray, points: np.ndarray) -> float:
        apart, _ = nearest.query(transform(T_label_camera, points))
        return float(np.minimum(apart, _NEAR * model.diameter).mean())

    return misfit


MATCHERS: dict[str, tuple[str, Matcher]] = {
    "OpenCV ppf_match_3d + ICP": ("cv2.ppf_match_3d", opencv_ppf),
    "FPFH + RANSAC + ICP": ("open3d", fpfh_ransac_icp),
    "multi-start ICP": ("small_gicp", multi_start_icp),
}
