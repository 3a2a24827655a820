/* Elimination of unknowns that are constant sums of others: see condensed.h. */
#include "system/condensed.h"
#include "linear/lanes.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define AT_ONCE 4 /* terms of a sum in one pass over memory */

/* x := factors * sources + constant of few unknowns, as most of a small model stand: outside the wide loops */
static inline void evaluate_few(const sd_straight *straight, double *x, const double *constant)
{
    const int32_t *source = straight->source, terms = straight->terms, n = straight->number;
    const double *f = straight->factor;
    for (int32_t i = 0; i < n; i++) {
        double sum = terms > 0 ? f[i] * x[source[0] + i] : 0.0;
        for (int32_t k = 1; k < terms; k++)
            sum += f[k * n + i] * x[source[k] + i];
        x[straight->place + i] = constant ? sum + constant[i] : sum;
    }
}

/* Where the terms of a stretch begin */
typedef struct terms {
    const double *source[AT_ONCE], *factor[AT_ONCE];
} terms;

/* out of the unknowns i .. i + SD_LANES */
static inline __attribute__((always_inline)) void sum_lanes(const terms *of, ptrdiff_t i, const int32_t number, const int alike,
                                                            double *out)
{
    sd_lanes sum = {0.0};
    for (int32_t k = 0; k < number; k++) {
        const sd_lanes source = SD_FROM(of->source[k], i);
        const double f = of->factor[k][0];
        sd_lanes term = {f, f, f, f};
        if (!alike)
            term = SD_FROM(of->factor[k], i);
        term *= source;
        if (k == 0)
            sum = term;
        else
            sum += term;
    }
    SD_AT(out, i) = sum;
}

/* The same of many unknowns, of so many terms; alike: of one factor each, for along a line of like sections the factors would be
 * most of what is read.  The last lanes overlap those before them. */
static inline __attribute__((always_inline)) void sum_up(const sd_straight *straight, double *x, const int32_t number,
                                                         const int alike)
{
    const ptrdiff_t n = straight->number;
    double *const out = x + straight->place;
    terms of;
    for (int32_t k = 0; k < number; k++) {
        of.source[k] = x + straight->source[k];
        of.factor[k] = straight->factor + k * (alike ? straight->alike : n);
    }
    for (ptrdiff_t i = 0; i + SD_LANES <= n; i += SD_LANES)
        sum_lanes(&of, i, number, alike, out);
    if (n % SD_LANES)
        sum_lanes(&of, n - SD_LANES, number, alike, out);
}

/* x += factors * sources of the terms from AT_ONCE on */
static inline void add_terms(const sd_straight *straight, double *x)
{
    const int32_t n = straight->number;
    double *restrict out = x + straight->place;
    for (int32_t k = AT_ONCE; k < straight->terms; k++) {
        const double *restrict a = x + straight->source[k], *restrict f = straight->factor + (size_t)k * n;
        for (int32_t i = 0; i < n; i++)
            out[i] += f[i] * a[i];
    }
}

SD_WIDE static void evaluate_many(const sd_straight *straight, double *x, const double *constant)
{
    switch (straight->alike ? -straight->terms : straight->terms) {
    case -2: sum_up(straight, x, 2, 1); break;
    case -1: sum_up(straight, x, 1, 1); break;
    case 0: sum_up(straight, x, 0, 0); break;
    case 1: sum_up(straight, x, 1, 0); break;
    case 2: sum_up(straight, x, 2, 0); break;
    case 3: sum_up(straight, x, 3, 0); break;
    case 4: sum_up(straight, x, 4, 0); break;
    default: sum_up(straight, x, AT_ONCE, 0); add_terms(straight, x);
    }
    double *restrict out = x + straight->place;
    for (int32_t i = 0; constant && i < straight->number; i++)
        out[i] += constant[i];
}

static inline void evaluate_straight(const sd_straight *straight, double *x, int rate)
{
    const double *constant = rate ? NULL : straight->constant;
    if (straight->number < SD_LANES)
        evaluate_few(straight, x, constant);
    else
        evaluate_many(straight, x, constant);
}

void sd_condensed_complete(const sd_condensed *condensed, double *x, int rate)
{
    for (int32_t s = 0; s < condensed->straights; s++)
        evaluate_straight(&condensed->straight[s], x, rate);
}

/* a span of numbers, most of a small model of one */
static inline void copy(double *to, const double *from, int32_t number)
{
    if (number == 1)
        *to = *from;
    else
        memcpy(to, from, (size_t)number * sizeof *to);
}

static void scatter(int32_t spans, const sd_span *span, const double *z, double *x)
{
    for (int32_t s = 0; s < spans; s++)
        copy(x + span[s].full, z + span[s].kept, span[s].number);
}

static void gather(int32_t spans, const sd_span *span, const double *x, double *z)
{
    for (int32_t s = 0; s < spans; s++)
        copy(z + span[s].kept, x + span[s].full, span[s].number);
}

void sd_condensed_put(const sd_condensed *condensed, const double *z, double *x)
{
    scatter(condensed->unknown_spans, condensed->unknown, z, x);
}

void sd_condensed_expand(const sd_condensed *condensed, const double *z, double *x, int rate)
{
    sd_condensed_put(condensed, z, x);
    sd_condensed_complete(condensed, x, rate);
}

void sd_condensed_audited(const sd_condensed *condensed, const double *z, double *x)
{
    sd_condensed_put(condensed, z, x);
    for (int32_t s = 0; s < condensed->straights; s++)
        if (condensed->straight[s].audited)
            evaluate_straight(&condensed->straight[s], x, 0);
}

void sd_condensed_shown_rates(const sd_condensed *condensed, double *yd)
{
    for (int32_t s = 0; s < condensed->straights && condensed->observed_rates; s++)
        if (condensed->straight[s].rated)
            evaluate_straight(&condensed->straight[s], yd, 1);
}

void sd_condensed_show(const sd_condensed *condensed, const double *z, const double *zd, double *y, double *yd)
{
    sd_condensed_expand(condensed, z, y, 0);
    sd_condensed_put(condensed, zd, yd);
    sd_condensed_shown_rates(condensed, yd);
}

void sd_condensed_gather(const sd_condensed *condensed, const double *x, double *z)
{
    gather(condensed->unknown_spans, condensed->unknown, x, z);
}

void sd_condensed_place(const sd_condensed *condensed, const double *z)
{
    sd_condensed_expand(condensed, z, condensed->y, 0);
}

void sd_condensed_place_rates(const sd_condensed *condensed, const double *zd)
{
    scatter(condensed->rate_spans, condensed->rate, zd, condensed->yd);
}

static void place(const sd_condensed *condensed, const double *z, const double *zd)
{
    sd_condensed_place(condensed, z);
    sd_condensed_place_rates(condensed, zd);
}

/* kept rows q' - f that are nothing else */
SD_WIDE static void write_own(const sd_condensed *condensed, const double *zd, double *r)
{
    for (const int32_t *own = condensed->own, *end = own + 4 * (size_t)condensed->own_spans; own < end; own += 4) {
        const double *q = zd + own[2], *restrict f = condensed->y + own[3];
        double *to = r + own[1];
        const int32_t number = own[0];
        for (int32_t i = 0; i < number; i++)
            to[i] = q[i] - f[i];
    }
}

int sd_condensed_in_place(const sd_condensed *condensed)
{
    int own = 1;
    for (int32_t s = 0; s < condensed->own_spans; s++)
        own &= condensed->own[4 * (size_t)s + 1] == condensed->own[4 * (size_t)s + 2];
    return own;
}

void sd_condensed_rows(const sd_condensed *condensed, double t, const double *zd, double *r)
{
    for (int32_t s = 0; s < condensed->rest_spans; s++) /* others are nobody's */
        memset(condensed->r + condensed->rest[s].full, 0, (size_t)condensed->rest[s].number * sizeof *r);
    sd_add_rows(condensed->full, t, condensed->y, condensed->yd, condensed->r);
    gather(condensed->rest_spans, condensed->rest, condensed->r, r);
    write_own(condensed, zd, r);
}

static void residual(const sd_left *left, double t, const double *z, const double *zd, double *r)
{
    const sd_condensed *condensed = (const sd_condensed *)left;
    place(condensed, z, zd);
    sd_condensed_rows(condensed, t, zd, r);
}

/* values += share * slope of the products */
static void add_products(const sd_condensed *condensed, const double *slope, double *values)
{
    for (int64_t p = 0; p < condensed->products && condensed->from; p++)
        values[condensed->to[p]] += condensed->share[p] * slope[condensed->from[p]];
    for (int64_t s = 0; s < condensed->stretches; s++) {
        const sd_shares *lines = &condensed->shares[s];
        for (int64_t i = 0; i < lines->number; i++)
            for (int32_t k = 0; k < lines->width; k++)
                values[lines->to[k] + i * lines->to_step[k]] += lines->share[k] * slope[lines->from[k] + i * lines->from_step[k]];
    }
}

static void jacobian(const sd_left *left, double t, const double *z, const double *zd, double *jz, double *jzd)
{
    const sd_condensed *condensed = (const sd_condensed *)left;
    double *slope = condensed->slope ? condensed->slope : malloc(((size_t)condensed->full->entries + 1) * sizeof *slope);
    if (!slope) {
        jz[0] = NAN;
        return;
    }
    place(condensed, z, zd);
    for (int rate = 0; rate < 2; rate++) { /* one room for both: of a large system it is long */
        sd_slopes(condensed->full, t, condensed->y, condensed->yd, rate, slope);
        add_products(condensed, slope, rate ? jzd : jz);
    }
    if (!condensed->slope)
        free(slope);
}

static void steep(const sd_left *left, double t, const double *z, const double *rate, double *s, sd_terms *terms)
{
    const sd_condensed *condensed = (const sd_condensed *)left;
    place(condensed, z, rate);
    terms(condensed->full, t, condensed->y, condensed->yd, condensed->r);
    gather(condensed->row_spans, condensed->row, condensed->r, s);
}

void sd_condensed_bind(sd_condensed *condensed, sd_system *system)
{
    condensed->left = (sd_left){residual, jacobian, steep};
    system->left = &condensed->left;
}
