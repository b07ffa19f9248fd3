"""The first look at pairs of shapes: MuJoCo Warp's, of the pairs alone whose bounding spheres meet.

A warp of the GPU, or a few, look at a world: they keep the spheres in shared memory, where a pair costs two reads; MuJoCo
Warp gathers some twenty numbers of a pair from anywhere.
"""

from functools import cache
from typing import Any

import mujoco_warp as mjw  # pyright: ignore[reportMissingImports]
import numpy as np
import warp as wp  # pyright: ignore[reportMissingImports]
from mujoco_warp._src import collision_core, collision_driver  # pyright: ignore[reportMissingImports]

_WARP = 32  # lanes
_MOST_WORLDS = 4  # in a block
_MANY_PAIRS, _WARPS = 1_024, 4  # of a world, and the warps of a block that look at one with so many
_SHARED = 44_000  # bytes of shared memory in a block, of 48 KiB
# A pair's two shapes in one word, and whether the model names the pair, which then has margins of its own.
_SHAPE_BITS, _NAMED = 15, 1 << 30
# Lists the pairs of a world whose spheres meet, if `i` is -1, and returns how many; else returns a pair of the list. A
# CPU has no shared memory: there the list is of all pairs, and of those that do not meet -1 is returned.
_NEAR = """
const float* const place = reinterpret_cast<const float*>(positions.data) + size_t(world) * positions.shape[1] * 3;
const float* const radius = radii.data + size_t(world % radii.shape[0]) * radii.shape[1];
const float* const margin = margins.data + size_t(world % margins.shape[0]) * margins.shape[1];
const float* const gap = gaps.data + size_t(world % gaps.shape[0]) * gaps.shape[1];
// Of a sphere; planes have none.
auto reach_of = [&](int shape) { return radius[shape] == 0.0f ? -1.0f : radius[shape] + margin[shape] + gap[shape]; };
auto first_of = [](int ends) { return ends & ((1 << SHAPE_BITS) - 1); };
auto second_of = [](int ends) { return (ends >> SHAPE_BITS) & ((1 << SHAPE_BITS) - 1); };
auto meet = [](int ends, float x, float y, float z, float reach, float other) {
    return ends >= NAMED || reach < 0.0f || other < 0.0f ||
           x * x + y * y + z * z <= (reach + other) * (reach + other);
};
#if defined(__CUDA_ARCH__)
__shared__ float4 spheres[WORLDS][SHAPES];
__shared__ unsigned short near_pairs[WORLDS][PAIRS];
__shared__ int counts[WORLDS];
const int slot = threadIdx.x / LANES;
if (i >= 0) return near_pairs[slot][i];
// Of several warps in a block all look at one world.
auto all_are_here = [] { if (LANES > 32) __syncthreads(); else __syncwarp(); };
for (int k = lane; k < SHAPES; k += LANES) {
    const int shape = shapes.data[k];
    spheres[slot][k] = make_float4(place[3 * shape], place[3 * shape + 1], place[3 * shape + 2], reach_of(shape));
}
if (lane == 0) counts[slot] = 0;
all_are_here();
const unsigned int before = (1u << (lane & 31)) - 1;
for (int first = 0; first < PAIRS; first += AT_ONCE * LANES) {
    int ends_of[AT_ONCE];
    unsigned int found[AT_ONCE];
#pragma unroll
    for (int k = 0; k < AT_ONCE; ++k) {
        const int pair = first + k * LANES + lane;
        ends_of[k] = pair < PAIRS ? ends.data[pair] : -1;
    }
    int count = 0;
#pragma unroll
    for (int k = 0; k < AT_ONCE; ++k) {
        bool near = false;
        if (ends_of[k] >= 0) {
            const float4 a = spheres[slot][first_of(ends_of[k])], b = spheres[slot][second_of(ends_of[k])];
            near = meet(ends_of[k], a.x - b.x, a.y - b.y, a.z - b.z, a.w, b.w);
        }
        found[k] = __ballot_sync(0xffffffffu, near);
        count += __popc(found[k]);
    }
    if (count == 0) continue;
    int place_of = 0;
    if ((lane & 31) == 0) place_of = atomicAdd(&counts[slot], count);
    place_of = __shfl_sync(0xffffffffu, place_of, 0);
#pragma unroll
    for (int k = 0; k < AT_ONCE; ++k) {
        if (found[k] >> (lane & 31) & 1) near_pairs[slot][place_of + __popc(found[k] & before)] = first + k * LANES + lane;
        place_of += __popc(found[k]);
    }
}
all_are_here();
return counts[slot];
#else
if (i < 0) return PAIRS;
const int both = ends.data[i], a = shapes.data[first_of(both)], b = shapes.data[second_of(both)];
const float* const p = place + 3 * a;
const float* const q = place + 3 * b;
return meet(both, p[0] - q[0], p[1] - q[1], p[2] - q[2], reach_of(a), reach_of(b)) ? i : -1;
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
        first, second = ends.reshape(-1, 2).T
        named = model.nxn_pairid_filtered.numpy()[:, 0] >= 0
        self._shapes = wp.array(shapes, dtype=int)
        self._ends = wp.array(first | second << _SHAPE_BITS | named * _NAMED, dtype=int)
        sizes = (model.geom_aabb, model.geom_rbound, *margins, model.geom_dataid)
        sizes = tuple(each.shape[0] for each in sizes)
        filters = int(model.opt.broadphase_filter)
        pairs = len(self._ends)
        self._lanes = _WARP * (_WARPS if pairs > _MANY_PAIRS else 1)
        self._worlds = _worlds_of_a_block(len(shapes), pairs)
        self._kernel = _kernel(self._worlds, self._lanes, len(shapes), pairs, filters, sizes)

    def find(self) -> None:
        """Contacts of all worlds."""
        m, d, context = self._model, self._data, self._context
        d.ncollision.zero_()
        d.nacon.zero_()
        wp.launch(
            self._kernel,
            dim=(d.nworld, self._lanes),
            block_dim=self._worlds * self._lanes,
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
    """How many have room in a block's shared memory, 16 bytes a shape and 2 a pair; with many pairs one at most."""
    if pairs > np.iinfo(np.uint16).max:
        return 0
    return min(1 if pairs > _MANY_PAIRS else _MOST_WORLDS, _SHARED // (16 * shapes + 2 * pairs))


@cache
def _kernel(
    worlds: int, lanes: int, shapes: int, pairs: int, filters: int, sizes: tuple[int, ...]
) -> Any:
    """For so many worlds in a block, lanes of each, shapes and pairs, and such first axes of the model's arrays.

    Those are of bounds, radii, margins and gaps of shapes and pairs, and meshes.
    """
    still_near = collision_driver._broadphase_filter(filters, *sizes[:-1])
    missing, add = collision_driver._mesh_missing, collision_driver._add_geom_pair
    own_meshes = sizes[-1] > 1
    constants = {"WORLDS": worlds, "LANES": lanes, "SHAPES": shapes, "PAIRS": pairs, "AT_ONCE": 4}
    constants |= {"SHAPE_BITS": _SHAPE_BITS, "NAMED": _NAMED}
    head = "".join(f"constexpr int {name} = {value};\n" for name, value in constants.items())

    @wp.func_native(head + _NEAR)
    def near(
        world: int,
        lane: int,
        i: int,
        shapes: wp.array[int],
        ends: wp.array[int],
        positions: wp.array2d[wp.vec3],
        radii: wp.array2d[float],
        margins: wp.array2d[float],
        gaps: wp.array2d[float],
    ) -> int: ...

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False)
    def find_near(
        shapes: wp.array[int],
        ends: wp.array[int],
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
            geom_xpos,
            geom_rbound,
            geom_margin,
            geom_gap,
        )
        for i in range(lane, count, lanes):
            pair = near(
                world,
                lane,
                i,
                shapes,
                ends,
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
