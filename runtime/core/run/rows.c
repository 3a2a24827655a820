/* The rows of an integration: the point of each, settled; energies, what is observed there, sizes (see run.h). */
#include "run/run.h"

#include <math.h>
#include <string.h>

#include "run/compared.h"
#include "run/meters/quadratures.h"
#include "linear/lanes.h"
#include "system/settle_shown.h"
#include "linear/tuning.h"

#define FAILS 4 /* rows that meet their sums for each that does not: fewer are not worth looking */
#define CRESTS 32 /* rows of what is watched that a step may have beside those at its parts */
#define GROWN 1.1 /* times the largest so far: beyond it the size of a step is not believed as the method left it */
#define BEGUN SD_SMALL /* magnitudes by which a start may still be moved: at a valve at rest no state gives its law a rate */

/* points are settled in room of the method's, or no more */
static void lend(sd_run *run, int room)
{
    const sd_stepper *stepper = run->stepper;
    run->settle->lent = room && stepper->spare ? stepper->spare(stepper->self, &run->settle->lent_room) : NULL;
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

/* whether any of the first unknowns, a whole number of lanes, lies further beyond those of the steps than `beyond` */
static SD_WIDE int reaches(int32_t n, const double *point, const double *end, const double *usual, double beyond)
{
    sd_bits any = {0};
    for (int32_t j = 0; j < n; j += SD_LANES) {
        const sd_lanes size = SD_SIZES(SD_FROM(point, j)), last = beyond * SD_SIZES(SD_FROM(end, j));
        any |= (size > last) & (size > beyond * SD_FROM(usual, j));
    }
    return (any[0] | any[1] | any[2] | any[3]) != 0;
}

/* How far the unknowns of a row within a step, as written, lie beyond those of the steps, its own end among them. */
static void note_beyond(sd_run *run)
{
    const double *end = run->stepper->y;
    const int32_t n = run->stepper->n < run->written ? run->stepper->n : run->written, whole = n - n % SD_LANES;
    for (int32_t j = reaches(whole, run->point, end, run->magnitude, run->beyond) ? 0 : whole; j < n; j++) {
        const double usual = run->magnitude[j], last = fabs(end[j]), size = last > usual ? last : usual;
        if (fabs(run->point[j]) > run->beyond * size && usual > 0.0)
            run->beyond = fabs(run->point[j]) / size;
    }
}

/* Whether a row shows what it shall as its point comes: for ever not once the first ones did not.  Where one output within a
 * step meets constant sums alone, so do the others there, which are combinations of the same points (of radau they are not). */
static int meets(sd_run *run, double t)
{
    if (run->told && run->told_here) {
        sd_settle_as_met(run->settle, run->point, run->point_d);
        return 1;
    }
    if (run->told && sd_settle_meets(run->settle, t, run->point, run->point_d)) {
        run->told++;
        run->told_here = !run->fresh && !run->stepper->collocated && sd_settle_sums_alone(run->settle);
        return 1;
    }
    run->told = run->told > FAILS ? run->told - FAILS : 0;
    return 0;
}

/* whether a row is for comparison alone, or of a draft, which shows states alone: it stays as the dense output has it */
static int stays(const sd_run *run, int32_t kind)
{
    return run->bare && (kind == SD_COMPARED || run->unsummed > 1);
}

/* The point of a row moved there; where only runs are compared by it, roughly.  rated: its rates are wanted too */
void sd_run_settle_row(sd_run *run, double t, int32_t kind, int rated)
{
    if (run->settle && (rated || (!stays(run, kind) && !meets(run, t)))) {
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
    for (int32_t i = 0; i < run->observed; i++) {
        const double size = fabs(observed[i]), terms = fabs(run->values[i]);
        run->values[i] = terms > size || isnan(size) ? terms : size;
    }
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
        sd_run_settle_row(run, t, 0, 0);
        find_own_sizes(run, t);
    }
    note_sizes(run);
}

/* run->point := that of a row, not settled yet; sum: of the powers from the start of the last step, where they are summed */
static void find_point(sd_run *run, double t, int summed, double sum[2])
{
    if (run->fresh) {
        memcpy(run->point, run->stepper->y, (size_t)run->stepper->n * sizeof(double));
        memcpy(run->point_d, run->start_rate, (size_t)run->stepper->n * sizeof(double));
    } else if (!(summed && sd_run_sum(run, t, sum)))
        run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
}

/* run->slope := rates of what is observed as the dense output has them */
static void find_slopes(sd_run *run, double t)
{
    memset(run->slope, 0, (size_t)run->observed * sizeof(double));
    run->observe_rate->rows(&run->observe_rate->frame, t, run->point, run->point_d, run->slope);
}

/* What stands before the quantities of a row: label, kind, energies and their balance by the powers summed so far (left: not,
 * they are no numbers), constraints (stays: nor is this); what is observed reads the same behind y. */
static void write_head(sd_run *run, double label, double kind, const double powers[2], int left, int stays, double *row)
{
    const double *out = run->end;
    double dissipated = left ? NAN : powers[0], supplied = left ? NAN : powers[1];
    double energy = out[0] + out[1] - run->stored + dissipated - supplied;
    double constraints = stays ? NAN : run->settle ? run->settle->constraints : 0.0;
    double head[SD_ROW_HEAD] = {label, kind, out[0], out[1], dissipated, supplied, energy, constraints};
    double drift = fmax(run->settle ? run->settle->drift : 0.0, run->projected && run->started ? *run->projected : 0.0);
    double behind[7] = {energy, out[0], out[1], dissipated, supplied, constraints, drift};
    memcpy(row, head, sizeof head);
    for (int k = 0; k < 7; k++)
        if (run->audit_at[k] >= 0) {
            run->point[run->audit_at[k]] = behind[k];
            run->point_d[run->audit_at[k]] = 0.0;
        }
}

/* what is observed at the point of a row, and, where they are asked for, its rates */
static void write_quantities(sd_run *run, double t, int rates, double *row)
{
    double *values = row + SD_ROW_HEAD;
    memset(values, 0, 2 * (size_t)run->observed * sizeof *values);
    if (run->observe)
        run->observe->rows(&run->observe->frame, t, run->point, run->point_d, values);
    if (run->observe_rate && rates)
        run->observe_rate->rows(&run->observe_rate->frame, t, run->point, run->point_d, values + run->observed);
    find_sizes(run, t, values);
    note_sizes(run);
}

/* one output row at an instant of the last step, written as of `label`; two where it is compared too */
static void emit(sd_run *run, double t, double label, double kind, int at_step)
{
    double *row = run->row + (size_t)run->rows * (size_t)(SD_ROW_HEAD + 2 * run->observed);
    double sum[2] = {0.0, 0.0};
    const int alone = !at_step && (int32_t)kind == SD_COMPARED; /* nothing but comparison reads it */
    const int unsummed = run->unsummed > 1 || (run->unsummed && alone);
    const int compared = !at_step && (int32_t)kind & SD_COMPARED && run->observe_rate;
    const int begun = compared && run->t_from == run->t_begun;
    find_point(run, t, !at_step && !unsummed, sum);
    if (compared)
        find_slopes(run, t);
    sd_run_settle_row(run, t, (int32_t)kind, begun);
    if (run->magnitude && !at_step)
        note_beyond(run);
    if (run->unsummed && alone)
        memset(run->end, 0, (size_t)run->audited * sizeof(double));
    else
        sd_run_audit(run, t, run->point, run->point_d, run->end);
    if (!run->started)
        run->stored = run->end[0] + run->end[1];
    const double powers[2] = {at_step ? run->dissipated : run->step_dissipated + sum[0],
                              at_step ? run->supplied : run->step_supplied + sum[1]};
    write_head(run, label, kind, powers, unsummed, !begun && stays(run, (int32_t)kind), row);
    write_quantities(run, t, !(compared && alone && !begun), row);
    if ((int32_t)kind & SD_COMPARED)
        run->t_row = label;
    run->rows++;
    run->rows_written++;
    if (compared)
        sd_run_compare(run, t, row, begun);
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

void sd_run_rows_of_start(sd_run *run, double label)
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
}

void sd_run_look(sd_run *run, double t, double *values)
{
    run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
    sd_run_quantities(run, t, values);
}

void sd_run_observe(sd_run *run, double t, double *values)
{
    run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
    sd_settle *settle = run->settle;
    if (settle) { /* as the point will be from which the event is: to round-off, in a draft too, and by factors of its own,
                   * for slopes of elsewhere put it elsewhere */
        const double enough = settle->enough;
        settle->enough = 0.0;
        settle->ready = SD_BY_NONE;
        lend(run, 1);
        sd_settle_point(settle, t, run->point, run->point_d);
        lend(run, 0);
        settle->enough = enough;
    }
    sd_run_quantities(run, t, values);
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

