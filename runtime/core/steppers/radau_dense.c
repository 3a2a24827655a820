/* Values between the ends of a step of Radau IIA, and the guess for the next (see radau.h). */
#include "steppers/radau.h"

#include <string.h>

#define PULLED 4.0 /* steps resolve what is slower: measured on HIRES, whose rows within steps were 30 times worse */

void sd_radau_gaps(double gap[SD_METHODS][SD_STAGES + 1][SD_STAGES + 1])
{
    for (int k = 0; k < SD_METHODS; k++) {
        const sd_radau_method *method = &sd_radau_methods[k];
        for (int i = 0; i <= method->stages; i++)
            for (int j = 0; j <= method->stages; j++)
                gap[k][i][j] = i == j ? 0.0 : 1.0 / ((i ? method->c[i - 1] : 0.0) - (j ? method->c[j - 1] : 0.0));
    }
}

/* Lagrange weights of the nodes 0, c_1, ..., c_s = 1 at x */
static void lagrange_value(const sd_radau *radau, const sd_radau_method *method, double x, double *value)
{
    const double(*gap)[SD_STAGES + 1] = radau->gap[method - sd_radau_methods];
    double far[SD_STAGES + 1] = {x};
    for (int j = 0; j < method->stages; j++)
        far[j + 1] = x - method->c[j];
    for (int i = 0; i <= method->stages; i++) {
        value[i] = 1.0;
        for (int j = 0; j <= method->stages; j++)
            value[i] *= j == i ? 1.0 : far[j] * gap[i][j];
    }
}

/* the same, and their derivatives by x */
static void lagrange(const sd_radau *radau, const sd_radau_method *method, double x, double *value, double *slope)
{
    const double(*gap)[SD_STAGES + 1] = radau->gap[method - sd_radau_methods];
    double far[SD_STAGES + 1] = {x};
    for (int j = 0; j < method->stages; j++)
        far[j + 1] = x - method->c[j];
    for (int i = 0; i <= method->stages; i++) {
        double v = 1.0, d = 0.0;
        for (int j = 0; j <= method->stages; j++) {
            if (j == i)
                continue;
            d = (d * far[j] + v) * gap[i][j];
            v *= far[j] * gap[i][j];
        }
        value[i] = v;
        slope[i] = d;
    }
}

/* Hermite weights of values and derivatives at the points x[0..count) at t, and their derivatives:
 * value_i = (1 - 2 (t - x_i) l_i'(x_i)) l_i^2,  rate_i = (t - x_i) l_i^2 */
static void hermite(int count, const double *x, double t, double *value, double *rate, double *value_d, double *rate_d)
{
    for (int i = 0; i < count; i++) {
        double l = 1.0, dl = 0.0, own = 0.0;
        for (int j = 0; j < count; j++) {
            if (j == i)
                continue;
            double q = 1.0 / (x[i] - x[j]);
            dl = (dl * (t - x[j]) + l) * q;
            l *= (t - x[j]) * q;
            own += q;
        }
        double far = t - x[i];
        value[i] = (1.0 - 2.0 * far * own) * l * l;
        value_d[i] = -2.0 * own * l * l + (1.0 - 2.0 * far * own) * 2.0 * l * dl;
        rate[i] = far * l * l;
        rate_d[i] = l * l + far * 2.0 * l * dl;
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

/* steps resolve this unknown's motion: its derivative tells more than the stages alone */
static int led(const sd_radau *radau, int32_t i)
{
    return radau->smooth[i] && radau->pull[i] < PULLED;
}

/* the quintic through values and derivatives at the last three points, for the unknowns that it serves */
static void between_points(const sd_radau *radau, double t, double *y, double *yd)
{
    double from = radau->t - radau->h_used, x[3] = {radau->t, from, from - radau->h_before}, a[3], b[3], ad[3], bd[3];
    int points = radau->taken > 1 ? 3 : 2;
    hermite(points, x, t, a, b, ad, bd);
    for (int32_t i = 0; i < radau->n; i++)
        if (led(radau, i)) {
            double base = radau->last[i]; /* differences against one value: no cancellation of large ones */
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
    double h = radau->h_used, v[SD_STAGES + 1], d[SD_STAGES + 1], by[2];
    lifted(radau, (t - (radau->t - h)) / h, v, d, by);
    for (int32_t i = 0; i < radau->n; i++)
        if (led(radau, i)) {
            double end = radau->phi[i] - radau->last[i], slope = radau->slope[1][i];
            double sum = v[last + 1] * end, rate = d[last + 1] * end;
            for (int s = 0; s < last; s++) {
                sum += v[s + 1] * radau->kept[s][i];
                rate += d[s + 1] * radau->kept[s][i];
            }
            y[i] = radau->last[i] + (sum + h * by[0] * slope);
            yd[i] = rate / h + by[1] * slope;
        }
}

/* the polynomial of the stages for the unknowns that nothing else serves */
static void of_stages(const sd_radau *radau, double t, double *y, double *yd)
{
    const sd_radau_method *method = radau->used;
    double h = radau->h_used, v[SD_STAGES + 1], d[SD_STAGES + 1];
    lagrange(radau, method, (t - (radau->t - h)) / h, v, d);
    for (int32_t i = 0; i < radau->n; i++)
        if (!led(radau, i)) {
            double sum = radau->last[i], rate = 0.0;
            for (int s = 0; s < method->stages; s++) {
                sum += v[s + 1] * radau->kept[s][i];
                rate += d[s + 1] * radau->kept[s][i];
            }
            y[i] = sum;
            yd[i] = rate / h;
        }
}

void sd_radau_dense(const sd_radau *radau, double t, double *y, double *yd)
{
    int32_t n = radau->n;
    if (radau->taken == 0 || t >= radau->t) {
        memcpy(y, radau->phi, (size_t)n * sizeof *y);
        memcpy(yd, radau->yd, (size_t)n * sizeof *yd);
        return;
    }
    of_stages(radau, t, y, yd);
    if (radau->used->stages > 3)
        between_stages(radau, t, y, yd);
    else
        between_points(radau, t, y, yd);
}

void sd_radau_refine(sd_radau *radau, sd_settle *settle)
{
    const double *value[SD_POINTS] = {radau->phi, radau->last, radau->before};
    double t[SD_POINTS] = {radau->t, radau->t - radau->h_used, radau->t - radau->h_used - radau->h_before};
    size_t size = (size_t)radau->n * sizeof(double);
    int32_t n = radau->n < settle->whole ? radau->n : settle->whole;
    for (int k = 0; k < SD_POINTS && k <= radau->taken; k++) {
        if (radau->refined[k])
            continue;
        memcpy(radau->point, value[k], size);
        memcpy(radau->point_d, radau->slope[k], size);
        if (sd_settle_point(settle, t[k], radau->point, radau->point_d) == 0)
            for (int32_t i = 0; i < n; i++)
                if (radau->smooth[i])
                    radau->slope[k][i] = radau->point_d[i];
        radau->refined[k] = 1;
    }
}

int sd_radau_astray(sd_radau *radau)
{
    const sd_radau_method *method = radau->method;
    for (int k = 0; k + 1 < method->stages; k++) {
        double between = 0.5 * (method->c[k] + method->c[k + 1]); /* in the middle of the wider gaps */
        double v[SD_STAGES + 1], d[SD_STAGES + 1], at = radau->t + between * radau->h;
        lagrange(radau, method, between, v, d);
        for (int32_t i = 0; i < radau->n; i++) {
            double sum = radau->phi[i], rate = 0.0;
            for (int s = 0; s < method->stages; s++) {
                sum += v[s + 1] * radau->z[s][i];
                rate += d[s + 1] * radau->z[s][i];
            }
            radau->y[i] = sum;
            radau->rate[i] = rate / radau->h;
        }
        sd_residual(radau->system, at, radau->y, radau->rate, radau->d[0]);
        if (sd_first_astray(radau->system, at, radau->y, radau->rate, radau->d[0], radau->jy, radau->jyd, radau->h,
                            radau->magnitude, radau->terms) >= 0)
            return 1;
    }
    return 0;
}

void sd_radau_extrapolate(sd_radau *radau, double h)
{
    const sd_radau_method *used = radau->used;
    int last = used->stages - 1;
    for (int s = 0; s < radau->method->stages; s++) {
        double *z = radau->z[s], v[SD_STAGES + 1];
        if (radau->taken == 0) {
            memset(z, 0, (size_t)radau->n * sizeof *z);
            continue;
        }
        lagrange_value(radau, used, 1.0 + radau->method->c[s] * h / radau->h_used, v);
        for (int32_t i = 0; i < radau->n; i++) {
            double sum = 0.0;
            for (int j = 0; j < last; j++)
                sum += v[j + 1] * radau->kept[j][i];
            z[i] = sum + (v[last + 1] - 1.0) * radau->kept[last][i];
        }
    }
}
