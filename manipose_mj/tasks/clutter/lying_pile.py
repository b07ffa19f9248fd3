"""A pile where it lies on the table in one episode."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import Asset
from manipose_mj.mjcf.panda.reachability import is_reachable
from manipose_mj.poses import invert
from manipose_mj.tasks.clutter.pile import Pile
from manipose_mj.tasks.core.start import PlacedObject

_STANDOFF = 0.06  # from which the arm has to come straight to a grasp [m]
_TURNS = 8  # of an axis of symmetry
_HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True)
class LyingPile:
    """A pile with its place; the robot stands at the world's origin.

    Attributes:
      pile: How its objects lie.
      assets: Of each of them.
      pose: `T_world_pile`.
      side: Of the table's middle line that it lies on, -1 or 1.
    """

    pile: Pile
    assets: tuple[Asset, ...]
    pose: Float[np.ndarray, "4 4"]
    side: float

    @property
    def poses(self) -> Float[np.ndarray, "n 4 4"]:
        """`T_world_object` of each object."""
        return self.pose @ self.pile.poses

    def name(self, index: int) -> str:
        """The asset's name of an object of the pile."""
        return self.assets[index].name

    def placed(self) -> tuple[PlacedObject, ...]:
        """Each object where it lies."""
        return tuple(
            PlacedObject(int(index), self.pose @ pose)
            for index, pose in zip(self.pile.objects, self.pile.poses, strict=True)
        )

    @cached_property
    def _reached(self) -> tuple[Bool[np.ndarray, "g 2"], ...]:
        """Of each object, the annotated grasps that the arm comes straight to, each way round."""
        pairs = zip(self.assets, self.poses, strict=True)
        return tuple(_comes_straight(pose @ _hands(asset)) for asset, pose in pairs)

    def usable(self, index: int, least: int, moved: int) -> Bool[np.ndarray, "g 2"]:
        """Which grasps of an object can be had, each way round, once others have been set aside.

        Args:
          index: Of the object.
          least: Grasps by which each of those others can be taken and set down on some side.
          moved: How many others may be in the way; 0: the grasps that can be had as all lies.
        """
        blocked, reached = self._blockers(index), self._reached[index]
        gone = self._set_aside(index, least) if moved else np.zeros(len(self.assets), bool)
        free = ~blocked[:, -1] & (blocked[:, :-1].sum(axis=1) <= moved)
        free &= ~blocked[:, :-1][:, ~gone].any(axis=1)
        return reached & free[:, None]

    def usable_to(
        self,
        index: int,
        usable: Bool[np.ndarray, "g 2"],
        goal: Float[np.ndarray, "4 4"],
        stable: int,
    ) -> Bool[np.ndarray, "g"]:
        """Which of the usable grasps of an object can also set it down at a goal.

        Args:
          index: Of the object.
          usable: Its grasps to choose from, each way round.
          goal: `T_world_label`.
          stable: Index of the stable pose it has there.
        """
        asset = self.assets[index]
        assert asset.grasps is not None
        turns = asset.label.symmetry.sampled(_TURNS)
        labels = np.repeat(goal[None], len(turns), axis=0)
        labels[:, :3, :3] = goal[:3, :3] @ turns
        objects = labels @ invert(asset.label.pose)
        clear = asset.grasps.clear[:, stable, None].astype(bool)
        there = _comes_straight(objects[:, None, None] @ _hands(asset)).any(axis=0)
        return np.asarray((usable & clear & there).any(axis=1))

    def _blockers(self, index: int) -> Bool[np.ndarray, "g m"]:
        """What keeps each grasp of an object from being had: what the hand meets, and what lies on the object."""
        blocked = self.pile.obstacles[index, : len(self._reached[index])].copy()
        blocked[:, :-1] |= self.pile.above[:, index]
        return blocked

    def _set_aside(self, kept: int, least: int) -> Bool[np.ndarray, "n"]:
        """Which objects can be set aside one after the other while one stays where it is."""
        gone = np.zeros(len(self.assets), bool)
        for _ in self.assets:
            before = gone.copy()
            for i in np.flatnonzero(~before).tolist():
                if i != kept:
                    gone[i] = self._can_go(i, before, least)
            if (gone == before).all():
                break
        return gone

    def _can_go(self, index: int, gone: Bool[np.ndarray, "n"], least: int) -> bool:
        grasps = self.assets[index].grasps
        if grasps is None:
            return False
        blocked = self._blockers(index)
        free = ~blocked[:, -1] & ~blocked[:, :-1][:, ~gone].any(axis=1)
        had = self._reached[index].any(axis=1) & free
        return bool(((had[:, None] & grasps.clear.astype(bool)).sum(axis=0) >= least).any())


def _hands(asset: Asset) -> Float[np.ndarray, "h 2 4 4"]:
    """`T_object_tcp` of the annotated grasps, each way round."""
    if asset.grasps is None:
        return np.zeros((0, 2, 4, 4))
    return np.stack([asset.grasps.poses, asset.grasps.poses @ _HALF_TURN], axis=1)


def _comes_straight(tcp_poses: Float[np.ndarray, "*n 4 4"]) -> Bool[np.ndarray, "*n"]:
    """Whether the arm alone reaches each pose `T_world_tcp`, and the one that it comes from."""
    back = tcp_poses.copy()
    back[..., :3, 3] -= _STANDOFF * back[..., :3, 2]
    return is_reachable(tcp_poses) & is_reachable(back)
