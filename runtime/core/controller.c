/* Local error, order and step size of the BDF (Brenan, Campbell & Petzold, section 5.2.3 f.; see bdf.h). */
#include "bdf.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Root mean square over the tested unknowns, of four partial sums: one would wait for itself. */
static double root(const sd_bdf *bdf, const double *sum)
{
    return bdf->tested ? sqrt((sum[0] + sum[1] + sum[2] + sum[3]) / bdf->tested) : 0.0;
}

/* Root mean square of x - minus (NULL: x) in the error weights. */
double sd_bdf_norm(const sd_bdf *bdf, const double *x, const double *minus)
{
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    for (int32_t i = 0; i < bdf->n; i++) {
        double v = (minus ? x[i] - minus[i] : x[i]) * bdf->test_weight[i];
        sum[i % 4] += v * v;
    }
    return root(bdf, sum);
}

/* Norms of ee, ee + phi[k] and ee + phi[k] + phi[k-1]: corrections at the orders k, k - 1, k - 2. */
static void lower_orders(const sd_bdf *bdf, double *norm)
{
    int32_t k = bdf->order;
    const double *ee = bdf->ee, *one = bdf->phi[k], *two = bdf->phi[k - 1], *weight = bdf->test_weight;
    double sum[3][4] = {{0.0}};
    for (int32_t i = 0; i < bdf->n; i++) {
        double a = ee[i], b = a + one[i], c = b + two[i], w = weight[i];
        sum[0][i % 4] += a * w * (a * w);
        sum[1][i % 4] += b * w * (b * w);
        sum[2][i % 4] += c * w * (c * w);
    }
    for (int j = 0; j < 3; j++)
        norm[j] = root(bdf, sum[j]);
}

/* Error of the step and the order that promises more (never a higher one here).  1: the step passes. */
int sd_bdf_test(sd_bdf *bdf, double ck, double *error, int32_t *order_next)
{
    int32_t k = bdf->order;
    double norm[3];
    lower_orders(bdf, norm);
    double here = bdf->sigma[k] * norm[0], term = (k + 1) * here;
    *order_next = k;
    bdf->error_next = here;
    if (k > 1) {
        double below = bdf->sigma[k - 1] * norm[1], term_below = k * below;
        double term_two = k > 2 ? (k - 1) * bdf->sigma[k - 2] * norm[2] : 0.0;
        if (k > 2 ? fmax(term_below, term_two) <= term : term_below <= 0.5 * term) {
            *order_next = k - 1;
            bdf->error_next = below;
        }
    }
    *error = ck * norm[0];
    return *error <= 1.0;
}

/* Order and step size after an accepted step, then the differences of the next. */
void sd_bdf_accept(sd_bdf *bdf, int32_t order_next)
{
    int32_t k = bdf->order, order_change = k - bdf->order_used;
    double error = bdf->error_next, h = bdf->h, h_next = h;
    bdf->steps++;
    bdf->taken++;
    bdf->order_used = k;
    bdf->h_used = h;
    if (order_next == k - 1 || k == bdf->max_order)
        bdf->rising = 0;
    if (bdf->rising) {
        /* at the start: order and step rise together */
        if (bdf->taken > 1) {
            bdf->order = k + 1;
            h_next = 2.0 * h;
        }
    } else {
        int32_t order = order_next;
        if (order_next == k && k < bdf->max_order && k + 1 < bdf->ns && order_change != 1) {
            double norm[3], above = sd_bdf_norm(bdf, bdf->ee, bdf->phi[k + 1]) / (k + 2), below = 0.0;
            lower_orders(bdf, norm); /* a projection has moved them */
            double term_above = (k + 2) * above, term = (k + 1) * bdf->sigma[k] * norm[0];
            if (k == 1) {
                if (term_above < 0.5 * term)
                    order = 2;
            } else {
                below = bdf->sigma[k - 1] * norm[1];
                double term_below = k * below;
                if (term_below <= fmin(term, term_above))
                    order = k - 1;
                else if (term_above < term)
                    order = k + 1;
            }
            if (order == k + 1)
                error = above;
            else if (order == k - 1)
                error = below;
        }
        bdf->order = order;
        double ratio = pow(2.0 * error + 1e-4, -1.0 / (order + 1));
        if (ratio >= 2.0)
            h_next = 2.0 * h;
        else if (ratio <= 1.0)
            h_next = h * fmax(0.5, fmin(0.9, ratio));
    }
    bdf->h = bdf->fixed_h > 0.0 ? bdf->fixed_h : fmin(h_next, bdf->h_max);
    /* the differences at the new point */
    for (int32_t first = 0; first < bdf->n; first += SD_PIECE) {
        int32_t n = bdf->n - first < SD_PIECE ? bdf->n - first : SD_PIECE;
        const double *restrict above = bdf->ee + first;
        if (k < SD_MAX_ORDER)
            memcpy(bdf->phi[k + 1] + first, above, (size_t)n * sizeof(double));
        for (int32_t j = k; j >= 0; j--) {
            double *restrict phi = bdf->phi[j] + first;
            for (int32_t i = 0; i < n; i++)
                phi[i] += above[i];
            above = phi;
        }
    }
}

/* A first step: a thousandth of the span, or such that the local error h^2 y''/2 is within tolerance, with y'' guessed
 * as y'^2 / y: h = sqrt(rtol) y / y' (the error test cuts it where that was too bold). */
double sd_bdf_first_step(const sd_bdf *bdf, const double *yd, double span)
{
    double change = sqrt(bdf->rtol > 0.0 ? bdf->rtol : 1e-6) * sd_bdf_norm(bdf, yd, NULL);
    double h = 1e-3 * span, least = 1e3 * DBL_EPSILON * fmax(fabs(bdf->t), SD_SHORT * span);
    if (isfinite(change) && change * h > 0.5)
        h = 0.5 / change;
    return fmax(h, fmin(least, span));
}
