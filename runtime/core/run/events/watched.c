/* Whether a step passes over a change of what is watched: see watched.h. */
#include "run/events/watched.h"
#include "linear/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NARROWER 20   /* times the part of a step within which something changes is parted again */
#define A_TURN 0.5     /* from one extreme to the next: a part at most */
#define SHIFT 0.13    /* of a part, by which every other one is longer */
#define ODD(part) (part + SHIFT)
/* of the cubic through four points: what the value at k counts at 2 beside those at a, b and c */
#define IN_THE_MIDDLE(k, a, b, c) ((2.0 - (a)) / ((k) - (a)) * ((2.0 - (b)) / ((k) - (b))) * ((2.0 - (c)) / ((k) - (c))))
#define GOLDEN 0.6180339887498949 /* of what the bottom lies within: what is kept */
#define DEEP 70        /* of these: to the spacing of t */
#define STEEPER 2.0    /* times the slopes met: as steep it may fall between two looks */
#define AT_ONCE SD_UNSEEN /* of the first part: what begins at zero and falls there may come back within it */
#define OFF 0.1        /* of what is met within a step: what is interpolated between its ends may be off by */
#define SETTLED 2
#define FAINT SD_SAME /* of the largest value of what is watched: what it is off by unseen */

typedef void look(sd_run *run, double t, double *values);

/* The parabola through three points: its rise from the first to the second, and half of its second derivative. */
static double parabola(const double *x, const double *value, double *bend)
{
    double rise = (value[1] - value[0]) / (x[1] - x[0]);
    *bend = ((value[2] - value[1]) / (x[2] - x[1]) - rise) / (x[2] - x[0]);
    return rise;
}

/* The least value between x[0] and x[2] of the parabola through three points; of the points, where it has none there. */
static double bottom(const double *x, const double *value)
{
    double bend, rise = parabola(x, value, &bend), at = 0.5 * (x[0] + x[1] - rise / bend);
    if (!(bend > 0.0 && at > x[0] && at < x[2]))
        return fmin(value[0], value[2]);
    return value[0] + (at - x[0]) * (rise + bend * (at - x[1]));
}

/* The parabola through three points at x[3]. */
static double beyond(const double *x, const double *value)
{
    double bend, rise = parabola(x, value, &bend);
    return value[0] + (x[3] - x[0]) * (rise + bend * (x[3] - x[1]));
}

/* Whether a watch may fall through zero and come back between the ends of SD_PARTS parts, which lie at 0, ODD(1), 2,
 * ODD(3), 4 (no period is a part of all): the value in the middle is off the cubic through the others by more than
 * a quarter of the least of them, or a parabola through neighbours falls, by so much more at most.  first: what begins at
 * zero leaves it. */
static int unfollowed(const sd_run *run, const sd_watch *watch, int first)
{
    static const double part[SD_PARTS + 1] = {0.0, ODD(1), 2.0, ODD(3), 4.0};
    static const double against[SD_PARTS + 1] = {
        -IN_THE_MIDDLE(0.0, ODD(1), ODD(3), 4.0), -IN_THE_MIDDLE(ODD(1), 0.0, ODD(3), 4.0), 1.0,
        -IN_THE_MIDDLE(ODD(3), 0.0, ODD(1), 4.0), -IN_THE_MIDDLE(4.0, 0.0, ODD(1), ODD(3))};
    double off = 0.0, least = INFINITY, most = 0.0, found[SD_PARTS + 1];
    for (int k = 0; k <= SD_PARTS; k++) {
        found[k] = watch->side * run->looked[(size_t)k * (size_t)run->observed + (size_t)watch->row];
        off += against[k] * found[k];
        most = fmax(most, fabs(found[k]));
    }
    double unseen = fmax(watch->tolerance, FAINT * most), low = INFINITY, wrong = fabs(off);
    first = first && found[0] <= unseen;
    for (int k = first; k <= SD_PARTS; k++)
        least = fmin(least, found[k]);
    for (int k = 0; k + 2 <= SD_PARTS; k++) {
        if (k >= first)
            low = fmin(low, bottom(part + k, found + k));
        if (k + 3 <= SD_PARTS)
            wrong = fmax(wrong, fabs(beyond(part + k, found + k) - found[k + 3]));
    }
    return fabs(off) > fmax(0.25 * least, unseen) || low - wrong < -unseen;
}

/* What watch has at t. */
static double value_of(sd_run *run, const sd_watch *watch, double t, look *at)
{
    double *values = run->looked + (size_t)(SD_PARTS + 1) * (size_t)run->observed;
    at(run, t, values);
    return watch->side * values[watch->row];
}

/* The bottom of a watch within a..b, where it has fa, fb, by golden section; whether it has fallen there (*seen)
 * and not before (*clear).  It is given up where slopes like those met so far lead to no fall. */
static int bottomed(sd_run *run, const sd_watch *watch, double a, double fa, double b, double fb, look *at, double *clear,
                    double *seen)
{
    double x = b - GOLDEN * (b - a), y = a + GOLDEN * (b - a);
    double fx = value_of(run, watch, x, at), fy = value_of(run, watch, y, at);
    for (int k = 0; k < DEEP; k++) {
        double least = fmin(fx, fy), slope = fmax(fabs(fx - fa) / (x - a), fabs(fb - fy) / (b - y));
        int fell = least < -watch->tolerance, apart = a < x && x < y && y < b;
        if (fell && (!apart || slope * (b - a) <= -least)) {
            *seen = fx < fy ? x : y;
            return 1;
        }
        if (!apart || (!fell && least - STEEPER * slope * (b - a) >= -watch->tolerance))
            return 0;
        if (fx < fy) {
            b = y, fb = fy, y = x, fy = fx;
            x = b - GOLDEN * (b - a), fx = value_of(run, watch, x, at);
        } else {
            a = x, fa = fx, x = y, fx = fy;
            *clear = fa < -watch->tolerance ? *clear : a;
            y = a + GOLDEN * (b - a), fy = value_of(run, watch, y, at);
        }
    }
    return 0;
}

/* The first fall of a watch that comes back between two of the points t[0..SD_PARTS] it was looked at: where it
 * falls before them and rises behind (|u| - a at a corner).  first: as unfollowed. */
static int dips(sd_run *run, const sd_watch *watch, const double *t, int first)
{
    double f[SD_PARTS + 1];
    for (int k = 0; k <= SD_PARTS; k++)
        f[k] = watch->side * run->looked[(size_t)k * (size_t)run->observed + (size_t)watch->row];
    for (int k = first && f[0] <= watch->tolerance; k < SD_PARTS; k++) {
        double clear = t[k], seen = t[k + 1];
        int falls = k == 0 || f[k] < f[k - 1], rises = k + 2 > SD_PARTS || f[k + 2] > f[k + 1];
        if (falls && rises && bottomed(run, watch, t[k], f[k], t[k + 1], f[k + 1], sd_run_look, &clear, &seen)) {
            if (seen < run->t_seen)
                run->t_clear = clear, run->t_seen = seen;
            return 1;
        }
    }
    return 0;
}

/* A fall of a watch between a and b where it is settled, into t_clear..t_seen if it is before t_seen; begin: where it has not
 * fallen.  Of what algebra alone determines no error test follows what is interpolated within a step. */
static int falls_settled(sd_run *run, const sd_watch *watch, double begin, double a, double b)
{
    double clear = begin, seen = a, fa = value_of(run, watch, a, sd_run_observe);
    if (!(fa < -watch->tolerance)) {
        clear = a;
        if (!bottomed(run, watch, a, fa, b, value_of(run, watch, b, sd_run_observe), sd_run_observe, &clear, &seen))
            return 0;
    }
    if (seen < run->t_seen)
        run->t_clear = clear, run->t_seen = seen;
    return 1;
}

/* Whether a watch that is lowest within t[0..SD_PARTS], where it misses zero by less than it may be off by, falls as it is
 * settled.  first: as unfollowed. */
static int touches(sd_run *run, const sd_watch *watch, const double *t, int first)
{
    double f[SD_PARTS + 1], most = -INFINITY;
    for (int k = 0; k <= SD_PARTS; k++) {
        f[k] = watch->side * run->looked[(size_t)k * (size_t)run->observed + (size_t)watch->row];
        most = fmax(most, f[k]);
    }
    first = first && f[0] <= watch->tolerance;
    int low = first;
    for (int k = first + 1; k <= SD_PARTS; k++)
        low = f[k] < f[low] ? k : low;
    const int a = low > first ? low - 1 : low, b = low < SD_PARTS ? low + 1 : low;
    const double least = b > a + 1 ? fmin(f[low], bottom(t + a, f + a)) : f[low];
    return f[a] > watch->tolerance && least <= OFF * (most - f[low]) && falls_settled(run, watch, t[0], t[a], t[b]);
}

static int fallen(const sd_run *run, const double *values)
{
    for (int32_t i = 0; i < run->watches; i++)
        if (run->watch[i].side * values[run->watch[i].row] < -run->watch[i].tolerance)
            return 1;
    return 0;
}

/* What has been seen to change within from..to as it is interpolated: where it does as it is settled, if it does. */
static void confirm(sd_run *run, double from, double to)
{
    const double seen = run->t_seen;
    double *values = run->looked + (size_t)(SD_PARTS + 1) * (size_t)run->observed;
    sd_run_observe(run, seen, values);
    if (fallen(run, values)) {
        if (run->t_clear > from) {
            sd_run_observe(run, run->t_clear, values);
            run->t_clear = fallen(run, values) ? from : run->t_clear;
        }
        return;
    }
    sd_run_look(run, seen, run->looked);
    run->t_seen = INFINITY;
    for (int32_t i = 0; i < run->watches; i++) {
        const sd_watch *watch = &run->watch[i];
        if (watch->side * run->looked[watch->row] < -watch->tolerance)
            falls_settled(run, watch, from, from, to);
    }
    if (run->t_seen == INFINITY)
        run->t_seen = seen;
}

/* Whether a watch that begins at zero falls and comes back between the points t[0..SD_PARTS] (a ball that is thrown). */
static int returns(sd_run *run, const sd_watch *watch, const double *t)
{
    const double *values = run->looked + watch->row, f = watch->side * values[0];
    double back = f, clear = t[0], seen = t[1];
    int k = 0;
    if (f > watch->tolerance)
        return 0;
    while (back <= f && k < SD_PARTS)
        back = watch->side * values[(size_t)++k * (size_t)run->observed];
    if (back <= f || (k == 1 && value_of(run, watch, t[0] + AT_ONCE * (t[1] - t[0]), sd_run_look) >= f))
        return 0;
    if (!bottomed(run, watch, t[0], f, t[k], back, sd_run_look, &clear, &seen))
        return 0;
    if (seen < run->t_seen)
        run->t_clear = clear, run->t_seen = seen;
    return 1;
}

/* Looks at `parts` parts of begin..end, up to the first at whose end something watched has changed, which is then
 * t_clear..t_seen; whether what is watched is not followed by so many.  seek: nor falls and comes back between two.  *fell:
 * whether something has; SETTLED: where it is settled. */
static int scan(sd_run *run, double begin, double end, int parts, int seek, int *fell)
{
    size_t row = (size_t)run->observed;
    int more = 0;
    double at[SD_PARTS + 1] = {begin};
    sd_run_look(run, begin, run->looked);
    run->t_seen = begin;
    *fell = 0;
    for (int part = 1; part <= parts && !*fell; part++) {
        int k = (part - 1) % SD_PARTS + 1;
        double *values = run->looked + (size_t)k * row;
        double t = part == parts ? end : begin + (end - begin) * (part + (part % 2 ? SHIFT : 0.0)) / parts;
        sd_run_look(run, t, values);
        run->t_clear = run->t_seen;
        run->t_seen = at[k] = t;
        *fell = fallen(run, values);
        if (k < SD_PARTS)
            continue;
        int dip = 0;
        for (int32_t i = 0; i < run->watches && (seek || !more) && !*fell; i++) {
            const int turns = unfollowed(run, &run->watch[i], part == SD_PARTS);
            more |= turns;
            const int falls = turns && seek && dips(run, &run->watch[i], at, part == SD_PARTS);
            const int nearly = !falls && seek && run->settle && touches(run, &run->watch[i], at, part == SD_PARTS);
            dip |= nearly ? SETTLED : falls;
            dip |= seek && part == SD_PARTS && returns(run, &run->watch[i], at);
        }
        *fell |= dip;
        memcpy(run->looked, values, row * sizeof(double));
        at[0] = t;
    }
    return more;
}

int sd_run_changes(sd_run *run, double from)
{
    double to = run->stepper->ivp->t, end = to;
    int parts = SD_PARTS, fell = 0;
    run->t_clear = from;
    run->t_seen = to;
    if (!run->watches)
        return 0;
    if (!run->looked && !(run->looked = malloc((SD_PARTS + 2) * (size_t)run->observed * sizeof(double))))
        return 1; /* it is sought without */
    while (run->turns > 0.0 && parts < SD_FINEST && to - from > (double)parts * A_TURN * run->turns)
        parts *= SD_PARTS; /* of what turns several times between two looks they may say nothing */
    const int known = parts > SD_PARTS;
    int more = scan(run, from, to, parts, 1, &fell);
    const double clear = run->t_clear, seen = run->t_seen;
    const int settled = fell & SETTLED, parted = more || known;
    for (; more && parts < SD_FINEST; more = scan(run, from, end, parts, 0, &fell)) {
        end = fell ? run->t_seen : end;
        parts *= SD_PARTS;
    }
    for (int k = 0; parted && fell && k < NARROWER; k++) { /* of several changes between two looks the first */
        double clear = run->t_clear, seen = run->t_seen;
        scan(run, clear, seen, SD_PARTS, 0, &fell);
        if (!fell)
            run->t_clear = clear, run->t_seen = seen;
        if (run->t_seen == seen)
            break;
    }
    run->t_clear = parted ? fmax(from, 2.0 * run->t_clear - run->t_seen) : from;
    if (fell && run->settle)
        confirm(run, from, to);
    if (settled && !(fell && run->t_seen < seen))
        run->t_clear = clear, run->t_seen = seen;
    return fell || settled;
}
