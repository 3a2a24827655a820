/* The driver of one integration: see run.h. */
#define _POSIX_C_SOURCE 199309L
#include "run.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define POLL 4 /* steps between two looks at the clock */

sd_run *sd_run_new(sd_bdf *bdf, sd_settle *settle, int32_t written, int32_t extended, int32_t observed)
{
    sd_run *run = calloc(1, sizeof *run);
    if (!run)
        return NULL;
    size_t n = (size_t)(extended > bdf->n ? extended : bdf->n) + 8, m = (size_t)observed + 8;
    run->memory = calloc(4 * n + 2 * m, sizeof(double));
    if (!run->memory) {
        free(run);
        return NULL;
    }
    run->bdf = bdf;
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
    double from = run->t_from, half = 0.5 * (to - from), middle = 0.5 * (to + from), out[4], sum[2] = {0.0, 0.0};
    if (!run->audit || half == 0.0) {
        *dissipated = *supplied = 0.0;
        return;
    }
    for (int k = -1; k <= 1; k += 2) {
        sd_bdf_dense(run->bdf, middle + k * inner * half, run->aux, run->aux_d);
        audit(run, middle + k * inner * half, run->aux, run->aux_d, out);
        sum[0] += out[2];
        sum[1] += out[3];
    }
    sd_bdf_dense(run->bdf, to, run->aux, run->aux_d);
    audit(run, to, run->aux, run->aux_d, end);
    *dissipated = half / 6.0 * (run->power_dissipated + 5.0 * sum[0] + end[2]);
    *supplied = half / 6.0 * (run->power_supplied + 5.0 * sum[1] + end[3]);
}

/* one output row at an instant of the last step */
static void emit(sd_run *run, double t, double kind, int at_step)
{
    double *row = run->row + (size_t)run->rows * (size_t)(SD_ROW_HEAD + 2 * run->observed);
    double out[4], end[4] = {0.0, 0.0, 0.0, 0.0}, dissipated = 0.0, supplied = 0.0;
    if (!run->started) {
        memcpy(run->point, run->bdf->y, (size_t)run->bdf->n * sizeof(double));
        memcpy(run->point_d, run->start_rate, (size_t)run->bdf->n * sizeof(double));
    } else {
        if (!at_step)
            integrate(run, t, &dissipated, &supplied, end);
        sd_bdf_dense(run->bdf, t, run->point, run->point_d);
    }
    if (run->settle)
        sd_settle_point(run->settle, t, run->point, run->point_d);
    dissipated = at_step ? run->dissipated : run->step_dissipated + dissipated;
    supplied = at_step ? run->supplied : run->step_supplied + supplied;
    audit(run, t, run->point, run->point_d, out);
    if (!run->started)
        run->stored = out[0] + out[1];
    double energy = out[0] + out[1] - run->stored + dissipated - supplied;
    double constraints = run->settle ? run->settle->constraints : 0.0;
    double head[SD_ROW_HEAD] = {t, kind, out[0], out[1], dissipated, supplied, energy, constraints};
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
    double t = run->bdf->t;
    while (run->pending) {
        if (run->rows >= run->room)
            return 1;
        int asked = run->next < run->instants && run->instant[run->next] <= t;
        if (asked && run->instant[run->next] < t) {
            double kind = (double)run->instant_kind[run->next];
            emit(run, run->instant[run->next++], kind, 0);
            continue;
        }
        double kind = kind_here(run, asked);
        run->next += asked;
        if (kind > 0.0)
            emit(run, t, kind, 1);
        run->pending = 0;
    }
    return 0;
}

/* the start: energies, powers and the first row */
static int begin(sd_run *run)
{
    double out[4];
    if (run->rows >= run->room)
        return 1;
    run->t_from = run->bdf->t;
    int asked = run->next < run->instants && run->instant[run->next] <= run->bdf->t;
    emit(run, run->bdf->t, kind_here(run, asked), 1);
    run->next += asked;
    audit(run, run->bdf->t, run->point, run->point_d, out);
    run->power_dissipated = out[2];
    run->power_supplied = out[3];
    if (run->row[(size_t)(run->rows - 1) * (size_t)(SD_ROW_HEAD + 2 * run->observed) + 1] == 0.0)
        run->rows--; /* nobody asked for it */
    run->started = 1;
    return 0;
}

/* quadratures over the step just accepted */
static void measure(sd_run *run, double from)
{
    double dissipated, supplied, end[4] = {0.0, 0.0, 0.0, 0.0};
    run->t_from = from;
    run->step_dissipated = run->dissipated;
    run->step_supplied = run->supplied;
    integrate(run, run->bdf->t, &dissipated, &supplied, end);
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
        if (*run->bdf->system->stop)
            return SD_FAILED;
        if (run->bdf->t >= run->bdf->t_end)
            return SD_FINISHED;
        double from = run->bdf->t;
        if (run->audit && run->bdf->steps > 0) {
            sd_bdf_dense(run->bdf, from, run->aux, run->aux_d);
            audit(run, from, run->aux, run->aux_d, out);
            run->power_dissipated = out[2];
            run->power_supplied = out[3];
        }
        if (sd_bdf_step(run->bdf))
            return SD_FAILED;
        measure(run, from);
        if (drain(run))
            return SD_FULL;
        if (k % POLL == POLL - 1 && now() > until)
            return SD_RUNNING;
    }
    return run->bdf->t >= run->bdf->t_end && !run->pending ? SD_FINISHED : SD_RUNNING;
}
