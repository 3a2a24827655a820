/* The step of Gauss's method with the energy balance closed: its size, the step itself, values within (see energy.h). */
#include "steppers/energy/energy.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define S SD_ENERGY_STAGES
#define SAFETY 0.8
#define GROWTH 4.0       /* of the first step from one trial to the next */
#define EASY 0.05        /* of what is allowed: a first step with less is tried longer */
#define MARGIN 1.2       /* growth of the roughness behind which the step is checked anew */
#define WINDOW 20        /* steps before it is tried longer again, at first */
#define MOST 20.0        /* steps a period at most whose errors are thought to add up: at a kink they do not */
#define LAST_WINDOW ((int64_t)1 << 40)
#define HELD 500         /* steps that the iteration, and not the error, keeps too short: stiffness, not a kink */
#define FAILURES 40      /* of slopes in one step */
enum { VECTORS = 21 }; /* of n, beside the stages */

sd_energy *sd_energy_new(sd_system *system, sd_underlying *underlying, int32_t extended, int32_t audited)
{
    sd_energy *energy = calloc(1, sizeof *energy);
    if (!energy)
        return NULL;
    size_t m = (size_t)(extended > system->unknowns ? extended : system->unknowns);
    m = ((size_t)system->rows > m ? (size_t)system->rows : m) + 1;
    energy->memory = calloc((VECTORS + 4 * S) * m + 4 * (size_t)audited + 1, sizeof(double));
    if (!energy->memory) {
        free(energy);
        return NULL;
    }
    double *next = energy->memory;
    double **vectors[VECTORS] = {&energy->phi,     &energy->yd,        &energy->rest,  &energy->from,    &energy->from_d,
                                 &energy->from_rest, &energy->raw,     &energy->half,  &energy->half_rest, &energy->inner,
                                 &energy->inner_d, &energy->trial,     &energy->old_y, &energy->old_rate, &energy->ivp.ee,
                                 &energy->ivp.weight,  &energy->begin,     &energy->position, &energy->velocity,
                                 &energy->base,    &energy->sample};
    for (int i = 0; i < VECTORS; i++, next += m)
        *vectors[i] = next;
    for (int i = 0; i < S; i++, next += 4 * m) {
        energy->stage.y[i] = next;
        energy->stage.rate[i] = next + m;
        energy->side.y[i] = next + 2 * m;
        energy->side.rate[i] = next + 3 * m;
    }
    energy->sample = next; /* the last ones, longer than a vector perhaps */
    energy->work = energy->sample + audited;
    energy->moves = energy->work + audited;
    energy->inner_moves = energy->moves + audited;
    energy->ivp.system = system;
    energy->underlying = underlying;
    energy->ivp.n = system->unknowns;
    energy->audited = audited;
    energy->ivp.stepper = (sd_stepper){
        .self = energy, .ivp = &energy->ivp, .n = energy->ivp.n, .y = energy->phi, .yd = energy->yd, .step = sd_energy_step,
        .dense = sd_energy_dense, .start = sd_energy_start, .nodes = S, .node = sd_energy_c, .node_weight = sd_energy_b,
        .node_y = energy->stage.y, .node_yd = energy->stage.rate, .part_y = energy->side.y, .part_yd = energy->side.rate,
        .length = &energy->ivp.h_used, .moves = energy->moves, .part_moves = energy->inner_moves};
    return energy;
}

void sd_energy_free(sd_energy *energy)
{
    if (!energy)
        return;
    free(energy->memory);
    free(energy);
}

/* root mean square of x over the tested unknowns in the error weights */
static double norm(const sd_energy *energy, const double *x)
{
    return energy->ivp.tested ? sqrt(sd_squares(&energy->ivp, x, NULL) / energy->ivp.tested) : 0.0;
}

void sd_energy_start(void *self, double t, const double *y, const double *yd, double h)
{
    sd_energy *energy = self;
    size_t size = (size_t)energy->ivp.n * sizeof *y;
    sd_begin(&energy->ivp, t);
    memmove(energy->phi, y, size);
    memmove(energy->yd, yd, size);
    sd_underlying_begin(energy->underlying, 1e-15, energy->yd);
    memset(energy->rest, 0, size);
    sd_weigh(&energy->ivp, energy->ivp.rtol, energy->phi);
    if (!(h > 0.0))
        h = sd_first_step(&energy->ivp, SD_FIRST * (energy->ivp.t_end - t), 0.1, energy->ivp.rtol * norm(energy, energy->yd));
    energy->wanted = fmin(energy->ivp.fixed_h > 0.0 ? energy->ivp.fixed_h : h, energy->ivp.h_max);
    energy->anchor_end = -INFINITY;
    energy->ivp.h = energy->wanted;
    energy->rough = energy->frequency = energy->lost = energy->content = 0.0;
    energy->finding = !(energy->ivp.fixed_h > 0.0);
    energy->guessed = energy->inner_ready = energy->grown = energy->limited = 0;
    energy->held = 0;
    energy->since = 0;
    energy->window = energy->window ? energy->window : WINDOW;
    energy->energy = energy->audit ? sd_energy_content(energy, t, energy->phi, energy->yd) : 0.0;
}

/* equal steps from here to the end, none longer than wanted */
static void fit(sd_energy *energy)
{
    if (energy->anchor_end == energy->ivp.t_end)
        return;
    double left = energy->ivp.t_end - energy->ivp.t;
    energy->anchor = energy->ivp.t;
    energy->anchor_end = energy->ivp.t_end;
    energy->done = 0;
    energy->count = (int64_t)fmax(1.0, ceil(left / energy->wanted * (1.0 - 1e-12)));
    energy->ivp.h = left / (double)energy->count;
}

/* another step; one that shrinks soon after it has grown was not to grow yet */
static void take_step(sd_energy *energy, double wanted)
{
    energy->wanted = fmin(wanted, energy->ivp.h_max);
    energy->anchor_end = -INFINITY;
    energy->rough = 0.0;
    energy->since = 0;
    fit(energy);
}

static void shrink(sd_energy *energy, double factor)
{
    double rough = energy->rough_before;
    int vain = energy->grown == 2;
    if (energy->grown && energy->window < LAST_WINDOW)
        energy->window *= 2;
    energy->grown = 0;
    take_step(energy, vain ? energy->before : energy->ivp.h * factor);
    energy->rough = vain ? rough : 0.0;
}

/* slopes of all stages as at the start of the step */
static void guess_start(const sd_energy *energy, const double *y, const double *yd, sd_collocation *guess)
{
    size_t size = (size_t)energy->ivp.n * sizeof(double);
    for (int i = 0; i < S; i++) {
        memcpy(guess->y[i], y, size);
        memcpy(guess->rate[i], yd, size);
    }
}

/* the stages of the step from a point near the last one, and raw, by the slopes that stand there as guesses */
static int collocate(sd_energy *energy, const double *from)
{
    return sd_energy_collocate(energy, &energy->stage, energy->ivp.t, from, energy->rest, energy->ivp.h, energy->raw,
                               energy->from_rest);
}

/* energy that the step drains */
static double drained(sd_energy *energy)
{
    return energy->audit ? sd_energy_drained(energy, &energy->stage, energy->ivp.t, energy->ivp.h) : 0.0;
}

/* The step from the last point to raw, not moved onto anything yet; its slopes may be guessed from those of the step
 * before, or of a trial of this one (guessed: the length of that one). */
static int attempt(sd_energy *energy)
{
    int cause = SD_NEWTON;
    if (energy->guessed) {
        sd_energy_guess(energy, &energy->stage, 1.0, energy->ivp.h / energy->ivp.h_used, &energy->stage);
        cause = collocate(energy, energy->phi);
        if (cause == SD_FINE || cause == SD_STOPPED || cause == SD_MEMORY)
            return cause;
    }
    guess_start(energy, energy->phi, energy->yd, &energy->stage);
    return collocate(energy, energy->phi);
}

/* the highest difference of the stages' slopes over the step, in the weights */
static double roughness(sd_energy *energy)
{
    double factor[S];
    for (int j = 0; j < S; j++) {
        factor[j] = 1.0;
        for (int k = 0; k < S; k++)
            if (k != j)
                factor[j] /= S * (sd_energy_c[j] - sd_energy_c[k]);
    }
    memset(energy->ivp.ee, 0, (size_t)energy->ivp.n * sizeof(double));
    for (int j = 0; j < S; j++)
        for (int32_t i = 0; i < energy->ivp.n; i++)
            energy->ivp.ee[i] += energy->ivp.h * factor[j] * energy->stage.rate[j][i];
    return norm(energy, energy->ivp.ee);
}

/* multipliers and implicit efforts of the stages at the side: as those of the step, for Newton to begin with */
static void guess_algebraic(sd_energy *energy)
{
    const sd_underlying *u = energy->underlying;
    for (int32_t l = 0; l < u->solved; l++)
        for (int i = 0; u->rate[l] == 0 && i < S; i++)
            energy->side.y[i][u->unknown[l]] = energy->stage.y[i][u->unknown[l]];
}

/* the error of the step over one shortest period, over what is allowed: the step against two halves of it */
static int halved(sd_energy *energy, double *error)
{
    double h = 0.5 * energy->ivp.h;
    for (int part = 0; part < 2; part++) {
        const double *y = part ? energy->half : energy->phi, *rest = part ? energy->half_rest : energy->rest;
        sd_energy_guess(energy, &energy->stage, 0.5 * part, 0.5, &energy->side);
        guess_algebraic(energy);
        int cause = sd_energy_collocate(energy, &energy->side, energy->ivp.t + part * h, y, rest, h,
                                        part ? energy->inner : energy->half,
                                        part ? energy->inner_d : energy->half_rest);
        if (cause)
            return cause;
    }
    double span = energy->ivp.t_end - energy->ivp.t;
    double period = energy->frequency > 0.0 ? fmin(2.0 * acos(-1.0) / energy->frequency, span) : span;
    for (int32_t i = 0; i < energy->ivp.n; i++)
        energy->ivp.ee[i] = (energy->raw[i] - energy->inner[i]) + (energy->from_rest[i] - energy->inner_d[i]);
    *error = norm(energy, energy->ivp.ee) * fmin(fmax(1.0, period / energy->ivp.h), MOST);
    return isfinite(*error) ? SD_FINE : SD_NONFINITE;
}

/* Whether the step is short enough; if not, or if the first may be longer, another one is taken.  1: it stands */
static int stands(sd_energy *energy)
{
    double rough = roughness(energy), error;
    if (energy->ivp.fixed_h > 0.0 || rough <= MARGIN * energy->rough)
        return 1;
    if (halved(energy, &error)) {
        shrink(energy, 0.5);
        energy->finding = 0; /* a length whose halves cannot be made is not tried again */
        energy->ivp.newton_failures++;
        return 0;
    }
    double factor = SAFETY * pow(fmax(error, 1e-30), -0.5 / S);
    if (energy->finding && error < EASY && energy->wanted < energy->ivp.h_max) {
        double h = energy->ivp.h;
        take_step(energy, energy->wanted * fmin(GROWTH, fmax(factor, 1.2)));
        if (energy->ivp.h > h)
            return 0;
    }
    energy->finding = 0;
    if (error <= 1.0) {
        energy->rough = rough;
        energy->grown = energy->grown != 0;
        return 1;
    }
    shrink(energy, fmax(SD_SHRINK, fmin(factor, 0.9)));
    energy->limited = 0;
    energy->ivp.rejected_steps++;
    return 0;
}

/* the raw step moved onto everything, its slopes, and the new sum of the energy */
static int complete(sd_energy *energy, double t)
{
    int again;
    int cause = sd_energy_symmetric(energy, t, energy->energy - drained(energy), &again);
    if (cause == SD_FINE && again)
        cause = collocate(energy, energy->begin);
    memcpy(energy->inner_d, energy->stage.rate[S - 1], (size_t)energy->ivp.n * sizeof(double));
    if (cause == SD_FINE && again) /* it is moved with slopes of its own, as the start was */
        cause = sd_underlying_slopes(energy->underlying, t, energy->raw, energy->inner_d);
    if (cause)
        return cause;
    double out = drained(energy);
    double start = energy->audit ? energy->moves[2] - energy->moves[3] : 0.0;
    cause = sd_energy_balance(energy, t, energy->raw, energy->inner_d, energy->energy - out - start, energy->moves);
    if (cause == SD_FINE)
        cause = sd_underlying_slopes(energy->underlying, t, energy->raw, energy->inner_d);
    if (cause)
        return cause;
    energy->from_energy = energy->energy;
    if (energy->audit) { /* compensated */
        double move = energy->lost - out - (energy->moves[2] - energy->moves[3]);
        energy->energy = energy->from_energy + move;
        energy->lost = (energy->from_energy - energy->energy) + move;
    }
    return SD_FINE;
}

static void swap(double **a, double **b)
{
    double *c = *a;
    *a = *b;
    *b = c;
}

int sd_energy_step(void *self)
{
    sd_energy *energy = self;
    int failures = 0, cause = SD_FINE;
    double t = energy->ivp.t;
    size_t size = (size_t)energy->ivp.n * sizeof(double);
    sd_weigh(&energy->ivp, energy->ivp.rtol, energy->phi);
    energy->ivp.cause = SD_FINE;
    energy->inner_ready = 0;
    if (energy->ivp.taken == 0 && (energy->ivp.cause = sd_underlying_slopes(energy->underlying, t, energy->phi, energy->yd)))
        return energy->ivp.cause;
    for (;;) {
        fit(energy);
        if (sd_too_small(&energy->ivp))
            return energy->ivp.cause = cause ? cause : SD_STEP;
        t = energy->done + 1 >= energy->count ? energy->ivp.t_end
                                              : energy->anchor + (double)(energy->done + 1) * energy->ivp.h;
        cause = attempt(energy);
        if (cause == SD_FINE && !stands(energy)) {
            energy->guessed = 0;
            t = energy->ivp.t;
            continue;
        }
        if (cause == SD_FINE)
            cause = complete(energy, t);
        if (cause == SD_FINE)
            break;
        t = energy->ivp.t;
        energy->guessed = 0;
        if (sd_ends(&energy->ivp, cause))
            return energy->ivp.cause = cause;
        energy->ivp.newton_failures++;
        energy->finding = 0;
        if (++failures > FAILURES)
            return energy->ivp.cause = cause;
        shrink(energy, 0.5);
        energy->limited = cause == SD_NEWTON;
    }
    /* the rests of raw stand in from_rest */
    swap(&energy->rest, &energy->from_rest);
    memcpy(energy->from, energy->phi, size);
    memcpy(energy->from_d, energy->yd, size);
    memcpy(energy->phi, energy->raw, size);
    memcpy(energy->yd, energy->inner_d, size);
    energy->ivp.h_used = energy->ivp.h;
    energy->from_t = energy->ivp.t;
    energy->ivp.t = t;
    energy->ivp.steps++;
    energy->ivp.taken++;
    energy->done++;
    energy->guessed = 1;
    energy->held = energy->limited && (energy->ivp.t_end - t) / energy->ivp.h > energy->patience ? energy->held + 1 : 0;
    if (energy->held > HELD)
        return energy->ivp.cause = SD_STIFF;
    if (!(energy->ivp.fixed_h > 0.0) && ++energy->since >= energy->window && 2.0 * energy->wanted <= energy->ivp.h_max) {
        energy->before = energy->wanted;
        energy->rough_before = energy->rough;
        take_step(energy, 2.0 * energy->wanted);
        energy->grown = 2;
    }
    return SD_FINE;
}

/* the point at t within the last step by a shorter one; 0 done */
static int within(sd_energy *energy, double t)
{
    double from = energy->from_t, h = t - from;
    sd_energy_guess(energy, &energy->stage, 0.0, h / energy->ivp.h_used, &energy->side);
    guess_algebraic(energy);
    if (sd_energy_collocate(energy, &energy->side, from, energy->from, energy->from_rest, h, energy->inner,
                            energy->half_rest)) {
        guess_start(energy, energy->from, energy->from_d, &energy->side);
        if (sd_energy_collocate(energy, &energy->side, from, energy->from, energy->from_rest, h, energy->inner,
                                energy->half_rest))
            return 1;
    }
    double target = energy->from_energy;
    if (energy->audit)
        target -= sd_energy_drained(energy, &energy->side, from, h);
    memset(energy->inner_moves, 0, (size_t)energy->audited * sizeof(double));
    if (sd_energy_balance(energy, t, energy->inner, energy->side.rate[S - 1], target, energy->inner_moves))
        return 1;
    memcpy(energy->inner_d, energy->side.rate[S - 1], (size_t)energy->ivp.n * sizeof(double));
    return sd_underlying_slopes(energy->underlying, t, energy->inner, energy->inner_d);
}

/* the cubic of both ends: where a shorter step cannot be made */
static void cubic(sd_energy *energy, double t)
{
    double h = energy->ivp.h_used, x = (t - energy->from_t) / h;
    for (int32_t i = 0; i < energy->ivp.n; i++) {
        double a = energy->from[i], b = energy->phi[i], da = h * energy->from_d[i], db = h * energy->yd[i];
        double c2 = 3.0 * (b - a) - 2.0 * da - db, c3 = da + db - 2.0 * (b - a);
        energy->inner[i] = a + x * (da + x * (c2 + x * c3));
        energy->inner_d[i] = (da + x * (2.0 * c2 + x * 3.0 * c3)) / h;
    }
}

void sd_energy_dense(const void *self, double t, double *y, double *yd)
{
    sd_energy *energy = (sd_energy *)self; /* a value within a step is made when it is asked for */
    size_t size = (size_t)energy->ivp.n * sizeof *y;
    if (energy->ivp.taken == 0 || t >= energy->ivp.t) {
        memcpy(y, energy->phi, size);
        memcpy(yd, energy->yd, size);
        return;
    }
    if (!energy->inner_ready || energy->dense_t != t) {
        double frequency = energy->frequency;
        if (within(energy, t))
            cubic(energy, t);
        energy->frequency = frequency;
        energy->dense_t = t;
        energy->inner_ready = 1;
    }
    memcpy(y, energy->inner, size);
    memcpy(yd, energy->inner_d, size);
}
