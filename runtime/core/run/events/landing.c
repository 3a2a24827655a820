/* The point behind an event: see landing.h. */
#include "run/events/landing.h"

#include <math.h>
#include <string.h>

#include "run/events/fits.h"
#include "run/events/strike.h"

#define ROWS_OF_EVENT 8 /* at most, beside those asked for */

void sd_landing_look(sd_run *run, double t, const double *y, const double *yd, double *values)
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

void sd_landing_enter(sd_run *run, int32_t number)
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
    row[1] = (double)one->number;
    sd_landing_look(run, t, m->y, m->yd, m->values);
    for (int32_t k = 0; k < m->relations; k++)
        m->exact[k] = one->sides[k] != sd_mode_now(m)->relation[k] && m->values[m->relation_row[k]] == 0.0;
    for (int32_t r = 0, a = 0; r < one->rounds; r++) {
        for (int32_t k = a; k < one->end[r]; k++) { /* all values are read, then all assigned */
            row[2 + 2 * k] = (one->kind[k] ? m->y : m->p)[one->place[k]];
            row[3 + 2 * k] = m->values[one->read[k]];
            if (!isfinite(row[3 + 2 * k]))
                return 0; /* the handler says so */
        }
        for (int32_t k = 0; k < m->relations; k++)
            m->was[k] = m->values[m->relation_row[k]];
        for (; a < one->end[r]; a++)
            (one->kind[a] ? m->y : m->p)[one->place[a]] = row[3 + 2 * a];
        if (one->momenta && !sd_strike_momenta(run, one->momenta, t))
            return 0;
        sd_landing_look(run, t, m->y, m->yd, m->values);
        const double *sides = one->sides + r * m->relations;
        if (!sd_mode_assigned_fit(m, sides + m->relations, sides, m->was, m->values, m->high))
            return 0;
    }
    return 1;
}

/* y, yd settled at t: 1, where no state moves for it */
static int stays(sd_settle *settle, double t, double *y, double *yd, const sd_keeping *keeping)
{
    int failed = sd_settle_point(settle, t, y, yd);
    for (int32_t i = 0; i < keeping->written && !failed; i++)
        failed = keeping->state[i] && !(fabs(y[i] - keeping->before[i]) <= keeping->still * keeping->magnitude[i]);
    return !failed;
}

int sd_landing_keeps(sd_settle *settle, double t, double *y, double *yd, const sd_keeping *keeping)
{
    size_t written = (size_t)keeping->written * sizeof(double);
    double slack = settle->slack;
    memcpy(keeping->before, y, written);
    memcpy(keeping->before_d, yd, written);
    settle->slack = 0.0;
    int done = settle->basis && !settle->determined && stays(settle, t, y, yd, keeping);
    settle->slack = slack;
    if (done)
        return 1;
    memcpy(y, keeping->before, written);
    memcpy(yd, keeping->before_d, written);
    settle->hold = SD_HELD;
    done = stays(settle, t, y, yd, keeping);
    settle->hold = 1.0;
    settle->ready = 0;
    return done;
}

int sd_landing_jumps(int32_t number, const double *before, const double *behind, const double *largest, double part)
{
    for (int32_t i = 0; i < number; i++)
        if (fabs(behind[i] - before[i]) > part * fmax(largest[i], fmax(fabs(behind[i]), fabs(before[i]))))
            return 1;
    return 0;
}

int sd_landing_shows(int32_t n, const int32_t *unnamed, const double *met, const double *magnitude, const double *rate,
                     double zero, double unknown)
{
    for (int32_t i = 0; i < n; i++)
        if (unnamed[i] && met[i] <= zero && magnitude[i] == unknown && rate[i] != 0.0)
            return 1;
    return 0;
}

int sd_landing_room(const sd_run *run, double t)
{
    int32_t rows = ROWS_OF_EVENT;
    for (int32_t k = run->next; k < run->instants && run->instant[k] <= t && rows <= run->room; k++)
        rows += 2;
    return rows > run->room ? -1 : run->rows + rows <= run->room;
}

void sd_landing_leave(sd_run *run)
{
    sd_modes *m = run->modes;
    size_t written = (size_t)run->written * sizeof(double);
    memcpy(m->p_before, m->p, (size_t)m->parameters * sizeof(double));
    memcpy(m->y, m->before, written);
    memcpy(m->yd, m->before_d, written);
}

int sd_landing_arrives(sd_run *run, const double *sides, double t)
{
    sd_modes *m = run->modes;
    size_t written = (size_t)run->written * sizeof(double);
    const sd_keeping keeping = {run->written, m->state, m->magnitude, m->still, m->restart, m->restart_d};
    const sd_system *system = run->settle->system;
    for (int32_t i = 0; i < system->held; i++)
        m->yd[system->held_unknown[i]] = 0.0; /* what does not hold any more pushes no more */
    if (!sd_landing_keeps(run->settle, t, m->y, m->yd, &keeping))
        return 0;
    memset(m->restart, 0, (size_t)m->unknowns * sizeof(double));
    memset(m->rate, 0, (size_t)m->unknowns * sizeof(double));
    memcpy(m->restart, m->y, written);
    memcpy(m->rate, m->yd, written);
    sd_landing_look(run, t, m->y, m->yd, m->values);
    return sd_mode_fits(m, sides, m->values) && sd_mode_sized(m);
}

int sd_landing_takes(sd_run *run, const sd_transition *one, double t)
{
    sd_modes *m = run->modes;
    int32_t from = m->now;
    const sd_mode *before = sd_mode_now(m);
    sd_landing_leave(run);
    int done = assign(run, one, t) && (!one->strike || sd_strike_gap(run, one->strike, t));
    m->struck = one->strike ? one->strike->contact : -1;
    sd_landing_enter(run, one->to);
    done = done && sd_landing_arrives(run, one->sides + one->rounds * m->relations, t) && sd_mode_ordinary(m) &&
           sd_mode_decided(m, before, one, m->values) && !sd_mode_returns(m, before, one, m->values);
    m->struck = -1;
    done = done && sd_strike_throws(run, one->strike, t);
    if (!done) {
        memcpy(m->p, m->p_before, (size_t)m->parameters * sizeof(double));
        sd_landing_enter(run, from);
    }
    return done;
}
