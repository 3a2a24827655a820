/* One impact: see strike.h.
 *
 * What holds between flows and their momenta is met behind it, balances are integrated over it (runtime/start/instant.py):
 *     M (f+ - f-) + dF/dkappa Lambda = 0,   Phi_q f+ + Phi_t = 0,   value' = -restitution value' of before.
 */
#include "run/events/strike.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "linear/linear.h"
#include "run/events/fits.h"
#include "run/events/landing.h"
#include "linear/tuning.h"

#define ITERATIONS_OF_STRIKE 3
#define UNSEEN_FLIGHT (16.0 * DBL_EPSILON) /* of the terms of a gap: a flight lower than that */
#define REGULAR SD_DEPENDENT /* of its column: a pivot */
#define STAYS SD_BY_SUMS /* of its magnitude, what an unknown is moved by that stays where it is */

/* The flow with which the gap opens again, 0 where it closes no more, or what it reaches is at its zero too. */
static double thrown_back(const sd_run *run, const sd_strike *strike)
{
    const sd_modes *m = run->modes;
    const sd_contact *c = &m->contact[strike->contact];
    const double *v = m->values;
    double speed = v[c->rate], back = -strike->restitution * speed, *fastest = &m->fastest[strike->contact];
    for (int32_t k = 0; k < strike->besides; k++) {
        int32_t row = m->contact[strike->beside[k]].value;
        if (v[row] <= sd_mode_zero(m, row))
            return 0.0;
    }
    for (int32_t k = 0; k < m->relations; k++)
        if (m->relation_moves[k] && fabs(v[m->relation_row[k]]) <= sd_mode_zero(m, m->relation_row[k]))
            return 0.0;
    if (!(speed < -sd_mode_zero(m, c->rate)))
        return 0.0;
    *fastest = fmax(*fastest, -speed);
    int risen = back * back > -2.0 * v[c->acceleration] * UNSEEN_FLIGHT * m->high[c->value];
    return risen && back > fmax(m->rest * *fastest, sd_mode_zero(m, c->rate)) ? back : 0.0;
}

/* The matrix of the rows at m->y, x := what they are off by; aim: of the flow of the gap. */
static void lay_out(sd_run *run, const sd_strike *strike, double t, double aim)
{
    sd_modes *m = run->modes;
    const double *slope[2] = {strike->jy, strike->jyd};
    sd_jacobian(strike->system, t, m->y, m->yd, NULL, strike->jy, strike->jyd);
    sd_residual(strike->system, t, m->y, m->yd, strike->r);
    for (int32_t i = 0; i < strike->n; i++) {
        double asked = strike->of_row[i] == strike->row ? -aim : 0.0;
        strike->x[i] = strike->integral[i] ? 0.0 : asked - strike->r[strike->of_row[i]];
    }
    for (int32_t j = 0; j < strike->n; j++) {
        int32_t unknown = strike->unknown[j];
        double most = 0.0, gone = j < strike->moves ? m->y[unknown] - m->restart[unknown] : strike->impulse[j];
        for (int32_t k = strike->column[j]; k < strike->column[j + 1]; k++) {
            double value = slope[strike->rated[k]][strike->slot[k]];
            strike->value[k] = value;
            most = fmax(most, fabs(value));
            if (strike->integral[strike->row_of[k]])
                strike->x[strike->row_of[k]] -= value * gone;
        }
        strike->scale[j] = j < strike->moves ? run->settle->scale[unknown] : most > 0.0 ? 1.0 / most : 1.0;
    }
}

/* The flows and momenta behind the impulses, as far as they move. */
static int moved(sd_run *run, const sd_strike *strike, double t, double aim)
{
    sd_modes *m = run->modes;
    memset(strike->impulse, 0, (size_t)strike->n * sizeof(double));
    memcpy(m->restart, m->y, (size_t)run->written * sizeof(double));
    for (int i = 0; i < ITERATIONS_OF_STRIKE; i++) {
        lay_out(run, strike, t, aim);
        if (!sd_finite(strike->column[strike->n], strike->value) || !sd_finite(strike->n, strike->x) ||
            sd_linear_factor(strike->linear, strike->value, strike->scale) || !(strike->linear->smallest > REGULAR))
            return 0;
        sd_linear_solve(strike->linear, strike->x);
        for (int32_t j = 0; j < strike->n; j++)
            if (j < strike->moves)
                m->y[strike->unknown[j]] += strike->x[j];
            else
                strike->impulse[j] += strike->x[j];
    }
    for (int32_t j = 0; j < strike->moves; j++) {
        int32_t k = strike->unknown[j];
        if (fabs(m->y[k] - m->restart[k]) <= STAYS * run->settle->scale[k])
            m->y[k] = m->restart[k];
    }
    return strike->own < 0 || strike->impulse[strike->own] > 0.0;
}

int sd_strike_momenta(sd_run *run, const sd_strike *momenta, double t)
{
    return moved(run, momenta, t, 0.0);
}

int sd_strike_gap(sd_run *run, const sd_strike *strike, double t)
{
    sd_modes *m = run->modes;
    sd_system *system = strike->system, before = *system;
    const sd_contact *c = &m->contact[strike->contact];
    double back = thrown_back(run, strike);
    if (back == 0.0)
        return 0;
    system->held = strike->held.held;
    system->clear = strike->held.clear;
    system->held_row = strike->held.row;
    system->held_unknown = strike->held.unknown;
    system->held_slot = strike->held.slot;
    system->held_rate = strike->held.rate;
    system->cleared = strike->held.cleared;
    int done = moved(run, strike, t, back);
    system->held = before.held;
    system->clear = before.clear;
    system->held_row = before.held_row;
    system->held_unknown = before.held_unknown;
    system->held_slot = before.held_slot;
    system->held_rate = before.held_rate;
    system->cleared = before.cleared;
    if (!done)
        return 0;
    sd_landing_look(run, t, m->y, m->yd, m->values);
    return fabs(m->values[c->rate] - back) <= sd_mode_zero(m, c->rate);
}

/* What holds flies no more. */
static void land(sd_modes *m)
{
    for (int32_t k = 0; k < m->contacts; k++)
        if (m->contact[k].kind == SD_PHI && sd_mode_now(m)->holds[k])
            m->thrown[m->contact[k].value] = 0;
}

int sd_strike_throws(sd_run *run, const sd_strike *strike, double t)
{
    sd_modes *m = run->modes;
    if (!strike) {
        land(m);
        return 1;
    }
    const sd_contact *c = &m->contact[strike->contact];
    double speed = m->values[c->rate], pull = -m->values[c->acceleration];
    int back = speed > 0.0 && pull > 0.0;
    double height = back ? 0.5 * speed * speed / pull : INFINITY;
    if (height < m->faint * m->largest[c->value])
        return 0;
    land(m);
    m->thrown[c->value] = 1;
    m->level[c->value] = fmin(m->values[c->value], 0.0);
    m->height[c->value] = height;
    m->begins[c->value] = t;
    m->flight[c->value] = back ? 2.0 * speed / pull : INFINITY;
    return 1;
}
