"""Kernels around MuJoCo Warp's step: where the hand goes, and how far the object has moved in it."""

import warp as wp  # pyright: ignore[reportMissingImports]


@wp.kernel
def find_touching(
    count: wp.array[int],
    world_of: wp.array[int],
    distance: wp.array[float],
    touching: wp.array[int],
):
    """Which worlds have a contact that is deeper than nothing."""
    i = wp.tid()
    if i < count[0] and distance[i] < 0.0:
        touching[world_of[i]] = 1


@wp.kernel
def move_hand(
    step: wp.array[int],
    up: wp.array[float],
    aside: wp.array[wp.vec3],
    ups: wp.array[wp.vec3],
    ctrl: wp.array2d[float],
):
    """Set where the hand shall be in this step; the fingers are sent shut."""
    world = wp.tid()
    t = step[0]
    target = up[t] * ups[world] + aside[t]
    ctrl[world, 0] = target[0]
    ctrl[world, 1] = target[1]
    ctrl[world, 2] = target[2]
    ctrl[world, 3] = 0.0
    ctrl[world, 4] = 0.0


@wp.kernel
def follow(
    qpos: wp.array2d[float],
    closed: wp.array2d[float],
    furthest: wp.array[float],
):
    """How far the object has been from its place in the hand, along the axis where that is most."""
    world = wp.tid()
    most = furthest[world]
    for i in range(3):
        away = wp.abs(qpos[world, i] - qpos[world, 7 + i] - closed[world, i])
        # What is not a number is as far as can be.
        if not away <= 1.0:
            away = 1.0
        most = wp.max(most, away)
    furthest[world] = most


@wp.kernel
def next_step(step: wp.array[int]):
    """Count."""
    step[0] = step[0] + 1
