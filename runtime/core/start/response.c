#include "start/response.h"

#include "linear/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ENTRIES 20000 /* of a Jacobian: larger systems are left as they are */
#define FACTORS 100 /* of one leg of the path */
#define ITERATIONS 12
#define CLOSE 1e-2 /* of an unknown: the last correction of Newton's method, behind one of half of it at most, ... */
#define SLOW 0.1 /* ... and of that: far above its load an exponential has corrections that are small beside the
                         * unknown and all alike.  Where they fall by less the factors are made anew. */
#define EXACT SD_HALF_OF_ITS_DIGITS /* of an unknown: the same where the row is linear */
#define FIRST 0.125 /* of a leg: the first step along it */
#define LONGEST 0.25
#define SHORTEST SD_UNSEEN
#define GROUP SD_SMALL /* of their like: what is smaller is not followed to its own digits */

/* The path: a point (t, h, d), the work of Newton's method there. */
typedef struct {
    const sd_balance *balance;
    sd_system *system;
    sd_linear *linear;
    double t0, quick, span;
    const double *y, *scale;
    double *d, *slope, *most;                             /* [n]; slope: of d along the leg; most: the largest |d| so far */
    double *at, *rate, *tried, *step, *like, *residual;   /* [n], like [kinds], residual [rows] */
    double *jy, *jyd;                                     /* [entries] */
    int32_t factors;
} path;

/* the largest correction, each beside its unknown or a part of the largest of its like */
static double correction(const path *p)
{
    const sd_balance *b = p->balance;
    double worst = 0.0;
    memset(p->like, 0, (size_t)b->kinds * sizeof *p->like);
    for (int32_t k = 0; k < b->unknowns; k++)
        p->like[b->kind[k]] = sd_larger(p->like[b->kind[k]], fabs(p->tried[k]));
    for (int32_t k = 0; k < b->unknowns; k++)
        if (p->step[k] != 0.0)
            worst = sd_larger(worst, fabs(p->step[k]) / fmax(fabs(p->tried[k]), GROUP * p->like[b->kind[k]]));
    return worst;
}

static int factored(path *p, double t, double h)
{
    sd_system *s = p->system;
    p->factors++;
    sd_jacobian(s, t, p->at, p->rate, NULL, p->jy, p->jyd);
    for (int32_t e = 0; e < s->entries; e++)
        p->jy[e] += p->jyd[e] / h;
    return sd_first_bad(s->entries, p->jy) < 0 && sd_linear_factor(p->linear, p->jy, p->scale) == 0;
}

/* tried := d at (t, h), from tried; fresh: the factors are those of this h */
static int converged(path *p, double t, double h, int fresh)
{
    sd_system *s = p->system;
    double last = INFINITY;
    for (int32_t iteration = 0; iteration < ITERATIONS && !*s->stop; iteration++) {
        for (int32_t k = 0; k < s->unknowns; k++) {
            p->at[k] = p->y[k] + p->tried[k];
            p->rate[k] = p->tried[k] / h;
        }
        sd_residual(s, t, p->at, p->rate, p->residual);
        if (sd_first_bad(s->rows, p->residual) >= 0 || (!fresh && !factored(p, t, h)))
            return 0;
        memcpy(p->step, p->residual, (size_t)s->unknowns * sizeof *p->step);
        sd_linear_solve(p->linear, p->step);
        for (int32_t k = 0; k < s->unknowns; k++)
            p->tried[k] -= p->step[k];
        if (sd_first_bad(s->unknowns, p->tried) >= 0)
            return 0;
        double now = correction(p);
        int fast = now <= SLOW * last;
        if (now <= EXACT || (now <= CLOSE && last <= 0.5 && fast))
            return 1;
        fresh = fast && iteration > 0;
        last = now;
    }
    return 0;
}

/* t and h at a part of a leg; begun: part of quick that the first leg came to */
static void placed(const path *p, int second, double part, double begun, double *t, double *h)
{
    *t = p->t0 + (second ? begun : part) * p->quick;
    *h = second ? p->quick * pow(p->span / p->quick, part) : p->quick;
}

/* the part of a leg that is done */
static double followed(path *p, int second, double begun)
{
    int32_t n = p->system->unknowns, fresh = 0;
    double done = 0.0, next = FIRST;
    p->factors = 0;
    memset(p->slope, 0, (size_t)n * sizeof *p->slope);
    while (done < 1.0 && next > SHORTEST && p->factors < FACTORS && !*p->system->stop) {
        double part = fmin(done + next, 1.0), t, h;
        placed(p, second, part, begun, &t, &h);
        for (int32_t k = 0; k < n; k++)
            p->tried[k] = p->d[k] + p->slope[k] * (part - done);
        if (!converged(p, t, h, fresh)) {
            next *= 0.25;
            fresh = 0;
            continue;
        }
        for (int32_t k = 0; k < n; k++) {
            p->slope[k] = (p->tried[k] - p->d[k]) / (part - done);
            p->d[k] = p->tried[k];
            p->most[k] = fmax(p->most[k], fabs(p->d[k]));
        }
        done = part;
        next = fmin(2.0 * next, LONGEST);
        fresh = !second;
    }
    return done;
}

int sd_response(const sd_balance *balance, sd_system *system, const sd_order *order, double t0, double quick, double span,
                const double *y, const double *scale, double *least, double *most)
{
    size_t n = (size_t)system->unknowns, rows = (size_t)system->rows, entries = (size_t)system->entries;
    if (entries > ENTRIES || rows != n)
        return 0;
    double *memory = calloc(6 * n + rows + 2 * entries + (size_t)balance->kinds + 1, sizeof *memory);
    sd_linear *linear = sd_linear_ordered(system->unknowns, system->column, system->row, order);
    if (!memory || !linear) {
        free(memory);
        sd_linear_free(linear);
        return -1;
    }
    path p = {.balance = balance, .system = system, .linear = linear, .t0 = t0, .quick = fmin(quick, span), .span = span,
              .y = y, .scale = scale, .most = most};
    p.d = memory, p.slope = p.d + n, p.at = p.slope + n, p.rate = p.at + n, p.tried = p.rate + n, p.step = p.tried + n;
    p.residual = p.step + n, p.jy = p.residual + rows, p.jyd = p.jy + entries, p.like = p.jyd + entries;
    memset(most, 0, n * sizeof *most);
    double begun = followed(&p, 0, 0.0), on = 0.0;
    memcpy(least, most, n * sizeof *least);
    if (begun > 0.0) {
        on = followed(&p, 1, begun);
        double further = pow(span / p.quick, 2.0 * (1.0 - on)) / begun;
        for (size_t k = 0; k < n; k++)
            most[k] *= further;
    }
    free(memory);
    sd_linear_free(linear);
    return begun > 0.0;
}
