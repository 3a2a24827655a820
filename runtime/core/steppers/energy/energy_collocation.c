/* The stages of Gauss's method by fixed-point iteration: see energy.h. */
#include "steppers/energy/energy.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define S SD_ENERGY_STAGES
#define SWEEPS 50
#define EXACT 4e-16      /* change of the stages, in magnitudes, behind which there is nothing to gain */
#define CLOSE SD_CANCELS /* with which a sweep that stagnates is content: round-off of the slopes */
#define LAX 1e-2         /* of the tolerance: with which a sweep is content that does not contract at all */
#define STAGNANT 0.5
#define DIVERGED 3       /* sweeps in a row that make it worse */
#define SEEN SD_SAME /* change of a stage, in magnitudes, that tells a frequency from round-off */

void sd_energy_guess(const sd_energy *energy, const sd_collocation *known, double first, double part,
                     sd_collocation *guess)
{
    const sd_underlying *u = energy->underlying;
    const double *c = sd_energy_c;
    double factor[S][S];
    for (int i = 0; i < S; i++)
        for (int j = 0; j < S; j++) {
            factor[i][j] = 1.0;
            for (int k = 0; k < S; k++)
                if (k != j)
                    factor[i][j] *= (first + part * c[i] - c[k]) / (c[j] - c[k]);
        }
    for (int32_t l = 0; l < u->solved; l++) {
        int32_t k = u->unknown[l];
        double *const *value = u->rate[l] ? known->rate : known->y;
        double *const *into = u->rate[l] ? guess->rate : guess->y;
        double old[S];
        for (int j = 0; j < S; j++)
            old[j] = value[j][k];
        for (int i = 0; i < S; i++) {
            double sum = 0.0;
            for (int j = 0; j < S; j++)
                sum += factor[i][j] * old[j];
            into[i][k] = sum;
        }
    }
}

/* points of the stages from their slopes: flows and the rest of the state first, displacements from these flows */
static void place(const sd_energy *energy, sd_collocation *stage, const double *from, const double *rest, double h)
{
    const sd_underlying *u = energy->underlying;
    const sd_system *system = energy->ivp.system;
    for (int32_t l = 0; l < u->solved; l++) {
        int32_t k = u->unknown[l];
        for (int i = 0; u->rate[l] && i < S; i++) {
            double sum = 0.0;
            for (int j = 0; j < S; j++)
                sum += sd_energy_a[i][j] * stage->rate[j][k];
            stage->y[i][k] = from[k] + (rest[k] + h * sum);
        }
    }
    for (int32_t l = 0; l < system->kinematics; l++) {
        int32_t q = system->k_q[l], f = system->k_f[l];
        for (int i = 0; i < S; i++) {
            double sum = 0.0;
            for (int j = 0; j < S; j++)
                sum += sd_energy_a[i][j] * stage->y[j][f];
            stage->y[i][q] = from[q] + (rest[q] + h * sum);
        }
    }
}

/* the state or a slope of it by what moved: 1 where unknown k carries the state */
static int carries(const sd_underlying *u, int32_t k)
{
    return u->column[k] < 0 || u->rate[u->column[k]] != 0;
}

/* New slopes of all stages; the largest change of h times them, in magnitudes, in `change`.  Of the middle stage the
 * change of slopes over that of its point, from sweep to sweep, is a frequency of the system. */
static int sweep(sd_energy *energy, sd_collocation *stage, double t, double h, int first, double *change)
{
    sd_underlying *u = energy->underlying;
    double largest = 0.0, turned = 0.0, moved = 0.0;
    for (int i = 0; i < S; i++) {
        double *y = stage->y[i], *rate = stage->rate[i];
        memcpy(energy->old_rate, rate, (size_t)energy->ivp.n * sizeof *rate);
        int cause = sd_underlying_slopes(u, t + sd_energy_c[i] * h, y, rate);
        if (cause) {
            energy->ivp.bad_row = u->bad_row;
            energy->ivp.bad_column = u->bad_column;
            return cause;
        }
        for (int32_t k = 0; k < energy->ivp.n; k++) {
            if (!carries(u, k))
                continue;
            double turn = (rate[k] - energy->old_rate[k]) / energy->ivp.magnitude[k];
            double size = fabs(h * turn);
            if (!(size <= largest))
                largest = isnan(size) ? INFINITY : size; /* else the next one would be larger */
            if (i == S / 2) {
                double move = (y[k] - energy->old_y[k]) / energy->ivp.magnitude[k];
                turned += turn * turn;
                moved += move * move;
                energy->old_y[k] = y[k];
            }
        }
    }
    if (!first && moved > SEEN * SEEN && isfinite(turned))
        energy->frequency = sqrt(turned / moved);
    *change = largest;
    return isfinite(largest) ? SD_FINE : SD_NONFINITE;
}

/* x1 in `out`, compensated */
static void finish(const sd_energy *energy, const sd_collocation *stage, const double *from, const double *rest, double h,
                   double *out, double *out_rest)
{
    const sd_underlying *u = energy->underlying;
    for (int32_t k = 0; k < energy->ivp.n; k++) {
        if (!carries(u, k)) {
            out[k] = stage->y[S - 1][k];
            out_rest[k] = 0.0;
            continue;
        }
        double sum = 0.0;
        for (int j = 0; j < S; j++)
            sum += sd_energy_b[j] * stage->rate[j][k];
        double move = rest[k] + h * sum;
        double next = from[k] + move;
        out_rest[k] = (from[k] - next) + move;
        out[k] = next;
    }
}

int sd_energy_collocate(sd_energy *energy, sd_collocation *stage, double t, const double *y, const double *rest, double h,
                        double *out, double *out_rest)
{
    double change = INFINITY, before = INFINITY;
    int worse = 0;
    memcpy(energy->old_y, y, (size_t)energy->ivp.n * sizeof *y);
    for (int m = 0; m < SWEEPS; m++) {
        place(energy, stage, y, rest, h);
        int cause = sweep(energy, stage, t, h, m == 0, &change);
        if (cause)
            return cause;
        if (change <= EXACT || (m > 0 && change > STAGNANT * before && change <= CLOSE)) {
            place(energy, stage, y, rest, h);
            finish(energy, stage, y, rest, h, out, out_rest);
            return SD_FINE;
        }
        worse = m > 0 && change > before ? worse + 1 : 0;
        if (worse >= DIVERGED || m == SWEEPS - 1) { /* over a jump of the slopes nothing contracts: the step becomes short */
            if (!(change <= LAX * energy->ivp.rtol))
                return SD_NEWTON;
            finish(energy, stage, y, rest, h, out, out_rest);
            return SD_FINE;
        }
        before = change;
    }
    return SD_NEWTON;
}
