// State of one rendered view, kept from the forward to the backward pass.
#pragma once
#include <cstdint>
#include <vector>

constexpr int TILE = 8;
constexpr int GEOMETRY = 5;   // channels that follow the caller's: normal (3), m, m^2
constexpr int BASE_SUMS = 14; // per-pair gradient sums before those of the channels and the normal

// Passed from Python as plain floats and ints; keep in step with library.py.
struct ViewParams {
    float rotation[9];     // camera from unit, row major
    float translation[3];
    float fx, fy, cx, cy;  // of the crop, pixel centres at integer + 0.5
    float z_reference;     // m = z - z_reference keeps m^2 small
    float near;            // surfels nearer than this are left out
    float cutoff;          // alpha below it does not count
    float transmittance;   // a pixel is done below it
    float low_pass;        // 1 / sigma^2 in px^-2 of the screen-space filter; < 0: none
    float alpha_max;
    float grazing;         // |n.p| / |p| below it: edge-on, left out
    int32_t width, height, stride;  // true size and padded row length (a multiple of TILE)
    int32_t channels;
    int32_t cull;          // leave out surfels that face away
    int32_t threads;
};

// A surfel as the pixel loop sees it; positions in pixels relative to its projected centre (xc, yc).
struct Screen {
    float xc, yc;          // projected centre
    float ux, uy, vx, vy;  // u = z (ux dx + uy dy), v alike: no constant, since u = v = 0 at the centre
    float wx, wy, iz;      // 1 / z = iz + wx dx + wy dy
    float opacity, rho_max, zc;
    float nx, ny, nz;      // camera frame, towards the camera
    float y_low, y_high;   // rows that it can touch
    float sign;            // -1 when the normal was turned round
};

struct Context {
    ViewParams view{};
    int64_t count = 0;
    int tiles_x = 0, tiles_y = 0;
    std::vector<Screen> screen;          // (N,)
    std::vector<int32_t> box;            // (N, 4) tile range, empty when not visible
    std::vector<int64_t> first;          // (N + 1,) first pair of each surfel
    std::vector<int64_t> tile_start;     // (tiles + 1,)
    std::vector<int32_t> entry_surfel;   // (pairs,) by tile, near to far
    std::vector<int64_t> entry_pair;     // (pairs,) the pair's slot, surfel by surfel
    std::vector<int32_t> tile_used;      // (tiles,) entries before every pixel was opaque
    std::vector<float> sums;             // (pairs, BASE_SUMS + channels + 3)
    std::vector<uint8_t> touched;        // (pairs,)
};

struct Cloud {  // natural values, not logits
    const float *centers, *quaternions, *scales, *opacities, *channels;
};

void project(Context& context, const Cloud& cloud);
void bin(Context& context);
