/* The step of DOP853: stages, error, projection, step size, stiffness (see dopri.h). */
#include "steppers/explicit/dopri.h"

#include "linear/lanes.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BOLD 2.0         /* of the first step: what it may be longer than for a coefficient of 1 */
#define EXACT SD_CANCELS /* error of one of them at least */
#define GROWTH 6.0       /* of the step at most; it shrinks to 1/3 at most */
#define SHRINK 0.333
#define MEMORY 0.03      /* exponent of the last step's error (PI control) */
#define BOUNDARY 6.1     /* of h |lambda|: where the region of stability ends */
#define STIFF 15         /* steps at the boundary that show stiffness */
#define SOON 8           /* the same where the end is FAR times further than patience lasts */
#define FAR 10.0
#define SMOOTH 6         /* steps inside it that show the contrary */
#define QUICKER 4.0      /* times the rate at which the motion bends: what holds the step is a system that is that much faster,
                            for no stage of an explicit method knows the slope that the others come to */
#define SEEN 3           /* steps that show it at least: the first ones are short */
#define OUTRUN 45.0      /* the same times how often what is spared fits into what is left */
#define PROJECTED 3.0    /* times what the error test bears: of 48 models constraints ask for 1.3 at most (a singular one 23) */
#define REFUSED 50       /* steps refused beyond those taken: kinks that the method cannot cross with its order */

sd_dopri *sd_dopri_new(sd_system *system, sd_underlying *underlying)
{
    sd_dopri *dopri = calloc(1, sizeof *dopri);
    if (!dopri)
        return NULL;
    size_t m = (size_t)sd_whole_lanes(system->unknowns);
    dopri->memory = calloc((6 + 2 * SD_DOPRI_ALL + SD_DOPRI_DENSE) * m, sizeof(double));
    if (!dopri->memory) {
        free(dopri);
        return NULL;
    }
    double *next = dopri->memory;
    double **vectors[] = {&dopri->phi, &dopri->yd, &dopri->ivp.ee, &dopri->ivp.weight, &dopri->moved, &dopri->moved_d};
    for (int i = 0; i < 6; i++, next += m)
        *vectors[i] = next;
    for (int i = 0; i < SD_DOPRI_ALL; i++, next += 2 * m) {
        dopri->y[i] = next;
        dopri->rate[i] = next + m;
    }
    for (int i = 0; i < SD_DOPRI_DENSE; i++, next += m)
        dopri->f[i] = next;
    dopri->ivp.system = system;
    dopri->ivp.n = system->unknowns;
    dopri->underlying = underlying;
    dopri->ivp.stepper = (sd_stepper){
        .self = dopri, .ivp = &dopri->ivp, .n = dopri->ivp.n, .y = dopri->phi, .yd = dopri->yd, .step = sd_dopri_step,
        .dense = sd_dopri_dense, .start = sd_dopri_start, .onto = sd_dopri_onto,
        .nodes = SD_DOPRI_STAGES, .node = sd_dopri_c, .node_weight = sd_dopri_a[SD_DOPRI_STAGES], .node_y = dopri->y,
        .node_yd = dopri->rate};
    return dopri;
}

void sd_dopri_free(sd_dopri *dopri)
{
    if (!dopri)
        return;
    free(dopri->memory);
    free(dopri);
}

/* As an earlier run found it fit; else (h y'/y)^8 is within tolerance, but for a coefficient that is small. */
static double first_step(const sd_dopri *dopri)
{
    const sd_ivp *ivp = &dopri->ivp;
    double part = pow(ivp->rtol, 0.125), known = ivp->steps == 0 ? dopri->opening * part : 0.0;
    double change = ivp->tested ? ivp->rtol * sqrt(sd_squares(ivp, dopri->yd, NULL) / ivp->tested) : 0.0;
    if (known > 0.0 && isfinite(known))
        return known;
    return sd_first_step(ivp, 0.1 * (ivp->t_end - ivp->t), BOLD * part, change);
}

void sd_dopri_start(void *self, double t, const double *y, const double *yd, double h)
{
    sd_dopri *dopri = self;
    size_t size = (size_t)dopri->ivp.n * sizeof *y;
    sd_begin(&dopri->ivp, t);
    memmove(dopri->phi, y, size);
    memmove(dopri->yd, yd, size);
    sd_underlying_begin(dopri->underlying, fmax(1e-3 * dopri->ivp.rtol, 1e-14), dopri->yd);
    sd_weigh(&dopri->ivp, dopri->ivp.rtol, dopri->phi);
    if (!(h > 0.0))
        h = first_step(dopri);
    if (dopri->ivp.steps == 0)
        dopri->opening = INFINITY;
    dopri->ivp.h = fmin(dopri->ivp.fixed_h > 0.0 ? dopri->ivp.fixed_h : h, dopri->ivp.h_max);
    dopri->error_accepted = 1e-4;
    dopri->speed = 0.0;
    dopri->rejected = dopri->stiff = dopri->smooth = dopri->outrun = dopri->even = dopri->dense = 0;
}

/* slopes of stage s at its point, from those of the stage before as a guess */
static int slopes(sd_dopri *dopri, int s, int before, double t)
{
    const sd_underlying *u = dopri->underlying;
    for (int32_t j = 0; j < u->solved && !u->direct; j++) { /* what is solved at once begins at zero */
        int32_t k = u->unknown[j];
        dopri->rate[s][k] = dopri->rate[before][k];
        if (!u->rate[j])
            dopri->y[s][k] = dopri->y[before][k];
    }
    int cause = sd_underlying_slopes(dopri->underlying, t, dopri->y[s], dopri->rate[s]);
    if (cause) {
        dopri->ivp.bad_row = u->bad_row;
        dopri->ivp.bad_column = u->bad_column;
    }
    return cause;
}

/* in whole lanes: behind its unknowns every array has room for them, where nothing but zeros comes to stand */
SD_WIDE void sd_dopri_add_up(int32_t n, int terms, const double *a, double *const *k, double *sum)
{
    for (int32_t i = 0; i < n; i += SD_LANES) {
        sd_lanes total = {0.0};
        if (terms)
            total = a[0] * SD_FROM(k[0], i);
        for (int j = SD_DOPRI_NEXT; j < terms; j++)
            total += a[j] * SD_FROM(k[j], i);
        SD_AT(sum, i) = total;
    }
}

/* y [n] := y0 + h times the sum of a_sj k_j: two lanes at a time read the coefficients once */
static SD_WIDE void lead(int32_t n, int s, double *const *k, double h, const double *y0, double *y)
{
    const double *a = sd_dopri_a[s];
    const int from = sd_dopri_next[s];
    for (int32_t i = 0; i < n; i += 2 * SD_LANES) {
        const int32_t i2 = i + SD_LANES < n ? i + SD_LANES : i;
        sd_lanes one = a[0] * SD_FROM(k[0], i), two = a[0] * SD_FROM(k[0], i2);
        for (int j = from; j < s; j++) {
            one += a[j] * SD_FROM(k[j], i);
            two += a[j] * SD_FROM(k[j], i2);
        }
        SD_AT(y, i) = SD_FROM(y0, i) + h * one;
        SD_AT(y, i2) = SD_FROM(y0, i2) + h * two;
    }
}

void sd_dopri_combine(sd_dopri *dopri, int s, double h)
{
    lead(dopri->ivp.n, s, dopri->rate, h, dopri->y[0], dopri->y[s]);
}

/* local error in the weights, from the embedded formulas of orders 5 and 3 */
static double estimate(sd_dopri *dopri)
{
    double *five = dopri->ivp.ee, *three = dopri->f[0];
    sd_dopri_add_up(dopri->ivp.n, SD_DOPRI_STAGES, sd_dopri_e5, dopri->rate, five);
    sd_dopri_add_up(dopri->ivp.n, SD_DOPRI_STAGES, sd_dopri_e3, dopri->rate, three);
    double s5 = sd_squares(&dopri->ivp, five, NULL), s3 = sd_squares(&dopri->ivp, three, NULL), both = s5 + 0.01 * s3;
    for (int32_t i = 0; i < dopri->ivp.n; i++)
        five[i] *= dopri->ivp.h;
    if (!(both > 0.0) || !dopri->ivp.tested)
        return isfinite(both) ? 0.0 : INFINITY;
    double error = dopri->ivp.h * s5 / sqrt(both * dopri->ivp.tested);
    return isfinite(error) ? error : INFINITY;
}

/* The new point onto the constraints.  What that moves is error too: more than the test bears is a corner that no stage saw. */
static int project(sd_dopri *dopri, double *error)
{
    sd_ivp *ivp = &dopri->ivp;
    double *new = dopri->y[SD_DOPRI_STAGES], *moved = dopri->f[0];
    memcpy(moved, new, (size_t)ivp->n * sizeof *moved);
    /* the factors are those of the last stage, at the same t */
    int cause = sd_underlying_project(dopri->underlying, ivp->t + ivp->h, new, dopri->rate[SD_DOPRI_STAGES - 1]);
    if (cause || ivp->fixed_h > 0.0 || !ivp->tested)
        return cause;
    const double apart = sqrt(sd_squares(ivp, moved, new) / ivp->tested);
    if (apart < PROJECTED)
        return SD_FINE;
    *error = apart;
    return SD_ERROR_TEST;
}

/* stages, error, projection and slopes at the new point (stage 12); the error test may refuse */
static int attempt(sd_dopri *dopri, double *error)
{
    double h = dopri->ivp.h;
    int cause;
    for (int s = 1; s < SD_DOPRI_STAGES; s++) {
        sd_dopri_combine(dopri, s, h);
        if ((cause = slopes(dopri, s, s - 1, dopri->ivp.t + sd_dopri_c[s] * h)))
            return cause;
    }
    *error = dopri->ivp.fixed_h > 0.0 ? 0.0 : estimate(dopri);
    if (!(*error < 1.0))
        return SD_ERROR_TEST;
    sd_dopri_combine(dopri, SD_DOPRI_STAGES, h);
    if ((cause = project(dopri, error)))
        return cause;
    return slopes(dopri, SD_DOPRI_STAGES, SD_DOPRI_STAGES - 1, dopri->ivp.t + h);
}

/* Counts steps with `sign`, which SMOOTH steps in a row without it clear. */
static void count(int32_t *with, int32_t *without, int sign)
{
    *with += sign;
    *without = sign ? 0 : *without + 1;
    if (*without == SMOOTH)
        *with = 0;
}

/* 1: the error test holds the step far below what the motion asks for (ratio: (h |lambda|)^2), and the end is further
 * than what another method would take anew: the further it is the fewer steps are waited for (tried with 15: two
 * of 430 runs then left for radau what took the explicit method two thirds of the time) */
static int is_outrun(sd_dopri *dopri, double ratio)
{
    double bend = sd_squares(&dopri->ivp, dopri->rate[SD_DOPRI_STAGES], dopri->rate[0]);
    double size = sd_squares(&dopri->ivp, dopri->rate[SD_DOPRI_STAGES], NULL);
    count(&dopri->outrun, &dopri->even, dopri->ivp.h < dopri->ivp.h_max && ratio * size > QUICKER * QUICKER * bend);
    double times = (dopri->ivp.t_end - dopri->ivp.t) / (fmax(dopri->spare, (double)dopri->ivp.steps) * dopri->ivp.h);
    int far = dopri->outrun >= SEEN && dopri->outrun * times >= OUTRUN;
    return times > 1.0 && (far || dopri->outrun >= STIFF);
}

/* 1: the step is held to the region of stability, and the end is far */
static int is_stiff(sd_dopri *dopri)
{
    double far = sd_squares(&dopri->ivp, dopri->y[SD_DOPRI_STAGES], dopri->y[SD_DOPRI_STAGES - 1]);
    double turn = sd_squares(&dopri->ivp, dopri->rate[SD_DOPRI_STAGES], dopri->rate[SD_DOPRI_STAGES - 1]);
    if (dopri->spare > 0.0 && far > 0.0 && is_outrun(dopri, dopri->ivp.h * dopri->ivp.h * turn / far))
        return 1;
    dopri->speed = far > 0.0 ? dopri->ivp.h * sqrt(turn / far) : 0.0;
    count(&dopri->stiff, &dopri->smooth, dopri->speed > BOUNDARY);
    double steps = (dopri->ivp.t_end - dopri->ivp.t) / dopri->ivp.h;
    return dopri->stiff >= (steps > FAR * dopri->patience ? SOON : STIFF) && steps > dopri->patience;
}

/* the new point, and the next step's size */
static void accept(sd_dopri *dopri, double error)
{
    double h = dopri->ivp.h;
    double ratio = pow(error, 0.125 - 0.2 * MEMORY) / pow(dopri->error_accepted, MEMORY) / SD_SAFETY;
    double next = h / fmax(1.0 / GROWTH, fmin(1.0 / SHRINK, ratio));
    if (dopri->ivp.steps < SD_OPENING)
        dopri->opening = fmin(dopri->opening, SD_SAFETY * h * pow(fmax(error, EXACT) * dopri->ivp.rtol, -0.125));
    if (dopri->rejected)
        next = fmin(next, h);
    dopri->error_accepted = fmax(error, 1e-4);
    memcpy(dopri->phi, dopri->y[SD_DOPRI_STAGES], (size_t)dopri->ivp.n * sizeof(double));
    memcpy(dopri->yd, dopri->rate[SD_DOPRI_STAGES], (size_t)dopri->ivp.n * sizeof(double));
    sd_advance(&dopri->ivp);
    dopri->rejected = 0;
    dopri->ivp.h = dopri->ivp.fixed_h > 0.0 ? dopri->ivp.fixed_h : fmin(next, dopri->ivp.h_max);
}

int sd_dopri_step(void *self)
{
    sd_dopri *dopri = self;
    int failures = 0, cause = SD_FINE;
    double error = 0.0;
    size_t size = (size_t)dopri->ivp.n * sizeof(double);
    sd_weigh(&dopri->ivp, dopri->ivp.rtol, dopri->phi);
    dopri->ivp.cause = SD_FINE;
    dopri->dense = 0;
    memcpy(dopri->y[0], dopri->phi, size);
    memcpy(dopri->rate[0], dopri->yd, size);
    if (dopri->ivp.taken == 0 && (dopri->ivp.cause = slopes(dopri, 0, 0, dopri->ivp.t)))
        return dopri->ivp.cause;
    for (;;) {
        dopri->ivp.h = sd_fitted(&dopri->ivp, SD_SLACK);
        if (sd_too_small(&dopri->ivp))
            return dopri->ivp.cause = cause ? cause : SD_STEP;
        cause = attempt(dopri, &error);
        if (cause == SD_FINE)
            break;
        dopri->rejected = 1;
        if (sd_ends(&dopri->ivp, cause))
            return dopri->ivp.cause = cause;
        if (cause == SD_ERROR_TEST) {
            double ratio = pow(error, 0.125 - 0.2 * MEMORY) / SD_SAFETY;
            dopri->ivp.rejected_steps++;
            double steps = (dopri->ivp.t_end - dopri->ivp.t) / dopri->ivp.h;
            if (dopri->ivp.rejected_steps > dopri->ivp.steps + REFUSED && steps > dopri->patience)
                return dopri->ivp.cause = cause;
            dopri->ivp.h *= isfinite(ratio) ? 1.0 / fmax(1.0, fmin(1.0 / SHRINK, ratio)) : 0.1;
        } else {
            dopri->ivp.newton_failures++;
            if (++failures > SD_FAILURES)
                return dopri->ivp.cause = cause;
            dopri->ivp.h *= 0.25;
        }
    }
    if (!(dopri->ivp.fixed_h > 0.0) && is_stiff(dopri))
        return dopri->ivp.cause = SD_STIFF;
    accept(dopri, error);
    return SD_FINE;
}
