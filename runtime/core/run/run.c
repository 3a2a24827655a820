/* The driver of one integration: see run.h. */
#define _POSIX_C_SOURCE 199309L
#include "run/run.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "run/events/corners.h"
#include "run/meters/quadratures.h"
#include "run/events/watched.h"
#include "linear/lanes.h"
#include "system/condensed.h"

#define POLL 4  /* steps between two looks at the clock */

sd_run *sd_run_new(sd_stepper *stepper, sd_settle *settle, int32_t written, int32_t extended, int32_t observed,
                   int32_t audited)
{
    sd_run *run = calloc(1, sizeof *run);
    if (!run)
        return NULL;
    size_t n = (size_t)(extended > stepper->n ? extended : stepper->n) + 8, m = (size_t)observed + 8;
    size_t a = (size_t)audited + 8;
    /* where rows are settled with the kept unknowns alone, points stand where such a system evaluates its own: between what
     * moves a point and who looks at it nothing is evaluated */
    const sd_condensed *left = settle ? (const sd_condensed *)settle->system->left : NULL;
    run->memory = calloc((left ? 0 : 2 * n) + 3 * m + (7 + SD_PAST) * a, sizeof(double));
    if (!run->memory) {
        free(run);
        return NULL;
    }
    run->stepper = stepper;
    run->settle = settle;
    run->written = written;
    run->observed = observed;
    run->point = left ? left->y : run->memory;
    run->point_d = left ? left->yd : run->memory + n;
    run->values = left ? run->memory : run->point_d + n;
    run->largest = run->values + m;
    run->slope = run->largest + m;
    run->audited = audited;
    run->power = run->slope + m;
    run->after = run->power + a;
    run->sample = run->after + a;
    run->integral = run->sample + a;
    run->end = run->integral + a;
    run->middle = run->end + a;
    run->work = run->middle + a;
    for (int k = 0; k < SD_PAST; k++)
        run->past[k] = run->work + (size_t)(k + 1) * a;
    return run;
}

void sd_run_free(sd_run *run)
{
    if (!run)
        return;
    free(run->memory);
    free(run->looked);
    free(run);
}

/* where there is any for what elements store */
static double *room_of_contents(const sd_run *run)
{
    size_t numbers = 0;
    double *room = run->stepper->spare ? run->stepper->spare(run->stepper->self, &numbers) : NULL;
    return numbers >= (size_t)run->ledgers->elements ? room : NULL;
}

/* steps from the point started from on: its rows, as of `label`, and powers */
static void start(sd_run *run, double label)
{
    double t = run->stepper->ivp->t;
    sd_run_rows_of_start(run, label);
    sd_run_audit(run, t, run->point, run->point_d, run->after);
    if (run->ledgers)
        sd_ledgers_note(run->ledgers, t, run->point, run->point_d, run->after, room_of_contents(run));
    run->t_from = run->t_to = run->t_begun = t;
    run->fresh = run->pasts = 0;
    if (run->settle)
        run->settle->within = 0.0;
    if (run->extrema)
        run->extrema->number = 0; /* what jumps has no crest */
}

/* the start: energies, powers and the first row */
static int begin(sd_run *run)
{
    if (run->rows >= run->room)
        return 1;
    run->fresh = 1;
    run->t_row = run->stepper->ivp->t;
    start(run, run->stepper->ivp->t);
    run->started = 1;
    return 0;
}

/* into [audited] := the powers at y, yd [written] */
static void audit_at(sd_run *run, double t, const double *y, const double *yd, double *into)
{
    size_t written = (size_t)run->written * sizeof(double);
    memcpy(run->point, y, written);
    memcpy(run->point_d, yd, written);
    sd_run_audit(run, t, run->point, run->point_d, into);
}

void sd_run_leave(sd_run *run, const double *y, const double *yd)
{
    audit_at(run, run->t_to, y, yd, run->sample);
}

void sd_run_restart(sd_run *run, double t, double label, const double *y, const double *yd)
{
    const double *old = run->sample, *new = run->end;
    audit_at(run, t, y, yd, run->end);
    const double gained = (new[0] + new[1]) - (old[0] + old[1]);
    run->supplied += fmax(gained, 0.0);
    run->dissipated += fmax(-gained, 0.0);
    if (run->ledgers)
        sd_ledgers_jump(run->ledgers, old, new);
    run->stepper->start(run->stepper->self, t, y, yd, 0.0);
    run->fresh = 1;
    start(run, label);
}

/* where a step lies behind, the powers at its start are those of one before now */
static void keep_past(sd_run *run)
{
    if (!(run->t_to > run->t_from))
        return;
    double *room = run->past[SD_PAST - 1];
    memmove(run->past + 1, run->past, (SD_PAST - 1) * sizeof *run->past);
    memmove(run->t_past + 1, run->t_past, (SD_PAST - 1) * sizeof *run->t_past);
    memcpy(room, run->power, (size_t)run->audited * sizeof *room);
    run->past[0] = room;
    run->t_past[0] = run->t_from;
    run->pasts += run->pasts < SD_PAST;
}

/* quadratures over the step just accepted, powers and balances at its end */
static void measure(sd_run *run, double from, double t)
{
    run->t_from = from;
    run->t_to = t;
    run->sampled = run->noded = run->divided = run->by_past = run->told_here = 0;
    run->step_dissipated = run->dissipated;
    run->step_supplied = run->supplied;
    if (run->unsummed > 1)
        memset(run->integral, 0, (size_t)run->audited * sizeof(double));
    else if (t < run->stepper->ivp->t && run->settle && !run->stepper->part_y)
        sd_run_integrate_cut(run, t);
    else
        sd_run_integrate(run, t);
    run->dissipated += run->integral[2];
    run->supplied += run->integral[3];
    if (run->audit && run->sampled) {
        memcpy(run->after, run->sample, (size_t)run->audited * sizeof(double));
    } else if (run->audit) {
        run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
        sd_run_audit(run, t, run->point, run->point_d, run->after);
    }
    if (run->ledgers) {
        sd_ledgers_add(run->ledgers, run->integral);
        sd_ledgers_note(run->ledgers, t, run->point, run->point_d, run->after, room_of_contents(run));
    }
    /* powers at the start of the next step are kept apart until the rows of this one are written */
    run->pending = 1;
    run->glanced = 0;
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int sd_run_accept(sd_run *run, double to, int32_t kind)
{
    int32_t before = run->end_kind;
    memcpy(run->power, run->after, (size_t)run->audited * sizeof(double));
    measure(run, run->t_from, to);
    run->end_kind |= kind;
    int full = sd_run_drain(run);
    run->end_kind = full ? run->end_kind : before;
    return full;
}

/* what happens where a step has met the end of its piece of the text */
static int end(sd_run *run)
{
    if (run->modes)
        return sd_modes_end(run);
    return run->corners ? sd_corners_end(run) : SD_FINISHED;
}

/* one step, or what happens where one ends */
static int advance(sd_run *run)
{
    double from = run->stepper->ivp->t;
    if (from >= run->stepper->ivp->t_end)
        return end(run);
    keep_past(run);
    memcpy(run->power, run->after, (size_t)run->audited * sizeof(double));
    if (run->stepper->step(run->stepper->self))
        return SD_FAILED;
    run->t_from = from;
    run->told_here = 0; /* before events are looked for, which have rows too */
    if (run->settle)
        run->settle->within = from > run->t_begun ? run->stepper->ivp->t - from : 0.0;
    if (run->modes)
        run->modes->begin = from;
    if (sd_run_changes(run, from))
        return run->modes ? sd_modes_event(run) : SD_EVENT;
    measure(run, from, run->stepper->ivp->t);
    if (run->ledgers && run->ledgers->lost >= 0)
        return SD_FAILED;
    return sd_run_drain(run) ? SD_FULL : SD_RUNNING;
}

int sd_run_advance(sd_run *run, int64_t steps, double seconds)
{
    double until = now() + seconds;
    if (!run->started && begin(run))
        return SD_FULL;
    for (int64_t k = 0; k < steps; k++) {
        if (run->pending && sd_run_drain(run))
            return SD_FULL;
        if (*run->stepper->ivp->system->stop)
            return SD_FAILED;
        int state = run->modes && run->modes->waits ? sd_modes_event(run) : advance(run);
        if (state != SD_RUNNING)
            return state;
        if (k % POLL == POLL - 1 && now() > until)
            return SD_RUNNING;
    }
    return run->stepper->ivp->t >= run->stepper->ivp->t_end && !run->pending ? SD_FINISHED : SD_RUNNING;
}
