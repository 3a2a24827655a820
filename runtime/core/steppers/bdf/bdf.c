/* The step of the BDF: predict, correct, test, choose order and step size (see bdf.h). */
#include "steppers/bdf/bdf.h"
#include "linear/lanes.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { VECTORS = 12 };
#define SELDOM 4 /* of these: where rows are judged or points projected */
#define ITERATIONS 4        /* of Newton a step */
#define NEWTON_TOLERANCE 0.33 /* of the error tolerance (Brenan, Campbell & Petzold) */
#define UNKNOWN 20.0        /* contraction assumed where none has been seen */
#define TRUST 0.02          /* least contraction assumed of a first correction (an exponential law may lie ahead) */
#define STEEP 0.1           /* with steep laws instead of the one, ... */
#define STEEP_TRUST 0.3     /* ... and the other: corrections left out would be errors that fall slower than the tolerance */
#define SLOW 0.9            /* contraction above which Newton gives up */
#define STAGNANT 0.1        /* of the tolerance: corrections this small that do not shrink are round-off */
#define OLD_JACOBIAN 40     /* steps; measured: older ones cost more iterations than they save */
#define GROWN 10.0          /* growth of a step beyond which slopes are taken afresh: taken where cj outweighed them they may
                             * be wrong by orders (within van der Pol's jump), and make whatever is left look small */
#define SLUGGISH 0.2        /* contraction above which the next step takes a fresh Jacobian */
#define STEEP_SLUGGISH 0.05 /* the same with steep laws, whose slopes change by themselves: 6 to 20 % fewer residuals */
#define DEAR 4.0            /* products of factors for each of a solution from which those of another cj serve, ... */
#define APART 2.0           /* ... up to this ratio of both: a third is left of a correction at most */
#define SPENT 0.5           /* of what factors cost, in solutions: what iterations more may cost before they are made anew */
#define OTHERS 0.03         /* the tolerance of their iteration: what is left is no noise, 0.1 made a fourth more steps at 1e-5 */
#define LAX 10.0            /* a steep row may be off by as many tolerances of its terms; beside 3: error over steps times tolerance
                             * at most 0.88 instead of 0.52 (an amplifier), 0.42 instead of 0.23 (a diode), in the mean the same */
#define LOOSEST_ROW 0.3     /* and be off by no more of them: of an exponential that is no law any more any value is within 1 */
#define FIXED_SLACK SD_SMALL /* of a step of fixed length: what may be left of the span */
#define FINEST_ROW SD_SAME /* part of a steep row's terms that round-off of its unknowns leaves */

static void values(const void *bdf, double t, double *y)
{
    sd_bdf_dense(bdf, t, y, NULL);
}

sd_bdf *sd_bdf_new(sd_system *system, sd_linear *linear)
{
    sd_bdf *bdf = calloc(1, sizeof *bdf);
    if (!bdf)
        return NULL;
    size_t m = (size_t)sd_whole_lanes(system->unknowns), nnz = (size_t)sd_whole_lanes(system->entries);
    size_t steep = system->scales > 0; /* whose rows are judged by the matrix as it is */
    /* neither judged nor projected: of a large one the room counts */
    size_t vectors = steep || !system->left ? VECTORS : VECTORS - SELDOM;
    bdf->memory = calloc((SD_MAX_ORDER + 2 + vectors) * m + (2 + steep) * nnz + 1, sizeof(double));
    bdf->powered = calloc(m + m / SD_LANES + 1, sizeof *bdf->powered);
    if (!bdf->memory || !bdf->powered) {
        sd_bdf_free(bdf);
        return NULL;
    }
    bdf->apart = bdf->powered + m;
    double *next = bdf->memory;
    for (int i = 0; i < SD_MAX_ORDER + 2; i++, next += m)
        bdf->phi[i] = next;
    double **vector[VECTORS] = {&bdf->y, &bdf->yd, &bdf->ivp.ee, &bdf->ivp.weight, &bdf->delta, &bdf->own,
                                &bdf->newton_power, &bdf->test_power, &bdf->moved, &bdf->moved_d, &bdf->terms, &bdf->rate};
    for (size_t i = 0; i < vectors; i++, next += m)
        *vector[i] = next;
    bdf->jy = next;
    bdf->jyd = bdf->jy + nnz;
    bdf->g = steep ? bdf->jyd + nnz : linear->scaled;
    bdf->ivp.system = system;
    bdf->linear = linear;
    sd_linear_often(linear);
    bdf->ivp.n = system->unknowns;
    bdf->max_order = SD_MAX_ORDER;
    bdf->ivp.stepper = (sd_stepper){.self = bdf, .ivp = &bdf->ivp, .n = bdf->ivp.n, .y = bdf->phi[0], .yd = bdf->yd,
                                    .step = sd_bdf_step, .dense = sd_bdf_dense, .values = values, .start = sd_bdf_start};
    return bdf;
}

void sd_bdf_free(sd_bdf *bdf)
{
    if (!bdf)
        return;
    free(bdf->memory);
    free(bdf->powered);
    free(bdf);
}

void sd_bdf_start(void *self, double t, const double *y, const double *yd, double h)
{
    sd_bdf *bdf = self;
    sd_begin(&bdf->ivp, t);
    memcpy(bdf->phi[0], y, (size_t)bdf->ivp.n * sizeof *y);
    memcpy(bdf->y, y, (size_t)bdf->ivp.n * sizeof *y);
    memcpy(bdf->yd, yd, (size_t)bdf->ivp.n * sizeof *yd);
    memset(bdf->ivp.ee, 0, (size_t)bdf->ivp.n * sizeof *yd);
    bdf->ivp.h = 1.0;
    bdf->linear->null_pivot = bdf->linear->idle ? SD_LEAST_PIVOT : 0.0;
    sd_bdf_begin_powers(bdf);
    sd_bdf_weights(bdf);
    sd_bdf_weigh(bdf, SD_LOCAL_ERROR_TEST);
    bdf->ivp.h = bdf->ivp.fixed_h > 0.0 ? bdf->ivp.fixed_h : h > 0.0 ? h : sd_bdf_first_step(bdf);
    bdf->ivp.h = fmin(bdf->ivp.h, bdf->ivp.h_max);
    for (int32_t i = 0; i < bdf->ivp.n; i++)
        bdf->phi[1][i] = bdf->ivp.h * yd[i];
    bdf->psi[0] = bdf->ivp.h;
    bdf->order = 1;
    bdf->order_used = 0;
    bdf->ns = 0;
    bdf->rising = bdf->max_order > 1;
    bdf->contraction = UNKNOWN;
    bdf->ready = 0;
}

/* G := dF/dy + cj dF/dyd and its factors; a fresh Jacobian where asked */
static int factorise(sd_bdf *bdf, double t, int fresh)
{
    if (fresh) {
        int32_t bad = sd_jacobian(bdf->ivp.system, t, bdf->y, bdf->yd, bdf->ivp.magnitude, bdf->jy, bdf->jyd);
        bdf->jacobian_age = 0;
        bdf->cj_slopes = bdf->cj;
        bdf->fresh_jacobian = 1;
        if (*bdf->ivp.system->stop)
            return SD_STOPPED;
        if (bad >= 0) {
            bdf->ready = 0;
            bdf->ivp.bad_row = bad;
            return SD_NONFINITE;
        }
    }
    sd_bdf_matrix(bdf);
    bdf->ready = 0;
    int failed = sd_linear_factor(bdf->linear, bdf->g, bdf->ivp.magnitude);
    if (failed) {
        bdf->ivp.bad_row = bdf->linear->bad_row;
        bdf->ivp.bad_column = bdf->linear->bad_column;
        return failed == 2 ? SD_MEMORY : SD_SINGULAR;
    }
    failed = sd_outgrown(&bdf->ivp, bdf->linear, bdf->jy, bdf->jyd, bdf->cj, bdf->g, bdf->ivp.magnitude);
    if (failed)
        return failed;
    bdf->cj_factored = bdf->cj;
    bdf->extra = 0;
    bdf->contraction = UNKNOWN;
    bdf->ready = 1;
    return SD_FINE;
}

/* what a row may be off, of its terms */
static double row_limit(const sd_bdf *bdf)
{
    return fmin(LOOSEST_ROW, fmax(FINEST_ROW, LAX * bdf->ivp.rtol));
}

/* The residual in delta, behind the last correction, is small in every steep row beside the row's own terms: on an
 * exponential a correction says nothing about what it leaves.  Where the factors left a column every row is judged. */
static int rows_hold(sd_bdf *bdf, double t)
{
    for (int32_t i = 0; i < bdf->ivp.n; i++)
        bdf->rate[i] = bdf->cj * (fabs(bdf->y[i]) + bdf->ivp.magnitude[i]);
    double limit = row_limit(bdf);
    int all = bdf->linear->rank < bdf->ivp.n;
    return sd_first_unmet(bdf->ivp.system, t, bdf->y, bdf->rate, bdf->delta, limit, bdf->g, bdf->ivp.magnitude, bdf->ivp.met,
                          all, bdf->terms) < 0;
}

/* Every steep row is as small as round-off of the unknowns (`moved`), by slopes at the point itself, lets it be (see
 * radau/radau_newton.c) */
static int rows_at_round_off(sd_bdf *bdf, double t)
{
    sd_jacobian(bdf->ivp.system, t, bdf->y, bdf->yd, bdf->ivp.magnitude, bdf->jy, bdf->jyd);
    return sd_first_astray(bdf->ivp.system, t, bdf->y, bdf->yd, bdf->delta, row_limit(bdf), bdf->jy, bdf->jyd,
                           1.0 / bdf->cj, bdf->moved, bdf->linear->rank < bdf->ivp.n, bdf->terms) < 0;
}

/* the residual in delta is finite; else bad_row says where not */
static int finite(sd_bdf *bdf)
{
    int32_t bad = sd_first_bad(bdf->ivp.n, bdf->delta);
    if (bad >= 0)
        bdf->ivp.bad_row = bad;
    return bad < 0;
}

/* Why a correction is not finite: the first `corrections` from the prediction on once more, each residual looked at.  What
 * is not finite in a residual is in the correction, which is looked at in any case: good ones are spared the pass. */
static int cause_of(sd_bdf *bdf, double t, int corrections)
{
    sd_bdf_predict(bdf);
    for (int m = 0; m < corrections; m++) {
        sd_residual(bdf->ivp.system, t, bdf->y, bdf->yd, bdf->delta);
        if (*bdf->ivp.system->stop)
            return SD_STOPPED;
        if (!finite(bdf))
            return SD_NONFINITE;
        sd_linear_solve(bdf->linear, bdf->delta);
        sd_bdf_move(bdf, m == 0);
    }
    return SD_NEWTON;
}

/* Whether the factors serve, of another cj where they are dear and no row is judged (Brenan, Campbell & Petzold) */
static int factors_serve(const sd_bdf *bdf)
{
    double ratio = bdf->cj / bdf->cj_factored;
    if (ratio == 1.0)
        return 1;
    double effort = bdf->ivp.system->scales ? 0.0 : sd_linear_effort(bdf->linear);
    return ratio <= APART && ratio >= 1.0 / APART && effort >= DEAR && bdf->extra < SPENT * effort;
}

/* Newton's iteration from the prediction with the present factors */
static int iterate(sd_bdf *bdf, double t)
{
    double first = 0.0, before = 0.0;
    int converged = 0, idle = 0, judged = bdf->ivp.system->scales > 0;
    int others = bdf->cj != bdf->cj_factored;
    double trust = judged ? STEEP_TRUST : TRUST, tolerance = judged ? STEEP : others ? OTHERS : NEWTON_TOLERANCE;
    for (int m = 0; m < ITERATIONS + judged; m++) {
        double *d = bdf->delta;
        sd_residual(bdf->ivp.system, t, bdf->y, bdf->yd, d);
        if (*bdf->ivp.system->stop)
            return SD_STOPPED;
        if (judged && !finite(bdf)) /* rows are judged, and columns may be left out of the correction */
            return SD_NONFINITE;
        if (converged && (rows_hold(bdf, t) || (idle && rows_at_round_off(bdf, t))))
            return SD_FINE;
        if (m == ITERATIONS)
            break;
        converged = 0;
        sd_linear_solve(bdf->linear, d);
        sd_bdf_balance(bdf, d);
        bdf->extra += others && m > 0;
        double size = sd_bdf_move(bdf, m == 0);
        if (!isfinite(size))
            return cause_of(bdf, t, m + 1);
        if (m == 0) {
            first = size;
            converged = size <= 100.0 * DBL_EPSILON;
        } else {
            double rate = m == 1 ? size / first : pow(size / first, 1.0 / m);
            if (rate > SLOW && size > STAGNANT)
                return SD_NEWTON;
            converged = rate > SLOW;
            if (!converged)
                bdf->contraction = rate / (1.0 - rate);
            if (rate > (judged ? STEEP_SLUGGISH : SLUGGISH) && !others)
                bdf->jacobian_age = OLD_JACOBIAN;
        }
        /* they do not shrink, or are round-off of the unknowns whatever they do (a law whose slope vanishes: by halves) */
        idle = m > 0 && size <= STAGNANT && (!(size < SLOW * before) || size * bdf->ivp.rtol <= SD_ROUND_OFF);
        for (int32_t i = 0; i < bdf->ivp.n && idle && judged; i++)
            bdf->moved[i] = sd_open(d[i], bdf->y[i], bdf->ivp.met[i]);
        before = size;
        /* a first correction is not believed beyond this, however fast earlier steps converged */
        double contraction = m == 0 ? fmax(bdf->contraction, trust) : bdf->contraction;
        converged = converged || contraction * size <= tolerance;
        if (converged && !judged)
            return SD_FINE;
    }
    return SD_NEWTON;
}

/* Whether slopes at hand may mislead, or there are none since the start */
static int slopes_fade(const sd_bdf *bdf)
{
    int old = bdf->jacobian_age >= OLD_JACOBIAN || bdf->cj * GROWN < bdf->cj_slopes;
    return bdf->ivp.taken == 0 || (old && !bdf->ivp.system->steady);
}

/* Corrects the prediction; factors are renewed when cj changed, the Jacobian when it is old or fails. */
static int correct(sd_bdf *bdf)
{
    double t = bdf->ivp.t + bdf->ivp.h;
    bdf->fresh_jacobian = 0;
    sd_bdf_weigh(bdf, SD_NEWTON_TEST);
    for (;;) {
        int fresh = slopes_fade(bdf) || bdf->fresh_jacobian < 0;
        if (fresh || !bdf->ready || !factors_serve(bdf)) {
            int cause = factorise(bdf, t, fresh);
            if (cause == SD_SINGULAR && bdf->fresh_jacobian == 0) {
                bdf->fresh_jacobian = -1;
                continue;
            }
            if (cause)
                return cause;
        }
        if (bdf->ivp.system->steady && bdf->cj == bdf->cj_factored)
            bdf->contraction = 0.0; /* factors of the very matrix leave nothing */
        else if (bdf->cj != bdf->cj_last)
            bdf->contraction = UNKNOWN;
        bdf->cj_last = bdf->cj;
        int cause = iterate(bdf, t);
        if (cause == SD_FINE || cause == SD_STOPPED || bdf->fresh_jacobian)
            return cause;
        bdf->fresh_jacobian = -1; /* once more with a fresh Jacobian */
        sd_bdf_predict(bdf);
    }
}

/* a smaller step after a failure; on the first step the difference phi[1] = h yd follows */
static void reduce(sd_bdf *bdf, double ratio)
{
    bdf->ivp.h *= ratio;
    if (bdf->ivp.taken == 0) {
        bdf->psi[0] = bdf->ivp.h;
        for (int32_t i = 0; i < bdf->ivp.n; i++)
            bdf->phi[1][i] *= ratio;
    }
}

/* what a sum of fixed steps leaves is round-off: a step of that length would divide multipliers by it */
static void fit_end(sd_bdf *bdf)
{
    double h = sd_fitted(&bdf->ivp, bdf->ivp.fixed_h > 0.0 ? FIXED_SLACK : SD_SLACK);
    if (h != bdf->ivp.h)
        reduce(bdf, h / bdf->ivp.h);
    bdf->ivp.h = h;
}

/* The new point moved onto every constraint; the correction moves with it, and so do the differences made of it. */
static void project(sd_bdf *bdf)
{
    size_t size = (size_t)bdf->ivp.n * sizeof(double);
    memcpy(bdf->moved, bdf->y, size);
    memcpy(bdf->moved_d, bdf->yd, size);
    if (sd_settle_point(bdf->ivp.project, bdf->ivp.t, bdf->moved, bdf->moved_d))
        return;
    for (int32_t i = 0; i < bdf->ivp.n; i++) {
        bdf->ivp.ee[i] += bdf->moved[i] - bdf->y[i];
        bdf->y[i] = bdf->moved[i];
    }
}

int sd_bdf_step(void *self)
{
    sd_bdf *bdf = self;
    int32_t error_failures = 0, order_next = 1;
    double ck, error, norm[4];
    sd_bdf_weights(bdf);
    bdf->ivp.cause = SD_FINE;
    bdf->jacobian_age++;
    for (;;) {
        fit_end(bdf);
        if (sd_too_small(&bdf->ivp))
            return bdf->ivp.cause = bdf->ivp.cause ? bdf->ivp.cause : SD_STEP;
        sd_bdf_coefficients(bdf, &ck);
        sd_bdf_predict(bdf);
        int cause = correct(bdf);
        if (cause == SD_FINE && (sd_bdf_test(bdf, ck, norm, &error, &order_next) || bdf->ivp.fixed_h > 0.0))
            break;
        sd_bdf_restore(bdf);
        bdf->ivp.cause = cause ? cause : SD_ERROR_TEST;
        if (sd_ends(&bdf->ivp, cause))
            return bdf->ivp.cause;
        if (cause) {
            /* Newton, a singular matrix, a number that is not finite: much smaller */
            bdf->ivp.newton_failures++;
            bdf->jacobian_age = OLD_JACOBIAN; /* taken at a point that proved far off: its slopes mislead */
            reduce(bdf, 0.25);
        } else {
            bdf->ivp.rejected_steps++;
            bdf->rising = 0;
            error_failures++;
            double ratio = 0.25;
            if (error_failures == 1)
                ratio = fmax(0.25, fmin(0.9, 0.9 * pow(2.0 * bdf->error_next + 1e-4, -1.0 / (order_next + 1))));
            bdf->order = error_failures > 2 ? 1 : order_next;
            reduce(bdf, ratio);
        }
    }
    bdf->ivp.cause = SD_FINE;
    sd_advance(&bdf->ivp);
    if (bdf->ivp.project) {
        project(bdf);
        sd_bdf_orders(bdf, norm);
    }
    sd_bdf_accept(bdf, norm, order_next);
    return SD_FINE;
}

/* Polynomial through the last order + 1 points, in divided differences. */
void sd_bdf_dense(const void *self, double t, double *y, double *yd)
{
    const sd_bdf *bdf = self;
    int32_t k = bdf->ivp.taken == 0 ? 0 : bdf->order_used > 0 ? bdf->order_used : 1;
    double delta = t - bdf->ivp.t, c = 1.0, d = 0.0, gamma = bdf->psi[0] != 0.0 ? delta / bdf->psi[0] : 0.0;
    double value[SD_MAX_ORDER + 2], rate[SD_MAX_ORDER + 2];
    for (int32_t j = 1; j <= k; j++) {
        rate[j] = d = d * gamma + c / bdf->psi[j - 1];
        value[j] = c *= gamma;
        gamma = (delta + bdf->psi[j - 1]) / bdf->psi[j];
    }
    sd_bdf_interpolate(bdf, k, value, rate, y, yd);
    if (bdf->ivp.taken == 0 && yd)
        memcpy(yd, bdf->yd, (size_t)bdf->ivp.n * sizeof *yd);
}
