// gsplat's rasterising kernels, unchanged, on a CPU: the threads of a block are fibers, one block runs at a time.
//
// Compiled with kernels.inc beside it, which holds the kernels' text; see gsplat_on_cpu.py.
#include <ucontext.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <glm/glm.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <type_traits>
#include <vector>

#define __global__
#define __device__
#define __shared__
#define __restrict__ __restrict
#define FILTER_INV_SQUARE_2DGS 2.0f
#define ALPHA_THRESHOLD (1.f / 255.f)
#define __expf(x) std::exp(x)

struct Index {
    uint32_t x, y, z;
};
struct uint2 {
    uint32_t x, y;
};

// What the device gives its kernels: conversions that saturate, mixed minima, sums that nothing interrupts.
static uint32_t saturated(float v) { return v <= 0 ? 0 : uint32_t(v); }
static uint32_t saturated_floor(float v) { return saturated(std::floor(v)); }
static uint32_t saturated_ceil(float v) { return saturated(std::ceil(v)); }
template <class A, class B>
auto min(A a, B b) {
    using C = std::common_type_t<A, B>;
    return C(a) < C(b) ? C(a) : C(b);
}
template <class A, class B>
auto max(A a, B b) {
    using C = std::common_type_t<A, B>;
    return C(a) > C(b) ? C(a) : C(b);
}
template <class T>
void gpuAtomicAdd(T* p, T v) {
    *p += v;
}

// Fibers.
struct Fiber {
    ucontext_t context;
    std::vector<char> stack;
    bool done;
};
static ucontext_t scheduler;
static std::vector<Fiber> fibers;
static std::function<void()> kernel;
static int current, alive;

static void yield() { swapcontext(&fibers[current].context, &scheduler); }

static void run_fiber() {
    kernel();
    fibers[current].done = true;
    --alive;
    yield();
}

// Barriers of a block and of its warps, by generations.
struct Barrier {
    int arrived = 0;
    uint64_t generation = 0;
    double value[1024], result = 0;
    template <class F>
    double wait(int rank, int size, double v, F combine) {
        const uint64_t mine = generation;
        value[rank] = v;
        if (++arrived == size) {
            result = value[0];
            for (int i = 1; i < size; ++i) result = combine(result, value[i]);
            arrived = 0;
            ++generation;
        } else {
            while (generation == mine) yield();
        }
        return result;
    }
};
static Barrier of_block, of_warp[32];
static Index block_index;
static uint32_t side;  // of a tile, threads
static int64_t grid_rank;
static double add(double a, double b) { return a + b; }

static uint32_t __syncthreads_count(bool v) { return uint32_t(of_block.wait(current, side * side, v, add)); }

static void run_block() {
    const int threads = side * side;
    fibers.resize(threads);
    alive = threads;
    for (Fiber& f : fibers) {
        f.stack.resize(256 << 10);
        f.done = false;
        getcontext(&f.context);
        f.context.uc_stack.ss_sp = f.stack.data();
        f.context.uc_stack.ss_size = f.stack.size();
        f.context.uc_link = &scheduler;
        makecontext(&f.context, run_fiber, 0);
    }
    while (alive)
        for (current = 0; current < threads; ++current)
            if (!fibers[current].done) swapcontext(&scheduler, &fibers[current].context);
}

namespace cooperative_groups {
template <class T>
struct plus {
    T operator()(T a, T b) const { return a + b; }
};
template <class T>
struct greater {
    T operator()(T a, T b) const { return a > b ? a : b; }
};
struct Block {
    Index group_index() const { return block_index; }
    Index thread_index() const { return {uint32_t(current) % side, uint32_t(current) / side, 0}; }
    uint32_t thread_rank() const { return uint32_t(current); }
    uint32_t size() const { return side * side; }
    void sync() const { __syncthreads_count(false); }
};
inline Block this_thread_block() { return {}; }
template <int N>
struct thread_block_tile {
    uint32_t thread_rank() const { return uint32_t(current) % N; }
    bool any(bool v) const { return of_warp[current / N].wait(current % N, N, v, add) > 0; }
};
template <int N>
thread_block_tile<N> tiled_partition(Block) {
    return {};
}
template <int N, class T, class Op>
T reduce(thread_block_tile<N>, T v, Op op) {
    const auto combine = [&](double a, double b) { return double(op(T(a), T(b))); };
    return T(of_warp[current / N].wait(current % N, N, v, combine));
}
struct Grid {
    int64_t thread_rank() const { return grid_rank; }
};
inline Grid this_grid() { return {}; }
}  // namespace cooperative_groups

namespace gsplat {
namespace cg = cooperative_groups;
using vec2 = glm::vec<2, float>;
using vec3 = glm::vec<3, float>;
using vec4 = glm::vec<4, float>;
using mat2 = glm::mat<2, 2, float>;
using mat3 = glm::mat<3, 3, float>;
using mat4 = glm::mat<4, 4, float>;
int s[1 << 18];  // shared memory
#include "kernels.inc"
}  // namespace gsplat
using namespace gsplat;

static void run_tiles(uint32_t columns, uint32_t rows) {
    for (uint32_t y = 0; y < rows; ++y)
        for (uint32_t x = 0; x < columns; ++x) {
            block_index = {0, y, x};
            std::memset(gsplat::s, 0xff, sizeof gsplat::s);  // NaN where nothing was written
            run_block();
        }
}

struct Call {  // mirror of `_Call` in gsplat_on_cpu.py
    uint32_t channels, count, pairs, width, height, tile, columns, rows;
    const float *xy, *transforms, *colors, *opacities, *normals;
    const int32_t *offsets, *order;
    float *color, *alpha, *normal, *distortion, *median;
    int32_t *last_ids, *median_ids;
    const float *v_color, *v_alpha, *v_normal, *v_distortion, *v_median;
    float *g_xy, *g_transforms, *g_colors, *g_opacities, *g_normals, *g_densify;
};

template <uint32_t C>
void forward(const Call& c) {
    kernel = [&] {
        rasterize_to_pixels_2dgs_fwd_kernel<C, float>(
            1, c.count, c.pairs, false, (const vec2*)c.xy, c.transforms, c.colors, c.opacities, c.normals, nullptr,
            nullptr, c.width, c.height, c.tile, c.columns, c.rows, c.offsets, c.order, c.color, c.alpha, c.normal,
            c.distortion, c.median, c.last_ids, c.median_ids);
    };
    run_tiles(c.columns, c.rows);
}

template <uint32_t C>
void backward(const Call& c) {
    if (c.pairs == 0) return;  // as gsplat
    kernel = [&] {
        rasterize_to_pixels_2dgs_bwd_kernel<C, float>(
            1, c.count, c.pairs, false, (const vec2*)c.xy, c.transforms, c.colors, c.normals, c.opacities, nullptr,
            nullptr, c.width, c.height, c.tile, c.columns, c.rows, c.offsets, c.order, c.color, c.alpha, c.last_ids,
            c.median_ids, c.v_color, c.v_alpha, c.v_normal, c.v_distortion, c.v_median, nullptr, (vec2*)c.g_xy,
            c.g_transforms, c.g_colors, c.g_opacities, c.g_normals, c.g_densify);
    };
    run_tiles(c.columns, c.rows);
}

extern "C" {
int rasterise(const Call* call, int differentiate) {
    side = call->tile;
    switch (call->channels) {
#define CASE(N)                                             \
    case N:                                                 \
        differentiate ? backward<N>(*call) : forward<N>(*call); \
        return 0;
        CASE(1)
        CASE(2)
        CASE(4)
        CASE(8)
        CASE(16)
        CASE(32)
        CASE(64)
    }
    return 1;
}

void tiles(uint32_t count, const float* xy, const int32_t* radii, const float* depth, const int64_t* before,
           uint32_t tile, uint32_t columns, uint32_t rows, uint32_t bits, int32_t* each, int64_t* ids, int32_t* order) {
    for (grid_rank = 0; grid_rank < count; ++grid_rank)
        intersect_tile_kernel<float>(false, 1, count, 0, nullptr, nullptr, xy, radii, depth, before, tile, columns,
                                     rows, bits, 1, each, ids, order);
}

void offsets(uint32_t pairs, const int64_t* ids, uint32_t count, uint32_t bits, int32_t* out) {
    for (grid_rank = 0; grid_rank < pairs; ++grid_rank) intersect_offset_kernel(pairs, ids, 1, count, bits, out);
}
}
