"""The names of where a baseline's poses come from, and the perception and sensors of each."""

from __future__ import annotations

import numpy as np
from dm_control import mjcf

from manipose_mj.assets.asset import Asset
from manipose_mj.control.perception.camera_rig import (
    FRONT_CAMERAS,
    SENSORS,
    standing_cameras,
    wide_cameras,
)
from manipose_mj.control.perception.estimated import EstimatedPerception
from manipose_mj.control.perception.foreign_estimator import ForeignEstimator
from manipose_mj.control.perception.oracle import OraclePerception
from manipose_mj.control.perception.perturbed import (
    UNPERTURBED,
    PerturbedPerception,
    PosePerturbation,
)
from manipose_mj.control.perception.protocol import Perception
from manipose_mj.control.perception.sensed_world import SensedWorld
from manipose_mj.control.perception.source_names import (
    POSE_SOURCES,
    GraspSource,
    default_grasps,
)
from manipose_mj.control.perception.worlds import SimulatedWorld, World
from manipose_mj.errors import unknown_name
from manipose_mj.estimators.loading import load_estimator
from manipose_mj.estimators.observation import asset_mesh
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.observations.sensor_config import SensorConfig


def check_pose_source(pose: str) -> None:
    """Raise `InputError` where there is no such source; the nearest is offered."""
    if pose not in POSE_SOURCES:
        raise unknown_name("pose source", pose, POSE_SOURCES)


def sensors_for(pose: str) -> SensorConfig:
    """What the environment of such a baseline has to measure."""
    return SensorConfig() if pose == "oracle" else SENSORS


def make_perception(
    pose: str,
    task: ManipulationTask,
    physics: mjcf.Physics,
    estimator: EstimatorSettings | None = None,
    errors: PosePerturbation = UNPERTURBED,
    grasps: GraspSource | None = None,
) -> Perception:
    """The perception of one environment.

    Args:
      pose: One of `POSE_SOURCES`.
      task: Of the environment.
      physics: Of the environment.
      estimator: Whose estimates `"estimated"` are; None: those of the package's weights.
      errors: Made to the poses of objects on purpose.
      grasps: Where grasps come from; None: those annotated with true poses, else from clouds.

    Raises:
      InputError: There is no such source or estimator.
    """
    check_pose_source(pose)
    perception = _perception(pose, task, physics, estimator, grasps or default_grasps(pose))
    return PerturbedPerception(perception, task, errors) if errors else perception


def _perception(
    pose: str,
    task: ManipulationTask,
    physics: mjcf.Physics,
    estimator: EstimatorSettings | None,
    grasps: GraspSource,
) -> Perception:
    if pose == "oracle":
        return OraclePerception(task, physics)
    world: World
    if pose == "estimated":
        cameras = standing_cameras(task.env_config.sensors)
        front = tuple(name for name in FRONT_CAMERAS if name in cameras) or cameras
        wide = wide_cameras(task.env_config.sensors)
        world = SensedWorld(task, physics, cameras, front, wide)
    else:
        world = SimulatedWorld(task, physics)
    if estimator is None:
        return EstimatedPerception(task, physics, world, grasps=grasps)
    service = load_estimator(estimator)
    return EstimatedPerception(
        task,
        physics,
        world,
        estimators=lambda kind: ForeignEstimator(service, kind.category),
        meshes=_mesh_of if estimator.give_cad else None,
        grasps=grasps,
    )


_meshes: dict[str, dict[str, np.ndarray]] = {}


def _mesh_of(asset: Asset) -> dict[str, np.ndarray]:
    """The mesh of an asset, read once a process."""
    where = str(asset.folder)
    if where not in _meshes:
        _meshes[where] = asset_mesh(asset)
    return _meshes[where]
