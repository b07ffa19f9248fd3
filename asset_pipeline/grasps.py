"""Antipodal parallel-jaw grasps of an object, sampled once in its own frame.

The object is a cloud of evenly spread surface points. Pairs of points whose normals oppose each
other within the friction cones give closing directions; approach directions are spread around each.
What the pads touch, and whether the open hand hits the object, is counted in points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float, Int

from asset_pipeline.assets import GraspSet, StablePose
from asset_pipeline.geometry import Shape
from asset_pipeline.gripper import ParallelJaw

SPACING = 0.003  # between surface points [m]
MAX_POINTS = 8000
PAIRS = 400
APPROACHES = 24
FRICTION = 0.5  # of the cones; below the real one, so that small errors of pose do no harm
MARGIN = 0.0015  # kept between the open hand and the object [m]
PAD_DEPTH = 0.0015  # points this close to the first touched count as touched [m]
MIN_WIDTH = 0.002
WALL = 0.01  # walls further apart than this are grasped each by itself [m]
MIN_COVER = 0.25  # least share of a pad that must touch
PLANE_CLEARANCE = 0.003
STANDOFF = 0.10  # where a straight approach starts [m]


@dataclass(frozen=True)
class _Candidates:
    poses: Float[np.ndarray, "n 4 4"]
    widths: Float[np.ndarray, "n"]
    quality: Float[np.ndarray, "n"]

    def take(self, index: np.ndarray) -> _Candidates:
        return _Candidates(self.poses[index], self.widths[index], self.quality[index])


def sample_grasps(
    surface: trimesh.Trimesh,
    collision: Sequence[Shape],
    stable_poses: Sequence[StablePose],
    *,
    center_of_mass: Float[np.ndarray, "3"] | None = None,
    gripper: ParallelJaw | None = None,
    seed: int = 0,
    count: int = 400,
) -> GraspSet:
    """A diverse set of at most `count` grasps, best first.

    Every grasp stands for two: turning the hand by half a turn about its approach gives the same
    contacts with another arm posture; whoever plans for an arm adds those. The hand is expected to
    approach along z, opened to `gripper.opening(width)`: that is what was tested for collision.

    Args:
      surface: What is seen, in the object frame [m].
      collision: What is touched, in the object frame.
      stable_poses: For `GraspSet.clear`, in this order.
      center_of_mass: `(3,)` [m]; near it is better. None takes the surface's centroid.
      gripper: The hand; None takes the Franka hand's geometry.
      seed: Of the sampling; the same seed gives the same grasps.
      count: The most grasps to return.
    """
    gripper = gripper or ParallelJaw()
    rng = np.random.default_rng(seed)
    points, normals, spacing = surface_points(surface, rng)
    touched = trimesh.util.concatenate([s.surface() for s in collision])
    obstacles = np.concatenate([points, surface_points(touched, rng)[0]])
    center = np.asarray(surface.centroid if center_of_mass is None else center_of_mass, float)
    pairs = antipodal_pairs(points, normals, spacing, gripper, rng)
    found = [
        _around_pair(points, normals, obstacles, spacing, i, j, center, gripper) for i, j in pairs
    ]
    found = [c for c in found if len(c.widths)]
    if not found:
        empty = np.empty((0, len(stable_poses)), bool)
        return GraspSet(np.empty((0, 4, 4)), np.empty(0), empty)
    candidates = _Candidates(
        np.concatenate([c.poses for c in found]),
        np.concatenate([c.widths for c in found]),
        np.concatenate([c.quality for c in found]),
    )
    clear = clear_of_plane(candidates.poses, candidates.widths, stable_poses, gripper)
    chosen = _diverse(candidates, clear, count)
    chosen = chosen[np.argsort(-candidates.quality[chosen], kind="stable")]
    best = candidates.take(chosen)
    return GraspSet(best.poses, best.widths, clear[chosen])


def surface_points(
    mesh: trimesh.Trimesh, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"], float]:
    """Evenly spread points of a surface, their outward normals, and their spacing [m].

    Area-weighted random points, thinned to one in each cell of a grid.
    """
    spacing = max(SPACING, float(np.sqrt(mesh.area / MAX_POINTS)))
    count = int(5 * mesh.area / spacing**2) + 100
    corners = np.asarray(mesh.triangles)
    areas = np.asarray(mesh.area_faces)
    faces = rng.choice(len(areas), size=count, p=areas / areas.sum())
    u, v = rng.random((2, count, 1))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    a, b, c = corners[faces].transpose(1, 0, 2)
    points = a + u * (b - a) + v * (c - a)
    cells = np.floor(points / spacing).astype(int)
    sides = np.round(np.asarray(mesh.face_normals)[faces]).astype(int)  # both sides of a thin wall
    _, first = np.unique(np.hstack([cells, sides]), axis=0, return_index=True)
    first = np.sort(first)
    return points[first], np.asarray(mesh.face_normals)[faces[first]], spacing


def antipodal_pairs(
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    spacing: float,
    gripper: ParallelJaw,
    rng: np.random.Generator,
) -> Int[np.ndarray, "pairs 2"]:
    """Pairs of points that two pads could press against each other.

    Both normals lie within the friction cones about the closing direction, which is their mean and
    joins the points to within the spacing of the cloud.
    """
    seeds = rng.permutation(len(points))[:PAIRS]
    cone = np.cos(np.arctan(FRICTION))
    widest = gripper.max_opening - gripper.min_clearance
    pairs = []
    for i in seeds:
        closing = normals - normals[i]
        length = np.linalg.norm(closing, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            closing /= length[:, None]
        facing = length / 2  # cosine of both normals to the closing direction
        offset = points - points[i]
        along = np.einsum("ni,ni->n", offset, closing)
        aside = np.linalg.norm(offset - along[:, None] * closing, axis=1)
        fits = (facing > cone) & (aside < spacing) & (along > MIN_WIDTH) & (along < widest)
        options = np.flatnonzero(fits)
        # Of each wall behind the point, the partner that opposes it best.
        wall = np.floor(along[options] / WALL).astype(int)
        for w in np.unique(wall):
            same = options[wall == w]
            pairs.append((i, same[np.argmax(facing[same] - aside[same] / WALL)]))
    return np.array(pairs, int).reshape(-1, 2)


def _around_pair(
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    obstacles: Float[np.ndarray, "m 3"],
    spacing: float,
    i: int,
    j: int,
    center_of_mass: Float[np.ndarray, "3"],
    gripper: ParallelJaw,
) -> _Candidates:
    """The grasps that close on one pair of points, one for each approach direction that is free."""
    closing = normals[j] - normals[i]
    closing /= np.linalg.norm(closing)
    center = (points[i] + points[j]) / 2
    half = abs(float((points[j] - points[i]) @ closing)) / 2
    side = np.cross(closing, np.eye(3)[np.argmin(np.abs(closing))])
    side /= np.linalg.norm(side)
    plane = np.stack([side, np.cross(side, closing)])  # x and z of the first approach
    angles = np.arange(APPROACHES) * (2 * np.pi / APPROACHES)
    cos, sin = np.cos(angles)[:, None], np.sin(angles)[:, None]

    def local(cloud: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        offset = cloud - center
        u, v = plane @ offset.T
        return cos * u - sin * v, offset @ closing, sin * u + cos * v

    # Points near the pair's two walls, as the pads see them.
    y_all = (points - center) @ closing
    near = np.abs(np.abs(y_all) - half) < 0.006
    near &= np.linalg.norm(points - center, axis=1) < half + 0.03
    x, y, z = local(points[near])
    facing = (normals[near] @ closing) * np.sign(y)
    window = (np.abs(x) < gripper.pad_half_width) & (np.abs(z) < gripper.pad_half_height)
    high = np.where(window & (y > 0), y, -np.inf).max(axis=1, initial=-np.inf)
    low = np.where(window & (y < 0), y, np.inf).min(axis=1, initial=np.inf)
    width = high - low
    middle = (high + low) / 2
    full = 4 * gripper.pad_half_width * gripper.pad_half_height / spacing**2
    solid = window & (facing > 0.7)
    cover_high = (solid & (y > high[:, None] - PAD_DEPTH)).sum(axis=1) / full
    cover_low = (solid & (y < low[:, None] + PAD_DEPTH)).sum(axis=1) / full
    cover = np.minimum(cover_high, cover_low)
    good = np.isfinite(width) & (cover > MIN_COVER)
    good &= width < gripper.max_opening - gripper.min_clearance
    good &= width > 0.002

    index = np.flatnonzero(good)
    if len(index) == 0:
        return _no_candidates()
    cos, sin = cos[index], sin[index]
    x, y, z = local(obstacles)
    free = np.empty(len(index), bool)
    for row, k in enumerate(index):
        boxes = gripper.boxes(float(gripper.opening(width[k])))
        boxes[:, 0] -= MARGIN
        boxes[:, 1] += MARGIN
        boxes[: 2 * len(gripper.finger)] = _pad_faces_in(boxes, gripper)
        free[row] = not _any_inside(x[row], y - middle[k], z[row], boxes)
    index, cos, sin = index[free], cos[free], sin[free]
    poses = np.tile(np.eye(4), (len(index), 1, 1))
    poses[:, :3, 0] = cos * plane[0] - sin * plane[1]
    poses[:, :3, 1] = closing
    poses[:, :3, 2] = sin * plane[0] + cos * plane[1]
    poses[:, :3, 3] = center + middle[index, None] * closing
    quality = _quality(poses, cover[index], center_of_mass)
    return _Candidates(poses, width[index], quality)


def _pad_faces_in(boxes: np.ndarray, gripper: ParallelJaw) -> np.ndarray:
    """The fingers' inner sides need no margin: the pads' clearance is theirs."""
    count = len(gripper.finger)
    fingers = boxes[: 2 * count].copy()
    fingers[:count, 0, 1] += MARGIN
    fingers[count:, 1, 1] -= MARGIN
    return fingers


def _any_inside(x: np.ndarray, y: np.ndarray, z: np.ndarray, boxes: np.ndarray) -> bool:
    for low, high in boxes:
        inside = (y > low[1]) & (y < high[1])
        inside &= (x > low[0]) & (x < high[0])
        inside &= (z > low[2]) & (z < high[2])
        if inside.any():
            return True
    return False


def _no_candidates() -> _Candidates:
    return _Candidates(np.empty((0, 4, 4)), np.empty(0), np.empty(0))


def _quality(
    poses: Float[np.ndarray, "n 4 4"],
    cover: Float[np.ndarray, "n"],
    center_of_mass: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "n"]:
    """Pad contact, less where the weight turns the object about the closing line."""
    offset = center_of_mass - poses[:, :3, 3]
    lever = np.linalg.norm(np.cross(offset, poses[:, :3, 1]), axis=1)
    return np.minimum(cover, 1.0) * np.exp(-lever / 0.10)


def clear_of_plane(
    poses: Float[np.ndarray, "n 4 4"],
    widths: Float[np.ndarray, "n"],
    stable_poses: Sequence[StablePose],
    gripper: ParallelJaw,
) -> np.ndarray:
    """`(n, s)`: whether the open hand, at the grasp and 10 cm back, is 3 mm clear of the support."""
    lowest = np.empty((len(poses), len(stable_poses)))
    ups = np.array([p.rotation[2] for p in stable_poses]).reshape(-1, 3)
    heights = np.array([p.height for p in stable_poses])
    for k, (pose, width) in enumerate(zip(poses, widths, strict=True)):
        boxes = gripper.boxes(float(gripper.opening(width)))
        axes = ups @ pose[:3, :3]  # up in the tcp frame, one row for each stable pose
        reach = np.minimum(axes[:, None] * boxes[:, 0], axes[:, None] * boxes[:, 1]).sum(axis=2)
        back = np.minimum(0.0, -STANDOFF * axes[:, 2])
        lowest[k] = reach.min(axis=1) + ups @ pose[:3, 3] + heights + back
    return lowest >= PLANE_CLEARANCE


def _diverse(candidates: _Candidates, clear: np.ndarray, count: int) -> Int[np.ndarray, "k"]:
    """Indices of good grasps far from one another, some of them for every stable pose."""
    chosen: list[int] = []
    poses = clear.shape[1]
    for s in range(poses):
        _farthest(candidates, np.flatnonzero(clear[:, s]), count // (2 * poses), chosen)
    _farthest(candidates, np.arange(len(candidates.widths)), count - len(chosen), chosen)
    return np.array(chosen, int)


def _farthest(
    candidates: _Candidates, allowed: Int[np.ndarray, "m"], extra: int, chosen: list[int]
) -> None:
    """Append up to `extra` of `allowed`: each time the best of quality times distance to the chosen."""
    features = _features(candidates.poses)
    distance = np.full(len(allowed), 1.0)
    for k in chosen:
        distance = np.minimum(distance, _distance(features[allowed], features[k]))
    for _ in range(extra):
        score = distance * candidates.quality[allowed]
        if len(score) == 0 or score.max() <= 0:
            return
        best = int(allowed[np.argmax(score)])
        chosen.append(best)
        distance = np.minimum(distance, _distance(features[allowed], features[best]))


def _features(poses: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "n 6"]:
    """Position over 5 cm and approach over 60 degrees."""
    return np.hstack([poses[:, :3, 3] / 0.05, poses[:, :3, 2]])


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.linalg.norm(a - b, axis=1)
