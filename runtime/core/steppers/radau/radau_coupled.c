/* Newton's iteration for all stages of a step of Radau IIA at once, each with slopes of its own (see radau.h).
 *
 * Towards a position in which constraints lose rank the slopes at a step's start fade in one direction, and beyond it they
 * have turned: Newton's iteration with them fails for every step that reaches the position, and steps that may not reach it
 * shrink for ever.  The equations of all stages together are regular for a step that passes over it. */
#include "linear/dense/dense.h"
#include "steppers/radau/radau.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LARGEST 64      /* unknowns: factors are dense */
#define ALIGNED 0.9     /* cosine between corrections that have one direction, there or back */
#define ITERATIONS 15
#define ASIDE 3         /* of these that may lead away before they come near */
#define STAGNANT 0.1    /* a correction over the one before: with slopes of the point only round-off is left */

/* The matrix of all stages [stages n]: in the place of stage i and stage j A^-1_ij / h E_i, on the diagonal + J_i. */
typedef struct sd_coupled {
    int32_t stages, all; /* all: stages n */
    int32_t *column, *row;
    double *values, *scale, *right, *other; /* scale, right, other [all] */
    sd_linear *linear;
} sd_coupled;

void sd_radau_free_coupled(sd_coupled *coupled)
{
    if (!coupled)
        return;
    sd_linear_free(coupled->linear);
    free(coupled->column);
    free(coupled->values);
    free(coupled);
}

/* the pattern of the system, once for each pair of stages; 0: no memory */
static int arrange(sd_coupled *coupled, const sd_system *system)
{
    const int32_t n = system->unknowns;
    const size_t all = (size_t)coupled->all, entries = (size_t)coupled->stages * (size_t)coupled->stages * (size_t)system->entries;
    coupled->column = malloc((all + 1 + entries) * sizeof *coupled->column);
    coupled->values = calloc(entries + 3 * all + 1, sizeof *coupled->values);
    if (!coupled->column || !coupled->values)
        return 0;
    coupled->row = coupled->column + all + 1;
    coupled->scale = coupled->values + entries;
    coupled->right = coupled->scale + all;
    coupled->other = coupled->right + all;
    int32_t e = 0;
    for (int32_t k = 0; k < coupled->all; k++) {
        coupled->column[k] = e;
        for (int32_t i = 0; i < coupled->stages; i++)
            for (int32_t own = system->column[k % n]; own < system->column[k % n + 1]; own++)
                coupled->row[e++] = i * n + system->row[own];
    }
    coupled->column[coupled->all] = e;
    coupled->linear = sd_linear_new(coupled->all, coupled->column, coupled->row, NULL);
    return coupled->linear != NULL;
}

/* of as many stages as the step has, made when first needed; NULL: no memory */
static sd_coupled *coupled_of(sd_radau *radau)
{
    if (radau->coupled && radau->coupled->stages == radau->method->stages)
        return radau->coupled;
    sd_radau_free_coupled(radau->coupled);
    sd_coupled *coupled = radau->coupled = calloc(1, sizeof *coupled);
    if (!coupled)
        return NULL;
    coupled->stages = radau->method->stages;
    coupled->all = coupled->stages * radau->ivp.n;
    if (!arrange(coupled, radau->ivp.system)) {
        sd_radau_free_coupled(coupled);
        radau->coupled = NULL;
    }
    return radau->coupled;
}

/* to [all] := the stages one behind the other */
static void copy_stages(const sd_radau *radau, double *to)
{
    for (int s = 0; s < radau->method->stages; s++)
        memcpy(to + s * radau->ivp.n, radau->z[s], (size_t)radau->ivp.n * sizeof *to);
}

/* step [all] := what the stages have moved by since they were there, in Newton's weights */
static void since(const sd_radau *radau, double *step)
{
    for (int s = 0; s < radau->method->stages; s++)
        for (int32_t k = 0; k < radau->ivp.n; k++)
            step[s * radau->ivp.n + k] = (radau->z[s][k] - step[s * radau->ivp.n + k]) * sd_radau_newton_weight(radau, k);
}

/* Whether two corrections by the factors at hand, from the extrapolated stages on, have one direction: it is all that is wrong
 * with these slopes. */
static int aligned(sd_radau *radau, sd_coupled *coupled)
{
    double *const steps[] = {coupled->right, coupled->other};
    sd_radau_extrapolate(radau, radau->ivp.h);
    for (int m = 0; m < 2; m++) {
        copy_stages(radau, steps[m]);
        if (sd_radau_residuals(radau))
            return 0;
        sd_radau_correct(radau);
        since(radau, steps[m]);
    }
    double one = sd_dot(coupled->all, steps[0], steps[0]), two = sd_dot(coupled->all, steps[1], steps[1]);
    double along = sd_dot(coupled->all, steps[0], steps[1]);
    return (radau->turned ? fabs(along) : along) >= ALIGNED * sqrt(one * two);
}

/* the entries of the rows of stage i, at its present point */
static int fill(sd_radau *radau, sd_coupled *coupled, int i)
{
    sd_system *system = radau->ivp.system;
    double t = radau->ivp.t + radau->method->c[i] * radau->ivp.h;
    if (sd_radau_room_for_slopes(radau))
        return SD_MEMORY;
    sd_radau_stage(radau, i, radau->y, radau->rate);
    int32_t bad = sd_jacobian(system, t, radau->y, radau->rate, radau->ivp.magnitude, radau->jy, radau->jyd);
    radau->old_jacobian = 0;
    if (*system->stop)
        return SD_STOPPED;
    if (bad >= 0) {
        radau->ivp.bad_row = bad;
        return SD_NONFINITE;
    }
    for (int32_t k = 0; k < coupled->all; k++) {
        const int32_t j = k / radau->ivp.n, own = k % radau->ivp.n;
        const int32_t first = system->column[own], number = system->column[own + 1] - first;
        double *to = coupled->values + coupled->column[k] + i * number;
        for (int32_t e = 0; e < number; e++)
            to[e] = radau->lead[i][j] * radau->jyd[first + e] + (i == j ? radau->jy[first + e] : 0.0);
    }
    return SD_FINE;
}

/* root mean square of the last correction in Newton's weights, over all unknowns or those that the error test judges */
static double size_of(const sd_radau *radau, const sd_coupled *coupled, int judged)
{
    double sum = 0.0, number = 0.0;
    for (int32_t k = 0; k < coupled->all; k++)
        if (!judged || radau->ivp.test[k % radau->ivp.n] >= 0) {
            sum += coupled->other[k] * coupled->other[k];
            number++;
        }
    return sqrt(sum / fmax(number, 1.0));
}

/* a correction from the residuals in d, by the slopes of each stage: `other` */
static int correct(sd_radau *radau, sd_coupled *coupled)
{
    const int32_t n = radau->ivp.n;
    for (int i = 0; i < coupled->stages; i++) {
        int cause = fill(radau, coupled, i);
        if (cause)
            return cause;
        for (int32_t k = 0; k < n; k++)
            coupled->right[i * n + k] = -radau->d[i][k];
    }
    int failed = sd_linear_factor(coupled->linear, coupled->values, coupled->scale);
    if (failed)
        return failed == 2 ? SD_MEMORY : SD_NEWTON;
    sd_linear_solve(coupled->linear, coupled->right);
    copy_stages(radau, coupled->other);
    for (int i = 0; i < coupled->stages; i++)
        for (int32_t k = 0; k < n; k++)
            radau->z[i][k] += coupled->right[i * n + k];
    since(radau, coupled->other);
    return sd_finite(coupled->all, coupled->other) ? SD_FINE : SD_NEWTON;
}

/* whether the rows are met behind the last correction, beside their terms: slopes times unknowns */
static int rows_hold(sd_radau *radau, sd_coupled *coupled, double tolerance)
{
    const int32_t n = radau->ivp.n;
    const double limit = sd_radau_row_limit(radau, tolerance);
    double *terms = coupled->right;
    if (sd_radau_residuals(radau))
        return 0;
    memset(terms, 0, (size_t)coupled->all * sizeof *terms);
    for (int32_t k = 0; k < coupled->all; k++) {
        const double y = radau->phi[k % n] + radau->z[k / n][k % n];
        for (int32_t e = coupled->column[k]; e < coupled->column[k + 1]; e++)
            terms[coupled->row[e]] += fabs(coupled->values[e] * y);
    }
    for (int32_t k = 0; k < coupled->all; k++)
        if (!(fabs(radau->d[k / n][k % n]) <= limit * terms[k]))
            return 0;
    return 1;
}

int sd_radau_iterate_coupled(sd_radau *radau, int *used)
{
    if (radau->ivp.n > LARGEST)
        return SD_NEWTON;
    sd_coupled *coupled = coupled_of(radau);
    if (!coupled)
        return SD_MEMORY;
    if (!aligned(radau, coupled))
        return SD_NEWTON;
    for (int i = 0; i < coupled->stages; i++)
        memcpy(coupled->scale + i * radau->ivp.n, radau->scale, (size_t)radau->ivp.n * sizeof(double));
    double before = INFINITY, tolerance = sd_radau_newton_tolerance(radau);
    sd_radau_extrapolate(radau, radau->ivp.h);
    for (int m = 1; m <= ITERATIONS; m++) {
        int cause = sd_radau_residuals(radau);
        if (!cause)
            cause = correct(radau, coupled);
        *used = m;
        if (cause)
            return cause;
        double size = size_of(radau, coupled, 0);
        if (size <= tolerance) /* it falls with the square of the one before */
            return SD_FINE;
        /* multipliers of constraints that fade are known to a round-off that grows, what they do to the rows is not */
        int idle = size > STAGNANT * before && size_of(radau, coupled, 1) <= tolerance;
        if (idle && rows_hold(radau, coupled, tolerance))
            return SD_FINE;
        if (m > ASIDE && !(size < before))
            return SD_NEWTON;
        before = size;
    }
    return SD_NEWTON;
}
