"""The perception of `pose="estimated"`: objects as cameras and the pose estimator have them.

Of objects perception reads the task's observations of depth and segmentation, and each one's category,
as an instance detector would give them; of a category outside the catalogue also its object type
(`object_kinds`). They never read an object's pose, model, name, or anything else of its label.
Furniture and surroundings are a `World`'s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, GraspSet
from manipose_mj.control.furniture.sensing.scene_cloud import SceneViews
from manipose_mj.control.motion.arm_model import ArmModel
from manipose_mj.control.perception.camera_rig import (
    FRONT_CAMERAS,
    HAND_CAMERA,
    SPARE_CAMERAS,
    standing_cameras,
)
from manipose_mj.control.perception.cloud_grasps import COUNT, MANY
from manipose_mj.control.perception.flat_objects import sensed_if_flat
from manipose_mj.control.perception.grasp_sources import sensed_grasps
from manipose_mj.control.perception.in_hand import InHand, is_gone
from manipose_mj.control.perception.kind_estimators import shipped_estimator
from manipose_mj.control.perception.objects.asked_objects import asked_rotations, in_the_open
from manipose_mj.control.perception.objects.colour_words import SeenColours
from manipose_mj.control.perception.objects.goal_depth import as_unsure_as_deep
from manipose_mj.control.perception.objects.object_kinds import ObjectKind, kinds_of
from manipose_mj.control.perception.objects.object_views import ObjectView, ObjectViews, seen_points
from manipose_mj.control.perception.objects.shape_fits import OneShape, ShapeFitter, shapes_of
from manipose_mj.control.perception.pose_sensing import (
    MIN_VIEW_POINTS,
    EstimatedPose,
    Estimator,
    EstimatorOfViews,
    SensedPose,
    agree,
    random_keys,
    sense_pose,
    weighed,
)
from manipose_mj.control.perception.source_names import TOLD_OF_KINDS, GraspSource
from manipose_mj.control.perception.worlds import SimulatedWorld, World
from manipose_mj.control.scene.collision_model import subtree_geoms
from manipose_mj.control.scene.planning_scene import PlanningScene
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.failures import StageFailure
from manipose_mj.poses import invert, transform
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.goals import TakenOutGoal

_SURE = 0.6  # confidence from which on an estimate is kept for as long as it fits what is seen
_TRUSTED = 0.8  # confidence under which all cameras are asked before an estimate is used
_FITS = (1.25, 0.0005)  # misfit allowed later, of the first: a factor, and so much more [m]
_MORE = 1.5  # times the points that a shape was found by, from which on it is found anew
_BETTER = 0.9  # of what is left of the weighed misfit, for another pose to replace it
_IN_HAND = (0.03, 0.5)  # how far what fingers hold may be from where they should have it [m, rad]


class EstimatedPerception:
    """Estimates poses from views, compares them with every new view, follows the hand."""

    def __init__(
        self,
        task: ManipulationTask,
        physics: mjcf.Physics,
        world: World | None = None,
        *,
        estimators: Callable[[ObjectKind], Estimator | EstimatorOfViews] | None = None,
        meshes: Callable[[Asset], Mapping[str, np.ndarray]] | None = None,
        grasps: GraspSource = "cloud",
    ) -> None:
        """Compiles nothing yet.

        Args:
          task: Of an environment whose sensors are `SENSORS`, or others; it looks through all of their cameras,
            through `SPARE_CAMERAS` and those over the shoulders where it has to.
          physics: The environment's.
          world: Furniture and surroundings; those of the simulator by default.
          estimators: The estimator of a kind; by default `FusedViewEstimator` of those in the catalogue,
            `PoseEstimator` of others.
          meshes: The mesh of an object, if estimators are given it; planning never sees it.
          grasps: Where grasps come from.
        """
        self._task, self._physics = task, physics
        self._load = estimators or shipped_estimator
        self._meshes = meshes
        self._world = world or SimulatedWorld(task, physics)
        self.feels_joints = self._world.feels_joints
        self._grasp_source: GraspSource = grasps
        sensors = task.env_config.sensors
        names = standing_cameras(sensors)
        every = tuple(name for name in names if name not in FRONT_CAMERAS) or names
        usual = tuple(name for name in every if name not in SPARE_CAMERAS) or every
        self._views = ObjectViews(task.task_observables, usual)
        self._more_views = ObjectViews(task.task_observables, names)
        self.looks_by_hand = HAND_CAMERA in sensors.camera_names
        self._close_views = ObjectViews(task.task_observables, sensors.camera_names)
        self._sights = SceneViews(task.task_observables, usual)
        self._colours = SeenColours(lambda name: self._more_views.of(physics, name))
        self._known: dict[str, SensedPose] = {}
        self._grasps: dict[str, Callable[..., GraspSet]] = {}
        self._held: InHand | None = None
        self._seen: dict[str, SensedPose] = {}  # where what is known showed last
        self._lost: set[str] = set()  # what was not where the hand should have it
        self._dropped: set[str] = set()  # what lies otherwise than its grasps were made for
        self._time = self._looked = -1.0
        self._keys = random_keys(0)
        self.sources: Mapping[str, str] = {
            "objects": "estimated",
            "kinds": TOLD_OF_KINDS,
            "furniture": self._world.source,
        }
        self.last_estimates: tuple[EstimatedPose, ...] = ()

    def reset(self, seed: int, *, for_goals: bool = True) -> None:
        """Estimate every object of an episode, and build a scene of what is seen.

        Raises:
          StageFailure: An object that a goal is about is not seen, nor is anything that may hide it; only `for_goals`.
          InputError: There are no weights for a category or its type.
        """
        self._keys = random_keys(seed)
        self._held, self._dropped, self._lost = None, set(), set()
        self._known, self._seen, self._grasps = {}, {}, {}
        self._colours.forget()
        for kind in kinds_of(self._task.objects).values():
            self._load(kind)  # what has no weights is told before anything is built
        self._world.reset(self._keys())
        self._find_objects()
        among_others = in_the_open(self._task.goals) and not self._task.furniture_masks
        hidden = self._known and among_others  # what hides them can be moved off
        if for_goals and self._covered and not hidden:
            raise StageFailure("perception", f"no camera sees enough of {min(self._covered)}")
        self._time = self._looked = float(self._physics.data.time)
        self._build()

    @property
    def arm(self) -> ArmModel:
        """The arm among what is known."""
        return self._world.arm

    @property
    def unseen(self) -> frozenset[str]:
        """Objects of goals that no camera has seen yet."""
        return frozenset(self._needed - self._known.keys())

    @property
    def _covered(self) -> frozenset[str]:
        """Those of them that no furniture hides."""
        return self.unseen - self._enclosed

    @property
    def _enclosed(self) -> frozenset[str]:
        """Objects that a goal has taken out of furniture."""
        return frozenset(g.object for g in self._task.goals if isinstance(g, TakenOutGoal))

    @property
    def _uncertain(self) -> tuple[str, ...]:
        """What is estimated with a confidence that does not last, and not in the hand."""
        known = self._known.items()
        return tuple(n for n, s in known if s.confidence < _SURE and n != self.held_name)

    @property
    def _outgrown(self) -> tuple[str, ...]:
        """What goals are about, sure, not in the hand, and seen by many more points than its shape was found by."""
        asked = (self._needed & self._known.keys()) - {self.held_name, *self._uncertain}
        counts = {n: sum(map(len, self._views.of(self._physics, n))) for n in sorted(asked)}
        return tuple(n for n, count in counts.items() if count > _MORE * self._known[n].points)

    def look_around(self) -> None:
        """Between two plans: look for what goals are about and others may have hidden, anew at what is uncertain, and
        at what goals are about and shows more of itself than when its shape was found."""
        now = float(self._physics.data.time)
        # What furniture hides and the hand has lost may lie otherwise now: furniture is looked into again.
        forgotten = (self._lost & self._enclosed & self._known.keys()) - {self.held_name}
        for name in forgotten:
            del self._known[name]
        self._dropped, self._lost = self._dropped - forgotten, set()
        again = () if now == self._looked else (*self._uncertain, *self._outgrown)
        if not (self._covered or again or forgotten):
            return
        self.observe()
        self._looked, before = now, dict(self._known)
        for name in again:
            known, sensed = self._known[name], self._looked_at(name)
            if sensed is None:
                continue
            outgrown = sensed.confidence >= _SURE and sensed.points > _MORE * known.points
            if outgrown or sensed.confidence > known.confidence:
                self._known[name] = sensed
                self._grasps.pop(name)
        self._find_objects()
        if forgotten or any(s is not before.get(name) for name, s in self._known.items()):
            self._build()

    def look_again(self) -> None:
        """After something was opened: measure it, and look for what it hid."""
        self.observe()  # where parts and objects are by now
        self._world.look_again(self._keys())
        self._find_objects()
        self._build()

    def look_closely(self) -> None:
        """Estimate what goals have taken out of furniture by what the hand's camera sees, besides all others."""
        self.observe()
        for name in sorted(self._enclosed):
            sensed = self._looked_at(name, self._close_views)
            if sensed is not None:
                self._known[name] = self._seen[name] = sensed
                self._grasps[name] = self._grasps_of(name, self._close_views)
            elif name in self._seen:
                self._known.setdefault(name, self._seen[name])  # what was forgotten shows no better
        self._build()

    @property
    def _needed(self) -> set[str]:
        names = (getattr(goal, "object", None) for goal in self._task.goals)
        return {name for name in names if name is not None}

    def _find_objects(self) -> None:
        """Estimate what is seen for the first time."""
        for name in kinds_of(self._task.objects):
            sensed = None if name in self._known else self._looked_at(name)
            if sensed is not None:
                self._known[name] = sensed
                self._grasps.pop(name, None)

    def _looked_at(self, name: str, more: ObjectViews | None = None) -> SensedPose | None:
        """The estimate of what may have any shape of its kind; by `more` views, of all standing cameras, if need be."""
        more = more or self._more_views
        kind, views = kinds_of(self._task.objects)[name], self._views.of(self._physics, name)
        sensed = self._sensed(name, views, shapes_of(kind), more)
        return sensed and sensed_if_flat(kind, sensed, views or more.of(self._physics, name))

    def _build(self) -> None:
        for name in self._known:
            if name not in self._grasps:
                self._grasps[name] = self._grasps_of(name)
                self._seen[name] = self._known[name]
        self._world.build({name: sensed.shape.hulls for name, sensed in self._known.items()})

    def robot(self) -> tuple[Float[np.ndarray, "7"], float]:
        """Joint angles [rad] and opening [m]."""
        return self._task.robot.configuration(self._physics)

    def observe(self) -> SceneEstimate:
        """Estimates of the scene as it is now."""
        joints, opening = self.robot()
        time = float(self._physics.data.time)
        if time != self._time:
            tcp = self._planning_scene().tcp_pose(joints)
            moved = self._world.follow(tcp, {n: s.pose for n, s in self._known.items()})
            for name in moved.keys() - {self.held_name}:  # what lies in drawers, seen or not
                self._known[name] = self._seen[name] = replace(self._known[name], pose=moved[name])
            for name in self._known:
                self._known[name] = self._updated(name, tcp)
            for name in self._dropped - {self.held_name}:
                self._grasps[name] = self._grasps_of(name)
                self._dropped.remove(name)
            self._time = time
        scene = self._planning_scene()
        objects = {n: self._estimate(n, sensed, scene) for n, sensed in self._known.items()}
        parts = self._world.parts(scene, objects)
        self.last_estimates = tuple(s.reported(name) for name, s in self._known.items())
        unseen = {n: kinds_of(self._task.objects)[n].category for n in sorted(self.unseen)}
        return SceneEstimate(joints, opening, objects, parts, scene, unseen)

    def hold(self, name: str | None) -> None:
        """From now on the hand holds this, as it was seen last; None: it holds nothing."""
        self._held = None
        tcp = self._planning_scene().tcp_pose(self.robot()[0])
        self._world.hold(name, tcp)
        if name in self._known:
            self._held = InHand(name, invert(tcp) @ self._known[name].pose, self.robot()[1])

    @property
    def held_name(self) -> str:
        """The object in the hand; empty: none that was seen."""
        return "" if self._held is None else self._held.name

    def feel(self, name: str, path: Float[np.ndarray, "n 4 4"], stopped: bool) -> None:
        """The hand led a part along this path, by `T_world_tcp`; `stopped`: it went no further."""
        self._world.feel(name, path, stopped)

    def pushed(self, name: str, opening: float) -> None:
        """The hand pushed a part to about this opening [m or rad]."""
        self._world.pushed(name, opening)

    def _planning_scene(self) -> PlanningScene:
        """The scene as the latest estimates have it."""
        poses = {name: sensed.pose for name, sensed in self._known.items()}
        return self._world.observed(*self.robot(), poses)

    def _updated(self, name: str, tcp: Float[np.ndarray, "4 4"]) -> SensedPose:
        """The pose of an object now: where it was, or the hand has brought it, if new views fit that; else as they show."""
        before = self._known[name]
        held = self._held if self.held_name == name else None
        if held is not None:
            before = replace(before, pose=tcp @ held.pose_tcp)
        views = self._views.of(self._physics, name)
        if sum(len(view) for view in views) < MIN_VIEW_POINTS:
            if not is_gone(before, self._seen[name], lambda: self._sights.sights(self._physics)):
                return before
            self._lost.add(name)
            return self._seen[name]
        misfit = before.shape.misfit(transform(invert(before.pose), seen_points(views)))
        if misfit <= _FITS[0] * before.misfit + _FITS[1] and before.confidence >= _SURE:
            self._seen[name] = before
            return before
        sensed = self._sensed(name, views, OneShape(before.shape))
        if sensed is None:
            return before
        if weighed(sensed.misfit, sensed.confidence) > _BETTER * weighed(misfit, before.confidence):
            return before
        jumped = held is not None and not agree(sensed, before, _IN_HAND)
        if held is not None and jumped and not held.may_be_lost(self.robot()[1]):
            return before
        sensed = replace(sensed, points=before.points)  # the shape is the old one
        if held is not None:
            self._held = replace(held, pose_tcp=invert(tcp) @ sensed.pose)
            if jumped:
                self._dropped.add(name)
        self._seen[name] = sensed
        return sensed

    def _sensed(
        self,
        name: str,
        views: tuple[ObjectView, ...],
        shapes: ShapeFitter,
        more: ObjectViews | None = None,
    ) -> SensedPose | None:
        """From these views; from more, if there are, where these leave an object uncertain, are of one side of it, or walls
        hide the same part of it from them."""
        estimator, sensed = self._load(kinds_of(self._task.objects)[name]), None
        if more is None or name not in self._enclosed:
            sensed = sense_pose(estimator, self._with_mesh(name, views), shapes, self._keys)
        one_side = len(views) < 2
        trusted = sensed is not None and sensed.confidence >= _TRUSTED
        if more is None or (trusted and not one_side):
            return sensed
        views = more.of(self._physics, name)
        second = sense_pose(estimator, self._with_mesh(name, views), shapes, self._keys)
        if sensed is None or second is None:
            return second or sensed
        if one_side and second.confidence >= _TRUSTED:
            return second
        return second if second.confidence > sensed.confidence else sensed

    def _grasps_of(self, name: str, by: ObjectViews | None = None) -> Callable[..., GraspSet]:
        """Samples grasps of what is seen now, for the pose estimated and those that goals ask for; once, when asked to."""
        sensed = self._known[name]
        symmetries = {each: other.shape.label.symmetry for each, other in self._known.items()}
        rotations = asked_rotations(self._task.goals, name, symmetries)
        views = (by or self._views).of(self._physics, name)
        views, objects = views or self._more_views.of(self._physics, name), self._task.objects

        @cache
        def sample(count: int = COUNT) -> GraspSet:
            return sensed_grasps(
                self._grasp_source, sensed, views, rotations, lambda: objects[name].asset, count
            )

        return sample

    def _with_mesh(self, name: str, views: tuple[ObjectView, ...]) -> tuple[ObjectView, ...]:
        """The views as estimators get them: with the object's mesh, if they are given it."""
        if self._meshes is None:
            return views
        mesh = self._meshes(self._task.objects[name].asset)
        return tuple(replace(view, mesh=mesh) for view in views)

    def _estimate(self, name: str, sensed: SensedPose, scene: PlanningScene) -> ObjectEstimate:
        body, kind = self._world.body(name), kinds_of(self._task.objects)[name]
        found = ObjectEstimate(
            name=name,
            pose=sensed.pose,
            label=sensed.shape.label,
            sample_grasps=self._grasps[name],
            body=body,
            geoms=subtree_geoms(scene.model, body),
            rests=sensed.shape.rests,
            category=kind.category,
            find_colours=partial(self._colours.of, name),
            uncertainty=sensed.misfit if self._grasp_source == "cloud" else 0.0,
            guessed_frame=not kind.in_catalogue
            or kind.object_type != sensed.shape.label.object_type,
        )
        if self._grasp_source == "cloud":
            found = replace(found, sample_more=partial(self._grasps[name], MANY))
        return as_unsure_as_deep(found, self._task.goals, scene)
