/* The step of Radau IIA: weights, start, error, step size (see radau.h). */
#include "linear/lanes.h"
#include "steppers/groups.h"
#include "steppers/radau/radau.h"
#include "system/condensed.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CREEPS 8           /* steps in a row for which Newton failed at first: towards a square root's zero they would never end */
#define IDLE 1e-6          /* error of a step that only Newton keeps short */
#define LEAP 8.0           /* the next one is tried that much longer, with fresh slopes at its end */
#define WITHIN -0.183
#define FINEST 5e-12       /* of the estimate: less is round-off */
#define FEWER 3            /* failures of Newton's in a step from which on each takes stages away */
#define LENGTHS 2          /* of a step that are tried before corrections are shortened, which is dearer */
#define PRESSED 1e-3       /* of the longest step: one that must be shorter before a steep law, no length will do */
#define SHORTENED 50       /* steps of three stages after one that needed shortened corrections */
#define GOOD 0.001         /* contraction up to which the Jacobian is kept for the next step */
#define KEEP_LOW 1.0       /* a step that would change by no more than this keeps its factors */
#define KEEP_HIGH 1.2
#define PULLED 4.0         /* steps resolve what is slower: measured on HIRES, whose rows within steps were 30 times worse */
#define SINGULAR 6         /* halvings after a singular matrix */
#define ASTRAY 16.0 /* error of a step that passes over what a steep law does: half of it is tried */

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
    sd_radau_provide_weights(radau);
    sd_weigh(&radau->ivp, radau->tolerance, radau->phi);
    if (!(h > 0.0)) { /* local error (h y'/y)^(s+1) within tolerance, with y' / y for the rate of all derivatives */
        double change = sd_radau_norm(radau, yd) * radau->tolerance, power = power_of(radau);
        double longest = SD_FIRST * (radau->ivp.t_end - t) * fmin(1.0, pow(1e3 * radau->tolerance, power)); /* runs that are compared begin apart */
        h = sd_first_step(&radau->ivp, longest, 0.1 * pow(radau->tolerance, power), change);
    }
    radau->ivp.h = fmin(radau->ivp.fixed_h > 0.0 ? radau->ivp.fixed_h : h, radau->ivp.h_max);
    radau->h_before = radau->error_accepted = 0.0;
    radau->growth = SD_GROWTH;
    radau->longest = radau->follows = 0.0;
    radau->behind = radau->ivp.steps > 0;
    radau->pressed = radau->balances;
    radau->lasting = radau->ready = radau->old_jacobian = radau->rejected = radau->creeping = radau->strained = radau->turned = 0;
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
        const int32_t first = radau->at ? radau->at[j] : system->column[j];
        const int32_t end = first + system->column[j + 1] - system->column[j];
        for (int32_t e = first; e < end && radau->smooth[j] != SD_UNPULLED; e++)
            if (radau->jyd[e] != 0.0)
                pull = fmax(pull, radau->ivp.h * fabs(radau->jy[e] / radau->jyd[e]));
        radau->led[j] = radau->smooth[j] && pull < PULLED;
    }
}

/* the last points, their slopes and the stages that led to the last one move on by one step */
static void keep_points(sd_radau *radau)
{
    double *oldest = radau->before, *slope = radau->slope[2];
    for (int32_t i = 0; i < radau->ivp.n && !radau->last; i++)
        oldest[i] = sd_radau_last(radau, i);
    if (radau->last) {
        radau->before = radau->last;
        radau->last = oldest;
        memcpy(radau->last, radau->phi, (size_t)radau->ivp.n * sizeof(double));
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
}

/* the new point, and the next step's size */
static void accept(sd_radau *radau, double error, int iterations, int troubled)
{
    const sd_radau_method *method = radau->method;
    double h = radau->ivp.h;
    error *= sd_radau_strictness(radau, method) / strictness(radau); /* what the next step is judged by */
    double next = sd_radau_next_step(radau, error, iterations, troubled);
    keep_points(radau);
    radau->used = method;
    sd_radau_combine(method->stages, radau->ivp.n, method->inverse[method->stages - 1], radau->kept, radau->rate);
    for (int32_t i = 0; i < radau->ivp.n; i++) {
        radau->phi[i] += radau->kept[method->stages - 1][i];
        radau->yd[i] = radau->rate[i] / h;
    }
    memcpy(radau->slope[0], radau->yd, (size_t)radau->ivp.n * sizeof(double));
    sd_advance(&radau->ivp);
    show_nodes(radau);
    sd_radau_note_points(radau);
    radau->rejected = 0;
    /* the Jacobian lasts while Newton converges fast; the factors while the step hardly changes */
    if (radau->theta > GOOD)
        radau->old_jacobian = radau->ready = 0;
    next = fmin(next, sd_longest(&radau->ivp));
    if (radau->ivp.fixed_h > 0.0)
        radau->ivp.h = radau->ivp.fixed_h;
    else if (!(radau->ready && next / h >= KEEP_LOW - SD_SLACK && next / h <= KEEP_HIGH))
        radau->ivp.h = next;
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

/* what has been tried of a step */
typedef struct trial {
    int iterations;           /* of Newton's */
    int failures, singular;   /* of it; of matrices */
    int fresh;                /* its slopes are of the point that it begins at */
    int strained;             /* it failed with such slopes */
    int leap;                 /* 1: it is longer than what failed before; 2: so it was, in vain */
    double retry, error;      /* the part of its length that is tried next; of the estimate */
} trial;

/* stages of the length at hand: by Newton's iteration, with shortened corrections, or all at once */
static int find_stages(sd_radau *radau, trial *one)
{
    const int steep = radau->ivp.system->scales > 0, whole = one->leap == 1;
    int cause = SD_FINE;
    one->retry = 0.5;
    one->fresh = !radau->old_jacobian;
    sd_radau_extrapolate(radau, radau->ivp.h);
    if (!radau->ready || !sd_radau_factored(radau))
        cause = sd_radau_factorise(radau, one->failures > 0 || whole);
    if (cause == SD_FINE) {
        radau->theta = 0.0; /* one iteration: the Jacobian is good enough */
        cause = sd_radau_iterate(radau, one->failures > 1 || whole, &one->iterations, &one->retry);
    }
    const double left = radau->ivp.t_end - radau->ivp.t;
    radau->pressed |= radau->ivp.h < PRESSED * radau->longest && radau->ivp.h < 0.5 * left;
    int stuck = cause == SD_NEWTON || cause == SD_NONFINITE || cause == SD_SINGULAR;
    if (stuck && !whole && (one->failures >= LENGTHS || radau->pressed) && steep) {
        if (radau->method != sd_radau_methods) /* shortened corrections of more stages are dear */
            radau->since = 0;
        radau->method = sd_radau_methods;
        radau->hold = SHORTENED;
        sd_radau_extrapolate(radau, radau->ivp.h);
        cause = sd_radau_iterate_damped(radau, &one->iterations);
        one->fresh = 1;
    }
    one->strained |= cause == SD_NEWTON && one->fresh;
    /* once it fails in any model: twice in a row it may be for no step's length */
    if (cause == SD_NEWTON && one->fresh && radau->strained && one->leap == 0 && !steep)
        cause = coupled(radau, &one->iterations);
    return cause;
}

/* SD_ERROR_TEST where the stages are too far off, or pass over what a steep law does */
static int judge(sd_radau *radau, trial *one)
{
    int cause = estimate_error(radau, &one->error);
    if (cause == SD_FINE && one->error < 1.0 && radau->ivp.system->scales > 0 && sd_radau_astray(radau))
        one->error = ASTRAY;
    return cause == SD_FINE && !(one->error < 1.0) ? SD_ERROR_TEST : cause;
}

/* a shorter step after one whose error is too large */
static void refuse(sd_radau *radau, const trial *one)
{
    radau->ivp.rejected_steps++;
    radau->rejected = 1;
    int usual = sd_radau_iterations(radau);
    double limit = fmin(SD_SAFETY, SD_SAFETY * (1 + 2 * usual) / (one->iterations + 2 * usual));
    double ratio = fmin(1.0 / SD_SHRINK, pow(one->error, power_of(radau)) / limit);
    radau->ivp.h *= radau->ivp.taken == 0 ? 0.1 : isfinite(ratio) ? 1.0 / fmax(ratio, 1.0) : SD_SHRINK;
}

/* another step after one whose stages were not found: with fresh slopes, longer where short ones creep, else shorter and with
 * fewer stages.  0: none */
static int try_another(sd_radau *radau, trial *one, int cause)
{
    radau->ivp.newton_failures++;
    radau->ready = 0;
    if (cause == SD_SINGULAR && ++one->singular >= SINGULAR)
        return 0;
    if (cause == SD_NEWTON && !one->fresh) {
        radau->old_jacobian = 0; /* once more with fresh slopes */
        return 1;
    }
    if (one->leap == 1) {
        radau->ivp.h /= LEAP;
        one->leap = 2;
    } else if (one->leap == 0 && radau->creeping >= CREEPS && cause == SD_NEWTON) {
        radau->ivp.h *= LEAP;
        radau->old_jacobian = 0;
        one->leap = 1;
        return 1;
    }
    radau->ivp.h *= cause == SD_NEWTON ? one->retry : 0.25;
    if (++one->failures > 2)
        radau->ivp.h *= 0.5;
    if (one->failures >= FEWER && radau->method->stages > 3) {
        radau->method--;
        radau->since = 0;
    }
    radau->old_jacobian = 0;
    radau->rejected = 1;
    return 1;
}

int sd_radau_step(void *self)
{
    sd_radau *radau = self;
    trial one = {0};
    radau->ivp.cause = radau->work && radau->scale ? SD_FINE : SD_MEMORY;
    if (radau->ivp.cause)
        return radau->ivp.cause;
    sd_weigh(&radau->ivp, radau->tolerance, radau->phi);
    for (;;) {
        radau->ivp.h = sd_fitted(&radau->ivp, SD_SLACK);
        if (sd_too_small(&radau->ivp))
            return radau->ivp.cause = radau->ivp.cause ? radau->ivp.cause : SD_STEP;
        sd_radau_weigh(radau);
        int cause = find_stages(radau, &one);
        if (cause == SD_FINE && !(radau->ivp.fixed_h > 0.0))
            cause = judge(radau, &one);
        if (cause == SD_FINE)
            break;
        radau->ivp.cause = cause;
        if (sd_ends(&radau->ivp, cause))
            return cause;
        if (cause == SD_ERROR_TEST)
            refuse(radau, &one);
        else if (!try_another(radau, &one, cause))
            return cause;
    }
    radau->ivp.cause = SD_FINE;
    radau->strained = one.strained;
    radau->turned = radau->turned && one.strained;
    radau->creeping = one.failures > 0 && one.error < IDLE ? radau->creeping + 1 : 0;
    accept(radau, one.error, one.iterations, one.failures > 0);
    if (radau->ivp.project)
        project(radau);
    return SD_FINE;
}
