/* Whether a mode is what values say: see fits.h. */
#include "run/events/fits.h"

#include <math.h>

#include "run/events/landing.h"
#include "linear/tuning.h"

#define FULL_SENSE SD_SAME /* of a sense: what it may pass its end by */
#define NO_SIZE SD_SAME /* of its magnitude, an unknown of which round-off leaves nothing open */

/* Whether an inequality, or a friction law, is as the mode says. */
static int contact_fits(const sd_modes *m, const sd_contact *c, int holds, const double *v)
{
    double sense = c->sense >= 0 ? m->p[c->sense] : 1.0, slip = sense * v[c->value];
    if (c->kind == SD_FOLLOWS)
        return 1;
    if (c->kind == SD_GUARDED)
        return (v[c->guard] != 0.0) == holds;
    if (c->kind == SD_FRICTION && v[c->bound] == 0.0)
        return !holds && sense != 0.0;
    if (holds && c->kind == SD_FRICTION)
        return fabs(v[c->multiplier]) <= v[c->bound] + sd_mode_zero(m, c->multiplier);
    if (holds)
        return v[c->multiplier] >= -sd_mode_zero(m, c->multiplier) &&
               (c->kind != SD_PHI || v[c->rate] >= -sd_mode_zero(m, c->rate));
    if (sense == 0.0)
        return 0;
    if (slip > sd_mode_zero(m, c->value))
        return 1;
    if (m->struck >= 0 && c == &m->contact[m->struck])
        return v[c->rate] > sd_mode_zero(m, c->rate);
    return c->kind != SD_PHI && slip >= -sd_mode_zero(m, c->value) && sense * v[c->rate] >= -sd_mode_zero(m, c->rate);
}

static int touched(const sd_modes *m, const sd_mode *from, const sd_transition *one)
{
    for (int32_t k = 0; k < one->crossed; k++)
        for (int32_t i = 0; i < m->contacts; i++) {
            int32_t row = from->row[one->which[k]];
            if (row == m->contact[i].value || row == m->contact[i].multiplier)
                return 1;
        }
    return 0;
}

int sd_mode_decided(const sd_modes *m, const sd_mode *from, const sd_transition *one, const double *v)
{
    if (touched(m, from, one))
        return 1;
    for (int32_t k = 0; k < m->contacts; k++) {
        const sd_contact *c = &m->contact[k];
        int holds = sd_mode_now(m)->holds[k], turned = holds != from->holds[k] && (c->kind == SD_PHI || c->kind == SD_PSI);
        if (turned && holds && !(v[c->multiplier] > sd_mode_zero(m, c->multiplier)))
            return 0;
        if (turned && !holds && !(v[c->value] > sd_mode_zero(m, c->value)) && !(v[c->rate] > sd_mode_zero(m, c->rate)))
            return 0;
    }
    return 1;
}

/* Whether the branch of a law is what its switching function says. */
static int kink_fits(const sd_modes *m, const sd_kink *k, const double *v)
{
    double branch = m->p[k->branch], small = sd_mode_zero(m, k->value);
    if (branch == 0.0)
        return fabs(v[k->value]) <= small;
    if (branch == SD_BRANCH_SLIDES)
        return v[k->above] >= -FULL_SENSE && v[k->below] >= -FULL_SENSE;
    if (branch == SD_BRANCH_RESTS)
        return fabs(v[k->value]) <= small && (k->rate < 0 || fabs(v[k->rate]) <= sd_mode_zero(m, k->rate));
    if (branch * v[k->value] > small)
        return 1;
    if (k->jumps && branch == m->p_before[k->branch]) /* it has not crossed zero, and is there */
        return 0;
    return branch * v[k->value] >= -small && (k->rate < 0 || branch * v[k->rate] >= -sd_mode_zero(m, k->rate));
}

/* Whether a relation is on the side that the mode says; flipped: where it was; small: what is zero of it. */
static int relation_fits(const sd_modes *m, int32_t k, double side, double flipped, double value, double small)
{
    if (fabs(value) <= small && (value != 0.0 || m->exact[k]))
        return side == flipped;
    return side == (double)((value > 0.0) - (value < 0.0));
}

int sd_mode_sides_fit(const sd_modes *m, const double *side, const double *before, const double *v)
{
    for (int32_t k = 0; k < m->relations; k++) {
        const int32_t row = m->relation_row[k];
        if (!relation_fits(m, k, side[k], before[k], v[row], m->relation_moves[k] ? sd_mode_zero(m, row) : 0.0))
            return 0;
    }
    return 1;
}

int sd_mode_assigned_fit(const sd_modes *m, const double *side, const double *before, const double *was, const double *v,
                         const double *terms)
{
    for (int32_t k = 0; k < m->relations; k++) {
        const int32_t row = m->relation_row[k];
        double small = m->relation_moves[k] ? sd_mode_zero(m, row) : 0.0;
        const double rounding = ROUNDING * fmax(fabs(terms[row]), fabs(v[row]));
        if (fabs(v[row] - was[k]) > rounding) {
            if (fabs(v[row]) > rounding && fabs(v[row]) <= small) /* due again at once: the handler's */
                return 0;
            small = fmin(small, rounding);
        }
        if (!relation_fits(m, k, side[k], before[k], v[row], small))
            return 0;
    }
    return 1;
}

int sd_mode_returns(const sd_modes *m, const sd_mode *from, const sd_transition *one, const double *v)
{
    const double *side = sd_mode_now(m)->relation;
    for (int32_t k = 0; k < m->relations; k++) {
        const int32_t row = m->relation_row[k];
        int crosses = !m->relation_moves[k] || fabs(v[row]) > sd_mode_zero(m, row);
        for (int32_t i = 0; i < one->crossed && !crosses; i++)
            crosses = from->row[one->which[i]] == row;
        if (!crosses && side[k] * v[row] < -ROUNDING * m->largest[row])
            return 1;
    }
    return 0;
}

int sd_mode_fits(const sd_modes *m, const double *before, const double *v)
{
    const sd_mode *mode = sd_mode_now(m);
    for (int32_t k = 0; k < m->contacts; k++)
        if (!contact_fits(m, &m->contact[k], mode->holds[k], v))
            return 0;
    for (int32_t k = 0; k < m->kinks; k++)
        if (!kink_fits(m, &m->kink[k], v))
            return 0;
    return sd_mode_sides_fit(m, mode->relation, before, v);
}

int sd_mode_sized(const sd_modes *m)
{
    return !sd_landing_shows(m->unknowns, m->unnamed, m->met, m->magnitude, m->rate, m->round_off, m->unknown_size);
}

int sd_mode_ordinary(const sd_modes *m)
{
    for (int32_t i = 0; i < m->unknowns; i++)
        if (fabs(m->restart[i]) > 2.0 * fmax(m->resolved[i], NO_SIZE * m->magnitude[i]))
            return 0;
    return sd_mode_sized(m);
}
