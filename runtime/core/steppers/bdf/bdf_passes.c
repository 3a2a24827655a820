/* Passes of the BDF's step over all unknowns (see bdf.h, lanes.h); arrays of its own end on whole lanes, with zeros. */
#include "steppers/bdf/bdf.h"
#include "linear/lanes.h"
#include "steppers/groups.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* a pass for each order: the differences of an order that is known stay in registers; stretched: some are (see bdf.h) */
#define OF_ORDER(pass, bdf, order, stretched) \
    switch (order) { \
    case 1: pass(bdf, 1, stretched); break; \
    case 2: pass(bdf, 2, stretched); break; \
    case 3: pass(bdf, 3, stretched); break; \
    case 4: pass(bdf, 4, stretched); break; \
    default: pass(bdf, 5, stretched); \
    }

/* what makes phi[k] a difference of the step under way */
static inline double stretch(const sd_bdf *bdf, int32_t k)
{
    return k < bdf->ns ? 1.0 : bdf->beta[k];
}

static inline __attribute__((always_inline)) void predict(sd_bdf *bdf, const int32_t order, const int stretched)
{
    const int32_t n = bdf->ivp.n;
    double *phi[SD_MAX_ORDER + 1], gamma[SD_MAX_ORDER + 1], by[SD_MAX_ORDER + 1];
    double *const own = bdf->y, *const own_d = bdf->yd;
    for (int32_t k = 0; k <= order; k++) {
        phi[k] = bdf->phi[k];
        gamma[k] = bdf->gamma[k];
        by[k] = stretched ? stretch(bdf, k) : 1.0;
    }
    for (ptrdiff_t i = 0; i < n; i += SD_LANES) {
        sd_lanes y = SD_FROM(phi[0], i), yd = {0.0};
        for (int32_t k = 1; k <= order; k++) {
            sd_lanes difference = SD_FROM(phi[k], i);
            if (stretched)
                difference *= by[k];
            y += difference;
            yd += gamma[k] * difference;
        }
        SD_AT(own, i) = y;
        SD_AT(own_d, i) = yd;
    }
}

/* y, yd := the polynomial through the past, at the new t, where a correction begins */
SD_WIDE void sd_bdf_predict(sd_bdf *bdf)
{
    if (bdf->ns <= bdf->order)
        OF_ORDER(predict, bdf, bdf->order, 1)
    else
        OF_ORDER(predict, bdf, bdf->order, 0)
}

static inline __attribute__((always_inline)) double move(sd_bdf *bdf, const int first)
{
    const int32_t n = bdf->ivp.n;
    const double cj = bdf->cj, *const delta = bdf->delta, *const weight = bdf->ivp.weight;
    double *const y = bdf->y, *const yd = bdf->yd, *const ee = bdf->ivp.ee;
    sd_lanes sum = {0.0};
    for (ptrdiff_t i = 0; i < n; i += SD_LANES) {
        sd_lanes d = SD_FROM(delta, i), v = d * SD_FROM(weight, i);
        sum += v * v;
        SD_AT(ee, i) = (first ? (sd_lanes){0.0} : SD_FROM(ee, i)) - d;
        SD_AT(y, i) -= d;
        SD_AT(yd, i) -= cj * d;
    }
    return n ? sqrt(SD_TOTAL(sum) / n) : 0.0;
}

/* y -= delta and what goes with it; root mean square of delta in Newton's weights; first: ee begins with it */
SD_WIDE double sd_bdf_move(sd_bdf *bdf, int first)
{
    return first ? move(bdf, 1) : move(bdf, 0);
}

static inline __attribute__((always_inline)) void interpolate(const sd_bdf *bdf, const int32_t order, const double *value,
                                                              const double *rate, double *restrict y, double *restrict yd)
{
    const double *phi[SD_MAX_ORDER + 1];
    double a[SD_MAX_ORDER + 1], b[SD_MAX_ORDER + 1];
    for (int32_t k = 0; k <= order; k++) {
        phi[k] = bdf->phi[k];
        a[k] = value[k];
        b[k] = rate[k];
    }
    for (int32_t i = 0; !yd && i < bdf->ivp.n; i++) {
        double x = phi[0][i];
        for (int32_t k = 1; k <= order; k++)
            x += a[k] * phi[k][i];
        y[i] = x;
    }
    for (int32_t i = 0; yd && i < bdf->ivp.n; i++) {
        double x = phi[0][i], slope = 0.0;
        for (int32_t k = 1; k <= order; k++) {
            x += a[k] * phi[k][i];
            slope += b[k] * phi[k][i];
        }
        y[i] = x;
        yd[i] = slope;
    }
}

/* A correction by factors of another cj, between what it would be where one part of the matrix alone counted, and the other;
 * multipliers answer to powers of cj besides */
void sd_bdf_balance(const sd_bdf *bdf, double *d)
{
    double ratio = bdf->cj / bdf->cj_factored, part = 2.0 / (1.0 + ratio), power[3] = {1.0, ratio, ratio * ratio};
    if (ratio == 1.0)
        return;
    for (int32_t i = 0; i < bdf->ivp.n; i++)
        d[i] *= part;
    for (int32_t k = 0; k < bdf->powers; k++)
        d[bdf->powered[k]] *= power[bdf->ivp.power[bdf->powered[k]]];
}

/* y, yd [n] := sums of the differences up to an order, times value and times rate [order + 1]; the first one counts once;
 * yd NULL: not asked for */
SD_WIDE void sd_bdf_interpolate(const sd_bdf *bdf, int32_t order, const double *value, const double *rate, double *y,
                                double *yd)
{
    switch (order) {
    case 0: interpolate(bdf, 0, value, rate, y, yd); break;
    case 1: interpolate(bdf, 1, value, rate, y, yd); break;
    case 2: interpolate(bdf, 2, value, rate, y, yd); break;
    case 3: interpolate(bdf, 3, value, rate, y, yd); break;
    case 4: interpolate(bdf, 4, value, rate, y, yd); break;
    default: interpolate(bdf, 5, value, rate, y, yd);
    }
}

static inline __attribute__((always_inline)) void shift(sd_bdf *bdf, const int32_t order, const int stretched)
{
    const int32_t n = bdf->ivp.n;
    double *phi[SD_MAX_ORDER + 2], by[SD_MAX_ORDER + 1], *const ee = bdf->ivp.ee;
    for (int32_t k = 0; k <= order + 1; k++)
        phi[k] = bdf->phi[k];
    for (int32_t k = 0; stretched && k <= order; k++)
        by[k] = stretch(bdf, k);
    for (ptrdiff_t i = 0; i < n; i += SD_LANES) {
        sd_lanes above = SD_FROM(ee, i);
        if (order < SD_MAX_ORDER)
            SD_AT(phi[order + 1], i) = above;
        for (int32_t k = order; k >= 0; k--) {
            sd_lanes difference = SD_FROM(phi[k], i);
            if (stretched)
                difference *= by[k];
            above = SD_AT(phi[k], i) = difference + above;
        }
    }
}

/* differences at the new point: up to the one above the order of the step */
SD_WIDE void sd_bdf_shift(sd_bdf *bdf)
{
    if (bdf->ns <= bdf->order_used)
        OF_ORDER(shift, bdf, bdf->order_used, 1)
    else
        OF_ORDER(shift, bdf, bdf->order_used, 0)
}

static double own_weight(const void *bdf, int32_t i)
{
    return ((const sd_bdf *)bdf)->own[i];
}

static double apart(const sd_bdf *bdf, const double *x, const double *by, const double *one, const double *two)
{
    return sd_squares_apart(bdf->commons, bdf->common_from, bdf->common, own_weight, bdf, x, by, one, two);
}

/* whether the order above may be asked for: its difference is one of equal steps */
static int rises(const sd_bdf *bdf)
{
    int32_t k = bdf->order;
    return !bdf->rising && k < bdf->max_order && k + 1 < bdf->ns && k - bdf->order_used != 1;
}

static inline __attribute__((always_inline)) void orders(const sd_bdf *bdf, double *total, const int higher)
{
    const int32_t n = bdf->ivp.n, k = bdf->order;
    const double *const ee = bdf->ivp.ee, *const weight = bdf->ivp.weight;
    const double *const one = bdf->phi[k], *const two = bdf->phi[k - 1], *const above = bdf->phi[k + 1];
    const double by_one = stretch(bdf, k), by_two = stretch(bdf, k - 1);
    sd_lanes sum[4] = {{0.0}, {0.0}, {0.0}, {0.0}};
    for (ptrdiff_t i = 0; i < n; i += SD_LANES) {
        sd_lanes w = SD_FROM(weight, i), a = SD_FROM(ee, i), b = a + by_one * SD_FROM(one, i);
        sd_lanes c = b + by_two * SD_FROM(two, i);
        sum[0] += a * w * (a * w);
        sum[1] += b * w * (b * w);
        sum[2] += c * w * (c * w);
        if (higher) {
            sd_lanes v = (a - SD_FROM(above, i)) * w;
            sum[3] += v * v;
        }
    }
    for (int j = 0; j < 4; j++)
        total[j] = SD_TOTAL(sum[j]);
}

/* norm [4] := root mean squares over the tested unknowns of ee, ee + phi[k] and ee + phi[k] + phi[k-1], corrections at the
 * orders k, k - 1, k - 2, and of its change since the last step, where the order above is asked for */
SD_WIDE void sd_bdf_orders(const sd_bdf *bdf, double *norm)
{
    const int32_t k = bdf->order;
    const double none[2] = {0.0}, less[2] = {-1.0}, by[2] = {stretch(bdf, k), stretch(bdf, k - 1)};
    const double *ee = bdf->ivp.ee, *one = bdf->phi[k];
    double total[4];
    if (rises(bdf))
        orders(bdf, total, 1);
    else
        orders(bdf, total, 0);
    if (bdf->commons) {
        total[0] += apart(bdf, ee, none, ee, NULL);
        total[1] += apart(bdf, ee, by, one, NULL);
        total[2] += apart(bdf, ee, by, one, bdf->phi[k - 1]);
        total[3] += rises(bdf) ? apart(bdf, ee, less, bdf->phi[k + 1], NULL) : 0.0;
    }
    for (int j = 0; j < 4; j++)
        norm[j] = bdf->ivp.tested ? sqrt(total[j] / bdf->ivp.tested) : 0.0;
}

/* root mean square of x - minus in the error weights; both end on whole lanes */
SD_WIDE double sd_bdf_norm(const sd_bdf *bdf, const double *x, const double *minus)
{
    const int32_t n = bdf->ivp.n;
    const double *const weight = bdf->ivp.weight, less[2] = {-1.0};
    sd_lanes sum = {0.0};
    for (ptrdiff_t i = 0; i < n; i += SD_LANES) {
        sd_lanes v = (SD_FROM(x, i) - SD_FROM(minus, i)) * SD_FROM(weight, i);
        sum += v * v;
    }
    double total = SD_TOTAL(sum) + (bdf->commons ? apart(bdf, x, less, minus, NULL) : 0.0);
    return bdf->ivp.tested ? sqrt(total / bdf->ivp.tested) : 0.0;
}

/* what a step of length h makes of the weights: powers of h in Newton's test and in that of the error */
static void set_powers(sd_bdf *bdf)
{
    const double power[3] = {1.0, bdf->ivp.h, bdf->ivp.h * bdf->ivp.h}, test[3] = {0.0, 1.0, bdf->ivp.h};
    const int32_t *const powered = bdf->powered, powers = bdf->powers;
    for (int32_t k = 0; k < powers; k++) {
        int32_t i = powered[k];
        bdf->newton_power[i] = power[bdf->ivp.power[i]];
        bdf->test_power[i] = test[bdf->ivp.test[i] + 1];
    }
    for (int32_t k = 0; bdf->commons && k < bdf->common_from[bdf->commons]; k++)
        bdf->test_power[bdf->common[k]] = 0.0; /* groups are summed apart */
    bdf->h_weighed = bdf->ivp.h;
}

/* the lanes of an unknown are weighed apart from now on; powers of zero: they were not */
static void weigh_apart(sd_bdf *bdf, int32_t i)
{
    int32_t lanes = i - i % SD_LANES;
    if (bdf->newton_power[lanes] != 0.0)
        return;
    SD_AT(bdf->newton_power, lanes) = SD_AT(bdf->test_power, lanes) = (sd_lanes){1.0, 1.0, 1.0, 1.0};
    bdf->apart[bdf->aparts++] = lanes;
}

/* which unknowns do not count alike in both tests, and their powers at the h of the moment */
void sd_bdf_begin_powers(sd_bdf *bdf)
{
    for (int32_t k = 0; k < bdf->aparts; k++)
        SD_AT(bdf->newton_power, bdf->apart[k]) = (sd_lanes){0.0};
    bdf->powers = bdf->aparts = 0;
    for (int32_t i = 0; i < bdf->ivp.n; i++)
        if (bdf->ivp.power[i] > 0 || bdf->ivp.test[i] != 0) {
            bdf->powered[bdf->powers++] = i;
            weigh_apart(bdf, i);
        }
    for (int32_t k = 0; bdf->commons && k < bdf->common_from[bdf->commons]; k++)
        weigh_apart(bdf, bdf->common[k]);
    set_powers(bdf);
}

/* weight := weights times the powers of this step in one of the tests */
SD_WIDE void sd_bdf_weigh(sd_bdf *bdf, enum sd_test test)
{
    if (bdf->ivp.h != bdf->h_weighed)
        set_powers(bdf);
    const int32_t *const apart = bdf->apart, aparts = bdf->aparts;
    const double *const own = bdf->own, *const power = test == SD_NEWTON_TEST ? bdf->newton_power : bdf->test_power;
    double *const weight = bdf->ivp.weight;
    for (int32_t k = 0; k < aparts; k++)
        SD_AT(weight, apart[k]) = SD_FROM(own, apart[k]) * SD_FROM(power, apart[k]);
}

/* weight := 1 / (atol + rtol |y|) at the last accepted point */
SD_WIDE void sd_bdf_weights(sd_bdf *bdf)
{
    const int32_t n = bdf->ivp.n;
    const double rtol = bdf->ivp.rtol, *const y = bdf->phi[0];
    double *const met = bdf->ivp.met, *const magnitude = bdf->ivp.magnitude, *const weight = bdf->ivp.weight;
#pragma GCC ivdep
    for (int32_t i = 0; i < n; i++) {
        double size = fabs(y[i]);
        met[i] = size > met[i] ? size : met[i];
        magnitude[i] = size > magnitude[i] ? size : magnitude[i];
        weight[i] = 1.0 / (rtol * magnitude[i] + rtol * size);
    }
    for (int32_t i = 0; bdf->ivp.atol && i < n; i++)
        if (bdf->ivp.test[i] >= 0)
            weight[i] = 1.0 / (bdf->ivp.atol[i] + rtol * fabs(y[i]));
    const int32_t *const apart = bdf->apart, aparts = bdf->aparts;
    double *const own = bdf->own;
    for (int32_t k = 0; k < aparts; k++)
        SD_AT(own, apart[k]) = SD_FROM(weight, apart[k]);
}

/* g := dF/dy + cj dF/dyd */
SD_WIDE void sd_bdf_matrix(sd_bdf *bdf)
{
    const int32_t entries = bdf->ivp.system->entries;
    const double cj = bdf->cj, *const jy = bdf->jy, *const jyd = bdf->jyd;
    double *const g = bdf->g;
#pragma GCC unroll 4
    for (ptrdiff_t e = 0; e < entries; e += SD_LANES)
        SD_AT(g, e) = SD_FROM(jy, e) + cj * SD_FROM(jyd, e);
}
