/* The step of Radau IIA: weights, start, error, step size (see radau.h). */
#include "linear/lanes.h"
#include "steppers/groups.h"
#include "steppers/radau/radau.h"
#include "steppers/threads.h"
#include "system/condensed.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FIRST 1e-2         /* of the span: the first step at most */
#define CREEPS 8           /* steps in a row for which Newton failed at first: towards a square root's zero they would never end */
#define IDLE 1e-6          /* error of a step that only Newton keeps short */
#define LEAP 8.0           /* the next one is tried that much longer, with fresh slopes at its end */
#define WITHIN -0.183
#define FINEST 5e-12       /* of the estimate: less is round-off */
#define FEWER 3            /* failures of Newton's in a step from which on each takes stages away */
#define LENGTHS 2          /* of a step that are tried before corrections are shortened, which is dearer */
#define PRESSED 1e-3       /* of the longest step: one that must be shorter before a steep law, no length will do */
#define REGAIN 1.2         /* growth of the growth that steep laws leave a step behind a failure of Newton's */
#define SHORTENED 50       /* steps of three stages after one that needed shortened corrections */
#define GOOD 0.001         /* contraction up to which the Jacobian is kept for the next step */
#define KEEP_LOW 1.0       /* a step that would change by no more than this keeps its factors */
#define KEEP_HIGH 1.2
#define PULLED 4.0         /* steps resolve what is slower: measured on HIRES, whose rows within steps were 30 times worse */
#define SINGULAR 6         /* halvings after a singular matrix */
#define ASTRAY 16.0 /* error of a step that passes over what a steep law does: half of it is tried */

/* Newton's weights and the scale of columns: of unknowns that all count as they are those that there are; where memory for
 * others is missing no scale, which the first step tells */
static void provide_newton_weights(sd_radau *radau)
{
    size_t m = (size_t)sd_whole_lanes(radau->ivp.n + 1);
    int powers = 0;
    for (int32_t i = 0; i < radau->ivp.n; i++)
        powers |= radau->ivp.power[i] != 0;
    int others = powers || (radau->ivp.atol && !radau->ivp.weight);
    if (others && !radau->powered)
        radau->powered = calloc(3 * m, sizeof *radau->powered);
    if (others && !radau->ivp.weight && radau->powered)
        radau->ivp.weight = radau->powered + 2 * m;
    radau->newton_weight = powers ? radau->powered : radau->ivp.weight;
    radau->scale = others && !radau->powered ? NULL : powers ? radau->powered + m : radau->ivp.magnitude;
}

/* index-2 unknowns and index-3 multipliers count with powers of h */
static void set_newton_weights(sd_radau *radau)
{
    for (int32_t i = 0; i < radau->ivp.n && radau->scale != radau->ivp.magnitude; i++) {
        double power = radau->ivp.power[i] == 0 ? 1.0 : radau->ivp.power[i] == 1 ? radau->ivp.h : radau->ivp.h * radau->ivp.h;
        radau->newton_weight[i] = radau->ivp.weight[i] * power;
        radau->scale[i] = radau->ivp.magnitude[i] / power;
    }
}

static double weight_of(const void *radau, int32_t i)
{
    return sd_radau_weight(radau, i);
}

/* root mean square over the tested unknowns in the error weights */
double sd_radau_norm(const sd_radau *radau, const double *x)
{
    const double none = 0.0;
    double sum = sd_squares_apart(radau->commons, radau->common_from, radau->common, weight_of, radau, x, &none, x, NULL);
    for (int32_t i = 0; i < radau->ivp.n; i++)
        if (radau->ivp.test[i] >= 0) {
            double v = x[i] * sd_radau_weight(radau, i) * (radau->ivp.test[i] ? radau->ivp.h : 1.0);
            sum += v * v;
        }
    return radau->ivp.tested ? sqrt(sum / radau->ivp.tested) : 0.0;
}

/* what is interpolated meets no steep law, of what follows from differences of unknowns too little, and has a lower
 * order than more stages; and slopes at a start may be of a motion that is over at once (an inductor that megaohms tie):
 * powers are those of the stages */
static void show_nodes(sd_radau *radau)
{
    const sd_radau_method *used = radau->used;
    int stages = radau->ivp.system->scales > 0 || radau->ivp.system->left || used->stages > 3 || radau->ivp.taken < SD_POINTS;
    radau->ivp.stepper.nodes = stages ? used->stages : 0;
    radau->ivp.stepper.node = used->c;
    radau->ivp.stepper.node_weight = used->b;
}

/* Values within a step of more stages may be as far off as its estimate says (where constraints make multipliers), and
 * shall fall like those of three, with rtol^0.85: the estimate counts within * rtol^(2/3 - 0.85) times. */
static const double within[SD_METHODS] = {0.0, 0.2, 0.02};

static double strict_by(const sd_radau *radau, double part)
{
    return fmax(1.0, fmin(part * pow(radau->ivp.rtol, WITHIN), radau->tolerance / FINEST));
}

/* what the estimate of a method counts beside that of three stages */
double sd_radau_strictness(const sd_radau *radau, const sd_radau_method *method)
{
    return radau->strict[method - sd_radau_methods];
}

/* the same of the step at hand: values within the first one, of three stages, are a cubic's, of the order of the estimate */
static double strictness(const sd_radau *radau)
{
    int cubic = radau->ivp.taken == 0 && radau->method->stages == 3;
    return cubic ? radau->strict_first : sd_radau_strictness(radau, radau->method);
}

/* 1 / order of the estimate's error in the step */
static double power_of(const sd_radau *radau)
{
    return 1.0 / (radau->method->stages + 1);
}

void sd_radau_start(void *self, double t, const double *y, const double *yd, double h)
{
    sd_radau *radau = self;
    size_t size = (size_t)radau->ivp.n * sizeof *y;
    sd_begin(&radau->ivp, t);
    radau->tolerance = fmax(0.1 * pow(radau->ivp.rtol, 2.0 / 3.0), 1e-13);
    for (int k = 0; k < SD_METHODS; k++)
        radau->strict[k] = strict_by(radau, within[k]);
    radau->strict_first = strict_by(radau, 1.0);
    memmove(radau->phi, y, size);
    memmove(radau->yd, yd, size);
    if (sd_radau_provide(radau)) /* which the first step tells */
        return;
    memcpy(radau->slope[0], radau->yd, size);
    radau->refined[0] = 1; /* a start is settled */
    radau->method = sd_radau_methods;
    while (radau->method->stages < radau->stages)
        radau->method++;
    radau->used = radau->method;
    radau->since = radau->hold = 0;
    show_nodes(radau);
    radau->ivp.h = 1.0;
    provide_newton_weights(radau);
    sd_weigh(&radau->ivp, radau->tolerance, radau->phi);
    if (!(h > 0.0)) { /* local error (h y'/y)^(s+1) within tolerance, with y' / y for the rate of all derivatives */
        double change = sd_radau_norm(radau, yd) * radau->tolerance, power = power_of(radau);
        double longest = FIRST * (radau->ivp.t_end - t);
        longest *= fmin(1.0, pow(1e3 * radau->tolerance, power)); /* runs that are compared begin apart */
        h = sd_first_step(&radau->ivp, longest, 0.1 * pow(radau->tolerance, power), change);
    }
    radau->ivp.h = fmin(radau->ivp.fixed_h > 0.0 ? radau->ivp.fixed_h : h, radau->ivp.h_max);
    radau->h_before = radau->error_accepted = 0.0;
    radau->growth = SD_GROWTH;
    radau->longest = radau->follows = 0.0;
    radau->behind = radau->ivp.steps > 0;
    radau->pressed = radau->balances;
    radau->ready = radau->old_jacobian = radau->rejected = radau->creeping = radau->strained = radau->turned = 0;
    sd_radau_leave_below(radau, radau->linear->idle ? SD_LEAST_PIVOT : 0.0);
    radau->theta = 1.0;
}

/* error of the step in the weights, filtered once more where it is large after a rejection or at the start */
static int estimate_error(sd_radau *radau, double *error)
{
    int32_t n = radau->ivp.n;
    double *v = radau->rate, *ee = radau->ivp.ee, strict = strictness(radau);
    memcpy(radau->y, radau->phi, (size_t)n * sizeof(double));
    for (int again = 0;; again++) {
        sd_radau_combine(radau->method->stages, n, radau->method->estimate, radau->z, v);
        for (int32_t i = 0; i < n; i++)
            v[i] = -v[i] / radau->ivp.h;
        sd_residual(radau->ivp.system, radau->ivp.t, radau->y, v, ee);
        if (*radau->ivp.system->stop)
            return SD_STOPPED;
        for (int32_t i = 0; i < n; i++)
            ee[i] = -ee[i];
        sd_linear_solve(radau->linear, ee);
        *error = sd_radau_norm(radau, ee);
        if (!(*error * strict >= 1.0) || again || !(radau->ivp.taken == 0 || radau->rejected))
            break;
        for (int32_t i = 0; i < n; i++)
            radau->y[i] = radau->phi[i] + (radau->ivp.test[i] >= 0 ? ee[i] : 0.0);
    }
    *error *= strict;
    if (!(radau->ivp.fixed_h > 0.0))
        *error = fmax(*error, sd_radau_between(radau));
    *error = isfinite(*error) ? fmax(*error, 1e-10) : INFINITY;
    return SD_FINE;
}

/* which unknowns steps follow: how fast each is pulled back by its own row, in steps */
static void note_led(sd_radau *radau)
{
    const sd_system *system = radau->ivp.system;
    for (int32_t j = 0; j < radau->ivp.n; j++) {
        double pull = 0.0;
        for (int32_t e = system->column[j]; e < system->column[j + 1] && radau->smooth[j] != SD_UNPULLED; e++)
            if (radau->jyd[e] != 0.0)
                pull = fmax(pull, radau->ivp.h * fabs(radau->jy[e] / radau->jyd[e]));
        radau->led[j] = radau->smooth[j] && pull < PULLED;
    }
}

/* the new point, and the next step's size */
static void accept(sd_radau *radau, double error, int iterations, int troubled)
{
    size_t size = (size_t)radau->ivp.n * sizeof(double);
    const sd_radau_method *method = radau->method;
    double h = radau->ivp.h, power = power_of(radau);
    error *= sd_radau_strictness(radau, method) / strictness(radau); /* what the next step is judged by */
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
    if (!(radau->ivp.fixed_h > 0.0))
        next = sd_radau_choose(radau, next, error, iterations, troubled);
    double *oldest = radau->before, *slope = radau->slope[2];
    for (int32_t i = 0; i < radau->ivp.n && !radau->last; i++)
        oldest[i] = sd_radau_last(radau, i);
    if (radau->last) {
        radau->before = radau->last;
        radau->last = oldest;
        memcpy(radau->last, radau->phi, size);
    }
    for (int k = 2; k > 0; k--) {
        radau->slope[k] = radau->slope[k - 1];
        radau->refined[k] = radau->refined[k - 1];
    }
    radau->slope[0] = slope;
    radau->refined[0] = 0;
    radau->h_before = radau->ivp.h_used;
    note_led(radau);
    for (int s = 0; s < radau->most_stages; s++) {
        double *swap = radau->kept[s];
        radau->kept[s] = radau->z[s];
        radau->z[s] = swap;
    }
    radau->used = method;
    sd_radau_combine(method->stages, radau->ivp.n, method->inverse[method->stages - 1], radau->kept, radau->rate);
    for (int32_t i = 0; i < radau->ivp.n; i++) {
        radau->phi[i] += radau->kept[method->stages - 1][i];
        radau->yd[i] = radau->rate[i] / h;
    }
    memcpy(radau->slope[0], radau->yd, size);
    sd_advance(&radau->ivp);
    show_nodes(radau);
    sd_radau_note_points(radau);
    radau->rejected = 0;
    /* the Jacobian lasts while Newton converges fast; the factors while the step hardly changes */
    if (radau->theta > GOOD)
        radau->old_jacobian = radau->ready = 0;
    if (radau->ivp.fixed_h > 0.0)
        radau->ivp.h = radau->ivp.fixed_h;
    else if (!(radau->ready && next / h >= KEEP_LOW && next / h <= KEEP_HIGH))
        radau->ivp.h = fmin(next, radau->ivp.h_max);
}

/* the new point moved onto every constraint, and q' with f */
static void project(sd_radau *radau)
{
    size_t size = (size_t)radau->ivp.n * sizeof(double);
    memcpy(radau->y, radau->phi, size);
    memcpy(radau->rate, radau->yd, size);
    radau->ivp.project->lent = radau->ivp.system->left ? NULL : sd_radau_spare(radau, &radau->ivp.project->lent_room);
    int failed = sd_settle_point(radau->ivp.project, radau->ivp.t, radau->y, radau->rate);
    radau->ivp.project->lent = NULL;
    if (failed)
        return;
    memcpy(radau->phi, radau->y, size);
    for (int32_t i = 0; i < radau->ivp.n; i++)
        if (radau->smooth[i])
            radau->slope[0][i] = radau->yd[i] = radau->rate[i];
}

/* the stages all at once; the error is then judged by slopes at the end of the step, those at its start having failed */
static int coupled(sd_radau *radau, int *iterations)
{
    int cause = sd_radau_iterate_coupled(radau, iterations);
    radau->turned = cause == SD_FINE;
    return cause ? cause : sd_radau_factorise(radau, 1);
}

int sd_radau_step(void *self)
{
    sd_radau *radau = self;
    int singular = 0, iterations = 0, failures = 0, leap = 0, strained = 0;
    double retry = 0.5, error = 0.0;
    radau->ivp.cause = radau->work && radau->scale ? SD_FINE : SD_MEMORY;
    if (radau->ivp.cause)
        return radau->ivp.cause;
    sd_weigh(&radau->ivp, radau->tolerance, radau->phi);
    for (;;) {
        radau->ivp.h = sd_fitted(&radau->ivp, SD_SLACK);
        if (sd_too_small(&radau->ivp))
            return radau->ivp.cause = radau->ivp.cause ? radau->ivp.cause : SD_STEP;
        set_newton_weights(radau);
        int cause = SD_FINE;
        retry = 0.5;
        int fresh = !radau->old_jacobian;
        sd_radau_extrapolate(radau, radau->ivp.h);
        if (!radau->ready || radau->ivp.h != radau->h_factored)
            cause = sd_radau_factorise(radau, failures > 0 || leap == 1);
        if (cause == SD_FINE) {
            radau->theta = 0.0; /* one iteration: the Jacobian is good enough */
            cause = sd_radau_iterate(radau, failures > 1 || leap == 1, &iterations, &retry);
        }
        radau->pressed |= radau->ivp.h < PRESSED * radau->longest && radau->ivp.h < 0.5 * (radau->ivp.t_end - radau->ivp.t);
        int stuck = cause == SD_NEWTON || cause == SD_NONFINITE || cause == SD_SINGULAR;
        if (stuck && leap != 1 && (failures >= LENGTHS || radau->pressed) && radau->ivp.system->scales > 0) {
            if (radau->method != sd_radau_methods) /* shortened corrections of more stages are dear */
                radau->since = 0;
            radau->method = sd_radau_methods;
            radau->hold = SHORTENED;
            sd_radau_extrapolate(radau, radau->ivp.h);
            cause = sd_radau_iterate_damped(radau, &iterations);
            fresh = 1;
        }
        strained |= cause == SD_NEWTON && fresh;
        /* once it fails in any model: twice in a row it may be for no step's length */
        if (cause == SD_NEWTON && fresh && radau->strained && leap == 0 && radau->ivp.system->scales == 0)
            cause = coupled(radau, &iterations);
        if (cause == SD_FINE && !(radau->ivp.fixed_h > 0.0)) {
            cause = estimate_error(radau, &error);
            if (cause == SD_FINE && error < 1.0 && radau->ivp.system->scales > 0 && sd_radau_astray(radau))
                error = ASTRAY;
            if (cause == SD_FINE && !(error < 1.0))
                cause = SD_ERROR_TEST;
        }
        if (cause == SD_FINE)
            break;
        radau->ivp.cause = cause;
        if (sd_ends(&radau->ivp, cause))
            return cause;
        if (cause == SD_ERROR_TEST) {
            radau->ivp.rejected_steps++;
            radau->rejected = 1;
            int usual = sd_radau_iterations(radau);
            double limit = fmin(SD_SAFETY, SD_SAFETY * (1 + 2 * usual) / (iterations + 2 * usual));
            double ratio = fmin(1.0 / SD_SHRINK, pow(error, power_of(radau)) / limit);
            radau->ivp.h *= radau->ivp.taken == 0 ? 0.1 : isfinite(ratio) ? 1.0 / fmax(ratio, 1.0) : SD_SHRINK;
        } else {
            radau->ivp.newton_failures++;
            radau->ready = 0;
            if (cause == SD_SINGULAR && ++singular >= SINGULAR)
                return cause;
            if (cause == SD_NEWTON && !fresh) {
                radau->old_jacobian = 0; /* once more with fresh slopes */
                continue;
            }
            if (leap == 1) {
                radau->ivp.h /= LEAP;
                leap = 2;
            } else if (leap == 0 && radau->creeping >= CREEPS && cause == SD_NEWTON) {
                radau->ivp.h *= LEAP;
                radau->old_jacobian = 0;
                leap = 1;
                continue;
            }
            radau->ivp.h *= cause == SD_NEWTON ? retry : 0.25;
            if (++failures > 2)
                radau->ivp.h *= 0.5;
            if (failures >= FEWER && radau->method->stages > 3) {
                radau->method--;
                radau->since = 0;
            }
            radau->old_jacobian = 0;
            radau->rejected = 1;
        }
    }
    radau->ivp.cause = SD_FINE;
    radau->strained = strained;
    radau->turned = radau->turned && strained;
    radau->creeping = failures > 0 && error < IDLE ? radau->creeping + 1 : 0;
    accept(radau, error, iterations, failures > 0);
    if (radau->ivp.project)
        project(radau);
    return SD_FINE;
}
