"""The senses of `pose="estimated"`: objects as cameras and the pose estimator have them.

Of objects these senses read the task's observations of depth and segmentation, and each one's category,
as an instance detector would give them. They never read an object's pose, model, label or name.
What furniture they believe in is another's matter: `FurnitureSenses`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from asset_pipeline.assets import GraspSet
from manipose_mj.control.belief import Belief, ObjectBelief
from manipose_mj.control.estimated_scene import EstimatedScenes, SceneFollower
from manipose_mj.control.failure import StageFailure
from manipose_mj.control.furniture_senses import FurnitureSenses, TrueFurniture
from manipose_mj.control.known_shapes import KnownShape, known_shapes
from manipose_mj.control.object_views import ObjectView, ObjectViews
from manipose_mj.control.planning_scene import PlanningScene, subtree_geoms
from manipose_mj.control.pose_sensing import (
    MIN_VIEW_POINTS,
    Estimator,
    SensedPose,
    seen_points,
    sense_pose,
)
from manipose_mj.poses import invert, transform
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.sensor_config import SensorConfig

# What an estimating agent looks through: a depth camera's noise, at a third of its usual pixels.
CAMERAS = ("front", "left", "right")
SPARE_CAMERAS = ("overview",)  # looked through as well when the others leave doubt
SENSORS = SensorConfig(
    cameras=(*CAMERAS, *SPARE_CAMERAS), height=240, width=320, depth_model="structured_light"
)
_SURE = 0.9  # confidence from which on an estimate is kept for as long as it fits what is seen
_TRUSTED = 0.5  # confidence under which more cameras are asked
_FITS = (1.25, 0.0005)  # misfit allowed later, of the first: a factor, and so much more [m]
_BETTER = 0.9  # of the misfit that is left, for another pose to be believed


@dataclass(frozen=True)
class Estimate:
    """What was believed of an object at a look, for whoever judges it.

    Attributes: name; pose `T_world_label`; confidence: when it was estimated; camera: that saw it.
    """

    name: str
    pose: Float[np.ndarray, "4 4"]
    confidence: float
    camera: str


class EstimatedSenses:
    """Believes what it sees: estimates poses, holds them against every new view, follows the hand."""

    def __init__(
        self,
        task: ManipulationTask,
        physics: mjcf.Physics,
        *,
        estimators: Callable[[str], Estimator] | None = None,
        furniture: FurnitureSenses | None = None,
    ) -> None:
        """Compiles nothing yet.

        Args:
          task: Of an environment whose sensors are `SENSORS`, or others with the same cameras.
          physics: The environment's.
          estimators: The estimator of a category; `PoseEstimator.load` by default.
          furniture: Where drawers and doors are; the simulator by default.
        """
        self._task, self._physics = task, physics
        self._load = estimators or _load
        self._furniture = furniture or TrueFurniture(task, physics)
        self._views = ObjectViews(task.task_observables, CAMERAS)
        self._more_views = ObjectViews(task.task_observables, (*CAMERAS, *SPARE_CAMERAS))
        self._scenes = EstimatedScenes(task.root_entity.mjcf_model, task.robot.mjcf_model.model)
        self._scene: PlanningScene | None = None
        self._follower: SceneFollower | None = None
        self._known: dict[str, SensedPose] = {}
        self._grasps: dict[str, GraspSet] = {}
        self._held: tuple[str, Float[np.ndarray, "4 4"]] | None = None
        self._time = -1.0
        self._keys = _keys(0)
        self.sources: Mapping[str, str] = {
            "objects": "estimated",
            "furniture": self._furniture.source,
        }
        self.last_look: tuple[Estimate, ...] = ()

    def begin(self, seed: int) -> PlanningScene:
        """Look for every object of an episode, and make a scene of what is seen.

        Raises:
          StageFailure: An object that a goal is about is not seen.
          InputError: There are no weights for a category.
        """
        self._keys = _keys(seed)
        self._held, self._known = None, {}
        wanted = {getattr(goal, "object", None) for goal in self._task.goals}
        categories = self._categories()
        for category in categories.values():
            self._load(category)  # what has no weights is told before anything is built
        for name, category in categories.items():
            shapes = known_shapes(category)
            sensed = self._sensed(name, self._views.of(self._physics, name), shapes)
            if sensed is not None:
                self._known[name] = sensed
            elif name in wanted:
                raise StageFailure("perception", f"no camera sees enough of {name}")
        self._time = float(self._physics.data.time)
        self._grasps = {name: sensed.shape.sampled_grasps() for name, sensed in self._known.items()}
        self._scene, self._follower = self._scenes.build(
            {name: sensed.shape.hulls for name, sensed in self._known.items()}
        )
        return self._scene

    def robot(self) -> tuple[Float[np.ndarray, "7"], float]:
        """Joint angles [rad] and opening [m]."""
        return self._task.robot.configuration(self._physics)

    def look(self) -> Belief:
        """What is believed now; the planning scene is brought up to date with it."""
        assert self._scene is not None and self._follower is not None  # begin comes first
        physics, scene, follower = self._physics, self._scene, self._follower
        follower.follow(physics.model.ptr, physics.data.qpos)
        joints, opening = self.robot()
        time = float(physics.data.time)
        if time != self._time:
            tcp = scene.tcp_pose(joints)
            for name in self._known:
                self._known[name] = self._again(name, tcp)
            self._time = time
        for name, sensed in self._known.items():
            follower.place(name, sensed.pose)
        objects = {name: self._belief(name, sensed) for name, sensed in self._known.items()}
        parts = self._furniture.parts(scene, objects)
        self.last_look = tuple(
            Estimate(name, sensed.pose, sensed.confidence, sensed.camera)
            for name, sensed in self._known.items()
        )
        return Belief(joints, opening, objects, parts)

    def hold(self, name: str | None) -> None:
        """From now on the hand holds this, as it was seen last; None: it holds nothing."""
        self._held = None
        if name in self._known and self._scene is not None:
            tcp = self._scene.tcp_pose(self.robot()[0])
            self._held = (name, invert(tcp) @ self._known[name].pose)

    def _categories(self) -> Mapping[str, str]:
        """Of each object's category: all that is told about it."""
        return {name: entity.asset.category for name, entity in self._task.movable.items()}

    def _again(self, name: str, tcp: Float[np.ndarray, "4 4"]) -> SensedPose:
        """What is believed of an object after time has passed: where it was, or where the hand has
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
        sensed = sense_pose(estimator, views, shapes, self._keys)
        if sensed is not None and sensed.confidence >= _TRUSTED:
            return sensed
        views = self._more_views.of(self._physics, name)
        return sense_pose(estimator, views, shapes, self._keys)

    def _belief(self, name: str, sensed: SensedPose) -> ObjectBelief:
        assert self._scene is not None and self._follower is not None
        body = self._follower.body(name)
        return ObjectBelief(
            name=name,
            pose=sensed.pose,
            label=sensed.shape.label,
            grasps=self._grasps[name],
            body=body,
            geoms=subtree_geoms(self._scene.model, body),
            rests=sensed.shape.rests,
        )


def _load(category: str) -> Estimator:
    from manipose_mj.ppf_jax.estimator import PoseEstimator  # loads JAX

    return PoseEstimator.load(category)


def _keys(seed: int) -> Callable[[], Any]:
    """A new random key at every call, always the same ones for a seed."""
    count = 0

    def draw() -> Any:
        import jax

        nonlocal count
        count += 1
        return jax.random.fold_in(jax.random.key(seed), count)

    return draw
