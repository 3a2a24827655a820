/* What all methods have in common: see stepper.h. */
#include "steppers/stepper.h"

#include <math.h>

#define INSTANT 1e-10 /* of a step: within it no mode grows */
#define INSTANT_ABOVE 1e-5 /* the same where the index is above 1: in less, round-off of what cancels tells the sign, which
                            * is asked for behind restarts alone */
#define FEW 100.0 /* steps whose lengths, each rounded, still add up to the span */

void sd_stepper_start(sd_stepper *stepper, double t, const double *y, const double *yd)
{
    stepper->start(stepper->self, t, y, yd, 0.0);
}

void sd_begin(sd_ivp *ivp, double t)
{
    ivp->t = t;
    ivp->h_used = 0.0;
    ivp->taken = 0;
    ivp->outgrown = ivp->resting = 0;
    ivp->tested = 0;
    for (int32_t i = 0; i < ivp->n; i++)
        ivp->tested += ivp->test[i] >= 0;
}

void sd_weigh(sd_ivp *ivp, double tolerance, const double *y)
{
    const double part = tolerance == ivp->rtol ? 1.0 : tolerance / ivp->rtol;
    for (int32_t i = 0; i < ivp->n; i++) {
        double size = fabs(y[i]);
        sd_met(size, &ivp->met[i], &ivp->magnitude[i]);
        double atol = ivp->atol && ivp->test[i] >= 0 ? part * ivp->atol[i] : tolerance * ivp->magnitude[i];
        if (ivp->weight)
            ivp->weight[i] = 1.0 / (atol + tolerance * size);
    }
}

double sd_squares(const sd_ivp *ivp, const double *a, const double *b)
{
    double sum = 0.0;
    for (int32_t i = 0; i < ivp->n; i++)
        if (ivp->test[i] >= 0) {
            double v = (a[i] - (b ? b[i] : 0.0)) * ivp->weight[i];
            sum += v * v;
        }
    return sum;
}

double sd_first_step(const sd_ivp *ivp, double longest, double part, double change)
{
    double span = ivp->t_end - ivp->t, least = 1e3 * DBL_EPSILON * fmax(fabs(ivp->t), SD_SHORT * span);
    if (isfinite(change) && change > 0.0)
        longest = fmin(longest, part / change);
    return fmax(longest, fmin(least, span));
}

double sd_fitted(const sd_ivp *ivp, double slack)
{
    double left = ivp->t_end - ivp->t, h = ivp->h;
    if (h >= left * (1.0 - slack))
        return left;
    return 2.0 * h > left && ivp->taken > 0 && !(ivp->fixed_h > 0.0) ? 0.5 * left : h;
}

double sd_longest(const sd_ivp *ivp)
{
    double left = ivp->t_end - ivp->t, number = ceil(left / ivp->h_max * (1.0 - SD_SLACK));
    return number >= 1.0 && number <= FEW ? left / number : ivp->h_max;
}

int sd_too_small(const sd_ivp *ivp)
{
    double left = ivp->t_end - ivp->t;
    return ivp->h < 4.0 * DBL_EPSILON * fmax(fabs(ivp->t), SD_SHORT * left) && ivp->h < left;
}

/* g := jy + lead jyd, and its factors */
static int factorise_at(const sd_ivp *ivp, sd_linear *linear, const double *jy, const double *jyd, double lead, double *g,
                        const double *scale)
{
    for (int32_t e = 0; e < ivp->system->entries; e++)
        g[e] = jy[e] + lead * jyd[e];
    return sd_linear_factor(linear, g, scale);
}

/* whether an unknown is a multiplier, or follows as one does: the index is above 1 */
static int has_multipliers(const sd_ivp *ivp)
{
    for (int32_t i = 0; i < ivp->n; i++)
        if (ivp->power[i] != 0)
            return 1;
    return 0;
}

int sd_outgrown(sd_ivp *ivp, sd_linear *linear, const double *jy, const double *jyd, double lead, double *g, const double *scale)
{
    const int at_step = sd_linear_orientation(linear);
    if (!ivp->orientation)
        ivp->orientation = at_step;
    if (at_step == ivp->orientation && ivp->resting >= SD_RESTS)
        ivp->resting = 0;
    if (!at_step || at_step == ivp->orientation || ivp->resting >= SD_RESTS || ivp->fixed_h > 0.0)
        return SD_FINE;
    const int above = has_multipliers(ivp);
    if (above && ivp->taken > 0) {
        ivp->orientation = at_step;
        return SD_FINE;
    }
    /* a mode that grows, or rows that others have replaced since the sign was taken (an event) */
    const double at = lead / (above ? INSTANT_ABOVE : INSTANT);
    const int at_once = factorise_at(ivp, linear, jy, jyd, at, g, scale) ? 0 : sd_linear_orientation(linear);
    ivp->orientation = at_once ? at_once : at_step;
    if (at_once && at_once != at_step) {
        ivp->outgrown = 1;
        return SD_OUTGROWN;
    }
    return factorise_at(ivp, linear, jy, jyd, lead, g, scale) ? SD_SINGULAR : SD_FINE;
}

int sd_ends(const sd_ivp *ivp, int cause)
{
    return cause == SD_STOPPED || cause == SD_MEMORY || ivp->fixed_h > 0.0;
}

void sd_advance(sd_ivp *ivp)
{
    double t = ivp->t + ivp->h;
    ivp->t = fabs(ivp->t_end - t) <= SD_SLACK * ivp->h ? ivp->t_end : t;
    ivp->h_used = ivp->h;
    ivp->resting = ivp->outgrown || ivp->resting >= SD_RESTS ? ivp->resting + 1 : 0;
    ivp->outgrown = 0;
    ivp->steps++;
    ivp->taken++;
}
