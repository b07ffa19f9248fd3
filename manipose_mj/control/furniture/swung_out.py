"""A door that stands open: its panel stands out of the body, and its hinge is where that meets the front."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.furniture.fit.furniture_fit import fit_furniture
from manipose_mj.control.furniture.sensing.part_sensing import SensedFurniture, SensedPart
from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.control.furniture.shapes.body_shape import foremost, front_of
from manipose_mj.control.furniture.shapes.door_line import DoorLine, longest_line
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel, PartModel
from manipose_mj.control.furniture.shapes.handle_shape import ACROSS_FRONT, UP_FRONT
from manipose_mj.poses import compose, invert, rotation_about, transform

_FRONT_MISTAKEN = 0.05  # how far the front is from where the body is seen to end, at most [m]
_LEAST_OUT = 0.06  # how far a door stands out of the body: handles stand out less [m]
_ALONG = 0.4  # cosine between normals of a door and its hinge, at most
_PLANE, _SLOPE = (
    0.012,
    0.02,
)  # how far points of a door are from its plane [m], and more for each metre from its hinge
_LEAST, _SMALLEST = 200, 0.08  # points of a door; its sides [m]
_AJAR, _WIDEST = 0.5, 3.3  # openings at which a door stands out, or beside the body [rad]
# Of a door that turned by about half a turn: how far beside the body, and how little behind the front, its points are [m].
_BESIDE_BODY, _NOT_BEHIND = 0.03, 0.05
# Between the faces of a door [m]: where neither both show nor the rim that it shuts against, at least, at most.
_THICKNESS, _THINNEST, _THICKEST = 0.018, 0.008, 0.05
_ONE_FACE = 0.006  # how far points of a face are from it [m]
# How far a face may be turned against its normals [rad], and how many more points are then on its line.
_MISTURNED, _CLEARLY_MORE = 0.1, 1.5
_FACES = 0.7  # cosine between their normals and the face's, at least
_BEHIND = (0.03, 0.3)  # how far behind the front the sides of the body are looked for [m]
# Of the front of the body: cosine of its normals and X, at least; how far it may be from where it is thought to be, and bins
# in which points are counted [m].
_FRONT_FACES, _MISTAKEN, _BIN = 0.9, 0.2, 0.005
_EDGE = 0.06  # how far hinges are from a side of the body [m]
_GAP = 0.08  # how far from its hinge a door begins to show, at most [m]
_HANDLE = (0.012, 0.08)  # how far points of a handle are before the panel [m]
_HANDLE_LEAST = 30  # such points
_BESIDE, _BEHIND_PANEL = 0.03, 0.06  # how far beside and behind it estimates have handles [m]
_FREE = 0.85  # where handles are, as a share of the way from the hinge to the free edge
# Of what a door shuts: in which points are counted, what is its rim, how far walls are from its place [m].
_CELL, _RIM, _WALL = 0.02, 0.03, 0.015
_NEAR_DOOR = np.array([0.1, 0.15, 0.15])  # of a door, with its handle [m]
_MOST_WALLED, _MOST_STRAY = 0.5, 0.03
_QUARTERS = (0.0, np.pi / 2, -np.pi / 2)  # by which the front may have been mistaken [rad]


@dataclass(frozen=True)
class _Swung:
    """Attributes: on: points of the door; across: axis of the object frame from hinge to free edge, shut; line: its outer
    face; hinge: along X and across `(2,)` [m]; thickness [m]."""

    on: Bool[np.ndarray, "n"]
    across: int
    line: DoorLine
    hinge: Float[np.ndarray, "2"]
    thickness: float


@dataclass(frozen=True)
class OpenDoor:
    """A door that its panel showed.

    Attributes:
      sensed: Where it is and how it turns.
      panel: Low and high corner, shut, object frame [m].
      back: `T_object_world`, which shuts it.
      handle_seen: Whether points stand out of the panel where the handle is, otherwise a guess.
      walled: Share of what it shuts where there is a wall.
      stray: Share of all points that are before the front, and not near the door.
    """

    sensed: SensedPart
    panel: Float[np.ndarray, "2 3"]
    back: Float[np.ndarray, "4 4"]
    handle_seen: bool
    walled: float
    stray: float

    @property
    def fits(self) -> bool:
        """Whether it can be a door of the front; otherwise a side of the body was taken for the front."""
        return self.walled < _MOST_WALLED and self.stray < _MOST_STRAY

    def carries(self, place: Float[np.ndarray, "3"]) -> bool:
        """Whether a place, world frame [m], is on its front, as a handle is."""
        local = transform(self.back, place[None])[0]
        low, high = self.panel - [
            [_BEHIND_PANEL, _BESIDE, _BESIDE],
            [-_HANDLE[1], -_BESIDE, -_BESIDE],
        ]
        return bool(((local > low) & (local < high)).all())


def swung_out(model: FurnitureModel, cloud: SceneCloud) -> OpenDoor | None:
    """A door whose panel stands out of the body's edge; None where none does.

    Args:
      model: Of the furniture, its front about right.
      cloud: Of it, with normals.
    """
    points = transform(invert(model.pose), cloud.points)
    normals = cloud.normals @ model.pose[:3, :3]
    front, seen = model.front, front_of(points)
    if seen is not None and abs(seen - front) > _FRONT_MISTAKEN:
        front = seen
    standing = points[:, 0] > front + _LEAST_OUT
    # Doors turn about the vertical, flaps about the level; what turned by half a turn stands beside the body.
    ways = [(1, standing), (2, standing), (1, _beside_body(points[:, :2], front))]
    doors: list[tuple[bool, int, OpenDoor]] = []
    for across, out in ways:
        swung = _swung(points, normals, front, across, out)
        if swung is not None:
            door = _opened(model.pose, points, normals, swung)
            doors.append((door.fits, int(swung.on.sum()), door))
    return max(doors, key=lambda each: each[:2])[2] if doors else None


def _opened(
    pose: Float[np.ndarray, "4 4"],
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    swung: _Swung,
) -> OpenDoor:
    """The door of a line, of furniture at `T_world_object`."""
    inwards, opening = swung.line.inwards, swung.line.opening
    axis, origin = np.zeros(3), np.zeros(3)
    axis[3 - swung.across] = inwards if swung.across == 2 else -inwards
    origin[[0, swung.across]] = swung.hinge
    turn = rotation_about(axis, opening)
    motion = compose(turn, origin - turn @ origin)
    shut = transform(invert(motion), points)
    panel = np.percentile(shut[swung.on], [1, 99], axis=0)
    panel[1, 0] = swung.hinge[0] + swung.thickness
    handle, seen = _handle_guess(shut, panel, swung)
    sensed = SensedPart(
        handle=pose @ motion @ handle,
        kind="hinge",
        origin=transform(pose, origin[None])[0],
        axis=pose[:3, :3] @ axis,
        opening=opening,
        confidence=1.0,
    )
    walled = _walled(points[~swung.on], normals[~swung.on], panel)
    near = (np.abs(shut - panel.mean(axis=0)) < np.ptp(panel, axis=0) / 2 + _NEAR_DOOR).all(axis=1)
    stray = float(((points[:, 0] > panel[1, 0] + _LEAST_OUT) & ~near).mean())
    return OpenDoor(sensed, panel, invert(pose @ motion), seen, walled, stray)


def open_door_of(
    cloud: SceneCloud, sensed: SensedFurniture, model: FurnitureModel
) -> tuple[SensedFurniture, OpenDoor] | None:
    """A door that stands open, and what was sensed with the front where that door is; None where none shows.

    Args:
      cloud: Of the furniture, with normals.
      sensed: Its front and parts: the front may be a side.
      model: What they were fitted to.
    """
    first = None
    for quarter in _QUARTERS:
        turned, fitted = sensed, model
        if quarter:
            front = rotation_about(np.array([0.0, 0.0, 1.0]), quarter) @ sensed.front
            turned = replace(sensed, front=front)
            fitted = fit_furniture(cloud, turned, model.category)
        door = swung_out(fitted, cloud)
        if door is not None and door.fits:
            return turned, door
        first = first or (None if door is None else (turned, door))
    # What was sensed to stand open may be right where no door that is seen fits.
    return None if any(part.opening > 0.0 for part in model.parts) else first


def with_open_door(sensed: SensedFurniture, door: OpenDoor) -> SensedFurniture:
    """The same with this door instead of all that was sensed on it; of that, its handle where no better one shows."""
    on = [door.carries(part.handle[:3, 3]) for part in sensed.parts]
    handles = [part for part, its in zip(sensed.parts, on, strict=True) if its]
    others = tuple(part for part, its in zip(sensed.parts, on, strict=True) if not its)
    part = door.sensed
    if handles and not door.handle_seen:
        part = replace(part, handle=max(handles, key=lambda each: each.confidence).handle)
    return replace(sensed, parts=(part, *others))


def as_seen_open(part: PartModel, door: OpenDoor, pose: Float[np.ndarray, "4 4"]) -> PartModel:
    """A door with the hinge and opening that its panel shows; `pose` is `T_world_object`."""
    to_object, sensed = invert(pose), door.sensed
    joint = replace(
        part.part.joint,
        origin=transform(to_object, sensed.origin[None])[0],
        axis=to_object[:3, :3] @ sensed.axis,
    )
    moved = replace(part, part=replace(part.part, joint=joint), opening=sensed.opening)
    return moved.opening_to(max(joint.range[1], sensed.opening))


def as_large_as(part: PartModel, door: OpenDoor) -> PartModel:
    """A door at least as large as its panel shows, which handles of neighbours may have cut short."""
    panel = part.panel.copy()
    panel[0, 1:] = np.minimum(panel[0, 1:], door.panel[0, 1:])
    panel[1, 1:] = np.maximum(panel[1, 1:], door.panel[1, 1:])
    return replace(part, panel=panel)


def _swung(
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    front: float,
    across: int,
    out: Bool[np.ndarray, "n"],
) -> _Swung | None:
    """A door about the axis that neither X nor `across` is: of the points `out` there, a line, seen along that axis."""
    flat, faces = points[:, [0, across]], normals[:, [0, across]]
    out = out & (np.abs(normals[:, 3 - across]) < _ALONG)
    line = longest_line(flat[out]) if out.sum() >= _LEAST else None
    if line is None:
        return None
    rest = np.abs(line.before(flat)) > 2 * _PLANE
    facing = points[rest & (normals[:, 0] > _FRONT_FACES), 0]
    seen = foremost(facing, front, _MISTAKEN)
    front = front if seen is None else seen
    body = (points[:, 0] < front - _BEHIND[0]) & (points[:, 0] > front - _BEHIND[1])
    if body.sum() < _LEAST:
        return None
    sides = np.percentile(points[body, across], [1, 99])
    line = line.away_from(sides)
    line = replace(line, inwards=_inwards(line, flat[out], front, sides, across))
    line, thickness = _outer_face(line, flat[out], faces[out], _rim_depth(facing, front))
    if not _AJAR < line.opening < _WIDEST:
        return None
    # Most hinges are at the inner face; that is where the body's rim is, if not where its front is.
    rim = np.abs(facing - (front - thickness)) < 2 * _BIN
    inner = line.moved(-thickness)
    x = front - thickness if rim.sum() > _LEAST else front
    hinge = inner.meeting(x, sides)
    before, along = line.before(flat), (flat - hinge) @ line.way
    off = _PLANE + _SLOPE * np.maximum(along, 0.0)
    on = (before < off) & (before > -thickness - off) & (along > -_PLANE)
    on &= (points[:, 0] > front) | (along > _BESIDE_BODY)
    if not on.any():
        return None
    begins, ends = np.percentile(along[on], [1, 99])
    upright = float(np.ptp(np.percentile(points[on, 3 - across], [1, 99])))
    inside = sides[0] - _EDGE < hinge[1] < sides[1] + _EDGE
    if not inside or begins > _GAP or min(upright, ends - begins) < _SMALLEST:
        return None
    return _Swung(on, across, line, hinge, thickness)


def _beside_body(flat: Float[np.ndarray, "n 2"], front: float) -> Bool[np.ndarray, "n"]:
    """Points to either side of the body, not behind its front: of a door that turned by about half a turn."""
    body = flat[(flat[:, 0] < front - _NOT_BEHIND) & (flat[:, 0] > front - _BEHIND[1]), 1]
    if len(body) < _LEAST:
        return np.zeros(len(flat), bool)
    low, high = np.percentile(body, [1, 99]) + [-_BESIDE_BODY, _BESIDE_BODY]
    return ((flat[:, 1] < low) | (flat[:, 1] > high)) & (flat[:, 0] > front - _NOT_BEHIND)


def _inwards(
    line: DoorLine,
    flat: Float[np.ndarray, "n 2"],
    front: float,
    sides: Float[np.ndarray, "2"],
    across: int,
) -> float:
    """Sign of the way from the hinge of a door to its free edge, shut.

    Away from the side of the body where the hinge is; elsewhere towards where there is room, or else by the smaller turn.
    A flap shuts upwards, where there is room for it.
    """
    hinge = float(line.meeting(front, sides)[1])
    near = np.abs(sides - hinge)
    if across == 1 and near.min() < _EDGE:
        return 1.0 if near.argmin() == 0 else -1.0
    length = float(np.percentile((flat - [front, hinge]) @ line.way, 99))
    upwards, downwards = hinge + length < sides[1] + _EDGE, hinge - length > sides[0] - _EDGE
    if upwards and downwards and across == 1:
        return 1.0 if line.way[1] > 0 else -1.0
    return 1.0 if upwards else -1.0


def _outer_face(
    line: DoorLine, flat: Float[np.ndarray, "n 2"], faces: Float[np.ndarray, "n 2"], usual: float
) -> tuple[DoorLine, float]:
    """The line of the outer face, and how far behind it the inner one is [m]: `usual`, where one alone shows."""
    near = np.abs(line.before(flat)) < _THICKEST
    flat, faces = flat[near], faces[near]
    outer, inner = (sign * (faces @ line.outwards) > _FACES for sign in (1.0, -1.0))
    outer_shows, inner_shows = outer.sum() >= _LEAST, inner.sum() >= _LEAST
    if not outer_shows and not inner_shows:
        return line, usual
    shown, sign = (outer, 1.0) if outer_shows else (inner, -1.0)
    off = line.before(flat[shown])
    on_face = np.abs(off - np.median(off)) < _ONE_FACE
    # Its normals tell better than its points how it is turned: frames stand before panes.
    normal = sign * np.median(faces[shown][on_face], axis=0)
    way = line.inwards * np.array([-normal[1], normal[0]]) / np.linalg.norm(normal)
    line = replace(line, middle=flat[shown][on_face].mean(axis=0), way=way)
    line = _along_points(line, flat[shown])
    if not outer_shows:
        return line.moved(usual), usual
    if not inner_shows:
        return line, usual
    # A frame around a pane is as thick as the door.
    behind = float(-np.percentile(line.before(flat[inner]), 10))
    return line, float(np.clip(behind, _THINNEST, _THICKEST))


def _along_points(line: DoorLine, face: Float[np.ndarray, "n 2"]) -> DoorLine:
    """The line of a face as its points lie, if many more are on it than by their normals."""
    found = longest_line(face)
    if found is None or abs(float(found.way @ line.way)) < np.cos(_MISTURNED):
        return line
    way = found.way if found.way @ line.way > 0 else -found.way
    found = replace(line, middle=found.middle, way=way)
    counts = [int((np.abs(each.before(face)) < _ONE_FACE).sum()) for each in (line, found)]
    return found if counts[1] > _CLEARLY_MORE * counts[0] else line


def _rim_depth(facing: Float[np.ndarray, "n"], front: float) -> float:
    """How far behind the front the rim is that a door shuts against, and so how thick the door is [m]."""
    behind = front - facing
    behind = behind[(behind > _THINNEST) & (behind < _THICKEST)]
    counts, edges = np.histogram(behind, np.arange(_THINNEST, _THICKEST, _BIN))
    if counts.max() < _LEAST:
        return _THICKNESS
    place = edges[int(counts.argmax())] + _BIN / 2
    return float(np.median(behind[np.abs(behind - place) < _BIN]))


def _walled(
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    panel: Float[np.ndarray, "2 3"],
) -> float:
    """Share of a shut panel, without its rim, where a wall is, of points that are not the door's."""
    low, high = panel + np.array([[-_WALL, _RIM, _RIM], [_WALL, -_RIM, -_RIM]])
    counts = np.floor((high - low)[1:] / _CELL).astype(int)
    if (counts < 1).any():
        return 0.0
    on = ((points > low) & (points < high)).all(axis=1) & (np.abs(normals[:, 0]) > _FACES)
    cells = np.floor((points[on, 1:] - low[1:]) / _CELL).astype(int)
    return len(np.unique(cells, axis=0)) / float(np.prod(counts))


def _handle_guess(
    shut: Float[np.ndarray, "n 3"], panel: Float[np.ndarray, "2 3"], swung: _Swung
) -> tuple[Float[np.ndarray, "4 4"], bool]:
    """`T_object_handle`, about where points stand out of the panel, or else near its free edge; X along the hinge.

    And which of the two it is.
    """
    front = float(panel[1, 0])
    out = shut[:, 0] - front
    on = (out > _HANDLE[0]) & (out < _HANDLE[1])
    on &= ((shut > panel[0]) & (shut < panel[1]))[:, 1:].all(axis=1)
    place = panel.mean(axis=0)
    near, far = panel[:, swung.across] if swung.line.inwards > 0 else panel[::-1, swung.across]
    place[swung.across] = near + _FREE * (far - near)
    seen = int(on.sum()) > _HANDLE_LEAST
    if seen:
        place = np.median(shut[on], axis=0)
    place[0] = front + 0.03
    return compose(ACROSS_FRONT if swung.across == 2 else UP_FRONT, place), seen
