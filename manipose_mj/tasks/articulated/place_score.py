"""How well the arm can use a drawer or door of furniture that stands somewhere: by tables, without a trial.

At every place the hand is followed along the part's travel: each of its poses has to be reachable, with hand,
wrist and forearm clear of the furniture and of what that stands on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.assets.asset import MovingPart
from manipose_mj.assets.franka_hand import MAX_OPENING
from manipose_mj.mjcf.arena import FIXED_CAMERAS
from manipose_mj.mjcf.panda.geometry import CAPSULES
from manipose_mj.mjcf.panda.kinematics import HOME, link_poses, tcp_pose
from manipose_mj.mjcf.panda.reachability import is_reachable
from manipose_mj.poses import invert
from manipose_mj.tasks.articulated.hand_places import (
    HandPlaces,
    around_the_bar,
    before_the_bar,
    behind_the_door,
    chained,
    on_the_front,
)
from manipose_mj.tasks.articulated.part_shape import WIDE_OPEN, PartShape, part_motion

LAYERS = 10  # openings looked at
COMPLETE = (
    0.9  # a score from which on the arm can move the part all the way, in two stages at least
)
TRAVEL = 0.95  # of the joint's range, over which the hand is followed
_STEPS = 2  # tilts between layers
_AJAR = 0.5  # of a door, to be pushed on from inside [rad]
_EASE = 0.1  # how much the share of tilts counts that the arm can choose from
# Points of the hand in the TCP's frame, and how far each has to be from furniture [m].
_PALM = [(0.0, y, z, 0.020) for y in (-0.085, 0.0, 0.085) for z in (-0.06, -0.09)]
_HAND = np.array([*_PALM, (0.0, 0.0, -0.15, 0.055), (0.0, 0.0, -0.21, 0.065)])
# Of a finger's outer side: from the pad's inner side, from the TCP along the approach [m].
_FINGER = ((0.0145, 0.008), (0.0145, -0.009), (0.0230, -0.010), (0.0258, -0.045))
_FINGER_ROOM = 0.002
_WRIST = np.array([0.0, 0.0, -0.21])
_SHOULDER = np.array([0.0, 0.0, 0.333])
_FOREARM = np.array([0.2, 0.4, 0.6])  # points between wrist and shoulder
_FOREARM_RADIUS = 0.07
_RADII = np.append(_HAND[:, 3], np.full(len(_FOREARM), _FOREARM_RADIUS))
_OPENING_MARGIN = 0.012  # of the fingers as they come, beside what they take, in all [m]
_STANDOFF = 0.07  # from which the handle is approached [m]
# The robot's foot and shoulder, and the arm at home, which nothing may come near, lest it cannot leave [m].
_FOOT = np.array([(0.0, 0.0, z) for z in np.arange(-1.2, 0.5, 0.1)])
_FOOT_RADIUS = 0.21
_HAND_RADIUS, _HOME_ROOM = 0.10, 0.035
_OBJECT_RADIUS = 0.06
# From the camera that every picture of an episode is taken from, to the handle; and room around it [m].
_CAMERA = np.array(FIXED_CAMERAS["overview"][0])
_SIGHT = np.linspace(0.0, 1.0, 16)[:, None]
_CAMERA_RADIUS = 0.25


@dataclass(frozen=True)
class PlaceScore:
    """Scores places of one part.

    Attributes:
      part: Has a handle.
      shape: Where it is.
      layer: Of `LAYERS` openings the one at which the part starts, to be shut; 0: to be opened.
      back: Whether it is to be shut again after it was opened so far that a hand can reach in.
      objects: `(n, 3)`, where objects may be, in the base frame [m]; the part stays off there.
      fingertips: Whether the handle is held by its front only, for which there is more room.
    """

    part: MovingPart
    shape: PartShape
    layer: int = 0
    back: bool = False
    objects: Float[np.ndarray, "n 3"] | None = None
    fingertips: bool = False

    def __call__(
        self, bases: Float[np.ndarray, "c 4 4"], floors: Float[np.ndarray, "c"]
    ) -> Float[np.ndarray, "c"]:
        """`COMPLETE` and more where the arm can move the part all the way; below 0 where it cannot stand.

        Args:
          bases: `T_base_object`.
          floors: Height of what the hand has to stay above [m].
        """
        motions = self._motions()
        result = np.full(len(bases), -1.0)
        chosen = np.flatnonzero(self._robot_clear(bases, motions) & self._seen(bases))
        if not len(chosen):
            return result
        around = _Surroundings(self.shape, bases[chosen], motions, floors[chosen])
        if self.layer:
            value, ease = self._shutting(around, self.layer)
        else:
            value, ease = self._opening(around)
            if self.back:
                value = np.minimum(value, 0.5 + 0.5 * self._shutting(around, LAYERS - 1)[0])
        result[chosen] = value + _EASE * ease
        return result

    def _opening(self, around: _Surroundings) -> tuple[np.ndarray, np.ndarray]:
        """Share of the travel, and of the hand's poses there, as the handle leads; then from inside."""
        led, ease = np.zeros(len(around.bases)), np.zeros(len(around.bases))
        for grip in around_the_bar(self.part, fingertips=self.fingertips):
            way = chained(around.free(grip), _STEPS, seed=around.approached(grip))
            led = np.maximum(led, _share(way))
            ease = np.maximum(ease, way.mean(axis=(1, 2)))
        value = led.copy()
        if self.part.joint.kind == "hinge":
            ajar_share = min(_AJAR / self._travel(), 1.0)
            for hold in behind_the_door(self.part, self.shape):
                ajar = np.flatnonzero((value < COMPLETE) & (led >= ajar_share))
                if not len(ajar):
                    break
                # Backwards from the wide open door: from which layers on it can be pushed.
                free = around.of(ajar).free(hold)
                pushed = np.any(chained(free[:, ::-1], _STEPS), axis=2)[:, ::-1]
                last = np.round(led[ajar] * (LAYERS - 1)).astype(int)
                value[ajar[pushed[np.arange(len(ajar)), last]]] = COMPLETE
        return value, ease

    def _shutting(self, around: _Surroundings, layer: int) -> tuple[np.ndarray, np.ndarray]:
        """The same for shutting it from a layer, by a push before it or by the handle."""
        value, ease = np.zeros(len(around.bases)), np.zeros(len(around.bases))
        pushes = (*before_the_bar(self.part), *on_the_front(self.part, self.shape))
        for hold in (*pushes, *around_the_bar(self.part)):
            open_ = np.flatnonzero(value < 1.0)
            if not len(open_):
                break
            way = chained(around.of(open_).free(hold)[:, layer::-1], _STEPS)
            value[open_] = np.maximum(value[open_], _share(way))
            ease[open_] = np.maximum(ease[open_], way.mean(axis=(1, 2)))
        return value, ease

    def stays_off(
        self, bases: Float[np.ndarray, "c 4 4"], points: Float[np.ndarray, "n 3"], radius: float
    ) -> Bool[np.ndarray, "c"]:
        """Whether the furniture, and the part all along, stays off some points.

        Args:
          bases: `T_base_object`.
          points: In the base frame [m].
          radius: How near it may not come to any of them [m].
        """
        return self._clear_of(invert(bases), points, radius, self._motions())

    def _travel(self) -> float:
        """Of the joint [m or rad]."""
        travel = TRAVEL * float(np.ptp(self.part.joint.range))
        reached_into = self.back and self.part.joint.kind == "hinge"
        return min(travel, WIDE_OPEN) if reached_into else travel

    def _motions(self) -> Float[np.ndarray, "k 4 4"]:
        """Of the part, at each opening looked at."""
        openings = self.part.joint.range[0] + self._travel() * np.linspace(0, 1, LAYERS)
        return np.stack([part_motion(self.part, float(q)) for q in openings])

    def _robot_clear(self, bases: np.ndarray, motions: np.ndarray) -> Bool[np.ndarray, "c"]:
        """Whether the furniture, and the part all along, stays off the robot's foot, the arm at home and
        the objects."""
        clear = np.ones(len(bases), bool)
        base_points = [(_FOOT, _FOOT_RADIUS, True), (*_arm_at_home(), False)]
        if self.objects is not None:
            base_points.append((self.objects, _OBJECT_RADIUS, True))
        inverse = invert(bases)
        for points, radius, always in base_points:
            # The arm is at home at first, when the part is shut or, where it is to be shut, open.
            own = motions if always else motions[[0, self.layer]]
            clear &= self._clear_of(inverse, points, radius, own)
        return clear

    def _clear_of(
        self,
        inverse: Float[np.ndarray, "c 4 4"],
        points: Float[np.ndarray, "n 3"],
        radius: float | Float[np.ndarray, "n"],
        motions: Float[np.ndarray, "m 4 4"],
    ) -> Bool[np.ndarray, "c"]:
        """Of `T_object_base`, points in the base frame [m] and motions of the part."""
        local = np.einsum("cij,nj->cni", inverse[:, :3, :3], points) + inverse[:, None, :3, 3]
        clear = np.all(_distance(local, self.shape.fixed) > radius, axis=1)
        for motion in motions:
            back = invert(motion)
            moved = local @ back[:3, :3].T + back[:3, 3]
            clear &= (_distance(moved, self.shape.moving[None]) > radius).all(axis=1)
        return clear

    def _seen(self, bases: np.ndarray) -> Bool[np.ndarray, "c"]:
        """Whether the camera sees the handle of the shut part, past the furniture."""
        handle = self.part.handle
        assert handle is not None
        before = handle.origin + (handle.extents[1] / 2 + 0.02) * handle.rotation[:, 1]
        camera = (invert(bases) @ np.append(_CAMERA, 1.0))[:, None, :3]
        sight = (1 - _SIGHT) * before + _SIGHT * camera
        boxes = np.concatenate([self.shape.fixed, self.shape.moving[None]])
        room = _distance(camera[:, 0], boxes) > _CAMERA_RADIUS
        return room & (_distance(sight, boxes) > 0).all(axis=1)


@dataclass(frozen=True)
class _Surroundings:
    """The furniture at every place: `T_base_object` `(c, 4, 4)`, the part's motions `(k, 4, 4)`, floors `(c,)`."""

    shape: PartShape
    bases: Float[np.ndarray, "c 4 4"]
    motions: Float[np.ndarray, "k 4 4"]
    floors: Float[np.ndarray, "c"]

    def of(self, chosen: Int[np.ndarray, "p"]) -> _Surroundings:
        """The same at some of the places."""
        return _Surroundings(self.shape, self.bases[chosen], self.motions, self.floors[chosen])

    def free(self, hold: HandPlaces) -> Bool[np.ndarray, "c k t"]:
        """Which of the hand's places the arm can take, clear of furniture and floor."""
        local = self.motions[:, None] @ hold.poses[None]
        found = is_reachable(self.bases[:, None, None] @ local[None])
        c, k, t = np.nonzero(found)
        found[c, k, t] = self._clear(c, k, local[k, t], hold.opening)
        return found

    def approached(self, hold: HandPlaces) -> Bool[np.ndarray, "c t"]:
        """Whether the hand can come to each place with its fingers open, from a little way back, while the part
        is shut."""
        assert hold.opening is not None
        wide = min(hold.opening + _OPENING_MARGIN, MAX_OPENING)
        back = hold.poses.copy()
        back[:, :3, 3] -= _STANDOFF * back[:, :3, 2]
        found = np.ones((len(self.bases), len(back)), bool)
        for local in (hold.poses, back):
            found &= is_reachable(self.bases[:, None] @ local[None])
            c, t = np.nonzero(found)
            found[c, t] = self._clear(c, np.zeros(len(c), int), local[t], wide)
        return found

    def _clear(
        self,
        c: Int[np.ndarray, "p"],
        k: Int[np.ndarray, "p"],
        tcp: Float[np.ndarray, "p 4 4"],
        opening: float | None,
    ) -> Bool[np.ndarray, "p"]:
        """Of places `c`, layers `k`, `T_object_tcp` and the opening of the fingers [m]."""
        shoulder = (invert(self.bases) @ np.append(_SHOULDER, 1.0))[c][:, None, :3]
        hand = _points(tcp, _HAND[:, :3])
        wrist, shares = _points(tcp, _WRIST[None]), _FOREARM[None, :, None]
        points = np.concatenate([hand, (1 - shares) * wrist + shares * shoulder], axis=1)
        height = self.bases[c, 2, 3][:, None] + points[..., 2]
        free = np.all(height > self.floors[c][:, None] + _RADII, axis=1)
        back, moving = invert(self.motions)[k], self.shape.moving[None]

        def moved(points: Float[np.ndarray, "p n 3"]) -> Float[np.ndarray, "p n 3"]:
            return points @ back[:, :3, :3].transpose(0, 2, 1) + back[:, None, :3, 3]

        free &= (_distance(points, self.shape.fixed) > _RADII).all(axis=1)
        free &= (_distance(moved(points), moving) > _RADII).all(axis=1)
        if opening is not None:
            sides = [(0.0, way * (opening / 2 + y), z) for y, z in _FINGER for way in (1, -1)]
            fingers = _points(tcp, np.array(sides))
            free &= (_distance(fingers, self.shape.beside) > _FINGER_ROOM).all(axis=1)
            free &= (_distance(moved(fingers), moving) > _FINGER_ROOM).all(axis=1)
        return free


def _share(way: Bool[np.ndarray, "c k t"]) -> Float[np.ndarray, "c"]:
    """How much of the travel each chain covers; 0 where it does not begin."""
    covered = way.any(axis=2)
    return np.maximum(covered.sum(axis=1) - 1, 0) / max(way.shape[1] - 1, 1)


def _points(
    poses: Float[np.ndarray, "p 4 4"], points: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "p n 3"]:
    return points @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]


def _distance(
    points: Float[np.ndarray, "*p 3"], boxes: Float[np.ndarray, "b 2 3"]
) -> Float[np.ndarray, "*p"]:
    """Of points from the nearest of some boxes [m]."""
    least = np.full(points.shape[:-1], np.inf)
    for low, high in boxes:
        beyond = np.maximum(np.maximum(low - points, points - high), 0.0)
        np.minimum(least, np.sqrt((beyond**2).sum(axis=-1)), out=least)
    return least


def _arm_at_home() -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n"]]:
    """Points along links and hand at home, in the base frame, and how near nothing may come to each [m]."""
    shares = np.linspace(0, 1, 5)[:, None]
    links = link_poses(HOME)
    points, radii = [], []
    for i, link in enumerate(links, 1):
        for ends, radius in CAPSULES[f"link{i}"]:
            a, b = (link[:3, :3] @ np.array(end) + link[:3, 3] for end in (ends[:3], ends[3:]))
            points.append((1 - shares) * a + shares * b)
            radii.append(np.full(len(shares), radius + _HOME_ROOM))
    points.append((1 - shares) * links[-1][:3, 3] + shares * tcp_pose(HOME)[:3, 3])
    radii.append(np.full(len(shares), _HAND_RADIUS))
    return np.concatenate(points), np.concatenate(radii)
