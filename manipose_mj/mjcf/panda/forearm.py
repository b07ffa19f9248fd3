"""Where the links behind the hand may be: the forearm and the wrist, for poses of the TCP, in closed form.

A pose of the TCP leaves the arm one freedom. With the last joint at some turn the wrist's centre is known, and the
forearm lies in a plane: the last but one joint is where the elbow comes as far from the shoulder as the upper arm is
long. The joints before have no say but in their limits, which are not looked at. (He and Liu, "Analytical inverse
kinematics for Franka Emika Panda", ICCMA 2021, solve it all from there.)
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from manipose_mj.mjcf.panda.geometry import CAPSULES
from manipose_mj.mjcf.panda.kinematics import DH, POSITION_LIMITS, link_poses, link_step, tcp_pose
from manipose_mj.poses import invert, transform

_LOW, _HIGH = POSITION_LIMITS.T
_LINKS = ("link5", "link6")
_TURNS = 12  # of the last joint that are looked at
_BENDS = 24  # of the one before it
_ALONG = np.linspace(0.0, 1.0, 3)  # where balls are on a capsule's axis
_SHOULDER = np.array([0.0, 0.0, DH[0, 1]])
_UPPER_ARM = float(np.hypot(DH[2, 1], DH[3, 0]))  # from the shoulder to the elbow's axis [m]
_LOWER_ARM, _ELBOW_OFFSET = DH[4, 1], -DH[4, 0]  # from the wrist along the forearm, and aside [m]


def links_behind(
    tcp_poses: Float[np.ndarray, "n 4 4"],
) -> tuple[Int[np.ndarray, "m"], Float[np.ndarray, "m p 3"]]:
    """Where links 5 and 6 may be behind the hand.

    Args:
      tcp_poses: `T_base_tcp`.

    Returns:
      To which of the poses each way to be there belongs, and the middles of balls that fill the links [m]; their
      radii are `LINK_RADII`.
    """
    wrists = transform(tcp_poses[:, None], _WRISTS[None])  # n, turns, 1, 3
    axes = np.einsum("nij,tbj->ntbi", tcp_poses[:, :3, :3], _AXES)
    to_shoulder = _SHOULDER - wrists
    aside = to_shoulder - (to_shoulder * axes).sum(axis=-1, keepdims=True) * axes
    aside /= np.maximum(np.linalg.norm(aside, axis=-1, keepdims=True), 1e-9)
    elbows = wrists - _LOWER_ARM * axes + _ELBOW_OFFSET * aside
    excess = np.linalg.norm(elbows - _SHOULDER, axis=-1) - _UPPER_ARM
    owner, turn, bend = np.nonzero(excess[..., :-1] * excess[..., 1:] <= 0)
    later = np.abs(excess[owner, turn, bend + 1]) < np.abs(excess[owner, turn, bend])
    return owner, transform(tcp_poses[owner], _POINTS[turn, bend + later])


def _balls(link: str) -> Float[np.ndarray, "p 3"]:
    """Middles of balls along a link's capsules, in its frame [m]."""
    ends = np.array([axis for axis, _ in CAPSULES[link]]).reshape(-1, 2, 1, 3)
    return (ends[:, 0] + _ALONG[:, None] * (ends[:, 1] - ends[:, 0])).reshape(-1, 3)


def _behind(turn: float, bend: float) -> Float[np.ndarray, "2 4 4"]:
    """`T_tcp_link5` and `T_tcp_link6` for angles of the last two joints [rad]."""
    link6 = _TCP_LINK7 @ invert(link_step(6, turn))
    return np.stack([link6 @ invert(link_step(5, bend)), link6])


LINK_RADII = np.repeat([r for name in _LINKS for _, r in CAPSULES[name]], len(_ALONG))  # [m]
_TCP_LINK7 = invert(tcp_pose(np.zeros(7))) @ link_poses(np.zeros(7))[-1]
_FRAMES = np.array(
    [
        [_behind(turn, bend) for bend in np.linspace(_LOW[5], _HIGH[5], _BENDS)]
        for turn in np.linspace(_LOW[6], _HIGH[6], _TURNS)
    ]
)  # turns, bends, links, 4, 4
_WRISTS = _FRAMES[:, :1, 1, :3, 3]
_AXES = _FRAMES[:, :, 0, :3, 2]
_POINTS = np.concatenate(
    [transform(_FRAMES[:, :, i], _balls(name)[None, None]) for i, name in enumerate(_LINKS)], axis=2
)  # turns, bends, p, 3
