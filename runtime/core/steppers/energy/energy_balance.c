/* The energy of a point, and the move that gives it the energy it should have: see energy.h. */
#include "steppers/energy/energy.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define MOVES 6
#define FINE 4e-15       /* what a step misses, in magnitudes, that is round-off of its stages */
#define ROUND_OFF 1.0    /* of the content, in DBL_EPSILON: nothing is closer */
#define TRIAL SD_UNSEEN /* part of the direction by which the slope of the energy is felt */
#define FAR 0.1          /* of the direction: so large a move is no correction (a system at rest has no energy to move) */

double sd_energy_content(sd_energy *energy, double t, const double *y, const double *rate)
{
    memset(energy->sample, 0, (size_t)energy->audited * sizeof(double));
    energy->audit->rows(&energy->audit->frame, t, y, rate, energy->sample);
    double size = fabs(energy->sample[0]) + fabs(energy->sample[1]);
    if (size > energy->content)
        energy->content = size;
    return energy->sample[0] + energy->sample[1];
}

double sd_energy_drained(sd_energy *energy, const sd_collocation *stage, double t, double h)
{
    double sum = 0.0;
    for (int i = 0; i < SD_ENERGY_STAGES; i++) {
        memset(energy->sample, 0, (size_t)energy->audited * sizeof(double));
        energy->audit->rows(&energy->audit->frame, t + sd_energy_c[i] * h, stage->y[i], stage->rate[i], energy->sample);
        sum += sd_energy_b[i] * (energy->sample[2] - energy->sample[3]);
    }
    return h * sum;
}

/* y := from + part * (-tau^2 f', f, p): along the gradient of the energy; tau the step, which is about one over the
 * frequency, and the same everywhere */
static void along(const sd_energy *energy, const double *from, const double *rate, double part, double *y)
{
    const sd_underlying *u = energy->underlying;
    const sd_system *system = energy->ivp.system;
    double tau = energy->ivp.h;
    memcpy(y, from, (size_t)energy->ivp.n * sizeof *y);
    for (int32_t l = 0; l < u->solved; l++)
        if (u->rate[l] == 2)
            y[u->unknown[l]] += part * from[u->unknown[l]];
    for (int32_t l = 0; l < system->kinematics; l++)
        y[system->k_q[l]] -= part * tau * tau * rate[system->k_f[l]];
}

/* energy->work := what the rows of block audit give for the move of displacements from base to y, their powers for flows as
 * large as the moves */
static void work(sd_energy *energy, double t, const double *base, const double *y, const double *rate)
{
    const sd_system *system = energy->ivp.system;
    double *point = energy->old_y;
    memcpy(point, base, (size_t)energy->ivp.n * sizeof *point);
    memset(energy->work, 0, (size_t)energy->audited * sizeof(double));
    for (int side = 1; side >= 0; side--) {
        for (int32_t l = 0; l < system->kinematics; l++)
            point[system->k_f[l]] = side ? y[system->k_q[l]] - base[system->k_q[l]] : 0.0;
        memset(energy->sample, 0, (size_t)energy->audited * sizeof(double));
        energy->audit->rows(&energy->audit->frame, t, point, rate, energy->sample);
        for (int32_t k = 2; k < energy->audited; k++)
            energy->work[k] += side ? energy->sample[k] : -energy->sample[k];
    }
}

/* what T + V is off at y, which was moved there from the base */
static double off(sd_energy *energy, double t, const double *y, const double *rate, double target)
{
    work(energy, t, energy->base, y, rate);
    return sd_energy_content(energy, t, y, rate) + (energy->work[2] - energy->work[3]) - target;
}

/* trial := y moved by `part`, on the constraints; what its energy is off, in `miss` */
static int moved(sd_energy *energy, double t, const double *y, const double *rate, double part, double target,
                 double *miss)
{
    along(energy, y, rate, part, energy->trial);
    int cause = sd_underlying_project(energy->underlying, t, energy->trial, rate);
    if (cause == SD_FINE)
        *miss = off(energy, t, energy->trial, rate, target);
    return cause;
}

int sd_energy_symmetric(sd_energy *energy, double t, double target, int *again)
{
    sd_underlying *u = energy->underlying;
    double *start = energy->begin, miss = 0.0, size = 0.0;
    *again = 0;
    memset(energy->moves, 0, (size_t)energy->audited * sizeof(double));
    memcpy(start, energy->raw, (size_t)energy->ivp.n * sizeof *start);
    int cause = sd_underlying_project(u, t, start, energy->stage.rate[SD_ENERGY_STAGES - 1]);
    if (cause)
        return cause;
    for (int32_t k = 0; k < energy->ivp.n; k++)
        size = fmax(size, fabs(start[k] - energy->raw[k]) / energy->ivp.magnitude[k]);
    if (energy->audit)
        miss = sd_energy_content(energy, t, energy->raw, energy->stage.rate[SD_ENERGY_STAGES - 1]) - target;
    if (size <= FINE && fabs(miss) <= FINE * energy->content)
        return SD_FINE;
    sd_underlying_constraints(u, t, energy->raw, energy->position, energy->velocity);
    for (int32_t i = 0; i < energy->ivp.system->rows; i++) { /* the end is off by the start's, carried along, and by its own */
        double rate = -0.5 * energy->velocity[i];
        energy->position[i] = u->displaced[i] ? -0.5 * (energy->position[i] + energy->ivp.h * rate) : 0.0;
        energy->velocity[i] = rate;
    }
    memcpy(start, energy->phi, (size_t)energy->ivp.n * sizeof *start);
    memcpy(energy->inner_d, energy->yd, (size_t)energy->ivp.n * sizeof *start);
    if ((cause = sd_underlying_slopes(u, energy->ivp.t, start, energy->inner_d)))
        return cause;
    u->goal_position = energy->position;
    u->goal_velocity = energy->velocity;
    cause = sd_energy_balance(energy, energy->ivp.t, start, energy->inner_d, energy->energy - 0.5 * miss, energy->moves);
    u->goal_position = u->goal_velocity = NULL;
    *again = cause == SD_FINE;
    return cause;
}

/* y moved along the direction of the energy until nothing is off */
static int balance(sd_energy *energy, double t, double *y, const double *rate, double target)
{
    int cause;
    double miss = off(energy, t, y, rate, target), now, enough = ROUND_OFF * DBL_EPSILON * energy->content;
    if (fabs(miss) <= enough)
        return SD_FINE;
    if ((cause = moved(energy, t, y, rate, TRIAL, target, &now)))
        return cause;
    double slope = (now - miss) / TRIAL;
    for (int m = 0; m < MOVES && fabs(miss) > enough; m++) {
        double part = -miss / slope;
        if (!(fabs(part) <= FAR))
            return SD_FINE;
        if ((cause = moved(energy, t, y, rate, part, target, &now)))
            return cause;
        if (!(fabs(now) < fabs(miss)))
            return SD_FINE;
        memcpy(y, energy->trial, (size_t)energy->ivp.n * sizeof *y);
        miss = now;
    }
    return SD_FINE;
}

int sd_energy_balance(sd_energy *energy, double t, double *y, const double *rate, double target, double *gained)
{
    memcpy(energy->base, y, (size_t)energy->ivp.n * sizeof *y);
    int cause = sd_underlying_project(energy->underlying, t, y, rate);
    if (cause || !energy->audit)
        return cause;
    double drift = energy->underlying->drift;
    cause = balance(energy, t, y, rate, target);
    energy->underlying->drift = drift;
    work(energy, t, energy->base, y, rate);
    for (int32_t k = 2; k < energy->audited; k++)
        gained[k] += energy->work[k];
    return cause;
}
