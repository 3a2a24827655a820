/* The least change by the saddle-point matrix: see settle_saddle.h. */
#include "system/settle_saddle.h"
#include "system/settle_room.h"
#include "linear/tuning.h"

#include <math.h>
#include <string.h>

#define EPSILON SD_BY_SUMS /* of redundant rows */

double sd_settle_rate(const sd_settle *settle, int32_t k, const double *yd)
{
    const double usual = settle->scale[settle->rate[k]] / settle->time, rate = fabs(yd[settle->rate[k]]);
    return rate > usual && isfinite(rate) ? rate : usual;
}

int sd_settle_slopes(sd_settle *settle, double t, const double *y, const double *yd, int met)
{
    sd_system *system = settle->system;
    int32_t n = settle->unknowns, rates = settle->rates;
    settle->ready = SD_BY_NONE;
    if (!sd_settle_provide_slopes(settle))
        return 0;
    sd_jacobian(system, t, y, yd, settle->scale, settle->jy, settle->jyd);
    memset(settle->row_scale, 0, (size_t)settle->rows * sizeof(double));
    for (int32_t j = 0; j < n && met; j++)
        if (fabs(y[j]) > settle->scale[j] && isfinite(y[j]))
            settle->scale[j] = fabs(y[j]);
    for (int32_t k = 0; k < rates && met; k++)
        settle->scale[n + k] = sd_settle_rate(settle, k, yd);
    for (int32_t j = 0; j < n; j++) /* scale of yd at [step] for the moment */
        settle->step[j] = 0.0;
    for (int32_t k = 0; k < rates; k++)
        settle->step[settle->rate[k]] = settle->scale[n + k];
    for (int32_t j = 0; j < n; j++)
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++) {
            settle->jy[e] *= settle->scale[j];
            settle->jyd[e] *= settle->step[j];
            settle->row_scale[system->row[e]] += fabs(settle->jy[e]) + fabs(settle->jyd[e]);
        }
    for (int32_t i = 0; i < settle->rows; i++)
        settle->row_scale[i] = settle->sort[i] == SD_LEFT_OUT   ? 0.0
                               : settle->row_scale[i] > 0.0 ? 1.0 / settle->row_scale[i]
                                                            : 1.0;
    return 1;
}

/* the magnitude of the difference of pair k */
static double pair_scale(const sd_settle *settle, int32_t k)
{
    return fmax(settle->scale[settle->pair[2 * k]], settle->scale[settle->pair[2 * k + 1]]);
}

double sd_settle_parted(const sd_settle *settle, int32_t k, const double *y, const double *y0)
{
    const int32_t i = settle->pair[2 * k], j = settle->pair[2 * k + 1];
    return ((y[i] - y0[i]) - (y[j] - y0[j])) / pair_scale(settle, k);
}

/* adds the weights D */
static void weigh(sd_settle *settle)
{
    for (int32_t j = 0; j < settle->unknowns + settle->rates; j++)
        settle->matrix[settle->slot_x[j]] += settle->state[j] == SD_CARRIES ? settle->hold : settle->follows;
    for (int32_t k = 0; k < settle->pairs; k++) {
        const int32_t i = settle->pair[2 * k], j = settle->pair[2 * k + 1];
        const double a = settle->scale[i] / pair_scale(settle, k), b = settle->scale[j] / pair_scale(settle, k);
        settle->matrix[settle->slot_x[i]] += settle->hold * a * a;
        settle->matrix[settle->slot_x[j]] += settle->hold * b * b;
        settle->matrix[settle->slot_pair[k]] -= settle->hold * a * b;
        settle->matrix[settle->slot_pair_t[k]] -= settle->hold * a * b;
    }
}

int sd_settle_factorise(sd_settle *settle, double t, const double *y, const double *yd)
{
    sd_system *system = settle->system;
    if ((!settle->linear && settle->provide()) || !sd_settle_slopes(settle, t, y, yd, 1))
        return 1;
    memset(settle->matrix, 0, (size_t)settle->linear->entries * sizeof(double));
    for (int32_t e = 0; e < system->entries; e++) {
        double scale = settle->row_scale[system->row[e]];
        double a = settle->jy[e] * scale, b = settle->jyd[e] * scale;
        if (settle->slot_y[e] >= 0) {
            settle->matrix[settle->slot_y[e]] += a;
            settle->matrix[settle->slot_y_t[e]] += a;
        }
        if (settle->slot_yd[e] >= 0) {
            settle->matrix[settle->slot_yd[e]] += b;
            settle->matrix[settle->slot_yd_t[e]] += b;
        }
    }
    sd_settle_leave_slopes(settle);
    weigh(settle);
    for (int32_t i = 0; i < settle->rows; i++)
        settle->matrix[settle->slot_r[i]] -= EPSILON;
    if (sd_first_bad(settle->linear->entries, settle->matrix) >= 0 ||
        sd_linear_factor(settle->linear, settle->matrix, NULL))
        return 1;
    settle->ready = SD_BY_MATRIX;
    return 0;
}

double sd_settle_move(sd_settle *settle, double *y, double *yd, double *state)
{
    int32_t n = settle->unknowns, moves = n + settle->rates;
    double largest = 0.0;
    *state = 0.0;
    for (int32_t j = 0; j < moves; j++) {
        double now = j < n ? y[j] : yd[settle->rate[j - n]];
        double gone = (now - settle->x0[j]) / settle->scale[j];
        settle->step[j] = settle->state[j] == SD_CARRIES ? -settle->hold * gone : 0.0;
    }
    for (int32_t k = 0; k < settle->pairs; k++) {
        const int32_t i = settle->pair[2 * k], j = settle->pair[2 * k + 1];
        double pull = settle->hold * sd_settle_parted(settle, k, y, settle->x0) / pair_scale(settle, k);
        settle->step[i] -= pull * settle->scale[i];
        settle->step[j] += pull * settle->scale[j];
    }
    for (int32_t i = 0; i < settle->rows; i++)
        settle->step[moves + i] = -settle->r[i] * settle->row_scale[i];
    sd_linear_solve(settle->linear, settle->step);
    for (int32_t j = 0; j < n; j++)
        y[j] += settle->step[j] * settle->scale[j];
    for (int32_t k = 0; k < settle->rates; k++)
        yd[settle->rate[k]] += settle->step[n + k] * settle->scale[n + k];
    for (int32_t j = 0; j < moves; j++) {
        const double size = fabs(settle->step[j]);
        largest = size > largest ? size : largest;
        if (settle->state[j] == SD_CARRIES && size > *state)
            *state = size;
    }
    for (int32_t k = 0; k < settle->pairs; k++) {
        const int32_t i = settle->pair[2 * k], j = settle->pair[2 * k + 1];
        double part = settle->step[i] * settle->scale[i] - settle->step[j] * settle->scale[j];
        *state = fmax(*state, fabs(part) / pair_scale(settle, k));
    }
    return largest;
}
