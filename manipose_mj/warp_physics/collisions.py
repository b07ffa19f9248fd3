"""The first look at pairs of shapes: MuJoCo Warp's, of the pairs alone whose bounding spheres meet.

A warp of the GPU looks at a world: it keeps the spheres in shared memory, where a pair costs two reads; MuJoCo Warp
gathers some twenty numbers of a pair from anywhere.
"""

from functools import cache
from typing import Any

import mujoco_warp as mjw  # pyright: ignore[reportMissingImports]
import numpy as np
import warp as wp  # pyright: ignore[reportMissingImports]
from mujoco_warp._src import collision_core, collision_driver  # pyright: ignore[reportMissingImports]

_LANES = 32  # of a warp
_MOST_WORLDS = 4  # in a block
_SHARED = 44_000  # bytes of shared memory in a block, of 48 KiB
# Lists the pairs of a world whose spheres meet, if `i` is -1, and returns how many; else returns a pair of the list. A
# CPU has no shared memory: there the list is of all pairs, and of those that do not meet -1 is returned.
_NEAR = """
const float* const place = reinterpret_cast<const float*>(positions.data) + size_t(world) * positions.shape[1] * 3;
const float* const radius = radii.data + size_t(world % radii.shape[0]) * radii.shape[1];
const float* const margin = margins.data + size_t(world % margins.shape[0]) * margins.shape[1];
const float* const gap = gaps.data + size_t(world % gaps.shape[0]) * gaps.shape[1];
// Of a sphere; planes have none.
auto reach_of = [&](int shape) { return radius[shape] == 0.0f ? -1.0f : radius[shape] + margin[shape] + gap[shape]; };
// Pairs that the model names have margins of their own.
auto meet = [&](int pair, float x, float y, float z, float reach, float other) {
    return ids.data[pair].c[0] >= 0 || reach < 0.0f || other < 0.0f ||
           x * x + y * y + z * z <= (reach + other) * (reach + other);
};
#if defined(__CUDA_ARCH__)
__shared__ float4 spheres[WORLDS][SHAPES];
__shared__ unsigned short near_pairs[WORLDS][PAIRS];
const int slot = threadIdx.x >> 5;
if (i >= 0) return near_pairs[slot][i];
for (int k = lane; k < SHAPES; k += 32) {
    const int shape = shapes.data[k];
    spheres[slot][k] = make_float4(place[3 * shape], place[3 * shape + 1], place[3 * shape + 2], reach_of(shape));
}
__syncwarp();
int count = 0;
for (int first = 0; first < PAIRS; first += 32) {
    const int pair = first + lane;
    bool found = false;
    if (pair < PAIRS) {
        const float4 a = spheres[slot][ends.data[pair].c[0]], b = spheres[slot][ends.data[pair].c[1]];
        found = meet(pair, a.x - b.x, a.y - b.y, a.z - b.z, a.w, b.w);
    }
    const unsigned int all = __ballot_sync(0xffffffffu, found);
    if (found) near_pairs[slot][count + __popc(all & ((1u << lane) - 1))] = pair;
    count += __popc(all);
}
__syncwarp();
return count;
#else
if (i < 0) return PAIRS;
const int a = shapes.data[ends.data[i].c[0]], b = shapes.data[ends.data[i].c[1]];
const float* const p = place + 3 * a;
const float* const q = place + 3 * b;
return meet(i, p[0] - q[0], p[1] - q[1], p[2] - q[2], reach_of(a), reach_of(b)) ? i : -1;
#endif
"""


class Collisions:
    """Finds contacts as `mujoco_warp.collision`."""

    def __init__(self, model: Any, data: Any) -> None:
        """Takes the arrays of both, and room for pairs.

        Args:
          model: `mujoco_warp.Model` that `can_find`.
          data: `mujoco_warp.Data`.
        """
        self._model, self._data = model, data
        self._context = collision_core.create_collision_context(data.naconmax)
        margins = [model.geom_margin, model.geom_gap, model.pair_margin, model.pair_gap]
        shapes, ends = np.unique(model.nxn_geom_pair_filtered.numpy(), return_inverse=True)
        self._shapes = wp.array(shapes, dtype=int)
        self._ends = wp.array(ends.reshape(-1, 2).astype(np.int32), dtype=wp.vec2i)
        sizes = (model.geom_aabb, model.geom_rbound, *margins, model.geom_dataid)
        sizes = tuple(each.shape[0] for each in sizes)
        filters = int(model.opt.broadphase_filter)
        self._worlds = _worlds_of_a_block(len(shapes), len(self._ends))
        self._kernel = _kernel(self._worlds, len(shapes), len(self._ends), filters, sizes)

    def find(self) -> None:
        """Contacts of all worlds."""
        m, d, context = self._model, self._data, self._context
        d.ncollision.zero_()
        d.nacon.zero_()
        wp.launch(
            self._kernel,
            dim=(d.nworld, _LANES),
            block_dim=self._worlds * _LANES,
            inputs=[
                *(self._shapes, self._ends),
                *(m.geom_type, m.geom_dataid, m.geom_aabb, m.geom_rbound),
                *(m.geom_margin, m.geom_gap, m.pair_margin, m.pair_gap),
                *(m.nxn_geom_pair_filtered, m.nxn_pairid_filtered),
                *(d.geom_xpos, d.geom_xmat, d.naconmax),
            ],
            outputs=[
                d.ncollision,
                context.collision_pair,
                context.collision_pairid,
                context.collision_worldid,
            ],
        )
        collision_driver._narrowphase(m, d, context)


def can_find(model: Any) -> bool:
    """Whether `Collisions` does what MuJoCo Warp does for a `mujoco_warp.Model`."""
    opt, pairs = model.opt, model.nxn_geom_pair_filtered.numpy()
    return (
        opt.broadphase == mjw.BroadphaseType.NXN
        and bool(opt.broadphase_filter & mjw.BroadphaseFilter.SPHERE)
        and not opt.disableflags & (mjw.DisableBit.CONSTRAINT | mjw.DisableBit.CONTACT)
        and not model.callback.contactfilter
        and len(pairs) > 0
        and _worlds_of_a_block(len(np.unique(pairs)), len(pairs)) > 0
        and (model.nxn_pairid_filtered.numpy()[:, 1] < 0).all()  # sensors watch none
    )


def _worlds_of_a_block(shapes: int, pairs: int) -> int:
    """How many have room in a block's shared memory: 16 bytes a shape, 2 a pair."""
    most = np.iinfo(np.uint16).max
    return 0 if pairs > most else min(_MOST_WORLDS, _SHARED // (16 * shapes + 2 * pairs))


@cache
def _kernel(worlds: int, shapes: int, pairs: int, filters: int, sizes: tuple[int, ...]) -> Any:
    """For so many worlds in a block, shapes and pairs, and such first axes of the model's arrays.

    Those are of bounds, radii, margins and gaps of shapes and pairs, and meshes.
    """
    still_near = collision_driver._broadphase_filter(filters, *sizes[:-1])
    missing, add = collision_driver._mesh_missing, collision_driver._add_geom_pair
    own_meshes = sizes[-1] > 1
    constants = {"WORLDS": worlds, "SHAPES": shapes, "PAIRS": pairs}
    head = "".join(f"constexpr int {name} = {value};\n" for name, value in constants.items())

    @wp.func_native(head + _NEAR)
    def near(
        world: int,
        lane: int,
        i: int,
        shapes: wp.array[int],
        ends: wp.array[wp.vec2i],
        ids: wp.array[wp.vec2i],
        positions: wp.array2d[wp.vec3],
        radii: wp.array2d[float],
        margins: wp.array2d[float],
        gaps: wp.array2d[float],
    ) -> int: ...

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False)
    def find_near(
        shapes: wp.array[int],
        ends: wp.array[wp.vec2i],
        geom_type: wp.array[int],
        geom_dataid: wp.array2d[int],
        geom_aabb: wp.array3d[wp.vec3],
        geom_rbound: wp.array2d[float],
        geom_margin: wp.array2d[float],
        geom_gap: wp.array2d[float],
        pair_margin: wp.array2d[float],
        pair_gap: wp.array2d[float],
        geom_pairs: wp.array[wp.vec2i],
        pair_ids: wp.array[wp.vec2i],
        geom_xpos: wp.array2d[wp.vec3],
        geom_xmat: wp.array2d[wp.mat33],
        naconmax: int,
        ncollision: wp.array[int],
        found: wp.array[wp.vec2i],
        found_ids: wp.array[wp.vec2i],
        found_worlds: wp.array[int],
    ):
        world, lane = wp.tid()
        count = near(
            world,
            lane,
            -1,
            shapes,
            ends,
            pair_ids,
            geom_xpos,
            geom_rbound,
            geom_margin,
            geom_gap,
        )
        for i in range(lane, count, 32):
            pair = near(
                world,
                lane,
                i,
                shapes,
                ends,
                pair_ids,
                geom_xpos,
                geom_rbound,
                geom_margin,
                geom_gap,
            )
            if pair < 0:
                continue
            first = geom_pairs[pair][0]
            second = geom_pairs[pair][1]
            kind = geom_type[first]
            other = geom_type[second]
            if wp.static(own_meshes):
                mesh = world % geom_dataid.shape[0]
                if missing(geom_dataid, first, kind, mesh):
                    continue
                if missing(geom_dataid, second, other, mesh):
                    continue
            ids = pair_ids[pair]
            if still_near(
                geom_aabb,
                geom_rbound,
                geom_margin,
                geom_gap,
                pair_margin,
                pair_gap,
                geom_xpos,
                geom_xmat,
                first,
                second,
                ids[0],
                world,
            ):
                add(
                    naconmax,
                    first,
                    second,
                    kind,
                    other,
                    world,
                    ids,
                    ncollision,
                    found,
                    found_ids,
                    found_worlds,
                )

    return find_near
