/* Transitions between modes that are known: see modes.h. */
#include "run/modes.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "run/fits.h"
#include "run/run.h"

#define ITERATIONS 60    /* of Ridders' method */
#define SAME 8.0         /* spacings of t within which two instants are one */
#define HELD 1e8         /* weight of the state across an event */
#define ROWS_OF_EVENT 8  /* at most, beside those asked for */

static double spacing(double t)
{
    return nextafter(fabs(t), INFINITY) - fabs(t);
}

/* -- when ------------------------------------------------------------------------------------------------------ */

/* Whether a watch changes between two points; what leaves zero upwards, and still does, has not. */
static int falls(const sd_modes *m, int32_t k, const double *low, const double *high)
{
    const sd_mode *mode = sd_mode_now(m);
    int32_t row = mode->row[k], rate = mode->rate[k];
    double side = mode->side[k];
    int rises = rate >= 0 && side * low[row] <= 0.0 && side * low[rate] > 0.0 && side * high[rate] >= 0.0;
    return side * high[row] < -sd_mode_zero(m, row) && !rises;
}

/* Where side*value falls through zero between a (fa) and b (fb); a where it is not above zero there already. */
static double root(sd_run *run, int32_t row, double side, double a, double fa, double b, double fb)
{
    double *values = run->modes->values;
    if (fa <= 0.0)
        return a;
    for (int i = 0; i < ITERATIONS; i++) {
        double middle = 0.5 * (a + b);
        if (!(a < middle && middle < b))
            break;
        sd_run_observe(run, middle, values);
        double fm = side * values[row], size = sqrt(fm * fm - fa * fb);
        double t = size > 0.0 ? middle + (middle - a) * fm / size : middle;
        if (fm > 0.0)
            a = middle, fa = fm;
        else
            b = middle, fb = fm;
        if (a < t && t < b) {
            sd_run_observe(run, t, values);
            double ft = side * values[row];
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
static double instant(sd_run *run, int32_t k, double a, double b)
{
    sd_modes *m = run->modes;
    int32_t row = sd_mode_now(m)->row[k], rate = sd_mode_now(m)->rate[k];
    double side = sd_mode_now(m)->side[k], begin = a, value = side * m->low[row];
    if (value <= 0.0 && rate >= 0 && side * m->low[rate] > 0.0 && side * m->high[rate] < 0.0) {
        begin = root(run, rate, side, a, side * m->low[rate], b, side * m->high[rate]);
        sd_run_observe(run, begin, m->values);
        value = side * m->values[row];
        if (value <= 0.0)
            return b;
    }
    return root(run, row, side, begin, value, b, side * m->high[row]);
}

/* The first instant within m->begin..end at which something watched changes, and how many of m->which; 0: none. */
static int32_t crossing(sd_run *run, double end, double *t)
{
    sd_modes *m = run->modes;
    int32_t watches = sd_mode_now(m)->watches, hits = 0, same = 0;
    double begin = fmax(m->begin, fmin(run->t_clear, end)), low = begin, high = low;
    sd_run_observe(run, low, m->low);
    double stop = begin < run->t_seen && run->t_seen < end ? run->t_seen : end; /* where it has been seen, then all */
    for (int more = 1; more && !hits; begin = stop, stop = end) {
        more = stop < end;
        for (int part = 1; part <= SD_PARTS && !hits; part++) {
            if (high > low) {
                memcpy(m->low, m->high, (size_t)m->observed * sizeof(double));
                low = high;
            }
            high = part == SD_PARTS ? stop : begin + (stop - begin) * part / SD_PARTS;
            sd_run_observe(run, high, m->high);
            for (int32_t k = 0; k < watches; k++)
                if (falls(m, k, m->low, m->high))
                    m->which[hits++] = k;
        }
    }
    if (!hits)
        return 0;
    *t = INFINITY;
    for (int32_t i = 0; i < hits; i++) {
        m->found[i] = instant(run, m->which[i], low, high);
        *t = fmin(*t, m->found[i]);
    }
    for (int32_t i = 0; i < hits; i++)
        if (m->found[i] <= *t + SAME * spacing(fmax(fabs(low), fabs(high))))
            m->which[same++] = m->which[i];
    return same;
}

/* -- what ------------------------------------------------------------------------------------------------------ */

/* values [observed] at a point, whose sizes are kept */
static void look(sd_run *run, double t, const double *y, const double *yd, double *values)
{
    sd_modes *m = run->modes;
    double *scale = m->high;
    memset(values, 0, (size_t)m->observed * sizeof(double));
    memset(scale, 0, (size_t)m->observed * sizeof(double));
    run->observe->rows(&run->observe->frame, t, y, yd, values);
    if (run->observe_scale)
        run->observe_scale->rows(&run->observe_scale->frame, t, y, yd, scale);
    for (int32_t i = 0; i < m->observed; i++) {
        double size = fmax(fabs(values[i]), fabs(scale[i]));
        if (size > m->largest[i] && isfinite(size))
            m->largest[i] = size;
    }
    for (int32_t g = 0, i = 0; g < m->alikes; g++) {
        double most = 0.0;
        for (int32_t k = i; k < m->alike_end[g]; k++)
            most = fmax(most, m->largest[m->alike[k]]);
        for (; i < m->alike_end[g]; i++)
            m->largest[m->alike[i]] = most;
    }
}

/* The parameters and the rows of a mode. */
static void enter(sd_run *run, int32_t number)
{
    sd_modes *m = run->modes;
    const sd_mode *mode = &m->mode[number];
    for (int32_t i = 0; i < m->places; i++)
        m->p[m->place[i]] = mode->value[i];
    for (int32_t i = 0; i < m->systems; i++) {
        sd_system *system = m->system[i];
        const sd_held *held = &mode->held[i];
        system->held = held->held;
        system->clear = held->clear;
        system->held_row = held->row;
        system->held_unknown = held->unknown;
        system->held_slot = held->slot;
        system->held_rate = held->rate;
        system->cleared = held->cleared;
    }
    run->settle->ready = 0;
    m->now = number;
}

/* The assignments of a transition at t, to m->p and m->y, and its row of the log; 0: they lead elsewhere. */
static int assign(sd_run *run, const sd_transition *one, double t)
{
    sd_modes *m = run->modes;
    double *row = &m->log[(size_t)m->logged * (size_t)m->width];
    row[0] = t;
    row[1] = (double)(one - m->transition);
    look(run, t, m->y, m->yd, m->values);
    for (int32_t k = 0; k < m->relations; k++)
        m->exact[k] = one->sides[k] != sd_mode_now(m)->relation[k] && m->values[m->relation_row[k]] == 0.0;
    for (int32_t r = 0, a = 0; r < one->rounds; r++) {
        for (int32_t k = a; k < one->end[r]; k++) { /* all values are read, then all assigned */
            row[2 + 2 * k] = (one->kind[k] ? m->y : m->p)[one->place[k]];
            row[3 + 2 * k] = m->values[one->read[k]];
        }
        for (; a < one->end[r]; a++)
            (one->kind[a] ? m->y : m->p)[one->place[a]] = row[3 + 2 * a];
        look(run, t, m->y, m->yd, m->values);
        if (!sd_mode_sides_fit(m, one->sides + (r + 1) * m->relations, one->sides + r * m->relations, m->values))
            return 0;
    }
    return 1;
}

/* m->y, m->yd settled at t with the state held: 1; 0: that fails, or moves the state */
static int keeps_state(sd_run *run, double t)
{
    sd_modes *m = run->modes;
    sd_settle *settle = run->settle;
    memcpy(m->restart, m->y, (size_t)run->written * sizeof(double));
    settle->hold = HELD;
    int failed = sd_settle_point(settle, t, m->y, m->yd);
    settle->hold = 1.0;
    settle->ready = 0;
    for (int32_t i = 0; i < run->written && !failed; i++)
        failed = m->state[i] && !(fabs(m->y[i] - m->restart[i]) <= m->still * settle->scale[i]);
    return !failed;
}

/* The point behind a transition at t, from m->before, in m->restart and m->rate; the model is then in its mode.  0: it
 * does not lead there, and nothing has changed. */
static int lands(sd_run *run, const sd_transition *one, double t)
{
    sd_modes *m = run->modes;
    int32_t from = m->now;
    size_t written = (size_t)run->written * sizeof(double);
    memcpy(m->p_before, m->p, (size_t)m->parameters * sizeof(double));
    memcpy(m->y, m->before, written);
    memcpy(m->yd, m->before_d, written);
    int done = assign(run, one, t);
    enter(run, one->to);
    done = done && keeps_state(run, t);
    if (done) {
        memset(m->restart, 0, (size_t)m->unknowns * sizeof(double));
        memset(m->rate, 0, (size_t)m->unknowns * sizeof(double));
        memcpy(m->restart, m->y, written);
        memcpy(m->rate, m->yd, written);
        look(run, t, m->y, m->yd, m->values);
        done = sd_mode_fits(m, one->sides + one->rounds * m->relations, m->values) && sd_mode_ordinary(m) &&
               sd_mode_decided(m, &m->mode[from], one, m->values);
    }
    if (!done) {
        memcpy(m->p, m->p_before, (size_t)m->parameters * sizeof(double));
        enter(run, from);
    }
    return done;
}

/* What ends the piece that begins. */
static void watch(sd_run *run)
{
    sd_modes *m = run->modes;
    const sd_mode *mode = sd_mode_now(m);
    for (int32_t i = 0; i < m->observed; i++)
        m->largest[i] = fmax(m->largest[i], run->largest[i]);
    for (int32_t k = 0; k < mode->watches; k++)
        m->watch[k] = (sd_watch){mode->row[k], mode->side[k], sd_mode_zero(m, mode->row[k])};
    run->watch = m->watch;
    run->watches = mode->watches;
}

/* On from the point behind a transition. */
static void go_on(sd_run *run, double t, const sd_transition *transition)
{
    sd_modes *m = run->modes;
    double sample = INFINITY;
    for (int32_t k = 0; k < m->samples; k++)
        sample = fmin(sample, m->first + (double)m->next[k] * m->period[k]);
    *m->h_max = m->longest;
    *m->t_end = sample < m->segment - m->nothing ? sample : m->segment; /* where the text jumps too, that is first */
    run->end_kind = sample <= m->segment + m->nothing ? SD_TRACE : 0;
    for (int32_t i = 0; i < m->unknowns; i++)
        m->restart_d[i] = m->differential[i] ? m->rate[i] : 0.0;
    run->start_kind = SD_TRACE;
    sd_run_leave(run, m->before, m->before_d);
    sd_run_restart(run, t, t, m->restart, m->restart_d);
    run->start_kind = 0;
    m->logged++;
    m->left -= transition->entries;
    watch(run);
}

static int same(int32_t n, const int32_t *a, int32_t number, const int32_t *b)
{
    return n == number && !memcmp(a, b, (size_t)n * sizeof *a);
}

/* The transition that what crossed, or is due, takes at t; the model is then in its mode.  NULL: none. */
static const sd_transition *taken(sd_run *run, double t, int32_t crossed, int32_t due)
{
    sd_modes *m = run->modes;
    if (m->logged >= m->room || t - m->last <= m->nothing)
        return NULL;
    for (int32_t k = sd_mode_now(m)->first; k >= 0; k = m->transition[k].next) {
        const sd_transition *one = &m->transition[k];
        if (!same(one->crossed, one->which, crossed, m->which) || !same(one->due, one->sample, due, m->which))
            continue;
        if (one->entries > m->left)
            return NULL;
        if (!one->moves)
            enter(run, one->to);
        if (!one->moves || lands(run, one, t))
            return one;
    }
    return NULL;
}

/* Room for the rows of the last step up to t: 1; 0: not now; -1: never. */
static int roomy(const sd_run *run, double t)
{
    int32_t rows = ROWS_OF_EVENT;
    for (int32_t k = run->next; k < run->instants && run->instant[k] <= t && rows <= run->room; k++)
        rows += 2;
    return rows > run->room ? -1 : run->rows + rows <= run->room;
}

static int settled(sd_run *run, double t)
{
    sd_modes *m = run->modes;
    memset(m->before + run->written, 0, (size_t)(m->unknowns - run->written) * sizeof(double));
    return sd_settle_point(run->settle, t, m->before, m->before_d);
}

int sd_modes_event(sd_run *run)
{
    sd_modes *m = run->modes;
    const sd_stepper *stepper = run->stepper;
    double end = *stepper->t, t = end;
    m->waits = 0;
    if (m->now < 0)
        return SD_EVENT;
    if (stepper->refine)
        stepper->refine(stepper->self, run->settle);
    for (;;) {
        int32_t crossed = crossing(run, end, &t);
        int room = roomy(run, crossed ? t : end);
        if (*stepper->system->stop || room < 0)
            return SD_EVENT;
        m->waits = !room;
        if (!room)
            return SD_FULL;
        if (!crossed) {
            sd_run_accept(run, end, 0);
            watch(run);
            return SD_RUNNING;
        }
        stepper->dense(stepper->self, t, m->before, m->before_d);
        settled(run, t);
        int32_t from = m->now;
        const sd_transition *one = taken(run, t, crossed, 0);
        if (!one)
            return SD_EVENT;
        m->last = t;
        if (!one->moves) {
            m->begin = t;
            continue;
        }
        /* rows of before the event are written with the parameters of before */
        int32_t to = m->now;
        memcpy(m->p_after, m->p, (size_t)m->parameters * sizeof(double));
        memcpy(m->p, m->p_before, (size_t)m->parameters * sizeof(double));
        enter(run, from);
        sd_run_accept(run, t, SD_TRACE);
        memcpy(m->p, m->p_after, (size_t)m->parameters * sizeof(double));
        enter(run, to);
        go_on(run, t, one);
        return SD_RUNNING;
    }
}

int sd_modes_sample(sd_run *run)
{
    sd_modes *m = run->modes;
    double t = *run->stepper->t, now = t + m->nothing;
    int32_t due = 0;
    for (int32_t k = 0; k < m->samples; k++)
        if (m->first + (double)m->next[k] * m->period[k] <= now)
            m->which[due++] = k;
    if (!due || m->now < 0 || t >= m->segment)
        return SD_FINISHED;
    if (roomy(run, t) == 0)
        return SD_FULL;
    memcpy(m->before, run->stepper->y, (size_t)m->unknowns * sizeof(double));
    memcpy(m->before_d, run->stepper->yd, (size_t)m->unknowns * sizeof(double));
    settled(run, t);
    const sd_transition *one = taken(run, t, 0, due);
    if (!one)
        return SD_FINISHED;
    m->last = t;
    for (int32_t i = 0; i < due; i++)
        while (m->first + (double)m->next[one->sample[i]] * m->period[one->sample[i]] <= now)
            m->next[one->sample[i]]++;
    go_on(run, t, one);
    return SD_RUNNING;
}
