/* Newton's iteration for the stages of Radau IIA, and with corrections shortened for steep laws (see radau.h). */
#include "steppers/radau/radau.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define ITERATIONS 7       /* of Newton a step of three stages */
#define MORE 1             /* for each stage beyond */
#define PATIENT 30         /* the same where the step is fixed: nothing is gained by giving up early */
#define DAMPED 15          /* with corrections shortened */
#define WALK 45            /* with whole ones: back down an exponential of all digits, one 1/a each, and a few more */
#define SLOW 0.99          /* contraction above which Newton gives up */
#define FADING 0.3         /* a correction over the one before: what is borne and shrinks no faster is round-off */
#define STAGNANT 0.1       /* of the tolerance: corrections of the state this small that do not shrink are round-off; that of
                            * what follows from rates grows as steps shrink, goes into no other step, and may be the method's */
#define FAINTEST 1e-9      /* of magnitudes: what round-off may leave of what follows from rates */
#define LAX 100.0          /* a steep row may be off by as many times Newton's tolerance times the method's */
#define SOLVED 1e-6        /* of a correction: what factors of the very matrix leave at most, where slopes never change */
#define LEAST_PART 1e-7    /* of a correction that is still tried */
#define FAINT_ROW 1e-6     /* the same where slopes are too faint to move an unknown */
#define FINEST_ROW 1e-9    /* part of a steep row's terms that round-off of its unknowns leaves */

/* Parts of their column below which pivots determine nothing: no better than Newton's test asks, then ever fainter; then
 * slopes lean on those at zero, where columns were left, and of all that may be (sd_radau_lean) */
static const struct {
    double null_pivot;
    int lean;
} ways[] = {{1e-10, 0}, {1e-13, 0}, {1e-16, 0}, {SD_LEAST_PIVOT, 0}, {1e-10, SD_WHERE_LEFT}, {1e-10, SD_WHERE_IDLE}};

/* Newton's weights and the scale of columns: of unknowns that all count as they are those that there are; where memory for
 * others is missing no scale, which the first step tells */
void sd_radau_provide_weights(sd_radau *radau)
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
void sd_radau_weigh(sd_radau *radau)
{
    for (int32_t i = 0; i < radau->ivp.n && radau->scale != radau->ivp.magnitude; i++) {
        double power = radau->ivp.power[i] == 0 ? 1.0 : radau->ivp.power[i] == 1 ? radau->ivp.h : radau->ivp.h * radau->ivp.h;
        radau->newton_weight[i] = radau->ivp.weight[i] * power;
        radau->scale[i] = radau->ivp.magnitude[i] / power;
    }
}

/* the part of its column below which a pivot is none; columns of multipliers and states always have one */
void sd_radau_leave_below(sd_radau *radau, double null_pivot)
{
    radau->linear->null_pivot = null_pivot;
    for (int k = 0; k < SD_PAIRS && radau->complex_linear[k]; k++)
        sd_linear_z_allow(radau->complex_linear[k], null_pivot, radau->linear->idle);
}

/* Of Newton's corrections, in units of the unknowns': what is borne, and what is aimed at, for errors of this size have one
 * sign over many steps (van der Pol's phase was off by 2e-8 s at whatever tolerance, now 1e-10) */
static const double round_off[SD_METHODS] = {10.0, 40.0, 160.0}, aimed_at[SD_METHODS] = {1.0, 3.0, 5.0};

/* the last factors left a column */
static int columns_left(const sd_radau *radau)
{
    int left = radau->linear->rank < radau->ivp.n;
    for (int k = 0; k < radau->method->pairs; k++)
        left = left || sd_linear_z_rank(radau->complex_linear[k]) < radau->ivp.n;
    return left;
}

/* what a row may be off, of its terms */
double sd_radau_row_limit(const sd_radau *radau, double newton_tolerance)
{
    double limit = fmin(1.0, fmax(FINEST_ROW, LAX * newton_tolerance * radau->tolerance));
    return columns_left(radau) ? fmax(limit, FAINT_ROW) : limit;
}

/* The residuals in d, behind the last correction, are small in every steep row beside the row's own terms: on an
 * exponential a correction says nothing about what it leaves.  Where the factors left a column every row is judged. */
static int rows_hold(sd_radau *radau, double newton_tolerance, int all)
{
    int judged = all || columns_left(radau);
    double limit = sd_radau_row_limit(radau, newton_tolerance);
    for (int s = 0; s < radau->method->stages; s++) {
        for (int32_t i = 0; i < radau->ivp.n; i++) {
            radau->y[i] = radau->phi[i] + radau->z[s][i];
            radau->rate[i] = (fabs(radau->y[i]) + radau->ivp.magnitude[i]) / radau->ivp.h;
        }
        double t = radau->ivp.t + radau->method->c[s] * radau->ivp.h;
        if (sd_first_unmet(radau->ivp.system, t, radau->y, radau->rate, radau->d[s], limit, radau->g, radau->scale,
                           radau->ivp.met, judged, radau->terms) >= 0)
            return 0;
    }
    return 1;
}

/* What corrections that do not shrink any more leave open of an unknown.  Two of one sense that are as large as each other
 * are on their way, one 1/a after the other down an exponential, and leave its round-off alone; so does one by itself, of
 * which nobody knows whether it shrinks. */
static double left_open(const sd_radau *radau, int s, int32_t i, int before)
{
    double now = radau->full[s][i], was = before ? radau->moved[s][i] : now;
    return sd_open(now * was > 0.0 && fabs(now) > 0.5 * fabs(was) ? 0.0 : now, radau->y[i], radau->ivp.met[i]);
}

/* Every steep row is as small as the last corrections (`full`), which do not shrink any more, let it be by slopes at the
 * stages themselves: where two terms of a law nearly vanish beside unknowns that are large elsewhere, no part of the terms is
 * ever reached.  Where the factors left a column every row is judged.  before: `moved` holds the correction before. */
static int rows_at_round_off(sd_radau *radau, double newton_tolerance, int before)
{
    int all = columns_left(radau);
    double limit = sd_radau_row_limit(radau, newton_tolerance);
    for (int s = 0; s < radau->method->stages; s++) {
        double t = radau->ivp.t + radau->method->c[s] * radau->ivp.h;
        sd_radau_stage(radau, s, radau->y, radau->rate);
        sd_jacobian(radau->ivp.system, t, radau->y, radau->rate, radau->ivp.magnitude, radau->jy, radau->jyd);
        for (int32_t i = 0; i < radau->ivp.n; i++)
            radau->first[i] = left_open(radau, s, i, before);
        if (sd_first_astray(radau->ivp.system, t, radau->y, radau->rate, radau->d[s], limit, radau->jy, radau->jyd,
                            radau->ivp.h, radau->first, all, radau->terms) >= 0)
            return 0;
    }
    return 1;
}

/* of Newton a step */
int sd_radau_iterations(const sd_radau *radau)
{
    return ITERATIONS + MORE * (radau->method->stages - 3);
}

/* Of Newton's corrections in its weights, with a round-off in units of the unknowns' */
static double newton_tolerance(const sd_radau *radau, double of_unknowns)
{
    return fmax(of_unknowns * DBL_EPSILON / radau->tolerance, fmin(0.03, sqrt(radau->tolerance)));
}

/* what is borne; stages of more have larger round-off */
double sd_radau_newton_tolerance(const sd_radau *radau)
{
    return newton_tolerance(radau, round_off[radau->method - sd_radau_methods]);
}

/* the stages are kept in base */
static void keep(sd_radau *radau)
{
    for (int s = 0; s < radau->method->stages; s++)
        memcpy(radau->base[s], radau->z[s], (size_t)radau->ivp.n * sizeof(double));
}

/* change := what the stages have moved by from base */
static void note_change(const sd_radau *radau, double *const *change)
{
    for (int s = 0; s < radau->method->stages; s++)
        for (int32_t i = 0; i < radau->ivp.n; i++)
            change[s][i] = radau->z[s][i] - radau->base[s][i];
}

/* a correction of the stages with what it was and from where: full, base */
static double noted_correction(sd_radau *radau)
{
    keep(radau);
    double size = sd_radau_correct(radau);
    note_change(radau, radau->full);
    return size;
}

/* x^k, k of at least -1 */
static double whole_power(double x, int k)
{
    double product = k < 0 ? 1.0 / x : 1.0;
    for (; k > 0; k--)
        product *= x;
    return product;
}

/* Newton's iteration for the stages, with fresh slopes each time where `full`; `retry`: factor of the step where it fails */
int sd_radau_iterate(sd_radau *radau, int full, int *used, double *retry)
{
    double tolerance = sd_radau_newton_tolerance(radau);
    double aim = newton_tolerance(radau, aimed_at[radau->method - sd_radau_methods]);
    double before = 0.0, ratio_before = 0.0;
    double trust = radau->ivp.system->steady && sd_radau_factored(radau) ? SOLVED : 1.0;
    int patient = full || radau->ivp.fixed_h > 0.0;
    *retry = 0.5;
    int usual = sd_radau_iterations(radau), most = patient ? PATIENT : usual, converged = 0, idle = 0;
    for (int m = 1; m <= most + (radau->ivp.system->scales > 0); m++) {
        int cause = sd_radau_residuals(radau);
        if (cause)
            return cause;
        if (converged && (rows_hold(radau, tolerance, 0) || (idle && rows_at_round_off(radau, tolerance, 1))))
            return SD_FINE;
        if (m > most)
            break;
        if (m > 1 && radau->ivp.system->scales > 0)
            note_change(radau, radau->moved);
        double size = radau->ivp.system->scales > 0 ? noted_correction(radau) : sd_radau_correct(radau);
        *used = trust < 1.0 && m == 1 ? 2 : m; /* steps grow no longer for it */
        if (!isfinite(size))
            return SD_NEWTON;
        converged = 0;
        if (m > 1) {
            double ratio = size / before;
            radau->theta = m == 2 ? ratio : sqrt(ratio * ratio_before);
            ratio_before = ratio;
            const int faint = ratio > SLOW && size < fmin(1.0, FAINTEST / radau->ivp.rtol);
            const int borne = faint && sd_radau_state_moved(radau) < tolerance;
            converged = borne;
            if (!(radau->theta < SLOW) && !(full && m < PATIENT / 2)) {
                if (size > STAGNANT * tolerance && !borne)
                    return SD_NEWTON;
                converged = 1;
            }
            trust = radau->theta < SLOW ? radau->theta / (1.0 - radau->theta) : 1.0 / DBL_EPSILON;
            double end = trust * size * whole_power(radau->theta, usual - 1 - m) / tolerance;
            if (!converged && !patient && end >= 1.0 && trust * size > tolerance) {
                double far = fmax(1e-4, fmin(20.0, end));
                *retry = 0.8 * pow(far, -1.0 / (radau->method->stages + usual - m));
                return SD_NEWTON;
            }
        }
        idle = m > 1 && size <= STAGNANT * tolerance && !(size < SLOW * before);
        int as_aimed = trust * size <= aim || m == most || (m > 1 && size > FADING * before);
        before = fmax(size, DBL_MIN);
        /* far up an exponential every correction is small */
        converged = converged || (trust * size <= tolerance && as_aimed && !(full && m == 1));
        if (converged && radau->ivp.system->scales == 0)
            return SD_FINE;
        if (full) {
            radau->old_jacobian = 0;
            if ((cause = sd_radau_factorise(radau, 1)))
                return cause;
        }
    }
    return SD_NEWTON;
}

/* z := base + part (z_full - base) */
static void move(sd_radau *radau, double part)
{
    for (int s = 0; s < radau->method->stages; s++)
        for (int32_t i = 0; i < radau->ivp.n; i++)
            radau->z[s][i] = radau->base[s][i] + part * radau->full[s][i];
}

/* the part of the correction `full` of size `size` that is taken: the next one with the same factors is smaller
 * (natural monotonicity, Deuflhard 2004); residuals in d.  0: there is none */
static double damped_part(sd_radau *radau, double size)
{
    for (double part = 1.0; part >= LEAST_PART; part *= 0.5) {
        move(radau, part);
        int cause = sd_radau_residuals(radau);
        if (cause == SD_STOPPED)
            return 0.0;
        if (cause == SD_FINE) {
            memcpy(radau->first, radau->d[0], (size_t)radau->ivp.n * sizeof(double));
            double next = sd_radau_correct(radau);
            move(radau, part);
            memcpy(radau->d[0], radau->first, (size_t)radau->ivp.n * sizeof(double));
            /* up an exponential every correction is as large as the last */
            if (next <= size * (part < 1.0 ? 1.0 - 0.25 * part : 1.0)) {
                radau->theta = next / size;
                return part;
            }
        }
    }
    return 0.0;
}

/* The full correction at the present stages, with fresh slopes: base and full, its size; z has it.  known: d holds the
 * residuals there; lean: of sd_radau_lean, 0: slopes are as they are. */
static int full_correction(sd_radau *radau, int known, int lean, double *size)
{
    radau->old_jacobian = 0;
    int cause = sd_radau_factorise(radau, 1);
    if (cause || (lean && (cause = sd_radau_lean(radau, lean))))
        return cause;
    if (!known && (cause = sd_radau_residuals(radau)))
        return cause;
    *size = noted_correction(radau);
    return isfinite(*size) ? SD_FINE : SD_NEWTON;
}

/* the stages as they were kept */
static void take_back(sd_radau *radau)
{
    for (int s = 0; s < radau->method->stages; s++)
        memcpy(radau->z[s], radau->base[s], (size_t)radau->ivp.n * sizeof(double));
}

/* The part of a correction that is taken, whose factors leave columns as this way does; 0: none, or `cause` says why; -1:
 * the stages hold, or as well as round-off of unknowns to SD_NOISE lets them, the slopes being those of the point.  first:
 * no correction was taken before; else d holds the residuals for the first way. */
static double walk(sd_radau *radau, size_t way, double tolerance, int first, int *cause)
{
    double size;
    sd_radau_leave_below(radau, ways[way].null_pivot);
    *cause = full_correction(radau, !first && way == 0, ways[way].lean, &size);
    sd_radau_leave_below(radau, SD_LEAST_PIVOT);
    if (*cause)
        return 0.0;
    if (columns_left(radau) && radau->state_size <= tolerance && radau->linear->left_over > FINEST_ROW)
        return 0.0; /* a column whose row tells something is not to be left */
    if (radau->state_size <= tolerance && sd_radau_residuals(radau) == SD_FINE &&
        (rows_hold(radau, tolerance, 1) || rows_at_round_off(radau, tolerance, !first)))
        return -1.0;
    if (columns_left(radau) && size <= STAGNANT * tolerance)
        return 0.0; /* what is left of the rows is for the columns that were left */
    return damped_part(radau, fmax(size, DBL_MIN));
}

/* Newton's iteration from the last point, with fresh slopes each time and corrections shortened where they lead astray: for
 * steep laws.  What follows from the state through slopes near round-off does not converge (on the tail of an exponential
 * every correction is 1/a, on its underflow it is noise).  So the state is judged by its correction, the rest by the rows,
 * each in the scale of its terms; and slopes count that are faint only where those above them mend nothing.  (An extrapolated
 * point may lie far up an exponential, from where it is 1/a at a time.) */
int sd_radau_iterate_damped(sd_radau *radau, int *used)
{
    double tolerance = sd_radau_newton_tolerance(radau);
    for (int s = 0; s < radau->method->stages; s++)
        memset(radau->z[s], 0, (size_t)radau->ivp.n * sizeof(double));
    for (int m = 1; m <= WALK; m++) {
        double part = 0.0;
        *used = m;
        keep(radau);
        for (size_t k = 0; k < sizeof ways / sizeof *ways && part == 0.0; k++) {
            int cause;
            if (k > 0)
                take_back(radau);
            part = walk(radau, k, tolerance, m == 1, &cause);
            if (part < 0.0) {
                radau->theta = 1.0; /* slopes that lean are of this step alone */
                return SD_FINE;
            }
            if (cause == SD_STOPPED || cause == SD_MEMORY)
                return cause;
        }
        if (part == 0.0 || (m >= DAMPED && part < 1.0))
            return *radau->ivp.system->stop ? SD_STOPPED : SD_NEWTON;
        note_change(radau, radau->moved);
    }
    return SD_NEWTON;
}
