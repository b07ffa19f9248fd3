"""Where a piece of furniture stands so that the arm can use the part in question: drawn among good places.

Candidates are drawn once for every part, always the same; `place_score` tells the good ones, of which an episode
draws one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import radians

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.mjcf.arena import (
    SIDE_TABLE_CENTER,
    SIDE_TABLE_HALF_EXTENTS,
    TABLE_CENTER,
    TABLE_HALF_EXTENTS,
)
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.articulated.part_choice import kind_of
from manipose_mj.tasks.articulated.part_shape import PartShape, part_shape
from manipose_mj.tasks.articulated.place_score import (
    COMPLETE,
    LAYERS,
    TRAVEL,
    PlaceScore,
)
from manipose_mj.tasks.core.start import Mount

# A place that was found good is so nearby too [m, rad].
_SHIFT, _TURN = 0.006, radians(1)
_UP = np.array([0.0, 0.0, 1.0])
_BATCH, _BATCHES = 64, 8  # candidates
_MORE_BATCHES = 48  # where these have too few good places
_KEPT = 24
_ENOUGH = 8  # good places on the table, or the piece stands elsewhere
_HALF = LAYERS // 2
_SPREAD = 0.06  # of scores that are as good as the best
_LEAST_PLINTH = 0.06  # [m]
_ON_TABLE = (0.62, 1.0, 0.72)  # what is larger stands on the floor [m]
# What is on no table and small stands on a plinth as high as a table at least, so far above the floor [m].
_LOW_FLOOR = 0.45
_FEET = 0.04  # least height of a plinth on the floor, over which doors swing [m]
_PEDESTAL = 0.05  # height of the lowest [m]
# Where objects may be, from the middle of where they are [m].
_OBJECTS = np.array(
    [(x, y, z) for x in (-0.15, 0.0, 0.15) for y in (-0.15, 0.0, 0.15) for z in (0.05, 0.2)]
)
# Points all over the side table, from the middle of its top, and how near nothing may come to them [m].
_SIDE_TABLE = SIDE_TABLE_HALF_EXTENTS * np.array(
    [(x, y, -1.0) for x in np.linspace(-1, 1, 7) for y in np.linspace(-1, 1, 7)]
)
_SIDE_TABLE_RADIUS = 0.06


@dataclass(frozen=True)
class Place:
    """Where a piece stands, and the robot.

    Attributes: position `(3,)` and yaw of the piece [m, rad]; mount; raised: whether on a plinth.
    """

    position: Float[np.ndarray, "3"]
    yaw: float
    mount: Mount
    raised: bool


@dataclass(frozen=True)
class Standing:
    """From which places a piece's is drawn: of the shut part's handle, as seen from the robot's base.

    What is to the left here is to the right for doors hinged on the right.

    Attributes:
      distance: From the base's axis [m].
      bearing: To the left of straight ahead [rad].
      height: [m], where it can be chosen: not on a table.
      turn: Of the handle's outward direction from that towards the robot [rad].
      plinth: Height of a plinth on the table [m]; a low one is left away.
      objects: Whether the episode has objects on a table too; they lie to the right.
    """

    distance: tuple[float, float] = (0.40, 0.85)
    bearing: tuple[float, float] = (-radians(65), radians(65))
    height: tuple[float, float] = (0.05, 0.65)
    turn: tuple[float, float] = (-radians(75), radians(75))
    plinth: tuple[float, float] = (0.0, 0.22)
    objects: bool = False


def draw_place(
    rng: np.random.RandomState,
    asset: Asset,
    part: MovingPart,
    fraction: float = 0.0,
    standing: Standing | None = None,
) -> Place:
    """Draw where a piece stands, and on what.

    Args:
      rng: Draws.
      asset: The piece, at its size.
      part: The part in question, which has a handle.
      fraction: By how much of its range it is open at first; 0 where it is to be opened.
      standing: From which places are drawn.
    """
    places, _ = _good_places(_Key(asset, part), _layer(fraction), standing or Standing())
    place = places[rng.randint(len(places))]
    shift, turn = rng.uniform(-_SHIFT, _SHIFT, 2), rng.uniform(-_TURN, _TURN)
    return replace(place, position=place.position + [*shift, 0.0], yaw=place.yaw + turn)


def widest_start(asset: Asset, part: MovingPart, standing: Standing | None = None) -> float:
    """By which fraction of its range a part may be open where the arm is to shut it.

    All of it, but for doors that fold back so far that the arm cannot get before them anywhere.
    """
    _, best = _good_places(_Key(asset, part), LAYERS - 1, standing or Standing())
    return 1.0 if best >= COMPLETE else TRAVEL * _HALF / (LAYERS - 1)


def _layer(fraction: float) -> int:
    """A place for a door that is wider open serves for all that are less: few searches."""
    if fraction == 0:
        return 0
    return _HALF if fraction <= _HALF / (LAYERS - 1) else LAYERS - 1


def side(part: MovingPart) -> float:
    """-1 for a door hinged on the right as seen from the front, which opens to that side; else 1."""
    return -1.0 if kind_of(part) == "door" and part.joint.axis[2] > 0 else 1.0


def fits_table(shape: PartShape) -> bool:
    """Whether a piece is small enough to stand on the table."""
    size = np.ptp(np.concatenate([shape.fixed.reshape(-1, 3), shape.moving]), axis=0)
    return bool((size < _ON_TABLE).all())


@dataclass(frozen=True, eq=False)
class _Key:
    """A part of an asset, the same for the same folder."""

    asset: Asset
    part: MovingPart

    def __hash__(self) -> int:
        return hash((self.asset.folder, self.part.name))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and (self.asset.folder, self.part.name) == (
            other.asset.folder,
            other.part.name,
        )


@lru_cache(maxsize=1024)
def _good_places(key: _Key, layer: int, standing: Standing) -> tuple[tuple[Place, ...], float]:
    """The best of the places that are drawn for a part, and the best score.

    Those from where the arm cannot move the part all the way count only if all are such, all around the robot and for
    a hand that holds the handle by its fingertips too.
    """
    found = _found(key, layer, standing)
    around = Standing(objects=standing.objects)
    for fingertips in (False, True):
        if found[0][0] < COMPLETE and (fingertips or standing != around):
            again = _found(key, layer, around, fingertips=fingertips)
            found = max(found, again, key=lambda places: places[0][0])
    best = found[0][0]
    least = min(best - _SPREAD, found[_ENOUGH - 1][0])
    if best >= COMPLETE:
        least = max(least, COMPLETE)
    return tuple(place for value, place in found[:_KEPT] if value >= least), best


def _found(
    key: _Key, layer: int, standing: Standing, *, fingertips: bool = False
) -> list[tuple[float, Place]]:
    """Candidates with their scores, the best first; on the table where there are enough, more where there are few."""
    shape = part_shape(key.asset, key.part)
    objects = None
    if standing.objects:
        objects = _OBJECTS + np.array(SIDE_TABLE_CENTER) * [1.0, -side(key.part), 1.0]
    score = PlaceScore(key.part, shape, layer, standing.objects, objects, fingertips)
    best: list[tuple[float, Place]] = []
    for on_table in (True, False) if fits_table(shape) else (False,):
        rng = np.random.RandomState(0)
        for _ in range(_BATCHES):
            best += _scored(rng, score, standing, on_table)
            if sum(value >= 1.0 for value, _ in best) >= _KEPT:
                break
        best.sort(key=lambda found: -found[0])
        if _enough(best):
            return best
    for _ in range(_MORE_BATCHES if best[0][0] >= COMPLETE else 0):
        best += _scored(rng, score, standing, False)
        if _enough(best):
            break
    best.sort(key=lambda found: -found[0])
    return best


def _enough(found: list[tuple[float, Place]]) -> bool:
    return sum(value >= COMPLETE for value, _ in found) >= _ENOUGH


def _scored(
    rng: np.random.RandomState, score: PlaceScore, standing: Standing, on_table: bool
) -> list[tuple[float, Place]]:
    """A batch of candidates, each with its score."""
    drawn = [_drawn(rng, score.part, score.shape, standing, on_table) for _ in range(_BATCH)]
    return list(zip(_scores(score, score.shape, drawn).tolist(), drawn, strict=True))


def _drawn(
    rng: np.random.RandomState,
    part: MovingPart,
    shape: PartShape,
    standing: Standing,
    on_table: bool,
) -> Place:
    """A candidate."""
    assert part.handle is not None
    handle, outwards = part.handle.origin, part.handle.rotation[:, 1]
    mirror = side(part)
    distance, bearing = rng.uniform(*standing.distance), mirror * rng.uniform(*standing.bearing)
    turn, height = mirror * rng.uniform(*standing.turn), rng.uniform(*standing.height)
    plinth = rng.uniform(*standing.plinth)
    yaw = bearing + np.pi + turn - np.arctan2(outwards[1], outwards[0])
    yaw = float((yaw + np.pi) % (2 * np.pi) - np.pi)
    if on_table:
        bottom = plinth if plinth >= _LEAST_PLINTH else 0.0
        mount, raised = Mount(), bottom > 0
    else:
        bottom = height - (handle[2] - shape.floor)
        highest = -_LOW_FLOOR if fits_table(shape) or standing.objects else -_PEDESTAL
        floor, raised = min(bottom - _FEET, highest), True
        beside = -mirror if standing.objects else 0.0
        mount = Mount(table=False, height=-floor, side_table=beside)
    at = distance * np.array([np.cos(bearing), np.sin(bearing)])
    xy = at - (rotation_about(_UP, yaw) @ handle)[:2]
    return Place(np.array([*xy, bottom - shape.floor]), yaw, mount, raised)


def _scores(score: PlaceScore, shape: PartShape, places: list[Place]) -> Float[np.ndarray, "c"]:
    bases = np.stack([compose(rotation_about(_UP, p.yaw), p.position) for p in places])
    floors = np.array([0.0 if p.mount.table else -p.mount.height for p in places])
    on_table = np.array([p.mount.table for p in places])
    stands = ~on_table | _stands(shape, bases)
    beside = np.array([p.mount.side_table for p in places])
    for sign in set(beside[beside != 0]):
        table = _SIDE_TABLE + np.array(SIDE_TABLE_CENTER) * [1.0, sign, 1.0]
        stands &= (beside != sign) | score.stays_off(bases, table, _SIDE_TABLE_RADIUS)
    return np.where(stands, score(bases, floors), -1.0)


def _stands(shape: PartShape, bases: Float[np.ndarray, "c 4 4"]) -> Bool[np.ndarray, "c"]:
    """Whether the whole foot of a piece is on the table."""
    low, high = shape.fixed[:, 0].min(axis=0), shape.fixed[:, 1].max(axis=0)
    corners = np.array([(x, y, low[2]) for x in (low[0], high[0]) for y in (low[1], high[1])])
    at = np.einsum("cij,nj->cni", bases[:, :2, :3], corners) + bases[:, None, :2, 3]
    beyond = np.abs(at - TABLE_CENTER[:2]) - TABLE_HALF_EXTENTS[:2]
    return (beyond < 0).all(axis=(1, 2))
