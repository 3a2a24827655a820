/* Values between the ends of a step of Radau IIA, and the guess for the next (see radau.h). */
#include "linear/lanes.h"
#include "steppers/radau/radau.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MANY 100.0 /* unknowns up to which each is asked for what the error test asks of all */
#define TELLS 1e-3 /* tolerances by which slopes move an unknown, from which on what follows tells how it does */
#define TOLD 1.0   /* tolerances that what follows moves by: less tells nothing, and does no harm */
#define FINE 1e-10   /* below it flows near round-off of displacements are told by slopes alone (a valve's chamber) */
#define FOLLOWS 100.0 /* times as many by which what follows may move with it: then a state is no state for rows */

void sd_radau_gaps(double gap[SD_METHODS][SD_STAGES + 1][SD_STAGES + 1])
{
    for (int k = 0; k < SD_METHODS; k++) {
        const sd_radau_method *method = &sd_radau_methods[k];
        for (int i = 0; i <= method->stages; i++) {
            gap[k][i][i] = 1.0;
            for (int j = 0; j <= method->stages; j++)
                if (j != i) {
                    gap[k][i][j] = 1.0 / ((i ? method->c[i - 1] : 0.0) - (j ? method->c[j - 1] : 0.0));
                    gap[k][i][i] *= gap[k][i][j];
                }
        }
    }
}

/* Lagrange weights of the nodes 0, c_1, ..., c_s = 1 at x, and their derivatives by x where they are asked for (slope NULL:
 * they are not): products of what lies before and behind each node */
static inline void lagrange(const sd_radau *radau, const sd_radau_method *method, double x, double *value, double *slope)
{
    const double(*gap)[SD_STAGES + 1] = radau->gap[method - sd_radau_methods];
    double far[SD_STAGES + 1] = {x}, behind[SD_STAGES + 2], behind_d[SD_STAGES + 2], before = 1.0, before_d = 0.0;
    int s = method->stages;
    for (int j = 0; j < s; j++)
        far[j + 1] = x - method->c[j];
    behind[s + 1] = 1.0;
    behind_d[s + 1] = 0.0;
    for (int i = s; i > 0; i--) {
        behind[i] = behind[i + 1] * far[i];
        if (slope)
            behind_d[i] = behind_d[i + 1] * far[i] + behind[i + 1];
    }
    for (int i = 0; i <= s; i++) {
        value[i] = gap[i][i] * before * behind[i + 1];
        if (slope) {
            slope[i] = gap[i][i] * (before_d * behind[i + 1] + before * behind_d[i + 1]);
            before_d = before_d * far[i] + before;
        }
        before *= far[i];
    }
}

void sd_radau_note_points(sd_radau *radau)
{
    double from = radau->ivp.t - radau->ivp.h_used, x[SD_POINTS] = {radau->ivp.t, from, from - radau->h_before};
    int points = radau->ivp.taken > 1 ? SD_POINTS : 2;
    for (int i = 0; i < points; i++) {
        double product = 1.0, sum = 0.0;
        for (int j = 0; j < points; j++)
            if (j != i) {
                double q = 1.0 / (x[i] - x[j]);
                product *= q;
                sum += q;
            }
        radau->apart[i] = product;
        radau->bend[i] = 2.0 * sum;
    }
}

/* Hermite weights of values and derivatives at the last three points at t, and their derivatives:
 * value_i = (1 - 2 (t - x_i) l_i'(x_i)) l_i^2,  rate_i = (t - x_i) l_i^2 */
static void hermite(const sd_radau *radau, double t, double *value, double *rate, double *value_d, double *rate_d)
{
    double end = t - radau->ivp.t, begin = end + radau->ivp.h_used, old = begin + radau->h_before;
    int points = radau->ivp.taken > 1 ? SD_POINTS : 2;
    double far[SD_POINTS] = {end, begin, points > 2 ? old : 1.0};
    double d2 = points > 2 ? 1.0 : 0.0;
    double l[SD_POINTS] = {far[1] * far[2], far[0] * far[2], far[0] * far[1]};
    double dl[SD_POINTS] = {far[2] + d2 * far[1], far[2] + d2 * far[0], far[0] + far[1]};
    for (int i = 0; i < points; i++) {
        double own = l[i] * radau->apart[i], own_d = dl[i] * radau->apart[i];
        double square = own * own, square_d = 2.0 * own * own_d, lean = 1.0 - far[i] * radau->bend[i];
        value[i] = lean * square;
        value_d[i] = lean * square_d - radau->bend[i] * square;
        rate[i] = far[i] * square;
        rate_d[i] = square + far[i] * square_d;
    }
}

/* weights of z [stages], of h y' at the start in by_slope, of the polynomial of the stages and that slope at x, and their
 * derivatives by x */
static void lifted(const sd_radau *radau, double x, double *value, double *slope, double *by_slope)
{
    const sd_radau_method *method = radau->used;
    double zero[SD_STAGES + 1], begin[SD_STAGES + 1], l = 0.0, ld = 0.0;
    for (int k = method->stages; k >= 0; k--) {
        ld = ld * x + (k + 1) * method->lift[k];
        l = l * x + method->lift[k];
    }
    l *= x;
    lagrange(radau, method, x, value, slope);
    lagrange(radau, method, 0.0, zero, begin);
    for (int i = 0; i <= method->stages; i++) {
        value[i] -= l * begin[i];
        slope[i] -= ld * begin[i];
    }
    by_slope[0] = l;
    by_slope[1] = ld;
}

/* the quintic through values and derivatives at the last three points, for the unknowns that it serves */
static void between_points(const sd_radau *radau, double t, double *y, double *yd)
{
    double a[SD_POINTS], b[SD_POINTS], ad[SD_POINTS], bd[SD_POINTS];
    int points = radau->ivp.taken > 1 ? SD_POINTS : 2;
    hermite(radau, t, a, b, ad, bd);
    for (int32_t i = 0; i < radau->ivp.n; i++)
        if (radau->led[i]) {
            double base = sd_radau_last(radau, i); /* differences against one value: no cancellation of large ones */
            double end = radau->phi[i] - base, old = points > 2 ? radau->before[i] - base : 0.0;
            double d0 = radau->slope[0][i], d1 = radau->slope[1][i];
            y[i] = base + a[0] * end + b[0] * d0 + b[1] * d1;
            yd[i] = ad[0] * end + bd[0] * d0 + bd[1] * d1;
            if (points > 2) {
                y[i] += a[2] * old + b[2] * radau->slope[2][i];
                yd[i] += ad[2] * old + bd[2] * radau->slope[2][i];
            }
        }
}

/* the polynomial of the stages with the derivative at the start, for the unknowns that it serves */
static void between_stages(const sd_radau *radau, double t, double *y, double *yd)
{
    int last = radau->used->stages - 1;
    double h = radau->ivp.h_used, v[SD_STAGES + 1], d[SD_STAGES + 1], by[2];
    lifted(radau, (t - (radau->ivp.t - h)) / h, v, d, by);
    for (int32_t i = 0; i < radau->ivp.n; i++)
        if (radau->led[i]) {
            double base = sd_radau_last(radau, i), end = radau->phi[i] - base, slope = radau->slope[1][i];
            double sum = v[last + 1] * end, rate = d[last + 1] * end;
            for (int s = 0; s < last; s++) {
                sum += v[s + 1] * radau->kept[s][i];
                rate += d[s + 1] * radau->kept[s][i];
            }
            y[i] = base + (sum + h * by[0] * slope);
            yd[i] = rate / h + by[1] * slope;
        }
}

/* the polynomial of the stages for the unknowns that slopes lead, or for the others */
static void of_stages(const sd_radau *radau, double t, char led, double *y, double *yd)
{
    const sd_radau_method *method = radau->used;
    double h = radau->ivp.h_used, v[SD_STAGES + 1], d[SD_STAGES + 1];
    lagrange(radau, method, (t - (radau->ivp.t - h)) / h, v, d);
    for (int32_t i = 0; i < radau->ivp.n; i++)
        if (radau->led[i] == led) {
            double sum = sd_radau_last(radau, i), rate = 0.0;
            for (int s = 0; s < method->stages; s++) {
                sum += v[s + 1] * radau->kept[s][i];
                rate += d[s + 1] * radau->kept[s][i];
            }
            y[i] = sum;
            yd[i] = rate / h;
        }
}

/* the unknowns that slopes lead */
static void of_slopes(const sd_radau *radau, double t, double *y, double *yd)
{
    if (radau->used->stages > 3)
        between_stages(radau, t, y, yd);
    else
        between_points(radau, t, y, yd);
}

void sd_radau_dense(const void *self, double t, double *y, double *yd)
{
    const sd_radau *radau = self;
    int32_t n = radau->ivp.n;
    if (radau->ivp.taken == 0 || t >= radau->ivp.t) {
        memcpy(y, radau->phi, (size_t)n * sizeof *y);
        memcpy(yd, radau->yd, (size_t)n * sizeof *yd);
        return;
    }
    of_stages(radau, t, 0, y, yd);
    of_slopes(radau, t, y, yd);
}

/* In the weights of the error test, which is of the mean: how far one of many unknowns may be off */
static double most_off(const sd_radau *radau)
{
    return radau->ivp.system->scales > 0 ? 1.0 : fmax(1.0, sqrt((double)radau->ivp.n / MANY));
}

/* where slopes are asked what they make of the step: of more stages the first gap is the one that slopes bend */
static double place_of(const sd_radau *radau, int k, int looks)
{
    return radau->ivp.t - radau->ivp.h_used * (1.0 - (looks > 1 ? k / 3.0 : 0.5 * radau->used->c[0]));
}

/* How many tolerances what follows from the state (a node's potential, of two coils that a leak of megohms ties) moves where
 * slopes move the state by one; 0: they do not move it.  The polynomials of the stages have all linear rows in common, those
 * that slopes lead do not: what follows would be what is left between them. */
static double followed(sd_radau *radau, sd_settle *settle)
{
    const size_t n = (size_t)radau->ivp.n;
    double t = place_of(radau, 1, 2), moved = 0.0, most = 0.0;
    double *of = malloc(3 * n * sizeof *of), *y = of + n, *rate = y + n;
    if (!of)
        return 1.0;
    for (int led = 0; led < 2; led++) {
        of_stages(radau, t, 0, y, rate);
        if (led)
            of_slopes(radau, t, y, rate);
        else
            of_stages(radau, t, 1, y, rate);
        for (size_t i = 0; i < n && led; i++)
            if (radau->led[i])
                moved = fmax(moved, fabs(y[i] - radau->ivp.ee[i]) * sd_radau_weight(radau, (int32_t)i));
        if (!led)
            memcpy(radau->ivp.ee, y, n * sizeof *y);
        if ((led && moved < TELLS) || sd_settle_point(settle, t, y, rate)) {
            free(of);
            return 0.0;
        }
        if (!led)
            memcpy(of, y, n * sizeof *y);
    }
    for (size_t i = 0; i < n; i++)
        if (!radau->smooth[i])
            most = fmax(most, fabs(y[i] - of[i]) * sd_radau_weight(radau, (int32_t)i));
    free(of);
    return most > TOLD ? most / moved : 0.0;
}

/* Slopes lead no unknown that they would take further off the polynomial of the stages than the step's error may be, nor
 * what follows from it: there they are of a motion before, or what a stiff law makes of the point's own error. */
static void mistrust(sd_radau *radau)
{
    const int looks = radau->used->stages > 3 ? 1 : 2;
    const double most = most_off(radau) / (radau->follows > FOLLOWS ? radau->follows : 1.0);
    for (int k = 1; k <= looks; k++) {
        double t = place_of(radau, k, looks);
        of_stages(radau, t, 1, radau->y, radau->rate);
        memcpy(radau->ivp.ee, radau->y, (size_t)radau->ivp.n * sizeof(double));
        of_slopes(radau, t, radau->y, radau->rate);
        for (int32_t i = 0; i < radau->ivp.n; i++)
            if (radau->led[i] && !(fabs(radau->y[i] - radau->ivp.ee[i]) * sd_radau_weight(radau, i) <= most))
                radau->led[i] = 0;
    }
}

/* the point that is settled may be room that was lent for it, of which nothing is read from where all unknowns follow from it */
void sd_radau_refine(void *self, sd_settle *settle)
{
    sd_radau *radau = self;
    double last = radau->ivp.t - radau->ivp.h_used, t[SD_POINTS] = {radau->ivp.t, last, last - radau->h_before};
    size_t size = (size_t)radau->ivp.n * sizeof(double);
    int32_t n = settle->seen || radau->ivp.n < settle->unknowns ? radau->ivp.n : settle->unknowns;
    for (int k = 0; k < SD_POINTS && k <= radau->ivp.taken; k++) {
        if (radau->refined[k])
            continue;
        for (int32_t i = 0; i < radau->ivp.n; i++)
            radau->y[i] = k == 0 ? radau->phi[i] : k == 1 ? sd_radau_last(radau, i) : radau->before[i];
        memcpy(radau->rate, radau->slope[k], size);
        if (sd_settle_point(settle, t[k], radau->y, radau->rate) == 0)
            for (int32_t i = 0; i < n; i++)
                if (radau->smooth[i])
                    radau->slope[k][i] = radau->rate[i];
        radau->refined[k] = 1;
    }
    if (radau->ivp.fixed_h > 0.0) /* whose error is nobody's wish */
        return;
    const int asked = radau->follows == 0.0 && radau->ivp.taken > 0 && radau->behind && radau->ivp.rtol >= FINE;
    if (asked && !settle->seen && settle->unknowns == radau->ivp.n)
        radau->follows = followed(radau, settle);
    mistrust(radau);
}

int sd_radau_astray(sd_radau *radau)
{
    const sd_radau_method *method = radau->method;
    for (int k = 0; k + 1 < method->stages; k++) {
        double between = 0.5 * (method->c[k] + method->c[k + 1]); /* in the middle of the wider gaps */
        double v[SD_STAGES + 1], d[SD_STAGES + 1], at = radau->ivp.t + between * radau->ivp.h;
        lagrange(radau, method, between, v, d);
        for (int32_t i = 0; i < radau->ivp.n; i++) {
            double sum = radau->phi[i], rate = 0.0;
            for (int s = 0; s < method->stages; s++) {
                sum += v[s + 1] * radau->z[s][i];
                rate += d[s + 1] * radau->z[s][i];
            }
            radau->y[i] = sum;
            radau->rate[i] = rate / radau->ivp.h;
        }
        sd_residual(radau->ivp.system, at, radau->y, radau->rate, radau->d[0]);
        if (sd_first_astray(radau->ivp.system, at, radau->y, radau->rate, radau->d[0], 0.0, radau->jy, radau->jyd,
                            radau->ivp.h, radau->ivp.magnitude, 0, radau->terms) >= 0)
            return 1;
    }
    return 0;
}

/* x (x - c_1) ... (x - c_s) */
static double bulge(const sd_radau_method *method, double x)
{
    double product = x;
    for (int s = 0; s < method->stages; s++)
        product *= x - method->c[s];
    return product;
}

/* the largest within the step, of 3, 5 and 7 stages: at whole 32nds */
static const double largest_bulge[SD_METHODS] = {0.018115234375000004, 0.0011303157412580085, 6.8477403286893777e-05};

/* The polynomial of the stages leaves the start of the step before by `off`: what that makes of it between the nodes, where
 * the next power of x would be as large.  The estimate at the end sees nothing of it where a stiff law pulls. */
double sd_radau_between(const sd_radau *radau)
{
    const sd_radau_method *method = radau->method;
    double v[SD_STAGES + 1], largest = 0.0;
    if (radau->ivp.taken == 0)
        return 0.0;
    const double before = -radau->ivp.h_used / radau->ivp.h;
    lagrange(radau, method, before, v, NULL);
    for (int32_t i = 0; i < radau->ivp.n; i++)
        if (radau->ivp.test[i] == 0 && !radau->led[i]) {
            double off = radau->phi[i] - sd_radau_last(radau, i);
            for (int s = 0; s < method->stages; s++)
                off += v[s + 1] * radau->z[s][i];
            off = fabs(off) * sd_radau_weight(radau, i);
            largest = off > largest ? off : largest;
        }
    const double most = largest_bulge[method - sd_radau_methods];
    return largest > 0.0 ? largest / most_off(radau) * most / fabs(bulge(method, before)) : 0.0;
}

void sd_radau_extrapolate(sd_radau *radau, double h)
{
    const sd_radau_method *used = radau->used;
    for (int s = 0; s < radau->method->stages; s++) {
        double v[SD_STAGES + 1];
        if (radau->ivp.taken == 0) {
            memset(radau->z[s], 0, (size_t)sd_whole_lanes(radau->ivp.n) * sizeof(double));
            continue;
        }
        lagrange(radau, used, 1.0 + radau->method->c[s] * h / radau->ivp.h_used, v, NULL);
        v[used->stages] -= 1.0; /* of the point that the step begins at */
        sd_radau_combine(used->stages, radau->ivp.n, v + 1, radau->kept, radau->z[s]);
    }
}
