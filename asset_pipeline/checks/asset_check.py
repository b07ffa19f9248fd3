"""Does a built asset behave? Each is loaded alone, dropped, and tested by what it then does.

Beside that, its files must agree (`agreement_check`), and what is seen with what touches (`visual_check`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from joblib import Parallel, delayed

from asset_pipeline.checks.agreement_check import body_failures, joint_failures
from asset_pipeline.checks.handle_check import handle_remarks
from asset_pipeline.checks.visual_check import visual_failures
from asset_pipeline.geometry.settling import SETTLE_TIME, dropped, speeds
from asset_pipeline.geometry.stable_poses import tilt
from manipose_mj.assets.asset import MODEL_FILE, Asset
from manipose_mj.assets.asset_json import list_assets, read_asset
from manipose_mj.assets.model_file import refuse_frames
from manipose_mj.assets.rest_scene import rest_scene
from manipose_mj.errors import InputError
from manipose_mj.poses import quaternion_to_rotation


@dataclass(frozen=True)
class CheckLimits:
    """What an asset must satisfy, beside coming to rest as `geometry.settling` says.

    Attributes:
      penetration: At rest [m].
      tilt: Between the pose it was dropped in and the one it rests in [rad].
      part_vertices: Of any collision mesh.
      shut: How far a moving part may creep in `shut_time` seconds, as a share of its range.
      reach: Share of its range that a moving part must reach.
      force: On a sliding part [N]. torque: On a hinged one [N m].
    """

    penetration: float = 0.002
    tilt: float = np.deg2rad(10.0)
    part_vertices: int = 32
    shut: float = 0.01
    shut_time: float = 2.0
    reach: float = 0.95
    force: float = 20.0
    torque: float = 5.0


LIMITS = CheckLimits()


@dataclass(frozen=True)
class CheckResult:
    """What one asset did.

    Attributes:
      name: The asset's folder name.
      failures: One line for each limit it broke; empty if it passed.
      settle_seconds: When it came to rest [s]; NaN for articulated assets and those that never did.
      penetration: Deepest contact at rest [m].
      tilt: From the pose it was dropped in, symmetries apart [rad].
      parts: Number of collision geoms.
      part_vertices: Most vertices of a collision mesh.
      grasps: Number of sampled grasps.
      remarks: One line for each thing that tasks may refuse it for; no failure.
    """

    name: str
    failures: tuple[str, ...] = ()
    settle_seconds: float = float("nan")
    penetration: float = float("nan")
    tilt: float = float("nan")
    parts: int = 0
    part_vertices: int = 0
    grasps: int = 0
    remarks: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the asset broke no limit."""
        return not self.failures


def check(
    directory: Path | str,
    *,
    jobs: int = 1,
    progress: Callable[[CheckResult, int], None] | None = None,
) -> list[CheckResult]:
    """Check every asset folder under `directory`, or `directory` itself where it is one.

    Args:
      directory: Folder of asset folders, or an asset folder.
      jobs: Worker processes.
      progress: Called with each result and the number of assets in all.

    Returns:
      One result an asset, sorted by name. A folder that cannot be read or loaded is a failure too.

    Raises:
      InputError: There is no asset.
    """
    directory = Path(directory)
    alone = (directory / "asset.json").is_file()
    folders = [directory] if alone else list_assets(directory)
    results = []
    calls = (delayed(check_asset)(folder) for folder in folders)
    for result in Parallel(n_jobs=jobs, return_as="generator_unordered")(calls):
        results.append(result)
        if progress is not None:
            progress(result, len(folders))
    return sorted(results, key=lambda r: r.name)


def check_asset(folder: Path) -> CheckResult:
    """Load one asset alone and test it."""
    try:
        asset = read_asset(folder)
        model = rest_scene(asset.model_path, plane=asset.kind == "rigid")
        refuse_frames(mujoco.MjSpec.from_file(str(asset.model_path)), MODEL_FILE)
        unlike = visual_failures(folder)
    except InputError as error:
        return CheckResult(folder.name, (str(error),))
    except (ValueError, mujoco.FatalError) as error:  # MuJoCo's compiler
        line = " ".join(str(error).split())
        return CheckResult(folder.name, (f"{folder}: model.xml does not compile: {line}",))
    checked = _check_articulated if asset.kind == "articulated" else _check_rigid
    result = checked(asset, model)
    failures = (*result.failures, *body_failures(asset, model), *unlike)
    return replace(result, failures=failures, remarks=handle_remarks(asset))


def _check_rigid(asset: Asset, model: mujoco.MjModel) -> CheckResult:
    failures = _shape_failures(model)
    parts, vertices = _collision_parts(model)
    grasps = 0 if asset.grasps is None else len(asset.grasps)
    counts: dict[str, Any] = {"parts": parts, "part_vertices": vertices, "grasps": grasps}
    if model.nq != 7:
        failures.append(f"model has {model.nq} coordinates; a rigid asset has one free joint")
    if not asset.stable_poses:
        failures.append("asset.json lists no stable pose")
    if failures:
        return CheckResult(asset.folder.name, tuple(failures), **counts)
    start = max(asset.stable_poses, key=lambda p: p.probability)
    data, settle_seconds = dropped(model, start)
    depth = float(max(-data.contact.dist.min(), 0.0)) if data.ncon else 0.0
    leaned = tilt(quaternion_to_rotation(data.qpos[3:7]), start.rotation, asset.label)
    if not np.isfinite(data.qpos).all() or data.qpos[2] < -1.0:
        failures.append("fell through the plane or became unstable")
    if not np.isfinite(settle_seconds):
        linear, angular = speeds(data)
        failures.append(
            f"not at rest after {SETTLE_TIME:g} s ({linear:.3f} m/s, {angular:.2f} rad/s)"
        )
    if depth > LIMITS.penetration:
        failures.append(f"sinks {1e3 * depth:.1f} mm into the plane")
    if leaned > LIMITS.tilt:
        failures.append(
            f"rests {np.rad2deg(leaned):.0f} deg from the stable pose it was dropped in"
        )
    return CheckResult(asset.folder.name, tuple(failures), settle_seconds, depth, leaned, **counts)


def _check_articulated(asset: Asset, model: mujoco.MjModel) -> CheckResult:
    failures = _shape_failures(model)
    parts, vertices = _collision_parts(model)
    counts: dict[str, Any] = {"parts": parts, "part_vertices": vertices, "grasps": 0}
    if unlike := joint_failures(asset, model):  # what moves is then not what asset.json speaks of
        return CheckResult(asset.folder.name, (*failures, *unlike), **counts)
    data = mujoco.MjData(model)
    while data.time < LIMITS.shut_time:
        mujoco.mj_step(model, data)
    shut = data.qpos.copy()
    for part in asset.parts:
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"asset/{part.name}")
        low, high = part.joint.range
        opened = (shut[model.jnt_qposadr[joint]] - low) / (high - low)
        if abs(opened) > LIMITS.shut:
            failures.append(f"part {part.name!r} creeps to {100 * opened:.0f} % open, untouched")
        reached = _pull(model, data, joint, part.joint.kind == "slide")
        if (reached - low) / (high - low) < LIMITS.reach:
            failures.append(
                f"part {part.name!r} opens to {reached:.3f} of {high:.3f} under "
                f"{LIMITS.force:g} N or {LIMITS.torque:g} N m"
            )
    return CheckResult(asset.folder.name, tuple(failures), **counts)


def _pull(model: mujoco.MjModel, data: mujoco.MjData, joint: int, slides: bool) -> float:
    """How far the joint gets under a steady pull, everything else shut [m or rad]."""
    mujoco.mj_resetData(model, data)
    data.qfrc_applied[model.jnt_dofadr[joint]] = LIMITS.force if slides else LIMITS.torque
    while data.time < SETTLE_TIME:
        mujoco.mj_step(model, data)
    return float(data.qpos[model.jnt_qposadr[joint]])


def _shape_failures(model: mujoco.MjModel) -> list[str]:
    parts, vertices = _collision_parts(model)
    failures = []
    if not parts:
        failures.append("has no collision geom")
    if vertices > LIMITS.part_vertices:
        failures.append(
            f"a collision part has {vertices} vertices; at most {LIMITS.part_vertices} are allowed"
        )
    return failures


def _collision_parts(model: mujoco.MjModel) -> tuple[int, int]:
    """Number of the asset's collision geoms, and the most vertices of one's mesh."""
    solid = (model.geom_contype > 0) & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
    meshes = model.geom_dataid[solid & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)]
    most = int(model.mesh_vertnum[meshes].max()) if len(meshes) else 0
    return int(solid.sum()), most
