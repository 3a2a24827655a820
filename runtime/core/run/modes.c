/* Transitions between modes that are known: see modes.h. */
#include "run/modes.h"

#include <math.h>
#include <string.h>

#include "run/crossing.h"
#include "run/fits.h"

#define HELD 1e8         /* weight of the state across an event */
#define ROWS_OF_EVENT 8  /* at most, beside those asked for */

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
    const sd_mode *mode = number == SD_OWN ? &m->own : &m->mode[number];
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

/* m->y, m->yd settled at t: 1, where no state moves for it */
static int stays(sd_run *run, double t)
{
    sd_modes *m = run->modes;
    int failed = sd_settle_point(run->settle, t, m->y, m->yd);
    for (int32_t i = 0; i < run->written && !failed; i++)
        failed = m->state[i] && !(fabs(m->y[i] - m->restart[i]) <= m->still * m->magnitude[i]);
    return !failed;
}

/* The same with the state held: 1; 0: that fails, or moves the state.  Where constraints stay as they are a basis that moves
 * no state is enough. */
static int keeps_state(sd_run *run, double t)
{
    sd_modes *m = run->modes;
    sd_settle *settle = run->settle;
    size_t written = (size_t)run->written * sizeof(double);
    double slack = settle->slack;
    memcpy(m->restart, m->y, written);
    memcpy(m->restart_d, m->yd, written);
    settle->slack = 0.0;
    int done = settle->basis && !settle->determined && stays(run, t);
    settle->slack = slack;
    if (done)
        return 1;
    memcpy(m->y, m->restart, written);
    memcpy(m->yd, m->restart_d, written);
    settle->hold = HELD;
    done = stays(run, t);
    settle->hold = 1.0;
    settle->ready = 0;
    return done;
}

/* The point before an event, which is taken across it; the parameters there */
static void leave(sd_run *run)
{
    sd_modes *m = run->modes;
    size_t written = (size_t)run->written * sizeof(double);
    memcpy(m->p_before, m->p, (size_t)m->parameters * sizeof(double));
    memcpy(m->y, m->before, written);
    memcpy(m->yd, m->before_d, written);
}

/* The point behind an event at t in m->restart and m->rate: 1, where the mode is what its values say; sides: from which its
 * relations come */
static int arrives(sd_run *run, const double *sides, double t)
{
    sd_modes *m = run->modes;
    size_t written = (size_t)run->written * sizeof(double);
    if (!keeps_state(run, t))
        return 0;
    memset(m->restart, 0, (size_t)m->unknowns * sizeof(double));
    memset(m->rate, 0, (size_t)m->unknowns * sizeof(double));
    memcpy(m->restart, m->y, written);
    memcpy(m->rate, m->yd, written);
    look(run, t, m->y, m->yd, m->values);
    return sd_mode_fits(m, sides, m->values) && sd_mode_sized(m);
}

/* The point behind a transition at t, from m->before; the model is then in its mode.  0: it does not lead there, and
 * nothing has changed. */
static int lands(sd_run *run, const sd_transition *one, double t)
{
    sd_modes *m = run->modes;
    int32_t from = m->now;
    const sd_mode *before = sd_mode_now(m);
    leave(run);
    int done = assign(run, one, t);
    enter(run, one->to);
    done = done && arrives(run, one->sides + one->rounds * m->relations, t) && sd_mode_ordinary(m) &&
           sd_mode_decided(m, before, one, m->values);
    if (!done) {
        memcpy(m->p, m->p_before, (size_t)m->parameters * sizeof(double));
        enter(run, from);
    }
    return done;
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
    enter(run, SD_OWN);
}

/* The branches of laws that crossed, and nothing else, turn at t, from m->before; the model is then in its mode, and the log
 * tells.  0: they are not alone, or do not turn, and nothing has changed; where constraints hold at times they may leave
 * something open, which the handler knows. */
static int turns(sd_run *run, double t, int32_t crossed)
{
    sd_modes *m = run->modes;
    int32_t from = m->now;
    if (m->contacts || m->logged + crossed > m->room || t - m->last <= m->nothing || m->left < crossed || !kinks_of(m, crossed))
        return 0;
    leave(run);
    own(m);
    turn(run, crossed);
    if (!arrives(run, m->own.relation, t)) {
        turn(run, crossed);
        memcpy(m->p, m->p_before, (size_t)m->parameters * sizeof(double));
        enter(run, from);
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
        m->watch[k] = (sd_watch){mode->row[k], mode->side[k], sd_mode_zero(m, mode->row[k])};
    run->watch = m->watch;
    run->watches = mode->watches;
}

/* On from the point behind an event, which counts as so many, and is told in so many rows of the log. */
static void go_on(sd_run *run, double t, int32_t logged, int64_t entries)
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
    m->logged += logged;
    m->left -= entries;
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

/* What changes within the last step, whose points count to round-off (what is left over of one that holds nearly would be a
 * state that jumps); enough: for rows. */
static int event(sd_run *run, double enough)
{
    sd_modes *m = run->modes;
    const sd_stepper *stepper = run->stepper;
    double end = *stepper->t, t = end;
    if (stepper->refine)
        stepper->refine(stepper->self, run->settle);
    for (;;) {
        int32_t crossed = sd_run_crossing(run, end, &t);
        int room = roomy(run, crossed ? t : end);
        if (*stepper->system->stop || room < 0)
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
        memcpy(m->before, run->point, (size_t)run->written * sizeof(double));
        memcpy(m->before_d, run->point_d, (size_t)run->written * sizeof(double));
        int32_t from = m->now;
        const sd_transition *one = taken(run, t, crossed, 0);
        if (!one && !turns(run, t, crossed))
            return SD_EVENT;
        m->last = t;
        if (one && !one->moves) {
            m->begin = t;
            continue;
        }
        /* rows of before the event are written with the parameters of before */
        int32_t to = m->now;
        memcpy(m->p_after, m->p, (size_t)m->parameters * sizeof(double));
        if (one)
            enter(run, from);
        memcpy(m->p, m->p_before, (size_t)m->parameters * sizeof(double));
        run->settle->ready = 0;
        run->settle->enough = enough;
        sd_run_accept(run, t, SD_TRACE);
        if (one)
            enter(run, to);
        memcpy(m->p, m->p_after, (size_t)m->parameters * sizeof(double));
        run->settle->ready = 0;
        go_on(run, t, one ? 1 : crossed, one ? one->entries : crossed);
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
    double enough = run->settle->enough;
    run->settle->enough = 0.0;
    settled(run, t);
    const sd_transition *one = taken(run, t, 0, due);
    run->settle->enough = enough;
    if (!one)
        return SD_FINISHED;
    m->last = t;
    for (int32_t i = 0; i < due; i++)
        while (m->first + (double)m->next[one->sample[i]] * m->period[one->sample[i]] <= now)
            m->next[one->sample[i]]++;
    go_on(run, t, 1, one->entries);
    return SD_RUNNING;
}
