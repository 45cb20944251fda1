// Adam on raw parameters whose gradients arrive with respect to their natural values, and the neighbour prior.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

extern "C" {

// One Adam step. kind: 0 natural = raw, 1 natural = exp(raw), 2 natural = 1 / (1 + exp(-raw)).
// Rows of `width` values whose gradient is exactly zero everywhere are skipped when `sparse` (not seen in this view).
void bg_adam(float* raw, float* natural, const float* gradient, float* first, float* second, int64_t rows, int width,
             int kind, float rate, float beta1, float beta2, float epsilon, int64_t step, int sparse, int threads) {
    const float c1 = 1 / (1 - std::pow(beta1, float(step))), c2 = 1 / (1 - std::pow(beta2, float(step)));
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int64_t row = 0; row < rows; ++row) {
        bool seen = !sparse;
        for (int k = 0; k < width && !seen; ++k) seen = gradient[row * width + k] != 0;
        if (!seen) continue;
        for (int64_t i = row * width; i < (row + 1) * width; ++i) {
            float g = gradient[i];
            if (kind == 1) g *= natural[i];
            if (kind == 2) g *= natural[i] * (1 - natural[i]);
            first[i] = beta1 * first[i] + (1 - beta1) * g;
            second[i] = beta2 * second[i] + (1 - beta2) * g * g;
            raw[i] -= rate * first[i] * c1 / (std::sqrt(second[i] * c2) + epsilon);
            natural[i] = kind == 1 ? std::exp(raw[i]) : kind == 2 ? 1 / (1 + std::exp(-raw[i])) : raw[i];
        }
    }
}
}
