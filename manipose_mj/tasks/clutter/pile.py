"""A pile: how its objects are dropped, and how they lie once all is at rest.

Objects fall one after the other between invisible walls; then the walls go, and what leans on them
falls too. A pile follows from its assets, configuration and seed alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.physics import REST_ANGULAR_SPEED, REST_LINEAR_SPEED
from manipose_mj.tasks.clutter.pile_layout import PileConfig, choose, drops
from manipose_mj.tasks.clutter.pile_scene import PileScene
from manipose_mj.tasks.core.start import NoStartError

_ATTEMPTS = 20
_DROP_GAP = 0.012  # between what falls next and what lies there already [m]
_DROP_SPEED = 0.5  # downwards, to begin with [m/s]
_FALL_TIME = 0.4  # until the next one falls [s]
_REST_TIME = 4.0  # for the pile to come to rest without walls [s]
_STILL_TIME = 0.2  # for which it then has to be still [s]
_CALM_TIME = 0.6  # for a pile at rest to be so in fine steps too [s]
_STILL = (0.0005, 0.005)  # on average [m/s, rad/s]; friction that creeps turns them faster
# At any moment, half of what counts as rest: meshes that touch in few points tremble [m/s, rad/s].
_TREMBLING = (REST_LINEAR_SPEED / 2, REST_ANGULAR_SPEED / 2)
_SETTLES = 0.1  # share of what is hidden that may be seen more before the pile has come to rest
_PENETRATION = 0.002  # allowed in a pile at rest [m]


@dataclass(frozen=True)
class Pile:
    """A pile at rest; its frame stands on the table under its middle.

    Attributes:
      objects: `(n,)`, which of the assets lie in it, in the order in which they fell.
      poses: `(n, 4, 4)`, `T_pile_object`.
      supports: `(n, n)`; `[i, j]` says that object `i` rests on object `j`.
      obstacles: `(n, g, n + 1)`; `[i, k, j]` says that a hand that comes straight to grasp `k` of object `i`
        meets object `j`, or the table, which is last. Beyond an asset's last grasp it meets everything.
    """

    objects: Int[np.ndarray, "n"]
    poses: Float[np.ndarray, "n 4 4"]
    supports: Bool[np.ndarray, "n n"]
    obstacles: Bool[np.ndarray, "n g m"]

    @property
    def uncovered(self) -> Bool[np.ndarray, "n"]:
        """Whether nothing rests on an object."""
        return np.asarray(~self.supports.any(axis=0))

    @property
    def above(self) -> Bool[np.ndarray, "n n"]:
        """`[j, i]` says that object `j` rests on object `i`, or on one that does."""
        closed = self.supports
        for _ in range(len(closed)):
            closed = closed | (closed @ closed)
        return closed

    @property
    def radius(self) -> float:
        """Distance of the farthest origin from the middle [m]."""
        return float(np.linalg.norm(self.poses[:, :2, 3], axis=1).max())


def settle(assets: Sequence[Asset], config: PileConfig, seed: int) -> Pile:
    """Drop a pile.

    Args:
      assets: Each is dropped at most once.
      config: How many, how.
      seed: Of the choice of objects and of how they fall.

    Raises:
      NoStartError: No pile of these came to rest where it should.
    """
    for attempt in range(_ATTEMPTS):
        rng = np.random.default_rng((seed, attempt))
        pile = _dropped(assets, config, rng)
        if pile is not None:
            return pile
    names = ", ".join(asset.name for asset in assets)
    raise NoStartError(
        f"no pile of {config.count[0]} to {config.count[1]} of {names} comes to rest within "
        f"{config.spread} m; take objects that roll less or are smaller"
    )


def _dropped(assets: Sequence[Asset], config: PileConfig, rng: np.random.Generator) -> Pile | None:
    chosen = choose(assets, config, rng)
    chosen_assets = [assets[i] for i in chosen]
    radius = float(rng.uniform(*config.radius))
    scene = PileScene(chosen_assets, radius)
    for order, drop in enumerate(drops(chosen_assets, config, radius, rng)):
        scene.drop(order, drop.rotation, drop.xy, _DROP_GAP, _DROP_SPEED)
        scene.run(_FALL_TIME)
    if (
        config.layout == "cover"
        and scene.most_seen(0, config.hidden + _SETTLES) > config.hidden + _SETTLES
    ):
        return None
    scene.remove_walls()
    if not scene.rest(_REST_TIME, _STILL_TIME, _STILL, config.spread):
        return None
    scene.step_finely()
    still = scene.rest(_CALM_TIME, _STILL_TIME, _STILL, config.spread, momentary=_TREMBLING)
    kept = np.flatnonzero(scene.kept)
    if not still or len(kept) < config.count[0] or scene.penetration() > _PENETRATION:
        return None
    supports = scene.supports()[np.ix_(kept, kept)]
    if config.layout != "heap" and kept[0] != 0:
        return None
    if config.layout == "stack" and not supports[:, 0].any():
        return None
    if scene.diverged:
        return None
    if config.layout == "cover" and scene.most_seen(0, config.hidden) > config.hidden:
        return None
    poses = scene.poses()[kept]
    poses[:, :2, 3] -= poses[:, :2, 3].mean(axis=0)
    obstacles = scene.grasp_obstacles()[kept][:, :, [*kept, -1]]
    return Pile(chosen[kept], poses, supports, obstacles)
