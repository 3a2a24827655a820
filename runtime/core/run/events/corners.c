/* Instants at which the text jumps or bends: see corners.h. */
#include "run/events/corners.h"

#include <math.h>
#include <string.h>

#include "run/events/landing.h"
#include "start/round_off.h"

/* c->y, yd := the end of the last step with every unknown; what nothing reads stays as it is there */
static void last_point(const sd_run *run, const sd_corners *c)
{
    const sd_stepper *stepper = c->expanded ? c->expanded->inner : run->stepper;
    const size_t written = (size_t)run->written, rest = (size_t)c->unknowns - written;
    if (c->expanded) {
        sd_condensed_expand(c->expanded->condensed, stepper->y, c->y, 0);
        sd_condensed_expand(c->expanded->condensed, stepper->yd, c->yd, 1);
    } else {
        memcpy(c->y, stepper->y, written * sizeof(double));
        memcpy(c->yd, stepper->yd, written * sizeof(double));
    }
    memset(c->y + written, 0, rest * sizeof(double));
    memset(c->yd + written, 0, rest * sizeof(double));
}

/* what a method of fewer unknowns knows of their sizes becomes known of all */
static void share(const sd_corners *c)
{
    for (int32_t i = 0; i < c->unknowns; i++) {
        c->met[i] = fmax(c->met[i], fabs(c->y[i]));
        c->magnitude[i] = fmax(c->magnitude[i], fabs(c->y[i]));
    }
    for (int32_t k = 0; k < c->keeps; k++) {
        c->magnitude[c->kept[k]] = c->own_magnitude[k];
        c->met[c->kept[k]] = c->own_met[k];
    }
}

/* values [observed] := what is seen at a point */
static void look(sd_run *run, double t, const double *y, const double *yd, double *values)
{
    memcpy(run->point, y, (size_t)run->written * sizeof *y);
    memcpy(run->point_d, yd, (size_t)run->written * sizeof *yd);
    sd_run_quantities(run, t, values);
}

/* what stood at zero and begins to move is as large as a part of its like, at least */
static void begin_to_move(const sd_corners *c)
{
    memset(c->largest, 0, (size_t)c->groups * sizeof *c->largest);
    for (int32_t i = 0; i < c->unknowns; i++)
        c->largest[c->group[i]] = fmax(c->largest[c->group[i]], c->met[i]);
    for (int32_t i = 0; i < c->unknowns; i++) {
        double like = c->largest[c->group[i]];
        if (c->unnamed[i] && c->rate[i] != 0.0 && c->met[i] <= c->round_off * like)
            c->magnitude[i] = fmax(c->magnitude[i], c->part * like);
    }
}

/* no magnitude asks for more than round-off leaves, once contents have grown */
static void resolve(const sd_corners *c, double t)
{
    int grown = 0;
    for (int32_t i = 0; i < c->unknowns && !grown; i++)
        grown = !(fabs(c->y[i]) <= 2.0 * c->resolved[i]);
    if (!grown)
        return;
    for (int32_t i = 0; i < c->unknowns; i++)
        c->resolved[i] = fmax(c->resolved[i], fabs(c->y[i]));
    sd_jacobian(c->system, t, c->y, c->yd, NULL, c->jy, c->jyd);
    if (sd_noise(c->system, c->constraint, c->balance, c->multiplier, c->flow, c->y, c->jy, c->time, c->sweeps, c->part, c->open))
        return; /* no memory: sizes stay as they are */
    for (int32_t i = 0; i < c->unknowns; i++)
        if (!c->state[i])
            c->magnitude[i] = fmax(c->magnitude[i], c->open[i] * c->resolves);
}

/* c->y, yd := a point behind the instant, c->before, before_d the one before it; 0: Python finds it */
static int across(sd_run *run, const sd_corners *c, double t)
{
    const sd_keeping keeping = {run->written, c->state, c->magnitude, c->still, c->before, c->before_d};
    double enough = run->settle->enough;
    run->settle->enough = 0.0; /* behind a jump what is left over would move the state */
    run->settle->ready = 0;
    int done = !sd_settle_point(run->settle, run->t_to, c->y, c->yd);
    run->settle->ready = 0;
    done = done && sd_landing_keeps(run->settle, t, c->y, c->yd, &keeping);
    run->settle->enough = enough;
    return done;
}

/* the method starts from c->y, yd at the begin of `next` */
static void go_on(sd_run *run, const sd_corners *c, const sd_piece *next)
{
    const double *start_rate = run->start_rate;
    memcpy(c->rate, c->yd, (size_t)c->unknowns * sizeof(double));
    for (int32_t i = 0; i < c->unknowns; i++)
        c->yd[i] = c->differential[i] ? c->rate[i] : 0.0;
    begin_to_move(c);
    resolve(c, next->begin);
    for (int32_t k = 0; k < c->keeps; k++)
        c->own_magnitude[k] = c->magnitude[c->kept[k]];
    run->start_rate = c->rate;
    sd_run_restart(run, next->begin, next->label, c->y, c->yd);
    run->start_rate = start_rate;
    run->start_kind = 0;
}

int sd_corners_end(sd_run *run)
{
    sd_corners *c = run->corners;
    if (c->at + 1 >= c->pieces)
        return SD_FINISHED;
    const sd_piece *next = &c->piece[c->at + 1];
    int room = sd_landing_room(run, next->label);
    if (room <= 0)
        return room ? SD_FINISHED : SD_FULL;
    last_point(run, c);
    if (c->keeps)
        share(c);
    if (!across(run, c, next->begin))
        return SD_FINISHED;
    if (sd_landing_shows(run->written, c->unnamed, c->met, c->magnitude, c->yd, c->round_off, c->unknown_size))
        return SD_FINISHED;
    int starts = next->label == c->piece[0].label;
    if (starts || sd_run_asks(run, next->label)) {
        look(run, run->t_to, c->before, c->before_d, c->seen);
        look(run, next->begin, c->y, c->yd, run->values);
        int jumps = sd_landing_jumps(run->observed, c->seen, run->values, run->largest, c->differs);
        if (jumps && starts)
            run->start_kind = SD_TRACE;
        else if (jumps)
            sd_run_row(run, SD_TRACE);
    }
    sd_run_leave(run, c->before, c->before_d);
    c->at++;
    *c->t_end = next->end;
    go_on(run, c, next);
    return SD_RUNNING;
}
