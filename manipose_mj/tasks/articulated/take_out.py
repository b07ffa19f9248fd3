"""`articulated/take_out_*`: open a drawer or door, bring an object out onto the table, shut it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dm_control import mjcf

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.mjcf.markers.goal_area import GoalArea
from manipose_mj.poses import compose, invert
from manipose_mj.tasks.articulated.cavity_placement import MIN_GRASPS
from manipose_mj.tasks.articulated.cavity_task import CavityTask, placed_objects
from manipose_mj.tasks.articulated.part_room import cavity_of, room_at
from manipose_mj.tasks.articulated.placement import Standing
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec, TaskConfig
from manipose_mj.tasks.core.preview import Preview
from manipose_mj.tasks.core.start import EpisodeStart, NoStartError
from manipose_mj.tasks.goals import ShutGoal, TakenOutGoal

_SAME_SIDE = float(np.cos(np.radians(10)))  # between verticals, at rest and of a stable pose
_SUNK = 0.006  # below the floor of a cavity, by which bars let things sink [m]
_LEAST = MIN_GRASPS // 2  # grasps with room for the hand, once the object is at rest


@dataclass(frozen=True)
class TakeOutConfig(TaskConfig):
    """Attributes: standing: where the furniture stands; x_range, y_range: where the middle of the
    goal area may be [m], y mirrored for doors hinged on the right; area: half its sides [m];
    front: how far from the cavity's open side the object may lie [m]; room: between it and the
    walls, where there is that much, and other objects [m]; max_fillers: how many other
    objects may lie in the cavity; shut: by which fraction of its range a door must be shut in the
    end; None: to within the tolerance, as a drawer."""

    horizon: float = 90.0
    standing: Standing = Standing(objects=True)
    x_range: tuple[float, float] = (0.36, 0.46)
    y_range: tuple[float, float] = (-0.40, -0.30)
    area: tuple[float, float] = (0.08, 0.08)
    front: float = 0.02
    room: float = 0.035
    max_fillers: int = 0
    shut: float | None = None


class TakeOut(CavityTask):
    """Open the part, take the object out, set it down in the marked area, shut the part.

    Success: the object is out of the cavity, rests on the table in the goal area, released, and the
    part is shut.
    """

    def __init__(
        self,
        objects: Sequence[Asset],
        furniture: Asset,
        part: MovingPart,
        env_config: EnvConfig,
        config: TakeOutConfig | None = None,
    ) -> None:
        """Raises InputError where an object does not fit the cavity of the part."""
        self.task_config = config or TakeOutConfig()
        super().__init__(
            objects,
            furniture,
            part,
            self.task_config,
            env_config,
            standing=self.task_config.standing,
            max_fillers=self.task_config.max_fillers,
            taken=True,
        )
        self.scene.add_fixture("goal", GoalArea(half_sides=self.task_config.area))

    @property
    def observed_goals(self) -> tuple[str, ...]:
        return ("goal",)

    def write(self, physics: mjcf.Physics, start: EpisodeStart) -> None:
        """Put a simulation where an episode starts.

        Raises:
          NoStartError: An object does not come to rest, or at rest the one in question cannot be had any more: some
            fall over on an oven's grid, spoons roll.
        """
        super().write(physics, start)
        entity, piece = self.objects["object"], self.furniture.asset.name
        pose = entity.object_pose(physics)
        alike = [float(rest.rotation[2] @ pose[2, :3]) for rest in entity.asset.stable_poses]
        if max(alike) < _SAME_SIDE:
            raise NoStartError(f"{entity.asset.name} fell over in {piece}")
        cavity, stable = self.cavity_pose(physics), int(np.argmax(alike))
        at, room = invert(cavity) @ pose, cavity_of(self.part).extents
        if at[2, 3] < entity.asset.stable_poses[stable].height - room[2] / 2 - _SUNK:
            raise NoStartError(f"{entity.asset.name} fell through the grid of {piece}")
        towards = self.placement.towards
        hands = room_at(entity.asset, self.part, stable, at, cavity_world=cavity, towards=towards)
        if hands < _LEAST:
            raise NoStartError(
                f"{entity.asset.name} came to rest in {piece} where no hand gets at it"
            )

    def sample(
        self, rng: np.random.RandomState, spec: EpisodeSpec, preview: Preview
    ) -> EpisodeStart:
        config = self.task_config
        furniture, mount = self.pieces.sample(rng, 0)
        center = self.sample_place(rng, config.x_range, config.y_range)
        cavity = self.cavity_of(preview, furniture)
        own = self.placement.inside(rng, front=config.front, room=config.room, cavity_world=cavity)
        if own.hands < MIN_GRASPS:
            raise NoStartError(
                f"{self.pool.entities[0].asset.name} lies in {self.furniture.asset.name} where {own.hands} of its "
                f"grasps leave the hand room; expected {MIN_GRASPS}"
            )
        fillers = self.sample_fillers(rng, own)
        part = self.part.name
        assert self.part.cavity is not None
        inside = own.lying.pose(self.part.cavity, own.place)
        return EpisodeStart(
            goals=(
                TakenOutGoal("object", part, center, np.array(config.area)),
                ShutGoal(part, config.shut),
            ),
            objects=placed_objects(cavity @ inside, fillers, cavity),
            furniture=(furniture,),
            mount=mount,
            # The middle of the goal area, Z up.
            fixtures={"goal": compose(np.eye(3), np.array([*center, 0.0]))},
        )
