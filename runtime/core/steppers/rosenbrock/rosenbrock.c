/* The step of Rodas5P: stages, error, step size, values within (see rosenbrock.h). */
#include "steppers/rosenbrock/rosenbrock.h"
#include "linear/lanes.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STAGES SD_ROSENBROCK_STAGES
#define POWER 0.2          /* 1 / order of the estimate's error in the step */
#define SAFE 0.9
#define GROW 6.0           /* of the step at most */
#define CUT 0.2            /* what a refused one is cut to at least */
#define OPENS 1e-2         /* of the span: the first step at most */
#define TELLING 3          /* steps that tell how long the first might have been */
#define SLOPE 1e-6         /* of the step: over which dF/dt is taken */
#define TELLS 1e-8         /* of the longest step: over that, or the step, at least, for differences over less are round-off */
#define RESOLVED 64.0      /* of what t resolves: at least that */
#define INSIDE 0.75        /* of the step: where values within are looked at; those of what is slaved are furthest off there */
#define SAME 0.01          /* part of an error by which that of a step half as long may differ where a law jumps */
#define FALLS 0.5          /* of an error: that of a shorter step where none does */
#define FAR_LONGER 1e3     /* a step over another whose error is to say the same of a jump */
#define DOUBTED 0.1        /* of a steep row's terms: what it may be off before slopes tell whether tolerances let it be */
#define LOOSE 5e-3         /* tolerance beyond which that is asked: to 1e-3 it refused none of the steps of five circuits */
#define LEAST 1e-10        /* error of a step, for the next one's size */
#define SHRUNK 1e-3        /* of the step that was tried first, below which the point that it begins at is settled */
#define AFRESH 0.1         /* of it: what is tried from there */
#define GIVEN 0.1          /* of a slope: what is less has given way */
#define FAILS 12           /* matrices and stages of a step that may fail */

static int step(void *rosenbrock)
{
    return sd_rosenbrock_step(rosenbrock);
}

static void start(void *rosenbrock, double t, const double *y, const double *yd, double h)
{
    sd_rosenbrock_start(rosenbrock, t, y, yd, h);
}

/* out [n] := sum_j weight[j] x[j] of the first `terms`, in whole lanes, for which all vectors have room */
static inline __attribute__((always_inline)) void sum(int32_t n, int terms, const double *weight, double *const *x, double *out)
{
    for (int32_t i = 0; i < n; i += SD_LANES) {
        sd_lanes total = weight[0] * SD_FROM(x[0], i);
        for (int j = 1; j < terms; j++)
            total += weight[j] * SD_FROM(x[j], i);
        SD_AT(out, i) = total;
    }
}

/* the polynomial of the last step */
static SD_WIDE void prepare(sd_rosenbrock *rosenbrock)
{
    for (int k = 0; k < SD_ROSENBROCK_DENSE; k++)
        sum(rosenbrock->n, STAGES, sd_rosenbrock_dense_weight[k], rosenbrock->u, rosenbrock->bend[k]);
}

/* y(x) = y0 + x (change + (1 - x) (b0 + x (b1 + x b2))) and its slope, x: part of a step of size h from y0 to y1.  yd NULL: y
 * alone. */
static void polynomial(const sd_rosenbrock *rosenbrock, const double *y0, const double *y1, double h, double x, double *y, double *yd)
{
    double left = 1.0 - x, *const *b = rosenbrock->bend;
    for (int32_t i = 0; i < rosenbrock->n; i++) {
        double change = y1[i] - y0[i];
        double inner = b[0][i] + x * (b[1][i] + x * b[2][i]), inner_d = b[1][i] + 2.0 * x * b[2][i];
        y[i] = y0[i] + x * (change + left * inner);
        if (yd)
            yd[i] = (change + (left - x) * inner + x * left * inner_d) / h;
    }
}

static void within(const void *self, double t, double *y, double *yd)
{
    const sd_rosenbrock *rosenbrock = self;
    size_t size = (size_t)rosenbrock->n * sizeof *y;
    if (rosenbrock->taken == 0 || t >= rosenbrock->t) {
        memcpy(y, rosenbrock->phi, size);
        if (yd)
            memcpy(yd, rosenbrock->yd, size);
        return;
    }
    double h = rosenbrock->h_used;
    polynomial(rosenbrock, rosenbrock->last, rosenbrock->phi, h, (t - (rosenbrock->t - h)) / h, y, yd);
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
                          &rosenbrock->drift, &rosenbrock->begin, &rosenbrock->ee, &rosenbrock->weight, &rosenbrock->end,
                          &rosenbrock->within, &rosenbrock->within_d, &rosenbrock->inner};
    size_t number = sizeof vectors / sizeof *vectors;
    rosenbrock->memory = calloc((number + 2 * STAGES + SD_ROSENBROCK_DENSE) * m + 6 * nnz, sizeof(double));
    rosenbrock->rate_row = calloc(2 * nnz, sizeof *rosenbrock->rate_row);
    if (!rosenbrock->memory || !rosenbrock->rate_row) {
        sd_rosenbrock_free(rosenbrock);
        return NULL;
    }
    rosenbrock->rate_column = rosenbrock->rate_row + nnz;
    double *next = rosenbrock->memory;
    for (size_t i = 0; i < number; i++, next += m)
        *vectors[i] = next;
    for (int i = 0; i < STAGES; i++, next += 2 * m) {
        rosenbrock->u[i] = next;
        rosenbrock->v[i] = next + m;
    }
    for (int i = 0; i < SD_ROSENBROCK_DENSE; i++, next += m)
        rosenbrock->bend[i] = next;
    rosenbrock->jy = next;
    rosenbrock->jyd = rosenbrock->jy + nnz;
    rosenbrock->g = rosenbrock->jyd + nnz;
    rosenbrock->e = rosenbrock->g + nnz;
    rosenbrock->jy_end = rosenbrock->e + nnz;
    rosenbrock->jyd_end = rosenbrock->jy_end + nnz;
    rosenbrock->system = system;
    rosenbrock->linear = linear;
    sd_linear_replayed(linear);
    if (linear->elimination)
        linear->elimination->orders = 1; /* nothing corrects what its stages solve for */
    rosenbrock->n = system->unknowns;
    rosenbrock->stepper = (sd_stepper){
        .self = rosenbrock, .system = system, .n = rosenbrock->n, .t = &rosenbrock->t, .t_end = &rosenbrock->t_end,
        .y = rosenbrock->phi, .yd = rosenbrock->yd, .taken = &rosenbrock->taken, .step = step, .dense = within,
        .values = values, .start = start};
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

sd_stepper *sd_rosenbrock_stepper(sd_rosenbrock *rosenbrock)
{
    return &rosenbrock->stepper;
}

/* weights of the error test at the last accepted point; of what is not tested 0 */
static void set_weights(sd_rosenbrock *rosenbrock)
{
    for (int32_t i = 0; i < rosenbrock->n; i++) {
        double size = fabs(rosenbrock->phi[i]);
        sd_met(size, &rosenbrock->met[i], &rosenbrock->magnitude[i]);
        int state = rosenbrock->test[i] >= 0;
        double atol = rosenbrock->atol && state ? rosenbrock->atol[i] : rosenbrock->rtol * rosenbrock->magnitude[i];
        rosenbrock->weight[i] = state || rosenbrock->power[i] == 0 ? 1.0 / (atol + rosenbrock->rtol * size) : 0.0;
    }
}

/* root mean square over the tested unknowns in the error weights; h: of those that count with it.  Grows `state` to that of
 * what carries the state. */
static double norm(const sd_rosenbrock *rosenbrock, const double *x, double h, double *state)
{
    double all = 0.0, own = 0.0;
    for (int32_t i = 0; i < rosenbrock->n; i++) {
        double part = x[i] * rosenbrock->weight[i] * (rosenbrock->test[i] > 0 ? h : 1.0);
        all += part * part;
        own += rosenbrock->test[i] >= 0 ? part * part : 0.0;
    }
    double number = rosenbrock->tested ? rosenbrock->tested : 1.0;
    *state = fmax(*state, sqrt(own / number));
    return rosenbrock->tested ? sqrt(all / number) : 0.0;
}

void sd_rosenbrock_start(sd_rosenbrock *rosenbrock, double t, const double *y, const double *yd, double h)
{
    size_t size = (size_t)rosenbrock->n * sizeof *y;
    rosenbrock->t = t;
    rosenbrock->taken = rosenbrock->sloped = rosenbrock->jumped = 0;
    rosenbrock->tested = 0;
    for (int32_t i = 0; i < rosenbrock->n; i++)
        rosenbrock->tested += rosenbrock->test[i] >= 0;
    memmove(rosenbrock->phi, y, size);
    memmove(rosenbrock->yd, yd, size);
    rosenbrock->linear->null_pivot = rosenbrock->linear->idle ? SD_LEAST_PIVOT : 0.0;
    set_weights(rosenbrock);
    double span = rosenbrock->t_end - t, part = pow(rosenbrock->rtol, POWER);
    if (!(h > 0.0) && rosenbrock->steps == 0 && isfinite(rosenbrock->opening))
        h = rosenbrock->opening * part;
    if (!(h > 0.0)) { /* local error (h y'/y)^5 within tolerance */
        double state = 0.0, change = rosenbrock->rtol * norm(rosenbrock, yd, 1.0, &state);
        h = OPENS * span * fmin(1.0, 10.0 * part); /* runs that are compared begin apart */
        if (isfinite(change) && change > 0.0)
            h = fmin(h, 0.1 * part / change);
        h = fmax(h, fmin(1e3 * DBL_EPSILON * fmax(fabs(t), SD_SHORT * span), span));
    }
    if (rosenbrock->steps == 0)
        rosenbrock->opening = INFINITY;
    rosenbrock->h = fmin(rosenbrock->fixed_h > 0.0 ? rosenbrock->fixed_h : h, rosenbrock->h_max);
    rosenbrock->h_used = 0.0;
    rosenbrock->error_accepted = rosenbrock->h_refused = 0.0;
    rosenbrock->rejected = 0;
}

/* the step ends at t_end exactly, and never leaves less than its half for the last one */
static void fit_end(sd_rosenbrock *rosenbrock)
{
    double left = rosenbrock->t_end - rosenbrock->t;
    if (rosenbrock->h >= left * (1.0 - 1e-12))
        rosenbrock->h = left;
    else if (2.0 * rosenbrock->h > left && rosenbrock->taken > 0 && !(rosenbrock->fixed_h > 0.0))
        rosenbrock->h = 0.5 * left;
}

/* F at (t, y, yd) into r: SD_NONFINITE with its row where it is none */
static int residual(sd_rosenbrock *rosenbrock, double t, const double *y, const double *yd, double *r)
{
    sd_residual(rosenbrock->system, t, y, yd, r);
    if (*rosenbrock->system->stop)
        return SD_STOPPED;
    if (sd_finite(rosenbrock->n, r))
        return SD_FINE;
    rosenbrock->bad_row = sd_first_bad(rosenbrock->n, r);
    return SD_NONFINITE;
}

/* J, E, F and T at the last accepted point, for steps of about the size at hand */
static int linearise(sd_rosenbrock *rosenbrock)
{
    sd_system *system = rosenbrock->system;
    double t = rosenbrock->t, *drift = rosenbrock->drift;
    int32_t bad = -1;
    if (!rosenbrock->sloped)
        bad = sd_jacobian(system, t, rosenbrock->phi, rosenbrock->yd, rosenbrock->magnitude, rosenbrock->jy, rosenbrock->jyd);
    rosenbrock->sloped = 0;
    if (*system->stop)
        return SD_STOPPED;
    if (bad >= 0) {
        rosenbrock->bad_row = bad;
        return SD_NONFINITE;
    }
    rosenbrock->rates = 0;
    for (int32_t j = 0; j < rosenbrock->n; j++)
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            if (rosenbrock->jyd[e] != 0.0) {
                rosenbrock->e[rosenbrock->rates] = rosenbrock->jyd[e];
                rosenbrock->rate_row[rosenbrock->rates] = system->row[e];
                rosenbrock->rate_column[rosenbrock->rates++] = j;
            }
    double over = fmax(SLOPE * rosenbrock->h, fmin(rosenbrock->h, TELLS * rosenbrock->h_max));
    double later = t + fmax(over, RESOLVED * DBL_EPSILON * fabs(t));
    int cause = residual(rosenbrock, t, rosenbrock->phi, rosenbrock->yd, rosenbrock->begin);
    if (cause == SD_FINE)
        cause = residual(rosenbrock, later, rosenbrock->phi, rosenbrock->yd, drift);
    for (int32_t i = 0; i < rosenbrock->n; i++)
        drift[i] = (drift[i] - rosenbrock->begin[i]) / (later - t);
    return cause;
}

/* the factors of J + E / (gamma h) */
static int factorise(sd_rosenbrock *rosenbrock)
{
    double lead = 1.0 / (sd_rosenbrock_gamma * rosenbrock->h);
    for (int32_t e = 0; e < rosenbrock->system->entries; e++)
        rosenbrock->g[e] = rosenbrock->jy[e] + lead * rosenbrock->jyd[e];
    int failed = sd_linear_factor(rosenbrock->linear, rosenbrock->g, rosenbrock->magnitude);
    rosenbrock->bad_row = rosenbrock->linear->bad_row;
    rosenbrock->bad_column = rosenbrock->linear->bad_column;
    return failed == 2 ? SD_MEMORY : failed ? SD_SINGULAR : SD_FINE;
}

/* y, rate [n] := Y_s, Z_s;  v[s] := Z_s + s_s */
static SD_WIDE void place(sd_rosenbrock *rosenbrock, int s)
{
    const double *a = sd_rosenbrock_a[s], *c = sd_rosenbrock_coupling[s], over = 1.0 / rosenbrock->h;
    for (int32_t i = 0; i < rosenbrock->n; i += SD_LANES) {
        sd_lanes y = SD_FROM(rosenbrock->phi, i), z = SD_FROM(rosenbrock->yd, i), lag = {0.0};
        for (int j = 0; j < s; j++) {
            y += a[j] * SD_FROM(rosenbrock->u[j], i);
            z += a[j] * SD_FROM(rosenbrock->v[j], i);
            lag += c[j] * SD_FROM(rosenbrock->u[j], i);
        }
        SD_AT(rosenbrock->y, i) = y;
        SD_AT(rosenbrock->rate, i) = z;
        SD_AT(rosenbrock->v[s], i) = z + over * lag;
    }
}

/* u[s] := -F_s - d_s h T, where u[s] is F_s */
static SD_WIDE void turn(sd_rosenbrock *rosenbrock, int s)
{
    double *u = rosenbrock->u[s], dt = sd_rosenbrock_d[s] * rosenbrock->h;
    for (int32_t i = 0; i < rosenbrock->n; i += SD_LANES)
        SD_AT(u, i) = -SD_FROM(u, i) - dt * SD_FROM(rosenbrock->drift, i);
}

/* u[s] += E v[s] */
static void add_moved(sd_rosenbrock *rosenbrock, int s)
{
    double *u = rosenbrock->u[s], *v = rosenbrock->v[s];
    for (int32_t k = 0; k < rosenbrock->rates; k++)
        u[rosenbrock->rate_row[k]] += rosenbrock->e[k] * v[rosenbrock->rate_column[k]];
}

/* v[s] := u[s] / (gamma h) - v[s] */
static SD_WIDE void close(sd_rosenbrock *rosenbrock, int s)
{
    double *u = rosenbrock->u[s], *v = rosenbrock->v[s], lead = 1.0 / (sd_rosenbrock_gamma * rosenbrock->h);
    for (int32_t i = 0; i < rosenbrock->n; i += SD_LANES)
        SD_AT(v, i) = lead * SD_FROM(u, i) - SD_FROM(v, i);
}

/* all stages of a step */
static int take_stages(sd_rosenbrock *rosenbrock)
{
    for (int s = 0; s < STAGES; s++) {
        double *u = rosenbrock->u[s], t = rosenbrock->t + sd_rosenbrock_c[s] * rosenbrock->h;
        place(rosenbrock, s);
        int cause = SD_FINE;
        if (s == 0)
            memcpy(u, rosenbrock->begin, (size_t)rosenbrock->n * sizeof *u);
        else if ((cause = residual(rosenbrock, t, rosenbrock->y, rosenbrock->rate, u)))
            return cause;
        turn(rosenbrock, s);
        add_moved(rosenbrock, s);
        sd_linear_solve(rosenbrock->linear, u);
        close(rosenbrock, s);
    }
    return SD_FINE;
}

/* the new point, and the next step's size */
static void accept(sd_rosenbrock *rosenbrock, double error)
{
    double h = rosenbrock->h, t = rosenbrock->t + h, ratio = pow(error, POWER) / SAFE;
    if (rosenbrock->error_accepted > 0.0) { /* Gustafsson's predictive controller (Hairer & Wanner, IV.8.25) */
        double predicted = rosenbrock->h_accepted / h * pow(error * error / rosenbrock->error_accepted, POWER) / SAFE;
        ratio = fmax(ratio, predicted);
    }
    double next = h / fmax(1.0 / GROW, fmin(1.0 / CUT, ratio));
    if (rosenbrock->steps < TELLING)
        rosenbrock->opening = fmin(rosenbrock->opening, SAFE * h * pow(error * rosenbrock->rtol, -POWER));
    if (rosenbrock->rejected)
        next = fmin(next, h);
    rosenbrock->h_accepted = h;
    rosenbrock->error_accepted = fmax(1e-2, error);
    double *before = rosenbrock->last;
    memcpy(before, rosenbrock->phi, (size_t)rosenbrock->n * sizeof *before);
    for (int32_t i = 0; i < rosenbrock->n; i++) {
        rosenbrock->phi[i] = rosenbrock->y[i] + rosenbrock->u[STAGES - 1][i];
        rosenbrock->yd[i] = rosenbrock->rate[i] + rosenbrock->v[STAGES - 1][i];
    }
    if (!rosenbrock->rejected)
        rosenbrock->h_refused = 0.0;
    rosenbrock->t = fabs(rosenbrock->t_end - t) <= 1e-12 * h ? rosenbrock->t_end : t;
    rosenbrock->h_used = h;
    rosenbrock->steps++;
    rosenbrock->taken++;
    rosenbrock->rejected = 0;
    rosenbrock->h = rosenbrock->fixed_h > 0.0 ? rosenbrock->fixed_h : fmin(next, rosenbrock->h_max);
}

/* the last point moved onto constraints, or all rows; 1: it could not be */
static int project(sd_rosenbrock *rosenbrock, sd_settle *onto)
{
    size_t size = (size_t)rosenbrock->n * sizeof(double);
    memcpy(rosenbrock->y, rosenbrock->phi, size);
    memcpy(rosenbrock->rate, rosenbrock->yd, size);
    if (sd_settle_point(onto, rosenbrock->t, rosenbrock->y, rosenbrock->rate))
        return 1;
    memcpy(rosenbrock->phi, rosenbrock->y, size);
    memcpy(rosenbrock->yd, rosenbrock->rate, size);
    return 0;
}

/* what values within the step are off, where what is pulled back at once hides it from the error of the end: a Newton
 * correction at INSIDE of the step; in the weights, in `error`, of the state in `state` */
static int look_within(sd_rosenbrock *rosenbrock, double *error, double *state)
{
    double *end = rosenbrock->end, *r = rosenbrock->inner;
    for (int32_t i = 0; i < rosenbrock->n; i++)
        end[i] = rosenbrock->y[i] + rosenbrock->u[STAGES - 1][i];
    prepare(rosenbrock);
    polynomial(rosenbrock, rosenbrock->phi, end, rosenbrock->h, INSIDE, rosenbrock->within, rosenbrock->within_d);
    int cause = residual(rosenbrock, rosenbrock->t + INSIDE * rosenbrock->h, rosenbrock->within, rosenbrock->within_d, r);
    if (cause != SD_FINE)
        return cause;
    sd_linear_solve(rosenbrock->linear, r);
    *error = fmax(*error, norm(rosenbrock, r, rosenbrock->h, state));
    return SD_FINE;
}

/* SD_ERROR_TEST where a steep row of the step's end is off by more than the tolerances of its unknowns let it be, by the slopes
 * there: behind an exponential all stages follow the slope at its begin, and agree.  J, E and T are not the begin's then. */
static int laws_hold(sd_rosenbrock *rosenbrock, double *error)
{
    sd_system *system = rosenbrock->system;
    double t = rosenbrock->t + rosenbrock->h, *y = rosenbrock->end, *yd = rosenbrock->within_d, *r = rosenbrock->inner;
    double *terms = rosenbrock->within, *open = rosenbrock->drift, *size = rosenbrock->u[0], passed = *error;
    for (int32_t i = 0; i < rosenbrock->n; i++) {
        yd[i] = rosenbrock->rate[i] + rosenbrock->v[STAGES - 1][i];
        size[i] = (fabs(y[i]) + rosenbrock->magnitude[i]) / rosenbrock->h;
    }
    int cause = residual(rosenbrock, t, y, yd, r);
    if (cause != SD_FINE || sd_first_unmet(system, t, y, size, r, DOUBTED, rosenbrock->g, rosenbrock->magnitude, rosenbrock->met,
                                           0, terms) < 0)
        return cause;
    *error = INFINITY;
    if (sd_jacobian(system, t, y, yd, rosenbrock->magnitude, rosenbrock->jy, rosenbrock->jyd) >= 0)
        return SD_NONFINITE;
    for (int32_t i = 0; i < rosenbrock->n; i++)
        open[i] = rosenbrock->weight[i] > 0.0 ? 1.0 / rosenbrock->weight[i] : rosenbrock->rtol * rosenbrock->magnitude[i];
    if (sd_first_astray(system, t, y, yd, r, 0.0, rosenbrock->jy, rosenbrock->jyd, rosenbrock->h, open, 0, terms) >= 0)
        return SD_ERROR_TEST;
    *error = passed;
    return SD_FINE;
}

/* what the end is off by the slopes there, where a law has given way within the step (a tanh that saturates): by those at its
 * begin, which hold it, what is left of its row is next to nothing.  Slopes and factors are not the begin's then. */
static int gives_way(sd_rosenbrock *rosenbrock, double *error, double *state)
{
    sd_system *system = rosenbrock->system;
    double t = rosenbrock->t + rosenbrock->h, *y = rosenbrock->end, *yd = rosenbrock->within_d, *r = rosenbrock->inner;
    double lead = 1.0 / (sd_rosenbrock_gamma * rosenbrock->h), *jy = rosenbrock->jy_end, *jyd = rosenbrock->jyd_end;
    for (int32_t i = 0; i < rosenbrock->n; i++)
        yd[i] = rosenbrock->rate[i] + rosenbrock->v[STAGES - 1][i];
    int cause = residual(rosenbrock, t, y, yd, r);
    if (cause != SD_FINE)
        return cause;
    if (sd_jacobian(system, t, y, yd, rosenbrock->magnitude, jy, jyd) >= 0)
        return SD_NONFINITE;
    rosenbrock->sloped = 1;
    int32_t e = 0;
    while (e < system->entries && !(fabs(jy[e]) < GIVEN * fabs(rosenbrock->jy[e])))
        e++;
    if (e == system->entries)
        return SD_FINE;
    for (e = 0; e < system->entries; e++)
        rosenbrock->g[e] = jy[e] + lead * jyd[e];
    if (sd_linear_factor(rosenbrock->linear, rosenbrock->g, rosenbrock->magnitude))
        return SD_FINE;
    sd_linear_solve(rosenbrock->linear, r);
    *error = fmax(*error, norm(rosenbrock, r, rosenbrock->h, state));
    memset(r, 0, (size_t)rosenbrock->n * sizeof *r); /* nor is the difference of both solutions what the begin's factors say */
    const double *u = rosenbrock->u[STAGES - 1];
    for (int32_t j = 0; j < rosenbrock->n; j++)
        for (e = system->column[j]; e < system->column[j + 1]; e++)
            r[system->row[e]] += (rosenbrock->jy[e] + lead * rosenbrock->jyd[e]) * u[j];
    sd_linear_solve(rosenbrock->linear, r);
    *error = fmax(*error, norm(rosenbrock, r, rosenbrock->h, state));
    return SD_FINE;
}

/* factors and stages of a step, its error in `error`, of the state alone in `state`; SD_ERROR_TEST where it is too large */
static int attempt(sd_rosenbrock *rosenbrock, double *error, double *state)
{
    rosenbrock->sloped = 0;
    int cause = factorise(rosenbrock);
    if (cause == SD_FINE)
        cause = take_stages(rosenbrock);
    if (cause != SD_FINE)
        return cause;
    *state = 0.0;
    *error = norm(rosenbrock, rosenbrock->u[STAGES - 1], rosenbrock->h, state);
    memcpy(rosenbrock->ee, rosenbrock->u[STAGES - 1], (size_t)rosenbrock->n * sizeof(double));
    if (*state < 1.0 || rosenbrock->fixed_h > 0.0) /* what may be taken (`stays`) is asked within, too */
        cause = look_within(rosenbrock, error, state);
    if (rosenbrock->fixed_h > 0.0)
        return isfinite(*error) ? SD_FINE : SD_NONFINITE;
    if (cause != SD_FINE)
        return cause;
    if (*error < 1.0 && (cause = gives_way(rosenbrock, error, state)) != SD_FINE)
        return cause;
    *error = isfinite(*error) ? fmax(*error, LEAST) : INFINITY;
    if (!(*error < 1.0))
        return SD_ERROR_TEST;
    return rosenbrock->system->scales > 0 && rosenbrock->rtol > LOOSE ? laws_hold(rosenbrock, error) : SD_FINE;
}

/* whether shorter steps do not make a refused one's error less: what follows from the state jumps where a law does.  It is that of
 * one twice as long before it, or not much less than that of one FAR_LONGER; steps that end short of the jump lie between.  Behind
 * one that was taken for it the next is as good as any: where it is not, no law jumps, but each stage passes over a steep place */
static int stays(sd_rosenbrock *rosenbrock, double error)
{
    double longer = rosenbrock->h_refused, before = rosenbrock->error_refused;
    if (!(longer > 0.0) || error < FALLS * before) {
        rosenbrock->h_refused = rosenbrock->h;
        rosenbrock->error_refused = error;
        return 0;
    }
    return rosenbrock->h <= longer * (fabs(error - before) <= SAME * before ? 0.5 : 1.0 / FAR_LONGER);
}

int sd_rosenbrock_step(sd_rosenbrock *rosenbrock)
{
    int failures = 0, known = 0, settled = !rosenbrock->settle;
    double error = 0.0, state = 0.0, tried = rosenbrock->h;
    set_weights(rosenbrock);
    rosenbrock->cause = SD_FINE;
    for (;;) {
        fit_end(rosenbrock);
        double left = rosenbrock->t_end - rosenbrock->t;
        if (rosenbrock->h < 4.0 * DBL_EPSILON * fmax(fabs(rosenbrock->t), SD_SHORT * left) && rosenbrock->h < left) {
            rosenbrock->cause = rosenbrock->cause ? rosenbrock->cause : SD_STEP;
            return rosenbrock->cause;
        }
        int cause = known ? SD_FINE : linearise(rosenbrock);
        known = cause == SD_FINE;
        if (cause == SD_FINE)
            cause = attempt(rosenbrock, &error, &state);
        int jumped = cause == SD_ERROR_TEST && stays(rosenbrock, error) && state < 1.0 && !rosenbrock->jumped;
        if (jumped) {
            cause = SD_FINE;
            error = fmax(state, LEAST);
        }
        if (cause == SD_FINE) {
            rosenbrock->jumped = jumped;
            break;
        }
        rosenbrock->cause = cause;
        rosenbrock->rejected = 1;
        known = known && isfinite(error);
        if (cause == SD_STOPPED || cause == SD_MEMORY || rosenbrock->fixed_h > 0.0)
            return cause;
        if (!settled && rosenbrock->h < SHRUNK * tried) { /* no length bears what steps leave of an exponential */
            settled = 1;
            if (!project(rosenbrock, rosenbrock->settle)) {
                known = failures = 0;
                rosenbrock->h = AFRESH * tried;
                rosenbrock->h_refused = 0.0;
                continue;
            }
        }
        if (cause == SD_ERROR_TEST) {
            rosenbrock->rejected_steps++;
            double ratio = pow(error, POWER) / SAFE;
            rosenbrock->h *= rosenbrock->taken == 0 ? 0.1 : isfinite(ratio) ? fmax(CUT, fmin(1.0, 1.0 / ratio)) : CUT;
        } else {
            rosenbrock->newton_failures++;
            if (++failures > FAILS)
                return cause;
            rosenbrock->h *= 0.25;
        }
    }
    rosenbrock->cause = SD_FINE;
    accept(rosenbrock, error);
    if (rosenbrock->project) {
        project(rosenbrock, rosenbrock->project);
        rosenbrock->sloped = 0;
    }
    if (rosenbrock->sloped) {
        const size_t size = (size_t)rosenbrock->system->entries * sizeof(double);
        memcpy(rosenbrock->jy, rosenbrock->jy_end, size);
        memcpy(rosenbrock->jyd, rosenbrock->jyd_end, size);
    }
    return SD_FINE;
}
