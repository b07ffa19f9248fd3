"""Sums along the kinematic tree in one kernel, which is written for a tree: every body's value stays in a register.

MuJoCo Warp launches a kernel for each level of the tree; an arm with a hand has twelve.
"""

from functools import cache
from typing import Any

import warp as wp  # pyright: ignore[reportMissingImports]

_OPTIONS: dict[str, Any] = {"module": "unique", "enable_backward": False, "grid_stride": False}


@cache
def sum_subtrees(parents: tuple[int, ...], *, into_world: bool) -> Any:
    """A kernel that adds to what every body has what all bodies have that hang on it.

    Args:
      parents: Of all bodies, parents before children; body 0 is the world.
      into_world: Whether the world gets its sum too.

    Returns:
      A kernel of (worlds, components), of arrays (worlds, bodies, components): what they have, and the sums. They may
      be the same array.
    """
    body = _sums(parents, "own.data[at(body)]", into_world=into_world)
    body += [f"summed.data[at({i})] = v{i};" for i in range(len(parents))]

    @wp.func_native(_placed(len(parents), "own") + "\n".join(body))
    def add(world: int, component: int, own: wp.array3d[float], summed: wp.array3d[float]): ...

    @wp.kernel(**_OPTIONS)
    def sum_all(own: wp.array3d[float], summed: wp.array3d[float]):
        world, component = wp.tid()
        add(world, component, own, summed)

    return sum_all


@cache
def subtree_centres(parents: tuple[int, ...]) -> Any:
    """A kernel that finds the centres of mass of all bodies with what hangs on them.

    Args:
      parents: As of `sum_subtrees`.

    Returns:
      A kernel of (worlds, 3), of the masses of bodies, (1 or worlds, bodies); of their subtrees; their centres
      (worlds, bodies, 3); and the centres of their subtrees.
    """
    body = ["const float* const mass = masses.data + (world % masses.shape[0]) * masses.shape[1];"]
    body += [
        "const float* const all = subtrees.data + (world % subtrees.shape[0]) * masses.shape[1];"
    ]
    body += _sums(parents, "mass[body] * centres.data[at(body)]", into_world=True)
    body += [
        f"found.data[at({i})] = all[{i}] != 0.0f ? v{i} / all[{i}] : v{i};"
        for i in range(len(parents))
    ]

    @wp.func_native(_placed(len(parents), "centres") + "\n".join(body))
    def centre(
        world: int,
        component: int,
        masses: wp.array2d[float],
        subtrees: wp.array2d[float],
        centres: wp.array3d[float],
        found: wp.array3d[float],
    ): ...

    @wp.kernel(**_OPTIONS)
    def find_centres(
        masses: wp.array2d[float],
        subtrees: wp.array2d[float],
        centres: wp.array3d[float],
        found: wp.array3d[float],
    ):
        world, component = wp.tid()
        centre(world, component, masses, subtrees, centres, found)

    return find_centres


def _placed(bodies: int, array: str) -> str:
    """Where a body's value is in an array (worlds, bodies, components)."""
    return (
        f"const int width = {array}.shape[2];\n"
        f"const size_t first = size_t(world) * {bodies} * width + component;\n"
        "auto at = [&](int body) { return first + body * width; };\n"
    )


def _sums(parents: tuple[int, ...], value: str, *, into_world: bool) -> list[str]:
    """Lines that read `value` of each `body` and add it to those of its parents."""
    lines = [f"float v{i} = {value.replace('body', str(i))};" for i in range(len(parents))]
    for i in range(len(parents) - 1, 0, -1):
        if parents[i] > 0 or into_world:
            lines.append(f"v{parents[i]} += v{i};")
    return lines
