/* The stages of Rodas5P: slopes, factors, linear systems, and the polynomial through the step (see rosenbrock.h). */
#include "steppers/rosenbrock/rosenbrock.h"
#include "linear/lanes.h"
#include "steppers/combine.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define STAGES SD_ROSENBROCK_STAGES
#define SLOPE SD_UNSEEN /* of the step: over which dF/dt is taken */
#define TELLS SD_HALF_OF_ITS_DIGITS /* of the longest step: over that, or the step, at least, for differences over less are round-off */
#define RESOLVED 64.0      /* of what t resolves: at least that */
#define ENDS 6             /* the first of the stages that add no more than the u of the one before to its point */

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
    if (failed)
        return failed == 2 ? SD_MEMORY : SD_SINGULAR;
    return sd_outgrown(&rosenbrock->ivp, rosenbrock->linear, rosenbrock->jy, rosenbrock->jyd, lead, rosenbrock->g,
                       rosenbrock->ivp.magnitude);
}

/* x[i .. i + SD_LANES) of what was just written number by number: loaded whole it would have to wait for that */
#define IN_PARTS(x, i) ((sd_lanes){(x)[i], (x)[(i) + 1], (x)[(i) + 2], (x)[(i) + 3]})

/* y, rate, known := Y_s, Z_s, W_s, from unknown i on; s: a number that is known when this is compiled */
static inline __attribute__((always_inline)) void place_lanes(sd_rosenbrock *rosenbrock, const int s, int32_t i)
{
    const double *a = sd_rosenbrock_a[s], *b = sd_rosenbrock_rate[s], *w = sd_rosenbrock_known[s];
    const double over = 1.0 / rosenbrock->ivp.h;
    double *const *u = rosenbrock->u;
    const sd_lanes last = IN_PARTS(u[s - 1], i);
    sd_lanes known = w[s - 1] * last;
#pragma GCC unroll 8
    for (int j = 0; j < s - 1; j++)
        known += w[j] * SD_FROM(u[j], i);
    known *= over;
    if (s >= ENDS) { /* the point of the stage before and its u; known has no part of z */
        const double lead = over / sd_rosenbrock_gamma;
        SD_AT(rosenbrock->y, i) = SD_FROM(rosenbrock->y, i) + last;
        SD_AT(rosenbrock->rate, i) = SD_FROM(rosenbrock->rate, i) + (lead * last - SD_FROM(rosenbrock->known, i));
        SD_AT(rosenbrock->known, i) = known;
        return;
    }
    const sd_lanes begin = sd_rosenbrock_begin[s] * SD_FROM(rosenbrock->yd, i);
    sd_lanes y = a[s - 1] * last, rate = b[s - 1] * last;
#pragma GCC unroll 8
    for (int j = 0; j < s - 1; j++) {
        y += a[j] * SD_FROM(u[j], i);
        rate += b[j] * SD_FROM(u[j], i);
    }
    SD_AT(rosenbrock->y, i) = SD_FROM(rosenbrock->phi, i) + y;
    SD_AT(rosenbrock->rate, i) = begin + over * rate;
    SD_AT(rosenbrock->known, i) = begin + known;
}

static inline __attribute__((always_inline)) void place_all(sd_rosenbrock *rosenbrock, const int s)
{
    for (int32_t i = 0; i < rosenbrock->ivp.n; i += SD_LANES)
        place_lanes(rosenbrock, s, i);
}

static SD_WIDE void place(sd_rosenbrock *rosenbrock, int s)
{
    switch (s) {
    case 1: place_all(rosenbrock, 1); break;
    case 2: place_all(rosenbrock, 2); break;
    case 3: place_all(rosenbrock, 3); break;
    case 4: place_all(rosenbrock, 4); break;
    case 5: place_all(rosenbrock, 5); break;
    case 6: place_all(rosenbrock, 6); break;
    default: place_all(rosenbrock, 7);
    }
}

/* u[s] := -f - d_s h T + E known: the right side of a stage whose residual is f */
static SD_WIDE void turn(sd_rosenbrock *rosenbrock, int s, const double *f, const double *known)
{
    const int32_t n = rosenbrock->ivp.n;
    double *u = rosenbrock->u[s], dt = sd_rosenbrock_d[s] * rosenbrock->ivp.h;
    for (int32_t i = 0; i < n; i += SD_LANES)
        SD_AT(u, i) = -IN_PARTS(f, i) - dt * SD_FROM(rosenbrock->drift, i);
    const int32_t *row = rosenbrock->rate_row, *column = rosenbrock->rate_column;
    for (int32_t k = 0; k < rosenbrock->rates; k++)
        u[row[k]] += rosenbrock->e[k] * known[column[k]];
}

/* end, rate := the end of the step and its rates */
static SD_WIDE void close(sd_rosenbrock *rosenbrock)
{
    const double lead = 1.0 / (sd_rosenbrock_gamma * rosenbrock->ivp.h);
    for (int32_t i = 0; i < rosenbrock->ivp.n; i += SD_LANES) {
        const sd_lanes last = IN_PARTS(rosenbrock->u[STAGES - 1], i);
        SD_AT(rosenbrock->end, i) = SD_FROM(rosenbrock->y, i) + last;
        SD_AT(rosenbrock->rate, i) = SD_FROM(rosenbrock->rate, i) + (lead * last - SD_FROM(rosenbrock->known, i));
    }
}

/* all stages; each residual is looked at where `judged` */
static int pass(sd_rosenbrock *rosenbrock, int judged)
{
    sd_system *system = rosenbrock->ivp.system;
    turn(rosenbrock, 0, rosenbrock->begin, rosenbrock->yd);
    sd_linear_solve(rosenbrock->linear, rosenbrock->u[0]);
    for (int s = 1; s < STAGES; s++) {
        double *u = rosenbrock->u[s], t = rosenbrock->ivp.t + sd_rosenbrock_c[s] * rosenbrock->ivp.h;
        int cause = SD_FINE;
        place(rosenbrock, s);
        if (judged)
            cause = sd_rosenbrock_residual(rosenbrock, t, rosenbrock->y, rosenbrock->rate, u);
        else
            sd_residual(system, t, rosenbrock->y, rosenbrock->rate, u);
        if (cause || *system->stop)
            return cause ? cause : SD_STOPPED;
        turn(rosenbrock, s, u, rosenbrock->known);
        sd_linear_solve(rosenbrock->linear, u);
    }
    close(rosenbrock);
    return SD_FINE;
}

/* what is no number in any residual is none at the end, to which each u adds: only then is it looked for */
int sd_rosenbrock_stages(sd_rosenbrock *rosenbrock)
{
    int cause = pass(rosenbrock, 0);
    return cause || sd_finite(rosenbrock->ivp.n, rosenbrock->end) ? cause : pass(rosenbrock, 1);
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
