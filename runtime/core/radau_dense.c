/* Values between the ends of a step of Radau IIA, and the guess for the next (see radau.h). */
#include "radau.h"

#include <string.h>

#define PULLED 4.0 /* steps resolve what is slower: measured on HIRES, whose rows within steps were 30 times worse */

static const double node[SD_STAGES + 1] = {0.0, 0.15505102572168219018, 0.64494897427831780982, 1.0};

/* in the middle of the wider gaps between the nodes */
static const double between[2] = {0.4, 0.82247448713915890491};

/* Lagrange weights of the nodes 0, c1, c2, 1 at s, and their derivatives by s */
static void cubic(double s, double *value, double *slope)
{
    for (int i = 0; i <= SD_STAGES; i++) {
        double v = 1.0, d = 0.0;
        for (int j = 0; j <= SD_STAGES; j++) {
            if (j == i)
                continue;
            double q = 1.0 / (node[i] - node[j]);
            d = (d * (s - node[j]) + v) * q;
            v *= (s - node[j]) * q;
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

void sd_radau_dense(const sd_radau *radau, double t, double *y, double *yd)
{
    int32_t n = radau->n;
    if (radau->taken == 0 || t >= radau->t) {
        memcpy(y, radau->phi, (size_t)n * sizeof *y);
        memcpy(yd, radau->yd, (size_t)n * sizeof *yd);
        return;
    }
    double h = radau->h_used, from = radau->t - h, v[SD_STAGES + 1], d[SD_STAGES + 1];
    double x[3] = {radau->t, from, from - radau->h_before}, a[3], b[3], ad[3], bd[3];
    int points = radau->taken > 1 ? 3 : 2;
    cubic((t - from) / h, v, d);
    hermite(points, x, t, a, b, ad, bd);
    for (int32_t i = 0; i < n; i++) {
        if (radau->smooth[i] && radau->pull[i] < PULLED) {
            double base = radau->last[i]; /* differences against one value: no cancellation of large ones */
            double end = radau->phi[i] - base, old = points > 2 ? radau->before[i] - base : 0.0;
            double d0 = radau->slope[0][i], d1 = radau->slope[1][i];
            y[i] = base + a[0] * end + b[0] * d0 + b[1] * d1;
            yd[i] = ad[0] * end + bd[0] * d0 + bd[1] * d1;
            if (points > 2) {
                y[i] += a[2] * old + b[2] * radau->slope[2][i];
                yd[i] += ad[2] * old + bd[2] * radau->slope[2][i];
            }
        } else {
            const double z1 = radau->kept[0][i], z2 = radau->kept[1][i], z3 = radau->kept[2][i];
            y[i] = radau->last[i] + v[1] * z1 + v[2] * z2 + v[3] * z3;
            yd[i] = (d[1] * z1 + d[2] * z2 + d[3] * z3) / h;
        }
    }
}

void sd_radau_refine(sd_radau *radau, sd_settle *settle)
{
    const double *value[SD_STAGES] = {radau->phi, radau->last, radau->before};
    double t[SD_STAGES] = {radau->t, radau->t - radau->h_used, radau->t - radau->h_used - radau->h_before};
    size_t size = (size_t)radau->n * sizeof(double);
    int32_t n = radau->n < settle->whole ? radau->n : settle->whole;
    for (int k = 0; k < SD_STAGES && k <= radau->taken; k++) {
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
    for (int k = 0; k < 2; k++) {
        double v[SD_STAGES + 1], d[SD_STAGES + 1], at = radau->t + between[k] * radau->h;
        cubic(between[k], v, d);
        for (int32_t i = 0; i < radau->n; i++) {
            const double z1 = radau->z[0][i], z2 = radau->z[1][i], z3 = radau->z[2][i];
            radau->y[i] = radau->phi[i] + v[1] * z1 + v[2] * z2 + v[3] * z3;
            radau->rate[i] = (d[1] * z1 + d[2] * z2 + d[3] * z3) / radau->h;
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
    int32_t n = radau->n;
    for (int s = 0; s < SD_STAGES; s++) {
        double *z = radau->z[s], v[SD_STAGES + 1], d[SD_STAGES + 1];
        if (radau->taken == 0) {
            memset(z, 0, (size_t)n * sizeof *z);
            continue;
        }
        cubic(1.0 + node[s + 1] * h / radau->h_used, v, d);
        for (int32_t i = 0; i < n; i++)
            z[i] = v[1] * radau->kept[0][i] + v[2] * radau->kept[1][i] + (v[3] - 1.0) * radau->kept[2][i];
    }
}
