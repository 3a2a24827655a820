/* The step of Radau IIA: stages by Newton's iteration, error, step size (see radau.h). */
#include "system/condensed.h"
#include "steppers/radau.h"
#include "steppers/threads.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ITERATIONS 7       /* of Newton a step of three stages */
#define MORE 1             /* for each stage beyond */
#define PATIENT 30         /* the same where the step is fixed: nothing is gained by giving up early */
#define DAMPED 15          /* with corrections shortened */
#define WALK 45            /* with whole ones: back down an exponential of all digits, one 1/a each, and a few more */
#define SAFETY 0.9
#define FIRST 1e-2         /* of the span: the first step at most */
#define GROWTH 8.0         /* of the step at most; it shrinks to 1/5 at most */
#define SHRINK 0.2
#define SLOW 0.99          /* contraction above which Newton gives up */
#define CREEPS 8           /* steps in a row for which Newton failed at first: towards a square root's zero they would never end */
#define IDLE 1e-6          /* error of a step that only Newton keeps short */
#define LEAP 8.0           /* the next one is tried that much longer, with fresh slopes at its end */
#define STAGNANT 0.1       /* of the tolerance: corrections this small that do not shrink are round-off */
#define WITHIN -0.183
#define FINEST 5e-12       /* of the estimate: less is round-off */
#define FEWER 3            /* failures of Newton's in a step from which on each takes stages away */
#define LENGTHS 2          /* of a step that are tried before corrections are shortened, which is dearer */
#define PRESSED 1e-3       /* of the longest step: one that must be shorter before a steep law, no length will do */
#define REGAIN 1.2         /* growth of the growth that steep laws leave a step behind a failure of Newton's */
#define SHORTENED 50       /* steps of three stages after one that needed shortened corrections */
#define AWHILE 2           /* steps accepted before the number of stages changes again */
#define CHANGED 1.2        /* what another one must be worth beside the present one */
#define LONGER 2.0         /* the first step of more stages beside the last one at most */
#define FASTEST 0.3        /* contraction with which a longer step is counted on */
#define BESIDE 2.0         /* iterations' worth of a step besides: slopes and factors */
#define GOOD 0.001         /* contraction up to which the Jacobian is kept for the next step */
#define KEEP_LOW 1.0       /* a step that would change by no more than this keeps its factors */
#define KEEP_HIGH 1.2
#define SINGULAR 6         /* halvings after a singular matrix */
#define LAX 100.0          /* a steep row may be off by as many times Newton's tolerance times the method's */
#define NULL_PIVOT 1e-10   /* part of its column below which a pivot determines no better than Newton's test asks */
#define LEAST_PIVOT 1e-290 /* the same where every pivot but zero counts */
#define ASTRAY 16.0 /* error of a step that passes over what a steep law does: half of it is tried */
#define LEAST_PART 1e-7    /* of a correction that is still tried */
#define FAINT_ROW 1e-6     /* the same where slopes are too faint to move an unknown */
#define FINEST_ROW 1e-9    /* part of a steep row's terms that round-off of its unknowns leaves */

/* out [n] := sum_j weight[j] v[j] */
static inline void sum(int stages, int32_t n, const double *weight, double *const *v, double *out)
{
    for (int32_t i = 0; i < n; i++) {
        double x = weight[0] * v[0][i];
        for (int j = 1; j < stages; j++)
            x += weight[j] * v[j][i];
        out[i] = x;
    }
}

static void combine(int stages, int32_t n, const double *weight, double *const *v, double *out)
{
    if (stages == 3)
        sum(3, n, weight, v, out);
    else if (stages == 5)
        sum(5, n, weight, v, out);
    else
        sum(7, n, weight, v, out);
}

static int step(void *radau)
{
    return sd_radau_step(radau);
}

static void dense(const void *radau, double t, double *y, double *yd)
{
    sd_radau_dense(radau, t, y, yd);
}

static void refine(void *radau, sd_settle *settle)
{
    sd_radau_refine(radau, settle);
}

static void start(void *radau, double t, const double *y, const double *yd, double h)
{
    sd_radau_start(radau, t, y, yd, h);
}

sd_radau *sd_radau_new(sd_system *system, sd_linear *linear, sd_linear_z *const *complex_linear, int32_t stages)
{
    sd_radau *radau = calloc(1, sizeof *radau);
    if (!radau)
        return NULL;
    size_t nnz = (size_t)system->entries + 1, m = (size_t)system->unknowns + 1;
    double **vectors[] = {&radau->phi, &radau->yd, &radau->last, &radau->before, &radau->slope[0], &radau->slope[1],
                          &radau->slope[2], &radau->point, &radau->point_d, &radau->y, &radau->rate, &radau->ee,
                          &radau->weight, &radau->newton_weight, &radau->scale, &radau->terms, &radau->pull, &radau->first};
    double **of_stages[] = {radau->z, radau->kept, radau->d, radau->base, radau->full, radau->stage, radau->stage_d};
    size_t number = sizeof vectors / sizeof *vectors, sets = sizeof of_stages / sizeof *of_stages;
    size_t all = number + sets * (size_t)stages, pairs = (size_t)(stages - 1) / 2;
    radau->memory = calloc(all * m + 3 * nnz, sizeof(double));
    radau->gap = calloc(SD_METHODS, sizeof *radau->gap);
    size_t apart = system->unknowns < SD_LARGE ? 1 : pairs; /* complex matrices that are made at once */
    radau->gz = calloc(pairs * m + apart * nnz, sizeof(double complex));
    if (!radau->memory || !radau->gz || !radau->gap) {
        sd_radau_free(radau);
        return NULL;
    }
    sd_radau_gaps(radau->gap);
    double *next = radau->memory;
    for (size_t i = 0; i < number; i++, next += m)
        *vectors[i] = next;
    for (size_t i = 0; i < sets; i++)
        for (int32_t s = 0; s < stages; s++, next += m)
            of_stages[i][s] = next;
    radau->jy = next;
    radau->jyd = radau->jy + nnz;
    radau->g = radau->jyd + nnz;
    for (size_t k = 0; k < pairs; k++) {
        radau->w[k] = radau->gz + apart * nnz + k * m;
        radau->complex_linear[k] = complex_linear[k];
        if (complex_linear[k])
            sd_linear_z_replayed(complex_linear[k]);
    }
    radau->system = system;
    radau->linear = linear;
    sd_linear_replayed(linear);
    radau->n = system->unknowns;
    radau->stages = sd_radau_methods[0].stages;
    radau->most_stages = stages;
    radau->method = radau->used = sd_radau_methods;
    radau->stepper = (sd_stepper){radau, system, radau->n, &radau->t, &radau->t_end, radau->phi, radau->yd,
                                  &radau->taken, step, dense, refine, start, stages, NULL, NULL, radau->stage,
                                  radau->stage_d, NULL, NULL, NULL, NULL, NULL, 1};
    return radau;
}

void sd_radau_free(sd_radau *radau)
{
    if (!radau)
        return;
    free(radau->memory);
    free(radau->gz);
    free(radau->gap);
    free(radau->beside);
    free(radau->point_y);
    free(radau);
}

sd_stepper *sd_radau_stepper(sd_radau *radau)
{
    return &radau->stepper;
}

/* weights of the error test and of Newton's at the last accepted point */
static void set_weights(sd_radau *radau)
{
    for (int32_t i = 0; i < radau->n; i++) {
        double size = fabs(radau->phi[i]);
        sd_met(size, &radau->met[i], &radau->magnitude[i]);
        double atol = radau->tolerance * radau->magnitude[i];
        if (radau->atol && radau->test[i] >= 0)
            atol = radau->atol[i] * radau->tolerance / radau->rtol;
        radau->weight[i] = 1.0 / (atol + radau->tolerance * size);
    }
}

/* index-2 unknowns and index-3 multipliers count with powers of h */
static void set_newton_weights(sd_radau *radau)
{
    for (int32_t i = 0; i < radau->n; i++) {
        double power = radau->power[i] == 0 ? 1.0 : radau->power[i] == 1 ? radau->h : radau->h * radau->h;
        radau->newton_weight[i] = radau->weight[i] * power;
        radau->scale[i] = radau->magnitude[i] / power;
    }
}

/* root mean square over the tested unknowns in the error weights */
static double tested_norm(const sd_radau *radau, const double *x)
{
    double sum = 0.0;
    for (int32_t i = 0; i < radau->n; i++)
        if (radau->test[i] >= 0) {
            double v = x[i] * radau->weight[i] * (radau->test[i] ? radau->h : 1.0);
            sum += v * v;
        }
    return radau->tested ? sqrt(sum / radau->tested) : 0.0;
}

/* the part of its column below which a pivot is none; columns of multipliers and states always have one */
static void leave_below(sd_radau *radau, double null_pivot)
{
    radau->linear->null_pivot = null_pivot;
    for (int k = 0; k < SD_PAIRS && radau->complex_linear[k]; k++)
        sd_linear_z_allow(radau->complex_linear[k], null_pivot, radau->linear->idle);
}

/* what is interpolated meets no steep law, of what follows from differences of unknowns too little, and has a lower
 * order than more stages: powers are those of the stages */
static void show_nodes(sd_radau *radau)
{
    const sd_radau_method *used = radau->used;
    int stages = radau->system->scales > 0 || radau->system->left || used->stages > 3;
    radau->stepper.nodes = stages ? used->stages : 0;
    radau->stepper.node = used->c;
    radau->stepper.node_weight = used->b;
}

/* Values within a step of more stages may be as far off as its estimate says (where constraints make multipliers), and
 * shall fall like those of three, with rtol^0.85: the estimate counts within * rtol^(2/3 - 0.85) times. */
static const double within[SD_METHODS] = {0.0, 0.2, 0.02};

/* Of Newton's corrections, in units of the unknowns' */
static const double round_off[SD_METHODS] = {10.0, 40.0, 160.0};

/* what the estimate of a method counts beside that of three stages */
static double strictness(const sd_radau *radau, const sd_radau_method *method)
{
    return radau->strict[method - sd_radau_methods];
}

/* 1 / order of the estimate's error in the step */
static double power_of(const sd_radau *radau)
{
    return 1.0 / (radau->method->stages + 1);
}

void sd_radau_start(sd_radau *radau, double t, const double *y, const double *yd, double h)
{
    size_t size = (size_t)radau->n * sizeof *y;
    radau->t = t;
    radau->taken = 0;
    radau->tested = 0;
    for (int32_t i = 0; i < radau->n; i++)
        radau->tested += radau->test[i] >= 0;
    radau->tolerance = fmax(0.1 * pow(radau->rtol, 2.0 / 3.0), 1e-13);
    for (int k = 0; k < SD_METHODS; k++)
        radau->strict[k] = fmax(1.0, fmin(within[k] * pow(radau->rtol, WITHIN), radau->tolerance / FINEST));
    memmove(radau->phi, y, size);
    memmove(radau->yd, yd, size);
    memcpy(radau->slope[0], radau->yd, size);
    radau->refined[0] = 1; /* a start is settled */
    radau->method = sd_radau_methods;
    while (radau->method->stages < radau->stages)
        radau->method++;
    radau->used = radau->method;
    radau->since = radau->hold = 0;
    show_nodes(radau);
    radau->h = 1.0;
    set_weights(radau);
    double span = radau->t_end - t, change = tested_norm(radau, yd) * radau->tolerance;
    double power = power_of(radau);
    if (!(h > 0.0)) { /* local error (h y'/y)^(s+1) within tolerance, with y' / y for the rate of all derivatives */
        h = FIRST * span * fmin(1.0, pow(1e3 * radau->tolerance, power)); /* runs that are compared begin apart */
        if (isfinite(change) && change > 0.0)
            h = fmin(h, 0.1 * pow(radau->tolerance, power) / change);
        h = fmax(h, fmin(1e3 * DBL_EPSILON * fmax(fabs(t), SD_SHORT * span), span));
    }
    radau->h = fmin(radau->fixed_h > 0.0 ? radau->fixed_h : h, radau->h_max);
    radau->h_used = radau->h_before = 0.0;
    radau->error_accepted = 0.0;
    radau->growth = GROWTH;
    radau->longest = 0.0;
    radau->pressed = radau->balances;
    radau->ready = radau->old_jacobian = radau->rejected = radau->creeping = 0;
    leave_below(radau, radau->linear->idle ? LEAST_PIVOT : 0.0);
    radau->theta = 1.0;
}

/* whether the systems of a step are taken at once: a matter of their size, not of the machine */
static int large(const sd_radau *radau)
{
    return radau->n >= SD_LARGE;
}

typedef struct factoring {
    sd_radau *radau;
    int failed[SD_PAIRS + 1];
} factoring;

/* part 0: J + gamma/h E and its factors; part k: those of J + lambda/h E of pair k - 1 */
static void factorise_one(void *context, int part)
{
    factoring *all = context;
    sd_radau *radau = all->radau;
    const sd_radau_method *method = radau->method;
    int32_t entries = radau->system->entries;
    if (part == 0) {
        double real = method->gamma / radau->h;
        for (int32_t e = 0; e < entries; e++)
            radau->g[e] = radau->jy[e] + real * radau->jyd[e];
        all->failed[0] = sd_linear_factor(radau->linear, radau->g, radau->scale);
        return;
    }
    double complex both = method->lambda[part - 1] / radau->h;
    double complex *gz = radau->gz + (large(radau) ? (size_t)(part - 1) * ((size_t)entries + 1) : 0);
    for (int32_t e = 0; e < entries; e++)
        gz[e] = radau->jy[e] + both * radau->jyd[e];
    all->failed[part] = sd_linear_z_factor(radau->complex_linear[part - 1], gz, radau->scale);
}

/* The factors of all matrices of a step; the failure of the first that has none.  Large ones are all made in any case: what
 * they leave behind must not depend on how many threads there are. */
static int factorise_all(sd_radau *radau)
{
    factoring all = {radau, {0}};
    int failed = 0;
    if (large(radau))
        sd_side_by_side(radau->method->pairs + 1, factorise_one, &all);
    for (int part = 0; part <= radau->method->pairs && !failed; part++) {
        if (!large(radau))
            factorise_one(&all, part);
        failed = all.failed[part];
        if (part == 0) {
            radau->bad_row = radau->linear->bad_row;
            radau->bad_column = radau->linear->bad_column;
        } else if (failed)
            sd_linear_z_bad(radau->complex_linear[part - 1], &radau->bad_row, &radau->bad_column);
    }
    return failed;
}

/* J, E where they are not old, and the factors of J + gamma/h E and all J + lambda/h E.  Taken at the last accepted point, or
 * at the present guess of the end of the step, where slopes at the start mislead (a valve near rest). */
static int factorise(sd_radau *radau, int at_end)
{
    sd_system *system = radau->system;
    const sd_radau_method *method = radau->method;
    int last = method->stages - 1;
    if (!radau->old_jacobian) {
        double h = radau->h;
        if (at_end) {
            combine(last + 1, radau->n, method->inverse[last], radau->z, radau->rate);
            for (int32_t i = 0; i < radau->n; i++) {
                radau->y[i] = radau->phi[i] + radau->z[last][i];
                radau->rate[i] /= h;
            }
        }
        sd_jacobian(system, at_end ? radau->t + h : radau->t, at_end ? radau->y : radau->phi,
                    at_end ? radau->rate : radau->yd, radau->jy, radau->jyd);
        if (*system->stop)
            return SD_STOPPED;
        int32_t a = sd_first_bad(system->entries, radau->jy), b = sd_first_bad(system->entries, radau->jyd);
        if (a >= 0 || b >= 0) {
            radau->bad_row = system->row[a >= 0 ? a : b];
            return SD_NONFINITE;
        }
        radau->old_jacobian = 1;
    }
    radau->ready = 0;
    radau->factorisations++;
    int failed = factorise_all(radau);
    if (failed)
        return failed == 2 ? SD_MEMORY : SD_SINGULAR;
    radau->h_factored = radau->h;
    radau->ready = 1;
    return SD_FINE;
}

/* d of stage s := its residual, of `system`, by way of y and rate */
static void residual_of(sd_radau *radau, sd_system *system, int s, double *y, double *rate)
{
    const sd_radau_method *method = radau->method;
    double weight[SD_STAGES];
    for (int j = 0; j < method->stages; j++)
        weight[j] = method->inverse[s][j] / radau->h;
    combine(method->stages, radau->n, weight, radau->z, rate);
    for (int32_t i = 0; i < radau->n; i++)
        y[i] = radau->phi[i] + radau->z[s][i];
    sd_residual(system, radau->t + method->c[s] * radau->h, y, rate, radau->d[s]);
}

/* The later half of the stages, in a system beside the radau's own; the others in that. */
static void residual_part(void *context, int part)
{
    sd_radau *radau = context;
    int half = (radau->method->stages + 1) / 2;
    if (part == 0)
        for (int s = 0; s < half; s++)
            residual_of(radau, radau->system, s, radau->y, radau->rate);
    else
        for (int s = half; s < radau->method->stages; s++)
            residual_of(radau, radau->other, s, radau->point_y, radau->point_rate);
}

/* the system and the point that a second thread takes residuals with; 0: there are none */
static int accompanied(sd_radau *radau)
{
    if (!large(radau) || !radau->system->together || sd_threads() < 2)
        return 0;
    if (!radau->beside) {
        radau->beside = sd_beside_new(radau->system);
        radau->point_y = calloc(2 * ((size_t)radau->n + 1), sizeof(double));
        radau->point_rate = radau->point_y + radau->n + 1;
    }
    if (!radau->beside || !radau->point_y)
        return 0;
    radau->other = sd_beside_as(radau->beside, radau->system);
    return 1;
}

/* residuals of the stages into d */
static int residuals(sd_radau *radau)
{
    int32_t n = radau->n;
    int64_t before = radau->system->residual_evaluations;
    int made = accompanied(radau);
    if (made)
        sd_side_by_side(2, residual_part, radau);
    for (int s = 0; s < radau->method->stages; s++) {
        if (!made)
            residual_of(radau, radau->system, s, radau->y, radau->rate);
        radau->system->residual_evaluations = before + s + 1; /* those that are looked at */
        if (*radau->system->stop)
            return SD_STOPPED;
        int32_t bad = sd_first_bad(n, radau->d[s]);
        if (bad >= 0) {
            radau->bad_row = bad;
            return SD_NONFINITE;
        }
    }
    return SD_FINE;
}

/* the last factors left a column */
static int columns_left(const sd_radau *radau)
{
    int left = radau->linear->rank < radau->n;
    for (int k = 0; k < radau->method->pairs; k++)
        left = left || sd_linear_z_rank(radau->complex_linear[k]) < radau->n;
    return left;
}

/* The residuals in d, behind the last correction, are small in every steep row beside the row's own terms: on an
 * exponential a correction says nothing about what it leaves.  Where the factors left a column every row is judged. */
static int rows_hold(sd_radau *radau, double newton_tolerance, int all)
{
    double limit = fmin(1.0, fmax(FINEST_ROW, LAX * newton_tolerance * radau->tolerance));
    int left = columns_left(radau), judged = all || left;
    limit = left ? fmax(limit, FAINT_ROW) : limit;
    for (int s = 0; s < radau->method->stages; s++) {
        for (int32_t i = 0; i < radau->n; i++) {
            radau->y[i] = radau->phi[i] + radau->z[s][i];
            radau->rate[i] = (fabs(radau->y[i]) + radau->magnitude[i]) / radau->h;
        }
        if (sd_first_unmet(radau->system, radau->t + radau->method->c[s] * radau->h, radau->y, radau->rate, radau->d[s], limit,
                           radau->g, radau->scale, judged, radau->terms) >= 0)
            return 0;
    }
    return 1;
}

/* d, w := the right sides of the real system and of the complex ones: S^-1 times minus the residuals in d */
static inline void split(sd_radau *radau, int stages, int pairs)
{
    const sd_radau_method *method = radau->method;
    for (int32_t i = 0; i < radau->n; i++) {
        double r[SD_STAGES];
        for (int j = 0; j < stages; j++)
            r[j] = -radau->d[j][i];
        for (int k = 0; k < pairs; k++) {
            double complex w = method->rows[k][0] * r[0];
            for (int j = 1; j < stages; j++)
                w += method->rows[k][j] * r[j];
            radau->w[k][i] = w;
        }
        double real = method->row[0] * r[0];
        for (int j = 1; j < stages; j++)
            real += method->row[j] * r[j];
        radau->d[0][i] = real;
    }
}

/* z += S times the solutions in d and w; sums of squares of the correction in Newton's weights, over all unknowns and
 * over what carries the state */
static inline void join(sd_radau *radau, int stages, int pairs, double *sum, double *state)
{
    const sd_radau_method *method = radau->method;
    const int32_t *idle = radau->linear->idle;
    for (int32_t i = 0; i < radau->n; i++) {
        double real = radau->d[0][i];
        for (int s = 0; s < stages; s++) {
            double dz = method->column[s] * real;
            for (int k = 0; k < pairs; k++)
                dz += 2.0 * (creal(method->columns[k][s]) * creal(radau->w[k][i]) -
                             cimag(method->columns[k][s]) * cimag(radau->w[k][i]));
            double v = dz * radau->newton_weight[i];
            radau->z[s][i] += dz;
            *sum += v * v;
            if (idle && !idle[i])
                *state += v * v;
        }
    }
}

/* part 0: the real system; part k: that of pair k - 1 */
static void solve_one(void *context, int part)
{
    sd_radau *radau = context;
    if (part == 0)
        sd_linear_solve(radau->linear, radau->d[0]);
    else
        sd_linear_z_solve(radau->complex_linear[part - 1], radau->w[part - 1]);
}

/* One Newton step from the residuals in d; the size of the correction in Newton's weights, and that of what carries the
 * state in state_size. */
static double correct(sd_radau *radau)
{
    int stages = radau->method->stages;
    double all = 0.0, state = 0.0, number = (double)stages * radau->n;
    if (stages == 3)
        split(radau, 3, 1);
    else if (stages == 5)
        split(radau, 5, 2);
    else
        split(radau, 7, 3);
    if (large(radau))
        sd_side_by_side(radau->method->pairs + 1, solve_one, radau);
    else
        for (int part = 0; part <= radau->method->pairs; part++)
            solve_one(radau, part);
    if (stages == 3)
        join(radau, 3, 1, &all, &state);
    else if (stages == 5)
        join(radau, 5, 2, &all, &state);
    else
        join(radau, 7, 3, &all, &state);
    radau->newton_iterations++;
    radau->state_size = sqrt(state / number);
    return radau->n ? sqrt(all / number) : 0.0; /* nothing may move: samples alone */
}

/* of Newton a step */
static int iterations_of(const sd_radau *radau)
{
    return ITERATIONS + MORE * (radau->method->stages - 3);
}

/* Of Newton's corrections in its weights; stages of more have larger round-off */
static double newton_tolerance(const sd_radau *radau)
{
    double least = round_off[radau->method - sd_radau_methods] * DBL_EPSILON / radau->tolerance;
    return fmax(least, fmin(0.03, sqrt(radau->tolerance)));
}

/* Newton's iteration for the stages, with fresh slopes each time where `full`; `retry`: factor of the step where it fails */
static int iterate(sd_radau *radau, int full, int *used, double *retry)
{
    double tolerance = newton_tolerance(radau);
    double before = 0.0, ratio_before = 0.0, trust = 1.0;
    int patient = full || radau->fixed_h > 0.0;
    *retry = 0.5;
    int usual = iterations_of(radau), most = patient ? PATIENT : usual, converged = 0;
    for (int m = 1; m <= most + (radau->system->scales > 0); m++) {
        int cause = residuals(radau);
        if (cause)
            return cause;
        if (converged && rows_hold(radau, tolerance, 0))
            return SD_FINE;
        if (m > most)
            break;
        double size = correct(radau);
        *used = m;
        if (!isfinite(size))
            return SD_NEWTON;
        converged = 0;
        if (m > 1) {
            double ratio = size / before;
            radau->theta = m == 2 ? ratio : sqrt(ratio * ratio_before);
            ratio_before = ratio;
            if (!(radau->theta < SLOW) && !(full && m < PATIENT / 2)) {
                if (size > STAGNANT * tolerance)
                    return SD_NEWTON;
                converged = 1;
            }
            trust = radau->theta < SLOW ? radau->theta / (1.0 - radau->theta) : 1.0 / DBL_EPSILON;
            double end = trust * size * pow(radau->theta, usual - 1 - m) / tolerance;
            if (!converged && !patient && end >= 1.0 && trust * size > tolerance) {
                double far = fmax(1e-4, fmin(20.0, end));
                *retry = 0.8 * pow(far, -1.0 / (radau->method->stages + usual - m));
                return SD_NEWTON;
            }
        }
        before = fmax(size, DBL_MIN);
        /* far up an exponential every correction is small */
        converged = converged || (trust * size <= tolerance && !(full && m == 1));
        if (converged && radau->system->scales == 0)
            return SD_FINE;
        if (full) {
            radau->old_jacobian = 0;
            if ((cause = factorise(radau, 1)))
                return cause;
        }
    }
    return SD_NEWTON;
}

/* z := base + part (z_full - base) */
static void move(sd_radau *radau, double part)
{
    for (int s = 0; s < radau->method->stages; s++)
        for (int32_t i = 0; i < radau->n; i++)
            radau->z[s][i] = radau->base[s][i] + part * radau->full[s][i];
}

/* the part of the correction `full` of size `size` that is taken: the next one with the same factors is smaller
 * (natural monotonicity, Deuflhard 2004); residuals in d.  0: there is none */
static double damped_part(sd_radau *radau, double size)
{
    for (double part = 1.0; part >= LEAST_PART; part *= 0.5) {
        move(radau, part);
        int cause = residuals(radau);
        if (cause == SD_STOPPED)
            return 0.0;
        if (cause == SD_FINE) {
            memcpy(radau->first, radau->d[0], (size_t)radau->n * sizeof(double));
            double next = correct(radau);
            move(radau, part);
            memcpy(radau->d[0], radau->first, (size_t)radau->n * sizeof(double));
            /* up an exponential every correction is as large as the last */
            if (next <= size * (part < 1.0 ? 1.0 - 0.25 * part : 1.0)) {
                radau->theta = next / size;
                return part;
            }
        }
    }
    return 0.0;
}

/* The full correction at the present stages, with fresh slopes: base and full, its size; z has it.  known: d holds the
 * residuals there. */
static int full_correction(sd_radau *radau, int known, double *size)
{
    radau->old_jacobian = 0;
    int cause = factorise(radau, 1);
    if (cause)
        return cause;
    for (int s = 0; s < radau->method->stages; s++)
        memcpy(radau->base[s], radau->z[s], (size_t)radau->n * sizeof(double));
    if (!known && (cause = residuals(radau)))
        return cause;
    *size = correct(radau);
    for (int s = 0; s < radau->method->stages; s++)
        for (int32_t i = 0; i < radau->n; i++)
            radau->full[s][i] = radau->z[s][i] - radau->base[s][i];
    return isfinite(*size) ? SD_FINE : SD_NEWTON;
}

/* Newton's iteration with fresh slopes each time and corrections shortened where they lead astray: for steep laws.  What
 * follows from the state through slopes near round-off does not converge (on the tail of an exponential every correction
 * is 1/a, on its underflow it is noise).  So the state is judged by its correction, the rest by the rows, each in the
 * scale of its terms. */
static int iterate_damped(sd_radau *radau, int *used)
{
    double tolerance = newton_tolerance(radau);
    double size;
    int cause = residuals(radau), known = cause == SD_FINE;
    if (cause == SD_NONFINITE) { /* extrapolated too far: from the last point */
        for (int s = 0; s < radau->method->stages; s++)
            memset(radau->z[s], 0, (size_t)radau->n * sizeof(double));
        cause = SD_FINE;
    }
    for (int m = 1; m <= WALK && cause == SD_FINE; m++) {
        *used = m;
        leave_below(radau, NULL_PIVOT);
        cause = full_correction(radau, known, &size);
        leave_below(radau, LEAST_PIVOT);
        if (cause)
            break;
        if (radau->state_size <= tolerance && residuals(radau) == SD_FINE && rows_hold(radau, tolerance, 1))
            return SD_FINE;
        if (radau->linear->rank < radau->n) {
            for (int s = 0; s < radau->method->stages; s++)
                memcpy(radau->z[s], radau->base[s], (size_t)radau->n * sizeof(double));
            if ((cause = full_correction(radau, 0, &size)))
                break;
        }
        double part = damped_part(radau, fmax(size, DBL_MIN));
        if (part == 0.0 || (m >= DAMPED && part < 1.0))
            return *radau->system->stop ? SD_STOPPED : SD_NEWTON;
        known = 1;
    }
    return cause ? cause : SD_NEWTON;
}

/* error of the step in the weights, filtered once more where it is large after a rejection or at the start */
static int estimate_error(sd_radau *radau, double *error)
{
    int32_t n = radau->n;
    double *v = radau->rate, strict = strictness(radau, radau->method);
    memcpy(radau->y, radau->phi, (size_t)n * sizeof(double));
    for (int again = 0;; again++) {
        combine(radau->method->stages, n, radau->method->estimate, radau->z, v);
        for (int32_t i = 0; i < n; i++)
            v[i] = -v[i] / radau->h;
        sd_residual(radau->system, radau->t, radau->y, v, radau->ee);
        if (*radau->system->stop)
            return SD_STOPPED;
        for (int32_t i = 0; i < n; i++)
            radau->ee[i] = -radau->ee[i];
        sd_linear_solve(radau->linear, radau->ee);
        *error = tested_norm(radau, radau->ee);
        if (!(*error * strict >= 1.0) || again || !(radau->taken == 0 || radau->rejected))
            break;
        for (int32_t i = 0; i < n; i++)
            radau->y[i] = radau->phi[i] + (radau->test[i] >= 0 ? radau->ee[i] : 0.0);
    }
    *error *= strict;
    *error = isfinite(*error) ? fmax(*error, 1e-10) : INFINITY;
    return SD_FINE;
}

/* the step ends at t_end exactly, and never leaves less than its half for the last one */
static void fit_end(sd_radau *radau)
{
    double left = radau->t_end - radau->t;
    if (radau->h >= left * (1.0 - 1e-12))
        radau->h = left;
    else if (2.0 * radau->h > left && radau->taken > 0 && !(radau->fixed_h > 0.0))
        radau->h = 0.5 * left;
}

/* how fast each unknown is pulled back by its own row, in steps */
static void note_pulls(sd_radau *radau)
{
    const sd_system *system = radau->system;
    for (int32_t j = 0; j < radau->n; j++) {
        radau->pull[j] = 0.0;
        if (radau->smooth[j] == SD_UNPULLED)
            continue;
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            if (radau->jyd[e] != 0.0)
                radau->pull[j] = fmax(radau->pull[j], radau->h * fabs(radau->jy[e] / radau->jyd[e]));
    }
}

/* The length of step beside the last one, for each unit of work, that a method would take where its estimate of the
 * last step had been `error`; iterations: Newton's in the last step.  Its contraction grows with the step. */
static double worth(const sd_radau *radau, const sd_radau_method *method, double error, int iterations, int troubled,
                    double *length_taken)
{
    double length = SAFETY * pow(fmax(error, 1e-10), -1.0 / (method->stages + 1));
    double theta = radau->theta, needed = iterations;
    length = fmax(SHRINK, fmin(GROWTH, length));
    if (troubled)
        length = fmin(length, 1.0);
    if (theta > 0.0 && theta < 1.0) {
        length = fmin(length, fmax(FASTEST / theta, 1.0));
        if (length > 1.0)
            needed *= log(theta) / log(fmin(length * theta, FASTEST));
    }
    *length_taken = length;
    return length / (method->stages * (needed + BESIDE));
}

/* The method of the next step, whose size so far is `next`: the one that gets on best for its work, as the decay of
 * Taylor's coefficients in the last step (z) tells the errors of its neighbours; the size of its step. */
static double choose(sd_radau *radau, double next, double error, int iterations, int troubled)
{
    const sd_radau_method *method = radau->method;
    double size[2], length, h = radau->h;
    if (radau->hold > 0)
        radau->hold--;
    if (radau->most_stages == 3 || radau->since < AWHILE || radau->hold > 0)
        return next;
    for (int k = 0; k < 2; k++) {
        combine(method->stages, radau->n, method->taylor[k], radau->z, radau->rate);
        size[k] = tested_norm(radau, radau->rate);
    }
    if (!(size[0] > 0.0) || !isfinite(size[1]))
        return next;
    double best = worth(radau, method, error, iterations, troubled, &length) * CHANGED;
    if (method->stages > 3) {
        const sd_radau_method *lower = method - 1;
        double low = worth(radau, lower, lower->constant * size[0] * strictness(radau, lower), iterations, troubled,
                           &length);
        if (low > best) {
            best = low;
            radau->method = lower;
            next = length * h;
        }
    }
    if (method->stages < radau->most_stages && !troubled) {
        double decay = fmin(size[1] / size[0], 1.0), ratio = (method + 1)->constant / method->constant * decay * decay;
        ratio *= strictness(radau, method + 1) / strictness(radau, method);
        if (worth(radau, method + 1, error * ratio, iterations, 0, &length) > best) {
            radau->method = method + 1;
            next = fmin(length, LONGER) * h;
        }
    }
    if (radau->method != method)
        radau->since = radau->ready = 0;
    return next;
}

/* the new point, and the next step's size */
static void accept(sd_radau *radau, double error, int iterations, int troubled)
{
    size_t size = (size_t)radau->n * sizeof(double);
    const sd_radau_method *method = radau->method;
    double h = radau->h, power = power_of(radau);
    int usual = iterations_of(radau);
    double limit = fmin(SAFETY, SAFETY * (1 + 2 * usual) / (iterations + 2 * usual));
    double ratio = fmax(1.0 / GROWTH, fmin(1.0 / SHRINK, pow(error, power) / limit));
    if (radau->taken > 0 && radau->since > 0) { /* Gustafsson's predictive controller */
        double predicted = radau->h_accepted / h * pow(error * error / radau->error_accepted, power) / SAFETY;
        ratio = fmax(ratio, fmax(1.0 / GROWTH, fmin(1.0 / SHRINK, predicted)));
    }
    radau->h_accepted = h;
    radau->error_accepted = fmax(1e-2, error);
    double next = h / ratio;
    if (radau->rejected)
        next = fmin(next, h);
    radau->longest = fmax(radau->longest, h);
    radau->growth = troubled ? 1.0 : radau->growth * REGAIN;
    if (radau->system->scales > 0 && !radau->pressed) /* where they bend, the estimate says nothing of Newton's reach */
        next = fmin(next, fmin(radau->growth, GROWTH) * h);
    radau->since++;
    if (!(radau->fixed_h > 0.0))
        next = choose(radau, next, error, iterations, troubled);
    double *oldest = radau->before, *slope = radau->slope[2];
    radau->before = radau->last;
    radau->last = oldest;
    memcpy(radau->last, radau->phi, size);
    for (int k = 2; k > 0; k--) {
        radau->slope[k] = radau->slope[k - 1];
        radau->refined[k] = radau->refined[k - 1];
    }
    radau->slope[0] = slope;
    radau->refined[0] = 0;
    radau->h_before = radau->h_used;
    radau->h_used = h;
    note_pulls(radau);
    for (int s = 0; s < method->stages; s++) {
        combine(method->stages, radau->n, method->inverse[s], radau->z, radau->stage_d[s]);
        for (int32_t i = 0; i < radau->n; i++) {
            radau->stage[s][i] = radau->phi[i] + radau->z[s][i];
            radau->stage_d[s][i] /= h;
        }
    }
    memcpy(radau->phi, radau->stage[method->stages - 1], size);
    memcpy(radau->yd, radau->stage_d[method->stages - 1], size);
    memcpy(radau->slope[0], radau->yd, size);
    for (int s = 0; s < method->stages; s++) {
        double *swap = radau->kept[s];
        radau->kept[s] = radau->z[s];
        radau->z[s] = swap;
    }
    radau->used = method;
    show_nodes(radau);
    double t = radau->t + h;
    radau->t = fabs(radau->t_end - t) <= 1e-12 * h ? radau->t_end : t;
    radau->steps++;
    radau->taken++;
    radau->rejected = 0;
    /* the Jacobian lasts while Newton converges fast; the factors while the step hardly changes */
    if (radau->theta > GOOD)
        radau->old_jacobian = radau->ready = 0;
    if (radau->fixed_h > 0.0)
        radau->h = radau->fixed_h;
    else if (!(radau->ready && next / h >= KEEP_LOW && next / h <= KEEP_HIGH))
        radau->h = fmin(next, radau->h_max);
}

/* the new point moved onto every constraint, and q' with f */
static void project(sd_radau *radau)
{
    size_t size = (size_t)radau->n * sizeof(double);
    memcpy(radau->point, radau->phi, size);
    memcpy(radau->point_d, radau->yd, size);
    if (sd_settle_point(radau->project, radau->t, radau->point, radau->point_d))
        return;
    memcpy(radau->phi, radau->point, size);
    for (int32_t i = 0; i < radau->n; i++)
        if (radau->smooth[i])
            radau->slope[0][i] = radau->yd[i] = radau->point_d[i];
}

int sd_radau_step(sd_radau *radau)
{
    int singular = 0, iterations = 0, failures = 0, leap = 0;
    double retry = 0.5, error = 0.0;
    set_weights(radau);
    radau->cause = SD_FINE;
    for (;;) {
        fit_end(radau);
        double left = radau->t_end - radau->t;
        if (radau->h < 4.0 * DBL_EPSILON * fmax(fabs(radau->t), SD_SHORT * left) && radau->h < left) {
            radau->cause = radau->cause ? radau->cause : SD_STEP;
            return radau->cause;
        }
        set_newton_weights(radau);
        int cause = SD_FINE;
        retry = 0.5;
        int fresh = !radau->old_jacobian;
        sd_radau_extrapolate(radau, radau->h);
        if (!radau->ready || radau->h != radau->h_factored)
            cause = factorise(radau, failures > 0 || leap == 1);
        if (cause == SD_FINE) {
            radau->theta = 0.0; /* one iteration: the Jacobian is good enough */
            cause = iterate(radau, failures > 1 || leap == 1, &iterations, &retry);
        }
        radau->pressed |= radau->h < PRESSED * radau->longest && radau->h < 0.5 * left;
        int stuck = cause == SD_NEWTON || cause == SD_NONFINITE || cause == SD_SINGULAR;
        if (stuck && leap != 1 && (failures >= LENGTHS || radau->pressed) && radau->system->scales > 0) {
            if (radau->method != sd_radau_methods) /* shortened corrections of more stages are dear */
                radau->since = 0;
            radau->method = sd_radau_methods;
            radau->hold = SHORTENED;
            sd_radau_extrapolate(radau, radau->h);
            cause = iterate_damped(radau, &iterations);
            fresh = 1;
        }
        if (cause == SD_FINE && !(radau->fixed_h > 0.0)) {
            cause = estimate_error(radau, &error);
            if (cause == SD_FINE && error < 1.0 && radau->system->scales > 0 && sd_radau_astray(radau))
                error = ASTRAY;
            if (cause == SD_FINE && !(error < 1.0))
                cause = SD_ERROR_TEST;
        }
        if (cause == SD_FINE)
            break;
        radau->cause = cause;
        if (cause == SD_STOPPED || cause == SD_MEMORY || radau->fixed_h > 0.0)
            return cause;
        if (cause == SD_ERROR_TEST) {
            radau->rejected_steps++;
            radau->rejected = 1;
            int usual = iterations_of(radau);
            double limit = fmin(SAFETY, SAFETY * (1 + 2 * usual) / (iterations + 2 * usual));
            double ratio = fmin(1.0 / SHRINK, pow(error, power_of(radau)) / limit);
            radau->h *= radau->taken == 0 ? 0.1 : isfinite(ratio) ? 1.0 / fmax(ratio, 1.0) : SHRINK;
        } else {
            radau->newton_failures++;
            radau->ready = 0;
            if (cause == SD_SINGULAR && ++singular >= SINGULAR)
                return cause;
            if (cause == SD_NEWTON && !fresh) {
                radau->old_jacobian = 0; /* once more with fresh slopes */
                continue;
            }
            if (leap == 1) {
                radau->h /= LEAP;
                leap = 2;
            } else if (leap == 0 && radau->creeping >= CREEPS && cause == SD_NEWTON) {
                radau->h *= LEAP;
                radau->old_jacobian = 0;
                leap = 1;
                continue;
            }
            radau->h *= cause == SD_NEWTON ? retry : 0.25;
            if (++failures > 2)
                radau->h *= 0.5;
            if (failures >= FEWER && radau->method->stages > 3) {
                radau->method--;
                radau->since = 0;
            }
            radau->old_jacobian = 0;
            radau->rejected = 1;
        }
    }
    radau->cause = SD_FINE;
    radau->creeping = failures > 0 && error < IDLE ? radau->creeping + 1 : 0;
    accept(radau, error, iterations, failures > 0);
    if (radau->project)
        project(radau);
    return SD_FINE;
}
