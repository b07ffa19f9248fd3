"""The panel of a door that stands open, followed from its handle to its hinge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.furniture.shapes.body_shape import foremost
from manipose_mj.control.furniture.shapes.door_line import DoorLine, longest_line
from manipose_mj.control.furniture.shapes.handle_shape import run_around

# Points that are looked at: how far from the handle along the hinge, before it and behind it, more for each metre from it,
# and beyond it [m]; how much further away than was thought the hinge may be [m]; cosine between their
# normals and the hinge, and the way that the handle stands out.
_ALONG, _BEFORE, _DEEP, _SLOPE, _BEYOND, _FURTHER = 0.30, 0.01, 0.12, 0.15, 0.20, 0.25
_LEVEL, _SAME_WAY = 0.4, 0.92
_LEAST = 150  # points of a panel
_TURNED = float(np.cos(0.2))  # cosine between the panel and the face that the handle is on
# How far points of a panel are from its line [m]; cosine between their normals and the panel's.
_ON_LINE, _FACES = 0.010, 0.85
_GAP, _BESIDE_HANDLE = (
    0.08,
    0.06,
)  # without points, which ends it; how far from the handle it ends at least [m]
_MIDDLE = 0.013  # from the face of a door to its middle [m]
# What is on the line and faces as the front does is no panel's: how far the panel is open at least [rad]; in which points are
# counted along it [m], and how many there are.
_TELLS_APART, _BIN, _BIN_LEAST = 0.12, 0.02, 15
# Of a panel's way out of the front, from which on it may be in line with a side of the body.
_SQUARE = 0.9
# Of the front: cosine between its normals and X; how far its points are from the panel's line, at least, and it is from where
# the hinge is thought to be, at most; how far behind it hinges are [m].
_FRONT_FACES, _OFF_LINE, _MISTAKEN, _HINGE = 0.9, 0.024, 0.08, 0.01
_BODY, _BODY_LEAST = 0.035, 30  # how near a hinge the body is [m]; points of it


def hinge_of_panel(
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    handle: Float[np.ndarray, "4 4"],
    origin: Float[np.ndarray, "3"],
    axis: Float[np.ndarray, "3"],
    agree: float = 0.0,
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]] | None:
    """A point of the hinge, and the panel's way from there to the handle, unit; None where too little of it shows.

    The panel is the line that most points behind the handle are on, seen along the hinge. It ends where its points do, or
    where they begin to face as the front of the body does; the body has to be there. An estimate that is near stays.

    Args:
      points: Of the furniture, object frame [m].
      normals: Theirs.
      handle: `T_object_handle`, as it stands.
      origin: A point of the hinge, as estimated [m].
      axis: Of the hinge, upright or level along the front.
      agree: How far from there the hinge may be to stay there [m].
    """
    along = int(np.abs(axis).argmax())
    plane = [0, 3 - along]
    level = np.abs(points[:, along] - handle[along, 3]) < _ALONG
    flat, faces = points[:, plane] - handle[plane, 3], normals[:, plane]
    thought = origin[plane] - handle[plane, 3]
    near = level & (np.abs(normals[:, along]) < _LEVEL)
    way = _way(handle[plane, 1], thought)
    near &= np.abs(faces @ handle[plane, 1]) > _SAME_WAY
    near &= _behind_handle(flat, handle[plane, 1], way, thought)
    line = longest_line(flat[near]) if near.sum() >= _LEAST else None
    if line is None or abs(float(line.outwards @ handle[plane, 1])) < _TURNED:
        return None
    line = replace(line, way=np.sign(line.way @ way) * line.way)
    if line.outwards @ handle[plane, 1] < 0:
        line = replace(line, inwards=-line.inwards)
    on = near & (np.abs(line.before(flat)) < _ON_LINE)
    on &= np.abs(faces @ line.outwards) > _FACES
    if on.sum() < _LEAST:
        return None
    shows = float(
        np.sign(np.median(faces[on] @ line.outwards))
    )  # the outer face, or else the inner
    if line.way[0] > _SQUARE:
        # The side of the body may be on the line: how it is turned, most normals tell better.
        normal = shows * line.inwards * np.median(faces[on], axis=0)
        line = replace(line, way=np.array([-normal[1], normal[0]]) / np.linalg.norm(normal))
    at = (flat[on] - line.middle) @ line.way
    foot = float(-line.middle @ line.way)  # where the handle is
    end = foot + run_around(at - foot, _GAP)[0]
    end = max(end, _turns(at, foot - _BESIDE_HANDLE, faces[on], shows * line.outwards))
    if line.way[0] > _SQUARE:
        facing = flat[(faces[:, 0] > _FRONT_FACES) & (np.abs(line.before(flat)) > _OFF_LINE), 0]
        front = foremost(facing, float(thought[0]), _MISTAKEN)
        end = _before_front(end, line, float(thought[0]), front)
    place = line.middle + end * line.way
    off = flat - place
    body = level & (np.linalg.norm(off, axis=1) < _BODY)
    body &= (np.abs(off @ line.outwards) > 1.5 * _ON_LINE) | (off @ line.way < -_ON_LINE)
    if body.sum() < _BODY_LEAST:
        return None
    place = place - shows * _MIDDLE * line.outwards
    hinge, way = origin.copy(), np.zeros(3)
    if np.linalg.norm(place - thought) > agree:
        hinge[plane] = place + handle[plane, 3]
    way[plane] = line.way
    return hinge, way


def _way(out: Float[np.ndarray, "2"], thought: Float[np.ndarray, "2"]) -> Float[np.ndarray, "2"]:
    """From a hinge to the handle, along the panel that the handle stands out of; `thought` is from there to the hinge."""
    way = np.array([-out[1], out[0]])
    return way if way @ thought < 0 else -way


def _behind_handle(
    flat: Float[np.ndarray, "n 2"],
    out: Float[np.ndarray, "2"],
    way: Float[np.ndarray, "2"],
    thought: Float[np.ndarray, "2"],
) -> Bool[np.ndarray, "n"]:
    """Points, from the handle [m], that may be of the panel which it stands out of, towards the hinge and beyond."""
    at, before = flat @ way, flat @ out
    near = (before < _BEFORE) & (before > -_DEEP - _SLOPE * np.abs(at))
    return near & (at < _BEYOND) & (at > thought @ way - _FURTHER)


def _before_front(end: float, line: DoorLine, thought: float, front: float | None) -> float:
    """Where on its line a panel ends that may be in line with a side of the body: where its points do, or the front is [m].

    Args:
      end: Where its points do [m].
      line: Of the panel.
      thought: Where the hinge is along X, as estimated [m].
      front: Where the front of the body is [m], if that shows.
    """
    there = (thought - line.middle[0]) / line.way[0]
    if front is None:
        return max(end, there)
    return float(np.median([end, there, (front - _HINGE - line.middle[0]) / line.way[0]]))


def _turns(
    at: Float[np.ndarray, "n"],
    most: float,
    faces: Float[np.ndarray, "n 2"],
    normal: Float[np.ndarray, "2"],
) -> float:
    """Where on a line what faces as the front of the body does ends, and the panel begins [m]; `-inf` where nothing does.

    Args:
      at: Of its points, from the hinge's side on [m].
      most: It is no further along [m].
      faces: Their normals; X is out of the front.
      normal: Of the panel, on the side that shows.
    """
    if np.arccos(np.clip(normal[0], -1.0, 1.0)) < _TELLS_APART:
        return -np.inf
    first, found = float(at.min()), -np.inf
    bins = np.floor((at - first) / _BIN).astype(int)
    for each in range(int((most - first) / _BIN)):
        own = faces[bins == each]
        if len(own) >= _BIN_LEAST:
            median = np.median(own, axis=0)
            if median[0] < median @ normal:
                break
            found = first + (each + 1) * _BIN
    return found
