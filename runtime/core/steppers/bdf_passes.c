/* Passes of the BDF's step over all unknowns (see bdf.h, lanes.h); arrays of its own end on whole lanes, with zeros. */
#include "steppers/bdf.h"
#include "linear/lanes.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* a pass for each order: the differences of an order that is known stay in registers */
#define OF_ORDER(pass, bdf, order) \
    switch (order) { \
    case 1: pass(bdf, 1); break; \
    case 2: pass(bdf, 2); break; \
    case 3: pass(bdf, 3); break; \
    case 4: pass(bdf, 4); break; \
    default: pass(bdf, 5); \
    }

static inline __attribute__((always_inline)) void predict(sd_bdf *bdf, const int32_t order)
{
    const int32_t n = bdf->n;
    double *phi[SD_MAX_ORDER + 1], gamma[SD_MAX_ORDER + 1];
    double *const own = bdf->y, *const own_d = bdf->yd, *const ee = bdf->ee;
    for (int32_t k = 0; k <= order; k++) {
        phi[k] = bdf->phi[k];
        gamma[k] = bdf->gamma[k];
    }
    for (ptrdiff_t i = 0; i < n; i += SD_LANES) {
        sd_lanes y = SD_FROM(phi[0], i), yd = {0.0};
        for (int32_t k = 1; k <= order; k++) {
            sd_lanes difference = SD_FROM(phi[k], i);
            y += difference;
            yd += gamma[k] * difference;
        }
        SD_AT(own, i) = y;
        SD_AT(own_d, i) = yd;
        SD_AT(ee, i) = (sd_lanes){0.0};
    }
}

/* y, yd := the polynomial through the past, at the new t, where a correction begins; ee := 0 */
SD_WIDE void sd_bdf_predict(sd_bdf *bdf)
{
    OF_ORDER(predict, bdf, bdf->order)
}

/* y -= delta and what goes with it; root mean square of delta in Newton's weights */
SD_WIDE double sd_bdf_move(sd_bdf *bdf)
{
    const int32_t n = bdf->n;
    const double cj = bdf->cj, *const delta = bdf->delta, *const weight = bdf->newton_weight;
    double *const y = bdf->y, *const yd = bdf->yd, *const ee = bdf->ee;
    sd_lanes sum = {0.0};
    for (ptrdiff_t i = 0; i < n; i += SD_LANES) {
        sd_lanes d = SD_FROM(delta, i), v = d * SD_FROM(weight, i);
        sum += v * v;
        SD_AT(ee, i) -= d;
        SD_AT(y, i) -= d;
        SD_AT(yd, i) -= cj * d;
    }
    return n ? sqrt(SD_TOTAL(sum) / n) : 0.0;
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
    for (int32_t i = 0; !yd && i < bdf->n; i++) {
        double x = phi[0][i];
        for (int32_t k = 1; k <= order; k++)
            x += a[k] * phi[k][i];
        y[i] = x;
    }
    for (int32_t i = 0; yd && i < bdf->n; i++) {
        double x = phi[0][i], slope = 0.0;
        for (int32_t k = 1; k <= order; k++) {
            x += a[k] * phi[k][i];
            slope += b[k] * phi[k][i];
        }
        y[i] = x;
        yd[i] = slope;
    }
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

/* differences [first, last] times their beta, or over it */
SD_WIDE void sd_bdf_stretch(sd_bdf *bdf, int32_t first, int32_t last, const double *beta)
{
    const int32_t n = bdf->n;
    for (int32_t k = first; k <= last; k++) {
        double *const phi = bdf->phi[k], by = beta[k];
        for (ptrdiff_t i = 0; i < n; i += SD_LANES)
            SD_AT(phi, i) *= by;
    }
}

static inline __attribute__((always_inline)) void shift(sd_bdf *bdf, const int32_t order)
{
    const int32_t n = bdf->n;
    double *phi[SD_MAX_ORDER + 2], *const ee = bdf->ee;
    for (int32_t k = 0; k <= order + 1; k++)
        phi[k] = bdf->phi[k];
    for (ptrdiff_t i = 0; i < n; i += SD_LANES) {
        sd_lanes above = SD_FROM(ee, i);
        if (order < SD_MAX_ORDER)
            SD_AT(phi[order + 1], i) = above;
        for (int32_t k = order; k >= 0; k--)
            above = SD_AT(phi[k], i) += above;
    }
}

/* differences at the new point: up to the one above the order of the step */
SD_WIDE void sd_bdf_shift(sd_bdf *bdf)
{
    OF_ORDER(shift, bdf, bdf->order_used)
}

/* Squares, in the error weights, of x + by * other + more (or NULL) over the unknowns of groups, without what those of each
 * group have in common */
static double apart(const sd_bdf *bdf, const double *x, const double *other, double by, const double *more)
{
    double sum = 0.0;
    for (int32_t g = 0; g < bdf->commons; g++) {
        const int32_t *first = bdf->common + bdf->common_from[g], *end = bdf->common + bdf->common_from[g + 1];
        double weights = 0.0, mean = 0.0;
        for (const int32_t *i = first; i < end; i++) {
            double w = bdf->weight[*i] * bdf->weight[*i];
            weights += w;
            mean += w * (x[*i] + by * other[*i] + (more ? more[*i] : 0.0));
        }
        mean /= weights;
        for (const int32_t *i = first; i < end; i++) {
            double v = bdf->weight[*i] * (x[*i] + by * other[*i] + (more ? more[*i] : 0.0) - mean);
            sum += v * v;
        }
    }
    return sum;
}

/* root mean squares over the tested unknowns of ee, ee + phi[k] and ee + phi[k] + phi[k-1]: corrections at the orders k,
 * k - 1, k - 2 */
SD_WIDE void sd_bdf_orders(const sd_bdf *bdf, double *norm)
{
    const int32_t n = bdf->n, k = bdf->order;
    const double *const ee = bdf->ee, *const one = bdf->phi[k], *const two = bdf->phi[k - 1], *const weight = bdf->test_weight;
    sd_lanes sum[3] = {{0.0}, {0.0}, {0.0}};
    for (ptrdiff_t i = 0; i < n; i += SD_LANES) {
        sd_lanes w = SD_FROM(weight, i), a = SD_FROM(ee, i), b = a + SD_FROM(one, i), c = b + SD_FROM(two, i);
        sum[0] += a * w * (a * w);
        sum[1] += b * w * (b * w);
        sum[2] += c * w * (c * w);
    }
    double total[3] = {SD_TOTAL(sum[0]), SD_TOTAL(sum[1]), SD_TOTAL(sum[2])};
    if (bdf->commons) {
        total[0] += apart(bdf, ee, ee, 0.0, NULL);
        total[1] += apart(bdf, ee, one, 1.0, NULL);
        total[2] += apart(bdf, ee, one, 1.0, two);
    }
    for (int j = 0; j < 3; j++)
        norm[j] = bdf->tested ? sqrt(total[j] / bdf->tested) : 0.0;
}

/* root mean square of x - minus in the error weights; both end on whole lanes */
SD_WIDE double sd_bdf_norm(const sd_bdf *bdf, const double *x, const double *minus)
{
    const int32_t n = bdf->n;
    const double *const weight = bdf->test_weight;
    sd_lanes sum = {0.0};
    for (ptrdiff_t i = 0; i < n; i += SD_LANES) {
        sd_lanes v = (SD_FROM(x, i) - SD_FROM(minus, i)) * SD_FROM(weight, i);
        sum += v * v;
    }
    double total = SD_TOTAL(sum) + (bdf->commons ? apart(bdf, x, minus, -1.0, NULL) : 0.0);
    return bdf->tested ? sqrt(total / bdf->tested) : 0.0;
}

/* what a step of length h makes of the weights: powers of h in Newton's test and in that of the error */
static void set_powers(sd_bdf *bdf)
{
    const double power[3] = {1.0, bdf->h, bdf->h * bdf->h}, test[3] = {0.0, 1.0, bdf->h};
    const int32_t *const powered = bdf->powered, powers = bdf->powers;
    for (int32_t k = 0; k < powers; k++) {
        int32_t i = powered[k];
        bdf->newton_power[i] = power[bdf->power[i]];
        bdf->test_power[i] = test[bdf->test[i] + 1];
    }
    for (int32_t k = 0; bdf->commons && k < bdf->common_from[bdf->commons]; k++)
        bdf->test_power[bdf->common[k]] = 0.0; /* groups are summed apart */
    bdf->h_weighed = bdf->h;
}

/* powers at the h of the moment, and which unknowns have others at another */
void sd_bdf_begin_powers(sd_bdf *bdf)
{
    for (bdf->powers = 0; bdf->powers < bdf->n; bdf->powers++)
        bdf->powered[bdf->powers] = bdf->powers;
    set_powers(bdf);
    bdf->powers = 0;
    for (int32_t i = 0; i < bdf->n; i++)
        if (bdf->power[i] > 0 || bdf->test[i] > 0)
            bdf->powered[bdf->powers++] = i;
}

/* newton_weight, test_weight := weight times the powers of this step */
SD_WIDE void sd_bdf_step_weights(sd_bdf *bdf)
{
    if (bdf->h != bdf->h_weighed)
        set_powers(bdf);
    const int32_t n = bdf->n;
    const double *const weight = bdf->weight, *const newton_power = bdf->newton_power, *const test_power = bdf->test_power;
    double *const newton_weight = bdf->newton_weight, *const test_weight = bdf->test_weight;
    for (ptrdiff_t i = 0; i < n; i += SD_LANES) {
        sd_lanes w = SD_FROM(weight, i);
        SD_AT(newton_weight, i) = w * SD_FROM(newton_power, i);
        SD_AT(test_weight, i) = w * SD_FROM(test_power, i);
    }
}

/* weight := 1 / (atol + rtol |y|) at the last accepted point */
SD_WIDE void sd_bdf_weights(sd_bdf *bdf)
{
    const int32_t n = bdf->n;
    const double rtol = bdf->rtol, *const y = bdf->phi[0];
    double *const met = bdf->met, *const magnitude = bdf->magnitude, *const weight = bdf->weight;
#pragma GCC ivdep
    for (int32_t i = 0; i < n; i++) {
        double size = fabs(y[i]);
        met[i] = size > met[i] ? size : met[i];
        magnitude[i] = size > magnitude[i] ? size : magnitude[i];
        weight[i] = 1.0 / (rtol * magnitude[i] + rtol * size);
    }
    for (int32_t i = 0; bdf->atol && i < n; i++)
        if (bdf->test[i] >= 0)
            weight[i] = 1.0 / (bdf->atol[i] + rtol * fabs(y[i]));
}

/* g := dF/dy + cj dF/dyd */
SD_WIDE void sd_bdf_matrix(sd_bdf *bdf)
{
    const int32_t entries = bdf->system->entries;
    const double cj = bdf->cj, *const jy = bdf->jy, *const jyd = bdf->jyd;
    double *const g = bdf->g;
#pragma GCC unroll 4
    for (ptrdiff_t e = 0; e < entries; e += SD_LANES)
        SD_AT(g, e) = SD_FROM(jy, e) + cj * SD_FROM(jyd, e);
}
