"""Kernels around MuJoCo Warp's step: changing a world's start, limiting set-points, reading contacts."""

import warp as wp  # pyright: ignore[reportMissingImports]

from manipose_mj.tasks.scene.indices import FIRST, RIGHT_PAD

wp.set_module_options({"enable_backward": False})  # compiled in a third of the time

_FIRST = wp.constant(FIRST)
_RIGHT_PAD = wp.constant(RIGHT_PAD)


@wp.kernel
def find_changed(rows: wp.array[int], current: wp.array[int], changed: wp.array[int]):
    """Which worlds have another start than the model's fields are of, and that they have it now."""
    world = wp.tid()
    changed[world] = wp.where(rows[world] != current[world], 1, 0)
    current[world] = rows[world]


@wp.kernel
def copy_reals(
    rows: wp.array[int],
    changed: wp.array[int],
    table: wp.array2d[float],
    field: wp.array2d[float],
):
    """Write the start's own values of a field of the model, or of what never moves."""
    world, i = wp.tid()
    if changed[world] == 1:
        field[world, i] = table[rows[world], i]


@wp.kernel
def copy_integers(
    rows: wp.array[int],
    changed: wp.array[int],
    table: wp.array2d[int],
    field: wp.array2d[int],
):
    """The same for whole numbers."""
    world, i = wp.tid()
    if changed[world] == 1:
        field[world, i] = table[rows[world], i]


@wp.kernel
def limit_set_points(
    targets: wp.array3d[float],
    substep: int,
    qpos: wp.array2d[float],
    tcp: wp.array2d[wp.vec3],
    anchors: wp.array2d[wp.vec3],
    axes: wp.array2d[wp.vec3],
    joints: wp.array[int],
    angles: wp.array[int],
    limits: wp.array2d[float],
    site: int,
    arm: int,
    gripper: int,
    tcp_lead: float,
    widest: float,
    ctrl: wp.array2d[float],
):
    """`mjcf.panda.speed_limits.allowed_set_points`, one world a thread.

    `limits` has a row for each joint: the most that its set-point may move in a step and be ahead of it, its
    least and its greatest angle.
    """
    world = wp.tid()
    motion = wp.vec3(0.0, 0.0, 0.0)
    for i in range(7):
        now = ctrl[world, arm + i]
        angle = qpos[world, angles[i]]
        most = limits[i, 0]
        lead = limits[i, 1]
        allowed = wp.clamp(targets[world, substep, i], now - most, now + most)
        allowed = wp.clamp(allowed, angle - lead, angle + lead)
        ctrl[world, arm + i] = allowed
        joint = joints[i]
        lever = tcp[world, site] - anchors[world, joint]
        motion += wp.cross(axes[world, joint], lever) * (allowed - angle)
    length = wp.length(motion)
    share = tcp_lead / wp.max(length, tcp_lead)
    for i in range(7):
        angle = qpos[world, angles[i]]
        allowed = ctrl[world, arm + i]
        if length > tcp_lead:
            allowed = angle + share * (allowed - angle)
        ctrl[world, arm + i] = wp.clamp(allowed, limits[i, 2], limits[i, 3])
    ctrl[world, gripper] = wp.clamp(targets[world, substep, 7], 0.0, widest)


@wp.kernel
def find_contacts(
    count: wp.array[int],
    world_of: wp.array[int],
    geoms: wp.array[wp.vec2i],
    rows: wp.array[int],
    owners: wp.array2d[int],
    owned: int,
    found: wp.array2d[int],
):
    """Whether the robot, its left pad or its right pad touches each object and part of its world."""
    i = wp.tid()
    if i < count[0]:
        world = world_of[i]
        row = rows[world]
        one = owners[row, geoms[i][0]]
        other = owners[row, geoms[i][1]]
        low = wp.min(one, other)
        high = wp.max(one, other)
        if low <= _RIGHT_PAD and high >= _FIRST:
            found[world, low * owned + high - _FIRST] = 1


@wp.kernel
def find_diverged(
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    fastest: float,
    diverged: wp.array[int],
):
    """Whether a position is not finite, or a speed too high or not a number."""
    world = wp.tid()
    diverged[world] = 0
    for i in range(qpos.shape[1]):
        if not wp.isfinite(qpos[world, i]):
            diverged[world] = 1
    for i in range(qvel.shape[1]):
        if not wp.abs(qvel[world, i]) < fastest:
            diverged[world] = 1
