"""Fit the hand to antipodal pairs: what the pads touch, what the fingers meet, how good it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.assets.geometry import MassProperties
from manipose_mj.assets.gripper import ParallelJaw
from manipose_mj.grasp_sampling.antipodal import FRICTION, MIN_WIDTH
from manipose_mj.grasp_sampling.approaches import DEPTH, PairFrames
from manipose_mj.grasp_sampling.contact_patch import contact_patch, pad_reach
from manipose_mj.grasp_sampling.gripper_clearance import finger_reach, fingers_free
from manipose_mj.grasp_sampling.touch_points import SurfacePoints

MIN_COVER = 0.1  # least share of a pad that must touch
SLANT = 0.05  # of the touched faces, at which quality has fallen to 1/e: 18 degrees
SKEW = 0.006  # between the middles of what the pads touch, at which it has fallen to 1/e [m]
JERK = 20.0  # twice gravity, which a carried object may feel [m/s^2]
TORSION = 0.005  # of the pads' contact, as an arm of the friction force [m]


@dataclass(frozen=True)
class ObjectCloud:
    """The object as points in its own frame.

    Attributes:
      touch: The surface that fingers touch.
      obstacles: `(m, 3)` [m], all that the open fingers must not meet; those of `touch` come first.
      coarse: `(c, 3)` [m], fewer of them and the outermost corners, for the hand's large boxes.
      mass_properties: What hangs in the hand.
    """

    touch: SurfacePoints
    obstacles: Float[np.ndarray, "m 3"]
    coarse: Float[np.ndarray, "c 3"]
    mass_properties: MassProperties


@dataclass(frozen=True)
class Candidates:
    """Grasps with a quality in [0, 1]. Attributes: poses `T_object_tcp`; widths [m]; quality."""

    poses: Float[np.ndarray, "n 4 4"]
    widths: Float[np.ndarray, "n"]
    quality: Float[np.ndarray, "n"]

    def __len__(self) -> int:
        return len(self.widths)

    def take(self, chosen: np.ndarray) -> Candidates:
        """Those of a mask, or of indices in their order."""
        return Candidates(self.poses[chosen], self.widths[chosen], self.quality[chosen])

    @classmethod
    def joined(cls, parts: Sequence[Candidates]) -> Candidates:
        """All of `parts`, in order; none gives none."""
        return cls(
            np.concatenate([np.empty((0, 4, 4)), *(p.poses for p in parts)]),
            np.concatenate([np.empty(0), *(p.widths for p in parts)]),
            np.concatenate([np.empty(0), *(p.quality for p in parts)]),
        )


def fit_pairs(
    cloud: ObjectCloud,
    frames: PairFrames,
    free: Bool[np.ndarray, "p hands"],
    gripper: ParallelJaw,
) -> Candidates:
    """The grasps that close on these pairs.

    Kept are those whose pads both find enough surface and whose open fingers meet no point of the
    object.

    Args:
      cloud: The object.
      frames: The pairs.
      free: Of each hand, whether what is behind its fingers has room.
      gripper: The hand.
    """
    obstacles = cloud.obstacles.T.astype(np.float32)
    normals = cloud.touch.normals.T.astype(np.float32)
    reach = max(finger_reach(gripper), pad_reach(gripper))
    longest = 2 * gripper.clearance + max(high[1] for _, high in gripper.finger)
    found = []
    offset = cloud.mass_properties.center_of_mass - frames.center
    levers = np.linalg.norm(np.cross(offset, frames.axes[:, 1]), axis=1)
    for pair in range(len(frames)):
        local, index = frames.local_within(
            pair, obstacles, (reach, frames.half[pair] + longest, reach)
        )
        touch = index[: np.searchsorted(index, len(cloud.touch.points))]
        surface = _between_pads(local[:, : len(touch)], frames.half[pair], gripper)
        fit = _fit(
            cloud,
            frames,
            pair,
            local[:, surface],
            normals[:, touch[surface]],
            np.flatnonzero(free[pair]),
            levers[pair],
            gripper,
        )
        if fit is not None:
            clear = fingers_free(local, fit.faces, gripper)
            found.append(fit.candidates.take(clear[fit.hands]))
    return Candidates.joined(found)


@dataclass(frozen=True)
class _PairFit:
    """The grasps of one pair before the fingers are looked at.

    Attributes:
      candidates: The grasps.
      hands: Which of the pair's hands they are.
      faces: `(n, 2)` [m], where the open pads' faces are along the closing direction.
    """

    candidates: Candidates
    hands: Int[np.ndarray, "n"]
    faces: Float[np.ndarray, "n 2"]


def _between_pads(
    local: Float[np.ndarray, "3 m"], half: float, gripper: ParallelJaw
) -> Int[np.ndarray, "k"]:
    """Which points of the surface pads may touch that close on a pair this far from its middle."""
    near = np.abs(np.abs(local[1]) - half) < gripper.clearance
    return np.flatnonzero(near & (np.hypot(local[0], local[2]) < pad_reach(gripper)))


def _fit(
    cloud: ObjectCloud,
    frames: PairFrames,
    pair: int,
    surface: Float[np.ndarray, "3 m"],
    normals: Float[np.ndarray, "3 m"],
    hands: Int[np.ndarray, "k"],
    lever: float,
    gripper: ParallelJaw,
) -> _PairFit | None:
    """What the pads of these hands find on `surface`, given in the pair's frame; None if nothing.

    The weight pulls `lever` [m] away from the closing line.
    """
    closing = frames.axes[pair, 1]
    y = closing.astype(np.float32)
    outward = (y[0] * normals[0] + y[1] * normals[1] + y[2] * normals[2]) * np.sign(surface[1])
    contact = contact_patch(surface, outward, cloud.touch.spacing, hands, gripper)
    good = (contact.cover > MIN_COVER) & (contact.width > MIN_WIDTH)
    good &= contact.width < gripper.max_opening - gripper.min_clearance
    if not good.any():
        return None
    hands, width, middle = hands[good], contact.width[good], contact.middle[good]
    opening = gripper.opening(width)
    poses = np.tile(np.eye(4), (len(hands), 1, 1))
    poses[:, :3, :3] = frames.rotations(pair, hands)
    poses[:, :3, 3] = frames.center[pair] + middle[:, None] * closing
    poses[:, :3, 3] -= DEPTH[hands, None] * poses[:, :3, 2]
    weight = cloud.mass_properties
    # Friction of both pads about the closing line, against the weight's torque.
    capacity = 2 * FRICTION * gripper.grip_force * (contact.radius[good] + TORSION)
    load = weight.mass * JERK * lever / capacity
    tight = (opening - width) / (2 * gripper.clearance)
    quality = np.minimum(contact.cover[good], 1.0) * (0.5 + 0.5 * tight)
    quality *= np.exp(-frames.slant[pair] / SLANT - contact.skew[good] / SKEW) / (1 + load**4)
    faces = np.stack([middle - opening / 2, middle + opening / 2], axis=1)
    return _PairFit(Candidates(poses, width, quality), hands, faces)
