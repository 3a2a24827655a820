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

/* weights of the error test and of Newton's at the last accepted point */
static void set_weights(sd_radau *radau)
{
    for (int32_t i = 0; i < radau->n; i++) {
        double size = fabs(radau->phi[i]);
        sd_met(size, &radau->met[i], &radau->magnitude[i]);
        double atol = radau->tolerance * radau->magnitude[i];
        if (radau->atol && radau->test[i] >= 0)
            atol = radau->atol[i] * radau->tolerance / radau->rtol;
        if (radau->weight)
            radau->weight[i] = 1.0 / (atol + radau->tolerance * size);
    }
}

/* Newton's weights and the scale of columns: of unknowns that all count as they are those that there are; where memory for
 * others is missing no scale, which the first step tells */
static void provide_newton_weights(sd_radau *radau)
{
    size_t m = (size_t)sd_whole_lanes(radau->n + 1);
    int powers = 0;
    for (int32_t i = 0; i < radau->n; i++)
        powers |= radau->power[i] != 0;
    int others = powers || (radau->atol && !radau->weight);
    if (others && !radau->powered)
        radau->powered = calloc(3 * m, sizeof *radau->powered);
    if (others && !radau->weight && radau->powered)
        radau->weight = radau->powered + 2 * m;
    radau->newton_weight = powers ? radau->powered : radau->weight;
    radau->scale = others && !radau->powered ? NULL : powers ? radau->powered + m : radau->magnitude;
}

/* index-2 unknowns and index-3 multipliers count with powers of h */
static void set_newton_weights(sd_radau *radau)
{
    for (int32_t i = 0; i < radau->n && radau->scale != radau->magnitude; i++) {
        double power = radau->power[i] == 0 ? 1.0 : radau->power[i] == 1 ? radau->h : radau->h * radau->h;
        radau->newton_weight[i] = radau->weight[i] * power;
        radau->scale[i] = radau->magnitude[i] / power;
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
    for (int32_t i = 0; i < radau->n; i++)
        if (radau->test[i] >= 0) {
            double v = x[i] * sd_radau_weight(radau, i) * (radau->test[i] ? radau->h : 1.0);
            sum += v * v;
        }
    return radau->tested ? sqrt(sum / radau->tested) : 0.0;
}

/* what is interpolated meets no steep law, of what follows from differences of unknowns too little, and has a lower
 * order than more stages; and slopes at a start may be of a motion that is over at once (an inductor that megaohms tie):
 * powers are those of the stages */
static void show_nodes(sd_radau *radau)
{
    const sd_radau_method *used = radau->used;
    int stages = radau->system->scales > 0 || radau->system->left || used->stages > 3 || radau->taken < SD_POINTS;
    radau->stepper.nodes = stages ? used->stages : 0;
    radau->stepper.node = used->c;
    radau->stepper.node_weight = used->b;
}

/* Values within a step of more stages may be as far off as its estimate says (where constraints make multipliers), and
 * shall fall like those of three, with rtol^0.85: the estimate counts within * rtol^(2/3 - 0.85) times. */
static const double within[SD_METHODS] = {0.0, 0.2, 0.02};

static double strict_by(const sd_radau *radau, double part)
{
    return fmax(1.0, fmin(part * pow(radau->rtol, WITHIN), radau->tolerance / FINEST));
}

/* what the estimate of a method counts beside that of three stages */
double sd_radau_strictness(const sd_radau *radau, const sd_radau_method *method)
{
    return radau->strict[method - sd_radau_methods];
}

/* the same of the step at hand: values within the first one, of three stages, are a cubic's, of the order of the estimate */
static double strictness(const sd_radau *radau)
{
    int cubic = radau->taken == 0 && radau->method->stages == 3;
    return cubic ? radau->strict_first : sd_radau_strictness(radau, radau->method);
}

/* 1 / order of the estimate's error in the step */
static double power_of(const sd_radau *radau)
{
    return 1.0 / (radau->method->stages + 1);
}

void sd_radau_start(sd_radau *radau, double t, const double *y, const double *yd, double h)
{
    size_t size = (size_t)radau->n * sizeof *y;
    radau->t = t;
    radau->taken = 0;
    radau->tested = 0;
    for (int32_t i = 0; i < radau->n; i++)
        radau->tested += radau->test[i] >= 0;
    radau->tolerance = fmax(0.1 * pow(radau->rtol, 2.0 / 3.0), 1e-13);
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
    radau->h = 1.0;
    provide_newton_weights(radau);
    set_weights(radau);
    double span = radau->t_end - t, change = sd_radau_norm(radau, yd) * radau->tolerance;
    double power = power_of(radau);
    if (!(h > 0.0)) { /* local error (h y'/y)^(s+1) within tolerance, with y' / y for the rate of all derivatives */
        h = FIRST * span * fmin(1.0, pow(1e3 * radau->tolerance, power)); /* runs that are compared begin apart */
        if (isfinite(change) && change > 0.0)
            h = fmin(h, 0.1 * pow(radau->tolerance, power) / change);
        h = fmax(h, fmin(1e3 * DBL_EPSILON * fmax(fabs(t), SD_SHORT * span), span));
    }
    radau->h = fmin(radau->fixed_h > 0.0 ? radau->fixed_h : h, radau->h_max);
    radau->h_used = radau->h_before = 0.0;
    radau->error_accepted = 0.0;
    radau->growth = SD_GROWTH;
    radau->longest = radau->follows = 0.0;
    radau->behind = radau->steps > 0;
    radau->pressed = radau->balances;
    radau->ready = radau->old_jacobian = radau->rejected = radau->creeping = radau->strained = radau->turned = 0;
    sd_radau_leave_below(radau, radau->linear->idle ? SD_LEAST_PIVOT : 0.0);
    radau->theta = 1.0;
}

/* error of the step in the weights, filtered once more where it is large after a rejection or at the start */
static int estimate_error(sd_radau *radau, double *error)
{
    int32_t n = radau->n;
    double *v = radau->rate, *ee = radau->ee, strict = strictness(radau);
    memcpy(radau->y, radau->phi, (size_t)n * sizeof(double));
    for (int again = 0;; again++) {
        sd_radau_combine(radau->method->stages, n, radau->method->estimate, radau->z, v);
        for (int32_t i = 0; i < n; i++)
            v[i] = -v[i] / radau->h;
        sd_residual(radau->system, radau->t, radau->y, v, ee);
        if (*radau->system->stop)
            return SD_STOPPED;
        for (int32_t i = 0; i < n; i++)
            ee[i] = -ee[i];
        sd_linear_solve(radau->linear, ee);
        *error = sd_radau_norm(radau, ee);
        if (!(*error * strict >= 1.0) || again || !(radau->taken == 0 || radau->rejected))
            break;
        for (int32_t i = 0; i < n; i++)
            radau->y[i] = radau->phi[i] + (radau->test[i] >= 0 ? ee[i] : 0.0);
    }
    *error *= strict;
    if (!(radau->fixed_h > 0.0))
        *error = fmax(*error, sd_radau_between(radau));
    *error = isfinite(*error) ? fmax(*error, 1e-10) : INFINITY;
    return SD_FINE;
}

/* the step ends at t_end exactly, and never leaves less than its half for the last one */
static void fit_end(sd_radau *radau)
{
    double left = radau->t_end - radau->t;
    if (radau->h >= left * (1.0 - 1e-12))
        radau->h = left;
    else if (2.0 * radau->h > left && radau->taken > 0 && !(radau->fixed_h > 0.0))
        radau->h = 0.5 * left;
}

/* which unknowns steps follow: how fast each is pulled back by its own row, in steps */
static void note_led(sd_radau *radau)
{
    const sd_system *system = radau->system;
    for (int32_t j = 0; j < radau->n; j++) {
        double pull = 0.0;
        for (int32_t e = system->column[j]; e < system->column[j + 1] && radau->smooth[j] != SD_UNPULLED; e++)
            if (radau->jyd[e] != 0.0)
                pull = fmax(pull, radau->h * fabs(radau->jy[e] / radau->jyd[e]));
        radau->led[j] = radau->smooth[j] && pull < PULLED;
    }
}

/* the new point, and the next step's size */
static void accept(sd_radau *radau, double error, int iterations, int troubled)
{
    size_t size = (size_t)radau->n * sizeof(double);
    const sd_radau_method *method = radau->method;
    double h = radau->h, power = power_of(radau);
    error *= sd_radau_strictness(radau, method) / strictness(radau); /* what the next step is judged by */
    int usual = sd_radau_iterations(radau);
    double limit = fmin(SD_SAFETY, SD_SAFETY * (1 + 2 * usual) / (iterations + 2 * usual));
    double ratio = fmax(1.0 / SD_GROWTH, fmin(1.0 / SD_SHRINK, pow(error, power) / limit));
    if (radau->taken > 0 && radau->since > 0) { /* Gustafsson's predictive controller */
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
    if (radau->system->scales > 0 && !radau->pressed) /* where they bend, the estimate says nothing of Newton's reach */
        next = fmin(next, fmin(radau->growth, SD_GROWTH) * h);
    radau->since++;
    if (!(radau->fixed_h > 0.0))
        next = sd_radau_choose(radau, next, error, iterations, troubled);
    double *oldest = radau->before, *slope = radau->slope[2];
    for (int32_t i = 0; i < radau->n && !radau->last; i++)
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
    radau->h_before = radau->h_used;
    radau->h_used = h;
    note_led(radau);
    for (int s = 0; s < radau->most_stages; s++) {
        double *swap = radau->kept[s];
        radau->kept[s] = radau->z[s];
        radau->z[s] = swap;
    }
    radau->used = method;
    sd_radau_combine(method->stages, radau->n, method->inverse[method->stages - 1], radau->kept, radau->rate);
    for (int32_t i = 0; i < radau->n; i++) {
        radau->phi[i] += radau->kept[method->stages - 1][i];
        radau->yd[i] = radau->rate[i] / h;
    }
    memcpy(radau->slope[0], radau->yd, size);
    double t = radau->t + h;
    radau->t = fabs(radau->t_end - t) <= 1e-12 * h ? radau->t_end : t;
    radau->steps++;
    radau->taken++;
    show_nodes(radau);
    sd_radau_note_points(radau);
    radau->rejected = 0;
    /* the Jacobian lasts while Newton converges fast; the factors while the step hardly changes */
    if (radau->theta > GOOD)
        radau->old_jacobian = radau->ready = 0;
    if (radau->fixed_h > 0.0)
        radau->h = radau->fixed_h;
    else if (!(radau->ready && next / h >= KEEP_LOW && next / h <= KEEP_HIGH))
        radau->h = fmin(next, radau->h_max);
}

/* the new point moved onto every constraint, and q' with f */
static void project(sd_radau *radau)
{
    size_t size = (size_t)radau->n * sizeof(double);
    memcpy(radau->y, radau->phi, size);
    memcpy(radau->rate, radau->yd, size);
    radau->project->lent = radau->system->left ? NULL : sd_radau_spare(radau, &radau->project->lent_room);
    int failed = sd_settle_point(radau->project, radau->t, radau->y, radau->rate);
    radau->project->lent = NULL;
    if (failed)
        return;
    memcpy(radau->phi, radau->y, size);
    for (int32_t i = 0; i < radau->n; i++)
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

int sd_radau_step(sd_radau *radau)
{
    int singular = 0, iterations = 0, failures = 0, leap = 0, strained = 0;
    double retry = 0.5, error = 0.0;
    radau->cause = radau->work && radau->scale ? SD_FINE : SD_MEMORY;
    if (radau->cause)
        return radau->cause;
    set_weights(radau);
    for (;;) {
        fit_end(radau);
        double left = radau->t_end - radau->t;
        if (radau->h < 4.0 * DBL_EPSILON * fmax(fabs(radau->t), SD_SHORT * left) && radau->h < left) {
            radau->cause = radau->cause ? radau->cause : SD_STEP;
            return radau->cause;
        }
        set_newton_weights(radau);
        int cause = SD_FINE;
        retry = 0.5;
        int fresh = !radau->old_jacobian;
        sd_radau_extrapolate(radau, radau->h);
        if (!radau->ready || radau->h != radau->h_factored)
            cause = sd_radau_factorise(radau, failures > 0 || leap == 1);
        if (cause == SD_FINE) {
            radau->theta = 0.0; /* one iteration: the Jacobian is good enough */
            cause = sd_radau_iterate(radau, failures > 1 || leap == 1, &iterations, &retry);
        }
        radau->pressed |= radau->h < PRESSED * radau->longest && radau->h < 0.5 * left;
        int stuck = cause == SD_NEWTON || cause == SD_NONFINITE || cause == SD_SINGULAR;
        if (stuck && leap != 1 && (failures >= LENGTHS || radau->pressed) && radau->system->scales > 0) {
            if (radau->method != sd_radau_methods) /* shortened corrections of more stages are dear */
                radau->since = 0;
            radau->method = sd_radau_methods;
            radau->hold = SHORTENED;
            sd_radau_extrapolate(radau, radau->h);
            cause = sd_radau_iterate_damped(radau, &iterations);
            fresh = 1;
        }
        strained |= cause == SD_NEWTON && fresh;
        /* once it fails in any model: twice in a row it may be for no step's length */
        if (cause == SD_NEWTON && fresh && radau->strained && leap == 0 && radau->system->scales == 0)
            cause = coupled(radau, &iterations);
        if (cause == SD_FINE && !(radau->fixed_h > 0.0)) {
            cause = estimate_error(radau, &error);
            if (cause == SD_FINE && error < 1.0 && radau->system->scales > 0 && sd_radau_astray(radau))
                error = ASTRAY;
            if (cause == SD_FINE && !(error < 1.0))
                cause = SD_ERROR_TEST;
        }
        if (cause == SD_FINE)
            break;
        radau->cause = cause;
        if (cause == SD_STOPPED || cause == SD_MEMORY || radau->fixed_h > 0.0)
            return cause;
        if (cause == SD_ERROR_TEST) {
            radau->rejected_steps++;
            radau->rejected = 1;
            int usual = sd_radau_iterations(radau);
            double limit = fmin(SD_SAFETY, SD_SAFETY * (1 + 2 * usual) / (iterations + 2 * usual));
            double ratio = fmin(1.0 / SD_SHRINK, pow(error, power_of(radau)) / limit);
            radau->h *= radau->taken == 0 ? 0.1 : isfinite(ratio) ? 1.0 / fmax(ratio, 1.0) : SD_SHRINK;
        } else {
            radau->newton_failures++;
            radau->ready = 0;
            if (cause == SD_SINGULAR && ++singular >= SINGULAR)
                return cause;
            if (cause == SD_NEWTON && !fresh) {
                radau->old_jacobian = 0; /* once more with fresh slopes */
                continue;
            }
            if (leap == 1) {
                radau->h /= LEAP;
                leap = 2;
            } else if (leap == 0 && radau->creeping >= CREEPS && cause == SD_NEWTON) {
                radau->h *= LEAP;
                radau->old_jacobian = 0;
                leap = 1;
                continue;
            }
            radau->h *= cause == SD_NEWTON ? retry : 0.25;
            if (++failures > 2)
                radau->h *= 0.5;
            if (failures >= FEWER && radau->method->stages > 3) {
                radau->method--;
                radau->since = 0;
            }
            radau->old_jacobian = 0;
            radau->rejected = 1;
        }
    }
    radau->cause = SD_FINE;
    radau->strained = strained;
    radau->turned = radau->turned && strained;
    radau->creeping = failures > 0 && error < IDLE ? radau->creeping + 1 : 0;
    accept(radau, error, iterations, failures > 0);
    if (radau->project)
        project(radau);
    return SD_FINE;
}
