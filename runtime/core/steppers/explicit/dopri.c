/* The step of DOP853: stages, error, projection, step size, stiffness (see dopri.h). */
#include "steppers/explicit/dopri.h"

#include "linear/lanes.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SAFETY 0.9
#define BOLD 2.0         /* of the first step: what it may be longer than for a coefficient of 1 */
#define OPENING 3        /* steps that tell how long the first might have been */
#define EXACT 1e-12      /* error of one of them at least */
#define GROWTH 6.0       /* of the step at most; it shrinks to 1/3 at most */
#define SHRINK 0.333
#define MEMORY 0.03      /* exponent of the last step's error (PI control) */
#define FAILURES 12      /* of slopes in one step */
#define BOUNDARY 6.1     /* of h |lambda|: where the region of stability ends */
#define STIFF 15         /* steps at the boundary that show stiffness */
#define SOON 8           /* the same where the end is FAR times further than patience lasts */
#define FAR 10.0
#define SMOOTH 6         /* steps inside it that show the contrary */
#define QUICKER 4.0      /* times the rate at which the motion bends: what holds the step is a system that is that much faster,
                            for no stage of an explicit method knows the slope that the others come to */
#define SEEN 3           /* steps that show it at least: the first ones are short */
#define OUTRUN 45.0      /* the same times how often what is spared fits into what is left */
#define REFUSED 50       /* steps refused beyond those taken: kinks that the method cannot cross with its order */

static int step(void *dopri)
{
    return sd_dopri_step(dopri);
}

static void dense(const void *dopri, double t, double *y, double *yd)
{
    sd_dopri_dense((sd_dopri *)dopri, t, y, yd); /* the interpolant is made when it is first asked for */
}

static int onto(void *dopri, double t, double *y, double *yd, double *moved)
{
    return sd_dopri_onto(dopri, t, y, yd, moved);
}

static void start(void *dopri, double t, const double *y, const double *yd, double h)
{
    sd_dopri_start(dopri, t, y, yd, h);
}

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
    double **vectors[] = {&dopri->phi, &dopri->yd, &dopri->ee, &dopri->weight, &dopri->moved, &dopri->moved_d};
    for (int i = 0; i < 6; i++, next += m)
        *vectors[i] = next;
    for (int i = 0; i < SD_DOPRI_ALL; i++, next += 2 * m) {
        dopri->y[i] = next;
        dopri->rate[i] = next + m;
    }
    for (int i = 0; i < SD_DOPRI_DENSE; i++, next += m)
        dopri->f[i] = next;
    dopri->system = system;
    dopri->underlying = underlying;
    dopri->n = system->unknowns;
    dopri->stepper = (sd_stepper){
        .self = dopri, .system = system, .n = dopri->n, .t = &dopri->t, .t_end = &dopri->t_end, .y = dopri->phi,
        .yd = dopri->yd, .taken = &dopri->taken, .step = step, .dense = dense, .start = start, .onto = onto,
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

sd_stepper *sd_dopri_stepper(sd_dopri *dopri)
{
    return &dopri->stepper;
}

/* weights of the error test at the last accepted point */
static void set_weights(sd_dopri *dopri)
{
    for (int32_t i = 0; i < dopri->n; i++) {
        double size = fabs(dopri->phi[i]);
        sd_met(size, &dopri->met[i], &dopri->magnitude[i]);
        double atol = dopri->atol && dopri->test[i] >= 0 ? dopri->atol[i] : dopri->rtol * dopri->magnitude[i];
        dopri->weight[i] = 1.0 / (atol + dopri->rtol * size);
    }
}

/* sum of squares of (a - b) over the tested unknowns in the error weights; b may be NULL */
static double squares(const sd_dopri *dopri, const double *a, const double *b)
{
    double sum = 0.0;
    for (int32_t i = 0; i < dopri->n; i++)
        if (dopri->test[i] >= 0) {
            double v = (a[i] - (b ? b[i] : 0.0)) * dopri->weight[i];
            sum += v * v;
        }
    return sum;
}

/* As an earlier run found it fit; else (h y'/y)^8 is within tolerance, but for a coefficient that is small. */
static double first_step(const sd_dopri *dopri, double span)
{
    double part = pow(dopri->rtol, 0.125), known = dopri->steps == 0 ? dopri->opening * part : 0.0, h = 0.1 * span;
    double change = dopri->tested ? dopri->rtol * sqrt(squares(dopri, dopri->yd, NULL) / dopri->tested) : 0.0;
    if (known > 0.0 && isfinite(known))
        return known;
    if (isfinite(change) && change > 0.0)
        h = fmin(h, BOLD * part / change);
    return fmax(h, fmin(1e3 * DBL_EPSILON * fmax(fabs(dopri->t), SD_SHORT * span), span));
}

void sd_dopri_start(sd_dopri *dopri, double t, const double *y, const double *yd, double h)
{
    size_t size = (size_t)dopri->n * sizeof *y;
    dopri->t = t;
    dopri->taken = 0;
    dopri->tested = 0;
    for (int32_t i = 0; i < dopri->n; i++)
        dopri->tested += dopri->test[i] >= 0;
    memmove(dopri->phi, y, size);
    memmove(dopri->yd, yd, size);
    for (int32_t j = 0; j < dopri->underlying->solved; j++)
        if (!dopri->underlying->rate[j])
            dopri->yd[dopri->underlying->unknown[j]] = 0.0;
    dopri->underlying->tolerance = fmax(1e-3 * dopri->rtol, 1e-14);
    set_weights(dopri);
    if (!(h > 0.0))
        h = first_step(dopri, dopri->t_end - t);
    if (dopri->steps == 0)
        dopri->opening = INFINITY;
    dopri->h = fmin(dopri->fixed_h > 0.0 ? dopri->fixed_h : h, dopri->h_max);
    dopri->h_used = 0.0;
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
        dopri->bad_row = u->bad_row;
        dopri->bad_column = u->bad_column;
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
    lead(dopri->n, s, dopri->rate, h, dopri->y[0], dopri->y[s]);
}

/* local error in the weights, from the embedded formulas of orders 5 and 3 */
static double estimate(sd_dopri *dopri)
{
    double *five = dopri->ee, *three = dopri->f[0];
    sd_dopri_add_up(dopri->n, SD_DOPRI_STAGES, sd_dopri_e5, dopri->rate, five);
    sd_dopri_add_up(dopri->n, SD_DOPRI_STAGES, sd_dopri_e3, dopri->rate, three);
    double s5 = squares(dopri, five, NULL), s3 = squares(dopri, three, NULL), both = s5 + 0.01 * s3;
    for (int32_t i = 0; i < dopri->n; i++)
        five[i] *= dopri->h;
    if (!(both > 0.0) || !dopri->tested)
        return isfinite(both) ? 0.0 : INFINITY;
    double error = dopri->h * s5 / sqrt(both * dopri->tested);
    return isfinite(error) ? error : INFINITY;
}

/* the step ends at t_end exactly, and never leaves less than its half for the last one */
static void fit_end(sd_dopri *dopri)
{
    double left = dopri->t_end - dopri->t;
    if (dopri->h >= left * (1.0 - 1e-12))
        dopri->h = left;
    else if (2.0 * dopri->h > left && dopri->taken > 0 && !(dopri->fixed_h > 0.0))
        dopri->h = 0.5 * left;
}

/* stages, error, projection and slopes at the new point (stage 12); the error test may refuse */
static int attempt(sd_dopri *dopri, double *error)
{
    double h = dopri->h;
    int cause;
    for (int s = 1; s < SD_DOPRI_STAGES; s++) {
        sd_dopri_combine(dopri, s, h);
        if ((cause = slopes(dopri, s, s - 1, dopri->t + sd_dopri_c[s] * h)))
            return cause;
    }
    *error = dopri->fixed_h > 0.0 ? 0.0 : estimate(dopri);
    if (!(*error < 1.0))
        return SD_ERROR_TEST;
    sd_dopri_combine(dopri, SD_DOPRI_STAGES, h);
    /* the factors are those of the last stage, at the same t */
    double *new = dopri->y[SD_DOPRI_STAGES];
    cause = sd_underlying_project(dopri->underlying, dopri->t + h, new, dopri->rate[SD_DOPRI_STAGES - 1]);
    return cause ? cause : slopes(dopri, SD_DOPRI_STAGES, SD_DOPRI_STAGES - 1, dopri->t + h);
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
    double bend = squares(dopri, dopri->rate[SD_DOPRI_STAGES], dopri->rate[0]);
    double size = squares(dopri, dopri->rate[SD_DOPRI_STAGES], NULL);
    count(&dopri->outrun, &dopri->even, dopri->h < dopri->h_max && ratio * size > QUICKER * QUICKER * bend);
    double times = (dopri->t_end - dopri->t) / (fmax(dopri->spare, (double)dopri->steps) * dopri->h);
    int far = dopri->outrun >= SEEN && dopri->outrun * times >= OUTRUN;
    return times > 1.0 && (far || dopri->outrun >= STIFF);
}

/* 1: the step is held to the region of stability, and the end is far */
static int is_stiff(sd_dopri *dopri)
{
    double far = squares(dopri, dopri->y[SD_DOPRI_STAGES], dopri->y[SD_DOPRI_STAGES - 1]);
    double turn = squares(dopri, dopri->rate[SD_DOPRI_STAGES], dopri->rate[SD_DOPRI_STAGES - 1]);
    if (dopri->spare > 0.0 && far > 0.0 && is_outrun(dopri, dopri->h * dopri->h * turn / far))
        return 1;
    dopri->speed = far > 0.0 ? dopri->h * sqrt(turn / far) : 0.0;
    count(&dopri->stiff, &dopri->smooth, dopri->speed > BOUNDARY);
    double steps = (dopri->t_end - dopri->t) / dopri->h;
    return dopri->stiff >= (steps > FAR * dopri->patience ? SOON : STIFF) && steps > dopri->patience;
}

/* the new point, and the next step's size */
static void accept(sd_dopri *dopri, double error)
{
    double h = dopri->h, t = dopri->t + h;
    double ratio = pow(error, 0.125 - 0.2 * MEMORY) / pow(dopri->error_accepted, MEMORY) / SAFETY;
    double next = h / fmax(1.0 / GROWTH, fmin(1.0 / SHRINK, ratio));
    if (dopri->steps < OPENING)
        dopri->opening = fmin(dopri->opening, SAFETY * h * pow(fmax(error, EXACT) * dopri->rtol, -0.125));
    if (dopri->rejected)
        next = fmin(next, h);
    dopri->error_accepted = fmax(error, 1e-4);
    memcpy(dopri->phi, dopri->y[SD_DOPRI_STAGES], (size_t)dopri->n * sizeof(double));
    memcpy(dopri->yd, dopri->rate[SD_DOPRI_STAGES], (size_t)dopri->n * sizeof(double));
    dopri->t = fabs(dopri->t_end - t) <= 1e-12 * h ? dopri->t_end : t;
    dopri->h_used = h;
    dopri->steps++;
    dopri->taken++;
    dopri->rejected = 0;
    dopri->h = dopri->fixed_h > 0.0 ? dopri->fixed_h : fmin(next, dopri->h_max);
}

int sd_dopri_step(sd_dopri *dopri)
{
    int failures = 0, cause = SD_FINE;
    double error = 0.0;
    size_t size = (size_t)dopri->n * sizeof(double);
    set_weights(dopri);
    dopri->cause = SD_FINE;
    dopri->dense = 0;
    memcpy(dopri->y[0], dopri->phi, size);
    memcpy(dopri->rate[0], dopri->yd, size);
    if (dopri->taken == 0 && (dopri->cause = slopes(dopri, 0, 0, dopri->t)))
        return dopri->cause;
    for (;;) {
        fit_end(dopri);
        double left = dopri->t_end - dopri->t;
        if (dopri->h < 4.0 * DBL_EPSILON * fmax(fabs(dopri->t), SD_SHORT * left) && dopri->h < left) {
            dopri->cause = cause ? cause : SD_STEP;
            return dopri->cause;
        }
        cause = attempt(dopri, &error);
        if (cause == SD_FINE)
            break;
        dopri->rejected = 1;
        if (cause == SD_STOPPED || cause == SD_MEMORY || dopri->fixed_h > 0.0)
            return dopri->cause = cause;
        if (cause == SD_ERROR_TEST) {
            double ratio = pow(error, 0.125 - 0.2 * MEMORY) / SAFETY;
            dopri->rejected_steps++;
            if (dopri->rejected_steps > dopri->steps + REFUSED && left / dopri->h > dopri->patience)
                return dopri->cause = cause;
            dopri->h *= isfinite(ratio) ? 1.0 / fmax(1.0, fmin(1.0 / SHRINK, ratio)) : 0.1;
        } else {
            dopri->newton_failures++;
            if (++failures > FAILURES)
                return dopri->cause = cause;
            dopri->h *= 0.25;
        }
    }
    if (!(dopri->fixed_h > 0.0) && is_stiff(dopri))
        return dopri->cause = SD_STIFF;
    accept(dopri, error);
    return SD_FINE;
}
