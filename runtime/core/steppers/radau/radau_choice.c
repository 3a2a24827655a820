/* How long the next step of Radau IIA is, and how many stages it takes (see radau.h). */
#include "steppers/radau/radau.h"

#include <math.h>

#define REGAIN 1.2         /* growth of the growth that steep laws leave a step behind a failure of Newton's */
#define AWHILE 2           /* steps accepted before the number of stages changes again */
#define CHANGED 1.2        /* what another one must be worth beside the present one */
#define LONGER 2.0         /* the first step of more stages beside the last one at most */
#define FASTEST 0.3        /* contraction with which a longer step is counted on */
#define BESIDE 2.0         /* iterations' worth of a step besides: slopes and factors */

/* The length of step beside the last one, for each unit of work, that a method would take where its estimate of the
 * last step had been `error`; iterations: Newton's in the last step.  Its contraction grows with the step. */
static double worth(const sd_radau *radau, const sd_radau_method *method, double error, int iterations, int troubled,
                    double *length_taken)
{
    double length = SD_SAFETY * pow(fmax(error, 1e-10), -1.0 / (method->stages + 1));
    double theta = radau->theta, needed = iterations;
    length = fmax(SD_SHRINK, fmin(SD_GROWTH, length));
    if (troubled)
        length = fmin(length, 1.0);
    if (theta > 0.0 && theta < 1.0) {
        length = fmin(length, fmax(FASTEST / theta, 1.0));
        if (length > 1.0)
            needed *= log(theta) / log(fmin(length * theta, FASTEST));
    }
    *length_taken = length;
    return length / (method->stages * (needed + BESIDE));
}

/* The method of the next step, whose size so far is `next`: the one that gets on best for its work, as the decay of
 * Taylor's coefficients in the last step (z) tells the errors of its neighbours; the size of its step. */
static double choose(sd_radau *radau, double next, double error, int iterations, int troubled)
{
    const sd_radau_method *method = radau->method;
    double size[2], length, h = radau->ivp.h;
    if (radau->hold > 0)
        radau->hold--;
    if (radau->most_stages == 3 || radau->since < AWHILE || radau->hold > 0)
        return next;
    for (int k = 0; k < 2; k++) {
        sd_radau_combine(method->stages, radau->ivp.n, method->taylor[k], radau->z, radau->rate);
        size[k] = sd_radau_norm(radau, radau->rate);
    }
    if (!(size[0] > 0.0) || !isfinite(size[1]))
        return next;
    double best = worth(radau, method, error, iterations, troubled, &length) * CHANGED;
    if (method->stages > 3) {
        const sd_radau_method *lower = method - 1;
        double low = worth(radau, lower, lower->constant * size[0] * sd_radau_strictness(radau, lower), iterations, troubled,
                           &length);
        if (low > best) {
            best = low;
            radau->method = lower;
            next = length * h;
        }
    }
    if (method->stages < radau->most_stages && !troubled) {
        double decay = fmin(size[1] / size[0], 1.0), ratio = (method + 1)->constant / method->constant * decay * decay;
        ratio *= sd_radau_strictness(radau, method + 1) / sd_radau_strictness(radau, method);
        if (worth(radau, method + 1, error * ratio, iterations, 0, &length) > best) {
            radau->method = method + 1;
            next = fmin(length, LONGER) * h;
        }
    }
    if (radau->method != method)
        radau->since = radau->ready = 0;
    return next;
}

double sd_radau_next_step(sd_radau *radau, double error, int iterations, int troubled)
{
    double h = radau->ivp.h, power = 1.0 / (radau->method->stages + 1);
    int usual = sd_radau_iterations(radau);
    double limit = fmin(SD_SAFETY, SD_SAFETY * (1 + 2 * usual) / (iterations + 2 * usual));
    double ratio = fmax(1.0 / SD_GROWTH, fmin(1.0 / SD_SHRINK, pow(error, power) / limit));
    if (radau->ivp.taken > 0 && radau->since > 0) { /* Gustafsson's predictive controller */
        double predicted = radau->h_accepted / h * pow(error * error / radau->error_accepted, power) / SD_SAFETY;
        ratio = fmax(ratio, fmax(1.0 / SD_GROWTH, fmin(1.0 / SD_SHRINK, predicted)));
    }
    radau->h_accepted = h;
    radau->error_accepted = fmax(1e-2, error);
    double next = h / ratio;
    if (radau->rejected)
        next = fmin(next, h);
    radau->longest = fmax(radau->longest, h);
    radau->growth = troubled ? 1.0 : radau->growth * REGAIN;
    if (radau->ivp.system->scales > 0 && !radau->pressed) /* where they bend, the estimate says nothing of Newton's reach */
        next = fmin(next, fmin(radau->growth, SD_GROWTH) * h);
    radau->since++;
    return radau->ivp.fixed_h > 0.0 ? next : choose(radau, next, error, iterations, troubled);
}
