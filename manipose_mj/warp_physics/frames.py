"""Where bodies, shapes and sites are, with a lane for each row of a matrix: lanes beside each other write beside each other.

MuJoCo Warp has a lane for each matrix, whose nine numbers lie far from those of the next lane, and kernels of their own for
the matrices of bodies, the frames of their inertias, shapes and sites.
"""

from functools import cache
from typing import Any

import numpy as np
import warp as wp  # pyright: ignore[reportMissingImports]
from mujoco_warp._src import smooth  # pyright: ignore[reportMissingImports]
from mujoco_warp._src.math import mul_quat, rot_vec_quat  # pyright: ignore[reportMissingImports]

# What a lane does, of a row `i` of something that is on a body: rounded as by MuJoCo Warp, as are the functions below. With
# many shapes these lines take 0.10 ms where a kernel like that of bodies takes 0.12; of bodies, 40 us instead of 32.
_PLACE = """
const int i = thread % 3, world = thread / 3 / COUNT, thing = which.data[thread / 3 % COUNT], body = on.data[thing];
auto row_of = [&](int rows) { return size_t(world < rows ? world : world % rows); };
auto floats = [](auto* values) { return reinterpret_cast<const float*>(values); };
const float* const local = floats(places.data) + (row_of(places.shape[0]) * places.shape[1] + thing) * 3;
const float* const turn = floats(turns.data) + (row_of(turns.shape[0]) * turns.shape[1] + thing) * 4;
const float* const q = floats(body_turns.data) + (size_t(world) * BODIES + body) * 4;
const float w = q[0], x = q[1], y = q[2], z = q[3], a = local[0], b = local[1], c = local[2];
const float along = x * a + y * b + z * c, rest = w * w - (x * x + y * y + z * z);
auto pick = [i](float first, float second, float third) { return i == 0 ? first : i == 1 ? second : third; };
float away = 2.0f * (along * pick(x, y, z)) + rest * pick(a, b, c);
away += 2.0f * w * pick(y * c - z * b, z * a - x * c, x * b - y * a);
const size_t at = size_t(world) * places.shape[1] + thing;
reinterpret_cast<float*>(found_places.data)[at * 3 + i] = floats(body_places.data)[(size_t(world) * BODIES + body) * 3 + i] + away;
float* const row = reinterpret_cast<float*>(found_rows.data) + at * 9 + 3 * i;
const float s = turn[0], t = turn[1], u = turn[2], v = turn[3];
const float d = w * s - x * t - y * u - z * v, e = w * t + x * s + y * v - z * u;
const float f = w * u - x * v + y * s + z * t, g = w * v + x * u - y * t + z * s;
if (i == 0) {
    row[0] = d * d + e * e - f * f - g * g; row[1] = 2.0f * (e * f - d * g); row[2] = 2.0f * (e * g + d * f);
} else if (i == 1) {
    row[0] = 2.0f * (e * f + d * g); row[1] = d * d - e * e + f * f - g * g; row[2] = 2.0f * (f * g - d * e);
} else {
    row[0] = 2.0f * (e * g - d * f); row[1] = 2.0f * (f * g + d * e); row[2] = d * d - e * e - f * f + g * g;
}
"""


class Frames:
    """Finds the frames of bodies, shapes and sites as `mujoco_warp.kinematics`."""

    def __init__(self, model: Any, data: Any) -> None:
        """Takes the arrays of both.

        Args:
          model: `mujoco_warp.Model`.
          data: `mujoco_warp.Data`.
        """
        self._model, self._data = model, data
        welded, mocap = model.body_weldid.numpy() == 0, model.body_mocapid.numpy() >= 0
        still = welded & ~mocap[model.body_rootid.numpy()]  # `make_data` places what hangs on them
        self._shapes = wp.array(np.flatnonzero(~still[model.geom_bodyid.numpy()]), dtype=int)
        self._sites = wp.array(np.arange(model.nsite), dtype=int)

    def find(self) -> None:
        """Finds them for the positions of now."""
        m, d = self._model, self._data
        joints = [
            m.qpos0,
            m.body_parentid,
            m.body_mocapid,
            m.body_jntnum,
            m.body_jntadr,
            m.body_pos,
        ]
        joints += [m.body_quat, m.jnt_type, m.jnt_qposadr, m.jnt_pos, m.jnt_axis, m.body_branches]
        joints += [m.body_branch_start, d.qpos, d.mocap_pos, d.mocap_quat]
        bodies = [d.xpos, d.xquat, d.xanchor, d.xaxis]
        wp.launch(smooth._kinematics_branch, (d.nworld, m.nbranch), inputs=joints, outputs=bodies)
        wp.launch(
            _find_bodies,
            (d.nworld, m.nbody, 3),
            inputs=[m.body_ipos, m.body_iquat, _parts(d.xpos, float), d.xquat],
            outputs=[_parts(d.xmat, wp.vec3), _parts(d.xipos, float), _parts(d.ximat, wp.vec3)],
        )
        shapes = [m.geom_bodyid, m.geom_pos, m.geom_quat], [d.geom_xpos, d.geom_xmat]
        self._place(self._shapes, *shapes)
        sites = [m.site_bodyid, m.site_pos, m.site_quat], [d.site_xpos, d.site_xmat]
        self._place(self._sites, *sites)

    def _place(self, which: Any, hanging: list[Any], found: list[Any]) -> None:
        """Places some of the things that hang on bodies: those that are named."""
        data, bodies = self._data, self._model.nbody
        inputs = [which, *hanging, data.xpos, data.xquat]
        kernel = _kernel(max(len(which), 1), bodies)
        wp.launch(kernel, data.nworld * len(which) * 3, inputs=inputs, outputs=found)


@wp.func
def _row(turn: wp.quat, i: int) -> wp.vec3:
    """A row of the matrix of a quaternion."""
    w, x, y, z = turn[0], turn[1], turn[2], turn[3]
    if i == 0:
        return wp.vec3(w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y))
    if i == 1:
        return wp.vec3(2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x))
    return wp.vec3(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z)


@wp.kernel(enable_backward=False, grid_stride=False)
def _find_bodies(
    centres: wp.array2d[wp.vec3],
    turns: wp.array2d[wp.quat],
    places: wp.array3d[float],
    turned: wp.array2d[wp.quat],
    rows: wp.array3d[wp.vec3],
    found_centres: wp.array3d[float],
    found_rows: wp.array3d[wp.vec3],
):
    world, body, i = wp.tid()
    turn = turned[world, body]
    rows[world, body, i] = _row(turn, i)
    away = rot_vec_quat(centres[world % centres.shape[0], body], turn)
    # An index that the compiler does not know would need an array in memory.
    component = wp.where(i == 0, away[0], wp.where(i == 1, away[1], away[2]))
    found_centres[world, body, i] = places[world, body, i] + component
    found_rows[world, body, i] = _row(mul_quat(turn, turns[world % turns.shape[0], body]), i)


@cache
def _kernel(count: int, bodies: int) -> Any:
    """For so many things, in worlds of so many bodies."""
    constants = f"constexpr int COUNT = {count}, BODIES = {bodies};\n"

    @wp.func_native(constants + _PLACE)
    def place(
        thread: int,
        which: wp.array[int],
        on: wp.array[int],
        places: wp.array2d[wp.vec3],
        turns: wp.array2d[wp.quat],
        body_places: wp.array2d[wp.vec3],
        body_turns: wp.array2d[wp.quat],
        found_places: wp.array2d[wp.vec3],
        found_rows: wp.array2d[wp.mat33],
    ): ...

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False)
    def find_frames(
        which: wp.array[int],
        on: wp.array[int],
        places: wp.array2d[wp.vec3],
        turns: wp.array2d[wp.quat],
        body_places: wp.array2d[wp.vec3],
        body_turns: wp.array2d[wp.quat],
        found_places: wp.array2d[wp.vec3],
        found_rows: wp.array2d[wp.mat33],
    ):
        place(
            wp.tid(),
            which,
            on,
            places,
            turns,
            body_places,
            body_turns,
            found_places,
            found_rows,
        )

    return find_frames


def _parts(array: Any, dtype: Any) -> Any:
    """An array of vectors or matrices as one of what they consist of, with a last axis more: numbers, or rows."""
    size = wp.types.type_size_in_bytes(dtype)
    return wp.array(
        ptr=array.ptr,
        shape=(*array.shape, wp.types.type_size_in_bytes(array.dtype) // size),
        strides=(*array.strides, size),
        dtype=dtype,
        device=array.device,
    )
