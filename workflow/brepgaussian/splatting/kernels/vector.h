// Vectors of LANES floats over pixels: GCC vector extensions, so that one source serves AVX-512, AVX2, SSE and NEON.
#pragma once
#include <cstdint>
#include <cstring>
#if defined(__AVX512F__) || defined(__AVX2__)
#include <immintrin.h>
#endif

#if defined(__AVX512F__)
constexpr int LANES = 16;
#else
constexpr int LANES = 8;
#endif

typedef float vf __attribute__((vector_size(LANES * 4)));
typedef int32_t vi __attribute__((vector_size(LANES * 4)));

static inline vf splat(float x) { return vf{} + x; }

// Does any lane of a comparison hold?
static inline bool any(vi mask) {
#if defined(__AVX512F__)
    return _mm512_test_epi32_mask((__m512i)mask, (__m512i)mask) != 0;
#elif defined(__AVX2__)
    return _mm256_movemask_ps((__m256)mask) != 0;
#else
    int32_t seen = 0;
    for (int i = 0; i < LANES; ++i) seen |= mask[i];
    return seen != 0;
#endif
}

static inline vf load(const float* p) {
    vf x;
    std::memcpy(&x, p, sizeof(x));
    return x;
}

static inline void store(float* p, vf x) { std::memcpy(p, &x, sizeof(x)); }

static inline float sum(vf x) {  // pairwise, in one order for all lanes: the same bits on every run
    float parts[LANES];
    store(parts, x);
    for (int step = LANES / 2; step > 0; step /= 2)
        for (int i = 0; i < step; ++i) parts[i] += parts[i + step];
    return parts[0];
}

// exp(x) for x <= 0, relative error below 2e-7: 2^n times a degree-6 polynomial on [-1/2, 1/2].
static inline vf exp_negative(vf x) {
    const vf lowest = splat(-87.0f);
    x = x < lowest ? lowest : x;
    const vf y = x * 1.44269504f;
    const vi n = __builtin_convertvector(y - 0.5f, vi);  // truncation towards zero of a negative number: round
    const vf f = (x - __builtin_convertvector(n, vf) * 0.693359375f) + __builtin_convertvector(n, vf) * 2.12194440e-4f;
    vf p = splat(1.9875691500e-4f);
    p = p * f + 1.3981999507e-3f;
    p = p * f + 8.3334519073e-3f;
    p = p * f + 4.1665795894e-2f;
    p = p * f + 1.6666665459e-1f;
    p = p * f + 5.0000001201e-1f;
    p = p * f * f + f + 1.0f;
    const vi bits = (n + 127) << 23;
    return p * (vf)bits;
}
