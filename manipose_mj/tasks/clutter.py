"""What the clutter tasks share: a settled pile somewhere on the table, targets in it, goals beside it."""

from __future__ import annotations

import abc
from dataclasses import dataclass, field
from math import radians

import numpy as np
from dm_control import mjcf
from jaxtyping import Float

from asset_pipeline.assets import Asset
from manipose_mj.errors import InputError
from manipose_mj.mjcf.goal_marker import GoalMarker
from manipose_mj.mjcf.objects import RigidObject
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.goals import Goal, PoseGoal
from manipose_mj.tasks.object_pool import ObjectPool
from manipose_mj.tasks.options import TaskConfig, TaskOptions
from manipose_mj.tasks.pile import Pile
from manipose_mj.tasks.pile_cache import PileCache
from manipose_mj.tasks.pile_layout import PileConfig
from manipose_mj.tasks.pile_scene import (
    IMPRATIO,
    NOSLIP_ITERATIONS,
    PILE_CONTACT_TIME,
    PILE_TIMESTEP,
)
from manipose_mj.tasks.resting import pose_on_table, require_graspable

TARGET_NAMES = ("object", "object_second", "object_third")
_UP = np.array([0.0, 0.0, 1.0])
_DRAWS = 60  # of a pile and its place, before a reset gives up
_SLEEP_SPEED = 1e-3  # under which an island of touching things falls asleep [m/s]
_PLACES = 200  # drawn for a goal before the pile is drawn anew
_HIDDEN = compose(np.eye(3), np.array([0.0, 0.0, 60.0]))


@dataclass(frozen=True)
class ClutterConfig(TaskConfig):
    """Attributes: pile: how piles are dropped; piles: how many different ones there are; pile_x: where
    the middle of the pile may be, along x [m]; pile_y: how far from the table's middle line, to
    either side [m]; goal_x, goal_y: the same of goals, on the other side of that line [m];
    room: between a goal and everything else, for the hand [m]; targets: least and largest number;
    min_free: grasps a target must have that are free in the pile and clear of the table at the goal;
    max_turn: of a target's vertical between pile and goal [rad]."""

    horizon: float = 90.0
    pile: PileConfig = field(default_factory=PileConfig)
    piles: int = 16
    pile_x: tuple[float, float] = (0.47, 0.55)
    pile_y: tuple[float, float] = (0.12, 0.18)
    goal_x: tuple[float, float] = (0.36, 0.60)
    goal_y: tuple[float, float] = (0.10, 0.42)
    room: float = 0.05
    targets: tuple[int, int] = (1, 1)
    min_free: int = 2
    max_turn: float = radians(100)


class Clutter(ManipulationTask):
    """A pile and goals beside it. A subclass says which objects of a pile may be the targets.

    Physics as in the other tasks, but in steps half as long, with contacts twice as stiff; and friction
    is held by a stiffer constraint instead of the no-slip solver, for speed.

    Attributes:
      buried: Whether others may have to be moved before the target can be taken.
    """

    buried = False

    def __init__(
        self, assets: tuple[Asset, ...], config: ClutterConfig, options: TaskOptions
    ) -> None:
        """Build the scene.

        Raises:
          InputError: There are fewer objects than a pile needs, or the gripper cannot hold one.
        """
        super().__init__(config, options)
        self.task_config = config
        least = config.pile.count[0]
        if len(assets) < least:
            raise InputError(f"a pile takes at least {least} objects; got {len(assets)}")
        for asset in assets:
            require_graspable(asset)
        self._arena.mjcf_model.option.set_attributes(
            impratio=IMPRATIO, noslip_iterations=NOSLIP_ITERATIONS, sleep_tolerance=_SLEEP_SPEED
        )
        # The native one overstates how deep cylinders reach into boxes beside them, 7 mm for 1.
        self._arena.mjcf_model.option.flag.nativeccd = "disable"
        self.physics_timestep = PILE_TIMESTEP
        self._pool = ObjectPool(assets, self._arena)
        self._stiffen_contacts()
        self._instances.update({e.mjcf_model.model: e for e in self._pool.entities})
        self._markers = [
            GoalMarker(name=f"goal_{name}") for name in TARGET_NAMES[: config.targets[1]]
        ]
        for marker in self._markers:
            self._arena.attach(marker)
        self._cache = PileCache(assets, config.pile)
        self._largest = min(len(assets), config.pile.count[1])
        # This episode's objects, targets first, by their indices in the pool; the targets' goals.
        self._used: tuple[int, ...] = tuple(range(self._largest))
        self._goal_poses: tuple[Float[np.ndarray, "4 4"], ...] = ()
        self._finish_build()

    def _stiffen_contacts(self) -> None:
        geoms = [self._arena.mjcf_model.find("geom", "table")]
        for entity in self._pool.entities:
            geoms += [g for g in entity.mjcf_model.find_all("geom") if g.solref is not None]
        for geom in geoms:
            geom.solref = [PILE_CONTACT_TIME, 1.0]

    @abc.abstractmethod
    def _choose(
        self, physics: mjcf.Physics, pile: Pile, random_state: np.random.RandomState
    ) -> tuple[int, ...]:
        """The targets, by their indices in the pile, which lies on the table; empty: another pile."""

    @property
    def goals(self) -> tuple[Goal, ...]:
        return tuple(
            PoseGoal(name, pose.copy())
            for name, pose in zip(TARGET_NAMES, self._goal_poses, strict=False)
        )

    @property
    def neighbours(self) -> tuple[str, ...]:
        """The objects of this episode that are no targets."""
        return tuple(f"clutter_{k + 1}" for k in range(len(self._used) - len(self._goal_poses)))

    @property
    def movable(self) -> dict[str, RigidObject]:
        names = (*TARGET_NAMES[: len(self._goal_poses)], *self.neighbours)
        return {
            name: self._pool.entities[index] for name, index in zip(names, self._used, strict=True)
        }

    @property
    def object_slots(self) -> tuple[str, ...]:
        low, high = self.task_config.targets
        return (*TARGET_NAMES[:high], *(f"clutter_{k + 1}" for k in range(self._largest - low)))

    @property
    def goal_slots(self) -> tuple[str, ...]:
        high = self.task_config.targets[1]
        return ("goal",) if high == 1 else tuple(f"goal_{name}" for name in TARGET_NAMES[:high])

    @property
    def object_name(self) -> str:
        return self._pool.entities[self._used[0]].asset.name

    def place_objects(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        for _ in range(_DRAWS):
            pile = self._cache.pile(int(random_state.randint(self.task_config.piles)))
            self._lay(physics, pile, random_state)
            targets = self._choose(physics, pile, random_state)
            goals = self._draw_goals(pile, targets, random_state) if targets else None
            if goals is not None:
                break
        else:
            raise InputError(
                f"{type(self).__name__}: none of {self.task_config.piles} piles of these objects has a "
                "target as the task wants it; take more objects, or smaller ones"
            )
        others = [i for i in range(len(pile.objects)) if i not in targets]
        self._used = tuple(int(pile.objects[i]) for i in (*targets, *others))
        self._goal_poses = goals
        for marker, pose in zip(self._markers, (*goals, *[_HIDDEN] * 3), strict=False):
            marker.place(physics, pose)

    def _lay(self, physics: mjcf.Physics, pile: Pile, random_state: np.random.RandomState) -> None:
        """Put the pile on the table, somewhere and turned somehow."""
        config = self.task_config
        self._side = float(random_state.choice([-1.0, 1.0]))
        self._middle = np.array(
            [
                random_state.uniform(*config.pile_x),
                self._side * random_state.uniform(*config.pile_y),
            ]
        )
        turn = rotation_about(_UP, random_state.uniform(-np.pi, np.pi))
        self._pile_pose = compose(turn, np.array([*self._middle, 0.0]))
        self._pool.use(physics, tuple(int(i) for i in pile.objects))
        for index, pose in zip(pile.objects, pile.poses, strict=True):
            self._pool.entities[int(index)].place(physics, self._pile_pose @ pose)

    def _draw_goals(
        self, pile: Pile, targets: tuple[int, ...], random_state: np.random.RandomState
    ) -> tuple[Float[np.ndarray, "4 4"], ...] | None:
        """`T_world_label` of each target's goal, clear of the pile and of each other."""
        config = self.task_config
        assets = [self._pool.entities[int(i)].asset for i in pile.objects]
        poses = self._pile_pose @ pile.poses
        taken = [
            ((pose @ asset.label.pose)[:2, 3], _reach(asset))
            for pose, asset in zip(poses, assets, strict=True)
        ]
        goals = []
        for target in targets:
            asset = assets[target]
            stable = int(random_state.choice(self._goal_rests(pile, target, asset)))
            for _ in range(_PLACES):
                xy = np.array(
                    [
                        random_state.uniform(*config.goal_x),
                        -self._side * random_state.uniform(*config.goal_y),
                    ]
                )
                gaps = [np.linalg.norm(xy - at) - reach for at, reach in taken]
                if min(gaps) > _reach(asset) + config.room:
                    break
            else:
                return None
            taken.append((xy, _reach(asset)))
            yaw = random_state.uniform(-np.pi, np.pi)
            goals.append(pose_on_table(asset, stable, xy, yaw) @ asset.label.pose)
        return tuple(goals)

    def _goal_rests(self, pile: Pile, target: int, asset: Asset) -> list[int]:
        """Stable poses that one grasp may bring the target to; empty if there is none.

        Where something lies on it, or may have to be moved out of the way, its free grasps are not
        known yet: all that hold count.
        """
        assert asset.grasps is not None
        held = asset.grasps.held
        free = pile.free[target, :held]
        if self.buried or not pile.uncovered[target]:
            free = np.ones(held, bool)
        shared = (free[:, None] & asset.grasps.clear[:held]).sum(axis=0)
        up = pile.poses[target][2, :3]
        turns = [
            float(np.arccos(np.clip(rest.rotation[2] @ up, -1.0, 1.0)))
            for rest in asset.stable_poses
        ]
        return [
            k
            for k, turn in enumerate(turns)
            if shared[k] >= self.task_config.min_free and turn <= self.task_config.max_turn
        ]

    def _possible(self, pile: Pile) -> list[int]:
        """The objects of a pile that have a goal pose that one grasp may bring them to."""
        return [
            k
            for k, index in enumerate(pile.objects)
            if self._goal_rests(pile, k, self._pool.entities[int(index)].asset)
        ]


def _reach(asset: Asset) -> float:
    """Radius of a circle about the label's origin that the object stays in, however it lies [m]."""
    return float(np.linalg.norm(np.sort(asset.label.extents)[1:])) / 2
