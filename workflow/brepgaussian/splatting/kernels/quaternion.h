// Rotation matrix of a quaternion wxyz of any length, and the gradient back to it.
#pragma once
#include <cmath>

// `unit` (4) and `m` (9, row major) are written.
inline void rotation_of(const float* q, double* unit, double* m) {
    double length = 0;
    for (int i = 0; i < 4; ++i) length += double(q[i]) * q[i];
    length = std::sqrt(length);
    for (int i = 0; i < 4; ++i) unit[i] = q[i] / length;
    const double w = unit[0], x = unit[1], y = unit[2], z = unit[3];
    m[0] = 1 - 2 * (y * y + z * z), m[1] = 2 * (x * y - w * z), m[2] = 2 * (x * z + w * y);
    m[3] = 2 * (x * y + w * z), m[4] = 1 - 2 * (x * x + z * z), m[5] = 2 * (y * z - w * x);
    m[6] = 2 * (x * z - w * y), m[7] = 2 * (y * z + w * x), m[8] = 1 - 2 * (x * x + y * y);
}

// From dL/dm (9) to dL/dq (4), through the normalisation.
inline void rotation_gradient(const float* q, const double* unit, const double* g, float* out) {
    const double w = unit[0], x = unit[1], y = unit[2], z = unit[3];
    double d[4];
    d[0] = 2 * (-z * g[1] + y * g[2] + z * g[3] - x * g[5] - y * g[6] + x * g[7]);
    d[1] = 2 * (y * g[1] + z * g[2] + y * g[3] - 2 * x * g[4] - w * g[5] + z * g[6] + w * g[7] - 2 * x * g[8]);
    d[2] = 2 * (-2 * y * g[0] + x * g[1] + w * g[2] + x * g[3] + z * g[5] - w * g[6] + z * g[7] - 2 * y * g[8]);
    d[3] = 2 * (-2 * z * g[0] - w * g[1] + x * g[2] + w * g[3] - 2 * z * g[4] + y * g[5] + x * g[6] + y * g[7]);
    double length = 0, along = 0;
    for (int i = 0; i < 4; ++i) length += double(q[i]) * q[i], along += d[i] * unit[i];
    length = std::sqrt(length);
    for (int i = 0; i < 4; ++i) out[i] = float((d[i] - along * unit[i]) / length);
}
