/* The systems of a Newton step of Radau IIA: matrices and factors, residuals of the stages, corrections. */
#include "system/condensed.h"
#include "linear/lanes.h"
#include "steppers/combine.h"
#include "steppers/radau/radau.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LARGE 10000 /* unknowns from which on the room of matrices counts */
#define LEAN 0.01 /* part of the slope at zero that a faint one gets */

SD_WIDE void sd_radau_combine(int stages, int32_t n, const double *weight, double *const *v, double *out)
{
    if (stages == 3)
        sd_combine(3, n, weight, v, out);
    else if (stages == 5)
        sd_combine(5, n, weight, v, out);
    else
        sd_combine(7, n, weight, v, out);
}

int sd_radau_sparing(const sd_radau *radau)
{
    return radau->ivp.n >= LARGE && radau->ivp.system->scales == 0 && radau->linear->sparse;
}

/* of columns: where pivots are left out they are small or not beside the unknowns themselves, as large as they are at the
 * stages (`terms`), whatever the step */
static const double *column_scale(const sd_radau *radau)
{
    return radau->linear->null_pivot > SD_LEAST_PIVOT ? radau->terms : radau->scale;
}

/* terms := the same: a node that a source only begins to move is not as small as it was (its row, of the leaks of diodes,
 * counted for more than the resistor that grounds the others) */
static void size_columns(sd_radau *radau)
{
    for (int32_t i = 0; i < radau->ivp.n; i++) {
        double most = radau->ivp.magnitude[i];
        for (int s = 0; s < radau->method->stages; s++)
            most = fmax(most, fabs(radau->phi[i] + radau->z[s][i]));
        radau->terms[i] = most;
    }
}

/* part 0: J + gamma/h E and its factors; part k: those of J + lambda/h E of pair k - 1 */
static int factorise_one(sd_radau *radau, int part)
{
    const sd_radau_method *method = radau->method;
    int32_t entries = radau->ivp.system->entries;
    const double *scale = column_scale(radau);
    if (sd_radau_sparing(radau))
        return part ? sd_linear_z_factor_sum(radau->complex_linear[part - 1]) : sd_linear_factor_sum(radau->linear);
    if (part == 0) {
        double real = method->gamma / radau->ivp.h;
        for (int32_t e = 0; e < entries; e++)
            radau->g[e] = radau->jy[e] + real * radau->jyd[e];
        return sd_linear_factor(radau->linear, radau->g, scale);
    }
    double complex both = method->lambda[part - 1] / radau->ivp.h;
    double complex *gz = sd_linear_z_values(radau->complex_linear[part - 1]);
    for (int32_t e = 0; e < entries; e++)
        gz[e] = radau->jy[e] + both * radau->jyd[e];
    return sd_linear_z_factor(radau->complex_linear[part - 1], gz, scale);
}

/* the same scales for all matrices of a step, which nobody changes while they are factorised */
static void scale_all(sd_radau *radau)
{
    const sd_radau_method *method = radau->method;
    const double real = method->gamma / radau->ivp.h, *scale = column_scale(radau);
    sd_linear_scale_sum(radau->linear, radau->jy, radau->jyd, radau->at, &real, scale);
    for (int k = 0; k < method->pairs; k++) {
        const double complex both = method->lambda[k] / radau->ivp.h;
        sd_linear_z_scale_sum(radau->complex_linear[k], radau->jy, radau->jyd, radau->at, &both, scale);
    }
}

/* The factors of all matrices of a step; the failure of the first that has none. */
static int factorise_all(sd_radau *radau)
{
    int failed = 0;
    if (column_scale(radau) != radau->scale)
        size_columns(radau);
    if (sd_radau_sparing(radau))
        scale_all(radau);
    for (int part = 0; part <= radau->method->pairs && !failed; part++) {
        failed = factorise_one(radau, part);
        if (part == 0) {
            radau->ivp.bad_row = radau->linear->bad_row;
            radau->ivp.bad_column = radau->linear->bad_column;
        } else if (failed)
            sd_linear_z_bad(radau->complex_linear[part - 1], &radau->ivp.bad_row, &radau->ivp.bad_column);
    }
    return failed;
}

int sd_radau_factored(const sd_radau *radau)
{
    return fabs(radau->ivp.h - radau->h_factored) <= SD_SLACK * radau->ivp.h;
}

/* A^-1 / h, of the step and the method at hand */
static void set_lead(sd_radau *radau)
{
    if (radau->h_lead == radau->ivp.h && radau->of_lead == radau->method)
        return;
    for (int s = 0; s < radau->method->stages; s++)
        for (int j = 0; j < radau->method->stages; j++)
            radau->lead[s][j] = radau->method->inverse[s][j] / radau->ivp.h;
    radau->h_lead = radau->ivp.h;
    radau->of_lead = radau->method;
}

SD_WIDE void sd_radau_stage(sd_radau *radau, int s, double *y, double *rate)
{
    set_lead(radau);
    sd_radau_combine(radau->method->stages, radau->ivp.n, radau->lead[s], radau->z, rate);
    for (int32_t i = 0; i < radau->ivp.n; i += SD_LANES)
        SD_AT(y, i) = SD_FROM(radau->phi, i) + SD_FROM(radau->z[s], i);
}

/* sd_jacobian, for which right sides, which nobody knows yet, are room for the slopes of a whole system that has none */
static int32_t slopes(sd_radau *radau, double t, const double *y, const double *yd)
{
    sd_condensed *kept = sd_radau_sparing(radau) ? (sd_condensed *)radau->ivp.system->left : NULL;
    double *own = kept ? kept->slope : NULL;
    size_t room = (size_t)(radau->d[1] - radau->d[0]) * (size_t)radau->most_stages;
    if (kept && !own && y == radau->phi && (size_t)kept->full->entries < room)
        kept->slope = radau->d[0];
    int32_t bad = sd_jacobian(radau->ivp.system, t, y, yd, radau->ivp.magnitude, radau->jy, radau->jyd);
    if (kept)
        kept->slope = own;
    return bad;
}

/* J, E where they are not old, and the factors of J + gamma/h E and all J + lambda/h E.  Taken at the last accepted point, or
 * at the present guess of the end of the step, where slopes at the start mislead (a valve near rest). */
int sd_radau_factorise(sd_radau *radau, int at_end)
{
    sd_system *system = radau->ivp.system;
    radau->old_jacobian |= radau->lasting;
    if (!radau->old_jacobian) {
        if (sd_radau_room_for_slopes(radau))
            return SD_MEMORY;
        if (at_end)
            sd_radau_stage(radau, radau->method->stages - 1, radau->y, radau->rate);
        int32_t bad = slopes(radau, at_end ? radau->ivp.t + radau->ivp.h : radau->ivp.t, at_end ? radau->y : radau->phi,
                             at_end ? radau->rate : radau->yd);
        if (*system->stop)
            return SD_STOPPED;
        if (bad >= 0) {
            radau->ivp.bad_row = bad;
            return SD_NONFINITE;
        }
        sd_radau_share_slopes(radau);
        radau->old_jacobian = 1;
        radau->lasting = system->steady;
    }
    radau->ready = 0;
    int failed = factorise_all(radau);
    if (failed)
        return failed == 2 ? SD_MEMORY : SD_SINGULAR;
    if (!sd_radau_sparing(radau) && (failed = sd_outgrown(&radau->ivp, radau->linear, radau->jy, radau->jyd,
                                                          radau->method->gamma / radau->ivp.h, radau->g, column_scale(radau))))
        return failed;
    radau->h_factored = radau->ivp.h;
    radau->ready = 1;
    return SD_FINE;
}

/* dF/dy where all unknowns are zero; 0: no memory, or slopes that are no numbers there */
static int find_at_zero(sd_radau *radau)
{
    if (radau->at_zero)
        return radau->open != NULL;
    size_t entries = (size_t)radau->ivp.system->entries;
    radau->at_zero = malloc((2 * entries + 1) * sizeof *radau->at_zero);
    radau->open = malloc((size_t)radau->ivp.n + 1);
    if (!radau->at_zero || !radau->open)
        return 0;
    memset(radau->y, 0, (size_t)radau->ivp.n * sizeof(double));
    memset(radau->rate, 0, (size_t)radau->ivp.n * sizeof(double));
    if (sd_jacobian(radau->ivp.system, radau->ivp.t, radau->y, radau->rate, radau->ivp.magnitude, radau->at_zero,
                    radau->at_zero + entries) < 0)
        return 1;
    free(radau->open);
    radau->open = NULL;
    return 0;
}

/* radau->open := the columns `where` slopes lean; 0: none */
static int mark_open(sd_radau *radau, int where)
{
    const sd_linear *linear = radau->linear;
    if (where == SD_WHERE_LEFT && linear->rank == radau->ivp.n)
        return 0;
    if (!linear->idle || !find_at_zero(radau))
        return 0;
    if (where == SD_WHERE_LEFT)
        sd_linear_left(linear, radau->open);
    for (int32_t j = 0; j < radau->ivp.n && where == SD_WHERE_IDLE; j++)
        radau->open[j] = linear->idle[j] != 0;
    return 1;
}

/* Where slopes are so faint that nothing determines a column, those of steep rows lean on what they are at zero, in these
 * columns alone: the node between two diodes that block moves by their leakage, and rows without a steep law hold.  (A column
 * that is left leaves a row over, and any: charges of a node did not add up.)  The residuals are as before. */
int sd_radau_lean(sd_radau *radau, int where)
{
    if (!mark_open(radau, where))
        return SD_FINE;
    const sd_system *system = radau->ivp.system;
    sd_steep_terms(radau->ivp.system, radau->ivp.t, radau->phi, radau->yd, radau->terms);
    for (int32_t j = 0; j < radau->ivp.n; j++)
        for (int32_t e = system->column[j]; e < system->column[j + 1] && radau->open[j]; e++)
            if (radau->terms[system->row[e]] != 0.0)
                radau->jy[e] += LEAN * (radau->at_zero[e] - radau->jy[e]);
    sd_radau_leave_below(radau, SD_LEAST_PIVOT);
    return sd_radau_factorise(radau, 1);
}

static void residual_in_place(sd_radau *radau, int s, double t)
{
    sd_system *system = radau->ivp.system;
    const sd_condensed *left = (const sd_condensed *)system->left;
    double *d = radau->d[s];
    for (int32_t i = 0; i < radau->ivp.n; i++)
        d[i] = radau->phi[i] + radau->z[s][i];
    sd_condensed_place(left, d);
    sd_radau_combine(radau->method->stages, radau->ivp.n, radau->lead[s], radau->z, d);
    sd_condensed_place_rates(left, d);
    sd_condensed_rows(left, t, d, d);
    system->residual_evaluations++;
}

/* d of stage s := its residual, by way of y and rate */
static void residual_of(sd_radau *radau, int s)
{
    const double t = radau->ivp.t + radau->method->c[s] * radau->ivp.h;
    if (radau->in_place)
        residual_in_place(radau, s, t);
    else {
        sd_radau_stage(radau, s, radau->y, radau->rate);
        sd_residual(radau->ivp.system, t, radau->y, radau->rate, radau->d[s]);
    }
    for (int32_t i = radau->ivp.n; i < sd_whole_lanes(radau->ivp.n); i++)
        radau->d[s][i] = 0.0; /* others have worked there */
}

/* residuals of the stages into d */
int sd_radau_residuals(sd_radau *radau)
{
    int32_t n = radau->ivp.n;
    int64_t before = radau->ivp.system->residual_evaluations;
    set_lead(radau);
    for (int s = 0; s < radau->method->stages; s++) {
        residual_of(radau, s);
        radau->ivp.system->residual_evaluations = before + s + 1; /* those that are looked at */
        if (*radau->ivp.system->stop)
            return SD_STOPPED;
        if (!sd_finite(n, radau->d[s])) {
            radau->ivp.bad_row = sd_first_bad(n, radau->d[s]);
            return SD_NONFINITE;
        }
    }
    return SD_FINE;
}

/* real and imaginary parts of four complex numbers, and back */
static inline __attribute__((always_inline)) void parts(const double complex *w, sd_lanes *re, sd_lanes *im)
{
    const double *at = (const double *)w;
    const sd_lanes one = SD_FROM(at, 0), two = SD_FROM(at, SD_LANES);
    *re = (sd_lanes){one[0], one[2], two[0], two[2]};
    *im = (sd_lanes){one[1], one[3], two[1], two[3]};
}

static inline __attribute__((always_inline)) void join_parts(sd_lanes re, sd_lanes im, double complex *w)
{
    double *at = (double *)w;
    SD_AT(at, 0) = (sd_lanes){re[0], im[0], re[1], im[1]};
    SD_AT(at, SD_LANES) = (sd_lanes){re[2], im[2], re[3], im[3]};
}

/* d, w := the right sides of the real system and of the complex ones: S^-1 times minus the residuals in d.  In whole lanes,
 * for which all vectors have room. */
static inline __attribute__((always_inline)) void split(sd_radau *radau, int stages, int pairs)
{
    const sd_radau_method *method = radau->method;
    for (int32_t i = 0; i < radau->ivp.n; i += SD_LANES) {
        sd_lanes r[SD_STAGES];
        for (int j = 0; j < stages; j++)
            r[j] = -SD_FROM(radau->d[j], i);
        for (int k = 0; k < pairs; k++) {
            sd_lanes re = creal(method->rows[k][0]) * r[0], im = cimag(method->rows[k][0]) * r[0];
            for (int j = 1; j < stages; j++) {
                re += creal(method->rows[k][j]) * r[j];
                im += cimag(method->rows[k][j]) * r[j];
            }
            join_parts(re, im, radau->w[k] + i);
        }
        sd_lanes real = method->row[0] * r[0];
        for (int j = 1; j < stages; j++)
            real += method->row[j] * r[j];
        SD_AT(radau->d[0], i) = real;
    }
}

/* sum of the squares of v at i, of what carries the state alone */
static inline double squares_of_state(const sd_radau *radau, int32_t i, sd_lanes v)
{
    const int32_t *idle = radau->linear->idle;
    double sum = 0.0;
    for (int32_t l = 0; l < SD_LANES && i + l < radau->ivp.n; l++)
        sum += idle[i + l] ? 0.0 : v[l] * v[l];
    return sum;
}

/* four of Newton's weights, zeros behind the last */
static inline __attribute__((always_inline)) void newton_weights(const sd_radau *radau, int32_t i, sd_lanes *weight)
{
    const double part = radau->tolerance;
    if (radau->newton_weight)
        *weight = SD_FROM(radau->newton_weight, i);
    else if (i + SD_LANES <= radau->ivp.n)
        *weight = 1.0 / (part * SD_FROM(radau->ivp.magnitude, i) + part * SD_SIZES(SD_FROM(radau->phi, i)));
    else
        for (int32_t l = 0; l < SD_LANES; l++)
            (*weight)[l] = i + l < radau->ivp.n ? sd_radau_weight(radau, i + l) : 0.0;
}

/* z += S times the solutions in d and w; sums of squares of the correction in Newton's weights, over all unknowns and, where
 * some are idle, over what carries the state */
static inline __attribute__((always_inline)) void join(sd_radau *radau, int stages, int pairs, sd_lanes *sum, double *state)
{
    const sd_radau_method *method = radau->method;
    for (int32_t i = 0; i < radau->ivp.n; i += SD_LANES) {
        sd_lanes weight;
        newton_weights(radau, i, &weight);
        sd_lanes real = SD_FROM(radau->d[0], i), re[SD_PAIRS], im[SD_PAIRS];
        for (int k = 0; k < pairs; k++)
            parts(radau->w[k] + i, &re[k], &im[k]);
        for (int s = 0; s < stages; s++) {
            sd_lanes dz = method->column[s] * real;
            for (int k = 0; k < pairs; k++)
                dz += 2.0 * (creal(method->columns[k][s]) * re[k] - cimag(method->columns[k][s]) * im[k]);
            sd_lanes v = dz * weight;
            SD_AT(radau->z[s], i) += dz;
            *sum += v * v;
            if (radau->linear->idle)
                *state += squares_of_state(radau, i, v);
        }
    }
}

static SD_WIDE void split_all(sd_radau *radau)
{
    if (radau->method->stages == 3)
        split(radau, 3, 1);
    else if (radau->method->stages == 5)
        split(radau, 5, 2);
    else
        split(radau, 7, 3);
}

static SD_WIDE void join_all(sd_radau *radau, double *all, double *state)
{
    sd_lanes sum = {0.0};
    if (radau->method->stages == 3)
        join(radau, 3, 1, &sum, state);
    else if (radau->method->stages == 5)
        join(radau, 5, 2, &sum, state);
    else
        join(radau, 7, 3, &sum, state);
    *all = SD_TOTAL(sum);
}

double sd_radau_state_moved(const sd_radau *radau)
{
    const sd_radau_method *method = radau->method;
    double sum = 0.0;
    for (int32_t i = 0; i < radau->ivp.n; i++)
        for (int s = 0; s < method->stages && radau->smooth[i]; s++) {
            double dz = method->column[s] * radau->d[0][i];
            for (int k = 0; k < method->pairs; k++)
                dz += 2.0 * creal(method->columns[k][s] * radau->w[k][i]);
            double v = dz * sd_radau_newton_weight(radau, i);
            sum += v * v;
        }
    return radau->ivp.n ? sqrt(sum / ((double)method->stages * radau->ivp.n)) : 0.0;
}

/* One Newton step from the residuals in d; the size of the correction in Newton's weights, and that of what carries the
 * state in state_size. */
double sd_radau_correct(sd_radau *radau)
{
    double all = 0.0, state = 0.0, number = (double)radau->method->stages * radau->ivp.n;
    split_all(radau);
    sd_linear_solve(radau->linear, radau->d[0]);
    for (int k = 0; k < radau->method->pairs; k++)
        sd_linear_z_solve(radau->complex_linear[k], radau->w[k]);
    join_all(radau, &all, &state);
    radau->state_size = sqrt(state / number);
    return radau->ivp.n ? sqrt(all / number) : 0.0; /* nothing may move: samples alone */
}
