"""The ways an object rests on a horizontal plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import trimesh
from jaxtyping import Float

from asset_pipeline.geometry.toppling import rest_rotation, resting_faces
from manipose_mj.assets.asset import StablePose
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.physics import REST_ANGULAR_SPEED, REST_LINEAR_SPEED
from manipose_mj.assets.rest_scene import rest_scene
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, pose_to_vector, quaternion_to_rotation

MIN_PROBABILITY = 0.01
# Facets of a curved side are nearer to each other than this; faces of a box are not.
MERGE_ANGLE = np.deg2rad(12.0)
MIN_DEPTH = 1e-9  # of the centre of mass in the hull; on its face nothing is stable [m]
MAX_TILT = np.deg2rad(5.0)
SETTLE_TIME = 1.5  # [s]
# A tenth of the speeds at rest for this long, and not at once: what is about to topple starts slowly.
STIRRING, STILL_TIME, LEAST_TIME = 0.1, 0.1, 0.3
TOPPLED = np.deg2rad(30.0)  # from where no body comes back
_STRIDE, _TILT_EVERY = 10, 5  # steps between two polls of the speeds; polls between two of the tilt


def stable_poses(
    surface: trimesh.Trimesh,
    center_of_mass: Float[np.ndarray, "3"],
    *,
    label: PoseLabel | None = None,
) -> tuple[StablePose, ...]:
    """Quasi-static resting poses on the faces of the convex hull, most probable first.

    Poses that differ by a turn about the vertical, by a symmetry of the label or by the facets of
    one curved side are one pose; the most probable of them stands for all and gets their sum. Those
    under 1 % are dropped. Deterministic. Probabilities are those of `resting_faces`.

    Args:
      surface: What touches the plane, in the object frame [m].
      center_of_mass: `(3,)` in the object frame [m], inside the hull of `surface`.
      label: Its symmetry group says which poses are alike; without one none are.

    Raises:
      InputError: The surface has no volume, or the centre of mass lies outside its hull.
    """
    hull = _hull(surface)
    center = np.asarray(center_of_mass, float)
    inside = np.einsum("fi,fi->f", hull.triangles_center - center, hull.face_normals)
    if inside.min() < MIN_DEPTH:
        raise InputError(
            f"centre of mass {np.round(center, 4).tolist()} lies outside the object's convex hull"
        )
    normals, probabilities = resting_faces(hull, center)
    order = np.lexsort((*-normals.T.round(3), -probabilities.round(6)))
    merged = _merge(-normals[order], probabilities[order], label)
    kept = [(up, p) for up, p in merged if p >= MIN_PROBABILITY] or merged[:1]
    total = sum(p for _, p in kept)
    poses = [_stable_pose(rest_rotation(-up), p / total, hull) for up, p in kept]
    return tuple(sorted(poses, key=lambda p: -round(p.probability, 6)))


def verified(
    poses: Sequence[StablePose], model_path: Path, *, label: PoseLabel | None = None
) -> tuple[StablePose, ...]:
    """Those of `poses` in which the body comes to rest within 1.5 s of MuJoCo, renormalised.

    A pose fails when the body's up has tilted by more than 5 degrees, symmetries apart, or when it
    still rolls.

    Args:
      poses: To be tried.
      model_path: The object's MJCF, with one free joint.
      label: Its symmetry group says which poses are alike.

    Raises:
      InputError: None of them stands.
    """
    model = rest_scene(model_path)
    data = mujoco.MjData(model)
    standing = [p for p in poses if _stands(model, data, p, label)]
    if not standing:
        raise InputError(f"the object topples from every one of its {len(poses)} rest poses")
    total = sum(p.probability for p in standing)
    return tuple(replace(p, probability=p.probability / total) for p in standing)


def tilt(
    a: Float[np.ndarray, "3 3"], b: Float[np.ndarray, "3 3"], label: PoseLabel | None
) -> float:
    """Angle [rad] between two rest rotations `R_world_object`, least over symmetries and yaw."""
    return float(_tilts(a[2], b[2][None], label)[0])


def _tilts(
    up: Float[np.ndarray, "3"], others: Float[np.ndarray, "n 3"], label: PoseLabel | None
) -> Float[np.ndarray, "n"]:
    """Angles [rad] between a vertical and others, all in the object frame, least over symmetries."""
    group = SymmetryGroup.identity() if label is None else label.symmetry
    frame = np.eye(3) if label is None else label.rotation
    ups = (up @ frame @ group.rotations)[:, None]
    others = others @ frame
    if group.axial:  # compare heights along the axis: the turn about it is free
        along = np.arccos(np.clip(ups[..., 0], -1, 1)) - np.arccos(np.clip(others[:, 0], -1, 1))
        return np.abs(along).min(axis=0)
    chord = np.linalg.norm(ups - others, axis=2) / 2
    return (2 * np.arcsin(np.clip(chord, 0, 1))).min(axis=0)


def _merge(
    ups: Float[np.ndarray, "n 3"],
    probabilities: Float[np.ndarray, "n"],
    label: PoseLabel | None,
) -> list[tuple[np.ndarray, float]]:
    first: list[int] = []  # of the poses that are alike, the most probable
    total: list[float] = []
    for index, probability in enumerate(probabilities):
        alike = np.flatnonzero(_tilts(ups[index], ups[first], label) < MERGE_ANGLE)
        if len(alike):
            total[alike[0]] += float(probability)
        else:
            first.append(index)
            total.append(float(probability))
    return list(zip(ups[first], total, strict=True))


def _stable_pose(
    rotation: Float[np.ndarray, "3 3"], probability: float, hull: trimesh.Trimesh
) -> StablePose:
    lowest = (np.asarray(hull.vertices) @ rotation[2]).min()
    return StablePose(rotation=rotation, height=float(-lowest), probability=probability)


def _hull(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    try:
        return surface.convex_hull
    except Exception:  # qhull's own type, for flat or empty input
        raise InputError("surface has no convex hull; expected a solid object") from None


def _stands(
    model: mujoco.MjModel, data: mujoco.MjData, pose: StablePose, label: PoseLabel | None
) -> bool:
    """Whether the body ends at rest as it began; it has ended when it has not stirred for 0.1 s."""
    mujoco.mj_resetData(model, data)
    data.qpos[:7] = pose_to_vector(pose.pose)
    linear, angular, still_since, polls = np.inf, np.inf, 0.0, 0

    def leaned() -> float:
        return tilt(quaternion_to_rotation(data.qpos[3:7]), pose.rotation, label)

    while data.time < SETTLE_TIME:
        mujoco.mj_step(model, data, _STRIDE)
        polls += 1
        linear = float(np.linalg.norm(data.qvel[:3]))
        angular = float(np.linalg.norm(data.qvel[3:6]))
        if polls % _TILT_EVERY == 0 and leaned() > TOPPLED:
            return False
        if linear > STIRRING * REST_LINEAR_SPEED or angular > STIRRING * REST_ANGULAR_SPEED:
            still_since = data.time
        elif data.time > LEAST_TIME and data.time - still_since > STILL_TIME:
            break
    return bool(linear < REST_LINEAR_SPEED and angular < REST_ANGULAR_SPEED and leaned() < MAX_TILT)
