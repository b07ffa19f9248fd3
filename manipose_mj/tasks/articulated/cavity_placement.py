"""What lies in a cavity: which ways an object fits, and how several lie there side by side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, Cavity, MovingPart
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, rotation_about
from manipose_mj.tasks.scene.object_pool import ObjectPool

# Between what lies in a cavity and its walls and ceiling, in all and in each direction [m].
MARGIN = np.array([0.010, 0.010, 0.004])
# Between things that lie side by side [m].
GAP = 0.012
_LIKELY = 0.06  # share of drops that end in a stable pose
_LIFT = 0.001  # things are put down from this high [m]
_TRIES = 40
# Grasps that must come in this direction, or nearly (a cosine), for an object to be taken out.
_MIN_GRASPS, _TOWARDS = 6, 0.85
_HALF_HAND = 0.115  # of its width, with some room [m]
_MIN_CLEAR = 5  # grasps clear of the table with which a stable pose is one to start from
_MAX_WIDTH = 0.0765  # between the pads [m]; they open 80 mm
_ROOM_FRONT = 0.04  # room is kept for an object this far from the open side at most [m]
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


def starts(asset: Asset) -> tuple[int, ...]:
    """Stable poses on the table in which a hand can take the asset; all of them if there is none."""
    everything = tuple(range(len(asset.stable_poses)))
    if asset.grasps is None:
        return everything
    narrow = asset.grasps.clear[asset.grasps.widths < _MAX_WIDTH]
    return tuple(i for i in everything if narrow[:, i].sum() >= _MIN_CLEAR) or everything


def hand_room(asset: Asset, part: MovingPart, stable: int, yaw: float) -> bool:
    """Whether grasps enough come from above, or for what is behind a door from the front."""
    grasps = asset.grasps
    if grasps is None:
        return False
    cavity = _cavity(part)
    towards = (
        np.array([0.0, 0.0, -1.0]) if cavity.moves_with_part else np.append(-outwards_of(part), 0.0)
    )
    approaches = grasps.poses[:, :3, 2] @ resting(asset, stable, yaw).rotation.T
    usable = (approaches @ towards > _TOWARDS) & grasps.clear[:, stable]
    return int((usable & (grasps.widths < _MAX_WIDTH)).sum()) >= _MIN_GRASPS


@dataclass(frozen=True)
class Placement:
    """A thing that lies in a cavity: place `(2,)` of its box from the centre, reach `(3,)` [m]."""

    place: Float[np.ndarray, "2"]
    reach: Float[np.ndarray, "3"]


def resting(asset: Asset, stable: int, yaw: float) -> Resting:
    """The asset in a stable pose, turned by `yaw` [rad] about the vertical."""
    rest = asset.stable_poses[stable]
    rotation = rotation_about(_UP, yaw) @ rest.rotation
    label = rotation @ asset.label.rotation
    half = asset.label.extents / 2
    if asset.label.symmetry.axial:
        along = np.abs(label[:, 0])
        radius = half[1:].max()
        reach = along * half[0] + np.sqrt(np.clip(1 - along**2, 0, 1)) * radius
    else:
        reach = np.abs(label) @ half
    return Resting(rotation, (rotation @ asset.label.origin)[:2], reach, rest.height)


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
    ways = ways_to_lie(asset, _cavity(part))
    if not ways:
        lengths = " x ".join(f"{1000 * v:.0f}" for v in asset.label.extents)
        room = " x ".join(f"{1000 * v:.0f}" for v in _cavity(part).extents)
        raise InputError(
            f"{asset.folder}: {asset.name} measures {lengths} mm and fits the cavity of "
            f"{part.name!r} ({room} mm) in no stable pose"
        )
    return ways


def ways_out(asset: Asset, part: MovingPart) -> tuple[tuple[int, float], ...]:
    """Those of `ways_into` out of which a hand can take the asset.

    Raises:
      InputError: There is none.
    """
    ways = tuple(way for way in ways_into(asset, part) if hand_room(asset, part, *way))
    if not ways:
        raise InputError(
            f"part {part.name!r}: a gripper that opens 80 mm can take none of {asset.name} out of it; "
            "choose narrower objects"
        )
    return ways


class CavityPlacement:
    """Where the objects of a pool lie in the cavity behind a part; the first is what the episode is about."""

    def __init__(self, pool: ObjectPool, part: MovingPart, *, taken: bool) -> None:
        """Looks up every way to lie.

        Args:
          pool: Of objects.
          part: In question.
          taken: Whether the first object is to be taken out: it lies so that a hand can.

        Raises:
          InputError: An object does not fit the cavity, or the first cannot be taken out of it.
        """
        self._assets = tuple(entity.asset for entity in pool.entities)
        self._part = part
        self._ways = [ways_into(asset, part) for asset in self._assets]
        self._own = ways_out(self._assets[0], part) if taken else self._ways[0]

    def inside(
        self, rng: np.random.RandomState, *, front: float, room: float = 0.0
    ) -> tuple[Placement, Float[np.ndarray, "4 4"]]:
        """A place for the object in the empty cavity, and `T_cavity_object` there.

        Args:
          rng: Draws the way to lie and the place.
          front: At most this far from the open side [m].
          room: For fingers around it, towards walls and towards others [m].
        """
        part = self._part
        stable, yaw = self._own[rng.randint(len(self._own))]
        lying = resting(self._assets[0], stable, yaw)
        placement = sample_placement(
            lying,
            _cavity(part),
            [],
            rng,
            outwards=outwards_of(part),
            front=front,
            room=room,
        )
        assert placement is not None  # it fits, and nothing is in its way
        pose = lying.pose(_cavity(part), placement.place)
        return Placement(placement.place, placement.reach + room), pose

    def beside(
        self, rng: np.random.RandomState, count: int, placement: Placement | None = None
    ) -> dict[int, Float[np.ndarray, "4 4"]]:
        """Up to `count` other objects in the cavity that leave room for the object.

        Args:
          rng: Draws which and where.
          count: How many others at most.
          placement: Where the object lies; None: room is kept for it somewhere near the open side.

        Returns:
          Their indices, with `T_cavity_object` of each.
        """
        if not count:
            return {}
        part = self._part
        if placement is None:
            placement, _ = self.inside(rng, front=_ROOM_FRONT)
        taken, found = [placement], {}
        for other in 1 + rng.permutation(len(self._assets) - 1)[:count]:
            ways = self._ways[other]
            stable, yaw = ways[rng.randint(len(ways))]
            lying = resting(self._assets[other], stable, yaw)
            place = sample_placement(lying, _cavity(part), taken, rng, outwards=outwards_of(part))
            if place is not None:
                taken.append(place)
                found[int(other)] = lying.pose(_cavity(part), place.place)
        return found


def outwards_of(part: MovingPart) -> Float[np.ndarray, "2"]:
    """The open side of a part's cavity, along x or y of the object frame."""
    assert part.handle is not None
    outwards = part.handle.rotation[:2, 1]
    axis = int(np.argmax(np.abs(outwards)))
    return np.eye(2)[axis] * np.sign(outwards[axis])


def _cavity(part: MovingPart) -> Cavity:
    assert part.cavity is not None  # the furniture pool has seen to it
    return part.cavity
