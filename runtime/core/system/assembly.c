/* Residual and Jacobian of a system: see assembly.h. */
#include "system/assembly.h"
#include "linear/lanes.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define FAINT SD_SAME /* of the largest so far of an unknown that happens to be zero */
/* of the terms of a row, as the magnitudes of its unknowns make them: round-off of round-off.  A law that is zero (a
 * transistor that is off) leaves a row whose only term is its residual */
#define NOTHING (DBL_EPSILON * DBL_EPSILON)

/* how far beside a root at zero its slope is taken: of an unknown's magnitude, and at least */
#define ROOT_BESIDE SD_HALF_OF_ITS_DIGITS
#define ROOT_LEAST SD_CANCELS

/* rows q' - f of a short stretch */
static SD_ONE_BY_ONE void put_few(int32_t number, const double *own, const double *q, const double *f, double *to)
{
    for (int32_t i = 0; i < number; i++)
        to[i] = own ? (q[i] - f[i]) * own[i] : q[i] - f[i];
}

static inline void add_rows(const sd_system *system, double t, const double *y, const double *yd, double *r)
{
    const double *scale = system->k_scale;
    for (const int32_t *span = system->k_span, *end = span + 4 * (size_t)system->k_spans; span < end; span += 4) {
        const double *restrict own = scale, *restrict q = yd + span[2], *restrict f = y + span[3];
        double *restrict to = r + span[1];
        if (span[0] < SD_FEW) {
            put_few(span[0], own, q, f, to);
        } else {
            for (int32_t i = 0; i < span[0]; i++)
                to[i] = q[i] - f[i];
            for (int32_t i = 0; i < span[0] && own; i++)
                to[i] *= own[i];
        }
        scale = own ? own + span[0] : NULL;
    }
    for (const sd_call *call = system->call, *end = call + system->calls; call < end; call++)
        call->rows(&call->frame, t, y, yd, r);
    for (int32_t i = 0; i < system->held; i++)
        r[system->held_row[i]] = (system->held_rate[i] ? yd : y)[system->held_unknown[i]];
}

void sd_add_rows(const sd_system *system, double t, const double *y, const double *yd, double *r)
{
    add_rows(system, t, y, yd, r);
}

void sd_residual(sd_system *system, double t, const double *y, const double *yd, double *r)
{
    system->residual_evaluations++;
    if (system->left) {
        system->left->residual(system->left, t, y, yd, r);
        return;
    }
    memset(r, 0, (size_t)system->rows * sizeof *r);
    add_rows(system, t, y, yd, r);
}

/* adds entries into their places, of a list that is told by its stretches */
static void add_lines(int32_t stretches, const sd_lines *lines, const double *v, double *values)
{
    for (const sd_lines *end = lines + stretches; lines < end; lines++)
        for (int32_t i = 0; i < lines->number; i++)
            for (int32_t k = 0; k < lines->width; k++)
                values[lines->first[k] + (int64_t)i * lines->step[k]] += *v++;
}

/* adds one block's entries into their places; entries of one place add up */
static void add_entries(const sd_call *call, int rate, double t, const double *y, const double *yd, double *v, double *values)
{
    const int32_t n = rate ? call->n_dyd : call->n_dy, *slot = rate ? call->slot_dyd : call->slot_dy;
    if (n == 0)
        return;
    (rate ? call->dyd : call->dy)(&call->frame, t, y, yd, v);
    for (int32_t e = 0; e < n && slot; e++)
        values[slot[e]] += v[e];
    if (!slot)
        add_lines(rate ? call->stretches_dyd : call->stretches_dy, rate ? call->lines_dyd : call->lines_dy, v, values);
}

/* room for the entries of any block: that of the system, or (of a large one) some for now; NULL: no memory */
static double *room_of(const sd_system *system)
{
    int32_t most = 1;
    for (const sd_call *call = system->call, *end = call + system->calls; call < end && !system->v; call++) {
        most = call->n_dy > most ? call->n_dy : most;
        most = call->n_dyd > most ? call->n_dyd : most;
    }
    return system->v ? system->v : malloc((size_t)most * sizeof(double));
}

/* hands it back; where there was none the slopes [entries] are no numbers */
static void leave_room(const sd_system *system, double *v, double *values)
{
    for (int32_t e = 0; e < system->entries && !v; e++)
        values[e] = NAN;
    if (!system->v)
        free(v);
}

void sd_slopes(const sd_system *system, double t, const double *y, const double *yd, int rate, double *values)
{
    double *v = room_of(system);
    memset(values, 0, (size_t)system->entries * sizeof *values);
    for (int32_t i = 0; i < system->kinematics; i++) {
        double scale = system->k_scale ? system->k_scale[i] : 1.0;
        values[rate ? system->k_slot_q[i] : system->k_slot_f[i]] += rate ? scale : -scale;
    }
    for (int32_t c = 0; c < system->calls && v; c++)
        add_entries(&system->call[c], rate, t, y, yd, v, values);
    for (int32_t i = 0; i < system->clear; i++)
        values[system->cleared[i]] = 0.0;
    for (int32_t i = 0; i < system->held; i++)
        values[system->held_slot[i]] = (system->held_rate[i] != 0) == rate ? 1.0 : 0.0;
    leave_room(system, v, values);
}

static void evaluate_slopes(const sd_system *system, double t, const double *y, const double *yd, double *jy, double *jyd)
{
    if (system->left) {
        memset(jy, 0, (size_t)system->entries * sizeof *jy);
        memset(jyd, 0, (size_t)system->entries * sizeof *jyd);
        system->left->jacobian(system->left, t, y, yd, jy, jyd);
        return;
    }
    sd_slopes(system, t, y, yd, 0, jy);
    sd_slopes(system, t, y, yd, 1, jyd);
}

/* the first row with a slope that is no number, or any where the pattern is put away; -1: none */
static int32_t steep_beyond(const sd_system *system, const double *jy, const double *jyd)
{
    if (sd_finite(system->entries, jy) && sd_finite(system->entries, jyd))
        return -1;
    int32_t e = sd_first_bad(system->entries, jy);
    return system->row ? system->row[e >= 0 ? e : sd_first_bad(system->entries, jyd)] : 0;
}

/* beside := a point near y at which slopes may be numbers */
static void move_beside(const sd_system *system, const double *y, const double *size, int way, double *beside)
{
    double apart = 0.0;
    for (int32_t j = 0; j < system->unknowns; j++) {
        apart = sd_next_part(apart);
        beside[j] = y[j] + way * (1.0 + apart) * (ROOT_BESIDE * fmax(fabs(y[j]), size ? size[j] : 0.0) + ROOT_LEAST);
    }
}

int32_t sd_jacobian(sd_system *system, double t, const double *y, const double *yd, const double *size, double *jy,
                    double *jyd)
{
    system->jacobian_evaluations++;
    evaluate_slopes(system, t, y, yd, jy, jyd);
    int32_t bad = steep_beyond(system, jy, jyd);
    double *beside = bad < 0 ? NULL : malloc(((size_t)system->unknowns + SD_LANES) * sizeof *beside);
    for (int way = 1; way >= -1 && bad >= 0 && beside; way -= 2) {
        move_beside(system, y, size, way, beside);
        evaluate_slopes(system, t, beside, yd, jy, jyd);
        bad = steep_beyond(system, jy, jyd);
    }
    free(beside);
    return bad;
}

static int evaluate_both(const sd_system *system, double t, const double *y, const double *yd, double *values)
{
    double *v = room_of(system);
    memset(values, 0, (size_t)system->entries * sizeof *values);
    for (const sd_call *call = system->call, *end = call + system->calls; call < end && v; call++) {
        add_entries(call, 0, t, y, yd, v, values);
        add_entries(call, 1, t, y, yd, v, values);
    }
    leave_room(system, v, values);
    return sd_finite(system->entries, values);
}

int sd_both_slopes(const sd_system *system, double t, const double *y, const double *yd, double *values)
{
    if (evaluate_both(system, t, y, yd, values))
        return 0;
    double *beside = malloc(((size_t)system->unknowns + SD_LANES) * sizeof *beside);
    int failed = beside ? 1 : -2;
    for (int way = 1; way >= -1 && failed > 0; way -= 2) {
        move_beside(system, y, NULL, way, beside);
        failed = !evaluate_both(system, t, beside, yd, values);
    }
    free(beside);
    return failed < 0 ? failed : 0;
}

void sd_steep_terms(sd_system *system, double t, const double *y, const double *rate, double *s)
{
    if (system->left) {
        system->left->steep(system->left, t, y, rate, s, sd_steep_terms);
        return;
    }
    memset(s, 0, (size_t)system->rows * sizeof *s);
    for (int32_t c = 0; c < system->scales; c++)
        system->scale[c].rows(&system->scale[c].frame, t, y, rate, s);
    for (int32_t i = 0; i < system->held; i++)
        s[system->held_row[i]] = 0.0;
}

/* the first row with terms s, not all zero (a row that is not steep has none), that is beyond their part `limit`; -1: none */
static int32_t first_beyond(int32_t rows, const double *r, double limit, const double *s)
{
    for (int32_t i = 0; i < rows; i++)
        if (s[i] != 0.0 && !(fabs(r[i]) <= limit * s[i]))
            return i;
    return -1;
}

int32_t sd_first_unmet(sd_system *system, double t, const double *y, const double *rate, const double *r, double limit,
                       const double *g, const double *scale, const double *met, int all, double *s)
{
    sd_steep_terms(system, t, y, rate, s);
    if (!all && first_beyond(system->rows, r, limit, s) < 0)
        return -1; /* what follows adds to the terms */
    for (int32_t i = 0; i < system->rows; i++)
        s[i] = -s[i]; /* what is known already is not added to, but for what is nothing */
    for (int32_t j = 0; j < system->unknowns; j++)
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            if (s[system->row[e]] < 0.0)
                s[system->row[e]] -= NOTHING * fabs(g[e]) * scale[j];
            else if (all)
                s[system->row[e]] += fabs(g[e]) * (fabs(y[j]) + FAINT * met[j]);
    for (int32_t i = 0; i < system->rows; i++)
        s[i] = fabs(s[i]);
    return first_beyond(system->rows, r, limit, s);
}

int32_t sd_first_astray(sd_system *system, double t, const double *y, const double *rate, const double *r, double limit,
                        const double *jy, const double *jyd, double h, const double *open, int all, double *s)
{
    sd_steep_terms(system, t, y, rate, s);
    for (int32_t j = 0; j < system->unknowns && all; j++) /* of the other rows, below zero */
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            if (s[system->row[e]] <= 0.0)
                s[system->row[e]] -= fabs(jy[e] * y[j]);
    for (int32_t i = 0; i < system->rows; i++)
        s[i] = all || s[i] > 0.0 ? fabs(r[i]) - limit * fabs(s[i]) : 0.0;
    for (int32_t j = 0; j < system->unknowns; j++)
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            s[system->row[e]] -= (fabs(jy[e]) + fabs(jyd[e]) / h) * open[j];
    for (int32_t i = 0; i < system->rows; i++)
        if (!(s[i] <= 0.0))
            return i;
    return -1;
}

SD_WIDE int32_t sd_first_bad(int32_t n, const double *x)
{
    sd_lanes sums = {0.0}; /* x - x is 0 for a finite number and not a number otherwise */
    int32_t whole = n - n % SD_LANES;
    for (ptrdiff_t i = 0; i < whole; i += SD_LANES) {
        sd_lanes v = SD_FROM(x, i);
        sums += v - v;
    }
    double sum = SD_TOTAL(sums);
    for (int32_t i = whole; i < n; i++)
        sum += x[i] - x[i];
    for (int32_t i = 0; i < n && sum != 0.0; i++)
        if (!isfinite(x[i]))
            return i;
    return -1;
}
