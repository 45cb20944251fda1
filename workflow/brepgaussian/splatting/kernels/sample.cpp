// Multilinear interpolation between the values of a grid; outside it, a constant.
#include <cmath>
#include <cstdint>

namespace {

// Index of the lower neighbour and weight of the upper one; false outside of the grid.
bool place(double at, int64_t size, int64_t* low, double* share) {
    if (!(at >= 0 && at <= double(size - 1))) return false;
    *low = int64_t(at);
    if (*low > size - 2 && size > 1) *low = size - 2;
    *share = at - double(*low);
    return true;
}

double mixed(double a, double b, double share) { return (1 - share) * a + share * b; }

template <typename T>
double line(const T* row, double share, int64_t step) { return mixed(row[0], row[step], share); }

template <typename T>
void bilinear(const T* values, int64_t rows, int64_t columns, int64_t count, const double* at, double outside,
              float* result) {
    const int64_t step = columns > 1, down = rows > 1 ? columns : 0;
    for (int64_t k = 0; k < count; ++k) {
        int64_t r, c;
        double y, x;
        if (!place(at[2 * k], rows, &r, &y) || !place(at[2 * k + 1], columns, &c, &x)) {
            result[k] = float(outside);
            continue;
        }
        const T* corner = values + r * columns + c;
        result[k] = float(mixed(line(corner, x, step), line(corner + down, x, step), y));
    }
}

}  // namespace

extern "C" {

// values (rows, columns), floats or bytes; at (count, 2) row and column.
void bg_bilinear(const void* values, int32_t bytes, int64_t rows, int64_t columns, int64_t count, const double* at,
                 double outside, float* result) {
    if (bytes)
        bilinear(static_cast<const uint8_t*>(values), rows, columns, count, at, outside, result);
    else
        bilinear(static_cast<const float*>(values), rows, columns, count, at, outside, result);
}

// values (n0, n1, n2); at (count, 3).
void bg_trilinear(const float* values, const int64_t* shape, int64_t count, const double* at, double outside,
                  float* result) {
    const int64_t row = shape[2], slice = shape[1] * shape[2];
    const int64_t step = shape[2] > 1, down = shape[1] > 1 ? row : 0, deep = shape[0] > 1 ? slice : 0;
    for (int64_t k = 0; k < count; ++k) {
        int64_t low[3];
        double share[3];
        bool within = true;
        for (int axis = 0; axis < 3; ++axis)
            within = within && place(at[3 * k + axis], shape[axis], &low[axis], &share[axis]);
        if (!within) {
            result[k] = float(outside);
            continue;
        }
        const float* corner = values + low[0] * slice + low[1] * row + low[2];
        const double top = mixed(line(corner, share[2], step), line(corner + down, share[2], step), share[1]);
        corner += deep;
        const double bottom = mixed(line(corner, share[2], step), line(corner + down, share[2], step), share[1]);
        result[k] = float(mixed(top, bottom, share[0]));
    }
}
}
