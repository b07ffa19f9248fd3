"""Where the parts of a piece of furniture are, in boxes: what the hand and the arm have to keep clear of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import compose, rotation_about

# How far a door has to be open at most for a hand to pass with what it holds [rad]; some fold back by half a turn.
WIDE_OPEN = 2.0
_BESIDE = 0.01  # how far what carries a handle sticks out beside it [m]
_NEAR = 0.06  # of a handle [m]
_COLUMNS, _LEVELS = 5, 10
_THIN = 0.001  # what is no thicker is left out of a block [m]
_ALIKE = 0.008  # blocks whose sides differ by less are one [m]
_STANDOFF = 0.012  # of a handle before its board at least, where one convex piece is both [m]


@dataclass(frozen=True)
class PartShape:
    """Boxes along the axes of the object frame, with all parts shut: low and high corners [m].

    Attributes:
      fixed: Of everything else, filled from its front to its back, column by column and level by level.
      beside: Of what is near the handle, exactly: fingers have to fit in between.
      moving: Of the part without its handle.
      floor: What the piece stands on, along z [m].
    """

    fixed: Float[np.ndarray, "n 2 3"]
    beside: Float[np.ndarray, "m 2 3"]
    moving: Float[np.ndarray, "2 3"]
    floor: float


def part_shape(asset: Asset, part: MovingPart) -> PartShape:
    """The boxes around a part that has a handle; of every asset its model is compiled once."""
    assert part.handle is not None
    bodies = _geom_boxes(asset.model_path)
    own = bodies[part.name]
    others = np.concatenate([boxes for name, boxes in bodies.items() if name != part.name])
    moving = _around(_boards(own, part.handle))
    floor = min(float(boxes[:, 0, 2].min()) for boxes in bodies.values())
    across = int(np.abs(np.cross(part.handle.rotation[:, 1], [0.0, 0.0, 1.0])).argmax())
    return PartShape(_blocks(others, across), _beside(others, part.handle), moving, floor)


def part_motion(part: MovingPart, opening: float) -> Float[np.ndarray, "4 4"]:
    """How the part has moved, in the object frame, once its joint is at `opening` [m or rad]."""
    joint = part.joint
    if joint.kind == "slide":
        return compose(np.eye(3), joint.axis * opening)
    rotation = rotation_about(joint.axis, opening)
    return compose(rotation, joint.origin - rotation @ joint.origin)


def _boards(boxes: Float[np.ndarray, "n 2 3"], handle: PoseLabel) -> Float[np.ndarray, "m 2 3"]:
    """The boxes of a part but for those of its handle and what carries that; cut off before the handle."""
    axes = np.abs(handle.rotation)
    middle = boxes.mean(axis=1) - handle.origin
    reach = (boxes[:, 1] - boxes[:, 0]) / 2 @ axes
    beyond = np.abs(middle @ handle.rotation) + reach - handle.extents / 2
    carries = (beyond[:, [0, 2]] < _BESIDE).all(axis=1)
    boards = boxes[~carries] if not carries.all() else boxes.copy()
    outwards = handle.rotation[:, 1]
    axis = int(np.abs(outwards).argmax())
    sign = np.sign(outwards[axis])
    standoff = _STANDOFF if carries.all() else 0.0
    most = sign * (float(handle.origin @ outwards) - handle.extents[1] / 2 - standoff)
    end = int(sign > 0)
    boards[:, end, axis] = sign * np.minimum(sign * boards[:, end, axis], sign * most)
    return boards


def _beside(boxes: Float[np.ndarray, "n 2 3"], handle: PoseLabel) -> Float[np.ndarray, "m 2 3"]:
    reach = np.abs(handle.rotation) @ handle.extents / 2 + _NEAR
    low, high = handle.origin - reach, handle.origin + reach
    return boxes[((boxes[:, 0] < high) & (boxes[:, 1] > low)).all(axis=1)]


def _blocks(boxes: Float[np.ndarray, "n 2 3"], across: int) -> Float[np.ndarray, "m 2 3"]:
    """What is between front and back of some boxes, in columns along an axis and levels along z.

    Neighbours of one depth are joined: a plain front is one block.
    """
    whole = _around(boxes)
    columns = np.linspace(whole[0, across], whole[1, across], _COLUMNS + 1)
    levels = np.linspace(whole[0, 2], whole[1, 2], _LEVELS + 1)
    blocks: list[Float[np.ndarray, "2 3"]] = []
    for left, right in pairwise(columns):
        own: list[Float[np.ndarray, "2 3"]] = []
        for bottom, top in pairwise(levels):
            cut = boxes.copy()
            cut[:, :, across] = cut[:, :, across].clip(left, right)
            cut[:, :, 2] = cut[:, :, 2].clip(bottom, top)
            cut = cut[(cut[:, 1] - cut[:, 0] > _THIN).all(axis=1)]
            if len(cut):
                _join(own, _around(cut), 2)
        for block in own:
            _join(blocks, block, across)
    return np.stack(blocks)


def _join(
    blocks: list[Float[np.ndarray, "2 3"]],
    block: Float[np.ndarray, "2 3"],
    along: int,
) -> None:
    """Add a block; where one ends that is as deep and as wide, it goes on."""
    others = [axis for axis in range(3) if axis != along]
    for k, before in enumerate(blocks):
        gap = abs(before[1, along] - block[0, along])
        if gap < _ALIKE and (np.abs(before - block)[:, others] < _ALIKE).all():
            blocks[k] = _around(np.stack([before, block]))
            return
    blocks.append(block)


def _around(boxes: Float[np.ndarray, "n 2 3"]) -> Float[np.ndarray, "2 3"]:
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


@lru_cache(maxsize=256)
def _geom_boxes(model_path: Path) -> dict[str, Float[np.ndarray, "n 2 3"]]:
    """Low and high corners of the geoms that touch, of every body by its name; bodies without are left out."""
    spec = mujoco.MjSpec.from_file(str(model_path))
    for geom in list(spec.geoms):
        if not geom.contype:
            spec.delete(geom)
    for looks in (*spec.materials, *spec.textures):
        spec.delete(looks)
    used = {geom.meshname for geom in spec.geoms}
    for mesh in list(spec.meshes):
        if mesh.name not in used:
            spec.delete(mesh)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    turns = data.geom_xmat.reshape(-1, 3, 3)
    centers = data.geom_xpos + np.einsum("nij,nj->ni", turns, model.geom_aabb[:, :3])
    halves = np.einsum("nij,nj->ni", np.abs(turns), model.geom_aabb[:, 3:])
    boxes = np.stack([centers - halves, centers + halves], axis=1)
    return {
        model.body(body).name: boxes[model.geom_bodyid == body]
        for body in np.unique(model.geom_bodyid).tolist()
    }
