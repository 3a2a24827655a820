/* Extrema: see extrema.h. */
#include "run/meters/extrema.h"

#include "run/run.h"

#include <math.h>

#define LOOKS 8       /* parts of a step */
#define NARROW 0.125  /* of the distance between two looks: a crest of h omega = 1.2 is then timed to 1e-4 of 1 / omega */

void sd_extrema_begin(sd_extrema *extrema)
{
    extrema->number = 0;
    extrema->until = -INFINITY;
    for (int32_t q = 0; q < extrema->columns; q++) {
        extrema->least[q] = INFINITY;
        extrema->most[q] = -INFINITY;
    }
}

static void look(sd_run *run, double t, double *values)
{
    run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
    sd_run_quantities(run, t, values);
}

/* the parabola through (t[k], v[k]): when it turns; its value there */
static double vertex(const double t[3], const double v[3], double *value)
{
    double one = (v[1] - v[0]) / (t[1] - t[0]), two = (v[2] - v[1]) / (t[2] - t[1]);
    double bend = (two - one) / (t[2] - t[0]), slope = one + bend * (t[1] - t[0]);
    *value = v[1] - 0.25 * slope * slope / bend;
    return t[1] - 0.5 * slope / bend;
}

static int turns(const double v[3])
{
    return (v[1] > v[0] && v[1] > v[2]) || (v[1] < v[0] && v[1] < v[2]);
}

/* the value of quantity q at its crest near `at`, within the last step */
static double crest(sd_run *run, int32_t q, double at, double between)
{
    const double from = run->t_from, to = run->t_to, wide = fmin(NARROW * between, 0.5 * (to - from));
    const double middle = fmin(fmax(at, from + wide), to - wide), t[3] = {middle - wide, middle, middle + wide};
    double v[3], value;
    for (int k = 0; k < 3; k++) {
        look(run, t[k], run->extrema->settled);
        v[k] = run->extrema->settled[q];
    }
    double when = turns(v) ? vertex(t, v, &value) : at;
    sd_run_observe(run, when, run->extrema->settled);
    if (run->extrema->watched)
        sd_run_sample(run, when);
    return run->extrema->settled[q];
}

static void take(sd_run *run, int32_t q, double now)
{
    sd_extrema *x = run->extrema;
    const double t[3] = {x->time[0], x->time[1], now}, v[3] = {x->look[0][q], x->look[1][q], x->look[2][q]};
    double value, at;
    if (!turns(v))
        return;
    at = vertex(t, v, &value);
    if (!(v[1] > v[0] ? value > x->most[q] : value < x->least[q]))
        return;
    if (at >= run->t_from) /* else the dense output of its step is no more */
        value = crest(run, q, at, now - x->time[1]);
    x->least[q] = fmin(x->least[q], value);
    x->most[q] = fmax(x->most[q], value);
}

void sd_extrema_within(sd_run *run)
{
    sd_extrema *x = run->extrema;
    const double from = run->t_from, to = run->t_to;
    if (!(to > from) || to == x->until)
        return;
    for (int k = x->number > 0; k <= LOOKS; k++) {
        double t = k == LOOKS ? to : from + (to - from) * k / LOOKS;
        look(run, t, x->look[2]);
        for (int32_t q = 0; q < x->columns && x->number > 1; q++)
            take(run, q, t);
        double *oldest = x->look[0];
        x->look[0] = x->look[1];
        x->look[1] = x->look[2];
        x->look[2] = oldest;
        x->time[0] = x->time[1];
        x->time[1] = t;
        x->number++;
    }
    x->until = to;
}
