// The losses of stage 1 and their gradients with respect to the rendered planes, in one pass over the image.
//
// Written to be the same function as losses.py (torch), which is the readable truth and tests this one.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace {

constexpr int WINDOW = 11, HALF = WINDOW / 2;
constexpr float SIGMA = 1.5f, C1 = 0.0001f, C2 = 0.0009f;  // SSIM of images in 0..1 (Wang et al. 2004)

struct Kernel {
    float tap[WINDOW];
    Kernel() {
        float total = 0;
        for (int i = 0; i < WINDOW; ++i) total += tap[i] = std::exp(-float((i - HALF) * (i - HALF)) / (2 * SIGMA * SIGMA));
        for (float& t : tap) t /= total;
    }
};
const Kernel kernel;

// Separable Gaussian blur with zeros outside; rows in parallel, any thread count gives the same bits.
void blur(const float* in, float* scratch, float* out, int width, int height, int threads) {
    const int padded = width + 2 * HALF;
    float tap[WINDOW];  // a local copy: no store below can change it, so that the loops over x become vectors
    std::copy(kernel.tap, kernel.tap + WINDOW, tap);
#pragma omp parallel num_threads(threads)
    {
        std::vector<float> line(padded, 0.0f);
#pragma omp for schedule(static)
        for (int y = 0; y < height; ++y) {
            std::copy(in + int64_t(y) * width, in + int64_t(y + 1) * width, line.begin() + HALF);
            float* row = scratch + int64_t(y) * width;
            const float* source = line.data();
#pragma omp simd
            for (int x = 0; x < width; ++x) {
                float value = 0;
                for (int k = 0; k < WINDOW; ++k) value += tap[k] * source[x + k];
                row[x] = value;
            }
        }
#pragma omp for schedule(static)
        for (int y = 0; y < height; ++y) {
            float* row = out + int64_t(y) * width;
            const int first = std::max(0, HALF - y), last = std::min(WINDOW, height + HALF - y);
            const float* source = scratch + int64_t(y - HALF) * width;
            if (last - first == WINDOW) {
#pragma omp simd
                for (int x = 0; x < width; ++x) {
                    float value = 0;
                    for (int k = 0; k < WINDOW; ++k) value += tap[k] * source[k * width + x];
                    row[x] = value;
                }
            } else {
#pragma omp simd
                for (int x = 0; x < width; ++x) {
                    float value = 0;
                    for (int k = first; k < last; ++k) value += tap[k] * source[k * width + x];
                    row[x] = value;
                }
            }
        }
    }
}

double ordered_sum(const std::vector<double>& rows) {
    double total = 0;
    for (double row : rows) total += row;
    return total;
}

}  // namespace

extern "C" {

// Mean of 1 - SSIM over the image, and its gradient with respect to x times `weight`, added to `gradient`.
// All images are (height, stride) with zeros beyond `width`; the windows see zeros outside of the crop.
double bg_dssim(const float* x, const float* y, float* gradient, int width, int height, int stride, float weight,
                int threads) {
    const int64_t size = int64_t(stride) * height;
    static thread_local std::vector<float> buffer;  // kept: fresh pages cost more than the arithmetic on them
    buffer.resize(std::max<size_t>(buffer.size(), size * 9));
    float* maps[9];
    for (int k = 0; k < 9; ++k) maps[k] = buffer.data() + k * size;
    float *mx = maps[0], *my = maps[1], *xx = maps[2], *yy = maps[3], *xy = maps[4];
    float *in = maps[5], *scratch = maps[6], *d1 = maps[7], *d2 = maps[8];
    blur(x, scratch, mx, stride, height, threads);
    blur(y, scratch, my, stride, height, threads);
    for (int64_t i = 0; i < size; ++i) in[i] = x[i] * x[i];
    blur(in, scratch, xx, stride, height, threads);
    for (int64_t i = 0; i < size; ++i) in[i] = y[i] * y[i];
    blur(in, scratch, yy, stride, height, threads);
    for (int64_t i = 0; i < size; ++i) in[i] = x[i] * y[i];
    blur(in, scratch, xy, stride, height, threads);
    // s = A B / (C D): derivatives with respect to the local mean, E[x^2] and E[xy].
    std::vector<double> rows(height, 0.0);
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int row = 0; row < height; ++row) {
        double total = 0;
        for (int column = 0; column < stride; ++column) {
            const int64_t i = int64_t(row) * stride + column;
            const float A = 2 * mx[i] * my[i] + C1, B = 2 * (xy[i] - mx[i] * my[i]) + C2;
            const float C = mx[i] * mx[i] + my[i] * my[i] + C1;
            const float D = xx[i] - mx[i] * mx[i] + yy[i] - my[i] * my[i] + C2;
            const float inverse = 1 / (C * D), s = A * B * inverse;
            const float inside = column < width ? 1.0f : 0.0f;
            total += inside * (1 - s);
            in[i] = inside * (2 * my[i] * (B - A) * inverse - 2 * mx[i] * s * (1 / C - 1 / D));
            d1[i] = inside * -s / D;
            d2[i] = inside * 2 * A * inverse;
        }
        rows[row] = total;
    }
    const float scale = -weight / (float(width) * height);
    blur(in, scratch, mx, stride, height, threads);
    blur(d1, scratch, my, stride, height, threads);
    blur(d2, scratch, xx, stride, height, threads);
    for (int64_t i = 0; i < size; ++i) gradient[i] += scale * (mx[i] + 2 * x[i] * my[i] + y[i] * xx[i]);
    return ordered_sum(rows) / (double(width) * height);
}

// Weighted mean of |x - y| (power 1) or (x - y)^2 (power 2); the gradient is added.
double bg_difference(const float* x, const float* y, float* gradient, int width, int height, int stride, float weight,
                     int power, int threads) {
    std::vector<double> rows(height, 0.0);
    const float scale = weight / (float(width) * height);
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int row = 0; row < height; ++row) {
        const int64_t base = int64_t(row) * stride;
        float total = 0;
        for (int i = 0; i < width; ++i) {
            const float d = x[base + i] - y[base + i];
            if (power == 1) {
                total += std::fabs(d);
                gradient[base + i] += d > 0 ? scale : (d < 0 ? -scale : 0.0f);
            } else {
                total += d * d;
                gradient[base + i] += 2 * scale * d;
            }
        }
        rows[row] = total;
    }
    return ordered_sum(rows) / (double(width) * height);
}

// Depth distortion in its squared form, sum_ij w_i w_j (m_i - m_j)^2 = 2 (A M2 - M1^2), mean over pixels.
double bg_distortion(const float* m1, const float* m2, const float* alpha, float* g1, float* g2, float* ga, int width,
                     int height, int stride, float weight, int threads) {
    std::vector<double> rows(height, 0.0);
    const float scale = weight / (float(width) * height);
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int row = 0; row < height; ++row) {
        double total = 0;
        for (int64_t i = int64_t(row) * stride; i < int64_t(row) * stride + width; ++i) {
            total += 2 * (alpha[i] * m2[i] - m1[i] * m1[i]);
            g1[i] -= 4 * scale * m1[i];
            g2[i] += 2 * scale * alpha[i];
            ga[i] += 2 * scale * m2[i];
        }
        rows[row] = total;
    }
    return ordered_sum(rows) / (double(width) * height);
}

// 1 - n . N over pixels whose four neighbours are covered: n rendered normals (camera frame, length = weight), N the
// normal of the expected depth by central differences (2DGS, section 5). Mean over the image.
double bg_normal_consistency(const float* n, const float* m1, const float* alpha, float* gn, float* g1, float* ga,
                             int64_t plane, int width, int height, int stride, float fx, float fy, float cx, float cy,
                             float z_reference, float covered, float weight, int threads) {
    std::vector<double> rows(height, 0.0);
    static thread_local std::vector<float> buffer;  // kept, as in bg_dssim
    buffer.assign(plane * 4, 0.0f);
    float* const g_local = buffer.data();
    const float scale = weight / (float(width) * height);
    const auto depth = [&](int64_t i) { return z_reference + m1[i] / alpha[i]; };
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int y = 1; y < height - 1; ++y) {
        double total = 0;
        for (int x = 1; x < width - 1; ++x) {
            const int64_t i = int64_t(y) * stride + x, at[4] = {i + 1, i - 1, i + stride, i - stride};
            bool ok = alpha[i] > covered;
            for (int64_t k : at) ok = ok && alpha[k] > covered;
            if (!ok) continue;
            const float ray[4][2] = {{(x + 1.5f - cx) / fx, (y + 0.5f - cy) / fy},
                                     {(x - 0.5f - cx) / fx, (y + 0.5f - cy) / fy},
                                     {(x + 0.5f - cx) / fx, (y + 1.5f - cy) / fy},
                                     {(x + 0.5f - cx) / fx, (y - 0.5f - cy) / fy}};
            float p[4][3];
            for (int k = 0; k < 4; ++k) {
                const float z = depth(at[k]);
                p[k][0] = z * ray[k][0], p[k][1] = z * ray[k][1], p[k][2] = z;
            }
            float h[3], v[3];
            for (int c = 0; c < 3; ++c) h[c] = p[0][c] - p[1][c], v[c] = p[2][c] - p[3][c];
            // v x h points towards the camera (x right, y down, z forward)
            const float N[3] = {v[1] * h[2] - v[2] * h[1], v[2] * h[0] - v[0] * h[2], v[0] * h[1] - v[1] * h[0]};
            const float length = std::sqrt(N[0] * N[0] + N[1] * N[1] + N[2] * N[2]) + 1e-20f;
            float unit[3], dotted = 0, normal[3];
            for (int c = 0; c < 3; ++c) {
                unit[c] = N[c] / length, normal[c] = n[c * plane + i];
                dotted += unit[c] * normal[c];
            }
            total += 1 - dotted;
            float gN[3];
            for (int c = 0; c < 3; ++c) {
                gn[c * plane + i] -= scale * unit[c];
                gN[c] = -scale * (normal[c] - dotted * unit[c]) / length;
            }
            // N = v x h: dv = h x gN, dh = gN x v
            const float gv[3] = {h[1] * gN[2] - h[2] * gN[1], h[2] * gN[0] - h[0] * gN[2], h[0] * gN[1] - h[1] * gN[0]};
            const float gh[3] = {gN[1] * v[2] - gN[2] * v[1], gN[2] * v[0] - gN[0] * v[2], gN[0] * v[1] - gN[1] * v[0]};
            for (int k = 0; k < 4; ++k) {
                const float* d = k < 2 ? gh : gv;
                const float sign = k % 2 == 0 ? 1.0f : -1.0f;
                g_local[k * plane + i] = sign * (d[0] * ray[k][0] + d[1] * ray[k][1] + d[2]);
            }
        }
        rows[y] = total;
    }
    // Gather, so that rows may run in parallel: pixel i is the right neighbour of i - 1, and so on.
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const int64_t i = int64_t(y) * stride + x;
            float g = 0;
            if (x > 0) g += g_local[i - 1];
            if (x < width - 1) g += g_local[plane + i + 1];
            if (y > 0) g += g_local[2 * plane + i - stride];
            if (y < height - 1) g += g_local[3 * plane + i + stride];
            if (g == 0) continue;
            g1[i] += g / alpha[i];
            ga[i] -= g * m1[i] / (alpha[i] * alpha[i]);
        }
    return ordered_sum(rows) / (double(width) * height);
}
}
