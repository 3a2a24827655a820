/* Branches of a holonomic constraint: see branches.h. */
#include "run/branches.h"
#include "system/condensed.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOVED 0.01     /* of the magnitude of an unknown, behind which normals are taken anew */
#define SHORT 0.3      /* of the longest: where normals are that short every step is looked at */
#define HALVINGS 30    /* of the chord: branches that are a millionth of it apart are told from one curve */
#define LARGER 0.63    /* the larger part of a chord that is parted, at most */
#define APART 16.0     /* parts of the chord that are left: points further from each other are of two branches */
#define CORRECTIONS 12 /* onto the constraints, from the middle of a chord */
#define CLOSE 1e-10    /* of magnitudes: the last of these corrections */

sd_branches *sd_branches_new(sd_settle *settle, const sd_stepper *stepper, int32_t extended, int32_t row)
{
    const int32_t n = (extended > stepper->n ? extended : stepper->n) + 8;
    const size_t unknowns = (size_t)settle->unknowns, entries = (size_t)settle->system->entries;
    const size_t rows = (size_t)sd_whole_lanes(settle->rows);
    sd_branches *b = calloc(1, sizeof *b);
    double *next = calloc(rows + 2 * entries + 8 * unknowns + 4 * (size_t)n + 1, sizeof *next);
    if (!b || !next) {
        free(b);
        free(next);
        return NULL;
    }
    *b = (sd_branches){.settle = settle, .row = row, .memory = next, .before = next};
    b->now = b->before + unknowns;
    b->middle = b->now + unknowns;
    b->rest = b->middle + unknowns;
    b->jy = b->rest + rows;
    b->jyd = b->jy + entries;
    b->z = b->jyd + entries;
    b->zd = b->z + unknowns;
    b->at = b->zd + unknowns;
    b->near = b->at + unknowns;
    b->far = b->near + unknowns;
    b->y = b->far + unknowns;
    b->yd = b->y + n;
    b->end = b->yd + n;
    b->end_d = b->end + n;
    return b;
}

void sd_branches_free(sd_branches *branches)
{
    if (!branches)
        return;
    free(branches->memory);
    free(branches);
}

/* z, zd := y, yd in the unknowns of the settled system */
static void take_point(sd_branches *b, const double *y, const double *yd)
{
    const sd_condensed *seen = b->settle->seen;
    if (seen) {
        sd_condensed_expand(seen, y, seen->y, 0);
        sd_condensed_expand(seen, yd, seen->yd, 1);
        y = seen->y;
        yd = seen->yd;
    }
    sd_settle_take_point(b->settle, y, yd, b->z, b->zd);
}

/* normal [unknowns] at z, zd; 0: a slope is no number */
static int take_normal(sd_branches *b, double t, double *normal)
{
    sd_system *system = b->settle->system;
    const int32_t unknowns = b->settle->unknowns;
    if (sd_jacobian(system, t, b->z, b->zd, b->settle->scale, b->jy, b->jyd) >= 0)
        return 0;
    memset(normal, 0, (size_t)unknowns * sizeof *normal);
    for (int32_t j = 0; j < unknowns; j++)
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            if (system->row[e] == b->row)
                normal[j] = b->jy[e] * b->settle->scale[j];
    return 1;
}

static double product(const sd_branches *b, const double *m, const double *n)
{
    double sum = 0.0;
    for (int32_t j = 0; j < b->settle->unknowns; j++)
        sum += m[j] * n[j];
    return sum;
}

/* z moved onto the constraint the shortest way, `middle` the normal there; 0: that leads nowhere */
static int project(sd_branches *b, double t)
{
    for (int k = 0; k < CORRECTIONS; k++) {
        double moved = 0.0, square = 0.0;
        sd_residual(b->settle->system, t, b->z, b->zd, b->rest);
        if (!take_normal(b, t, b->middle) || !((square = product(b, b->middle, b->middle)) > 0.0))
            return 0;
        for (int32_t j = 0; j < b->settle->unknowns; j++) {
            const double step = b->middle[j] * (b->rest[b->row] / square);
            b->z[j] -= step * b->settle->scale[j];
            moved = fmax(moved, fabs(step));
        }
        if (moved <= CLOSE)
            return 1;
    }
    return 0;
}

static double distance(const sd_branches *b, const double *from, const double *to)
{
    double most = 0.0;
    for (int32_t j = 0; j < b->settle->unknowns; j++)
        most = fmax(most, fabs(to[j] - from[j]) / b->settle->scale[j]);
    return most;
}

/* z := a point of the constraints between those at `near` and `far`; from the middle of their chord, or, where two branches
 * are as far from it and it has no normals, from beside it.  0: none is found */
static int halve(sd_branches *b, double t)
{
    static const double share[] = {0.5, 0.37, 0.61};
    const int32_t unknowns = b->settle->unknowns;
    const double length = distance(b, b->near, b->far);
    for (size_t k = 0; k < sizeof share / sizeof *share; k++) {
        for (int32_t j = 0; j < unknowns; j++)
            b->z[j] = b->near[j] + share[k] * (b->far[j] - b->near[j]);
        if (project(b, t) && distance(b, b->near, b->z) <= length && distance(b, b->far, b->z) <= length)
            return 1;
    }
    return 0;
}

/* Normals turn between the points `at` (normal `before`) and z: whether these are of two branches, not of one curve */
static int are_two(sd_branches *b, double t)
{
    const size_t size = (size_t)b->settle->unknowns * sizeof(double);
    memcpy(b->near, b->at, size);
    memcpy(b->far, b->z, size);
    double part = distance(b, b->near, b->far);
    for (int k = 0; k < HALVINGS; k++) {
        if (!halve(b, t)) /* no curve leads from one to the other */
            return 1;
        part *= LARGER;
        memcpy(product(b, b->before, b->middle) < 0.0 ? b->far : b->near, b->z, size);
        if (distance(b, b->near, b->far) > APART * part)
            return 1;
    }
    return 0;
}

/* whether the point in z is so far from where normals were taken that others may hold */
static int has_moved(const sd_branches *b)
{
    for (int32_t j = 0; j < b->settle->unknowns; j++)
        if (fabs(b->z[j] - b->at[j]) > MOVED * b->settle->scale[j])
            return 1;
    return 0;
}

/* the normal in `now` is the one to compare with, of the point in z */
static void keep(sd_branches *b)
{
    double *swap = b->before;
    b->before = b->now;
    b->now = swap;
    memcpy(b->at, b->z, (size_t)b->settle->unknowns * sizeof *b->at);
    b->size = sqrt(product(b, b->before, b->before));
    b->most = fmax(b->most, b->size);
}

void sd_branches_leave(sd_branches *b, const sd_stepper *stepper)
{
    b->t = stepper->ivp->t;
    stepper->dense(stepper->self, b->t, b->y, b->yd);
    if (stepper->ivp->steps == 0)
        b->most = 0.0;
    take_point(b, b->y, b->yd);
    if ((!b->begun || stepper->ivp->taken == 0 || has_moved(b)) && take_normal(b, b->t, b->now)) {
        keep(b);
        b->begun = 1;
    }
}

int sd_branches_follow(sd_branches *b, sd_stepper *stepper)
{
    if (!b->begun || stepper->ivp->fixed_h > 0.0)
        return 1;
    stepper->dense(stepper->self, stepper->ivp->t, b->end, b->end_d);
    take_point(b, b->end, b->end_d);
    if (b->size >= SHORT * b->most && !has_moved(b))
        return 1;
    if (!take_normal(b, stepper->ivp->t, b->now))
        return 1;
    const double t = stepper->ivp->t;
    if (product(b, b->before, b->now) < 0.0) {
        if (are_two(b, t)) {
            sd_settle_point(b->settle, b->t, b->y, b->yd); /* rates of a start are those of the equations */
            stepper->start(stepper->self, b->t, b->y, b->yd, 0.25 * (t - b->t));
            return 0;
        }
        take_point(b, b->end, b->end_d);
    }
    keep(b);
    return 1;
}
