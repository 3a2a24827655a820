/* Dense LU of the scaled matrix of an sd_linear: part of linear.c. */
#ifndef SYSDYN_DENSE_LU_H
#define SYSDYN_DENSE_LU_H

#include "linear/linear.h"

#include <math.h>
#include <string.h>

/* columns j and k of a [n][n] by columns, and their places, exchanged */
static void swap_columns(sd_number *a, int32_t n, int32_t j, int32_t k, int32_t *place)
{
    int32_t p = place[j];
    place[j] = place[k];
    place[k] = p;
    for (int32_t i = 0; i < n && j != k; i++) {
        sd_number swap = a[(size_t)j * n + i];
        a[(size_t)j * n + i] = a[(size_t)k * n + i];
        a[(size_t)k * n + i] = swap;
    }
}

/* LU of the scaled matrix by columns with row exchanges; columns without a pivot, where they are allowed, come last */
static int dense_factor(sd_linear *linear)
{
    int32_t n = linear->n;
    sd_number *a = linear->dense;
    memset(a, 0, (size_t)n * (size_t)n * sizeof *a);
    for (int32_t j = 0; j < n; j++)
        for (int32_t e = linear->column[j]; e < linear->column[j + 1]; e++)
            a[(size_t)j * n + linear->row[e]] += linear->scaled[e];
    for (int32_t i = 0; i < n; i++)
        linear->pivot[i] = linear->place[i] = i;
    linear->smallest = 1.0;
    linear->rank = n;
    for (int32_t k = 0; k < linear->rank; k++) {
        sd_number *ck = a + (size_t)k * n;
        double size = 0.0;
        int32_t best = k;
        for (int32_t i = k; i < n; i++)
            if (sd_size(ck[i]) > sd_size(ck[best]))
                best = i;
        int32_t c = linear->place[k];
        for (int32_t e = linear->column[c]; e < linear->column[c + 1]; e++)
            size = fmax(size, sd_size(linear->scaled[e]));
        double relative = size > 0.0 ? sd_size(ck[best]) / size : 0.0;
        if (relative < linear->null_pivot && linear->idle[c]) {
            swap_columns(a, n, k--, --linear->rank, linear->place);
            continue;
        }
        if (!(relative >= linear->smallest)) {
            linear->smallest = relative;
            linear->bad_row = linear->pivot[best];
            linear->bad_column = c;
        }
        if (!(sd_size(ck[best]) > 0.0) || !isfinite(sd_size(ck[best])))
            return 1;
        if (best != k) {
            int32_t p = linear->pivot[k];
            linear->pivot[k] = linear->pivot[best];
            linear->pivot[best] = p;
            for (int32_t j = 0; j < n; j++) {
                sd_number swap = a[(size_t)j * n + k];
                a[(size_t)j * n + k] = a[(size_t)j * n + best];
                a[(size_t)j * n + best] = swap;
            }
        }
        sd_number inverse = 1.0 / ck[k];
        for (int32_t i = k + 1; i < n; i++)
            ck[i] *= inverse;
        for (int32_t j = k + 1; j < n; j++) {
            sd_number *cj = a + (size_t)j * n, u = cj[k];
            if (u == 0.0)
                continue;
            for (int32_t i = k + 1; i < n; i++)
                cj[i] -= ck[i] * u;
        }
    }
    return 0;
}

/* x [n]: right side in, solution out; work [n] */
static void dense_solve(const sd_linear *linear, sd_number *x, sd_number *work)
{
    int32_t n = linear->n;
    const sd_number *a = linear->dense;
    for (int32_t i = 0; i < n; i++)
        work[i] = x[linear->pivot[i]];
    for (int32_t k = 0; k < linear->rank; k++) {
        const sd_number *ck = a + (size_t)k * n;
        for (int32_t i = k + 1; i < n; i++)
            work[i] -= ck[i] * work[k];
    }
    for (int32_t k = linear->rank; k < n; k++)
        x[linear->place[k]] = 0.0;
    for (int32_t k = linear->rank - 1; k >= 0; k--) {
        const sd_number *ck = a + (size_t)k * n;
        sd_number v = x[linear->place[k]] = work[k] / ck[k];
        for (int32_t i = 0; i < k; i++)
            work[i] -= ck[i] * v;
    }
}

#endif
