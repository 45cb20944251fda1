// Surfels to the screen, and into 8x8 tiles from near to far.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "quaternion.h"
#include "raster.h"

namespace {

double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Fill one surfel's screen form and tile box; false when it cannot be seen.
bool project_one(const ViewParams& view, const Cloud& cloud, int64_t i, Screen& out, int32_t* box) {
    double unit[4], world[9], axes[9], p[3];
    rotation_of(cloud.quaternions + 4 * i, unit, world);
    const float* r = view.rotation;
    for (int row = 0; row < 3; ++row) {
        p[row] = view.translation[row];
        for (int k = 0; k < 3; ++k) p[row] += double(r[3 * row + k]) * cloud.centers[3 * i + k];
        for (int column = 0; column < 3; ++column) {
            axes[3 * column + row] = 0;  // columns of the matrix become rows: t_u, t_v, n
            for (int k = 0; k < 3; ++k) axes[3 * column + row] += double(r[3 * row + k]) * world[3 * k + column];
        }
    }
    if (!(p[2] > view.near)) return false;
    double* n = axes + 6;
    double k = dot(n, p);
    out.sign = 1;
    if (k > 0) {
        if (view.cull) return false;
        out.sign = -1;
        k = -k;
        for (int c = 0; c < 3; ++c) n[c] = -n[c];
    }
    if (-k <= view.grazing * std::sqrt(dot(p, p))) return false;
    const float opacity = cloud.opacities[i];
    if (!(opacity > view.cutoff)) return false;
    const double su = cloud.scales[2 * i], sv = cloud.scales[2 * i + 1];
    const double rho_max = 2 * std::log(double(opacity) / view.cutoff);

    const double w[3] = {n[0] / k, n[1] / k, n[2] / k};
    const double ap = dot(axes, p) / su, bp = dot(axes + 3, p) / sv;
    out.ux = float((axes[0] / su - ap * w[0]) / view.fx), out.uy = float((axes[1] / su - ap * w[1]) / view.fy);
    out.vx = float((axes[3] / sv - bp * w[0]) / view.fx), out.vy = float((axes[4] / sv - bp * w[1]) / view.fy);
    out.wx = float(w[0] / view.fx), out.wy = float(w[1] / view.fy), out.iz = float(1 / p[2]);
    out.xc = float(view.fx * p[0] / p[2] + view.cx), out.yc = float(view.fy * p[1] / p[2] + view.cy);
    out.opacity = opacity, out.rho_max = float(rho_max), out.zc = float(p[2]);
    out.nx = float(n[0]), out.ny = float(n[1]), out.nz = float(n[2]);

    // Box of the projected disk u^2 + v^2 <= rho_max: tangents of a conic (2DGS, section 4.2).
    const double depth2 = rho_max * (su * su * axes[2] * axes[2] + sv * sv * axes[5] * axes[5]) - p[2] * p[2];
    if (depth2 >= 0) return false;  // the disk reaches the camera's plane
    double low[2], high[2];
    const double focal[2] = {view.fx, view.fy}, principal[2] = {view.cx, view.cy};
    const double filter = view.low_pass > 0 ? std::sqrt(rho_max / view.low_pass) : 0;
    const float center[2] = {out.xc, out.yc};
    for (int c = 0; c < 2; ++c) {
        const double a = axes[c] * su, b = axes[3 + c] * sv, az = axes[2] * su, bz = axes[5] * sv;
        const double mid = (rho_max * (a * az + b * bz) - p[c] * p[2]) / depth2;
        const double half2 = mid * mid - (rho_max * (a * a + b * b) - p[c] * p[c]) / depth2;
        const double half = std::sqrt(std::max(half2, 0.0));
        low[c] = std::min(focal[c] * (mid - half) + principal[c], center[c] - filter);
        high[c] = std::max(focal[c] * (mid + half) + principal[c], center[c] + filter);
    }
    out.y_low = float(low[1]), out.y_high = float(high[1]);
    // Pixels whose centres lie inside; the box is empty when none does.
    const double sizes[2] = {double(view.width), double(view.height)};
    for (int c = 0; c < 2; ++c) {
        const double from = std::max(std::ceil(low[c] - 0.5), 0.0), to = std::min(std::floor(high[c] - 0.5), sizes[c] - 1);
        if (!(from <= to)) return false;
        box[c] = int32_t(from) / TILE, box[2 + c] = int32_t(to) / TILE + 1;
    }
    return true;
}

// Stable order of the visible surfels by depth (radix sort on the float's bits; depths are positive).
std::vector<int32_t> by_depth(const Context& context) {
    std::vector<int32_t> order, scratch;
    for (int64_t i = 0; i < context.count; ++i)
        if (context.first[i + 1] > context.first[i]) order.push_back(int32_t(i));
    scratch.resize(order.size());
    constexpr int BITS = 11;
    for (int shift = 0; shift < 33; shift += BITS) {
        uint32_t starts[(1 << BITS) + 1] = {};
        const auto digit = [&](int32_t i) {
            uint32_t bits;
            std::memcpy(&bits, &context.screen[i].zc, 4);
            return (bits >> shift) & ((1u << BITS) - 1);
        };
        for (int32_t i : order) ++starts[digit(i) + 1];
        for (int d = 0; d < (1 << BITS); ++d) starts[d + 1] += starts[d];
        for (int32_t i : order) scratch[starts[digit(i)]++] = i;
        order.swap(scratch);
    }
    return order;
}

}  // namespace

void project(Context& context, const Cloud& cloud) {
    const int64_t count = context.count;
    context.screen.resize(count);
    context.box.assign(4 * count, 0);
    context.first.assign(count + 1, 0);
#pragma omp parallel for schedule(static) num_threads(context.view.threads)
    for (int64_t i = 0; i < count; ++i) {
        int32_t* box = &context.box[4 * i];
        if (project_one(context.view, cloud, i, context.screen[i], box))
            context.first[i + 1] = int64_t(box[2] - box[0]) * (box[3] - box[1]);
    }
    std::partial_sum(context.first.begin(), context.first.end(), context.first.begin());
}

void bin(Context& context) {
    const int tiles = context.tiles_x * context.tiles_y;
    const int64_t pairs = context.first[context.count];
    context.tile_start.assign(tiles + 1, 0);
    const std::vector<int32_t> order = by_depth(context);
    const auto each_tile = [&](int32_t i, auto&& action) {
        const int32_t* box = &context.box[4 * int64_t(i)];
        int64_t pair = context.first[i];
        for (int y = box[1]; y < box[3]; ++y)
            for (int x = box[0]; x < box[2]; ++x) action(y * context.tiles_x + x, pair++);
    };
    for (int32_t i : order) each_tile(i, [&](int tile, int64_t) { ++context.tile_start[tile + 1]; });
    std::partial_sum(context.tile_start.begin(), context.tile_start.end(), context.tile_start.begin());
    context.entry_surfel.resize(pairs);
    context.entry_pair.resize(pairs);
    std::vector<int64_t> cursor(context.tile_start.begin(), context.tile_start.end() - 1);
    for (int32_t i : order)
        each_tile(i, [&](int tile, int64_t pair) {
            const int64_t slot = cursor[tile]++;
            context.entry_surfel[slot] = i;
            context.entry_pair[slot] = pair;
        });
}
