/* Values between the ends of a step of DOP853 (see dopri.h). */
#include "steppers/dopri.h"

#include <string.h>

/* the three further stages; 0 done */
static int more_stages(sd_dopri *dopri)
{
    sd_underlying *u = dopri->underlying;
    double from = dopri->t - dopri->h_used;
    for (int s = SD_DOPRI_STAGES + 1; s < SD_DOPRI_ALL; s++) {
        double *y = dopri->y[s];
        sd_dopri_combine(dopri, s, dopri->h_used);
        memcpy(dopri->rate[s], dopri->rate[SD_DOPRI_STAGES], (size_t)dopri->n * sizeof *y);
        for (int32_t j = 0; j < u->solved; j++)
            if (!u->rate[j])
                y[u->unknown[j]] = dopri->y[SD_DOPRI_STAGES][u->unknown[j]];
        if (sd_underlying_slopes(u, from + sd_dopri_c[s] * dopri->h_used, y, dopri->rate[s]))
            return 1;
    }
    return 0;
}

/* The interpolant of a step: the unknowns, and the integrals of those that are not integrated. */
static void prepare(sd_dopri *dopri)
{
    const sd_underlying *u = dopri->underlying;
    const double *b = sd_dopri_a[SD_DOPRI_STAGES];
    double h = dopri->h_used, **f = dopri->f;
    int plain = more_stages(dopri); /* without them it is the cubic of both ends */
    for (int32_t i = 0; i < dopri->n; i++) {
        int32_t column = u->column[i];
        double **k = column >= 0 && !u->rate[column] ? dopri->y : dopri->rate;
        double change = dopri->phi[i] - dopri->y[0][i];
        if (k == dopri->y) {
            change = 0.0;
            for (int j = 0; j < SD_DOPRI_STAGES; j++)
                change += h * b[j] * k[j][i];
        }
        f[0][i] = change;
        f[1][i] = h * k[0][i] - change;
        f[2][i] = 2.0 * change - h * (k[0][i] + k[SD_DOPRI_STAGES][i]);
        for (int m = 3; m < SD_DOPRI_DENSE; m++) {
            double sum = 0.0;
            for (int j = 0; !plain && j < SD_DOPRI_ALL; j++)
                sum += sd_dopri_d[m - 3][j] * k[j][i];
            f[m][i] = h * sum;
        }
    }
    dopri->dense = 1;
}

void sd_dopri_dense(sd_dopri *dopri, double t, double *y, double *yd)
{
    const sd_underlying *u = dopri->underlying;
    if (dopri->taken == 0 || t >= dopri->t) {
        memcpy(y, dopri->phi, (size_t)dopri->n * sizeof *y);
        memcpy(yd, dopri->yd, (size_t)dopri->n * sizeof *yd);
        return;
    }
    if (!dopri->dense)
        prepare(dopri);
    double x = (t - (dopri->t - dopri->h_used)) / dopri->h_used;
    for (int32_t i = 0; i < dopri->n; i++) {
        double v = 0.0, d = 0.0, turn = 0.0; /* value, first and second derivative */
        for (int m = SD_DOPRI_DENSE - 1; m >= 0; m--) {
            v += dopri->f[m][i];
            if (m % 2 == 0) {
                turn = turn * x + 2.0 * d;
                d = d * x + v;
                v *= x;
            } else {
                turn = turn * (1.0 - x) - 2.0 * d;
                d = d * (1.0 - x) - v;
                v *= 1.0 - x;
            }
        }
        d /= dopri->h_used;
        int32_t column = u->column[i];
        int integral = column >= 0 && !u->rate[column];
        y[i] = integral ? d : dopri->y[0][i] + v;
        yd[i] = integral ? turn / (dopri->h_used * dopri->h_used) : d;
    }
}

int sd_dopri_onto(sd_dopri *dopri, double t, double *y, double *yd, double *moved)
{
    sd_underlying *u = dopri->underlying;
    size_t size = (size_t)dopri->n * sizeof *y;
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
