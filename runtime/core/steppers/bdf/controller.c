/* Local error, order and step size of the BDF (Brenan, Campbell & Petzold, section 5.2.3 f.; see bdf.h). */
#include "steppers/bdf/bdf.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Error of the step and the order that promises more (never a higher one here); norm [4]: as sd_bdf_orders has
 * them.  1: the step passes. */
int sd_bdf_test(sd_bdf *bdf, double ck, double *norm, double *error, int32_t *order_next)
{
    int32_t k = bdf->order;
    sd_bdf_weigh(bdf, SD_LOCAL_ERROR_TEST);
    sd_bdf_orders(bdf, norm);
    double here = bdf->sigma[k] * norm[0], term = (k + 1) * here;
    *order_next = k;
    bdf->error_next = here;
    if (k > 1) {
        double below = bdf->sigma[k - 1] * norm[1], term_below = k * below;
        double term_two = k > 2 ? (k - 1) * bdf->sigma[k - 2] * norm[2] : 0.0;
        if (k > 2 ? term_below <= term && term_two <= term : term_below <= 0.5 * term) {
            *order_next = k - 1;
            bdf->error_next = below;
        }
    }
    *error = ck * norm[0];
    return *error <= 1.0;
}

/* Order and step size after a step that is accepted, whose corrections were `norm`, then the differences of the next. */
void sd_bdf_accept(sd_bdf *bdf, const double *norm, int32_t order_next)
{
    int32_t k = bdf->order, order_change = k - bdf->order_used;
    double error = bdf->error_next, h = bdf->ivp.h, h_next = h;
    bdf->orders += k;
    bdf->order_used = k;
    if (order_next == k - 1 || k == bdf->max_order)
        bdf->rising = 0;
    if (bdf->rising) {
        /* at the start: order and step rise together */
        if (bdf->ivp.taken > 1) {
            bdf->order = k + 1;
            h_next = 2.0 * h;
        }
    } else {
        int32_t order = order_next;
        if (order_next == k && k < bdf->max_order && k + 1 < bdf->ns && order_change != 1) {
            double above = norm[3] / (k + 2), below = 0.0;
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
        double size = 2.0 * error + 1e-4; /* h times its -1/(order + 1)-th power would be right */
        if (size * (double)(2 << order) <= 1.0)
            h_next = 2.0 * h;
        else if (size >= 1.0)
            h_next = h * fmax(0.5, fmin(0.9, pow(size, -1.0 / (order + 1))));
    }
    bdf->ivp.h = bdf->ivp.fixed_h > 0.0 ? bdf->ivp.fixed_h : fmin(h_next, bdf->ivp.h_max);
    sd_bdf_shift(bdf);
}

/* A first step: a thousandth of the span, or such that the local error h^2 y''/2 is within tolerance, with y'' guessed
 * as y'^2 / y (yd is there, and ee is zero): h = sqrt(rtol) y / y' (the error test cuts it where that was too bold). */
double sd_bdf_first_step(const sd_bdf *bdf)
{
    double change = sqrt(bdf->ivp.rtol > 0.0 ? bdf->ivp.rtol : 1e-6) * sd_bdf_norm(bdf, bdf->yd, bdf->ivp.ee);
    return sd_first_step(&bdf->ivp, 1e-3 * (bdf->ivp.t_end - bdf->ivp.t), 0.5, change);
}
