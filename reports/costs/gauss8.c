/* Gauss(8) with a fixed step on Kepler's problem, H = |p|^2/2 - 1/|q|: the algorithm of integrators/kernel.

   Second-order form, the eight stages of a component in one vector. First stages are the extrapolation of the
   last two steps' polynomials, the stopping rule is that of integrators/kernel/step/stopping.py, and the state
   is a sum of two doubles. All tables come from the kernel. Compiled without contraction, as the kernel is:
   each fused multiply-add is written. */

#include <math.h>
#include <stdint.h>
#include <string.h>

typedef double v8 __attribute__((vector_size(64)));
typedef double v4 __attribute__((vector_size(32)));
typedef double v4u __attribute__((vector_size(32), aligned(8)));
typedef int64_t i8 __attribute__((vector_size(64)));
typedef double v8u __attribute__((vector_size(64), aligned(8)));

#if defined(__AVX512F__) && defined(__FMA__)
#include <immintrin.h>
static inline v8 fma8(v8 x, v8 y, v8 z) { return (v8)_mm512_fmadd_pd((__m512d)x, (__m512d)y, (__m512d)z); }
static inline v8 sqrt8(v8 x) { return (v8)_mm512_sqrt_pd((__m512d)x); }
static inline v4 fma4(v4 x, v4 y, v4 z) { return (v4)_mm256_fmadd_pd((__m256d)x, (__m256d)y, (__m256d)z); }
#elif defined(__AVX__) && defined(__FMA__)
#include <immintrin.h>
typedef union { v8 whole; __m256d half[2]; } halves;
static inline v8 fma8(v8 x, v8 y, v8 z) {
    halves a = {x}, b = {y}, c = {z};
    for (int i = 0; i < 2; i++) a.half[i] = _mm256_fmadd_pd(a.half[i], b.half[i], c.half[i]);
    return a.whole;
}
static inline v8 sqrt8(v8 x) {
    halves a = {x};
    for (int i = 0; i < 2; i++) a.half[i] = _mm256_sqrt_pd(a.half[i]);
    return a.whole;
}
static inline v4 fma4(v4 x, v4 y, v4 z) { return (v4)_mm256_fmadd_pd((__m256d)x, (__m256d)y, (__m256d)z); }
#else
static inline v8 fma8(v8 x, v8 y, v8 z) {
    for (int i = 0; i < 8; i++) x[i] = __builtin_fma(x[i], y[i], z[i]);
    return x;
}
static inline v8 sqrt8(v8 x) {
    for (int i = 0; i < 8; i++) x[i] = __builtin_sqrt(x[i]);
    return x;
}
static inline v4 fma4(v4 x, v4 y, v4 z) {
    for (int i = 0; i < 4; i++) x[i] = __builtin_fma(x[i], y[i], z[i]);
    return x;
}
#endif

enum { ROWS = 2, MOST_ITERATIONS = 200, SIZES_LAST = 8, PATIENCE = 5 };

/* The numbers of integrators/kernel/step/rule.py and stopping.py, which the caller passes. */
typedef struct {
    double tolerance, rounding, stagnation, least, floor, first_rate, log_rest;
    double log_trusted, log_steep, log_promise, log_fall, fastest, slowest, most_extra;
} Rule;

typedef struct {
    double nodes[8], nodes_low[8], weights[8], weights_low[8], position_weights[8], position_weights_low[8];
    double matrix[64], extrapolation[64], extrapolation_two[128]; /* columns, times h^2 */
} Tables;

static inline v8 load(const double *from) { return *(const v8u *)from; }
static inline v8 spread(double x) { return (v8){x, x, x, x, x, x, x, x}; }
static inline v8 absolute(v8 x) { return (v8)((i8)x & INT64_MAX); }
static inline v8 larger(v8 x, v8 y) {
    i8 first = x > y;
    return (v8)(((i8)x & first) | ((i8)y & ~first));
}
static inline double larger_of(double x, double y) { return x > y ? x : y; }

static inline double largest(v8 x) {
    x = larger(x, __builtin_shufflevector(x, x, 4, 5, 6, 7, 0, 1, 2, 3));
    x = larger(x, __builtin_shufflevector(x, x, 2, 3, 0, 1, 6, 7, 4, 5));
    return larger_of(x[0], x[1]);
}

static inline double binary_log(double x) {
    uint64_t bits;
    memcpy(&bits, &x, 8);
    return (double)bits * 0x1p-52 - 1023.0;
}

static inline v8 two_sum8(v8 x, v8 y, v8 *lost) {
    v8 sum = x + y, part = sum - x;
    *lost = (x - (sum - part)) + (y - part);
    return sum;
}

static inline v4 two_sum4(v4 x, v4 y, v4 *lost) {
    v4 sum = x + y, part = sum - x;
    *lost = (x - (sum - part)) + (y - part);
    return sum;
}

/* A factor times x + rest, and what it lacks. */
static inline v4 multiplied(v4 factor, v4 x, v4 rest, v4 *lacks) {
    v4 product = factor * x;
    *lacks = fma4(factor, rest, fma4(factor, x, -product));
    return product;
}

/* A start plus a matrix, given by columns, times values: two sums side by side. */
static inline v8 combine(const double *matrix, v8 values, v8 start) {
    v8 one = start, other = load(matrix + 32) * spread(values[4]);
    for (int j = 0; j < 4; j++) one = fma8(load(matrix + 8 * j), spread(values[j]), one);
    for (int j = 5; j < 8; j++) other = fma8(load(matrix + 8 * j), spread(values[j]), other);
    return one + other;
}

static inline void evaluate(const v8 *q, v8 *force) {
    v8 square = q[0] * q[0] + q[1] * q[1];
    v8 pull = spread(1.0) / (square * sqrt8(square));
    force[0] = -(pull * q[0]);
    force[1] = -(pull * q[1]);
}

/* The sums of four vectors, and what they lack. */
static inline v4 sums(v8 a, v8 b, v8 c, v8 d, v4 *lacks) {
    v8 e, f, g, s, t, u;
    s = two_sum8(__builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11),
                 __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15), &e);
    t = two_sum8(__builtin_shufflevector(c, d, 0, 1, 2, 3, 8, 9, 10, 11),
                 __builtin_shufflevector(c, d, 4, 5, 6, 7, 12, 13, 14, 15), &f);
    u = two_sum8(__builtin_shufflevector(s, t, 0, 1, 4, 5, 8, 9, 12, 13),
                 __builtin_shufflevector(s, t, 2, 3, 6, 7, 10, 11, 14, 15), &g);
    g = g + (__builtin_shufflevector(e, f, 0, 1, 4, 5, 8, 9, 12, 13) +
             __builtin_shufflevector(e, f, 2, 3, 6, 7, 10, 11, 14, 15));
    v4 lost, sum = two_sum4(__builtin_shufflevector(u, u, 0, 2, 4, 6), __builtin_shufflevector(u, u, 1, 3, 5, 7), &lost);
    *lacks = lost + (__builtin_shufflevector(g, g, 0, 2, 4, 6) + __builtin_shufflevector(g, g, 1, 3, 5, 7));
    return sum;
}

static inline v8 weighted(const double *high, const double *low, v8 values) {
    return fma8(load(high), values, load(low) * values);
}

static inline void sweep(const double *matrix, v4 y, const v8 *base, v8 *stages, v8 *values) {
    evaluate(stages, values);
    for (int d = 0; d < ROWS; d++) stages[d] = spread(y[d]) + combine(matrix, values[d], base[d]);
}

/* The largest change of the stages, relative to sizes whose inverse is given. */
static inline double change_of(const v8 *stages, const v8 *old, const double *scales) {
    v8 first = absolute(stages[0] - old[0]) * spread(scales[0]);
    return largest(larger(first, absolute(stages[1] - old[1]) * spread(scales[1])));
}

/* The inverse sizes of both components: their own, and raised to what rounding of the force may be. */
static inline void take_sizes(const v8 *stages, v4 y, double floor, double *weights, double *floored) {
    double size[ROWS], most = 0.0, farthest = 0.0;
    for (int d = 0; d < ROWS; d++) {
        size[d] = largest(absolute(stages[d]));
        most = larger_of(size[d], most);
        farthest = larger_of(largest(absolute(stages[d] - spread(y[d]))), farthest);
    }
    for (int d = 0; d < ROWS; d++) {
        weights[d] = 1.0 / size[d];
        floored[d] = 1.0 / larger_of(size[d], larger_of(floor * most, farthest));
    }
}

/* Take steps of length h from state (q, p) + error, which are replaced; return the iterations, or -1. */
int64_t gauss8(const Tables *tables, const Rule *rule, double h, int64_t steps, double *state, double *error) {
    v4 y = *(v4u *)state, low = *(v4u *)error;
    v8 stages[ROWS], old[ROWS], base[ROWS], values[ROWS], older[ROWS];
    double weights[ROWS], floored[ROWS], rate = rule->first_rate;
    int64_t iterations = 0;
    int age = 0, untested = 0;
    memset(values, 0, sizeof values);
    memset(older, 0, sizeof older);
    const v4 drift = {h, h, 0.0, 0.0}, all = {h, h, h, h}, again = {h, h, 1.0, 1.0};
    const double *matrix = tables->matrix;

    for (int64_t n = 0; n < steps; n++) {
        /* What the stages have without the force, and the first stages. */
        v4 p = __builtin_shufflevector(y, y, 2, 3, 2, 3), p_low = __builtin_shufflevector(low, low, 2, 3, 2, 3);
        v4 moved_low, moved = multiplied(drift, p, p_low, &moved_low);
        for (int d = 0; d < ROWS; d++) {
            v8 c = load(tables->nodes), c_low = load(tables->nodes_low);
            v8 inner = fma8(c, spread(moved_low[d]), fma8(c_low, spread(moved[d]), spread(low[d])));
            base[d] = fma8(c, spread(moved[d]), inner);
        }
        for (int d = 0; d < ROWS; d++) {
            v8 start = base[d];
            if (n == 1) start = combine(tables->extrapolation, values[d], start);
            if (n > 1) {
                v8 before = combine(tables->extrapolation_two, older[d], spread(0.0));
                start = start + combine(tables->extrapolation_two + 64, values[d], before);
            }
            stages[d] = spread(y[d]) + start;
            older[d] = values[d];
        }

        age--;
        if (age < 0 || n == 0) {
            take_sizes(stages, y, rule->floor, weights, floored);
            age = SIZES_LAST;
        }

        int tried = 0, tests = 0, stalled = 0, before = n ? untested : 0;
        double best = INFINITY, last, change = INFINITY, left;
        for (;;) {
            for (int i = 0; i < before; i++) sweep(matrix, y, base, stages, values);
            old[0] = stages[0];
            old[1] = stages[1];
            sweep(matrix, y, base, stages, values);
            tried += before + 1;
            before = 0;
            last = change;
            change = change_of(stages, old, weights);
            tests++;
            if (age == 0) {
                take_sizes(stages, y, rule->floor, weights, floored);
                age = SIZES_LAST;
            }
            if (!(change < INFINITY) || tried >= MOST_ITERATIONS) return -1;
            double size = binary_log(change > rule->least ? change : rule->least);
            double fall = size - binary_log(last);
            int follows = last < 1.0, falling = change < best;
            if (follows && (change > rule->rounding || fall < rate)) {
                rate = fall > rule->fastest ? fall : rule->fastest;
                if (rate > rule->slowest) rate = rule->slowest;
            }
            int steep = follows && fall <= rule->log_steep && size <= rule->log_trusted;
            int known = falling && steep && tried * (size - rule->log_promise) <= rule->log_fall;
            int converged = change <= rule->tolerance || known;
            if (falling) best = change, stalled = 0;
            else stalled++;
            if (stalled && age < SIZES_LAST) {
                take_sizes(stages, y, rule->floor, weights, floored);
                age = SIZES_LAST;
            }
            left = change > rule->tolerance ? change : rule->tolerance;
            if (converged) break;
            if (stalled) {
                double bound = stalled >= PATIENCE ? rule->stagnation : rule->rounding;
                left = best <= rule->stagnation ? best : 0.0;
                if (change_of(stages, old, floored) < bound) break;
            }
        }
        int64_t more = 0;
        if (left > 0.0) {
            double wanted = (rule->log_rest - binary_log(left)) / rate;
            wanted = wanted > 0.0 ? wanted : 0.0;
            more = (int64_t)(wanted < rule->most_extra ? wanted : rule->most_extra);
            for (int64_t i = 0; i < more; i++) sweep(matrix, y, base, stages, values);
            evaluate(stages, values);
            more++;
        }
        iterations += tried + more;
        if (n) {
            int late = stalled == 0 && tests <= 2 && change <= rule->rounding;
            untested = untested + tests - stalled - (late ? 3 : 2);
            if (untested < 0) untested = 0;
        }

        /* The end of the step: positions in the lanes 0 and 1, momenta in 2 and 3. */
        const double *b = tables->weights, *b_low = tables->weights_low;
        const double *w = tables->position_weights, *w_low = tables->position_weights_low;
        v4 rest, lost, gone, mean = sums(weighted(w, w_low, values[0]), weighted(w, w_low, values[1]),
                                         weighted(b, b_low, values[0]), weighted(b, b_low, values[1]), &rest);
        v4 kept, drifted = two_sum4(y, moved, &kept);
        mean = multiplied(all, mean, rest, &rest);
        mean = multiplied(again, mean, rest, &rest);
        v4 whole = two_sum4(drifted, mean, &lost);
        y = two_sum4(whole, ((moved_low + low) + kept) + (rest + lost), &gone);
        low = gone;
    }
    *(v4u *)state = y;
    *(v4u *)error = low;
    return iterations;
}
