/* Transitions between modes that are known: see modes.h. */
#include "run/events/modes.h"

#include <math.h>
#include <string.h>

#include "run/events/crossing.h"
#include "run/events/fits.h"
#include "run/events/landing.h"

#define AT_ONCE 1e-2     /* of the first step behind an event: before that its dense output knows nothing */
#define SHORTER 8.0      /* steps in the place of one that misled */

/* No time has passed since the event before. */
static int near_the_last(const sd_modes *m, double t)
{
    return t - m->last <= m->nothing;
}

/* An event at t is taken. */
static void count(sd_modes *m, double t)
{
    m->stalled = near_the_last(m, t) ? m->stalled + 1 : 0;
    m->last = t;
}

/* -- laws whose branch turns ------------------------------------------------------------------------------------- */

/* The present mode becomes the core's own, if it is not. */
static void own(sd_modes *m)
{
    const sd_mode *mode = sd_mode_now(m);
    sd_mode *to = &m->own;
    if (m->now == SD_OWN)
        return;
    memcpy(to->row, mode->row, (size_t)mode->watches * sizeof *to->row);
    memcpy(to->rate, mode->rate, (size_t)mode->watches * sizeof *to->rate);
    memcpy(to->side, mode->side, (size_t)mode->watches * sizeof *to->side);
    memcpy(to->value, mode->value, (size_t)m->places * sizeof *to->value);
    to->watches = mode->watches;
    to->first = -1;
    to->relation = mode->relation;
    to->holds = mode->holds;
    to->held = mode->held;
    m->base = m->now;
    m->now = SD_OWN;
}

/* The kinks whose switching functions are the watches that crossed, into m->turning; 0: others crossed too, or a law slides
 * or is on neither branch. */
static int32_t kinks_of(const sd_modes *m, int32_t crossed)
{
    const sd_mode *mode = sd_mode_now(m);
    int32_t found = 0;
    for (int32_t k = 0; k < m->kinks; k++)
        for (int32_t i = 0; i < crossed; i++)
            if (mode->row[m->which[i]] == m->kink[k].value && m->p[m->kink[k].branch] == mode->side[m->which[i]]) {
                m->turning[found++] = k;
                break;
            }
    return found == crossed ? found : 0;
}

/* The watches that crossed change their sides, and the branches that they are those of. */
static void turn(sd_run *run, int32_t crossed)
{
    sd_modes *m = run->modes;
    for (int32_t i = 0; i < crossed; i++) {
        int32_t *side = &m->own.side[m->which[i]];
        *side = -*side;
        for (int32_t k = 0; k < m->places; k++)
            if (m->place[k] == m->kink[m->turning[i]].branch)
                m->own.value[k] = -m->own.value[k];
    }
    sd_landing_enter(run, SD_OWN);
}

/* The branches of laws that crossed, and nothing else, turn at t, from m->before; the model is then in its mode, and the log
 * tells.  0: they are not alone, or do not turn, and nothing has changed; where constraints hold at times they may leave
 * something open, which the handler knows. */
static int turns(sd_run *run, double t, int32_t crossed)
{
    sd_modes *m = run->modes;
    int32_t from = m->now;
    if (m->contacts || m->logged + crossed > m->room || near_the_last(m, t) || m->left < crossed || !kinks_of(m, crossed))
        return 0;
    sd_landing_leave(run);
    own(m);
    turn(run, crossed);
    if (!sd_landing_arrives(run, m->own.relation, t)) {
        turn(run, crossed);
        memcpy(m->p, m->p_before, (size_t)m->parameters * sizeof(double));
        sd_landing_enter(run, from);
        return 0;
    }
    for (int32_t i = 0; i < crossed; i++) {
        double *row = &m->log[(size_t)(m->logged + i) * (size_t)m->width], branch = m->p[m->kink[m->turning[i]].branch];
        row[0] = t;
        row[1] = -1.0 - (double)m->turning[i];
        row[2] = -branch;
        row[3] = branch;
    }
    return 1;
}

/* What ends the piece that begins. */
static void watch(sd_run *run)
{
    sd_modes *m = run->modes;
    const sd_mode *mode = sd_mode_now(m);
    for (int32_t i = 0; i < m->observed; i++)
        m->largest[i] = fmax(m->largest[i], run->largest[i]);
    for (int32_t k = 0; k < mode->watches; k++)
        m->watch[k] = (sd_watch){mode->row[k], mode->side[k], sd_mode_least(m, mode->row[k]) - sd_mode_level(m, mode->row[k])};
    run->watch = m->watch;
    run->watches = mode->watches;
}

/* What stood before an event, in mode `from`, stands again: rows of before are written with it.  The mode behind it. */
static int32_t back(sd_run *run, int32_t from)
{
    sd_modes *m = run->modes;
    int32_t to = m->now;
    memcpy(m->p_after, m->p, (size_t)m->parameters * sizeof(double));
    sd_landing_enter(run, from);
    memcpy(m->p, m->p_before, (size_t)m->parameters * sizeof(double));
    return to;
}

/* What stands behind it, in mode `to`, stands again. */
static void forth(sd_run *run, int32_t to)
{
    sd_modes *m = run->modes;
    sd_landing_enter(run, to);
    memcpy(m->p, m->p_after, (size_t)m->parameters * sizeof(double));
}

/* What was stored before an event, by the parameters of before; branches that coordinates turn are those of behind it. */
static void leave(sd_run *run)
{
    sd_modes *m = run->modes;
    size_t size = (size_t)m->parameters * sizeof(double);
    memcpy(m->p_after, m->p, size);
    memcpy(m->p, m->p_before, size);
    for (int32_t k = 0; k < m->kinks; k++)
        if (m->kink[k].inner)
            m->p[m->kink[k].branch] = m->p_after[m->kink[k].branch];
    sd_run_leave(run, m->before, m->before_d);
    memcpy(m->p, m->p_after, size);
}

/* The next steps, from t on, are parts of one that misled, until its end is passed. */
static void shorten(sd_run *run, double t, double step)
{
    sd_modes *m = run->modes;
    *m->h_max = fmax(fmin(step / SHORTER, *m->h_max), 16.0 * (nextafter(fabs(t), INFINITY) - fabs(t)));
    if (t + step < *m->t_end) {
        *m->t_end = t + step;
        run->end_kind = 0;
    }
}

/* On from the point behind an event at t, whose row, of kind `kind`, is as of `label`; it counts as so many, and is told
 * in so many rows of the log; misled: how long (s) steps are shorter. */
static void go_on(sd_run *run, double t, double label, int32_t kind, int32_t logged, int64_t entries, double misled)
{
    sd_modes *m = run->modes;
    double sample = INFINITY;
    for (int32_t k = 0; k < m->samples; k++)
        sample = fmin(sample, m->first + (double)m->next[k] * m->period[k]);
    m->begun = t;
    *m->h_max = m->longest;
    *m->t_end = sample < m->segment - m->nothing ? sample : m->segment; /* where the text jumps too, that is first */
    run->end_kind = sample <= m->segment + m->nothing ? SD_TRACE : 0;
    if (misled > 0.0)
        shorten(run, t, misled);
    if (t < m->passed) {
        *m->h_max = fmin(m->part, *m->h_max);
        if (m->passed < *m->t_end) {
            *m->t_end = m->passed;
            run->end_kind = 0;
        }
    }
    for (int32_t i = 0; i < m->unknowns; i++)
        m->restart_d[i] = m->differential[i] ? m->rate[i] : 0.0;
    run->start_kind = kind;
    leave(run);
    sd_run_restart(run, t, label, m->restart, m->restart_d);
    run->start_kind = 0;
    m->logged += logged;
    m->left -= entries;
    watch(run);
}

static int same(int32_t n, const int32_t *a, int32_t number, const int32_t *b)
{
    return n == number && !memcmp(a, b, (size_t)n * sizeof *a);
}

/* Whether a flight is under way that is lower than the method sees: the handler takes steps that are short enough. */
static int flies_low(const sd_modes *m, double t)
{
    for (int32_t k = 0; k < m->contacts && m->faint > 0.0; k++) {
        int32_t row = m->contact[k].value;
        if (m->contact[k].kind == SD_PHI && m->thrown[row] && m->height[row] < m->faint * m->largest[row] && t < m->begins[row] + 2.0 * m->flight[row])
            return 1;
    }
    return 0;
}

/* Whether the handler is asked about a known transition: behind a low flight, too soon behind the event before, where it is
 * one event too many. */
static int refused(const sd_modes *m, const sd_transition *one, double t)
{
    const int at_once = near_the_last(m, t) && m->contacts;
    return one->entries > m->left || (one->moves && (at_once || flies_low(m, t))) || t - m->last < one->soon;
}

/* The same of a gap alone that closes in flight, from whatever mode; NULL: there is none, or it leads elsewhere. */
static const sd_transition *anywhere(sd_run *run, double t, int32_t crossed, int32_t due)
{
    sd_modes *m = run->modes;
    const sd_mode *mode = sd_mode_now(m);
    for (int32_t k = 0; k < m->contacts && crossed == 1 && due == 0; k++) {
        if (m->anywhere[k] < 0 || mode->holds[k] || m->contact[k].value != mode->row[m->which[0]])
            continue;
        m->here = m->transition[m->anywhere[k]];
        m->here.to = m->now;
        m->here.which = m->which;
        m->here.sides = mode->relation;
        return !refused(m, &m->here, t) && sd_landing_takes(run, &m->here, t) ? &m->here : NULL;
    }
    return NULL;
}

/* Whether an assignment has put a relation next to zero. */
static int due_at_once(const sd_modes *m)
{
    int32_t k = 0;
    while (k < m->relations && m->known[m->relation_row[k]] != 1)
        k++;
    return k < m->relations;
}

/* The transition that what crossed, or is due (SD_JUMP: the text jumps), takes at t; the model is then in its mode.
 * NULL: none. */
static const sd_transition *taken(sd_run *run, double t, int32_t crossed, int32_t due)
{
    sd_modes *m = run->modes;
    if (m->logged >= m->room || (near_the_last(m, t) && m->stalled >= m->chatters) || due_at_once(m))
        return NULL;
    for (int32_t k = sd_mode_now(m)->first; k >= 0; k = m->transition[k].next) {
        const sd_transition *one = &m->transition[k];
        if (!same(one->crossed, one->which, crossed, m->which))
            continue;
        if (due == SD_JUMP ? one->due != SD_JUMP : !same(one->due, one->sample, due, m->which))
            continue;
        if (refused(m, one, t))
            return NULL;
        if (!one->moves)
            sd_landing_enter(run, one->to);
        if (!one->moves || sd_landing_takes(run, one, t))
            return one;
    }
    return anywhere(run, t, crossed, due);
}

static int settled(sd_run *run, double t)
{
    sd_modes *m = run->modes;
    memset(m->before + run->written, 0, (size_t)(m->unknowns - run->written) * sizeof(double));
    return sd_settle_point(run->settle, t, m->before, m->before_d);
}

/* Whether a row is of a gap that does not hold, which inertia leads. */
static int gap(const sd_modes *m, int32_t row)
{
    int32_t k = 0;
    while (k < m->contacts && (m->contact[k].kind != SD_PHI || sd_mode_now(m)->holds[k] || m->contact[k].value != row))
        k++;
    return k < m->contacts;
}

/* Whether what crosses at t does so early in the first step behind an event, and may be of what relaxes at once, which its
 * dense output does not follow: all but gaps. */
static int early(const sd_run *run, double t, double end, int32_t crossed)
{
    const sd_modes *m = run->modes;
    double since = t - run->t_from;
    int32_t gaps = 0;
    while (gaps < crossed && gap(m, sd_mode_now(m)->row[m->which[gaps]]))
        gaps++;
    return gaps < crossed && run->t_from == m->begun && since > m->at_once && since < m->early * (end - run->t_from);
}

/* How long (s) the shortest of the peaks takes that begin with what has just turned; INFINITY: none does. */
static double passing(const sd_modes *m)
{
    double found = INFINITY;
    for (int32_t k = 0; k < m->kinks; k++) {
        const sd_kink *kink = &m->kink[k];
        if (kink->passage > 0.0 && kink->rate >= 0 && m->p_before[kink->branch] < 0.0 && m->p[kink->branch] == 1.0)
            found = fmin(found, kink->passage / fabs(m->values[kink->rate]));
    }
    return found;
}

void sd_modes_pass(sd_modes *m, double t, double step, double passes)
{
    const int within = t < m->passed;
    if (!isfinite(passes) || (!within && step <= passes / SHORTER))
        return;
    m->part = fmin(passes / SHORTER, within ? m->part : INFINITY);
    m->passed = fmax(t + passes, within ? m->passed : t);
}

/* Whether the laws that have just turned are peaks, whose begins and ends are no rows. */
static int only_peaks(const sd_modes *m, int32_t crossed)
{
    int32_t k = 0;
    while (k < crossed && m->kink[m->turning[k]].passage > 0.0)
        k++;
    return k == crossed;
}

/* What changes within the last step, whose points count to round-off (what is left over of one that holds nearly would be a
 * state that jumps); enough: for rows. */
static int event(sd_run *run, double enough)
{
    sd_modes *m = run->modes;
    const sd_stepper *stepper = run->stepper;
    double end = stepper->ivp->t, t = end;
    if (stepper->refine)
        stepper->refine(stepper->self, run->settle);
    for (;;) {
        int32_t crossed = sd_run_crossing(run, end, &t);
        int room = sd_landing_room(run, crossed ? t : end);
        if (*stepper->ivp->system->stop || room < 0)
            return SD_EVENT;
        m->waits = !room;
        if (!room)
            return SD_FULL;
        if (!crossed) {
            run->settle->enough = enough;
            sd_run_accept(run, end, 0);
            watch(run);
            return SD_RUNNING;
        }
        if (early(run, t, end, crossed))
            return SD_EVENT;
        memcpy(m->before, run->point, (size_t)run->written * sizeof(double));
        memcpy(m->before_d, run->point_d, (size_t)run->written * sizeof(double));
        int32_t from = m->now;
        const sd_transition *one = taken(run, t, crossed, 0);
        if (!one && !turns(run, t, crossed))
            return SD_EVENT;
        count(m, t);
        if (one && !one->moves) {
            m->begin = t;
            continue;
        }
        int32_t to = back(run, from);
        double step = end - run->t_from;
        int misled = one && one->strike && run->t_from == m->begun && t - run->t_from < AT_ONCE * step;
        run->settle->enough = enough;
        int kind = one || !only_peaks(m, crossed) ? SD_TRACE : 0;
        sd_run_accept(run, t, kind);
        forth(run, to);
        sd_modes_pass(m, t, step, passing(m));
        go_on(run, t, t, kind, one ? 1 : crossed, one ? one->entries : crossed, misled ? step : 0.0);
        return SD_RUNNING;
    }
}

int sd_modes_event(sd_run *run)
{
    double enough = run->settle->enough;
    run->modes->waits = 0;
    if (run->modes->now < 0)
        return SD_EVENT;
    run->settle->enough = 0.0;
    int state = event(run, enough);
    run->settle->enough = enough;
    return state;
}

/* Whether a relation that has a side falls through zero where the last step ends, but for round-off; m->low: values there,
 * m->high := those shortly before, where `looked` says that they are not there yet */
static int met(sd_run *run, int32_t row, double side, int *looked)
{
    sd_modes *m = run->modes;
    double t = run->stepper->ivp->t, step = (t - run->t_from) / SHORTER;
    if (!(fabs(m->low[row]) <= m->small * m->largest[row]) || step <= m->nothing)
        return 0;
    if (!*looked)
        sd_run_observe(run, t - step, m->high);
    *looked = 1;
    double rate = side * (m->high[row] - m->low[row]) / step;
    return rate > 0.0 && side * m->low[row] <= rate * m->nothing;
}

/* The relations that cross where the last step ends, into m->which; values: behind a jump of the text, which takes some to
 * their other side, NULL: there is none.  Theirs are the first watches of a mode.  m->low: the values before it */
static int32_t turned(sd_run *run, const double *values)
{
    sd_modes *m = run->modes;
    const sd_mode *mode = sd_mode_now(m);
    int32_t found = 0;
    int looked = 0;
    for (int32_t k = 0, watch = 0; k < m->relations; k++) {
        int32_t row = m->relation_row[k], sides = mode->relation[k] != 0.0 ? 1 : 2;
        double small = sd_mode_zero(m, row);
        for (int32_t i = 0; m->relation_moves[k] && i < sides; i++, watch++) {
            int32_t side = mode->side[watch];
            if ((values && side * values[row] < -small) || (sides == 1 && met(run, row, side, &looked)))
                m->which[found++] = watch;
        }
    }
    return found;
}

/* The samples due at t, into m->which. */
static int32_t due_at(const sd_modes *m, double t)
{
    int32_t due = 0;
    for (int32_t k = 0; k < m->samples; k++)
        if (m->first + (double)m->next[k] * m->period[k] <= t + m->nothing)
            m->which[due++] = k;
    return due;
}

/* m->before := the end of the last step, to round-off */
static void settle_end(sd_run *run)
{
    sd_modes *m = run->modes;
    memcpy(m->before, run->stepper->y, (size_t)m->unknowns * sizeof(double));
    memcpy(m->before_d, run->stepper->yd, (size_t)m->unknowns * sizeof(double));
    settled(run, run->stepper->ivp->t);
}

static int sample(sd_run *run, int32_t due)
{
    sd_modes *m = run->modes;
    double t = run->stepper->ivp->t, enough = run->settle->enough;
    run->settle->enough = 0.0;
    settle_end(run);
    sd_landing_look(run, t, m->before, m->before_d, m->low);
    const sd_transition *one = turned(run, NULL) ? NULL : taken(run, t, 0, due_at(m, t));
    run->settle->enough = enough;
    if (!one)
        return SD_FINISHED;
    count(m, t);
    for (int32_t i = 0; i < due; i++)
        while (m->first + (double)m->next[one->sample[i]] * m->period[one->sample[i]] <= t + m->nothing)
            m->next[one->sample[i]]++;
    go_on(run, t, t, SD_TRACE, 1, one->entries, 0.0);
    return SD_RUNNING;
}

/* Whether a jump of the text to `label`, with so many events, asks for a row before it that is not there yet. */
static int lacks_row(const sd_run *run, double label, int64_t entries)
{
    const sd_modes *m = run->modes;
    if (run->every_step || run->end_kind & SD_TRACE)
        return 0;
    return entries || (sd_run_asks(run, label) && sd_landing_jumps(m->observed, m->low, m->values, m->largest, m->differs));
}

/* The text jumps where the step has met the end of its piece. */
static int jump(sd_run *run)
{
    sd_modes *m = run->modes;
    const sd_piece *next = &m->piece[m->at + 1];
    double t = next->begin, enough = run->settle->enough;
    int32_t from = m->now;
    if (due_at(m, t))
        return SD_FINISHED;
    run->settle->enough = 0.0;
    settle_end(run);
    sd_landing_look(run, run->stepper->ivp->t, m->before, m->before_d, m->low);
    sd_landing_look(run, t, m->before, m->before_d, m->values);
    int32_t crossed = turned(run, m->values);
    const sd_transition *one = taken(run, t, crossed, SD_JUMP);
    run->settle->enough = enough;
    if (!one)
        return SD_FINISHED;
    if (lacks_row(run, next->label, one->entries)) {
        int32_t to = back(run, from);
        sd_run_row(run, SD_TRACE);
        forth(run, to);
    }
    if (crossed)
        count(m, t);
    m->log[(size_t)m->logged * (size_t)m->width] = next->label;
    m->at++;
    m->segment = next->end;
    go_on(run, t, next->label, one->entries ? SD_TRACE : 0, one->entries != 0, one->entries, 0.0);
    return SD_RUNNING;
}

int sd_modes_end(sd_run *run)
{
    const sd_modes *m = run->modes;
    double t = run->stepper->ivp->t;
    int32_t jumps = t >= m->segment, due = jumps ? 0 : due_at(m, t);
    if (m->now < 0 || (jumps ? m->at + 1 >= m->pieces : !due))
        return SD_FINISHED;
    if (sd_landing_room(run, t) == 0)
        return SD_FULL;
    return jumps ? jump(run) : sample(run, due);
}
