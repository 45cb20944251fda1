// Adam on raw parameters whose gradients arrive with respect to their natural values.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

extern "C" {

// One Adam step. kind: 0 natural = raw, 1 natural = exp(raw), 2 natural = 1 / (1 + exp(-raw)).
// With `shared` all rows use one second moment (second[0]), the mean over rows: a surfel moves in proportion to its
// gradient, instead of every surfel moving at the full rate, those that see nothing but noise too.
void bg_adam(float* raw, float* natural, float* gradient, float* first, float* second, int64_t rows, int width,
             int kind, float rate, float beta1, float beta2, float epsilon, int64_t step, int shared, int threads) {
    const float c1 = 1 / (1 - std::pow(beta1, float(step))), c2 = 1 / (1 - std::pow(beta2, float(step)));
    const int64_t size = rows * width;
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int64_t i = 0; i < size; ++i) {
        if (kind == 1) gradient[i] *= natural[i];
        if (kind == 2) gradient[i] *= natural[i] * (1 - natural[i]);
    }
    if (shared && size > 0) {
        double total = 0;  // in one order
        for (int64_t i = 0; i < size; ++i) total += double(gradient[i]) * gradient[i];
        second[0] = beta2 * second[0] + (1 - beta2) * float(total / size);
    }
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int64_t i = 0; i < size; ++i) {
        const float g = gradient[i];
        first[i] = beta1 * first[i] + (1 - beta1) * g;
        float v = second[0];
        if (!shared) v = second[i] = beta2 * second[i] + (1 - beta2) * g * g;
        raw[i] -= rate * first[i] * c1 / (std::sqrt(v * c2) + epsilon);
        natural[i] = kind == 1 ? std::exp(raw[i]) : kind == 2 ? 1 / (1 + std::exp(-raw[i])) : raw[i];
    }
}
}
