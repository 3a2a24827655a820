/* The loop over runs: see many.h. */
#define _POSIX_C_SOURCE 199309L
#include "run/many/many.h"

#include <float.h>
#include <math.h>
#include <string.h>
#include <time.h>

#include "run/many/many_compare.h"
#include "run/many/many_start.h"
#include "linear/tuning.h"

#define SAME SD_CANCELS /* of an instant: a claim's */

static double cpu_now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* --- one integration ------------------------------------------------------------------------------------------- */

static void clear_ledgers(sd_ledgers *ledgers)
{
    size_t count = (size_t)ledgers->count * sizeof(double), elements = (size_t)ledgers->elements * sizeof(double);
    double *of_count[] = {ledgers->gross,   ledgers->largest,    ledgers->stored,  ledgers->balance,
                          ledgers->highest, ledgers->dissipated, ledgers->supplied};
    double *of_element[] = {ledgers->most, ledgers->value, ledgers->before};
    for (int k = 0; k < 7; k++)
        memset(of_count[k], 0, count);
    for (int k = 0; k < 3; k++)
        memset(of_element[k], 0, elements);
    for (int32_t k = 0; k < ledgers->count; k++)
        ledgers->element[k] = -1;
    for (int32_t i = 0; i < ledgers->elements; i++)
        ledgers->inertia[i] = ledgers->inertia[i] == SD_POSITIVE ? SD_INERTIA : ledgers->inertia[i];
    ledgers->records = 0;
    ledgers->begun = 0;
    ledgers->lost = -1;
}

/* every structure as it was set up, the start of this run in it; last: instants of the run before (NULL: as set up);
 * opening: its first step, as an earlier run found it (0: chosen) */
static void prepare(sd_many *many, sd_pass *pass, double tolerance, double longest, const sd_samples *last, double opening)
{
    sd_run *run = pass->run;
    const double *y = many->passes[0].y, *yd = many->passes[0].start_rate;
    sd_many_restore(pass->region, pass->regions);
    if (run->ledgers)
        clear_ledgers(run->ledgers);
    memset(run->largest, 0, (size_t)many->observed * sizeof(double));
    if (pass != many->passes) {
        memcpy(pass->y, y, (size_t)pass->n * sizeof *y);
        memcpy(pass->start_rate, yd, (size_t)pass->n * sizeof *yd);
    }
    memset(pass->yd, 0, (size_t)pass->n * sizeof *yd);
    for (int32_t i = 0; i < pass->n; i++)
        if (pass->differential[i])
            pass->yd[i] = yd[i];
    for (int32_t i = 0; i < pass->n; i++)
        pass->magnitude[i] = fmax(fmin(many->found[i], many->ceiling[i]), pass->least[i]);
    sd_many_scale(run->settle, pass->magnitude, many->tau);
    if (pass->project)
        sd_many_scale(pass->project, pass->magnitude, many->tau);
    memset(pass->met, 0, (size_t)pass->n * sizeof(double));
    *pass->rtol = tolerance;
    *pass->h_max = longest;
    if (pass->opening)
        *pass->opening = opening;
    if (last) {
        run->instant = last->time;
        run->instant_kind = many->kind;
        run->instants = last->number;
    }
    run->stepper->start(run->stepper->self, many->t0, pass->y, pass->yd, 0.0);
}

static void put(const sd_many *many, sd_samples *samples, int32_t at, const double *row)
{
    double *value = samples->value + (size_t)at * many->columns, *late = samples->late + (size_t)at * many->columns;
    samples->time[at] = row[0];
    for (int32_t q = 0; q < many->columns; q++) {
        value[q] = row[SD_ROW_HEAD + many->column[q]];
        late[q] = many->late * fabs(row[SD_ROW_HEAD + many->observed + many->column[q]]);
        late[q] = isnan(late[q]) ? 0.0 : late[q];
    }
}

/* every stride-th row of the trace, the last one behind them (accuracy/common_instants.py) */
static void thin(sd_many *many, sd_samples *own, const double *row)
{
    int32_t kept = many->stride * own->number; /* the row that is kept next */
    many->last_time = row[0];
    put(many, own, own->number, row);
    if (many->seen++ != kept)
        return;
    if (++own->number <= 2 * many->rules.instants)
        return;
    for (int32_t k = 0; 2 * k < own->number; k++) {
        own->time[k] = own->time[2 * k];
        size_t bytes = (size_t)many->columns * sizeof(double);
        memmove(own->value + (size_t)k * many->columns, own->value + (size_t)2 * k * many->columns, bytes);
        memmove(own->late + (size_t)k * many->columns, own->late + (size_t)2 * k * many->columns, bytes);
    }
    own->number = (own->number + 1) / 2;
    many->stride *= 2;
}

static int holds(int32_t op, double left, double right, double within)
{
    switch (op) {
    case 0:
        return fabs(left - right) <= within;
    case 1:
        return fabs(left - right) > within;
    case 2:
    case 3:
        return op == 3 || within != 0.0 ? left <= right + within : left < right;
    default:
        return op == 5 || within != 0.0 ? left >= right - within : left > right;
    }
}

static void claim(sd_many *many, const double *row, int last)
{
    for (int32_t k = 0; k < many->claims; k++) {
        const sd_claim *c = &many->claim[k];
        int here = c->moment == 2 && fabs(row[0] - c->at) <= SAME * fabs(c->at);
        if (last ? c->moment != 1 : c->moment == 1 || (c->moment == 2 && !here))
            continue;
        const double *value = row + SD_ROW_HEAD;
        if (!holds(c->op, value[c->left], value[c->right], c->within < 0 ? 0.0 : value[c->within]))
            many->broken = 1;
        many->judged += c->moment > 0;
    }
}

/* rows of the integration so far: what the comparison, the claims and the results want of them */
static void take(sd_many *many, sd_run *run, sd_samples *own, sd_samples *there)
{
    for (int32_t k = 0; k < run->rows; k++) {
        const double *row = run->row + (size_t)k * (size_t)(SD_ROW_HEAD + 2 * many->observed);
        int32_t kind = (int32_t)row[1];
        if ((kind & SD_COMPARED) && there->number < there->room)
            put(many, there, there->number++, row);
        if (kind & (SD_TRACE | SD_SAMPLE))
            claim(many, row, 0);
        if (!(kind & SD_TRACE))
            continue;
        if (!many->known)
            thin(many, own, row);
        int32_t number = many->rows++, due = many->thinned < many->thins && many->thin[many->thinned] == number;
        for (int32_t q = 0; q < many->columns; q++) {
            double v = row[SD_ROW_HEAD + many->column[q]];
            many->end[q] = v;
            if (number == 0 || v < many->least[q])
                many->least[q] = v;
            if (number == 0 || v > many->most[q])
                many->most[q] = v;
            if (due)
                many->thick[q * many->thins + many->thinned] = v;
        }
        many->thinned += due;
    }
    many->held = run->rows;
    if (run->stepper->ivp->t >= run->stepper->ivp->t_end && run->rows)
        claim(many, run->row + (size_t)(run->rows - 1) * (size_t)(SD_ROW_HEAD + 2 * many->observed), 1);
    run->rows = 0;
}

static void count(sd_many *many, const sd_pass *pass, int64_t sign)
{
    for (int k = 0; k < SD_MANY_COUNTERS; k++)
        many->counted[k] += pass->counter[k] ? sign * *pass->counter[k] : 0;
}

/* from the start to the end; own: its samples, there: those at instants of the last run */
static int integrate(sd_many *many, sd_pass *pass, sd_samples *own, sd_samples *there, int64_t *steps)
{
    sd_run *run = pass->run;
    int64_t left = many->max_steps;
    count(many, pass, -1);
    own->number = there->number = 0;
    many->stride = 1;
    many->seen = many->rows = many->thinned = many->broken = many->judged = 0;
    if (run->extrema)
        sd_extrema_begin(run->extrema);
    for (;;) {
        int64_t before = run->stepper->ivp->taken;
        double from = cpu_now();
        int state = sd_run_advance(run, left, 1e9);
        many->spent += cpu_now() - from;
        *steps += run->stepper->ivp->taken - before;
        left -= run->stepper->ivp->taken - before;
        take(many, run, own, there);
        if (state == SD_FINISHED)
            break;
        if (state != SD_FULL || left <= 0 || many->keep == SD_MANY_ROWS)
            return SD_MANY_FAILED;
    }
    count(many, pass, 1);
    if (sd_confirmed(many->sizing, many->system, many->t1 - many->t0, pass->met, pass->magnitude, many->ceiling))
        return SD_MANY_FAILED;
    sd_ceiling(many->sizing, many->system->scales > 0, pass->met, many->ceiling);
    for (int32_t q = 0; q < many->columns && run->extrema; q++) {
        many->least[q] = fmin(many->least[q], run->extrema->least[many->column[q]]);
        many->most[q] = fmax(many->most[q], run->extrema->most[many->column[q]]);
    }
    if (!many->known && own->number && own->time[own->number - 1] < many->last_time)
        own->number++; /* the last row stands behind the others already */
    return run->beyond > many->rules.beyond ? SD_MANY_ACCURACY : SD_MANY_DONE; /* a step passed over something */
}

/* --- the accuracy ---------------------------------------------------------------------------------------------- */

/* of tolerances a power of ten^step apart; longer: the steps of the finer run over those of the coarser one */
static double shrink(const sd_many *many, double power, double step, double longer)
{
    double ratio = fmax(pow(10.0, -power * step), pow(many->far, power));
    if (many->fall > 0.0)
        ratio = fmax(ratio, fmin(pow(fmax(longer, 1.0), -many->fall), many->rules.unseen));
    return many->rules.safety * ratio / (1.0 - ratio);
}

/* 1: every ledger balances */
static int balanced(const sd_many *many, const sd_ledgers *ledgers)
{
    for (int32_t k = 0; ledgers && k < ledgers->count; k++) {
        double turnover = ledgers->gross[k];
        for (int32_t i = 0; i < ledgers->elements; i++)
            turnover += ledgers->of[i] == k ? ledgers->most[i] : 0.0;
        if (!(ledgers->highest[k] <= many->energy * turnover))
            return 0;
    }
    return 1;
}

/* tolerance behind a draft of so many steps */
static double behind(const sd_many *many, int64_t steps)
{
    double much = fmin(fmax((double)steps, many->few_steps), many->many_steps) / many->few_steps;
    double draft = many->tolerance[0];
    double fit = many->tolerance[1] * pow(much, -many->growth / many->power);
    return fmax(fmax(fmin(fit, many->ratio * draft), many->far * draft), many->finest);
}

/* the first step that the last run of a pass found fit */
static double opening(const sd_pass *pass)
{
    return pass->opening ? *pass->opening : 0.0;
}

/* kinds of the rows of the next run: those of the last one, whose end is all that is asked for where it is `lean` */
static void ask(sd_many *many, const sd_samples *last, int lean)
{
    for (int32_t k = 0; !many->known && k < last->number; k++)
        many->kind[k] = SD_COMPARED | (lean && k == last->number - 1 ? SD_TRACE : 0);
}

/* what runs have differed by: over, at tolerances a power of ten^step apart; before, step_before: the pair before, -1: none;
 * power: of the tolerance by which differences fell, -1: not known yet */
typedef struct fall {
    double over, step, before, step_before, power;
} fall;

/* the part of a difference that is the later run's error, `taken` steps long, the other one `before` */
static double part_of(const sd_many *many, fall *f, int64_t taken, int64_t before)
{
    if (f->before >= 0.0 && f->over > f->before)
        return 1.0;
    double credit = taken >= many->rules.few ? many->credit : fmin(many->credit, many->rules.short_credit);
    if (f->before >= 0.0 && f->over > 0.0 && isfinite(f->before))
        f->power = fmax(0.3, fmin(1.0, log10(f->before / f->over) / f->step_before));
    double longer = (double)taken / (double)(before > 0 ? before : 1);
    return shrink(many, f->power < 0.0 ? credit : fmin(f->power, credit), f->step, longer);
}

/* the tolerance behind one whose error was so many times what is aimed at; away: the runs have parted */
static double behind_pair(const sd_many *many, double tolerance, double error, double power, int away)
{
    double drop = pow(1.0 / fmax(error, 1e-300), 1.0 / (power < 0.0 ? many->power : fmax(power, many->rules.slowest)));
    double least = power < 0.0 ? many->rules.first_drop : 1e-3, most = power < 0.0 ? many->little : many->rules.left;
    double next = fmax(fmax(least, fmin(drop, most)) * tolerance, many->finest);
    return away ? fmin(next, many->rules.tame) : next;
}

/* what a run says that is as accurate as asked: whether its ledgers balance and its claims hold */
static int verdict(const sd_many *many)
{
    int32_t at = 0;
    if (!balanced(many, many->passes[1].run->ledgers))
        return SD_MANY_ENERGY;
    for (int32_t k = 0; k < many->claims; k++)
        at += many->claim[k].moment > 0;
    return many->broken || many->judged < at ? SD_MANY_CLAIM : SD_MANY_DONE;
}

/* runs until the last one's estimated error is what was asked: `control` of accuracy/control.py */
static int control(sd_many *many, int64_t *steps, double *estimate)
{
    sd_samples *last = &many->sample[0], *own = &many->sample[1], *there = &many->sample[2];
    double tolerance = many->tolerance[0], next, longest = many->passes[1].longest, opened;
    fall f = {.before = -1.0, .power = -1.0};
    int64_t taken = 0, taken_before;
    /* of a run that is the last one, nobody asks for rows at its own steps */
    int lean = many->keep == 0 && !many->claims && !many->known;
    /* the draft */
    for (int32_t i = 0; i < many->passes[0].n; i++)
        many->ceiling[i] = INFINITY;
    prepare(many, &many->passes[0], tolerance, many->passes[0].longest, NULL, 0.0);
    int state = integrate(many, &many->passes[0], last, there, &taken);
    *steps += taken;
    next = behind(many, taken);
    opened = opening(&many->passes[0]);
    int lost = state == SD_MANY_ACCURACY; /* its rows say nothing: the next run is compared with nothing */
    state = lost ? SD_MANY_DONE : state;
    if (many->known)
        last = there, there = &many->sample[0];
    for (int number = 2; state == SD_MANY_DONE && number <= many->rules.runs; number++) {
        taken_before = taken;
        taken = 0;
        /* a finer run */
        ask(many, last, lean);
        prepare(many, &many->passes[1], next, longest, many->known ? NULL : last, opened);
        many->passes[1].run->every_step = many->passes[1].run->every_step && !lean;
        many->passes[1].run->sizes_at_steps = !lean;
        state = integrate(many, &many->passes[1], own, there, &taken);
        *steps += taken;
        int lost_now = state == SD_MANY_ACCURACY;
        if (state && !lost_now)
            return state;
        state = SD_MANY_DONE;
        /* what it differs by from the last one */
        if (many->known)
            sd_many_match(many, there, last);
        double apart = sd_many_difference(many, &many->passes[1], last, there, &f.over);
        if (lost || lost_now)
            apart = f.over = INFINITY;
        f.step = log10(tolerance / next);
        if (taken == taken_before && apart < SD_MANY_ROUND_OFF)
            return SD_MANY_ACCURACY; /* two runs that took the same steps say nothing */
        double part = part_of(many, &f, taken, taken_before);
        *estimate = apart * part;
        int away = next > many->rules.loose && sd_many_parted(many, &many->passes[1], last, there);
        if (f.over * part <= 1.0 && !away)
            return verdict(many);
        if (next <= 1.01 * many->finest)
            break;
        if (lean) { /* once more, with the rows that the next one is compared at */
            lean = 0;
            number--;
            taken = taken_before;
            continue;
        }
        /* it is what the next one is compared with */
        lost = lost_now;
        f.before = f.over;
        f.step_before = f.step;
        tolerance = next;
        opened = opening(&many->passes[1]);
        next = behind_pair(many, next, many->rules.aim * f.over * part, f.power, away);
        longest /= many->rules.stretch;
        sd_samples **found = many->known ? &there : &own, *swap = last;
        last = *found;
        *found = swap;
    }
    return state ? state : SD_MANY_ACCURACY;
}

void sd_many_runs(sd_many *many, int32_t runs, const double *p, const double *anchor, int32_t *state, int64_t *steps,
                  double *estimate, double *cpu, double *end, double *least, double *most, double *thick)
{
    size_t columns = (size_t)many->columns;
    double from = cpu_now();
    for (int32_t k = 0; k < runs; k++) {
        many->end = end + k * columns;
        many->least = least + k * columns;
        many->most = most + k * columns;
        many->thick = thick + k * columns * (size_t)many->thins;
        many->held = 0;
        many->spent = 0.0;
        memset(many->counted, 0, sizeof many->counted);
        memcpy(many->p, p + (size_t)k * many->parameters, (size_t)many->parameters * sizeof *p);
        steps[k] = 0;
        estimate[k] = NAN;
        state[k] = sd_many_begin(many, anchor + (size_t)k * many->written);
        if (state[k] == SD_MANY_DONE)
            state[k] = control(many, &steps[k], &estimate[k]);
        double to = cpu_now();
        cpu[k] = to - from;
        from = to;
    }
}
