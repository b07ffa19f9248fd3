"""What the clutter tasks share: a settled pile somewhere on the table, targets in it, goals beside it."""

from __future__ import annotations

import abc
from dataclasses import dataclass, field
from math import radians

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import Asset
from manipose_mj.errors import InputError
from manipose_mj.mjcf.markers.goal_marker import GoalMarker
from manipose_mj.mjcf.objects import stiffen
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.clutter.lying_pile import LyingPile
from manipose_mj.tasks.clutter.pile import Pile
from manipose_mj.tasks.clutter.pile_cache import PileCache
from manipose_mj.tasks.clutter.pile_layout import PileConfig
from manipose_mj.tasks.clutter.pile_scene import PILE_CONTACT_TIME, PILE_TIMESTEP
from manipose_mj.tasks.core.config import EnvConfig, EpisodeSpec, TaskConfig
from manipose_mj.tasks.core.preview import Preview
from manipose_mj.tasks.core.start import EpisodeStart, NoStartError
from manipose_mj.tasks.core.task import ManipulationTask
from manipose_mj.tasks.goals import Goal, PoseGoal
from manipose_mj.tasks.scene.resting import pose_on_table, require_graspable

TARGET_NAMES = ("object", "object_second", "object_third")
_UP = np.array([0.0, 0.0, 1.0])
_PLACEMENTS = 5  # of a pile on the table, before another one is dropped
_SLEEP_SPEED = 1e-3  # under which an island of touching things falls asleep [m/s]
_PLACES = 200  # drawn for a goal before the pile is drawn anew


@dataclass(frozen=True)
class ClutterConfig(TaskConfig):
    """Attributes: pile: how piles are dropped; piles: how many different ones there are of the objects, and how many
    more are dropped where none of those has a target; pile_x: where
    the middle of the pile may be, along x [m]; pile_y: how far from the table's middle line, to
    either side [m]; goal_x, goal_y: the same of goals, on the other side of that line [m];
    room: between a goal and everything else, for the hand [m]; targets: least and largest number;
    moved: how many others may have to be set aside before a target can be taken; min_free: grasps a target must have
    then, with which the arm can also set it down at its goal, and those others to be set aside by;
    max_turn: of a target's vertical between pile and goal [rad]."""

    horizon: float = 90.0
    pile: PileConfig = field(default_factory=PileConfig)
    piles: int = 4
    pile_x: tuple[float, float] = (0.47, 0.55)
    pile_y: tuple[float, float] = (0.12, 0.18)
    goal_x: tuple[float, float] = (0.36, 0.60)
    goal_y: tuple[float, float] = (0.10, 0.42)
    room: float = 0.05
    targets: tuple[int, int] = (1, 1)
    moved: int = 0
    min_free: int = 6
    max_turn: float = radians(100)


class Clutter(ManipulationTask):
    """A pile and goals beside it. A subclass says which objects of a pile may be the targets.

    Physics as in the other tasks, but in steps half as long, with contacts twice as stiff.
    """

    def __init__(
        self, assets: tuple[Asset, ...], config: ClutterConfig, env_config: EnvConfig
    ) -> None:
        """Build the scene.

        Raises:
          InputError: There are fewer objects than a pile needs, or the gripper cannot hold one.
        """
        super().__init__(config, env_config)
        self.task_config = config
        least = config.pile.count[0]
        if len(assets) < least:
            raise InputError(f"a pile takes at least {least} objects; got {len(assets)}")
        for asset in assets:
            require_graspable(asset)
        option = self.scene.arena.mjcf_model.option
        option.sleep_tolerance = _SLEEP_SPEED
        # The native one overstates how deep cylinders reach into boxes beside them, 7 mm for 1.
        option.flag.nativeccd = "disable"
        self.physics_timestep = PILE_TIMESTEP
        self.assets = assets
        self.pool = self.scene.add_objects(assets)
        self._stiffen_contacts()
        for name in TARGET_NAMES[: config.targets[1]]:
            self.scene.add_fixture(f"goal_{name}", GoalMarker(name=f"goal_{name}"))
        self._cache = PileCache(assets, config.pile)

    def _stiffen_contacts(self) -> None:
        self.scene.arena.mjcf_model.find("geom", "table").solref = [PILE_CONTACT_TIME, 1.0]
        for entity in self.pool.entities:
            stiffen(entity.mjcf_model, PILE_CONTACT_TIME)

    @abc.abstractmethod
    def choose_targets(
        self, rng: np.random.RandomState, lying: LyingPile, preview: Preview
    ) -> tuple[int, ...]:
        """The targets, by their indices in the pile, which lies on the table; empty: another pile."""

    def more_goals(self, others: tuple[str, ...]) -> tuple[Goal, ...]:
        """Goals besides the targets' poses, given the names of the objects that are no targets."""
        return ()

    @property
    def neighbours(self) -> tuple[str, ...]:
        """The objects of this episode that are no targets."""
        return tuple(name for name in self.objects if name not in TARGET_NAMES)

    @property
    def observed_objects(self) -> tuple[str, ...]:
        low, high = self.task_config.targets
        largest = min(len(self.assets), self.task_config.pile.count[1])
        return (*TARGET_NAMES[:high], *(f"clutter_{k + 1}" for k in range(largest - low)))

    @property
    def observed_goals(self) -> tuple[str, ...]:
        high = self.task_config.targets[1]
        return ("goal",) if high == 1 else tuple(f"goal_{name}" for name in TARGET_NAMES[:high])

    def sample(
        self, rng: np.random.RandomState, spec: EpisodeSpec, preview: Preview
    ) -> EpisodeStart:
        count = self.task_config.piles
        for number in (*rng.permutation(count).tolist(), *range(count, 2 * count)):
            try:
                pile = self._cache.pile(number)
            except NoStartError:
                continue
            for _ in range(_PLACEMENTS):
                lying = self._lying(pile, rng)
                targets = self.choose_targets(rng, lying, preview)
                named = spec.object is None or any(lying.name(t) == spec.object for t in targets)
                goals = self._sample_goals(lying, targets, rng) if targets and named else None
                if goals is not None:
                    return self._start(lying, targets, goals)
        raise NoStartError(
            f"{type(self).__name__}: none of {2 * count} piles of these objects has a "
            f"target as the task wants it{f', {spec.object!r}' if spec.object else ''}; "
            "take more objects, or smaller ones"
        )

    def _start(
        self,
        lying: LyingPile,
        targets: tuple[int, ...],
        goals: tuple[Float[np.ndarray, "4 4"], ...],
    ) -> EpisodeStart:
        others = [i for i in range(len(lying.pile.objects)) if i not in targets]
        other_names = tuple(f"clutter_{k + 1}" for k in range(len(others)))
        names = (*TARGET_NAMES[: len(targets)], *other_names)
        placed = lying.placed()
        requested = dict(zip(TARGET_NAMES, goals, strict=False))
        return EpisodeStart(
            goals=(
                *(PoseGoal(name, pose) for name, pose in requested.items()),
                *self.more_goals(other_names),
            ),
            objects={n: placed[i] for n, i in zip(names, (*targets, *others), strict=True)},
            fixtures={f"goal_{name}": pose for name, pose in requested.items()},
        )

    def _lying(self, pile: Pile, rng: np.random.RandomState) -> LyingPile:
        """A pile on the table, somewhere and turned somehow."""
        config = self.task_config
        side = float(rng.choice([-1.0, 1.0]))
        middle = np.array([rng.uniform(*config.pile_x), side * rng.uniform(*config.pile_y)])
        turn = rotation_about(_UP, rng.uniform(-np.pi, np.pi))
        pose = compose(turn, np.array([*middle, 0.0]))
        return LyingPile(pile, tuple(self.assets[int(i)] for i in pile.objects), pose, side)

    def _sample_goals(
        self, lying: LyingPile, targets: tuple[int, ...], rng: np.random.RandomState
    ) -> tuple[Float[np.ndarray, "4 4"], ...] | None:
        """`T_world_label` of each target's goal, clear of the pile and of each other."""
        config = self.task_config
        taken = [
            ((pose @ asset.label.pose)[:2, 3], _reach(asset))
            for pose, asset in zip(lying.poses, lying.assets, strict=True)
        ]
        goals = []
        for target in targets:
            asset = lying.assets[target]
            usable = self._usable(lying, target)
            stable = int(rng.choice(self._goal_rests(lying, target)))
            for _ in range(_PLACES):
                xy = np.array(
                    [
                        rng.uniform(*config.goal_x),
                        -lying.side * rng.uniform(*config.goal_y),
                    ]
                )
                gaps = [np.linalg.norm(xy - at) - reach for at, reach in taken]
                if min(gaps) <= _reach(asset) + config.room:
                    continue
                yaw = rng.uniform(-np.pi, np.pi)
                goal = pose_on_table(asset, stable, xy, yaw) @ asset.label.pose
                if lying.usable_to(target, usable, goal, stable).sum() >= config.min_free:
                    break
            else:
                return None
            taken.append((xy, _reach(asset)))
            goals.append(goal)
        return tuple(goals)

    def _goal_rests(self, lying: LyingPile, target: int) -> list[int]:
        """Stable poses that one grasp may bring the target to once nothing lies on it; empty if there is none."""
        asset = lying.assets[target]
        assert asset.grasps is not None
        usable = np.asarray(self._usable(lying, target).any(axis=1))
        shared = (usable[:, None] & asset.grasps.clear).sum(axis=0)
        up = lying.pile.poses[target][2, :3]
        turns = [
            float(np.arccos(np.clip(rest.rotation[2] @ up, -1.0, 1.0)))
            for rest in asset.stable_poses
        ]
        return [
            k
            for k, turn in enumerate(turns)
            if shared[k] >= self.task_config.min_free and turn <= self.task_config.max_turn
        ]

    def _usable(self, lying: LyingPile, target: int) -> Bool[np.ndarray, "g 2"]:
        return lying.usable(target, self.task_config.min_free, self.task_config.moved)

    def possible_targets(self, lying: LyingPile) -> list[int]:
        """The objects of a pile that one grasp may bring to a goal pose, once others are set aside."""
        return [k for k in range(len(lying.assets)) if self._goal_rests(lying, k)]


def _reach(asset: Asset) -> float:
    """Radius of a circle about the label's origin that the object stays in, however it lies, where that is its middle [m]."""
    return float(np.linalg.norm(np.sort(asset.label.extents)[1:])) / 2
