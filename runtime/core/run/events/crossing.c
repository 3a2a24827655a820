/* Where within a step something watched changes: see crossing.h. */
#include "run/events/crossing.h"

#include <math.h>
#include <string.h>

#include "run/events/fits.h"
#include "linear/tuning.h"

#define ITERATIONS 60    /* of Ridders' method */
#define SAME 8.0         /* spacings of t within which two instants are one */
#define FOLLOWED 8       /* points settled from an instant of the dense output as it is */
#define CLOSER 6         /* of these, after which what is ENOUGH will do */
#define ROUND_OFF 1e-15  /* of the largest value and terms of a row, or of its flight: it is no closer to zero */
#define ENOUGH SD_SMALL /* of what counts as zero: what is watched may be past it by */
#define AT_ONCE SD_UNSEEN /* of what is searched: a moment */
#define WIDER 3.0        /* times the stretch before: the next one that is searched behind where it has been seen */

typedef void look(sd_run *run, double t, double *values);

/* side * value of a row less a level, which falls through zero; enough: past it by so much at most */
typedef struct sd_fall {
    int32_t row;
    double side, level, enough;
} sd_fall;

static double spacing(double t)
{
    return nextafter(fabs(t), INFINITY) - fabs(t);
}

/* Whether a watch changes between two points; what leaves zero upwards, and still does, has not. */
static int falls(const sd_modes *m, int32_t k, const double *low, const double *high)
{
    const sd_mode *mode = sd_mode_now(m);
    int32_t row = mode->row[k], rate = mode->rate[k];
    double side = mode->side[k], level = sd_mode_end(m, row, side * low[row]), least = sd_mode_least(m, row);
    int rises = rate >= 0 && side * low[row] <= 0.0 && side * low[rate] > 0.0 && side * high[rate] >= 0.0;
    if (rate >= 0 && m->thrown[row]) {
        double still = -sd_mode_zero(m, rate);
        rises = side * low[row] <= level + least && side * low[rate] >= still && side * high[rate] >= still;
    }
    return side * high[row] - level < -least && !rises;
}

/* Where side*value - level falls through zero between a (fa) and b (fb), by no more than `enough`; a where it is not above
 * zero there already, nor a moment behind. */
static double root(sd_run *run, look *at, sd_fall fall, double a, double fa, double b, double fb)
{
    const int32_t row = fall.row;
    const double side = fall.side, level = fall.level, enough = fall.enough;
    double *values = run->modes->values;
    if (fa <= 0.0) { /* it may rise before it falls */
        double behind = a + AT_ONCE * (b - a);
        at(run, behind, values);
        fa = side * values[row] - level;
        if (!(a < behind && fa > 0.0))
            return a;
        a = behind;
    }
    for (int i = 0; i < ITERATIONS && !(fb <= 0.0 && fb >= -enough); i++) {
        double middle = 0.5 * (a + b);
        if (!(a < middle && middle < b))
            break;
        at(run, middle, values);
        double fm = side * values[row] - level, size = sqrt(fm * fm - fa * fb);
        double t = size > 0.0 ? middle + (middle - a) * fm / size : middle;
        if (fm > 0.0)
            a = middle, fa = fm;
        else
            b = middle, fb = fm;
        if (a < t && t < b) {
            at(run, t, values);
            double ft = side * values[row] - level;
            if (ft > 0.0)
                a = t, fa = ft;
            else
                b = t, fb = ft;
        }
        if (b - a <= 2.0 * spacing(fmax(fabs(a), fabs(b))) || fb == 0.0)
            break;
    }
    return b;
}

/* Where watch k falls through zero between a (low) and b (high); what begins at zero and rises falls from its crest. */
static double instant(sd_run *run, look *at, int32_t k, double a, double b)
{
    sd_modes *m = run->modes;
    int32_t row = sd_mode_now(m)->row[k], rate = sd_mode_now(m)->rate[k];
    double side = sd_mode_now(m)->side[k], begin = a, from = side * m->low[row];
    double level = sd_mode_end(m, row, from), value = from - level;
    double enough = at == sd_run_observe ? 0.0 : ENOUGH * m->small * m->largest[row];
    if (value <= 0.0 && rate >= 0 && side * m->low[rate] > 0.0 && side * m->high[rate] < 0.0) {
        begin = root(run, at, (sd_fall){rate, side, 0.0, 0.0}, a, side * m->low[rate], b, side * m->high[rate]);
        at(run, begin, m->values);
        level = sd_mode_end(m, row, side * m->values[row]);
        value = side * m->values[row] - level;
        if (value <= 0.0 && !m->thrown[row])
            return b;
        if (value <= 0.0) { /* that is round-off too: through what it may fall by unseen */
            value += sd_mode_least(m, row);
            level -= sd_mode_least(m, row);
        }
    }
    return root(run, at, (sd_fall){row, side, level, enough}, begin, value, b, side * m->high[row] - level);
}

/* The first part of begin..end in whose end something watched has changed, low..high, and how many of m->which; 0: none.
 * m->low, m->high: the values there. */
static int32_t part_of(sd_run *run, look *at, double end, double *low, double *high)
{
    sd_modes *m = run->modes;
    int32_t watches = sd_mode_now(m)->watches, hits = 0;
    double begin = fmax(m->begin, fmin(run->t_clear, end));
    *low = *high = begin;
    at(run, begin, m->low);
    /* where it has been seen, which may be less than what a settled point is off by, then ever more behind it */
    double stop = begin < run->t_seen && run->t_seen < end ? run->t_seen : end;
    for (int more = 1; more && !hits;) {
        more = stop < end;
        for (int part = 1; part <= SD_PARTS && !hits; part++) {
            if (*high > *low) {
                memcpy(m->low, m->high, (size_t)m->observed * sizeof(double));
                *low = *high;
            }
            *high = part == SD_PARTS ? stop : begin + (stop - begin) * part / SD_PARTS;
            at(run, *high, m->high);
            for (int32_t k = 0; k < watches; k++)
                if (falls(m, k, m->low, m->high))
                    m->which[hits++] = k;
        }
        double next = fmin(end, stop + WIDER * (stop - begin));
        begin = stop;
        stop = next;
    }
    return hits;
}

/* Of the watches m->which, which change within low..high, those that do first, and when. */
static int32_t first_found(sd_run *run, look *at, int32_t hits, double low, double high, double *t)
{
    sd_modes *m = run->modes;
    int32_t same = 0;
    *t = INFINITY;
    for (int32_t i = 0; i < hits; i++) {
        m->found[i] = instant(run, at, m->which[i], low, high);
        *t = fmin(*t, m->found[i]);
    }
    for (int32_t i = 0; i < hits; i++)
        if (m->found[i] <= *t + SAME * spacing(fmax(fabs(low), fabs(high))))
            m->which[same++] = m->which[i];
    return same;
}

/* The same of all watches: where what is found first turns others may have changed before, and be back at high. */
static int32_t first_of(sd_run *run, look *at, int32_t hits, double low, double high, double *t)
{
    sd_modes *m = run->modes;
    const int32_t watches = sd_mode_now(m)->watches;
    int32_t same = first_found(run, at, hits, low, high, t);
    for (int more = 1; more && low < *t && *t < high;) {
        at(run, *t, m->values);
        int32_t fallen = 0;
        more = 0;
        for (int32_t k = 0; k < watches; k++)
            more |= falls(m, k, m->low, m->values) && !falls(m, k, m->low, m->high);
        if (!more)
            break;
        high = *t;
        memcpy(m->high, m->values, (size_t)m->observed * sizeof(double));
        for (int32_t k = 0; k < watches; k++)
            if (falls(m, k, m->low, m->high))
                m->which[fallen++] = k;
        same = first_found(run, at, fallen, low, high, t);
    }
    return same;
}

/* Whether nothing but watch `one` is past zero in values. */
static int alone(const sd_modes *m, int32_t one, const double *values)
{
    const sd_mode *mode = sd_mode_now(m);
    for (int32_t k = 0; k < mode->watches; k++)
        if (k != one && mode->side[k] * values[mode->row[k]] - sd_mode_level(m, mode->row[k]) < -sd_mode_least(m, mode->row[k]))
            return 0;
    return 1;
}

/* From where one watch falls through zero on the dense output as it is to where it does on the settled one, nearly always
 * the same: by secants.  0: that is not found so. */
static int follow(sd_run *run, int32_t one, double low, double high, double *t)
{
    sd_modes *m = run->modes;
    int32_t row = sd_mode_now(m)->row[one];
    double side = sd_mode_now(m)->side[one], from = side * m->low[row], level = sd_mode_end(m, row, from);
    double value = from - level, before = low, at = *t, slope = -value / (at - low);
    double height = m->thrown[row] ? fmin(m->height[row], m->largest[row]) : m->largest[row];
    double enough = ENOUGH * fmin(m->small * m->largest[row], ENOUGH * height);
    if (!(value > 0.0 && at > low))
        return 0;
    for (int k = 0; k < FOLLOWED && low < at && at <= high; k++) {
        double last = value;
        sd_run_observe(run, at, m->values);
        value = side * m->values[row] - level;
        slope = k > 0 && at != before ? (value - last) / (at - before) : slope;
        double exact = fmax(SAME * spacing(at) * fabs(slope), ROUND_OFF * height);
        if (value <= 0.0 && value >= -(k < CLOSER ? fmin(exact, enough) : enough)) {
            *t = at;
            return alone(m, one, m->values);
        }
        before = at;
        at -= (value + 0.5 * fmin(exact, enough)) / slope;
        at = at != before ? at : before + copysign(spacing(before), value);
    }
    return 0;
}

int32_t sd_run_crossing(sd_run *run, double end, double *t)
{
    double low, high;
    int32_t hits = part_of(run, sd_run_look, end, &low, &high);
    if (hits && first_of(run, sd_run_look, hits, low, high, t) == 1 && follow(run, run->modes->which[0], low, high, t))
        return 1;
    hits = part_of(run, sd_run_observe, end, &low, &high);
    hits = hits ? first_of(run, sd_run_observe, hits, low, high, t) : 0;
    if (hits)
        sd_run_observe(run, *t, run->modes->values);
    return hits;
}
