/* The global error of the BDF, carried along its run where slopes are constant (see bdf.h).
 *
 * With constant dF/dy, dF/dyd the values y_n satisfy the equations with the derivative D y_n of the formula, the solution with
 * D y(t_n) less what the formula is off there: (rate) ee, rate = sum over i = 0..k of 1 / psi[i] - cj.  So e = y_n - y(t_n) is
 * stepped by the formula itself, of whatever order and steps:
 *     dF/dy e + dF/dyd (D e - rate ee) = 0,   D e = (predicted rate) + cj (e - predicted e),
 * whose matrix is that of the step.  e has differences of its own, which order and steps change as they do those of y. */
#include "steppers/bdf/bdf.h"
#include "linear/lanes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define VECTORS 4
#define NEAR 1.5 /* ratio of cj to that of the factors up to which one solution does: a fifth of a change of e is left at most,
                  * which the next step finds */

void sd_bdf_transport_begin(sd_bdf *bdf)
{
    sd_bdf_carried *carried = &bdf->carried;
    const size_t m = (size_t)sd_whole_lanes(bdf->ivp.n);
    if (carried->wanted && !carried->memory)
        carried->memory = calloc((SD_MAX_ORDER + 2 + VECTORS) * m + 1, sizeof(double));
    carried->wanted = carried->wanted && carried->memory;
    if (!carried->wanted)
        return;
    double *next = carried->memory;
    for (int i = 0; i < SD_MAX_ORDER + 2; i++, next += m)
        carried->phi[i] = next;
    double **vector[VECTORS] = {&carried->e, &carried->ed, &carried->ee, &carried->source};
    for (int i = 0; i < VECTORS; i++, next += m)
        *vector[i] = next;
    memset(carried->phi[1], 0, (SD_MAX_ORDER + 1) * m * sizeof(double));
}

/* passes over differences take those of e for those of y, and once more the other way round */
static void exchange(sd_bdf *bdf)
{
    sd_bdf_carried *carried = &bdf->carried;
    double *held;
    for (int i = 0; i < SD_MAX_ORDER + 2; i++) {
        held = bdf->phi[i];
        bdf->phi[i] = carried->phi[i];
        carried->phi[i] = held;
    }
    held = bdf->y, bdf->y = carried->e, carried->e = held;
    held = bdf->yd, bdf->yd = carried->ed, carried->ed = held;
    held = bdf->ivp.ee, bdf->ivp.ee = carried->ee, carried->ee = held;
}

/* delta := dF/dyd source - dF/dy e */
static void right_side(sd_bdf *bdf)
{
    const int32_t n = bdf->ivp.n, *const restrict column = bdf->ivp.system->column, *const restrict row = bdf->ivp.system->row;
    const double *const restrict jy = bdf->jy, *const restrict jyd = bdf->jyd;
    double *const restrict delta = bdf->delta;
    memset(delta, 0, (size_t)n * sizeof *delta);
    for (int32_t j = 0; j < n; j++) {
        const double source = bdf->carried.source[j], e = bdf->carried.e[j];
        for (int32_t k = column[j]; k < column[j + 1]; k++)
            delta[row[k]] += jyd[k] * source - jy[k] * e;
    }
}

/* source := (rate) ee less the predicted rate of e; the correction of e begins with nothing */
static SD_WIDE void begin(sd_bdf *bdf, double rate)
{
    const double *const ee = bdf->ivp.ee, *const ed = bdf->carried.ed;
    double *const source = bdf->carried.source, *const correction = bdf->carried.ee;
    for (ptrdiff_t i = 0; i < bdf->ivp.n; i += SD_LANES) {
        SD_AT(source, i) = rate * SD_FROM(ee, i) - SD_FROM(ed, i);
        SD_AT(correction, i) = (sd_lanes){0.0};
    }
}

/* e moved by delta, with all that goes with it */
static SD_WIDE void move(sd_bdf *bdf)
{
    const double cj = bdf->cj, *const delta = bdf->delta;
    sd_bdf_carried *carried = &bdf->carried;
    double *const e = carried->e, *const ed = carried->ed, *const ee = carried->ee, *const source = carried->source;
    for (ptrdiff_t i = 0; i < bdf->ivp.n; i += SD_LANES) {
        sd_lanes d = SD_FROM(delta, i);
        SD_AT(ee, i) += d;
        SD_AT(e, i) += d;
        SD_AT(ed, i) += cj * d;
        SD_AT(source, i) -= cj * d;
    }
}

void sd_bdf_transport(sd_bdf *bdf)
{
    const double cj = bdf->cj, ratio = cj / bdf->cj_factored;
    double rate = -cj;
    if (!bdf->carried.wanted)
        return;
    for (int32_t i = 0; i <= bdf->order; i++)
        rate += 1.0 / bdf->psi[i];
    if (bdf->ivp.taken == 1) /* the difference with which it began stands for a point twice */
        rate = 2.0 / bdf->ivp.h_used - cj;
    exchange(bdf);
    sd_bdf_predict(bdf);
    exchange(bdf);
    begin(bdf, rate);
    const int solutions = fmax(ratio, 1.0 / ratio) <= NEAR ? 1 : 2;
    for (int m = 0; m < solutions; m++) {
        right_side(bdf);
        sd_linear_solve(bdf->linear, bdf->delta);
        sd_bdf_balance(bdf, bdf->delta);
        move(bdf);
    }
}

void sd_bdf_without(const sd_bdf *bdf, double *y, double *yd)
{
    for (int32_t i = 0; bdf->carried.shown && i < bdf->ivp.n; i++) {
        y[i] -= bdf->carried.e[i];
        yd[i] -= bdf->carried.ed[i];
    }
}

void sd_bdf_transport_shift(sd_bdf *bdf)
{
    if (!bdf->carried.wanted)
        return;
    exchange(bdf);
    sd_bdf_shift(bdf);
    exchange(bdf);
}
