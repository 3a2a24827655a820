/* The start of one of many runs: see many_start.h. */
#include "run/many/many_start.h"
#include "linear/tuning.h"

#include <math.h>
#include <string.h>

#define ALIKE SD_HALF_OF_ITS_DIGITS /* of its magnitude: two starts that are one */
#define CONTRACTS 0.5    /* largest residual over the one before: Newton's method converges (Deuflhard 2004, 2.1) */
#define MOVED SD_MET /* of its magnitude: an anchor that moves by more is not what the text gives */
#define VANISHED SD_UNSEEN /* pivot of the start's matrix, or entry of its Jacobian, over that of the nominal start */

void sd_many_restore(const sd_region *region, int32_t regions)
{
    for (int32_t k = 0; k < regions; k++)
        memcpy(region[k].at, region[k].copy, (size_t)region[k].size);
}

/* 1: an entry of the start's Jacobian vanishes that counts in the nominal one, or a rate appears in a row */
static int other_pattern(const sd_many *many)
{
    for (int32_t e = 0; e < many->start->system->entries; e++) {
        double y = many->jy[e], yd = many->jyd[e];
        if (!isfinite(y) || !isfinite(yd) || (many->jyd0[e] == 0.0 && yd != 0.0))
            return 1;
        if (many->counts[e] & 1 && !(fabs(y) > VANISHED * fabs(many->jy0[e])))
            return 1;
        if (many->counts[e] & 2 && !(fabs(yd) > VANISHED * fabs(many->jyd0[e])))
            return 1;
    }
    return 0;
}

/* 1: the inertia has a negative direction (LDL^T; a column without a pivot has no inertia) */
static int negative_inertia(const sd_many *many)
{
    int32_t n = many->flows;
    double *m = many->inertia;
    memset(m, 0, (size_t)n * (size_t)n * sizeof *m);
    for (int32_t k = 0; k < many->inertias; k++) {
        const double *from = many->inertia_rate[k] ? many->jyd : many->jy;
        m[many->inertia_row[k] * n + many->inertia_column[k]] += many->inertia_sign[k] * from[many->inertia_entry[k]];
    }
    for (int32_t k = 0; k < n; k++) {
        double own = m[k * n + k];
        if (own < -1e-9 * fabs(own) || !isfinite(own))
            return 1;
    }
    for (int32_t k = 0; k < n; k++) {
        double d = m[k * n + k], size = 0.0;
        for (int32_t i = k; i < n; i++)
            size = fmax(size, fabs(m[i * n + k]));
        if (d < -1e-9 * size)
            return 1;
        if (d <= 1e-12 * size)
            continue;
        for (int32_t i = k + 1; i < n; i++)
            for (int32_t j = k + 1; j < n; j++)
                m[i * n + j] -= m[i * n + k] / d * m[k * n + j];
        for (int32_t i = k + 1; i < n; i++)
            if (m[i * n + i] < 0.0 && m[i * n + i] > -1e-9 * fabs(m[i * n + k] / d * m[k * n + i]))
                m[i * n + i] = 0.0; /* round-off */
    }
    return 0;
}

void sd_many_scale(sd_settle *settle, const double *magnitude, double tau)
{
    memcpy(settle->scale, magnitude, (size_t)settle->unknowns * sizeof *magnitude);
    for (int32_t k = 0; k < settle->rates; k++)
        settle->scale[settle->unknowns + k] = magnitude[settle->rate[k]] / tau;
}

/* what is left of a zero is zero, in the settler's magnitudes, and what the text gives is what it gives: balances would
 * be sized by round-off */
static void clean(const sd_many *many, const double *anchor, double *y, double *yd)
{
    const sd_settle *settle = many->start;
    for (int32_t i = 0; i < settle->unknowns; i++)
        if (fabs(y[i] - (many->anchored[i] ? anchor[i] : 0.0)) <= SD_MANY_NOTHING * settle->scale[i])
            y[i] = many->anchored[i] ? anchor[i] : 0.0;
    for (int32_t k = 0; k < settle->rates; k++)
        if (fabs(yd[settle->rate[k]]) <= SD_MANY_NOTHING * settle->scale[settle->unknowns + k])
            yd[settle->rate[k]] = 0.0;
    sd_follow_flows(settle->k_span, settle->k_spans, y, yd);
}

/* 1: y, yd settled, the anchored as they were, everything finite, on the root of the nominal start; magnitude: by which,
 * NULL: those of the nominal start */
static int settled(sd_many *many, const double *anchor, const double *magnitude, double *y, double *yd)
{
    sd_many_restore(many->region, many->regions);
    if (magnitude)
        sd_many_scale(many->start, magnitude, many->tau);
    if (sd_settle_point(many->start, many->t0, y, yd) || *many->start->system->stop)
        return 0;
    if (!(many->start->contracted <= CONTRACTS))
        return 0;
    clean(many, anchor, y, yd);
    for (int32_t i = 0; i < many->written; i++) {
        if (!isfinite(y[i]) || !isfinite(yd[i]))
            return 0;
        if (many->anchored[i] && !(fabs(y[i] - anchor[i]) <= MOVED * fmax(many->size[i], fabs(anchor[i]))))
            return 0;
    }
    return 1;
}

/* 1: what the text guesses, if that is not what it guessed at the nominal start, leads to y, yd too */
static int guessed(sd_many *many, const double *anchor, const double *y, const double *yd)
{
    int32_t n = many->written, other = 0;
    double *a = many->passes[1].y, *b = many->passes[1].start_rate;
    memcpy(a, y, (size_t)many->passes[0].n * sizeof *y);
    memcpy(b, yd, (size_t)many->passes[0].n * sizeof *yd);
    for (int32_t i = 0; i < n; i++)
        if (many->guessed[i] && anchor[i] != many->guess[i]) {
            other = 1;
            a[i] = anchor[i];
        }
    if (!other)
        return 1;
    if (!settled(many, anchor, NULL, a, b))
        return 0;
    for (int32_t i = 0; i < n; i++)
        if (!(fabs(a[i] - y[i]) <= ALIKE * fmax(many->size[i], fabs(y[i]))))
            return 0;
    return 1;
}

/* magnitudes at this start, as a run of its own finds them (runtime/integrate/origin.py); 1: they cannot be had */
static int sized(sd_many *many)
{
    const sd_pass *pass = &many->passes[0];
    memset(pass->yd, 0, (size_t)pass->n * sizeof(double));
    for (int32_t i = 0; i < pass->n; i++)
        if (pass->differential[i])
            pass->yd[i] = pass->start_rate[i];
    sd_jacobian(many->system, many->t0, pass->y, pass->start_rate, NULL, many->form_jy, many->form_jyd);
    return sd_magnitudes(many->sizing, many->system, many->t0, many->t1 - many->t0, pass->y, pass->yd, many->form_jy,
                         many->form_jyd, pass->yd, many->order, 0, many->found, &many->tau);
}

int sd_many_begin(sd_many *many, const double *anchor)
{
    double *y = many->passes[0].y, *yd = many->passes[0].start_rate;
    memset(y, 0, (size_t)many->passes[0].n * sizeof *y);
    memset(yd, 0, (size_t)many->passes[0].n * sizeof *yd);
    memcpy(y, many->y0, (size_t)many->written * sizeof *y);
    memcpy(yd, many->yd0, (size_t)many->written * sizeof *yd);
    for (int32_t i = 0; i < many->written; i++)
        if (many->anchored[i])
            y[i] = anchor[i];
    if (!settled(many, anchor, NULL, y, yd) || !guessed(many, anchor, y, yd))
        return SD_MANY_START;
    sd_jacobian(many->start->system, many->t0, y, yd, NULL, many->jy, many->jyd);
    if (other_pattern(many) || !(many->start->linear->smallest >= VANISHED * many->smallest) || negative_inertia(many))
        return SD_MANY_STRUCTURE;
    return sized(many) || !settled(many, anchor, many->found, y, yd) ? SD_MANY_START : SD_MANY_DONE;
}
