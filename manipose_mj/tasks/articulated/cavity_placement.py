"""What lies in a cavity: which ways an object fits, and how several lie there side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, Cavity, MovingPart
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.articulated.hand_room import MAX_WIDTH, STRAIGHT, TILTED, Placement
from manipose_mj.tasks.articulated.part_room import cavity_of, outwards_of, room_at
from manipose_mj.tasks.scene.object_pool import ObjectPool
from manipose_mj.tasks.scene.resting import placements_between

# Between what lies in a cavity and its walls and ceiling, in all and in each direction [m].
MARGIN = np.array([0.010, 0.010, 0.004])
# Between things that lie side by side [m].
GAP = 0.012
_LIKELY = 0.06  # share of drops that end in a stable pose
_LIFT = 0.001  # things are put down from this high [m]
_TRIES = 40
MIN_GRASPS = 6  # with room for the hand, for an object to be put in or taken out
_HALF_HAND = 0.115  # of its width, with some room [m]
_MIN_CLEAR = 5  # grasps clear of the table with which a stable pose is one to start from
_ROOM_FRONT = 0.04  # room is kept for an object this far from the open side at most [m]
# From the middle of a cavity to its open side, where an object is tried, as shares of the free way.
_DEPTHS = (0.0, 0.35, 0.7, 1.0, -0.35)
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Resting:
    """A way to lie on a cavity's floor.

    Attributes:
      rotation: `R_cavity_object`.
      center: `(2,)`, of the object's bounding box in x and y, from the object frame's origin [m].
      reach: `(3,)`, half the lengths of that box along the cavity's axes [m].
      height: Of the object frame's origin above the floor [m].
    """

    rotation: Float[np.ndarray, "3 3"]
    center: Float[np.ndarray, "2"]
    reach: Float[np.ndarray, "3"]
    height: float

    def pose(self, cavity: Cavity, place: Float[np.ndarray, "2"]) -> Float[np.ndarray, "4 4"]:
        """`T_cavity_object` with the box over `place` (from the cavity's centre) [m]."""
        z = self.height - cavity.extents[2] / 2 + _LIFT
        return compose(self.rotation, np.array([*(place - self.center), z]))


def ways_stored(asset: Asset, part: MovingPart) -> tuple[tuple[int, float], ...]:
    """Those of `ways_in_hand` that grasps lead to from where the asset starts on the table.

    Raises:
      InputError: There is none.
    """
    ways = ways_in_hand(asset, part)
    between = placements_between(asset)
    joined = tuple(
        way for way in ways if any(between[start, way[0]] >= 0 for start in starts(asset))
    )
    if not joined:
        raise InputError(
            f"part {part.name!r}: no grasps lead {asset.name} from the table to how it fits; choose "
            "other objects"
        )
    return joined


def starts_to_store(asset: Asset, part: MovingPart) -> tuple[int, ...]:
    """Stable poses on the table from which grasps lead to a way that the asset fits in.

    Raises:
      InputError: There is none.
    """
    ways, between = ways_stored(asset, part), placements_between(asset)
    return tuple(
        start for start in starts(asset) if any(between[start, way] >= 0 for way, _ in ways)
    )


def starts(asset: Asset) -> tuple[int, ...]:
    """Stable poses on the table in which a hand can take the asset; all of them if there is none."""
    everything = tuple(range(len(asset.stable_poses)))
    if asset.grasps is None:
        return everything
    narrow = asset.grasps.clear[asset.grasps.widths < MAX_WIDTH]
    return tuple(i for i in everything if narrow[:, i].sum() >= _MIN_CLEAR) or everything


def resting(asset: Asset, stable: int, yaw: float) -> Resting:
    """The asset in a stable pose, turned by `yaw` [rad] about the vertical."""
    rest = asset.stable_poses[stable]
    rotation = rotation_about(_UP, yaw) @ rest.rotation
    reach = asset.label.reach(rotation @ asset.label.rotation)
    middle = asset.label.origin + asset.label.rotation @ asset.label.center
    return Resting(rotation, (rotation @ middle)[:2], reach, rest.height)


def ways_to_lie(asset: Asset, cavity: Cavity) -> tuple[tuple[int, float], ...]:
    """Stable poses and quarter turns [rad] in which an asset fits a cavity.

    Unlikely stable poses are left out: on an oven's grid, things topple out of them.
    """
    shares = np.array([rest.probability for rest in asset.stable_poses])
    likely = np.flatnonzero(shares >= min(_LIKELY, shares.max(initial=0.0)))
    return tuple(
        (stable, quarter * np.pi / 2)
        for stable in likely.tolist()
        for quarter in range(4)
        if _fits(resting(asset, stable, quarter * np.pi / 2), cavity)
    )


def _fits(lying: Resting, cavity: Cavity) -> bool:
    return bool((2 * lying.reach + MARGIN <= cavity.extents).all())


def sample_placement(
    lying: Resting,
    cavity: Cavity,
    others: list[Placement],
    rng: np.random.RandomState,
    *,
    outwards: Float[np.ndarray, "2"],
    front: float | None = None,
    room: float = 0.0,
) -> Placement | None:
    """A free place on the floor, drawn at random; None if none was found.

    Args:
      lying: How the thing lies.
      cavity: Where.
      others: What lies there already.
      rng: Draws the place.
      outwards: The cavity's open side, a unit vector along x or y of its frame.
      front: The thing shall be at most this far from the open side [m]; None: anywhere.
      room: Between it and the walls, where the cavity is wide enough [m]; a drawer has one in front.
    """
    slack = (cavity.extents - MARGIN)[:2] / 2 - lying.reach[:2]
    if (slack < 0).any():
        return None
    # In the middle where there is not that much room.
    roomy = slack - room
    axis = int(np.argmax(np.abs(outwards)))
    if room and not cavity.moves_with_part:
        # The hand follows its fingers in.
        roomy[1 - axis] = min(roomy[1 - axis], cavity.extents[1 - axis] / 2 - _HALF_HAND)
    roomy = np.maximum(roomy, 0.0)
    mouth = roomy[axis] if cavity.moves_with_part else slack[axis]
    low, high = -roomy, roomy.copy()
    deep = -roomy[axis] if front is None else max(-roomy[axis], mouth - front)
    low[axis], high[axis] = sorted(np.sign(outwards[axis]) * np.array([deep, mouth]))
    for _ in range(_TRIES):
        place = rng.uniform(low, high)
        if all(_apart(place, lying.reach, other) for other in others):
            return Placement(place, lying.reach)
    return None


def _apart(place: Float[np.ndarray, "2"], reach: Float[np.ndarray, "3"], other: Placement) -> bool:
    return bool((np.abs(place - other.place) >= reach[:2] + other.reach[:2] + GAP).any())


def ways_into(asset: Asset, part: MovingPart) -> tuple[tuple[int, float], ...]:
    """`ways_to_lie` in the cavity of a part.

    Raises:
      InputError: There is none.
    """
    ways = ways_to_lie(asset, cavity_of(part))
    if not ways:
        lengths = " x ".join(f"{1000 * v:.0f}" for v in asset.label.extents)
        room = " x ".join(f"{1000 * v:.0f}" for v in cavity_of(part).extents)
        raise InputError(
            f"{asset.place}: measures {lengths} mm and fits the cavity of "
            f"{part.name!r} ({room} mm) in no stable pose"
        )
    return ways


def ways_in_hand(asset: Asset, part: MovingPart) -> tuple[tuple[int, float], ...]:
    """Those of `ways_into` in which a hand can hold the asset, at least where it has most room.

    Raises:
      InputError: There is none.
    """
    _, ways = _held_ways(asset, part)
    if not ways:
        raise InputError(
            f"part {part.name!r}: a gripper that opens 80 mm can take none of {asset.name} out of it; "
            "choose narrower objects"
        )
    return ways


def hand_towards(asset: Asset, part: MovingPart) -> float:
    """How the hand comes to the asset behind a part: `STRAIGHT`, or `TILTED` where it has no room so.

    Raises:
      InputError: The asset does not fit the cavity.
    """
    return _held_ways(asset, part)[0]


def _held_ways(asset: Asset, part: MovingPart) -> tuple[float, tuple[tuple[int, float], ...]]:
    """How the hand comes to the asset, and the ways to lie in which it has room so."""
    ways = ways_into(asset, part)
    for towards in (STRAIGHT,) if cavity_of(part).moves_with_part else (STRAIGHT, TILTED):
        held = tuple(
            (stable, yaw)
            for stable, yaw in ways
            if _roomiest(asset, part, stable, resting(asset, stable, yaw), towards)[0] >= MIN_GRASPS
        )
        if held:
            return towards, held
    return STRAIGHT, ()


def _roomiest(
    asset: Asset,
    part: MovingPart,
    stable: int,
    lying: Resting,
    towards: float,
    cavity_world: Float[np.ndarray, "4 4"] | None = None,
) -> tuple[int, Float[np.ndarray, "2"]]:
    """Of a few places between a cavity's two sides, how many grasps have room at the best, and where that is."""
    cavity = cavity_of(part)
    slack = (cavity.extents - MARGIN)[:2] / 2 - lying.reach[:2]
    # What is behind a door is held from the front: further in there is less room.
    shares = _DEPTHS if cavity.moves_with_part else _DEPTHS[:1]
    best, where = -1, np.zeros(2)
    for share in shares:
        place = share * slack * outwards_of(part)
        pose = lying.pose(cavity, place)
        count = room_at(asset, part, stable, pose, cavity_world=cavity_world, towards=towards)
        if count > best:
            best, where = count, place
        if best >= MIN_GRASPS:
            break
    return best, where


@dataclass(frozen=True)
class OwnPlace:
    """Where the object that an episode is about lies in a cavity, or shall lie.

    Attributes:
      stable: Index of its stable pose.
      lying: How it lies.
      place: Of its box, from the cavity's centre [m].
      room: That is kept around it [m].
      hands: How many of its grasps have room for the hand.
    """

    stable: int
    lying: Resting
    place: Float[np.ndarray, "2"]
    room: float
    hands: int

    @property
    def kept(self) -> Placement:
        """What others keep clear of."""
        return Placement(self.place, self.lying.reach + self.room)


class CavityPlacement:
    """Where the objects of a pool lie in the cavity behind a part; the first is what the episode is about.

    Attributes:
      towards: How the hand comes to the first, as of `hand_towards`.
    """

    def __init__(self, pool: ObjectPool, part: MovingPart, *, taken: bool) -> None:
        """Looks up every way to lie.

        Args:
          pool: Of objects.
          part: In question.
          taken: Whether the first object is to be taken out, or to be stored.

        Raises:
          InputError: An object does not fit the cavity, or no hand can put the first in or take it out.
        """
        self._assets = tuple(entity.asset for entity in pool.entities)
        self._part = part
        self._ways = [ways_into(asset, part) for asset in self._assets]
        self.towards = hand_towards(self._assets[0], part)
        self._own = (ways_in_hand if taken else ways_stored)(self._assets[0], part)

    def inside(
        self,
        rng: np.random.RandomState,
        *,
        front: float,
        room: float = 0.0,
        cavity_world: Float[np.ndarray, "4 4"] | None = None,
    ) -> OwnPlace:
        """A place for the object in the empty cavity, with room for the hand.

        Near the open side; where nothing there leaves the hand room, as between a long tool and a drawer's front,
        further in.

        Args:
          rng: Draws the way to lie and the place.
          front: At most this far from the open side [m].
          room: For fingers around it, towards walls and towards others [m].
          cavity_world: As of `room_at`.
        """
        asset, part = self._assets[0], self._part
        stable, yaw = self._own[rng.randint(len(self._own))]
        lying = resting(asset, stable, yaw)
        best, place = -1, np.zeros(2)
        deepest = (front, None) if cavity_of(part).moves_with_part else (front,)
        for allowed, _ in product(deepest, range(_TRIES)):
            tried = sample_placement(
                lying,
                cavity_of(part),
                [],
                rng,
                outwards=outwards_of(part),
                front=allowed,
                room=room,
            )
            assert tried is not None  # it fits, and nothing is in its way
            pose = lying.pose(cavity_of(part), tried.place)
            count = room_at(
                asset, part, stable, pose, cavity_world=cavity_world, towards=self.towards
            )
            if count > best:
                best, place = count, tried.place
            if best >= MIN_GRASPS:
                return OwnPlace(stable, lying, place, room, best)
        count, roomiest = _roomiest(asset, part, stable, lying, self.towards, cavity_world)
        if count > best:
            best, place = count, roomiest
        return OwnPlace(stable, lying, place, room, best)

    def beside(
        self, rng: np.random.RandomState, count: int, own: OwnPlace | None = None
    ) -> dict[int, Float[np.ndarray, "4 4"]]:
        """Up to `count` other objects in the cavity that leave room for the object.

        Args:
          rng: Draws which and where.
          count: How many others at most.
          own: Where the object lies; None: room is kept for it somewhere near the open side.

        Returns:
          Their indices, with `T_cavity_object` of each.
        """
        if not count:
            return {}
        part = self._part
        if own is None:
            own = self.inside(rng, front=_ROOM_FRONT)
        enough = min(MIN_GRASPS, self._room_beside(own, []))
        taken, found = [own.kept], {}
        for other in 1 + rng.permutation(len(self._assets) - 1)[:count]:
            ways = self._ways[other]
            stable, yaw = ways[rng.randint(len(ways))]
            lying = resting(self._assets[other], stable, yaw)
            place = sample_placement(lying, cavity_of(part), taken, rng, outwards=outwards_of(part))
            if place is None or self._room_beside(own, [*taken[1:], place]) < enough:
                continue
            taken.append(place)
            found[int(other)] = lying.pose(cavity_of(part), place.place)
        return found

    def _room_beside(self, own: OwnPlace, others: Sequence[Placement]) -> int:
        asset, pose = self._assets[0], own.lying.pose(cavity_of(self._part), own.place)
        return room_at(asset, self._part, own.stable, pose, others, towards=self.towards)
