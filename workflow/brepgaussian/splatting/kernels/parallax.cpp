// How much too deep or too high each place of a surface lies, told by the greys of the rays that hit it: robust fits.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "cholesky.h"

namespace {

constexpr int TERMS = 4;  // grey, its gradient on the surface, the depth along it

struct Ray {
    double design[TERMS], slant[2], grey, weight;
};

double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

void cross(const double* a, const double* b, double* c) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

void normalize(double* a) {
    const double length = std::sqrt(dot(a, a));
    for (int k = 0; k < 3; ++k) a[k] /= length;
}

// Weighted normal matrix of the first `terms` columns (lower triangle), and right-hand side.
void normal(const std::vector<Ray>& rays, int terms, double damping, double (*a)[TERMS], double* b) {
    for (int r = 0; r < terms; ++r) {
        b[r] = 0;
        for (int c = 0; c <= r; ++c) a[r][c] = 0;
    }
    for (const Ray& ray : rays)
        for (int r = 0; r < terms; ++r) {
            const double wr = ray.weight * ray.design[r];
            b[r] += wr * ray.grey;
            for (int c = 0; c <= r; ++c) a[r][c] += wr * ray.design[c];
        }
    for (int r = 0; r < terms; ++r) a[r][r] += damping;
}

double rest(const Ray& ray, const double* solution, int terms) {
    double expected = 0;
    for (int r = 0; r < terms; ++r) expected += solution[r] * ray.design[r];
    return ray.grey - expected;
}

// Fit by reweighting; the weights are those of the fit.
void robust(std::vector<Ray>& rays, int terms, int times, double damping, double tolerance, double* solution) {
    double a[TERMS][TERMS];
    for (int time = 0; time < times; ++time) {
        normal(rays, terms, damping, a, solution);
        solve(a, solution, terms);
        for (Ray& ray : rays) {
            const double off = rest(ray, solution, terms) / tolerance;
            ray.weight = 1 / (1 + off * off);
        }
    }
}

}  // namespace

extern "C" {
// Rays in the order of their places; starts: (places + 1,) first ray of each. points, normals, directions: (n, 3).
// Out: centres (places, 3), mean normals (places, 3), depth in footprints, its standard error, and the least cosine
// between the mean normal and a ray's.
void bg_depths(int64_t places, const int64_t* starts, const double* points, const double* normals,
               const double* directions, const double* grey, double footprint, double tolerance, double rounding,
               double damping, int reweightings, int rounds, double* centres, double* mean_normals, double* depth,
               double* sigma, double* facing) {
    std::vector<Ray> rays;
    for (int64_t place = 0; place < places; ++place) {
        const int64_t first = starts[place], count = starts[place + 1] - first;
        double *center = centres + 3 * place, *up = mean_normals + 3 * place;
        for (int k = 0; k < 3; ++k) {
            center[k] = up[k] = 0;
            for (int64_t i = first; i < first + count; ++i) {
                center[k] += points[3 * i + k];
                up[k] += normals[3 * i + k];
            }
            center[k] /= count;
        }
        normalize(up);
        const double ahead[3] = {std::fabs(up[0]) < 0.9 ? 1.0 : 0.0, std::fabs(up[0]) < 0.9 ? 0.0 : 1.0, 0.0};
        double axes[2][3];
        cross(up, ahead, axes[0]);
        normalize(axes[0]);
        cross(up, axes[0], axes[1]);
        facing[place] = 1;
        rays.resize(count);
        for (int64_t i = 0; i < count; ++i) {
            const double *n = normals + 3 * (first + i), *d = directions + 3 * (first + i);
            const double* p = points + 3 * (first + i);
            const double away[3] = {p[0] - center[0], p[1] - center[1], p[2] - center[2]}, into = -dot(n, d);
            facing[place] = std::min(facing[place], dot(n, up));
            Ray& ray = rays[i];
            ray.grey = grey[first + i];
            ray.weight = ray.design[0] = 1;
            for (int a = 0; a < 2; ++a) {
                ray.design[1 + a] = dot(axes[a], away) / footprint;
                ray.slant[a] = dot(axes[a], d) / into;
            }
        }
        double solution[TERMS], a[TERMS][TERMS], last[TERMS] = {0, 0, 0, 1};
        robust(rays, TERMS - 1, reweightings, damping, tolerance, solution);
        for (int round = 0; round < rounds; ++round) {  // the gradient is better known, the better the depth is
            double mean = 0, weight = 0;
            for (Ray& ray : rays) {
                ray.design[3] = ray.slant[0] * solution[1] + ray.slant[1] * solution[2];
                mean += ray.weight * ray.design[3];
                weight += ray.weight;
            }
            for (Ray& ray : rays) ray.design[3] -= mean / weight;
            robust(rays, TERMS, reweightings, damping, tolerance, solution);
        }
        depth[place] = solution[3];
        double variance = 0, weight = 0;
        for (const Ray& ray : rays) {
            const double off = rest(ray, solution, TERMS);
            variance += ray.weight * off * off;
            weight += ray.weight;
        }
        double unused[TERMS];
        normal(rays, TERMS, damping, a, unused);
        solve(a, last, TERMS);
        sigma[place] = std::max(std::sqrt(variance / weight), rounding * tolerance) * std::sqrt(last[3]);
    }
}
}
