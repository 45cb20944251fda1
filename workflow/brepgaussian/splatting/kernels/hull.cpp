// Signed distance to the visual hull on a grid: the minimum over views of the signed distance to the silhouette.
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace {

constexpr int BLOCK = 8;

struct Silhouettes {
    const int16_t* images;  // (views, height, width) signed distance to the contour in 1/UNITS px, inside positive
    const double* poses;    // (views, 12) rows of the 3x4 camera from unit
    const double* intrinsics;
    int views, height, width;
    float units;

    // Distance of a point to the hull in unit-frame lengths; exits when it is outside by more than `band`.
    float at(const double* x, float band) const {
        float least = band;
        for (int v = 0; v < views; ++v) {
            const double* m = poses + 12 * v;
            const double *k = intrinsics + 4 * v, z = m[8] * x[0] + m[9] * x[1] + m[10] * x[2] + m[11];
            if (z <= 0) continue;
            const double px = k[0] * (m[0] * x[0] + m[1] * x[1] + m[2] * x[2] + m[3]) / z + k[2] - 0.5;
            const double py = k[1] * (m[4] * x[0] + m[5] * x[1] + m[6] * x[2] + m[7]) / z + k[3] - 0.5;
            if (!(px >= 0 && py >= 0 && px < width - 1 && py < height - 1)) continue;  // not seen: no evidence
            const int ix = int(px), iy = int(py);
            const float fx = float(px - ix), fy = float(py - iy);
            const int16_t* p = images + (int64_t(v) * height + iy) * width + ix;
            const float top = p[0] + fx * (p[1] - p[0]), low = p[width] + fx * (p[width + 1] - p[width]);
            const float pixels = (top + fy * (low - top)) / units;
            const float distance = pixels * float(z / (0.5 * (k[0] + k[1])));
            if (distance < least) least = distance;
            if (least < -band) return -band;
        }
        return least;
    }
};

}  // namespace

extern "C" {

// field: (n, n, n) indexed [ix][iy][iz], clamped to +-band; coarse blocks that the hull's surface cannot cross are
// filled with their centre's sign.
void bg_hull(const int16_t* images, const double* poses, const double* intrinsics, int views, int height, int width,
             float units, const double* origin, double spacing, int n, float band, float* field, int threads) {
    const Silhouettes s{images, poses, intrinsics, views, height, width, units};
    const int blocks = (n + BLOCK - 1) / BLOCK;
    const float reach = float(spacing * BLOCK * 0.5 * std::sqrt(3.0)) * 1.1f + band;  // a little slack for perspective
#pragma omp parallel for schedule(dynamic, 8) num_threads(threads)
    for (int block = 0; block < blocks * blocks * blocks; ++block) {
        const int low[3] = {block / (blocks * blocks) * BLOCK, block / blocks % blocks * BLOCK, block % blocks * BLOCK};
        double centre[3];
        for (int c = 0; c < 3; ++c) centre[c] = origin[c] + spacing * (low[c] + 0.5 * (BLOCK - 1));
        const float middle = s.at(centre, 2 * reach);
        for (int i = low[0]; i < std::min(low[0] + BLOCK, n); ++i)
            for (int j = low[1]; j < std::min(low[1] + BLOCK, n); ++j)
                for (int k = low[2]; k < std::min(low[2] + BLOCK, n); ++k) {
                    float& out = field[(int64_t(i) * n + j) * n + k];
                    if (std::fabs(middle) > reach) {
                        out = middle > 0 ? band : -band;
                        continue;
                    }
                    const double x[3] = {origin[0] + spacing * i, origin[1] + spacing * j, origin[2] + spacing * k};
                    out = s.at(x, band);
                }
    }
}
}
