/* Values between the ends of a step of DOP853 (see dopri.h). */
#include "steppers/explicit/dopri.h"

#include "linear/lanes.h"

#include <math.h>
#include <string.h>

#define BEYOND 4.0 /* times the largest slope of a step: one between its stages is no more */
#define EDGE 5.0   /* of h |lambda|: a motion that fast is not what a step follows; the region of stability ends at 6 */
#define NEARER 0.5 /* measured: 1e-5 to 0.04 of what is only fast, 0.9 and beyond (1e4) of stages that lie anywhere */

/* the stages at the nearest instants of the step: guesses of what is solved for */
static const int NEAREST[SD_DOPRI_ALL - SD_DOPRI_STAGES - 1] = {3, 6, 10};

/* the three further stages; 0 done */
static int more_stages(sd_dopri *dopri)
{
    sd_underlying *u = dopri->underlying;
    double from = dopri->ivp.t - dopri->ivp.h_used;
    for (int s = SD_DOPRI_STAGES + 1; s < SD_DOPRI_ALL; s++) {
        const int near = NEAREST[s - SD_DOPRI_STAGES - 1];
        double *y = dopri->y[s];
        sd_dopri_combine(dopri, s, dopri->ivp.h_used);
        memcpy(dopri->rate[s], dopri->rate[near], (size_t)dopri->ivp.n * sizeof *y);
        for (int32_t j = 0; j < u->solved; j++)
            if (!u->rate[j])
                y[u->unknown[j]] = dopri->y[near][u->unknown[j]];
        if (sd_underlying_slopes(u, from + sd_dopri_c[s] * dopri->ivp.h_used, y, dopri->rate[s]))
            return 1;
    }
    return 0;
}

/* Whether further stages lie where a steep law makes anything of them (a diode at 11 V: 1e191 A). */
static int stray(const sd_dopri *dopri)
{
    double *const *k = dopri->rate, h = dopri->ivp.h_used;
    for (int32_t i = 0; i < dopri->ivp.n; i++) {
        double most = 0.0;
        for (int s = 0; s <= SD_DOPRI_STAGES; s++)
            most = fmax(most, fabs(k[s][i]));
        for (int s = SD_DOPRI_STAGES + 1; s < SD_DOPRI_ALL; s++)
            if (h * (fabs(k[s][i]) - BEYOND * most) * dopri->ivp.weight[i] > 1.0)
                return 1;
    }
    return 0;
}

/* a slope at an end, times h, with which a cubic stays between the ends (Fritsch & Carlson, SIAM J. Numer. Anal. 17, 1980) */
static inline double between(double slope, double change)
{
    return slope * change <= 0.0 ? 0.0 : copysign(fmin(fabs(slope), 3.0 * fabs(change)), change);
}

/* f0, f1, f2 of one unknown from what it changes by over the step and its slopes at the ends, all times h */
static inline void cubic(double *const *f, int32_t i, double change, double begin, double end)
{
    f[0][i] = change;
    f[1][i] = begin - change;
    f[2][i] = 2.0 * change - (begin + end);
}

/* sum of a_j k_j of one unknown */
static double sum_of(int terms, const double *a, double *const *k, int32_t i)
{
    double sum = 0.0;
    for (int j = 0; j < terms; j++)
        sum += a[j] * k[j][i];
    return sum;
}

/* of unknowns that are not integrated: the interpolant of their integral */
static void integrals(sd_dopri *dopri, int terms)
{
    const sd_underlying *u = dopri->underlying;
    double h = dopri->ivp.h_used, *const *y = dopri->y, **f = dopri->f;
    for (int32_t j = 0; j < u->solved; j++) {
        int32_t i = u->unknown[j];
        if (u->rate[j])
            continue;
        cubic(f, i, h * sum_of(SD_DOPRI_STAGES, sd_dopri_a[SD_DOPRI_STAGES], y, i), h * y[0][i], h * y[SD_DOPRI_STAGES][i]);
        for (int m = 3; m < SD_DOPRI_DENSE; m++)
            f[m][i] = h * sum_of(terms, sd_dopri_d[m - 3], y, i);
    }
}

/* f [..][n] of all unknowns: of order 7 by all stages, or where these are astray the cubic that stays between both ends */
static void interpolate(sd_dopri *dopri, int astray)
{
    double h = dopri->ivp.h_used, **f = dopri->f, *const *k = dopri->rate;
    const int terms = astray ? 0 : SD_DOPRI_ALL;
    for (int32_t i = 0; i < dopri->ivp.n; i++) {
        double change = dopri->phi[i] - dopri->y[0][i], begin = h * k[0][i], end = h * k[SD_DOPRI_STAGES][i];
        cubic(f, i, change, astray ? between(begin, change) : begin, astray ? between(end, change) : end);
    }
    for (int m = 3; m < SD_DOPRI_DENSE; m++) {
        sd_dopri_add_up(dopri->ivp.n, terms, sd_dopri_d[m - 3], k, f[m]);
        for (int32_t i = 0; i < dopri->ivp.n; i++)
            f[m][i] *= h;
    }
}

/* Whether the interpolant is nearer to the cubic than to the further stages through which it should go: a step that
 * stability bounds may pass the error test with stages that lie anywhere. Where the motion is only fast, as of an inertia
 * that has a narrow minimum, both agree to the error of the step, and the cubic is 1e5 times as far. */
static int is_off(const sd_dopri *dopri)
{
    double h = dopri->ivp.h_used, *const *f = dopri->f, *const *k = dopri->rate;
    double off = 0.0, apart = 0.0;
    for (int32_t i = 0; i < dopri->ivp.n; i++) {
        double change = f[0][i], begin = between(h * k[0][i], change), end = between(h * k[SD_DOPRI_STAGES][i], change);
        for (int s = SD_DOPRI_STAGES + 1; s < SD_DOPRI_ALL && dopri->ivp.test[i] >= 0; s++) {
            double x = sd_dopri_c[s], v = 0.0, w = 2.0 * change - begin - end;
            for (int m = SD_DOPRI_DENSE - 1; m >= 0; m--)
                v = (v + f[m][i]) * (m % 2 ? 1.0 - x : x);
            w = x * (change + (1.0 - x) * (begin - change + x * w));
            off += fabs(dopri->y[0][i] + v - dopri->y[s][i]) * dopri->ivp.weight[i];
            apart += fabs(v - w) * dopri->ivp.weight[i];
        }
    }
    return !(off < NEARER * apart);
}

/* The interpolant of a step: the unknowns, and the integrals of those that are not integrated. */
static void prepare(sd_dopri *dopri)
{
    int astray = more_stages(dopri);
    interpolate(dopri, astray);
    if (!astray && (dopri->speed > EDGE || stray(dopri)) && is_off(dopri))
        interpolate(dopri, astray = 1);
    integrals(dopri, astray ? 0 : SD_DOPRI_ALL);
    dopri->dense = 1;
}

/* The nested form f0 x + f1 x (1 - x) + f2 x^2 (1 - x) + ... and its derivative by x: value, slope [n]. */
static SD_WIDE void nested(int32_t n, double *const *f, double x, double *value, double *slope)
{
    int32_t whole = n - n % SD_LANES;
    for (int32_t i = 0; i < whole; i += SD_LANES) {
        sd_lanes v = {0.0}, d = {0.0};
        for (int m = SD_DOPRI_DENSE - 1; m >= 0; m--) {
            v += SD_FROM(f[m], i);
            d = m % 2 ? d * (1.0 - x) - v : d * x + v;
            v *= m % 2 ? 1.0 - x : x;
        }
        SD_AT(value, i) = v;
        SD_AT(slope, i) = d;
    }
    for (int32_t i = whole; i < n; i++) {
        double v = 0.0, d = 0.0;
        for (int m = SD_DOPRI_DENSE - 1; m >= 0; m--) {
            v += f[m][i];
            d = m % 2 ? d * (1.0 - x) - v : d * x + v;
            v *= m % 2 ? 1.0 - x : x;
        }
        value[i] = v;
        slope[i] = d;
    }
}

/* its second derivative, of one unknown */
static double bend(double *const *f, int32_t i, double x)
{
    double v = 0.0, d = 0.0, turn = 0.0;
    for (int m = SD_DOPRI_DENSE - 1; m >= 0; m--) {
        v += f[m][i];
        turn = m % 2 ? turn * (1.0 - x) - 2.0 * d : turn * x + 2.0 * d;
        d = m % 2 ? d * (1.0 - x) - v : d * x + v;
        v *= m % 2 ? 1.0 - x : x;
    }
    return turn;
}

void sd_dopri_dense(const void *self, double t, double *y, double *yd)
{
    sd_dopri *dopri = (sd_dopri *)self; /* the interpolant is made when it is first asked for */
    const sd_underlying *u = dopri->underlying;
    if (dopri->ivp.taken == 0 || t >= dopri->ivp.t) {
        memcpy(y, dopri->phi, (size_t)dopri->ivp.n * sizeof *y);
        memcpy(yd, dopri->yd, (size_t)dopri->ivp.n * sizeof *yd);
        return;
    }
    if (!dopri->dense)
        prepare(dopri);
    double h = dopri->ivp.h_used, x = (t - (dopri->ivp.t - h)) / h;
    nested(dopri->ivp.n, dopri->f, x, y, yd);
    for (int32_t i = 0; i < dopri->ivp.n; i++) {
        y[i] = dopri->y[0][i] + y[i];
        yd[i] /= h;
    }
    for (int32_t j = 0; j < u->solved; j++)
        if (!u->rate[j]) { /* the interpolant is of the integral */
            int32_t k = u->unknown[j];
            y[k] = yd[k];
            yd[k] = bend(dopri->f, k, x) / (h * h);
        }
}

int sd_dopri_onto(void *self, double t, double *y, double *yd, double *moved)
{
    sd_dopri *dopri = self;
    sd_underlying *u = dopri->underlying;
    size_t size = (size_t)dopri->ivp.n * sizeof *y;
    double drift = u->drift; /* of the step */
    memcpy(dopri->moved, y, size);
    memcpy(dopri->moved_d, yd, size);
    u->ready = 0;
    int failed = sd_underlying_project(u, t, dopri->moved, dopri->moved_d)
              || sd_underlying_slopes(u, t, dopri->moved, dopri->moved_d);
    *moved = u->drift;
    u->drift = drift;
    if (failed)
        return 1;
    memcpy(y, dopri->moved, size);
    memcpy(yd, dopri->moved_d, size);
    return 0;
}
