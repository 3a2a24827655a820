/* The least multipliers with given reactions: see least_norm.h. */
#include "system/least_norm.h"
#include "linear/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define EPSILON SD_BY_SUMS

sd_least_norm *sd_least_norm_new(sd_system *system, sd_linear *linear, int32_t multipliers, int32_t coordinates)
{
    sd_least_norm *least = calloc(1, sizeof *least);
    if (!least)
        return NULL;
    size_t nnz = (size_t)system->entries + 1, n = (size_t)(multipliers + coordinates) + 1;
    least->memory = calloc(2 * nnz + (size_t)linear->entries + 1 + 2 * n, sizeof(double));
    if (!least->memory) {
        free(least);
        return NULL;
    }
    least->system = system;
    least->linear = linear;
    least->multipliers = multipliers;
    least->coordinates = coordinates;
    least->jy = least->memory;
    least->jyd = least->jy + nnz;
    least->x = least->jyd + nnz;
    least->size = least->x + n;
    least->matrix = least->size + n;
    return least;
}

void sd_least_norm_free(sd_least_norm *least)
{
    if (!least)
        return;
    free(least->memory);
    free(least);
}

int sd_least_norm_apply(sd_least_norm *least, double t, double *y, const double *yd)
{
    int32_t m = least->multipliers, n = least->coordinates;
    sd_jacobian(least->system, t, y, yd, NULL, least->jy, least->jyd);
    memset(least->size, 0, (size_t)n * sizeof(double));
    memset(least->matrix, 0, (size_t)least->linear->entries * sizeof(double));
    for (int32_t e = 0; e < least->entries; e++)
        least->size[least->coordinate[e]] = fmax(least->size[least->coordinate[e]], fabs(least->jy[least->source[e]]));
    for (int32_t e = 0; e < least->entries; e++) {
        double size = least->size[least->coordinate[e]];
        double v = size > 0.0 ? least->jy[least->source[e]] / size : 0.0;
        least->matrix[least->slot[e]] += v;
        least->matrix[least->slot_t[e]] += v;
    }
    for (int32_t i = 0; i < m + n; i++)
        least->matrix[least->slot_diagonal[i]] += i < m ? 1.0 : -EPSILON;
    if (sd_first_bad(least->linear->entries, least->matrix) >= 0 ||
        sd_linear_factor(least->linear, least->matrix, NULL))
        return 1;
    for (int32_t i = 0; i < m; i++)
        least->x[i] = y[least->place[i]];
    memset(least->x + m, 0, (size_t)n * sizeof(double));
    sd_linear_solve(least->linear, least->x);
    for (int32_t i = 0; i < m; i++)
        if (!isfinite(least->x[i]))
            return 1;
    for (int32_t i = 0; i < m; i++)
        y[least->place[i]] -= least->x[i];
    return 0;
}
