"""The perception of `pose="estimated"`: objects as cameras and the pose estimator have them.

Of objects perception reads the task's observations of depth and segmentation, and each one's category,
as an instance detector would give them. They never read an object's pose, model, label or name.
Furniture is estimated elsewhere: `FurniturePerception`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, GraspSet
from manipose_mj.control.perception.estimated_scene import EstimatedScene, EstimatedScenes
from manipose_mj.control.perception.furniture_perception import FurniturePerception, TrueFurniture
from manipose_mj.control.perception.grasp_sources import sensed_grasps
from manipose_mj.control.perception.known_shapes import KnownShape, known_shapes
from manipose_mj.control.perception.object_views import ObjectView, ObjectViews
from manipose_mj.control.perception.pose_sensing import (
    MIN_VIEW_POINTS,
    Estimator,
    SensedPose,
    seen_points,
    sense_pose,
)
from manipose_mj.control.perception.source_names import GraspSource
from manipose_mj.control.scene.collision_model import subtree_geoms
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.failures import StageFailure
from manipose_mj.poses import invert, transform
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.observations.sensor_config import SensorConfig

# What an estimating agent looks through: a depth camera's noise, at a third of its usual pixels.
CAMERAS = ("front", "left", "right")
SPARE_CAMERAS = ("overview",)  # used as well when the others leave an estimate uncertain
SENSORS = SensorConfig(
    cameras=(*CAMERAS, *SPARE_CAMERAS),
    height=240,
    width=320,
    depth_model="structured_light",
    renderer="ray",  # colours that do not depend on the machine; nobody but estimators of others looks
)
_SURE = 0.9  # confidence from which on an estimate is kept for as long as it fits what is seen
_TRUSTED = 0.5  # confidence under which more cameras are asked
_FITS = (1.25, 0.0005)  # misfit allowed later, of the first: a factor, and so much more [m]
_BETTER = 0.9  # of the misfit that is left, for another pose to replace it


@dataclass(frozen=True)
class EstimatedPose:
    """The pose of an object at the last observation, for reports.

    Attributes: name; pose `T_world_label`; confidence: when it was estimated; camera: that saw it.
    """

    name: str
    pose: Float[np.ndarray, "4 4"]
    confidence: float
    camera: str


class EstimatedPerception:
    """Estimates poses from views, compares them with every new view, follows the hand."""

    def __init__(
        self,
        task: ManipulationTask,
        physics: mjcf.Physics,
        *,
        estimators: Callable[[str], Estimator] | None = None,
        meshes: Callable[[Asset], Mapping[str, np.ndarray]] | None = None,
        furniture: FurniturePerception | None = None,
        grasps: GraspSource = "cloud",
    ) -> None:
        """Compiles nothing yet.

        Args:
          task: Of an environment whose sensors are `SENSORS`, or others; it looks through all of their cameras,
            through `SPARE_CAMERAS` where it has to.
          physics: The environment's.
          estimators: The estimator of a category; `PoseEstimator.load` by default.
          meshes: The mesh of an object, if estimators are given it; planning never sees it.
          furniture: Where drawers and doors are; the simulator by default.
          grasps: Where grasps come from.
        """
        self._task, self._physics = task, physics
        self._load = estimators or _load
        self._meshes = meshes
        self._furniture = furniture or TrueFurniture(task, physics)
        self._grasp_source: GraspSource = grasps
        every = task.env_config.sensors.camera_names
        usual = tuple(name for name in every if name not in SPARE_CAMERAS) or every
        self._views = ObjectViews(task.task_observables, usual)
        self._more_views = ObjectViews(task.task_observables, every)
        self._scenes = EstimatedScenes(task.root_entity.mjcf_model, task.robot.mjcf_model.model)
        self._scene: EstimatedScene | None = None
        self._known: dict[str, SensedPose] = {}
        self._grasps: dict[str, GraspSet] = {}
        self._held: tuple[str, Float[np.ndarray, "4 4"]] | None = None
        self._time = -1.0
        self._keys = _keys(0)
        self.sources: Mapping[str, str] = {
            "objects": "estimated",
            "furniture": self._furniture.source,
        }
        self.last_estimates: tuple[EstimatedPose, ...] = ()

    def reset(self, seed: int) -> None:
        """Estimate every object of an episode, and build a scene of what is seen.

        Raises:
          StageFailure: An object that a goal is about is not seen.
          InputError: There are no weights for a category.
        """
        self._keys = _keys(seed)
        self._held, self._known = None, {}
        needed = {getattr(goal, "object", None) for goal in self._task.goals}
        categories = self._categories()
        for category in categories.values():
            self._load(category)  # what has no weights is told before anything is built
        for name, category in categories.items():
            shapes = known_shapes(category)
            sensed = self._sensed(name, self._views.of(self._physics, name), shapes)
            if sensed is not None:
                self._known[name] = sensed
            elif name in needed:
                raise StageFailure("perception", f"no camera sees enough of {name}")
        self._time = float(self._physics.data.time)
        self._grasps = {name: self._grasps_of(name) for name in self._known}
        self._scene = self._scenes.build(
            {name: sensed.shape.hulls for name, sensed in self._known.items()}
        )

    def robot(self) -> tuple[Float[np.ndarray, "7"], float]:
        """Joint angles [rad] and opening [m]."""
        return self._task.robot.configuration(self._physics)

    def observe(self) -> SceneEstimate:
        """Estimates of the scene as it is now."""
        joints, opening = self.robot()
        time = float(self._physics.data.time)
        if time != self._time:
            tcp = self._planning_scene().tcp_pose(joints)
            for name in self._known:
                self._known[name] = self._updated(name, tcp)
            self._time = time
        scene = self._planning_scene()
        objects = {
            name: self._estimate(name, sensed, scene) for name, sensed in self._known.items()
        }
        parts = self._furniture.parts(scene, objects)
        self.last_estimates = tuple(
            EstimatedPose(name, sensed.pose, sensed.confidence, sensed.camera)
            for name, sensed in self._known.items()
        )
        return SceneEstimate(joints, opening, objects, parts, scene)

    def hold(self, name: str | None) -> None:
        """From now on the hand holds this, as it was seen last; None: it holds nothing."""
        self._held = None
        if name in self._known:
            tcp = self._planning_scene().tcp_pose(self.robot()[0])
            self._held = (name, invert(tcp) @ self._known[name].pose)

    def _planning_scene(self) -> PlanningScene:
        """The scene as the simulator and the latest estimates have it."""
        assert self._scene is not None  # reset comes first
        poses = {name: sensed.pose for name, sensed in self._known.items()}
        physics = self._physics
        return self._scene.observed(physics.model.ptr, physics.data.qpos, poses)

    def _categories(self) -> Mapping[str, str]:
        """Of each object's category: all that is told about it."""
        return {name: entity.asset.category for name, entity in self._task.objects.items()}

    def _updated(self, name: str, tcp: Float[np.ndarray, "4 4"]) -> SensedPose:
        """The pose of an object after time has passed: where it was, or where the hand has
        brought it, if the new views fit that; else what they are estimated to show."""
        before = self._known[name]
        held = self._held is not None and self._held[0] == name
        if self._held is not None and held:
            before = replace(before, pose=tcp @ self._held[1])
        views = self._views.of(self._physics, name)
        if sum(len(view) for view in views) < MIN_VIEW_POINTS:
            return before
        misfit = before.shape.misfit(transform(invert(before.pose), seen_points(views)))
        factor, more = _FITS
        if misfit <= factor * before.misfit + more and before.confidence >= _SURE:
            return before
        sensed = self._sensed(name, views, (before.shape,))
        if sensed is None or sensed.misfit > _BETTER * misfit:
            return before
        if self._held is not None and held:
            self._held = (name, invert(tcp) @ sensed.pose)
        return sensed

    def _sensed(
        self, name: str, views: tuple[ObjectView, ...], shapes: tuple[KnownShape, ...]
    ) -> SensedPose | None:
        estimator = self._load(self._categories()[name])
        sensed = sense_pose(estimator, self._with_mesh(name, views), shapes, self._keys)
        if sensed is not None and sensed.confidence >= _TRUSTED:
            return sensed
        views = self._more_views.of(self._physics, name)
        return sense_pose(estimator, self._with_mesh(name, views), shapes, self._keys)

    def _grasps_of(self, name: str) -> GraspSet:
        """For the pose estimated and those that goals ask for."""
        symmetries = {each: sensed.shape.label.symmetry for each, sensed in self._known.items()}
        frames = [goal.goal_frame(symmetries) for goal in self._task.goals]
        rotations = [
            np.asarray(frame.pose)[:3, :3]
            for frame in frames
            if frame is not None and frame.object == name and frame.rotation_counts
        ]
        return sensed_grasps(
            self._grasp_source,
            self._known[name],
            self._views.of(self._physics, name) or self._more_views.of(self._physics, name),
            rotations,
            lambda: self._task.objects[name].asset,
        )

    def _with_mesh(self, name: str, views: tuple[ObjectView, ...]) -> tuple[ObjectView, ...]:
        """The views as estimators get them: with the object's mesh, if they are given it."""
        if self._meshes is None:
            return views
        mesh = self._meshes(self._task.objects[name].asset)
        return tuple(replace(view, mesh=mesh) for view in views)

    def _estimate(self, name: str, sensed: SensedPose, scene: PlanningScene) -> ObjectEstimate:
        assert self._scene is not None
        body = self._scene.body(name)
        return ObjectEstimate(
            name=name,
            pose=sensed.pose,
            label=sensed.shape.label,
            grasps=self._grasps[name],
            body=body,
            geoms=subtree_geoms(scene.model, body),
            rests=sensed.shape.rests,
            category=self._categories()[name],
            uncertainty=sensed.misfit if self._grasp_source == "cloud" else 0.0,
        )


def _load(category: str) -> Estimator:
    from manipose_mj.ppf_jax.estimator import PoseEstimator  # loads JAX

    return PoseEstimator.load(category)


def _keys(seed: int) -> Callable[[], Any]:
    """A new random key at every call, always the same ones for a seed."""
    count = 0

    def next_key() -> Any:
        import jax

        nonlocal count
        count += 1
        return jax.random.fold_in(jax.random.key(seed), count)

    return next_key
