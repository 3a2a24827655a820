/* The driver of one integration: see run.h. */
#define _POSIX_C_SOURCE 199309L
#include "run.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define POLL 4 /* steps between two looks at the clock */

sd_run *sd_run_new(sd_stepper *stepper, sd_settle *settle, int32_t written, int32_t extended, int32_t observed)
{
    sd_run *run = calloc(1, sizeof *run);
    if (!run)
        return NULL;
    size_t n = (size_t)(extended > stepper->n ? extended : stepper->n) + 8, m = (size_t)observed + 8;
    run->memory = calloc(4 * n + 2 * m, sizeof(double));
    if (!run->memory) {
        free(run);
        return NULL;
    }
    run->stepper = stepper;
    run->settle = settle;
    run->written = written;
    run->observed = observed;
    run->point = run->memory;
    run->point_d = run->point + n;
    run->aux = run->point_d + n;
    run->aux_d = run->aux + n;
    run->values = run->aux_d + n;
    run->largest = run->values + m;
    return run;
}

void sd_run_free(sd_run *run)
{
    if (!run)
        return;
    free(run->memory);
    free(run);
}

/* out [4]: kinetic and potential energy, powers dissipated and supplied */
static void audit(const sd_run *run, double t, const double *y, const double *yd, double *out)
{
    memset(out, 0, 4 * sizeof *out);
    if (run->audit)
        run->audit->rows(&run->audit->frame, t, y, yd, out);
}

/* integrals of the two powers from the start of the last step to `to`, within that step */
static void integrate(sd_run *run, double to, double *dissipated, double *supplied, double *end)
{
    static const double inner = 0.44721359549995793928; /* 1/sqrt(5) */
    const sd_stepper *stepper = run->stepper;
    double from = run->t_from, half = 0.5 * (to - from), middle = 0.5 * (to + from), out[4], sum[2] = {0.0, 0.0};
    if (!run->audit || half == 0.0) {
        *dissipated = *supplied = 0.0;
        return;
    }
    if (stepper->nodes && to == *stepper->t) {
        *dissipated = *supplied = 0.0;
        for (int32_t k = 0; k < stepper->nodes; k++) {
            if (stepper->node_weight[k] == 0.0)
                continue;
            audit(run, from + stepper->node[k] * (to - from), stepper->node_y[k], stepper->node_yd[k], out);
            *dissipated += (to - from) * stepper->node_weight[k] * out[2];
            *supplied += (to - from) * stepper->node_weight[k] * out[3];
        }
        return;
    }
    for (int k = -1; k <= 1; k += 2) {
        run->stepper->dense(run->stepper->self, middle + k * inner * half, run->aux, run->aux_d);
        audit(run, middle + k * inner * half, run->aux, run->aux_d, out);
        sum[0] += out[2];
        sum[1] += out[3];
    }
    run->stepper->dense(run->stepper->self, to, run->aux, run->aux_d);
    audit(run, to, run->aux, run->aux_d, end);
    *dissipated = half / 6.0 * (run->power_dissipated + 5.0 * sum[0] + end[2]);
    *supplied = half / 6.0 * (run->power_supplied + 5.0 * sum[1] + end[3]);
}

/* one output row at an instant of the last step, written as of `label` */
static void emit(sd_run *run, double t, double label, double kind, int at_step)
{
    double *row = run->row + (size_t)run->rows * (size_t)(SD_ROW_HEAD + 2 * run->observed);
    double out[4], end[4] = {0.0, 0.0, 0.0, 0.0}, dissipated = 0.0, supplied = 0.0;
    if (run->fresh) {
        memcpy(run->point, run->stepper->y, (size_t)run->stepper->n * sizeof(double));
        memcpy(run->point_d, run->start_rate, (size_t)run->stepper->n * sizeof(double));
    } else {
        if (!at_step)
            integrate(run, t, &dissipated, &supplied, end);
        run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
    }
    if (run->settle)
        sd_settle_point(run->settle, t, run->point, run->point_d);
    if (run->least_norm)
        sd_least_norm_apply(run->least_norm, t, run->point, run->point_d);
    dissipated = at_step ? run->dissipated : run->step_dissipated + dissipated;
    supplied = at_step ? run->supplied : run->step_supplied + supplied;
    audit(run, t, run->point, run->point_d, out);
    if (!run->started)
        run->stored = out[0] + out[1];
    double energy = out[0] + out[1] - run->stored + dissipated - supplied;
    double constraints = run->settle ? run->settle->constraints : 0.0;
    double head[SD_ROW_HEAD] = {label, kind, out[0], out[1], dissipated, supplied, energy, constraints};
    double behind[6] = {energy, out[0], out[1], dissipated, supplied, constraints};
    memcpy(row, head, sizeof head);
    for (int k = 0; k < 6; k++)
        if (run->audit_at[k] >= 0) {
            run->point[run->audit_at[k]] = behind[k];
            run->point_d[run->audit_at[k]] = 0.0;
        }
    memset(row + SD_ROW_HEAD, 0, 2 * (size_t)run->observed * sizeof *row);
    if (run->observe)
        run->observe->rows(&run->observe->frame, t, run->point, run->point_d, row + SD_ROW_HEAD);
    if (run->observe_rate)
        run->observe_rate->rows(&run->observe_rate->frame, t, run->point, run->point_d,
                                row + SD_ROW_HEAD + run->observed);
    memset(run->values, 0, (size_t)run->observed * sizeof(double));
    if (run->observe_scale)
        run->observe_scale->rows(&run->observe_scale->frame, t, run->point, run->point_d, run->values);
    for (int32_t i = 0; i < run->observed; i++) {
        double size = fmax(fabs(row[SD_ROW_HEAD + i]), fabs(run->values[i]));
        if (size > run->largest[i])
            run->largest[i] = size;
    }
    run->rows++;
    run->rows_written++;
}

/* kind of the row at the end of a step, or at the start */
static double kind_here(const sd_run *run, int asked)
{
    int32_t kind = asked ? run->instant_kind[run->next] : 0;
    kind |= (run->every_step ? 1 : 0) | (run->sample_steps ? 2 : 0);
    return (double)kind;
}

/* rows of the last step that are still to be written; 1: no room left */
static int drain(sd_run *run)
{
    double t = *run->stepper->t;
    if (run->pending && run->settle && run->stepper->refine && run->next < run->instants &&
        run->instant[run->next] < t)
        run->stepper->refine(run->stepper->self, run->settle);
    while (run->pending) {
        if (run->rows >= run->room)
            return 1;
        int asked = run->next < run->instants && run->instant[run->next] <= t;
        if (asked && run->instant[run->next] < t) {
            double kind = (double)run->instant_kind[run->next];
            double instant = run->instant[run->next++];
            emit(run, instant, instant, kind, 0);
            continue;
        }
        double kind = kind_here(run, asked);
        run->next += asked;
        if (kind > 0.0)
            emit(run, t, t, kind, 1);
        run->pending = 0;
    }
    return 0;
}

/* The point started from, which `emit` has put into run->point: powers there; rows asked for, as of `label` where the
 * instant is not earlier. */
static void rows_of_start(sd_run *run, double label)
{
    double out[4], t = *run->stepper->t;
    int32_t before = run->rows;
    while (run->next < run->instants && run->instant[run->next] < label) {
        double kind = (double)run->instant_kind[run->next];
        emit(run, t, run->instant[run->next++], kind, 1);
    }
    int asked = run->next < run->instants && run->instant[run->next] <= t;
    double kind = kind_here(run, asked);
    emit(run, t, label, kind, 1);
    run->next += asked;
    while (run->next < run->instants && run->instant[run->next] <= t)
        run->next++; /* between label and t there is nothing new */
    if (kind == 0.0 && run->rows > before) {
        run->rows--; /* nobody asked for it */
        run->rows_written--;
    }
    audit(run, t, run->point, run->point_d, out);
    run->power_dissipated = out[2];
    run->power_supplied = out[3];
    run->t_from = t;
    run->fresh = 0;
}

/* the start: energies, powers and the first row */
static int begin(sd_run *run)
{
    if (run->rows >= run->room)
        return 1;
    run->fresh = 1;
    rows_of_start(run, *run->stepper->t);
    run->started = 1;
    return 0;
}

void sd_run_restart(sd_run *run, double t, double label, const double *y, const double *yd, const double *before,
                    const double *before_d)
{
    double old[4], new[4];
    size_t written = (size_t)run->written * sizeof(double);
    memcpy(run->aux, before, written);
    memcpy(run->aux_d, before_d, written);
    audit(run, *run->stepper->t, run->aux, run->aux_d, old);
    memcpy(run->aux, y, written);
    memcpy(run->aux_d, yd, written);
    audit(run, t, run->aux, run->aux_d, new);
    run->supplied += (new[0] + new[1]) - (old[0] + old[1]);
    run->stepper->start(run->stepper->self, t, y, yd, 0.0);
    run->fresh = 1;
    rows_of_start(run, label);
}

/* quadratures over the step just accepted */
static void measure(sd_run *run, double from)
{
    double dissipated, supplied, end[4] = {0.0, 0.0, 0.0, 0.0};
    run->t_from = from;
    run->step_dissipated = run->dissipated;
    run->step_supplied = run->supplied;
    integrate(run, *run->stepper->t, &dissipated, &supplied, end);
    run->dissipated += dissipated;
    run->supplied += supplied;
    /* powers at the start of the next step are kept apart until the rows of this one are written */
    run->pending = 1;
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int sd_run_advance(sd_run *run, int64_t steps, double seconds)
{
    double until = now() + seconds, out[4];
    if (!run->started && begin(run))
        return SD_FULL;
    for (int64_t k = 0; k < steps; k++) {
        if (run->pending && drain(run))
            return SD_FULL;
        if (*run->stepper->system->stop)
            return SD_FAILED;
        if (*run->stepper->t >= *run->stepper->t_end)
            return SD_FINISHED;
        double from = *run->stepper->t;
        if (run->audit && *run->stepper->taken > 0) { /* else they are those of the start */
            run->stepper->dense(run->stepper->self, from, run->aux, run->aux_d);
            audit(run, from, run->aux, run->aux_d, out);
            run->power_dissipated = out[2];
            run->power_supplied = out[3];
        }
        if (run->stepper->step(run->stepper->self))
            return SD_FAILED;
        measure(run, from);
        if (drain(run))
            return SD_FULL;
        if (k % POLL == POLL - 1 && now() > until)
            return SD_RUNNING;
    }
    return *run->stepper->t >= *run->stepper->t_end && !run->pending ? SD_FINISHED : SD_RUNNING;
}
