/* The stages of Rodas5P: slopes, factors, linear systems, and the polynomial through the step (see rosenbrock.h). */
#include "steppers/rosenbrock/rosenbrock.h"
#include "linear/lanes.h"
#include "steppers/combine.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define STAGES SD_ROSENBROCK_STAGES
#define SLOPE 1e-6         /* of the step: over which dF/dt is taken */
#define TELLS 1e-8         /* of the longest step: over that, or the step, at least, for differences over less are round-off */
#define RESOLVED 64.0      /* of what t resolves: at least that */

int sd_rosenbrock_residual(sd_rosenbrock *rosenbrock, double t, const double *y, const double *yd, double *r)
{
    sd_residual(rosenbrock->ivp.system, t, y, yd, r);
    if (*rosenbrock->ivp.system->stop)
        return SD_STOPPED;
    if (sd_finite(rosenbrock->ivp.n, r))
        return SD_FINE;
    rosenbrock->ivp.bad_row = sd_first_bad(rosenbrock->ivp.n, r);
    return SD_NONFINITE;
}

int sd_rosenbrock_linearise(sd_rosenbrock *rosenbrock)
{
    sd_system *system = rosenbrock->ivp.system;
    double t = rosenbrock->ivp.t, *drift = rosenbrock->drift, *jy = rosenbrock->jy, *jyd = rosenbrock->jyd;
    const int known = rosenbrock->sloped, lasting = rosenbrock->lasting;
    int32_t bad = -1;
    if (!known && !lasting)
        bad = sd_jacobian(system, t, rosenbrock->phi, rosenbrock->yd, rosenbrock->ivp.magnitude, jy, jyd);
    rosenbrock->sloped = 0;
    if (*system->stop)
        return SD_STOPPED;
    if (bad >= 0) {
        rosenbrock->ivp.bad_row = bad;
        return SD_NONFINITE;
    }
    rosenbrock->rates = lasting ? rosenbrock->rates : 0;
    rosenbrock->lasting = system->steady;
    for (int32_t j = 0; j < rosenbrock->ivp.n && !lasting; j++)
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            if (jyd[e] != 0.0) {
                rosenbrock->e[rosenbrock->rates] = jyd[e];
                rosenbrock->rate_row[rosenbrock->rates] = system->row[e];
                rosenbrock->rate_column[rosenbrock->rates++] = j;
            }
    double over = fmax(SLOPE * rosenbrock->ivp.h, fmin(rosenbrock->ivp.h, TELLS * rosenbrock->ivp.h_max));
    double later = t + fmax(over, RESOLVED * DBL_EPSILON * fabs(t));
    int cause = known ? SD_FINE : sd_rosenbrock_residual(rosenbrock, t, rosenbrock->phi, rosenbrock->yd, rosenbrock->begin);
    if (cause == SD_FINE)
        cause = sd_rosenbrock_residual(rosenbrock, later, rosenbrock->phi, rosenbrock->yd, drift);
    for (int32_t i = 0; i < rosenbrock->ivp.n; i++)
        drift[i] = (drift[i] - rosenbrock->begin[i]) / (later - t);
    return cause;
}

int sd_rosenbrock_factorise(sd_rosenbrock *rosenbrock)
{
    double lead = 1.0 / (sd_rosenbrock_gamma * rosenbrock->ivp.h);
    for (int32_t e = 0; e < rosenbrock->ivp.system->entries; e++)
        rosenbrock->g[e] = rosenbrock->jy[e] + lead * rosenbrock->jyd[e];
    int failed = sd_linear_factor(rosenbrock->linear, rosenbrock->g, rosenbrock->ivp.magnitude);
    rosenbrock->ivp.bad_row = rosenbrock->linear->bad_row;
    rosenbrock->ivp.bad_column = rosenbrock->linear->bad_column;
    return failed == 2 ? SD_MEMORY : failed ? SD_SINGULAR : SD_FINE;
}

/* y, rate [n] := Y_s, Z_s;  v[s] := Z_s + s_s: from unknown i on, and from i2 on */
static inline __attribute__((always_inline)) void place_lanes(sd_rosenbrock *rosenbrock, int s, int32_t i, int32_t i2)
{
    const double *a = sd_rosenbrock_a[s], *c = sd_rosenbrock_coupling[s], over = 1.0 / rosenbrock->ivp.h;
    double *const *u = rosenbrock->u, *const *v = rosenbrock->v;
    sd_lanes y = SD_FROM(rosenbrock->phi, i), z = SD_FROM(rosenbrock->yd, i), lag = {0.0};
    sd_lanes y2 = SD_FROM(rosenbrock->phi, i2), z2 = SD_FROM(rosenbrock->yd, i2), lag2 = {0.0};
    for (int j = 0; j < s; j++) {
        y += a[j] * SD_FROM(u[j], i);
        z += a[j] * SD_FROM(v[j], i);
        lag += c[j] * SD_FROM(u[j], i);
        if (i2 != i) {
            y2 += a[j] * SD_FROM(u[j], i2);
            z2 += a[j] * SD_FROM(v[j], i2);
            lag2 += c[j] * SD_FROM(u[j], i2);
        }
    }
    SD_AT(rosenbrock->y, i) = y;
    SD_AT(rosenbrock->rate, i) = z;
    SD_AT(rosenbrock->v[s], i) = z + over * lag;
    if (i2 != i) {
        SD_AT(rosenbrock->y, i2) = y2;
        SD_AT(rosenbrock->rate, i2) = z2;
        SD_AT(rosenbrock->v[s], i2) = z2 + over * lag2;
    }
}

/* two lanes at a time read the coefficients once */
static SD_WIDE void place(sd_rosenbrock *rosenbrock, int s)
{
    const int32_t n = rosenbrock->ivp.n;
    int32_t i = 0;
    for (; i + SD_LANES < n; i += 2 * SD_LANES)
        place_lanes(rosenbrock, s, i, i + SD_LANES);
    if (i < n)
        place_lanes(rosenbrock, s, i, i);
}

/* u[s] := -F_s - d_s h T, where u[s] is F_s */
static SD_WIDE void turn(sd_rosenbrock *rosenbrock, int s)
{
    double *u = rosenbrock->u[s], dt = sd_rosenbrock_d[s] * rosenbrock->ivp.h;
    for (int32_t i = 0; i < rosenbrock->ivp.n; i += SD_LANES)
        SD_AT(u, i) = -SD_FROM(u, i) - dt * SD_FROM(rosenbrock->drift, i);
}

/* u[s] += E v[s] */
static void add_moved(sd_rosenbrock *rosenbrock, int s)
{
    double *u = rosenbrock->u[s], *v = rosenbrock->v[s];
    for (int32_t k = 0; k < rosenbrock->rates; k++)
        u[rosenbrock->rate_row[k]] += rosenbrock->e[k] * v[rosenbrock->rate_column[k]];
}

/* v[s] := u[s] / (gamma h) - v[s] */
static SD_WIDE void close(sd_rosenbrock *rosenbrock, int s)
{
    double *u = rosenbrock->u[s], *v = rosenbrock->v[s], lead = 1.0 / (sd_rosenbrock_gamma * rosenbrock->ivp.h);
    for (int32_t i = 0; i < rosenbrock->ivp.n; i += SD_LANES)
        SD_AT(v, i) = lead * SD_FROM(u, i) - SD_FROM(v, i);
}

int sd_rosenbrock_stages(sd_rosenbrock *rosenbrock)
{
    for (int s = 0; s < STAGES; s++) {
        double *u = rosenbrock->u[s], t = rosenbrock->ivp.t + sd_rosenbrock_c[s] * rosenbrock->ivp.h;
        place(rosenbrock, s);
        int cause = SD_FINE;
        if (s == 0)
            memcpy(u, rosenbrock->begin, (size_t)rosenbrock->ivp.n * sizeof *u);
        else if ((cause = sd_rosenbrock_residual(rosenbrock, t, rosenbrock->y, rosenbrock->rate, u)))
            return cause;
        turn(rosenbrock, s);
        add_moved(rosenbrock, s);
        sd_linear_solve(rosenbrock->linear, u);
        close(rosenbrock, s);
    }
    return SD_FINE;
}

SD_WIDE void sd_rosenbrock_bend(sd_rosenbrock *rosenbrock)
{
    for (int k = 0; k < SD_ROSENBROCK_DENSE; k++)
        sd_combine(STAGES, rosenbrock->ivp.n, sd_rosenbrock_dense_weight[k], rosenbrock->u, rosenbrock->bend[k]);
}

void sd_rosenbrock_polynomial(const sd_rosenbrock *rosenbrock, const double *y0, const double *y1, double h, double x,
                              double *y, double *yd)
{
    double left = 1.0 - x, *const *b = rosenbrock->bend;
    for (int32_t i = 0; i < rosenbrock->ivp.n; i++) {
        double change = y1[i] - y0[i];
        double inner = b[0][i] + x * (b[1][i] + x * b[2][i]), inner_d = b[1][i] + 2.0 * x * b[2][i];
        y[i] = y0[i] + x * (change + left * inner);
        if (yd)
            yd[i] = (change + (left - x) * inner + x * left * inner_d) / h;
    }
}
