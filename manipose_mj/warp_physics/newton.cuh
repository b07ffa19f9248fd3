// The body of `newton.solve_world`: the primal Newton solver of MuJoCo for one world of at most 32 degrees of freedom.
//
// 32 lanes work on a world: of a vector or a matrix's column each holds one degree of freedom, of the constraints one
// row. On a GPU the lanes are a warp. On a CPU one thread plays all of them, phase after phase: what a phase changes,
// it does not read of other lanes. Before stand `NV`, the degrees of freedom, `MOST_ROWS` of a contact, `WORLDS` in a
// block, and MuJoCo's numbers of types, states and limits.
//
// Sources: MuJoCo's documentation, chapter "Computation", for the objective, its cones and its derivatives; the rows
// are those that MuJoCo Warp makes.

constexpr int STRIDE = NV | 1;  // odd, so that lanes with a row each meet in no memory bank
constexpr int TILE = 32 + MOST_ROWS - 1;  // rows; the last are empty
constexpr float TINY = 1e-15f;
// Sums of 32-bit floats are no more exact than this, relative to the sum of absolute values.
constexpr float NOISE = 8.0f * 1.1920929e-7f;

#if defined(__CUDA_ARCH__)
constexpr int HELD = 1;  // lanes whose values a thread holds
#define AT(lane) 0
const int first_lane = thread, end_lane = thread + 1;
__shared__ float inertias[WORLDS][NV * STRIDE];
__shared__ float factors[WORLDS][NV * STRIDE];
__shared__ float tiles[WORLDS][TILE * STRIDE];
const int slot = threadIdx.x >> 5;
float* const inertia = inertias[slot];
float* const factor = factors[slot];
float* const tile = tiles[slot];
auto sync = []() { __syncwarp(); };
auto of = [](const float* x, int lane) { return __shfl_sync(0xffffffffu, x[0], lane); };
auto count_of = [](const int* x, int lane) { return __shfl_sync(0xffffffffu, x[0], lane); };
auto any = [](const int* x) { return __any_sync(0xffffffffu, x[0]) != 0; };
auto sum = [](const float* x) {
    float total = x[0];
    // Rounded by themselves: fused with a product, the sums of two lanes would differ, and so would their ways.
    for (int step = 16; step > 0; step >>= 1) total = __fadd_rn(total, __shfl_xor_sync(0xffffffffu, total, step));
    return total;
};
#else
if (thread != 0) return;
constexpr int HELD = 32;
#define AT(lane) lane
const int first_lane = 0, end_lane = 32;
float inertia[NV * STRIDE], factor[NV * STRIDE], tile[TILE * STRIDE];
auto sync = []() {};
auto of = [](const float* x, int lane) { return x[lane]; };
auto count_of = [](const int* x, int lane) { return x[lane]; };
auto any = [](const int* x) {
    for (int lane = 0; lane < 32; ++lane)
        if (x[lane]) return true;
    return false;
};
auto sum = [](const float* x) {
    float total = 0.0f;
    for (int lane = 0; lane < 32; ++lane) total += x[lane];
    return total;
};
#endif
#define EACH_LANE for (int lane = first_lane; lane < end_lane; ++lane)

// This world's part of each array.
const int width = problem.jacobian.shape[2], most = problem.jaref_scratch.shape[1];
const int address_width = problem.contact_address.shape[1];
const float* const J = problem.jacobian.data + size_t(world) * problem.jacobian.shape[1] * width;
const float* const D = problem.stiffness.data + size_t(world) * problem.stiffness.shape[1];
const float* const reference = problem.aref.data + size_t(world) * problem.aref.shape[1];
const float* const loss = problem.frictionloss.data + size_t(world) * problem.frictionloss.shape[1];
const int* const kind = problem.row_type.data + size_t(world) * problem.row_type.shape[1];
const int* const contact = problem.row_id.data + size_t(world) * problem.row_id.shape[1];
float* const force = problem.row_force.data + size_t(world) * problem.row_force.shape[1];
int* const state = problem.row_state.data + size_t(world) * problem.row_state.shape[1];
float* const jaref = problem.jaref_scratch.data + size_t(world) * most;
float* const jv = problem.jv_scratch.data + size_t(world) * most;
const int equalities = problem.equalities.data[world], frictions = problem.frictions.data[world];
const int rows = wp::min(problem.nefc.data[world], most);
const float tolerance = problem.tolerance.data[world % problem.tolerance.shape[0]];
const float ls_tolerance = problem.ls_tolerance.data[world % problem.ls_tolerance.shape[0]];
const float impratio_invsqrt = problem.impratio_invsqrt.data[world % problem.impratio_invsqrt.shape[0]];

// The inertia, dense and symmetric, and the inverse of its trace, which scales what is compared with tolerances.
EACH_LANE {
    for (int i = lane; i < NV * STRIDE; i += 32) inertia[i] = 0.0f;
    for (int i = lane; i < TILE * STRIDE; i += 32) tile[i] = 0.0f;
}
sync();
float trace[HELD];
EACH_LANE {
    trace[AT(lane)] = 0.0f;
    if (lane < NV) {
        const float* const packed = problem.packed_inertia.data + size_t(world) * problem.packed_inertia.shape[1];
        const int begin = problem.row_address.data[lane], count = problem.row_count.data[lane];
#pragma unroll 1
        for (int k = begin; k < begin + count; ++k) {
            const int column = problem.column_index.data[k];
            inertia[lane * STRIDE + column] = packed[k];
            inertia[column * STRIDE + lane] = packed[k];
        }
        trace[AT(lane)] = packed[begin + count - 1];
    }
}
sync();
const float scale = 1.0f / wp::max(TINY, sum(trace));

auto times_inertia = [&](const float* x, float* product) {
    EACH_LANE {
        float total = 0.0f;
#pragma unroll 4
        for (int j = 0; j < NV; ++j) {
            const float value = of(x, j);
            if (lane < NV) total += inertia[j * STRIDE + lane] * value;
        }
        product[AT(lane)] = total;
    }
};

// The first step is to the warm start, from no acceleration; without constraints Newton's step is the solution.
float acceleration[HELD], inertial[HELD], gradient[HELD], pushed[HELD], search[HELD], inertial_step[HELD];
float smooth[HELD];
EACH_LANE {
    const size_t i = size_t(world) * NV + lane;
    search[AT(lane)] = lane < NV && rows > 0 && problem.warm ? problem.warm_start.data[i] : 0.0f;
    smooth[AT(lane)] = 0.0f;
    if (lane < NV) {
        const float own = problem.qfrc_passive.data[i] - problem.qfrc_bias.data[i];
        smooth[AT(lane)] = own + problem.qfrc_actuator.data[i] + problem.qfrc_applied.data[i];
        problem.qfrc_smooth.data[i] = smooth[AT(lane)];
    }
    acceleration[AT(lane)] = inertial[AT(lane)] = pushed[AT(lane)] = 0.0f;
    for (int r = lane; r < rows; r += 32) jaref[r] = -reference[r];
}
sync();

// Rows that are in the tile together: at most 32, and whole contacts.
auto end_of = [&](int begin) {
    const int end = wp::min(begin + 32, rows);
    if (end == rows || kind[end] != ELLIPTIC) return end;
    return wp::min(end, problem.contact_address.data[contact[end] * address_width]);
};
int loaded = -1;
auto load = [&](int begin, int end) {
    if (loaded == begin) return;
    sync();
    EACH_LANE if (lane < NV) {
#pragma unroll 4
        for (int r = begin; r < end; ++r) tile[(r - begin) * STRIDE + lane] = J[r * width + lane];
    }
    sync();
    loaded = begin;
};
// J x, a row each lane.
auto times_jacobian = [&](const float* x, float* product) {
#pragma unroll 1
    for (int begin = 0; begin < rows;) {
        const int end = end_of(begin);
        load(begin, end);
        EACH_LANE {
            const int r = begin + lane;
            float total = 0.0f;
#pragma unroll 4
            for (int j = 0; j < NV; ++j) {
                const float value = of(x, j);
                if (r < end) total += tile[lane * STRIDE + j] * value;
            }
            if (r < end) product[r] = total;
        }
        begin = end;
    }
    sync();
};

// A contact with an elliptic cone: where its rows begin, how many they are, and its friction.
struct Cone {
    int begin, rows;
    float mu, dm;
    const float* friction;
};
auto cone_of = [&](int r) {
    const int c = contact[r];
    Cone cone;
    cone.begin = problem.contact_address.data[c * address_width];
    cone.rows = problem.contact_dim.data[c];
    cone.friction = reinterpret_cast<const float*>(problem.contact_friction.data + c);
    cone.mu = cone.friction[0] * impratio_invsqrt;
    const float square = cone.mu * cone.mu;
    cone.dm = D[cone.begin] / wp::max(TINY, square * (1.0f + square));
    return cone;
};
// Zones of a cone: above it nothing pushes, below it all rows are springs, between them the way to the cone is one.
auto zone_of = [](float mu, float normal, float tangent) {
    if (tangent <= 0.0f) return normal < 0.0f ? QUADRATIC : SATISFIED;
    if (normal >= mu * tangent) return SATISFIED;
    return mu * normal + tangent <= 0.0f ? QUADRATIC : CONE;
};

// What a row does at `jaref`: its force and state; and its part of the Hessian, `weights` of the rows from `begin`.
struct Row {
    float force;
    int state, begin;
    float weights[MOST_ROWS];
};
auto row_of = [&](int r) {
    Row row;
    const float x = jaref[r], d = D[r];
    row.begin = r;
    for (int j = 0; j < MOST_ROWS; ++j) row.weights[j] = 0.0f;
    row.state = SATISFIED;
    row.force = 0.0f;
    bool spring = false;
    if (r < equalities) {
        spring = true;
    } else if (r < equalities + frictions) {
        const float reach = loss[r] / wp::max(TINY, d);
        if (x <= -reach) {
            row.force = loss[r];
            row.state = LINEARNEG;
        } else if (x >= reach) {
            row.force = -loss[r];
            row.state = LINEARPOS;
        } else {
            spring = true;
        }
    } else if (kind[r] == ELLIPTIC) {
        const Cone cone = cone_of(r);
        if (cone.begin + cone.rows > rows) return row;  // there was no room for all of it
        const float normal = jaref[cone.begin] * cone.mu;
        float squares = 0.0f;
#pragma unroll 1
        for (int j = 1; j < cone.rows; ++j) {
            const float u = jaref[cone.begin + j] * cone.friction[j - 1];
            squares += u * u;
        }
        const float tangent = wp::sqrt(squares);
        row.state = zone_of(cone.mu, normal, tangent);
        spring = row.state == QUADRATIC;
        if (row.state == CONE) {
            const float beyond = normal - cone.mu * tangent, inverse = 1.0f / tangent;
            const float ratio = cone.mu * normal * inverse;
            // Direction of the row in the scaled space: the normal's factor, or friction times the unit tangent.
            auto lean = [&](int j) {
                const float f = cone.friction[j - 1];
                return jaref[cone.begin + j] * f * f * inverse;
            };
            const int own = r - cone.begin;
            const float along = own ? lean(own) : 0.0f;
            row.force = own ? cone.dm * beyond * cone.mu * along : -cone.dm * beyond * cone.mu;
            row.begin = cone.begin;
            for (int j = 0; j < MOST_ROWS; ++j) {
                float weight = 0.0f;
                if (j < cone.rows) {
                    if (own == 0 && j == 0) {
                        weight = cone.mu * cone.mu;
                    } else if (own == 0 || j == 0) {
                        weight = -cone.mu * cone.mu * (own ? along : lean(j));
                    } else {
                        weight = ratio * along * lean(j);
                        const float f = cone.friction[j - 1];
                        if (j == own) weight += (cone.mu * cone.mu - ratio) * f * f;
                    }
                }
                row.weights[j] = cone.dm * weight;
            }
        }
    } else {
        spring = x < 0.0f;
    }
    if (spring) {
        row.force = -d * x;
        row.state = QUADRATIC;
        row.weights[0] = d;
    }
    return row;
};

// Forces of all rows, what they push, the gradient of the objective, and the Hessian's columns, a lane each. Gives the
// gradient's length, and whether the cost was another than a quadratic one since the last time.
float column[NV][HELD];
auto differentiate = [&](bool& bent) {
    EACH_LANE {
        pushed[AT(lane)] = 0.0f;
#pragma unroll
        for (int i = 0; i < NV; ++i) column[i][AT(lane)] = inertia[i * STRIDE + wp::min(lane, NV - 1)];
    }
    bent = false;
#pragma unroll 1
    for (int begin = 0; begin < rows;) {
        const int end = end_of(begin);
        load(begin, end);
        int begins[HELD], changed[HELD];
        float forces[HELD], weights[MOST_ROWS][HELD];
        EACH_LANE {
            begins[AT(lane)] = changed[AT(lane)] = 0;
            forces[AT(lane)] = 0.0f;
#pragma unroll
            for (int j = 0; j < MOST_ROWS; ++j) weights[j][AT(lane)] = 0.0f;
            const int r = begin + lane;
            if (r < end) {
                const Row row = row_of(r);
                begins[AT(lane)] = row.begin - begin;
                forces[AT(lane)] = row.force;
#pragma unroll
                for (int j = 0; j < MOST_ROWS; ++j) weights[j][AT(lane)] = row.weights[j];
                changed[AT(lane)] = row.state == CONE || row.state != state[r];
                force[r] = row.force;
                state[r] = row.state;
            }
        }
        bent = any(changed) || bent;
        EACH_LANE {
            const int own = wp::min(lane, NV - 1);
            float total = pushed[AT(lane)];
#pragma unroll 4
            for (int r = 0; r < end - begin; ++r) {
                const int start = count_of(begins, r);
                total += tile[r * STRIDE + own] * of(forces, r);
                float weighted = 0.0f;
#pragma unroll
                for (int j = 0; j < MOST_ROWS; ++j) {
                    weighted += of(weights[j], r) * tile[(start + j) * STRIDE + own];
                }
#pragma unroll
                for (int i = 0; i < NV; ++i) column[i][AT(lane)] += tile[r * STRIDE + i] * weighted;
            }
            pushed[AT(lane)] = total;
        }
        begin = end;
    }
    float squares[HELD];
    EACH_LANE {
        gradient[AT(lane)] = lane < NV ? inertial[AT(lane)] - smooth[AT(lane)] - pushed[AT(lane)] : 0.0f;
        squares[AT(lane)] = gradient[AT(lane)] * gradient[AT(lane)];
    }
    return wp::sqrt(sum(squares));
};

// Newton's step: the Cholesky factor of the Hessian, and the solution. Returns how much it may reduce the cost, twice.
auto find_search = [&]() {
    float pivot[HELD];
    // By columns. A lane's own column becomes its row of the factor.
    float inverse[HELD], solution[HELD];
#pragma unroll
    for (int k = 0; k < NV; ++k) {
        const float root = 1.0f / wp::sqrt(wp::max(TINY, of(column[k], k)));
        EACH_LANE {
            pivot[AT(lane)] = column[k][AT(lane)] * root;
            if (lane == k) inverse[AT(lane)] = root;
        }
        EACH_LANE {
#pragma unroll
            for (int j = k + 1; j < NV; ++j) {
                const float other = of(pivot, j);
                column[j][AT(lane)] -= pivot[AT(lane)] * other;
            }
            column[k][AT(lane)] = pivot[AT(lane)];
            if (lane < NV) factor[lane * STRIDE + k] = pivot[AT(lane)];
        }
    }
    sync();
    EACH_LANE solution[AT(lane)] = -gradient[AT(lane)];
#pragma unroll
    for (int k = 0; k < NV; ++k) {
        const float value = of(solution, k) * of(inverse, k);
        EACH_LANE {
            if (lane == k) solution[AT(lane)] = value;
            if (lane > k) solution[AT(lane)] -= column[k][AT(lane)] * value;
        }
    }
#pragma unroll 1
    for (int k = NV - 1; k >= 0; --k) {
        const float value = of(solution, k) * of(inverse, k);
        EACH_LANE {
            if (lane == k) solution[AT(lane)] = value;
            if (lane < k) solution[AT(lane)] -= factor[k * STRIDE + lane] * value;
        }
    }
    float drops[HELD];
    EACH_LANE {
        search[AT(lane)] = lane < NV ? solution[AT(lane)] : 0.0f;
        drops[AT(lane)] = -search[AT(lane)] * gradient[AT(lane)];
    }
    return sum(drops);
};

// Slope and curvature along the search of one row's cost.
auto along = [&](int r, float alpha, float& slope, float& curvature) {
    slope = 0.0f;
    curvature = 0.0f;
    const float v = jv[r], d = D[r];
    const float x = jaref[r] + alpha * v;
    bool spring = false;
    if (r < equalities) {
        spring = true;
    } else if (r < equalities + frictions) {
        const float reach = loss[r] / wp::max(TINY, d);
        spring = -reach < x && x < reach;
        if (!spring) slope = x < 0.0f ? -loss[r] * v : loss[r] * v;
    } else if (kind[r] == ELLIPTIC) {
        const Cone cone = cone_of(r);
        if (r != cone.begin || cone.begin + cone.rows > rows) return;  // the first row stands for all
        const float normal = cone.mu * x, faster = cone.mu * v;
        float uu = 0.0f, uv = 0.0f, vv = 0.0f, springs = d * x * v, stiff = d * v * v;
#pragma unroll 1
        for (int j = 1; j < cone.rows; ++j) {
            const float f = cone.friction[j - 1], vj = jv[r + j], xj = jaref[r + j] + alpha * vj;
            uu += f * f * xj * xj;
            uv += f * f * xj * vj;
            vv += f * f * vj * vj;
            springs += D[r + j] * xj * vj;
            stiff += D[r + j] * vj * vj;
        }
        const float tangent = wp::sqrt(uu);
        const int zone = zone_of(cone.mu, normal, tangent);
        if (zone == QUADRATIC) {
            slope = springs;
            curvature = stiff;
        } else if (zone == CONE) {
            const float growth = uv / tangent, beyond = normal - cone.mu * tangent;
            const float rate = faster - cone.mu * growth;
            slope = cone.dm * beyond * rate;
            curvature = cone.dm * (rate * rate - cone.mu * beyond * (vv - growth * growth) / tangent);
        }
        return;
    } else {
        spring = x < 0.0f;
    }
    if (spring) {
        slope = d * x * v;
        curvature = d * v * v;
    }
};

// Along the search the cost is convex: Newton's method for the root of its slope, inside of a bracket.
auto find_length = [&](bool& found) {
    float terms[HELD], lengths[HELD];
    EACH_LANE {
        terms[AT(lane)] = search[AT(lane)] * (inertial[AT(lane)] - smooth[AT(lane)]);
        lengths[AT(lane)] = search[AT(lane)] * search[AT(lane)];
    }
    const float smooth_slope = sum(terms);
    EACH_LANE terms[AT(lane)] = search[AT(lane)] * inertial_step[AT(lane)];
    const float smooth_curvature = sum(terms);
    const float enough = wp::max(tolerance * ls_tolerance * wp::sqrt(sum(lengths)) / scale, 1e-6f);
    float low = 0.0f, high = -1.0f, alpha = 1.0f, before = 1.0f;  // nothing is known above yet
    found = false;
#pragma unroll 1
    for (int i = 0; i < problem.ls_iterations; ++i) {
        float slopes[HELD], curvatures[HELD], gross[HELD];
        EACH_LANE {
            slopes[AT(lane)] = curvatures[AT(lane)] = gross[AT(lane)] = 0.0f;
#pragma unroll 1
            for (int r = lane; r < rows; r += 32) {
                float slope, curvature;
                along(r, alpha, slope, curvature);
                slopes[AT(lane)] += slope;
                curvatures[AT(lane)] += curvature;
                gross[AT(lane)] += wp::abs(slope);
            }
        }
        const float slope = sum(slopes) + smooth_slope + alpha * smooth_curvature;
        const float curvature = sum(curvatures) + smooth_curvature;
        // Of the sums, and of the length itself.
        const float noise = NOISE * (sum(gross) + wp::abs(smooth_slope) + alpha * (smooth_curvature + curvature));
        found = wp::abs(slope) < wp::max(enough, noise);
        if (found) break;
        if (slope < 0.0f) low = alpha; else high = alpha;
        float next = alpha - slope / wp::max(TINY, curvature);
        if (high >= 0.0f) {
            // Halved where Newton's step leaves the bracket, or where it did not come close in the last step.
            const bool slow = wp::abs(next - alpha) > 0.5f * wp::abs(before);
            if (!(next > low && next < high) || (i > 1 && slow)) next = 0.5f * (low + high);
            if (high - low < NOISE * high) {
                found = true;
                break;
            }
        }
        before = next - alpha;
        alpha = next;
    }
    return alpha;
};

int iterations = 0, limits = 0;
for (float alpha = 1.0f;;) {
    times_inertia(search, inertial_step);
    times_jacobian(search, jv);
    if (iterations > 0) {
        bool found;
        alpha = find_length(found);
        if (!found) limits |= LS_ITERATIONS;
    }
    EACH_LANE {
        acceleration[AT(lane)] += alpha * search[AT(lane)];
        inertial[AT(lane)] += alpha * inertial_step[AT(lane)];
        for (int r = lane; r < rows; r += 32) jaref[r] += alpha * jv[r];
    }
    sync();
    bool bent;
    const float steepness = differentiate(bent);
    float drop = 0.0f;
    // A whole step over a quadratic cost has found the least of it.
    const bool found_least = iterations > 0 && alpha == 1.0f && !bent;
    if (scale * steepness >= tolerance && alpha > NOISE && !found_least) drop = find_search();
    const float both = steepness + drop;
    if (both != both) {  // not a number: neither is the result
        EACH_LANE acceleration[AT(lane)] = inertial[AT(lane)] = both;
        break;
    }
    if (0.5f * scale * drop < tolerance) break;
    if (iterations == problem.iterations) {
        limits |= ITERATIONS;
        break;
    }
    ++iterations;
}
EACH_LANE {
    if (lane < NV) {
        problem.qacc.data[size_t(world) * NV + lane] = acceleration[AT(lane)];
        problem.qfrc_constraint.data[size_t(world) * NV + lane] = pushed[AT(lane)];
        problem.inertial_force.data[size_t(world) * problem.inertial_force.shape[1] + lane] = inertial[AT(lane)];
    }
    if (lane == 0) {
        problem.iterations_taken.data[world] = iterations;
        problem.overflow.data[world] |= limits;
    }
}
#undef AT
#undef EACH_LANE
