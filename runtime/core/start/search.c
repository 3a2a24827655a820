#include "start/search.h"

#include "linear/dense/dense.h"
#include "linear/dense/graded.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define EMPTY 1e-160 /* coefficients whose squares underflow say nothing */
#define FLATTEST (DBL_MAX_EXP - 1)
#define ROUND_OFF (8.0 * DBL_EPSILON)
#define BESIDE SD_HALF_OF_ITS_DIGITS
#define STRAIGHT SD_SLIGHT

/* The rates yd [extended], and y as blocks read it, in room [extended] behind them: where they are compiled x serves, for they
 * know no audit families. */
static const double *expand(const sd_rows_of_start *s, const double *x, double *yd)
{
    double *y = yd + s->extended;
    memset(yd, 0, (size_t)s->extended * sizeof *yd);
    for (int32_t k = 0; k < s->rates; k++)
        yd[s->rate[k]] = x[s->written + k];
    sd_follow_flows(s->k_span, s->k_spans, x, yd);
    if (s->system->together)
        return x;
    memset(y, 0, (size_t)s->extended * sizeof *y);
    memcpy(y, x, (size_t)s->written * sizeof *y);
    return y;
}

int sd_start_residual(const sd_rows_of_start *s, double t, const double *x, double *r)
{
    double *yd = malloc(2 * (size_t)s->extended * sizeof *yd + 8);
    if (!yd)
        return -2;
    sd_residual(s->system, t, expand(s, x, yd), yd, r);
    free(yd);
    return 0;
}

/* the same where slopes are no numbers: as sd_jacobian finds them */
static int beside_roots(const sd_rows_of_start *s, double t, const double *y, const double *yd, double *values)
{
    double *jy = malloc((2 * (size_t)s->system->entries + 1) * sizeof *jy), *jyd = jy + s->system->entries;
    if (!jy)
        return -2;
    sd_jacobian(s->system, t, y, yd, NULL, jy, jyd);
    for (int32_t k = 0; k < s->plain + s->rated; k++)
        values[k] = (k < s->plain ? jy : jyd)[s->entry[k]];
    free(jy);
    return 0;
}

int sd_start_jacobian(const sd_rows_of_start *s, double t, const double *x, double *values)
{
    int32_t entries = s->both ? 0 : s->system->entries, whole = 1;
    double *yd = malloc((2 * (size_t)s->extended + (size_t)entries + 1) * sizeof *yd), *slope = yd + 2 * s->extended;
    if (!yd)
        return -2;
    const double *y = expand(s, x, yd);
    if (s->both) { /* of a large system the room counts */
        int missing = sd_both_slopes(s->both, t, y, yd, values);
        free(yd);
        return missing;
    }
    /* one side after the other: of a large system the room counts */
    for (int rate = 0; rate < 2 && whole; rate++) {
        sd_slopes(s->system, t, y, yd, rate, slope);
        whole = sd_finite(entries, slope);
        for (int32_t k = rate ? s->plain : 0; k < s->plain + (rate ? s->rated : 0); k++)
            values[k] = slope[s->entry[k]];
    }
    int failed = whole ? 0 : beside_roots(s, t, y, yd, values);
    free(yd);
    return failed;
}

/* What one iteration needs; the arrays of one block of memory. */
typedef struct {
    int32_t rows, unknowns;                       /* in use, free */
    int32_t *row_at, *column_at;                  /* [all rows], [all unknowns] number among these, or -1 */
    double *values, *unit, *row_scale;            /* [entries], [all unknowns], [all rows] */
    double *a, *work, *aim, *size;                /* [rows, unknowns] twice, [all rows] twice */
    double *u, *target, *tried, *stands;          /* [all unknowns] each; stands: 1 where a row has the unknown */
    double *r, *scaled, *begun, *end;             /* [all rows] */
} room;

static int32_t numbers(int32_t count, const int32_t *use, int32_t *at)
{
    int32_t found = 0;
    for (int32_t k = 0; k < count; k++)
        at[k] = use[k] ? found++ : -1;
    return found;
}

/* size [rows]: of the terms of each row in what is free, in magnitudes; of one that reads nothing free of all it reads */
static void sizes(const sd_search *s, const double *values, double *size)
{
    const sd_balance *m = &s->start->balance;
    memset(size, 0, (size_t)m->rows * sizeof *size);
    for (int32_t e = 0; e < m->entries; e++)
        if (s->free[m->column[e]] && isfinite(values[e]))
            size[m->row[e]] += fabs(values[e]) * s->scale[m->column[e]];
    for (int32_t e = 0; e < m->entries; e++)
        if (size[m->row[e]] <= 0.0 && !s->free[m->column[e]] && isfinite(values[e]))
            size[m->row[e]] -= fabs(values[e]) * s->scale[m->column[e]];
    for (int32_t r = 0; r < m->rows; r++)
        size[r] = size[r] != 0.0 ? fabs(size[r]) : 1.0;
}

/* the linearised rows at x, of the size of their terms, in scaled unknowns: w->a; w->row_scale */
static void linearise(const sd_search *s, const double *x, room *w)
{
    const sd_balance *m = &s->start->balance;
    sd_start_jacobian(s->start, s->t, x, w->values);
    sizes(s, w->values, w->size);
    memset(w->a, 0, (size_t)w->rows * (size_t)w->unknowns * sizeof *w->a);
    for (int32_t r = 0; r < m->rows; r++)
        w->row_scale[r] = 1.0 / w->size[r];
    for (int32_t e = 0; e < m->entries; e++) {
        int32_t i = w->row_at[m->row[e]], j = w->column_at[m->column[e]];
        if (i < 0 || j < 0 || !isfinite(w->values[e]))
            w->values[e] = 0.0;
        else
            w->a[(size_t)i * w->unknowns + j] += w->values[e] * w->unit[m->column[e]] * w->row_scale[m->row[e]];
    }
}

/* largest scaled row at x; w->scaled */
static double measure(sd_search *s, const double *x, room *w, double *norm)
{
    int32_t rows = s->start->balance.rows;
    double largest = 0.0, sum = 0.0;
    s->spent += SD_EVALUATION + SD_EACH * s->start->balance.entries;
    sd_start_residual(s->start, s->t, x, w->r);
    for (int32_t r = 0; r < rows; r++) {
        w->scaled[r] = s->use[r] ? w->r[r] * w->row_scale[r] : 0.0;
        double size = fabs(w->scaled[r]);
        largest = size > largest || isnan(size) ? size : largest;
        sum += size * size;
    }
    *norm = sqrt(sum);
    return isfinite(largest) ? largest : INFINITY;
}

/* target [unknowns]: that of `nearest` where the rows as they are determine the step; else 1 */
static int determined(const sd_search *s, room *w, int beside)
{
    const sd_balance *m = &s->start->balance;
    int32_t n = w->unknowns;
    memset(w->work, 0, (size_t)w->rows * (size_t)n * sizeof *w->work);
    memset(w->stands, 0, (size_t)m->unknowns * sizeof *w->stands);
    for (int32_t e = 0; e < m->entries; e++)
        if (w->values[e] != 0.0) {
            int32_t j = w->column_at[m->column[e]];
            w->work[(size_t)w->row_at[m->row[e]] * n + j] += w->values[e];
            w->stands[j] = 1.0;
        }
    for (int32_t r = 0; r < m->rows; r++)
        if (w->row_at[r] >= 0)
            w->aim[w->row_at[r]] = -w->r[r];
    int failed = sd_graded(w->rows, n, w->work, w->aim, NULL, w->target, NULL);
    for (int32_t c = 0; c < m->unknowns && !failed; c++) {
        int32_t j = w->column_at[c];
        if (j >= 0)
            w->target[j] = beside || w->stands[j] != 0.0 ? w->u[j] + w->target[j] / w->unit[c] : 0.0;
    }
    return failed;
}

/* target [unknowns]: the u of least norm with a u = a u_now - rows; beside: the step of least norm, added to u_now */
static int nearest(const sd_search *s, room *w, int beside)
{
    int32_t m = w->rows, n = w->unknowns, all = s->start->balance.rows;
    int open = determined(s, w, beside);
    if (open <= 0)
        return open;
    for (int32_t r = 0; r < all; r++) {
        int32_t i = w->row_at[r];
        if (i < 0)
            continue;
        const double *a = w->a + (size_t)i * n;
        double aim = -w->scaled[r], most = 0.0, sum = 0.0;
        for (int32_t j = 0; j < n && !beside; j++)
            aim += a[j] * w->u[j];
        for (int32_t j = 0; j < n; j++)
            most = isfinite(a[j]) ? fmax(most, fabs(a[j])) : INFINITY;
        if (!isfinite(most) || !isfinite(aim))
            return -1;
        /* by a power of two before squares are formed, which could overflow; then rows of equal size */
        int exponent;
        frexp(most > EMPTY ? most : 1.0, &exponent);
        double power = ldexp(1.0, exponent);
        for (int32_t j = 0; j < n; j++) {
            double v = a[j] / power;
            w->work[(size_t)i * n + j] = v;
            sum += v * v;
        }
        double size = sum > 0.0 ? sqrt(sum) : 1.0;
        for (int32_t j = 0; j < n; j++)
            w->work[(size_t)i * n + j] /= size;
        w->aim[i] = aim / power / size;
    }
    int failed = sd_nearest(m, n, w->work, w->aim, SD_DEPENDENT, w->target);
    for (int32_t j = 0; j < n && beside; j++)
        w->target[j] += w->u[j];
    return failed;
}

static int used(const sd_search *s, const double *r)
{
    for (int32_t k = 0; k < s->start->balance.rows; k++)
        if (s->use[k] && !isfinite(r[k]))
            return 0;
    return 1;
}

static void count(sd_search *s, const room *w)
{
    double rows = w->rows, unknowns = w->unknowns, entries = s->start->balance.entries;
    double whole = 15.0 * rows * unknowns * fmin(rows, unknowns) + SD_EVALUATION + SD_EACH * entries;
    s->largest = fmax(s->largest, whole);
    s->spent += whole;
}

/* w->tried: part of the way to the target; the norm of the rows there */
static double tried(sd_search *s, room *w, const double *x, double part)
{
    double norm;
    for (int32_t c = 0; c < s->start->balance.unknowns; c++) {
        int32_t j = w->column_at[c];
        w->tried[c] = x[c] + (j >= 0 ? part * (w->target[j] - w->u[j]) * w->unit[c] : 0.0);
    }
    measure(s, w->tried, w, &norm);
    return norm;
}

/* whether rows, at its middle now, are linear along a way on which they do not fall by a tenth: what is nearest to the
 * solution of linear rows that contradict, or whose slopes magnitudes hide, is all that there is */
static int ascends(const room *w, int32_t rows)
{
    double off = 0.0, size = 0.0, onward = 0.0;
    for (int32_t r = 0; r < rows; r++) {
        double bend = w->scaled[r] - 0.5 * (w->begun[r] + w->end[r]);
        off += bend * bend;
        size += w->scaled[r] * w->scaled[r];
        onward += w->begun[r] * (w->end[r] - 0.9 * w->begun[r]);
    }
    return sqrt(off) <= STRAIGHT * sqrt(size) && onward > 0.0;
}

/* whether rows shrink on the first of a way that is too long by powers of ten: that of a law that is flat at x (a junction
 * that blocks, and shall conduct); w->tried: about where they stop to, by bisection of the exponent */
static int flat(sd_search *s, room *w, const double *x, double norm, double *now)
{
    int above = SD_HALVINGS, below = FLATTEST;
    while (below - above > 1) {
        int halvings = (above + below) / 2;
        *(tried(s, w, x, ldexp(1.0, -halvings)) <= norm ? &below : &above) = halvings;
    }
    *now = tried(s, w, x, ldexp(1.0, -below));
    return *now < norm;
}

static void iterate(sd_search *s, room *w, double *x)
{
    size_t all = (size_t)s->start->balance.unknowns, rows = (size_t)s->start->balance.rows;
    int stale = 0, taken = 0, lost = 0;
    for (int k = 0; k < s->most + SD_FOLDS && taken != s->most && lost != SD_LOST; k++) {
        taken++;
        linearise(s, x, w);
        count(s, w);
        double norm, size = measure(s, x, w, &norm);
        if (size < s->residual) {
            stale = size > 0.5 * s->residual ? stale : 0;
            memcpy(s->x, x, all * sizeof *x);
            s->residual = size;
            for (size_t r = 0; r < rows; r++)
                s->scaled[r] = fabs(w->scaled[r]);
        }
        stale++;
        memcpy(w->begun, w->scaled, rows * sizeof *w->begun);
        if (size <= ROUND_OFF || !isfinite(size) || stale > (s->residual < 1e-12 ? 4 : 15))
            break;
        if (s->spent > s->share * fmax(SD_GRANTED, SD_ITERATIONS * s->largest))
            break;
        for (size_t c = 0; c < all; c++)
            if (w->column_at[c] >= 0)
                w->u[w->column_at[c]] = (x[c] - s->guess[c]) / w->unit[c];
        if (nearest(s, w, size < BESIDE && stale > 1))
            break;
        int good = 1;
        for (int32_t j = 0; j < w->unknowns; j++)
            good &= isfinite(w->target[j]);
        if (!good)
            break;
        double step = 1.0, now = INFINITY;
        int halvings = 0;
        for (; halvings < SD_HALVINGS; halvings++, step *= 0.5) {
            now = tried(s, w, x, step);
            if (isfinite(now) && now <= fmax((1.0 - 0.1 * step) * norm, 1e-11))
                break;
            if (halvings == 0)
                memcpy(w->end, w->scaled, rows * sizeof *w->end);
            if (halvings == 1 && ascends(w, (int32_t)rows))
                return;
        }
        if (halvings == SD_HALVINGS && !(flat(s, w, x, norm, &now))) {
            lost++;
            now = tried(s, w, x, 2.0 * step);
        } else
            lost = 0;
        if (s->residual >= 1e-12 && now <= 0.5 * norm) { /* rows that shrink as fast as their terms do */
            stale = 0;
            taken--;
        }
        if (!used(s, w->r))
            break;
        memcpy(x, w->tried, all * sizeof *x);
    }
}

int sd_search_solve(sd_search *s)
{
    const sd_balance *m = &s->start->balance;
    size_t all = (size_t)m->unknowns, rows = (size_t)m->rows, entries = (size_t)m->entries;
    room w;
    int32_t *at = malloc((rows + all + 1) * sizeof *at);
    if (!at)
        return -2;
    w.row_at = at;
    w.column_at = at + rows;
    w.rows = numbers(m->rows, s->use, w.row_at);
    w.unknowns = numbers(m->unknowns, s->free, w.column_at);
    size_t full = (size_t)w.rows * (size_t)w.unknowns;
    double *memory = malloc((entries + 6 * all + 7 * rows + 2 * full + 1) * sizeof *memory);
    if (!memory) {
        free(at);
        return -2;
    }
    w.values = memory;
    w.unit = w.values + entries;
    w.row_scale = w.unit + all;
    w.a = w.row_scale + rows;
    w.work = w.a + full;
    w.aim = w.work + full;
    w.size = w.aim + rows;
    w.u = w.size + rows;
    w.target = w.u + all;
    w.tried = w.target + all;
    w.stands = w.tried + all;
    w.r = w.stands + all;
    w.scaled = w.r + rows;
    w.begun = w.scaled + rows;
    w.end = w.begun + rows;
    double *x = w.end + rows;
    for (size_t c = 0; c < all; c++)
        w.unit[c] = s->scale[c] / s->weight[c];
    memcpy(x, s->x, all * sizeof *x);
    s->residual = INFINITY;
    for (size_t r = 0; r < rows; r++)
        s->scaled[r] = INFINITY;
    iterate(s, &w, x);
    free(memory);
    free(at);
    return 0;
}

int sd_search_measure(sd_search *s)
{
    const sd_balance *m = &s->start->balance;
    size_t rows = (size_t)m->rows;
    double *size = calloc(rows + (size_t)m->entries + 1, sizeof *size);
    if (!size)
        return -2;
    double *values = size + rows;
    int failed = sd_start_jacobian(s->start, s->t, s->x, values) | sd_start_residual(s->start, s->t, s->x, s->scaled);
    sizes(s, values, size);
    s->residual = 0.0;
    for (size_t r = 0; r < rows; r++) {
        double scaled = s->use[r] ? fabs(s->scaled[r] / size[r]) : 0.0;
        s->scaled[r] = scaled;
        s->residual = scaled > s->residual || isnan(scaled) ? scaled : s->residual;
    }
    s->residual = isfinite(s->residual) ? s->residual : INFINITY;
    free(size);
    return failed;
}
