// 2D Gaussian Splatting on tiles of 8x8 pixels, forward and backward, vectorised over pixels.
//
// The backward pass also walks front to back. With q_i = dL/d(weight of surfel i) in a pixel and S the running sum of
// w_i q_i, dL/dalpha_i = T_i q_i - (S_total - S_<=i) / (1 - alpha_i), and S_total is the scalar product of the rendered
// values with their gradients, so that nothing but the images has to be kept.
#include "raster.h"

#include <cmath>

#include "quaternion.h"
#include "vector.h"

namespace {

constexpr int ROWS = LANES / TILE;      // image rows in one vector
constexpr int VECTORS = TILE / ROWS;    // vectors in one tile
constexpr int MAX_CHANNELS = 64;

struct Tile {
    int x, y;
    vf px;           // pixel centres of a vector's lanes
    vf py[VECTORS];
};

Tile tile_at(const Context& context, int index) {
    Tile tile;
    tile.x = (index % context.tiles_x) * TILE, tile.y = (index / context.tiles_x) * TILE;
    for (int lane = 0; lane < LANES; ++lane) {
        tile.px[lane] = tile.x + lane % TILE + 0.5f;
        for (int r = 0; r < VECTORS; ++r) tile.py[r][lane] = tile.y + r * ROWS + lane / TILE + 0.5f;
    }
    return tile;
}

vf load_pixels(const float* plane, int stride, const Tile& tile, int r) {
    float lanes[LANES];
    for (int k = 0; k < ROWS; ++k)
        std::memcpy(lanes + k * TILE, plane + int64_t(tile.y + r * ROWS + k) * stride + tile.x, TILE * 4);
    return load(lanes);
}

void store_pixels(float* plane, int stride, const Tile& tile, int r, vf x) {
    float lanes[LANES];
    store(lanes, x);
    for (int k = 0; k < ROWS; ++k)
        std::memcpy(plane + int64_t(tile.y + r * ROWS + k) * stride + tile.x, lanes + k * TILE, TILE * 4);
}

// One surfel on one vector of pixels.
struct Hit {
    vf dx, dy, z, a, b, e, alpha;  // e = exp(-rho / 2) with rho = min(a^2 + b^2, low pass)
    vi flat;                       // the low pass is the smaller one
    vi hit;
};

inline Hit intersect(const ViewParams& view, const Screen& s, vf px, vf py, vf transmittance) {
    Hit h;
    h.dx = px - s.xc, h.dy = py - s.yc;
    const vf iw = h.dx * s.wx + h.dy * s.wy + s.iz;
    h.z = 1.0f / iw;
    h.a = (h.dx * s.ux + h.dy * s.uy) * h.z;
    h.b = (h.dx * s.vx + h.dy * s.vy) * h.z;
    vf rho = h.a * h.a + h.b * h.b;
    vi inside = (rho <= s.rho_max) & (iw > 0.0f);
    h.flat = vi{};
    if (view.low_pass > 0) {
        const vf filter = (h.dx * h.dx + h.dy * h.dy) * view.low_pass;
        h.flat = ~(inside & (rho <= filter)) & (filter <= s.rho_max);
        rho = h.flat ? filter : rho;
        h.z = h.flat ? splat(s.zc) : h.z;
        inside |= h.flat;
    }
    h.hit = inside & (transmittance >= view.transmittance);
    if (!any(h.hit)) return h;
    h.e = exp_negative(rho * -0.5f);
    h.alpha = h.e * s.opacity;
    h.alpha = h.alpha > view.alpha_max ? splat(view.alpha_max) : h.alpha;
    return h;
}

// Rows of the tile that a surfel can touch, as a range of vectors.
inline void vector_range(const Screen& s, const Tile& tile, int& from, int& to) {
    const float low = (s.y_low - tile.y - 0.5f) / ROWS, high = (s.y_high - tile.y - 0.5f) / ROWS;
    from = low > 0 ? int(low) : 0;
    to = high < VECTORS - 1 ? int(high) + 1 : VECTORS;
}

template <int FIXED>
void forward_tile(Context& context, const float* channels, int index, float* planes) {
    const ViewParams& view = context.view;
    const int C = FIXED >= 0 ? FIXED : view.channels;
    const Tile tile = tile_at(context, index);
    const int64_t plane = int64_t(context.tiles_y) * TILE * view.stride;
    vf sums[(FIXED >= 0 ? FIXED : MAX_CHANNELS) + GEOMETRY][VECTORS];
    vf T[VECTORS], median[VECTORS];
    for (int r = 0; r < VECTORS; ++r) {
        for (int c = 0; c < C + GEOMETRY; ++c) sums[c][r] = vf{};
        T[r] = splat(1.0f), median[r] = vf{};
    }
    const int64_t start = context.tile_start[index], end = context.tile_start[index + 1];
    int64_t used = start;
    for (; used < end; ++used) {
        if (used % 8 == 0) {  // stop where every pixel is opaque; looked at now and then, it costs
            vi open = vi{};
            for (int r = 0; r < VECTORS; ++r) open |= T[r] >= view.transmittance;
            if (!any(open)) break;
        }
        const int32_t i = context.entry_surfel[used];
        const Screen& s = context.screen[i];
        const float* c_i = channels + int64_t(C) * i;
        int from, to;
        vector_range(s, tile, from, to);
        for (int r = from; r < to; ++r) {
            const Hit h = intersect(view, s, tile.px, tile.py[r], T[r]);
            if (!any(h.hit)) continue;
            const vf w = h.hit ? h.alpha * T[r] : vf{};
            for (int c = 0; c < C; ++c) sums[c][r] += w * c_i[c];
            sums[C][r] += w * s.nx, sums[C + 1][r] += w * s.ny, sums[C + 2][r] += w * s.nz;
            const vf m = h.z - view.z_reference, wm = h.hit ? w * m : vf{};
            sums[C + 3][r] += wm;
            sums[C + 4][r] += h.hit ? wm * m : vf{};
            const vf after = T[r] - w;
            median[r] = (h.hit & (T[r] > 0.5f) & (after <= 0.5f)) ? h.z : median[r];
            T[r] = after;
        }
    }
    context.tile_used[index] = int32_t(used - start);
    for (int r = 0; r < VECTORS; ++r) {
        for (int c = 0; c < C + GEOMETRY; ++c) store_pixels(planes + c * plane, view.stride, tile, r, sums[c][r]);
        store_pixels(planes + (C + GEOMETRY) * plane, view.stride, tile, r, 1.0f - T[r]);
        store_pixels(planes + (C + GEOMETRY + 1) * plane, view.stride, tile, r, median[r]);
    }
}

template <int FIXED>
void backward_tile(Context& context, const float* channels, int index, const float* planes, const float* gradients) {
    const ViewParams& view = context.view;
    const int C = FIXED >= 0 ? FIXED : view.channels;
    const int width = BASE_SUMS + C + 3;
    const int64_t start = context.tile_start[index], end = start + context.tile_used[index];
    if (start == end) return;
    const Tile tile = tile_at(context, index);
    const int64_t plane = int64_t(context.tiles_y) * TILE * view.stride;
    constexpr int SIZE = (FIXED >= 0 ? FIXED : MAX_CHANNELS) + GEOMETRY;
    vf g[SIZE + 2][VECTORS], T[VECTORS], rest[VECTORS];  // rest = S_total - S_<=i
    vi live = vi{};
    for (int r = 0; r < VECTORS; ++r) {
        T[r] = splat(1.0f), rest[r] = vf{};
        for (int c = 0; c < C + GEOMETRY + 2; ++c) {
            g[c][r] = load_pixels(gradients + c * plane, view.stride, tile, r);
            live |= g[c][r] != 0.0f;
            if (c <= C + GEOMETRY) rest[r] += g[c][r] * load_pixels(planes + c * plane, view.stride, tile, r);
        }
    }
    if (!any(live)) return;
    vf sums[BASE_SUMS + (FIXED >= 0 ? FIXED : MAX_CHANNELS) + 3];
    for (int64_t entry = start; entry < end; ++entry) {
        const int32_t i = context.entry_surfel[entry];
        const Screen& s = context.screen[i];
        const float* c_i = channels + int64_t(C) * i;
        bool touched = false;
        int from, to;
        vector_range(s, tile, from, to);
        for (int r = from; r < to; ++r) {
            const Hit h = intersect(view, s, tile.px, tile.py[r], T[r]);
            if (!any(h.hit)) continue;
            if (!touched) {
                for (int k = 0; k < width; ++k) sums[k] = vf{};
                touched = true;
            }
            const vf zero = vf{}, alpha = h.hit ? h.alpha : zero, w = alpha * T[r];
            const vf m = h.hit ? h.z - view.z_reference : zero;
            const vf gm = g[C + 3][r], gm2 = g[C + 4][r];
            vf q = g[C + 5][r] + g[C][r] * s.nx + g[C + 1][r] * s.ny + g[C + 2][r] * s.nz + m * (gm + m * gm2);
            for (int c = 0; c < C; ++c) q += g[c][r] * c_i[c];
            rest[r] -= w * q;
            vf g_alpha = T[r] * q - rest[r] / (1.0f - alpha);
            g_alpha = (h.hit & (alpha < view.alpha_max)) ? g_alpha : zero;
            const vf after = T[r] - w;
            vf gz = w * (gm + 2.0f * m * gm2);
            gz += (h.hit & (T[r] > 0.5f) & (after <= 0.5f)) ? g[C + 6][r] : zero;
            T[r] = after;

            const vf g_rho = g_alpha * alpha * -0.5f;
            const vf a = h.hit ? h.a : zero, b = h.hit ? h.b : zero, z = h.hit ? h.z : zero;
            const vf ga = h.flat ? zero : 2.0f * g_rho * a, gb = h.flat ? zero : 2.0f * g_rho * b;
            const vf gu = ga * z, gv = gb * z;
            const vf gw = h.flat ? zero : -z * (z * gz + ga * a + gb * b);  // towards 1 / z
            sums[0] += gu * h.dx, sums[1] += gu * h.dy, sums[2] += gu;
            sums[3] += gv * h.dx, sums[4] += gv * h.dy, sums[5] += gv;
            sums[6] += gw * h.dx, sums[7] += gw * h.dy, sums[8] += gw;
            if (view.low_pass > 0) {
                const vf gf = h.flat ? g_rho : zero;
                sums[9] += gf * h.dx, sums[10] += gf * h.dy;
                sums[11] += h.flat ? gz : zero;
            }
            sums[12] += g_alpha * (h.hit ? h.e : zero);
            sums[13] += w;
            for (int c = 0; c < C; ++c) sums[BASE_SUMS + c] += w * g[c][r];
            for (int c = 0; c < 3; ++c) sums[BASE_SUMS + C + c] += w * g[C + c][r];
        }
        if (!touched) continue;
        const int64_t pair = context.entry_pair[entry];
        context.touched[pair] = 1;
        for (int k = 0; k < width; ++k) context.sums[pair * width + k] = sum(sums[k]);
    }
}

// From a surfel's screen gradients back to its parameters.
void unproject(const Context& context, const Cloud& cloud, int64_t i, const double* t, float* g_center,
               float* g_quaternion, float* g_scale, float* g_screen) {
    const ViewParams& view = context.view;
    const Screen& s = context.screen[i];
    const int C = view.channels;
    double unit[4], world[9], axes[9], p[3];
    rotation_of(cloud.quaternions + 4 * i, unit, world);
    for (int row = 0; row < 3; ++row) {
        p[row] = view.translation[row];
        for (int k = 0; k < 3; ++k) p[row] += double(view.rotation[3 * row + k]) * cloud.centers[3 * i + k];
        for (int column = 0; column < 3; ++column) {
            double value = 0;
            for (int k = 0; k < 3; ++k) value += double(view.rotation[3 * row + k]) * world[3 * k + column];
            axes[3 * column + row] = column == 2 ? s.sign * value : value;
        }
    }
    const double* n = axes + 6;
    const double k = n[0] * p[0] + n[1] * p[1] + n[2] * p[2];
    double g_axes[9] = {}, gp[3] = {}, gw[3] = {t[6] / view.fx, t[7] / view.fy, 0};
    for (int side = 0; side < 2; ++side) {
        const double size = cloud.scales[2 * i + side];
        const double gu[3] = {t[3 * side] / view.fx, t[3 * side + 1] / view.fy, 0};
        double a[3], ap = 0, gu_w = 0, ga[3];
        for (int c = 0; c < 3; ++c) a[c] = axes[3 * side + c] / size, ap += a[c] * p[c], gu_w += gu[c] * n[c] / k;
        double along = 0;
        for (int c = 0; c < 3; ++c) {
            ga[c] = gu[c] - gu_w * p[c];
            gp[c] -= gu_w * a[c];
            gw[c] -= ap * gu[c];
            g_axes[3 * side + c] = ga[c] / size;
            along += ga[c] * a[c];
        }
        g_scale[side] = float(-along / size);
    }
    const double gk = -(gw[0] * n[0] + gw[1] * n[1] + gw[2] * n[2]) / (k * k);
    for (int c = 0; c < 3; ++c) {
        g_axes[6 + c] = s.sign * (gw[c] / k + gk * p[c] + t[BASE_SUMS + C + c]);
        gp[c] += gk * n[c];
    }
    const double g_xc = -(s.ux * t[2] + s.vx * t[5] + s.wx * t[8]) - 2 * view.low_pass * t[9];
    const double g_yc = -(s.uy * t[2] + s.vy * t[5] + s.wy * t[8]) - 2 * view.low_pass * t[10];
    g_screen[0] = float(g_xc), g_screen[1] = float(g_yc);
    gp[0] += g_xc * view.fx / p[2];
    gp[1] += g_yc * view.fy / p[2];
    gp[2] += t[11] - t[8] / (p[2] * p[2]) - (g_xc * view.fx * p[0] + g_yc * view.fy * p[1]) / (p[2] * p[2]);
    double g_world[9] = {};
    for (int row = 0; row < 3; ++row) {
        double value = 0;
        for (int c = 0; c < 3; ++c) {
            value += view.rotation[3 * c + row] * gp[c];
            for (int column = 0; column < 3; ++column)
                g_world[3 * row + column] += view.rotation[3 * c + row] * g_axes[3 * column + c];
        }
        g_center[row] = float(value);
    }
    rotation_gradient(cloud.quaternions + 4 * i, unit, g_world, g_quaternion);
}

template <int FIXED>
void forward_all(Context& context, const float* channels, float* planes) {
    const int tiles = context.tiles_x * context.tiles_y;
#pragma omp parallel for schedule(dynamic, 4) num_threads(context.view.threads)
    for (int tile = 0; tile < tiles; ++tile) forward_tile<FIXED>(context, channels, tile, planes);
}

template <int FIXED>
void backward_all(Context& context, const float* channels, const float* planes, const float* gradients) {
    const int tiles = context.tiles_x * context.tiles_y;
#pragma omp parallel for schedule(dynamic, 4) num_threads(context.view.threads)
    for (int tile = 0; tile < tiles; ++tile) backward_tile<FIXED>(context, channels, tile, planes, gradients);
}

}  // namespace

extern "C" {

int bg_lanes() { return LANES; }
int bg_max_channels() { return MAX_CHANNELS; }
Context* bg_create() { return new Context; }
void bg_destroy(Context* context) { delete context; }
int64_t bg_pairs(const Context* context) { return context->first.empty() ? 0 : context->first.back(); }

// What a forward pass does before it touches pixels.
void bg_project(Context* context, const ViewParams* view, int64_t count, const float* centers, const float* quaternions,
                const float* scales, const float* opacities, const float* channels) {
    context->view = *view;
    context->count = count;
    context->tiles_x = view->stride / TILE, context->tiles_y = (view->height + TILE - 1) / TILE;
    context->tile_used.assign(context->tiles_x * context->tiles_y, 0);
    project(*context, {centers, quaternions, scales, opacities, channels});
    bin(*context);
}

// planes: (channels + 7, rows padded to 8, stride): channels, normal (3), m, m^2, alpha, median depth.
void bg_forward(Context* context, const ViewParams* view, int64_t count, const float* centers, const float* quaternions,
                const float* scales, const float* opacities, const float* channels, float* planes) {
    bg_project(context, view, count, centers, quaternions, scales, opacities, channels);
    switch (view->channels) {
        case 1: return forward_all<1>(*context, channels, planes);
        case 2: return forward_all<2>(*context, channels, planes);
        case 4: return forward_all<4>(*context, channels, planes);
        default: return forward_all<-1>(*context, channels, planes);
    }
}

// `gradients` is laid out as `planes`; the last output is the sum of weights of each surfel over the view.
void bg_backward(Context* context, const float* centers, const float* quaternions, const float* scales,
                 const float* opacities, const float* channels, const float* planes, const float* gradients,
                 float* g_centers, float* g_quaternions, float* g_scales, float* g_opacities, float* g_channels,
                 float* g_screen, float* weights) {
    const int C = context->view.channels, width = BASE_SUMS + C + 3;
    const int64_t pairs = context->first[context->count];
    context->sums.resize(pairs * width);
    context->touched.assign(pairs, 0);
    switch (C) {
        case 1: backward_all<1>(*context, channels, planes, gradients); break;
        case 2: backward_all<2>(*context, channels, planes, gradients); break;
        case 4: backward_all<4>(*context, channels, planes, gradients); break;
        default: backward_all<-1>(*context, channels, planes, gradients);
    }
    const Cloud cloud{centers, quaternions, scales, opacities, channels};
#pragma omp parallel for schedule(static) num_threads(context->view.threads)
    for (int64_t i = 0; i < context->count; ++i) {
        double total[BASE_SUMS + MAX_CHANNELS + 3] = {};
        bool touched = false;
        for (int64_t pair = context->first[i]; pair < context->first[i + 1]; ++pair) {
            if (!context->touched[pair]) continue;
            touched = true;
            for (int k = 0; k < width; ++k) total[k] += context->sums[pair * width + k];
        }
        for (int c = 0; c < 3; ++c) g_centers[3 * i + c] = 0;
        for (int c = 0; c < 4; ++c) g_quaternions[4 * i + c] = 0;
        g_scales[2 * i] = g_scales[2 * i + 1] = g_screen[2 * i] = g_screen[2 * i + 1] = 0;
        g_opacities[i] = float(total[12]), weights[i] = float(total[13]);
        for (int c = 0; c < C; ++c) g_channels[i * C + c] = float(total[BASE_SUMS + c]);
        if (touched)
            unproject(*context, cloud, i, total, g_centers + 3 * i, g_quaternions + 4 * i, g_scales + 2 * i,
                      g_screen + 2 * i);
    }
}

// Compositing weights of chosen pixels (paper, w_i): up to `limit` surfels a pixel, front to back; returns none missed.
void bg_weights(Context* context, int64_t pixels, const int32_t* xy, int32_t limit, int32_t* surfels, float* weights,
                int32_t* counts) {
    const ViewParams& view = context->view;
#pragma omp parallel for schedule(dynamic, 256) num_threads(view.threads)
    for (int64_t pixel = 0; pixel < pixels; ++pixel) {
        const int x = xy[2 * pixel], y = xy[2 * pixel + 1];
        const int tile = (y / TILE) * context->tiles_x + x / TILE;
        float T = 1;
        int32_t found = 0;
        for (int64_t entry = context->tile_start[tile]; entry < context->tile_start[tile + 1]; ++entry) {
            if (T < view.transmittance || found == limit) break;
            const int32_t i = context->entry_surfel[entry];
            const Screen& s = context->screen[i];
            const float dx = x + 0.5f - s.xc, dy = y + 0.5f - s.yc, iw = s.wx * dx + s.wy * dy + s.iz;
            float rho = INFINITY;
            if (iw > 0) {
                const float a = (s.ux * dx + s.uy * dy) / iw, b = (s.vx * dx + s.vy * dy) / iw;
                rho = a * a + b * b;
            }
            if (view.low_pass > 0) rho = std::fmin(rho, view.low_pass * (dx * dx + dy * dy));
            if (!(rho <= s.rho_max)) continue;
            const float alpha = std::fmin(s.opacity * std::exp(-0.5f * rho), view.alpha_max);
            surfels[pixel * limit + found] = i;
            weights[pixel * limit + found] = alpha * T;
            ++found;
            T -= alpha * T;
        }
        counts[pixel] = found;
    }
}
}
