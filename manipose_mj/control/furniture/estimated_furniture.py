"""The furniture of an episode as cameras and the hand know it: found, followed, measured once it is open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dm_control import mjcf
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from manipose_mj.assets.geometry import Joint
from manipose_mj.control.furniture.fit.door_hinge import is_level, usual_swing
from manipose_mj.control.furniture.fit.furniture_fit import fit_furniture
from manipose_mj.control.furniture.joint_fit import fitted_joint, gone_along, opening_of, points_of
from manipose_mj.control.furniture.named_parts import handle_of, named
from manipose_mj.control.furniture.opened_part import reaching_unseen, seen_open, with_extra
from manipose_mj.control.furniture.opening_search import Hidden, as_held, found_opening, misfit
from manipose_mj.control.furniture.pulled_out import as_it_moved, pulled_out
from manipose_mj.control.furniture.sensing.part_sensing import PartSensor, SensedFurniture
from manipose_mj.control.furniture.sensing.scene_cloud import (
    SceneCloud,
    SceneViews,
    hidden_from,
    seen_past,
)
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.control.furniture.stops import Stops, Swings
from manipose_mj.control.furniture.swung_out import (
    OpenDoor,
    as_large_as,
    as_seen_open,
    open_door_of,
    swung_out,
    with_open_door,
)
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, PartEstimate
from manipose_mj.errors import InputError
from manipose_mj.failures import StageFailure
from manipose_mj.poses import invert, transform
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.goals import OpenGoal, ShutGoal
from manipose_mj.tasks.instructions.sentence import asked_parts

_LEAST_POINTS = 1500  # of furniture that is looked at
_LONG_ARC = 0.5  # of a hinge, from which on the hand knows it better than clouds do [rad]
# Of the usual range of a door, from which on nobody knows how far it opens: where no stop was felt, its share; where one
# was, how far beyond [rad].
_NEAR_END, _BEYOND = 0.9, 0.02
_NEAR = 0.35  # of a part's handle: the hand may have moved the part [m]


@dataclass(frozen=True)
class _Held:
    """Attributes: name; start: where the point of the hand that goes with the part is, in the object frame with the
    part shut `(3,)` [m]; offset: of that point in the hand `(3,)` [m]."""

    name: str
    start: Float[np.ndarray, "3"]
    offset: Float[np.ndarray, "3"]


class EstimatedFurniture:
    """One piece of furniture, from clouds, its instance mask and its category."""

    def __init__(
        self,
        task: ManipulationTask,
        physics: mjcf.Physics,
        views: SceneViews,
        front_cameras: tuple[str, ...],
        sense: PartSensor,
    ) -> None:
        """Looks at nothing yet.

        Args:
          task: Says which furniture there is, by category and mask, and what an instruction calls its parts.
          physics: That the sensors measure.
          views: Of all cameras.
          front_cameras: Those that see what the robot faces, the highest first.
          sense: Finds handles and joints.
        """
        self._task, self._physics, self._views = task, physics, views
        self._front_cameras, self._sense = front_cameras, sense
        self.model: FurnitureModel | None = None
        self._mask = 0
        self._held: _Held | None = None
        self._moved: dict[str, bool] = {}  # parts that may have; whether the hand touched them
        self._stops, self._swings = Stops(), Swings()
        # Hinges that an open panel or a long arc of the hand has shown.
        self._sure: dict[str, Joint] = {}
        # Openings of parts that were pushed, or that the hand slipped off, and not looked at since.
        self._before: dict[str, float] = {}

    def reset(self, key: Any) -> None:
        """Look at the furniture of the episode.

        Raises:
          StageFailure: No part is found that a goal could mean.
        """
        self.model, self._held, self._moved, self._before, self._sure = None, None, {}, {}, {}
        self._stops, self._swings = Stops(), Swings()
        for category, mask in self._task.furniture_masks:
            self._mask = mask
            seen = self._cloud(self._front_cameras)
            if len(seen.points) < _LEAST_POINTS:
                raise StageFailure("perception", f"no camera sees enough of the {category}")
            pose = self._views.camera_pose(self._physics, self._front_cameras[0])
            cloud, asked = self._cloud(), asked_parts(self._task)
            whole = cloud.joined_by(self._cloud(self._views.wide))
            found: list[tuple[SensedFurniture, FurnitureModel]] = []
            # Through all cameras as well where what stands open did not show.
            for each in (seen, cloud):
                try:
                    sensed = self._sense(each, pose, key)
                except InputError as error:
                    raise StageFailure("perception", f"{category}: {error}") from None
                model = fit_furniture(whole, sensed, category)
                found.append((sensed, named(model, asked, self._expected_open)))
                if not self._looks_shut(found[-1][1]):
                    break
            else:
                found.reverse()
            model = self._with_open_parts(*found[-1], whole, asked)
            for part in model.parts if self._parts_alone else ():
                model = model.with_part(with_extra(model, part, whole))
            self.model = model

    def _looks_shut(self, model: FurnitureModel) -> list[str]:
        """Of the parts that should stand open, those that do not."""
        openings = {part.name: part.opening for part in model.parts}
        return [name for name in sorted(self._expected_open) if openings[name] == 0.0]

    def _with_open_parts(
        self,
        sensed: SensedFurniture,
        model: FurnitureModel,
        cloud: SceneCloud,
        asked: Mapping[str, str],
    ) -> FurnitureModel:
        """With what should stand open as a front or a door stands out of the body."""
        shut = self._looks_shut(model)
        for name in sorted(self._expected_open):
            if "drawer" in asked.get(name, "").split():
                model = (pulled_out(model, cloud, name) if name in shut else None) or model
            elif (found := open_door_of(cloud, sensed, model)) is not None:
                door = found[1]
                sensed = with_open_door(*found)
                model = fit_furniture(cloud, sensed, model.category)
                model = named(model, asked, self._expected_open)
                part = next(part for part in model.parts if part.name == name)
                if part.opening > 0.0:
                    self._sure[name] = part.part.joint
                    if self._is_of(door, part, model.pose):
                        past = seen_past(self._views.sights(self._physics), model.pose)
                        large = reaching_unseen(model, as_large_as(part, door), cloud, past)
                        model = model.with_part(large)
        return model

    @property
    def _expected_open(self) -> frozenset[str]:
        """Parts that shall be shut, and not opened before: they stand open."""
        goals = self._task.goals
        others = {getattr(goal, "part", None) for goal in goals if not isinstance(goal, ShutGoal)}
        return frozenset(
            goal.part for goal in goals if isinstance(goal, ShutGoal) and goal.part not in others
        )

    def part_poses(self) -> dict[str, Float[np.ndarray, "4 4"]]:
        """`T_world_part` of all parts."""
        model = self.model
        if model is None:
            return {}
        return {part.name: model.pose @ part.motion(part.opening) for part in model.parts}

    def parts(
        self,
        bodies: Mapping[str, int],
        geoms: Mapping[str, Bool[np.ndarray, "ngeom"]],
        objects: Mapping[str, ObjectEstimate],
        carried: Mapping[str, tuple[int, ...]],
    ) -> dict[str, PartEstimate]:
        """What planners know of the parts.

        Args:
          bodies: In the planning scene, by the parts' names.
          geoms: Likewise.
          objects: Some may lie in a drawer.
          carried: Bodies of what else was seen on parts, likewise.
        """
        model = self.model
        if model is None:
            return {}
        return {
            part.name: PartEstimate(
                name=part.name,
                base_pose=model.pose,
                pose=model.pose @ part.motion(part.opening),
                opening=part.opening,
                joint=part.part.joint,
                handle=handle_of(part),
                cavity=part.part.cavity,
                body=bodies[part.name],
                geoms=geoms[part.name],
                bodies_inside=(*_inside(model, part, objects), *carried.get(part.name, ())),
                cavity_seen=part.seen_inside,
                goes_on=self._swings.goes_on(part.name),
            )
            for part in model.parts
        }

    def hold(self, name: str | None, tcp_pose: Float[np.ndarray, "4 4"]) -> None:
        """The hand holds this from now on."""
        part = self._part(name)
        if self._held is not None:
            self._moved[self._held.name] = True
        self._held = None
        if part is not None and self.model is not None:
            place = transform(invert(self.model.pose), tcp_pose[None, :3, 3])
            part = as_held(part, place[0])
            start = transform(invert(part.motion(part.opening)), place)[0]
            self.model = self.model.with_part(part)
            self._held = _Held(part.name, start, np.zeros(3))

    def follow(self, tcp_pose: Float[np.ndarray, "4 4"]) -> None:
        """Find out how far parts are open now, through the cameras that see their fronts: images take time."""
        model = self.model
        if model is None:
            return
        if self._held is not None:
            part = self._part(self._held.name)
            assert part is not None
            now = points_of((invert(model.pose) @ tcp_pose)[None], self._held.offset)[0]
            opening = opening_of(part.part.joint, self._held.start, now, part.opening)
            self.model = model.with_part(part.at(opening))
            return
        suspected = [part for part in model.parts if self._may_have_moved(part, tcp_pose)]
        if suspected:
            points, hidden = self._seen_in_front()
            tree = cKDTree(points)
            for part in suspected:
                before = self._before.pop(part.name, None)
                handled = self._moved.get(part.name, False)
                part = as_it_moved(part, points) if handled else part
                opening = found_opening(part, points, hidden, before, tree=tree, touched=handled)
                known = part.part.joint.range[1]
                if self._shall_open_wide(part):
                    known = self._swings.end(part.name, opening, known)
                part = part.at(opening).opening_to(known)
                self.model = self.model.with_part(part) if self.model else None
        # Looked at again until the hand is gone.
        near = [part.name for part in suspected if self._near(part, tcp_pose)]
        self._moved = {name: self._moved.get(name, False) for name in near}

    def feel(self, name: str, path: Float[np.ndarray, "n 4 4"], stopped: bool) -> None:
        """Correct a joint by the way the hand went with the part; where it stopped, it goes no further.

        Args:
          name: Of the part.
          path: `T_world_tcp` of the hand that held its handle.
          stopped: Whether the part went no further.
        """
        model, part, held = self.model, self._part(name), self._held
        if model is None or part is None or held is None:
            return
        own = invert(model.pose) @ path
        began = points_of(own[:1], held.offset)[0]
        started = opening_of(part.part.joint, held.start, began, part.opening)
        known = self._sure.get(name)
        fitted = fitted_joint(known or part.part.joint, own, sure=known is not None)
        joint, went = fitted.joint, points_of(own, fitted.offset)
        gone = gone_along(joint, went)
        opening = started + gone
        if joint.kind == "hinge" and abs(gone) > _LONG_ARC and not stopped:
            self._sure[name] = joint
        if stopped:
            self._before[name] = started  # a hand that slips goes on without the part
        low, high = part.part.joint.range
        turned = is_level(joint.axis) != is_level(part.part.joint.axis)
        if joint.kind == "hinge" and turned:
            # What was taken for a flap goes as a door does, or the other way round.
            high = usual_swing(joint.axis, model.category)
        ends = stopped and self._stops.is_end(name, joint.kind, opening, high)
        end = opening if ends else max(high, opening)
        if self._shall_open_wide(part):
            usual = usual_swing(joint.axis, model.category)
            # A hand that stops beyond what is usual may have come to its own end. Flaps end where they are level.
            sure_end = stopped or is_level(joint.axis)
            if opening > (usual + _BEYOND if sure_end else _NEAR_END * usual):
                end = self._swings.led(name, opening, usual)
        joint = replace(joint, range=(low, end))
        moved = replace(part, part=replace(part.part, joint=joint), opening=opening)
        # Where the hand would be were the part shut, by the joint as it is known now.
        back = invert(moved.motion(opening))
        self._held = _Held(name, transform(back, went[-1:])[0], fitted.offset)
        self.model = model.with_part(moved)

    def pushed(self, name: str, opening: float) -> None:
        """The hand pushed a part to about this opening [m or rad]; no further than it was open: that is its end, as far as anybody can tell."""
        part = self._part(name)
        stayed = part is not None and opening == part.opening > part.part.joint.range[0]
        if part is not None and self.model is not None and stayed:
            self._swings.ends(name)
            self.model = self.model.with_part(part.opening_to(opening))
        elif part is not None and self.model is not None:
            self._before[name] = part.opening
            self._swings.pushed(name, opening)
            self.model = self.model.with_part(part.at(max(opening, 0.0)))
            self._moved[name] = True

    def look_again(self) -> None:
        """Measure panels and cavities of what stands open."""
        model = self.model
        if model is None:
            return
        cloud = self._cloud()
        points, asked = transform(invert(model.pose), cloud.points), asked_parts(self._task)
        sights = self._views.sights(self._physics)
        hidden, past = hidden_from(sights, model.pose), seen_past(sights, model.pose)
        doors = [part for part in model.parts if part.opening > 0.0 and part.hinged]
        door = swung_out(model, cloud) if doors else None
        for part in model.parts:
            if part.opening > 0.0:
                found = part.at(found_opening(part, points, hidden))
                if door is not None and part.hinged and self._is_of(door, part, model.pose):
                    panel = as_seen_open(part, door, model.pose)
                    panel = panel.at(found_opening(panel, points, hidden))
                    # What the hand felt may be better: a pane behind its frame looks turned.
                    if misfit(panel, points, hidden) < misfit(found, points, hidden):
                        found = panel
                        self._sure[part.name] = panel.part.joint
                # What does not show stays as it is usual: nobody need look again.
                opened = replace(seen_open(model, found, cloud, past), seen_inside=True)
                if part.hinged:
                    if door is not None and self._is_of(door, part, model.pose):
                        opened = as_large_as(opened, door)
                    opened = reaching_unseen(model, opened, cloud, past)
                    opened = with_extra(model, opened, cloud) if self._parts_alone else opened
                model = model.with_part(opened).without_fronts_over(opened, asked)
        self.model = model

    @property
    def _parts_alone(self) -> bool:
        """Whether nothing is put in or taken out: hands that do come too near to doors to heed every point on them."""
        return all(isinstance(goal, OpenGoal | ShutGoal) for goal in self._task.goals)

    def _shall_open_wide(self, part: PartModel) -> bool:
        """Whether it is a door that shall be open as far as it goes."""
        goals = self._task.goals
        return part.hinged and any(
            isinstance(goal, OpenGoal) and goal.part == part.name for goal in goals
        )

    @staticmethod
    def _is_of(door: OpenDoor, part: PartModel, pose: Float[np.ndarray, "4 4"]) -> bool:
        """Whether a door that stands open is this part: it carries its handle; `pose` is `T_world_object`."""
        handle = pose @ part.motion(part.opening) @ handle_of(part).pose
        return door.carries(handle[:3, 3])

    def _part(self, name: str | None) -> PartModel | None:
        parts = () if self.model is None else self.model.parts
        return next((part for part in parts if part.name == name), None)

    def _may_have_moved(self, part: PartModel, tcp_pose: Float[np.ndarray, "4 4"]) -> bool:
        return part.name in self._moved or self._near(part, tcp_pose)

    def _near(self, part: PartModel, tcp_pose: Float[np.ndarray, "4 4"]) -> bool:
        assert self.model is not None
        handle = self.model.pose @ part.motion(part.opening) @ handle_of(part).pose
        return float(np.linalg.norm(handle[:3, 3] - tcp_pose[:3, 3])) < _NEAR

    def _cloud(self, cameras: tuple[str, ...] | None = None) -> SceneCloud:
        return self._views.cloud(self._physics, self._mask, cameras=cameras)

    def _seen_in_front(self) -> tuple[Float[np.ndarray, "n 3"], Hidden]:
        """Points of the furniture now, object frame [m]; and which points there no front camera can see."""
        assert self.model is not None
        cameras, pose = self._front_cameras, self.model.pose
        cloud = self._views.cloud(self._physics, self._mask, cameras=cameras, normals=False)
        hidden = hidden_from(self._views.sights(self._physics, cameras), pose)
        return transform(invert(pose), cloud.points), hidden


def _inside(
    model: FurnitureModel, part: PartModel, objects: Mapping[str, ObjectEstimate]
) -> tuple[int, ...]:
    """Bodies of the objects in a drawer's cavity."""
    cavity = part.part.cavity
    if cavity is None or not cavity.moves_with_part:
        return ()
    to_part = invert(model.pose @ part.motion(part.opening))
    return tuple(
        obj.body
        for obj in objects.values()
        if (
            np.abs((to_part @ obj.label_pose)[:3, 3] - cavity.center) < cavity.extents / 2 + 0.01
        ).all()
    )
