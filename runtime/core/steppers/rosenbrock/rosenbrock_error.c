/* The error of a step of Rodas5P: at its end, within it, of laws that bend or give way (see rosenbrock.h). */
#include "steppers/rosenbrock/rosenbrock.h"
#include "linear/tuning.h"

#include <math.h>
#include <string.h>

#define STAGES SD_ROSENBROCK_STAGES
#define INSIDE 0.75        /* of the step: where values within are looked at; those of what is slaved are furthest off there */
#define DOUBTED 0.1        /* of a steep row's terms: what it may be off before slopes tell whether tolerances let it be */
#define LOOSE 5e-3         /* tolerance beyond which that is asked: to 1e-3 it refused none of the steps of five circuits */
#define GIVEN 0.1          /* of a slope: what is less has given way */
#define UNMET 10.0         /* tolerances of its unknowns that a row may be off at the end of a step */
#define ROUND_OFF SD_CANCELS /* of its terms: what a row is always off */

double sd_rosenbrock_norm(const sd_rosenbrock *rosenbrock, const double *x, double h, double *state)
{
    double all = 0.0, own = 0.0;
    for (int32_t i = 0; i < rosenbrock->ivp.n; i++) {
        double part = x[i] * rosenbrock->ivp.weight[i] * (rosenbrock->ivp.test[i] > 0 ? h : 1.0);
        all += part * part;
        own += rosenbrock->ivp.test[i] >= 0 ? part * part : 0.0;
    }
    double number = rosenbrock->ivp.tested ? rosenbrock->ivp.tested : 1.0;
    *state = fmax(*state, sqrt(own / number));
    return rosenbrock->ivp.tested ? sqrt(all / number) : 0.0;
}

/* what values within the step are off, where what is pulled back at once hides it from the error of the end: a Newton
 * correction at INSIDE of the step; in the weights, in `error`, of the state in `state` */
static int look_within(sd_rosenbrock *rosenbrock, double *error, double *state)
{
    const double *end = rosenbrock->end;
    double *r = rosenbrock->inner, h = rosenbrock->ivp.h;
    sd_rosenbrock_bend(rosenbrock);
    sd_rosenbrock_polynomial(rosenbrock, rosenbrock->phi, end, h, INSIDE, rosenbrock->within, rosenbrock->within_d);
    int cause = sd_rosenbrock_residual(rosenbrock, rosenbrock->ivp.t + INSIDE * h, rosenbrock->within, rosenbrock->within_d, r);
    if (cause != SD_FINE)
        return cause;
    sd_linear_solve(rosenbrock->linear, r);
    *error = fmax(*error, sd_rosenbrock_norm(rosenbrock, r, h, state));
    return SD_FINE;
}

/* SD_ERROR_TEST where a steep row of the step's end is off by more than the tolerances of its unknowns let it be, by the slopes
 * there: behind an exponential all stages follow the slope at its begin, and agree.  J, E and T are not the begin's then. */
static int laws_hold(sd_rosenbrock *rosenbrock, double *error)
{
    const sd_ivp *ivp = &rosenbrock->ivp;
    sd_system *system = ivp->system;
    double t = ivp->t + ivp->h, *y = rosenbrock->end, *yd = rosenbrock->rate, *r = rosenbrock->inner;
    double *terms = rosenbrock->within, *open = rosenbrock->drift, *size = rosenbrock->u[0], passed = *error;
    for (int32_t i = 0; i < ivp->n; i++)
        size[i] = (fabs(y[i]) + ivp->magnitude[i]) / ivp->h;
    int cause = sd_rosenbrock_residual(rosenbrock, t, y, yd, r);
    if (cause != SD_FINE ||
        sd_first_unmet(system, t, y, size, r, DOUBTED, rosenbrock->g, ivp->magnitude, ivp->met, 0, terms) < 0)
        return cause;
    *error = INFINITY;
    if (sd_jacobian(system, t, y, yd, ivp->magnitude, rosenbrock->jy, rosenbrock->jyd) >= 0)
        return SD_NONFINITE;
    for (int32_t i = 0; i < ivp->n; i++)
        open[i] = ivp->weight[i] > 0.0 ? 1.0 / ivp->weight[i] : ivp->rtol * ivp->magnitude[i];
    if (sd_first_astray(system, t, y, yd, r, 0.0, rosenbrock->jy, rosenbrock->jyd, ivp->h, open, 0, terms) >= 0)
        return SD_ERROR_TEST;
    *error = passed;
    return SD_FINE;
}

/* whether every row of the end is met as far as the tolerances of its unknowns let it be, by the slopes there.  No stage iterates:
 * a row of an algebraic Jacobian that is singular has no correction at all, and is carried along unmet without an error */
static int rows_hold(sd_rosenbrock *rosenbrock)
{
    const sd_ivp *ivp = &rosenbrock->ivp;
    double *size = rosenbrock->u[0], *open = rosenbrock->drift;
    for (int32_t i = 0; i < ivp->n; i++) {
        size[i] = (fabs(rosenbrock->end[i]) + ivp->magnitude[i]) / ivp->h;
        open[i] = UNMET * (ivp->weight[i] > 0.0 ? 1.0 / ivp->weight[i] : ivp->rtol * ivp->magnitude[i]);
    }
    return sd_first_astray(ivp->system, ivp->t + ivp->h, rosenbrock->end, size, rosenbrock->begin_end, ROUND_OFF,
                           rosenbrock->jy_end, rosenbrock->jyd_end, ivp->h, open, 1, rosenbrock->within) < 0;
}

/* what the end is off by the slopes there, where a law has given way within the step (a tanh that saturates): by those at its
 * begin, which hold it, what is left of its row is next to nothing.  Slopes and factors are not the begin's then. */
static int gives_way(sd_rosenbrock *rosenbrock, double *error, double *state)
{
    sd_system *system = rosenbrock->ivp.system;
    double t = rosenbrock->ivp.t + rosenbrock->ivp.h, *y = rosenbrock->end, *yd = rosenbrock->rate, *r = rosenbrock->inner;
    double lead = 1.0 / (sd_rosenbrock_gamma * rosenbrock->ivp.h), *jy = rosenbrock->jy_end, *jyd = rosenbrock->jyd_end;
    int cause = sd_rosenbrock_residual(rosenbrock, t, y, yd, rosenbrock->begin_end);
    if (cause != SD_FINE)
        return cause;
    if (!rosenbrock->lasting && sd_jacobian(system, t, y, yd, rosenbrock->ivp.magnitude, jy, jyd) >= 0)
        return SD_NONFINITE;
    rosenbrock->sloped = 1;
    if (rosenbrock->lasting)
        return SD_FINE;
    int32_t e = 0;
    while (e < system->entries && !(fabs(jy[e]) < GIVEN * fabs(rosenbrock->jy[e])))
        e++;
    if (e == system->entries) {
        if (rows_hold(rosenbrock))
            return SD_FINE;
        *error = INFINITY;
        return SD_ERROR_TEST;
    }
    for (e = 0; e < system->entries; e++)
        rosenbrock->g[e] = jy[e] + lead * jyd[e];
    if (sd_linear_factor(rosenbrock->linear, rosenbrock->g, rosenbrock->ivp.magnitude))
        return SD_FINE;
    memcpy(r, rosenbrock->begin_end, (size_t)rosenbrock->ivp.n * sizeof *r);
    sd_linear_solve(rosenbrock->linear, r);
    *error = fmax(*error, sd_rosenbrock_norm(rosenbrock, r, rosenbrock->ivp.h, state));
    /* nor is the difference of both solutions what the begin's factors say */
    memset(r, 0, (size_t)rosenbrock->ivp.n * sizeof *r);
    const double *u = rosenbrock->u[STAGES - 1];
    for (int32_t j = 0; j < rosenbrock->ivp.n; j++)
        for (e = system->column[j]; e < system->column[j + 1]; e++)
            r[system->row[e]] += (rosenbrock->jy[e] + lead * rosenbrock->jyd[e]) * u[j];
    sd_linear_solve(rosenbrock->linear, r);
    *error = fmax(*error, sd_rosenbrock_norm(rosenbrock, r, rosenbrock->ivp.h, state));
    return SD_FINE;
}

int sd_rosenbrock_attempt(sd_rosenbrock *rosenbrock, double *error, double *state)
{
    rosenbrock->sloped = 0;
    int cause = sd_rosenbrock_factorise(rosenbrock);
    if (cause == SD_FINE)
        cause = sd_rosenbrock_stages(rosenbrock);
    if (cause != SD_FINE)
        return cause;
    *state = 0.0;
    *error = sd_rosenbrock_norm(rosenbrock, rosenbrock->u[STAGES - 1], rosenbrock->ivp.h, state);
    memcpy(rosenbrock->ivp.ee, rosenbrock->u[STAGES - 1], (size_t)rosenbrock->ivp.n * sizeof(double));
    if (*state < 1.0 || rosenbrock->ivp.fixed_h > 0.0) /* what may be taken (`stays`) is asked within, too */
        cause = look_within(rosenbrock, error, state);
    if (rosenbrock->ivp.fixed_h > 0.0)
        return isfinite(*error) ? SD_FINE : SD_NONFINITE;
    if (cause != SD_FINE)
        return cause;
    if (*error < 1.0 && (cause = gives_way(rosenbrock, error, state)) != SD_FINE)
        return cause;
    *error = isfinite(*error) ? fmax(*error, SD_ROSENBROCK_LEAST) : INFINITY;
    if (!(*error < 1.0))
        return SD_ERROR_TEST;
    return rosenbrock->ivp.system->scales > 0 && rosenbrock->ivp.rtol > LOOSE ? laws_hold(rosenbrock, error) : SD_FINE;
}
