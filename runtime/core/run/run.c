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
#include "system/condensed.h"

#define POLL 4  /* steps between two looks at the clock */
#define FAILS 4 /* rows that meet their sums for each that does not: fewer are not worth looking */
#define CRESTS 32 /* rows of what is watched that a step may have beside those at its parts */
#define GROWN 1.1 /* times the largest so far: beyond it the size of a step is not believed as the method left it */
#define BEGUN 1e-3 /* magnitudes by which a start may still be moved: at a valve at rest no state gives its law a rate */

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
    run->memory = calloc((left ? 0 : 2 * n) + 3 * m + 5 * a, sizeof(double));
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

/* points are settled in room of the method's, or no more */
static void lend(sd_run *run, int room)
{
    const sd_stepper *stepper = run->stepper;
    run->settle->lent = room && stepper->spare ? stepper->spare(stepper->self, &run->settle->lent_room) : NULL;
}

/* where there is any for what elements store */
static double *room_of_contents(const sd_run *run)
{
    size_t numbers = 0;
    double *room = run->stepper->spare ? run->stepper->spare(run->stepper->self, &numbers) : NULL;
    return numbers >= (size_t)run->ledgers->elements ? room : NULL;
}

void sd_run_settle(sd_run *run, double t)
{
    sd_settle *settle = run->settle;
    const sd_stepper *stepper = run->stepper;
    double moved = 0.0;
    int at_hand = stepper->onto && !run->fresh;
    lend(run, 1);
    if (at_hand && t == stepper->ivp->t && sd_settle_holds(settle, t, run->point, run->point_d))
        settle->drift = settle->constraints;
    else if (at_hand && !stepper->onto(stepper->self, t, run->point, run->point_d, &moved)
             && sd_settle_holds(settle, t, run->point, run->point_d))
        settle->drift = moved;
    else
        sd_settle_point(settle, t, run->point, run->point_d);
    lend(run, 0);
}

/* How far the unknowns of a row within a step lie beyond those of the steps. */
static void note_beyond(sd_run *run)
{
    for (int32_t j = 0; j < run->stepper->n; j++)
        if (fabs(run->point[j]) > run->beyond * run->magnitude[j] && run->magnitude[j] > 0.0)
            run->beyond = fabs(run->point[j]) / run->magnitude[j];
}

/* Whether something observed relaxes at t within a small part of the last step, which began with it: by the equations,
 * whose rates `row` has, it is under way to where the dense output is not.  Then the row is for the comparison alone, and
 * has in the place of its energies how many times as long the step is, and the largest part of its largest that something
 * moves by since then as fast as the equations and the dense output differ. */
static int relaxes(const sd_run *run, double t, double *row)
{
    const double *rate = row + SD_ROW_HEAD + run->observed;
    double h = run->t_to - run->t_from, since = t - run->t_from, most = 0.0;
    for (int32_t i = 0; i < run->observed; i++) {
        const double apart = fabs(rate[i] - run->slope[i]);
        if (run->largest[i] > run->nothing[i] && isfinite(apart)) /* what is no number is said elsewhere */
            most = fmax(most, apart / run->largest[i]);
    }
    if (!(most * h > run->swift))
        return 0;
    row[2] = h / since;
    row[3] = most * since;
    return 1;
}

/* The row just written once more for the comparison alone, with the slopes of the dense output.  The rates of a settled
 * point are those of the equations: a motion that relaxes at once makes of any error a rate without bound. */
static void emit_compared(sd_run *run, double t, double *row, int begun)
{
    size_t width = (size_t)(SD_ROW_HEAD + 2 * run->observed);
    int32_t others = (int32_t)row[1] & ~SD_COMPARED;
    if (others) {
        memcpy(row + width, row, width * sizeof *row);
        row[1] = (double)others;
        row += width;
        run->rows++;
    }
    row[1] = SD_COMPARED | (begun && relaxes(run, t, row) ? SD_RELAXING : 0);
    memcpy(row + SD_ROW_HEAD + run->observed, run->slope, (size_t)run->observed * sizeof *row);
}

/* whether a row shows what it shall as its point comes: for ever not once the first ones did not */
static int meets(sd_run *run, double t)
{
    if (run->told && sd_settle_meets(run->settle, t, run->point, run->point_d)) {
        run->told++;
        return 1;
    }
    run->told = run->told > FAILS ? run->told - FAILS : 0;
    return 0;
}

/* The point of a row moved there; where only runs are compared by it, roughly, or not where states alone are seen.  rated:
 * its rates are wanted too */
static void settle_row(sd_run *run, double t, int32_t kind, int rated)
{
    if (run->settle && (rated || (!(kind == SD_COMPARED && run->bare) && !meets(run, t)))) {
        double enough = run->settle->enough;
        if (kind == SD_COMPARED)
            run->settle->enough = fmax(enough, run->rough);
        run->settle->most = run->fresh ? BEGUN : 0.0;
        sd_run_settle(run, t);
        run->settle->enough = enough;
        run->settle->most = 0.0;
    }
    if (run->least_norm)
        sd_least_norm_apply(run->least_norm, t, run->point, run->point_d);
}

/* derivatives at the ends of the last steps as exact as the rows within the last one want them */
static void refine(sd_run *run)
{
    int32_t kinds = run->glances > 1 || run->extrema ? SD_SAMPLE : 0;
    for (int32_t k = run->next; k < run->instants && run->instant[k] < run->t_to; k++)
        kinds |= run->instant_kind[k];
    if (!kinds)
        return;
    double enough = run->settle->enough;
    if (kinds == SD_COMPARED)
        run->settle->enough = fmax(enough, run->rough);
    lend(run, 1);
    run->stepper->refine(run->stepper->self, run->settle);
    lend(run, 0);
    run->settle->enough = enough;
}

void sd_run_quantities(sd_run *run, double t, double *values)
{
    memset(values, 0, (size_t)run->observed * sizeof *values);
    if (run->observe)
        run->observe->rows(&run->observe->frame, t, run->point, run->point_d, values);
}

/* values [observed] := magnitudes of what is observed and of its terms, at the point of a row */
static void find_sizes(sd_run *run, double t, const double *observed)
{
    memset(run->values, 0, (size_t)run->observed * sizeof(double));
    if (run->observe_scale)
        run->observe_scale->rows(&run->observe_scale->frame, t, run->point, run->point_d, run->values);
    for (int32_t i = 0; i < run->observed; i++)
        run->values[i] = fmax(fabs(observed[i]), fabs(run->values[i]));
}

/* the same of a point without a row */
static void find_own_sizes(sd_run *run, double t)
{
    sd_run_quantities(run, t, run->slope);
    find_sizes(run, t, run->slope);
}

static void note_sizes(sd_run *run)
{
    for (int32_t i = 0; i < run->observed; i++)
        if (run->values[i] > run->largest[i])
            run->largest[i] = run->values[i];
}

/* Sizes at the end of a step that has no row, which is moved onto the equations only where more than the state is seen and one
 * of them grows at once: what no error test sees may be anything in a first step. */
static void note_step(sd_run *run, double t)
{
    run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
    int grown = run->least_norm != NULL;
    if (!grown)
        find_own_sizes(run, t);
    for (int32_t i = 0; i < run->observed && !grown && !run->bare; i++)
        grown = run->values[i] > GROWN * run->largest[i];
    if (grown) {
        settle_row(run, t, 0, 0);
        find_own_sizes(run, t);
    }
    note_sizes(run);
}

/* one output row at an instant of the last step, written as of `label`; two where it is compared too */
static void emit(sd_run *run, double t, double label, double kind, int at_step)
{
    double *row = run->row + (size_t)run->rows * (size_t)(SD_ROW_HEAD + 2 * run->observed);
    double *out = run->end, sum[2] = {0.0, 0.0};
    const int alone = !at_step && (int32_t)kind == SD_COMPARED;
    const int unsummed = run->unsummed > 1 || (run->unsummed && alone);
    if (run->fresh) {
        memcpy(run->point, run->stepper->y, (size_t)run->stepper->n * sizeof(double));
        memcpy(run->point_d, run->start_rate, (size_t)run->stepper->n * sizeof(double));
    } else {
        int there = 0;
        if (!at_step && !unsummed)
            there = sd_run_sum(run, t, sum);
        if (!there)
            run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
    }
    int compared = !at_step && (int32_t)kind & SD_COMPARED && run->observe_rate;
    if (compared) {
        memset(run->slope, 0, (size_t)run->observed * sizeof(double));
        run->observe_rate->rows(&run->observe_rate->frame, t, run->point, run->point_d, run->slope);
    }
    int begun = compared && run->t_from == run->t_begun;
    settle_row(run, t, (int32_t)kind, begun);
    if (run->magnitude && !at_step)
        note_beyond(run);
    double dissipated = at_step ? run->dissipated : run->step_dissipated + sum[0];
    double supplied = at_step ? run->supplied : run->step_supplied + sum[1];
    if (run->unsummed && alone)
        memset(out, 0, (size_t)run->audited * sizeof *out);
    else
        sd_run_audit(run, t, run->point, run->point_d, out);
    if (!run->started)
        run->stored = out[0] + out[1];
    if (unsummed)
        dissipated = supplied = NAN;
    double energy = out[0] + out[1] - run->stored + dissipated - supplied;
    double constraints = run->settle ? run->settle->constraints : 0.0;
    double head[SD_ROW_HEAD] = {label, kind, out[0], out[1], dissipated, supplied, energy, constraints};
    double drift = fmax(run->settle ? run->settle->drift : 0.0, run->projected && run->started ? *run->projected : 0.0);
    double behind[7] = {energy, out[0], out[1], dissipated, supplied, constraints, drift};
    memcpy(row, head, sizeof head);
    for (int k = 0; k < 7; k++)
        if (run->audit_at[k] >= 0) {
            run->point[run->audit_at[k]] = behind[k];
            run->point_d[run->audit_at[k]] = 0.0;
        }
    memset(row + SD_ROW_HEAD, 0, 2 * (size_t)run->observed * sizeof *row);
    if (run->observe)
        run->observe->rows(&run->observe->frame, t, run->point, run->point_d, row + SD_ROW_HEAD);
    if (run->observe_rate && !(compared && alone && !begun))
        run->observe_rate->rows(&run->observe_rate->frame, t, run->point, run->point_d,
                                row + SD_ROW_HEAD + run->observed);
    find_sizes(run, t, row + SD_ROW_HEAD);
    note_sizes(run);
    if ((int32_t)kind & SD_COMPARED)
        run->t_row = label;
    run->rows++;
    run->rows_written++;
    if (compared)
        emit_compared(run, t, row, begun);
    for (int k = 0; k < 7; k++) /* what is watched at other points does not see this row's */
        if (run->audit_at[k] >= 0)
            run->point[run->audit_at[k]] = 0.0;
}

void sd_run_sample(sd_run *run, double t)
{
    if (run->rows + 1 < run->room)
        emit(run, t, t, SD_SAMPLE, 0);
}

/* kind of the row at the end of a step, or at the start */
static double kind_here(const sd_run *run, int asked)
{
    int32_t kind = asked ? run->instant_kind[run->next] : 0;
    kind |= (run->every_step ? SD_TRACE : 0) | (run->glances ? SD_SAMPLE : 0);
    return (double)kind;
}

/* Whether the next instant, within a step that ends at t, is nearer to the row before than rows are to be.  The last one
 * before an event is written: in a run behind this one it may stand behind the event; and the first one behind a restart,
 * where what relaxes at once has not done so yet. */
static int passes_over(const sd_run *run, double t)
{
    int32_t next = run->next;
    int last = next + 1 == run->instants || run->instant[next + 1] >= t;
    if (run->t_from == run->t_begun && run->t_row <= run->t_begun)
        return 0;
    return run->instant[next] < run->t_row + run->apart * (t - run->t_from) && !(last && t < run->stepper->ivp->t);
}

/* The next instant within a step that ends at t at which something is watched alone; t where that is none. */
static double next_glance(const sd_run *run, double t)
{
    return run->glanced + 1 < run->glances ? run->t_from + (t - run->t_from) * (run->glanced + 1) / run->glances : t;
}

/* rows of the last step that are still to be written; 1: no room left */
int sd_run_drain(sd_run *run)
{
    double t = run->t_to;
    if (run->pending && run->settle && run->stepper->refine)
        refine(run);
    if (run->pending && run->extrema) {
        if (run->extrema->watched && run->rows + CRESTS >= run->room && run->rows)
            return 1;
        sd_extrema_within(run);
    }
    while (run->pending) {
        if (run->rows + 1 >= run->room)
            return 1;
        int asked = run->next < run->instants && run->instant[run->next] <= t;
        double glance = next_glance(run, t);
        if (glance < t && !(asked && run->instant[run->next] <= glance)) {
            run->glanced++;
            emit(run, glance, glance, SD_SAMPLE, 0);
            continue;
        }
        if (asked && run->instant[run->next] < t) {
            if (passes_over(run, t)) {
                run->next++;
                continue;
            }
            double kind = (double)run->instant_kind[run->next];
            double instant = run->instant[run->next++];
            emit(run, instant, instant, kind, 0);
            continue;
        }
        double kind = kind_here(run, asked);
        if (t == run->stepper->ivp->t_end || t < run->stepper->ivp->t)
            kind = (double)((int32_t)kind | run->end_kind);
        run->next += asked;
        if (kind > 0.0)
            emit(run, t, t, kind, 1);
        else if (run->sizes_at_steps)
            note_step(run, t);
        run->pending = 0;
    }
    return 0;
}

/* The point started from, which `emit` has put into run->point: powers there; rows asked for, as of `label` where the
 * instant is not earlier. */
static void rows_of_start(sd_run *run, double label)
{
    double t = run->stepper->ivp->t;
    int32_t before = run->rows;
    while (run->next < run->instants && run->instant[run->next] < label) {
        double kind = (double)run->instant_kind[run->next];
        emit(run, t, run->instant[run->next++], kind, 1);
    }
    int32_t asked = (int32_t)kind_here(run, 0) | run->start_kind;
    while (run->next < run->instants && run->instant[run->next] <= t)
        asked |= run->instant_kind[run->next++]; /* between label and t there is nothing new */
    double kind = (double)asked;
    emit(run, t, label, kind, 1);
    if (kind == 0.0 && run->rows > before) {
        run->rows--; /* nobody asked for it */
        run->rows_written--;
    }
    sd_run_audit(run, t, run->point, run->point_d, run->after);
    if (run->ledgers)
        sd_ledgers_note(run->ledgers, t, run->point, run->point_d, run->after, room_of_contents(run));
    run->t_from = run->t_to = run->t_begun = t;
    run->fresh = 0;
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
    rows_of_start(run, run->stepper->ivp->t);
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
    run->supplied += (new[0] + new[1]) - (old[0] + old[1]);
    if (run->ledgers)
        sd_ledgers_jump(run->ledgers, old, new);
    run->stepper->start(run->stepper->self, t, y, yd, 0.0);
    run->fresh = 1;
    rows_of_start(run, label);
}

void sd_run_look(sd_run *run, double t, double *values)
{
    run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
    sd_run_quantities(run, t, values);
}

void sd_run_observe(sd_run *run, double t, double *values)
{
    run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
    if (run->settle)
        sd_run_settle(run, t);
    sd_run_quantities(run, t, values);
}

/* quadratures over the step just accepted, powers and balances at its end */
static void measure(sd_run *run, double from, double t)
{
    run->t_from = from;
    run->t_to = t;
    run->sampled = run->noded = 0;
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

void sd_run_row(sd_run *run, int32_t kind)
{
    emit(run, run->t_to, run->t_to, (double)kind, 1);
}

int sd_run_asks(const sd_run *run, double t)
{
    return !run->every_step && run->next < run->instants && run->instant[run->next] <= t &&
           run->instant_kind[run->next] & SD_TRACE;
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
    memcpy(run->power, run->after, (size_t)run->audited * sizeof(double));
    if (run->stepper->step(run->stepper->self))
        return SD_FAILED;
    run->t_from = from;
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
