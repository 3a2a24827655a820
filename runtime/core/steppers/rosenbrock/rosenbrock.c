/* The step of Rodas5P: its size, its end, values within (see rosenbrock.h). */
#include "steppers/rosenbrock/rosenbrock.h"
#include "linear/lanes.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STAGES SD_ROSENBROCK_STAGES
#define POWER 0.2          /* 1 / order of the estimate's error in the step */
#define LEAST_POWER 0.39810717055349726 /* of an error that predicts: of 1e-2 */
#define GROW 6.0           /* of the step at most */
#define SAME 0.01          /* part of an error by which that of a step half as long may differ where a law jumps */
#define FALLS 0.5          /* of an error: that of a shorter step where none does */
#define FAR_LONGER 1e3     /* a step over another whose error is to say the same of a jump */
#define SHRUNK SD_SMALL /* of the step that was tried first, below which the point that it begins at is settled */
#define AFRESH 0.1         /* of it: what is tried from there */
#define OWN_RATES 64       /* unknowns of a system whose rows are looked at for rates of their own */

/* yd [n] at the last accepted point.  Where each row has the rate of one unknown and no two the same, and what rows leave there is
 * known, they are solved for these: the last stage's are those of an embedded method, which rows of a trace would have to settle */
static void end_rates(const sd_rosenbrock *rosenbrock, double *yd)
{
    const sd_system *system = rosenbrock->ivp.system;
    const int32_t n = rosenbrock->ivp.n;
    const size_t size = (size_t)n * sizeof *yd;
    uint64_t solved = 0;
    memcpy(yd, rosenbrock->yd, size);
    for (int32_t j = 0; j < n && rosenbrock->sloped && rosenbrock->rates == n && n <= OWN_RATES; j++) {
        int32_t own = -1, others = 0;
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            if (rosenbrock->jyd[e] != 0.0) {
                others += own >= 0;
                own = e;
            }
        const uint64_t row = own >= 0 ? UINT64_C(1) << system->row[own] : solved;
        if (others || row & solved || own < 0) {
            memcpy(yd, rosenbrock->yd, size);
            return;
        }
        solved |= row;
        yd[j] -= rosenbrock->begin[system->row[own]] / rosenbrock->jyd[own];
    }
}

static void within(const void *self, double t, double *y, double *yd)
{
    const sd_rosenbrock *rosenbrock = self;
    size_t size = (size_t)rosenbrock->ivp.n * sizeof *y;
    if (rosenbrock->ivp.taken == 0 || t >= rosenbrock->ivp.t) {
        memcpy(y, rosenbrock->phi, size);
        if (yd)
            end_rates(rosenbrock, yd);
        return;
    }
    double h = rosenbrock->ivp.h_used;
    sd_rosenbrock_polynomial(rosenbrock, rosenbrock->last, rosenbrock->phi, h, (t - (rosenbrock->ivp.t - h)) / h, y, yd);
}

static void values(const void *self, double t, double *y)
{
    within(self, t, y, NULL);
}

sd_rosenbrock *sd_rosenbrock_new(sd_system *system, sd_linear *linear)
{
    sd_rosenbrock *rosenbrock = calloc(1, sizeof *rosenbrock);
    if (!rosenbrock)
        return NULL;
    size_t m = (size_t)sd_whole_lanes(system->unknowns + 1), nnz = (size_t)system->entries + 1;
    double **vectors[] = {&rosenbrock->phi, &rosenbrock->yd, &rosenbrock->last, &rosenbrock->y, &rosenbrock->rate,
                          &rosenbrock->known, &rosenbrock->drift, &rosenbrock->begin, &rosenbrock->ivp.ee, &rosenbrock->ivp.weight,
                          &rosenbrock->end, &rosenbrock->within, &rosenbrock->within_d, &rosenbrock->inner,
                          &rosenbrock->begin_end};
    size_t number = sizeof vectors / sizeof *vectors;
    rosenbrock->memory = calloc((number + STAGES + SD_ROSENBROCK_DENSE) * m + 6 * nnz, sizeof(double));
    rosenbrock->rate_row = calloc(2 * nnz, sizeof *rosenbrock->rate_row);
    if (!rosenbrock->memory || !rosenbrock->rate_row) {
        sd_rosenbrock_free(rosenbrock);
        return NULL;
    }
    rosenbrock->rate_column = rosenbrock->rate_row + nnz;
    double *next = rosenbrock->memory;
    for (size_t i = 0; i < number; i++, next += m)
        *vectors[i] = next;
    for (int i = 0; i < STAGES; i++, next += m)
        rosenbrock->u[i] = next;
    for (int i = 0; i < SD_ROSENBROCK_DENSE; i++, next += m)
        rosenbrock->bend[i] = next;
    rosenbrock->jy = next;
    rosenbrock->jyd = rosenbrock->jy + nnz;
    rosenbrock->g = rosenbrock->jyd + nnz;
    rosenbrock->e = rosenbrock->g + nnz;
    rosenbrock->jy_end = rosenbrock->e + nnz;
    rosenbrock->jyd_end = rosenbrock->jy_end + nnz;
    rosenbrock->ivp.system = system;
    rosenbrock->linear = linear;
    sd_linear_often(linear);
    if (linear->elimination)
        linear->elimination->orders = 1; /* nothing corrects what its stages solve for */
    rosenbrock->ivp.n = system->unknowns;
    rosenbrock->ivp.stepper = (sd_stepper){
        .self = rosenbrock, .ivp = &rosenbrock->ivp, .n = rosenbrock->ivp.n, .y = rosenbrock->phi, .yd = rosenbrock->yd,
        .step = sd_rosenbrock_step, .dense = within, .values = values, .start = sd_rosenbrock_start};
    return rosenbrock;
}

void sd_rosenbrock_free(sd_rosenbrock *rosenbrock)
{
    if (!rosenbrock)
        return;
    free(rosenbrock->memory);
    free(rosenbrock->rate_row);
    free(rosenbrock);
}

/* weights of the error test at the last accepted point; of what is not tested 0 */
static void set_weights(sd_rosenbrock *rosenbrock)
{
    const sd_ivp *ivp = &rosenbrock->ivp;
    sd_weigh(&rosenbrock->ivp, ivp->rtol, rosenbrock->phi);
    for (int32_t i = 0; i < ivp->n; i++)
        if (ivp->test[i] < 0 && ivp->power[i] != 0)
            ivp->weight[i] = 0.0;
}

void sd_rosenbrock_start(void *self, double t, const double *y, const double *yd, double h)
{
    sd_rosenbrock *rosenbrock = self;
    size_t size = (size_t)rosenbrock->ivp.n * sizeof *y;
    sd_begin(&rosenbrock->ivp, t);
    memmove(rosenbrock->phi, y, size);
    memmove(rosenbrock->yd, yd, size);
    rosenbrock->linear->null_pivot = rosenbrock->linear->idle ? SD_LEAST_PIVOT : 0.0;
    set_weights(rosenbrock);
    double part = pow(rosenbrock->ivp.rtol, POWER);
    if (!(h > 0.0) && rosenbrock->ivp.steps == 0 && isfinite(rosenbrock->opening))
        h = rosenbrock->opening * part;
    if (!(h > 0.0)) { /* local error (h y'/y)^5 within tolerance */
        double state = 0.0, change = rosenbrock->ivp.rtol * sd_rosenbrock_norm(rosenbrock, yd, 1.0, &state);
        double longest = SD_FIRST * (rosenbrock->ivp.t_end - t) * fmin(1.0, 10.0 * part); /* runs that are compared begin apart */
        h = sd_first_step(&rosenbrock->ivp, longest, 0.1 * part, change);
    }
    if (rosenbrock->ivp.steps == 0)
        rosenbrock->opening = INFINITY;
    rosenbrock->ivp.h = fmin(rosenbrock->ivp.fixed_h > 0.0 ? rosenbrock->ivp.fixed_h : h, rosenbrock->ivp.h_max);
    rosenbrock->power_accepted = rosenbrock->h_refused = 0.0;
    rosenbrock->rejected = rosenbrock->sloped = rosenbrock->jumped = rosenbrock->lasting = 0;
}

/* the new point, and the next step's size */
static void accept(sd_rosenbrock *rosenbrock, double error)
{
    const double h = rosenbrock->ivp.h, power = pow(error, POWER);
    double ratio = power / SD_SAFETY;
    if (rosenbrock->power_accepted > 0.0) { /* Gustafsson's predictive controller (Hairer & Wanner, IV.8.25) */
        double predicted = rosenbrock->h_accepted / h * (power * power / rosenbrock->power_accepted) / SD_SAFETY;
        ratio = fmax(ratio, predicted);
    }
    double next = h / fmax(1.0 / GROW, fmin(1.0 / SD_SHRINK, ratio));
    if (rosenbrock->ivp.steps < SD_OPENING)
        rosenbrock->opening = fmin(rosenbrock->opening, SD_SAFETY * h / (power * pow(rosenbrock->ivp.rtol, POWER)));
    if (rosenbrock->rejected)
        next = fmin(next, h);
    rosenbrock->h_accepted = h;
    rosenbrock->power_accepted = fmax(LEAST_POWER, power);
    const size_t size = (size_t)rosenbrock->ivp.n * sizeof(double);
    memcpy(rosenbrock->last, rosenbrock->phi, size);
    memcpy(rosenbrock->phi, rosenbrock->end, size);
    memcpy(rosenbrock->yd, rosenbrock->rate, size);
    if (!rosenbrock->rejected)
        rosenbrock->h_refused = 0.0;
    sd_advance(&rosenbrock->ivp);
    rosenbrock->rejected = 0;
    rosenbrock->ivp.h = rosenbrock->ivp.fixed_h > 0.0 ? rosenbrock->ivp.fixed_h : fmin(next, rosenbrock->ivp.h_max);
}

/* the last point moved onto constraints, or all rows; 1: it could not be */
static int project(sd_rosenbrock *rosenbrock, sd_settle *onto)
{
    size_t size = (size_t)rosenbrock->ivp.n * sizeof(double);
    memcpy(rosenbrock->y, rosenbrock->phi, size);
    memcpy(rosenbrock->rate, rosenbrock->yd, size);
    if (sd_settle_point(onto, rosenbrock->ivp.t, rosenbrock->y, rosenbrock->rate))
        return 1;
    memcpy(rosenbrock->phi, rosenbrock->y, size);
    memcpy(rosenbrock->yd, rosenbrock->rate, size);
    return 0;
}

/* whether shorter steps do not make a refused one's error less: what follows from the state jumps where a law does.  It is that of
 * one twice as long before it, or not much less than that of one FAR_LONGER; steps that end short of the jump lie between.  Behind
 * one that was taken for it the next is as good as any: where it is not, no law jumps, but each stage passes over a steep place */
static int stays(sd_rosenbrock *rosenbrock, double error)
{
    double longer = rosenbrock->h_refused, before = rosenbrock->error_refused;
    if (!(longer > 0.0) || error < FALLS * before) {
        rosenbrock->h_refused = rosenbrock->ivp.h;
        rosenbrock->error_refused = error;
        return 0;
    }
    return rosenbrock->ivp.h <= longer * (fabs(error - before) <= SAME * before ? 0.5 : 1.0 / FAR_LONGER);
}

static void exchange(double **a, double **b)
{
    double *was = *a;
    *a = *b;
    *b = was;
}

int sd_rosenbrock_step(void *self)
{
    sd_rosenbrock *rosenbrock = self;
    int failures = 0, known = 0, settled = !rosenbrock->settle;
    double error = 0.0, state = 0.0, tried = rosenbrock->ivp.h;
    set_weights(rosenbrock);
    rosenbrock->ivp.cause = SD_FINE;
    for (;;) {
        rosenbrock->ivp.h = sd_fitted(&rosenbrock->ivp, SD_SLACK);
        if (sd_too_small(&rosenbrock->ivp))
            return rosenbrock->ivp.cause = rosenbrock->ivp.cause ? rosenbrock->ivp.cause : SD_STEP;
        int cause = known ? SD_FINE : sd_rosenbrock_linearise(rosenbrock);
        known = cause == SD_FINE;
        if (cause == SD_FINE)
            cause = sd_rosenbrock_attempt(rosenbrock, &error, &state);
        int jumped = cause == SD_ERROR_TEST && stays(rosenbrock, error) && state < 1.0 && !rosenbrock->jumped;
        if (jumped) {
            cause = SD_FINE;
            error = fmax(state, SD_ROSENBROCK_LEAST);
        }
        if (cause == SD_FINE) {
            rosenbrock->jumped = jumped;
            break;
        }
        rosenbrock->ivp.cause = cause;
        rosenbrock->rejected = 1;
        rosenbrock->sloped = 0;
        known = known && isfinite(error);
        if (sd_ends(&rosenbrock->ivp, cause))
            return cause;
        if (!settled && rosenbrock->ivp.h < SHRUNK * tried) { /* no length bears what steps leave of an exponential */
            settled = 1;
            if (!project(rosenbrock, rosenbrock->settle)) {
                known = failures = 0;
                rosenbrock->ivp.h = AFRESH * tried;
                rosenbrock->h_refused = 0.0;
                continue;
            }
        }
        if (cause == SD_ERROR_TEST) {
            rosenbrock->ivp.rejected_steps++;
            double ratio = pow(error, POWER) / SD_SAFETY;
            rosenbrock->ivp.h *= rosenbrock->ivp.taken == 0 ? 0.1 : isfinite(ratio) ? fmax(SD_SHRINK, fmin(1.0, 1.0 / ratio)) : SD_SHRINK;
        } else {
            rosenbrock->ivp.newton_failures++;
            if (++failures > SD_FAILURES)
                return cause;
            rosenbrock->ivp.h *= 0.25;
        }
    }
    rosenbrock->ivp.cause = SD_FINE;
    accept(rosenbrock, error);
    if (rosenbrock->ivp.project) {
        project(rosenbrock, rosenbrock->ivp.project);
        rosenbrock->sloped = 0;
    }
    if (rosenbrock->sloped) {
        if (!rosenbrock->lasting) {
            exchange(&rosenbrock->jy, &rosenbrock->jy_end);
            exchange(&rosenbrock->jyd, &rosenbrock->jyd_end);
        }
        exchange(&rosenbrock->begin, &rosenbrock->begin_end);
    }
    return SD_FINE;
}
