// Rays through an opening: where they meet its walls, and how far each is from what all rays of its place agree on.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "cholesky.h"

namespace {

constexpr int MOST_TERMS = 4;  // of a linear fit: one grey and its gradient
constexpr int DIGIT_BITS = 11;

// Order of codes below `range`, equal ones as they come: counting sort, digit by digit.
std::vector<int64_t> ordered(const std::vector<int64_t>& code, int64_t range) {
    const int64_t n = code.size();
    std::vector<int64_t> order(n), next(n);
    for (int64_t i = 0; i < n; ++i) order[i] = i;
    for (int shift = 0; shift < 63 && (range - 1) >> shift > 0; shift += DIGIT_BITS) {
        std::vector<int64_t> start((1 << DIGIT_BITS) + 1, 0);
        const int64_t mask = (1 << DIGIT_BITS) - 1;
        for (int64_t i = 0; i < n; ++i) ++start[((code[i] >> shift) & mask) + 1];
        for (size_t d = 1; d < start.size(); ++d) start[d] += start[d - 1];
        for (int64_t i = 0; i < n; ++i) next[start[(code[order[i]] >> shift) & mask]++] = order[i];
        order.swap(next);
    }
    return order;
}

struct Map {
    const double* values;  // (rows, columns)
    int64_t rows, columns;

    // Bilinear; beyond the border as at the border.
    double at(double r, double c) const {
        r = std::min(std::max(r, 0.0), double(rows - 1));
        c = std::min(std::max(c, 0.0), double(columns - 1));
        const int64_t i = std::min(int64_t(r), std::max<int64_t>(rows - 2, 0)), k = rows > 1 ? columns : 0;
        const int64_t j = std::min(int64_t(c), std::max<int64_t>(columns - 2, 0)), l = columns > 1;
        const double fr = r - i, fc = c - j, *p = values + i * columns + j;
        return (1 - fr) * ((1 - fc) * p[0] + fc * p[l]) + fr * ((1 - fc) * p[k] + fc * p[k + l]);
    }
};

enum { LID, WALL, FLOOR, BEHIND };

// Depth at which a ray that is free down to `depth` meets the hull: there, further down, or nowhere (infinite).
// free: it is so until it leaves the part of the hull that it is in.
double met(const double* crossings, int64_t count, bool inside, double depth, bool free) {
    int64_t passed = 0;
    while (passed < count && crossings[passed] < depth) ++passed;
    const bool within = (passed + inside) % 2 == 1;
    if (within && !free) return depth;
    passed += within;
    return passed < count ? crossings[passed] : INFINITY;
}

}  // namespace

extern "C" {

// depth: (n,) in: where rays enter; out: where they meet the wall, at most `deepest`, -1 on the face around.
// clear: (rows, columns) distance to the outline, inside positive; the outline shrinks by `draft` a cell, `sink` at most.
void bg_exits(int64_t n, const double* start, const double* sideways, const double* clear, int64_t rows,
              int64_t columns, double deepest, double draft, double sink, double slowest, double reached, int steps,
              double* depth) {
    const Map map{clear, rows, columns};
    for (int64_t i = 0; i < n; ++i) {
        const double *at = start + 2 * i, *side = sideways + 2 * i;
        const double speed = std::max(std::hypot(side[0], side[1]), slowest) + std::max(draft, 0.0);
        double d = depth[i];
        for (int step = 0; step < steps; ++step) {
            const double room = map.at(at[0] + d * side[0], at[1] + d * side[1]) - std::min(draft * d, sink);
            if (step == 0 && room < 0) d = -1;
            if (!(room > reached && d < deepest)) break;
            d += room / speed;
        }
        depth[i] = std::min(d, deepest);
    }
}

// Where rays through an opening meet it: lid, wall, floor, or what lies behind (LID .. BEHIND); or background.
// crossings: (n, count) ascending depths at which they cross the hull; exit: (n,) where they meet the wall, negative on
// the lid; depth: of the floor, of a hole if `through`. against: (n,) 0 where background is met and seen, else `cap`.
// Of the rays that show a surface and meet one, `surface` gets the indices, place (.., 4) and local (.., 3) where they
// meet it, in places of `side`. Returns their number; passing: rays that show what a hole leads to.
int64_t bg_meet(int64_t n, const double* start, const double* sideways, const double* grey, const double* entry,
                int64_t count, const double* crossings, const uint8_t* inside, const double* exit, double depth,
                int through, double side, double cap, double* against, uint8_t* told, int64_t* surface,
                int64_t* place, double* local, int64_t* passing) {
    int64_t found = 0;
    *passing = 0;
    for (int64_t i = 0; i < n; ++i) {
        int kind = exit[i] < 0 ? LID : exit[i] < depth ? WALL : FLOOR;
        double sunk = entry[i];
        if (kind != LID) {  // free down to there; behind may be another opening, or nothing
            sunk = met(crossings + i * count, count, inside[i], std::min(exit[i], depth), kind == FLOOR && through);
            if (sunk > std::min(exit[i], depth)) kind = BEHIND;
        }
        const bool empty = std::isinf(sunk), background = grey[i] < 0;
        *passing += kind != LID && sunk > depth && empty == background;
        against[i] = empty && background ? 0 : cap;
        told[i] = empty || background;
        if (told[i]) continue;
        const double at[3] = {start[2 * i] + sunk * sideways[2 * i], start[2 * i + 1] + sunk * sideways[2 * i + 1], sunk};
        for (int c = 0; c < 3; ++c) {
            const double low = std::floor(at[c] / side);
            place[4 * found + c] = int64_t(low);
            local[3 * found + c] = at[c] / side - low - 0.5;
        }
        place[4 * found + 3] = kind;
        surface[found++] = i;
    }
    return found;
}

// place: (n, keys) integer coordinates of each ray's place; local: (n, terms - 1) where in it; grey: (n,).
// difference: (n,) |distance from the place's robust linear fit| in tolerances, at most `cap`; `cap` and enough = 0
// where a place has fewer than `least` rays. ridge: (terms,) added to the fit's diagonal.
void bg_differences(int64_t n, int keys, const int64_t* place, int terms, const double* local, const double* grey,
                    double tolerance, double cap, int64_t least, const double* ridge, int reweightings,
                    double* difference, uint8_t* enough) {
    std::vector<int64_t> code(n, 0);
    int64_t range = 1;
    for (int key = 0; key < keys; ++key) {
        int64_t low = n ? place[key] : 0, high = low;
        for (int64_t i = 0; i < n; ++i) {
            low = std::min(low, place[i * keys + key]);
            high = std::max(high, place[i * keys + key]);
        }
        for (int64_t i = 0; i < n; ++i) code[i] = code[i] * (high - low + 1) + place[i * keys + key] - low;
        range *= high - low + 1;
    }
    const std::vector<int64_t> order = ordered(code, range);
    std::vector<double> weight, off, where, seen;
    for (int64_t first = 0, last; first < n; first = last) {
        for (last = first; last < n && code[order[last]] == code[order[first]];) ++last;
        const int64_t count = last - first;
        if (count < least) {
            for (int64_t i = first; i < last; ++i) difference[order[i]] = cap, enough[order[i]] = 0;
            continue;
        }
        weight.assign(count, 1.0);
        off.resize(count);
        seen.resize(count);
        where.resize(count * (terms - 1));
        for (int64_t i = 0; i < count; ++i) {
            const int64_t ray = order[first + i];
            seen[i] = grey[ray];
            std::copy_n(local + ray * (terms - 1), terms - 1, where.begin() + i * (terms - 1));
        }
        for (int fit = 0; fit <= reweightings; ++fit) {
            double a[MOST_TERMS][MOST_TERMS] = {}, b[MOST_TERMS] = {};
            for (int64_t i = 0; i < count; ++i) {
                const double *at = where.data() + i * (terms - 1), w = weight[i];
                const double g = w * seen[i];
                a[0][0] += w;
                b[0] += g;
                for (int r = 1; r < terms; ++r) {
                    const double wr = w * at[r - 1];
                    a[r][0] += wr;
                    for (int c = 1; c <= r; ++c) a[r][c] += wr * at[c - 1];
                    b[r] += g * at[r - 1];
                }
            }
            for (int r = 0; r < terms; ++r) a[r][r] += ridge[r];
            solve(a, b, terms);
            for (int64_t i = 0; i < count; ++i) {
                const double* at = where.data() + i * (terms - 1);
                double expected = b[0];
                for (int r = 1; r < terms; ++r) expected += b[r] * at[r - 1];
                off[i] = (seen[i] - expected) / tolerance;
                weight[i] = 1 / (1 + (off[i] / cap) * (off[i] / cap));
            }
        }
        for (int64_t i = 0; i < count; ++i) {
            difference[order[first + i]] = std::min(std::fabs(off[i]), cap);
            enough[order[first + i]] = 1;
        }
    }
}
}
