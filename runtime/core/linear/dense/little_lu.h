/* Dense LU of matrices of up to SD_LITTLE rows, whose loops are unrolled: part of linear.c.
 *
 * Of so few an order of pivots that is looked for, and code that is written for it (elimination/), would cost 60 thousand
 * instructions and save none: of more unknowns zeros count.  Rows are exchanged, by entries as parts of their rows; a weak pivot
 * is for dense_lu.h, which refines, or leaves its column.
 */
#ifndef SYSDYN_LITTLE_LU_H
#define SYSDYN_LITTLE_LU_H

#include "linear/linear.h"
#include "linear/tuning.h"

#include <string.h>

#define WEAK_PIVOT SD_HALF_OF_ITS_DIGITS /* part of its column below which one is weak */

/* by pivots: multipliers below the diagonal, what is left of rows on and above it, their inverse diagonal; which row of the
 * matrix each is */
struct sd_little {
    sd_number lower[SD_LITTLE][SD_LITTLE], upper[SD_LITTLE][SD_LITTLE], inverse[SD_LITTLE];
    int32_t row[SD_LITTLE];
};

/* upper := the matrix; scale of rows [n] := 1 over their largest entry, in units of scale.  0: a row is zero */
static inline __attribute__((always_inline)) int little_take(const sd_linear *linear, const int n, const sd_number *values,
                                                             const double *scale, double *of_row)
{
    const int32_t *column = linear->column, *row = linear->row;
    sd_little *lu = linear->little;
    double most[SD_LITTLE] = {0.0};
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            lu->upper[i][j] = 0.0;
    for (int j = 0; j < n; j++) {
        const double s = scale ? scale[j] : 1.0;
        for (int32_t e = column[j]; e < column[j + 1]; e++) {
            const double size = sd_size(lu->upper[row[e]][j] += values[e]) * s;
            most[row[e]] = size > most[row[e]] ? size : most[row[e]];
        }
    }
    for (int i = 0; i < n; i++) {
        if (!(most[i] > 0.0))
            return 0;
        lu->row[i] = i;
        of_row[i] = 1.0 / most[i];
    }
    return 1;
}

static SD_APART void little_exchange(sd_little *lu, int n, int i, int k, double *of_row)
{
    const double scale = of_row[i];
    const int32_t row = lu->row[i];
    of_row[i] = of_row[k];
    of_row[k] = scale;
    lu->row[i] = lu->row[k];
    lu->row[k] = row;
    for (int j = 0; j < n; j++) {
        const sd_number upper = lu->upper[i][j], lower = lu->lower[i][j];
        lu->upper[i][j] = lu->upper[k][j];
        lu->upper[k][j] = upper;
        lu->lower[i][j] = lu->lower[k][j];
        lu->lower[k][j] = lower;
    }
}

/* the row from k on whose entry in column k is the largest part of its row, which `most` becomes */
static inline __attribute__((always_inline)) int little_pivot(const sd_little *lu, const int n, int k, const double *of_row,
                                                              double *most)
{
    int best = k;
    *most = sd_size(lu->upper[k][k]) * of_row[k];
#pragma GCC unroll 5
    for (int i = k + 1; i < n; i++) {
        const double size = sd_size(lu->upper[i][k]) * of_row[i];
        best = size > *most ? i : best;
        *most = size > *most ? size : *most;
    }
    return best;
}

/* whether a pivot is not weak, which is a small part of a row */
static SD_APART int little_strong(const sd_linear *linear, int k, const sd_number *values, const double *of_row, double most)
{
    const sd_little *lu = linear->little;
    double largest = 0.0;
    for (int32_t e = linear->column[k]; e < linear->column[k + 1]; e++)
        for (int i = 0; i < linear->n; i++)
            if (lu->row[i] == linear->row[e] && sd_size(values[e]) * of_row[i] > largest)
                largest = sd_size(values[e]) * of_row[i];
    return most > 0.0 && most >= WEAK_PIVOT * largest && most < INFINITY;
}

/* values [entries], scale [n] magnitudes of the unknowns or NULL.  1: factorised; 0: a pivot is weak, or nothing is finite */
static inline __attribute__((always_inline)) int little_factor_of(const sd_linear *linear, const int n, const sd_number *values,
                                                                  const double *scale)
{
    sd_little *lu = linear->little;
    double of_row[SD_LITTLE];
    if (!little_take(linear, n, values, scale, of_row))
        return 0;
#pragma GCC unroll 5
    for (int k = 0; k < n; k++) {
        double most;
        const int best = little_pivot(lu, n, k, of_row, &most);
        const int plain = most * (scale ? scale[k] : 1.0) >= WEAK_PIVOT && most < INFINITY;
        if (!plain && !little_strong(linear, k, values, of_row, most))
            return 0;
        if (best != k)
            little_exchange(lu, n, best, k, of_row);
        const sd_number inverse = lu->inverse[k] = sd_inverse(lu->upper[k][k]);
#pragma GCC unroll 5
        for (int i = k + 1; i < n; i++) {
            const sd_number by = lu->lower[i][k] = lu->upper[i][k] * inverse;
#pragma GCC unroll 5
            for (int j = k + 1; j < n; j++)
                lu->upper[i][j] -= by * lu->upper[k][j];
        }
    }
    return 1;
}

static int little_factor(const sd_linear *linear, const sd_number *values, const double *scale)
{
    switch (linear->n) {
    case 0: return 1;
    case 1: return little_factor_of(linear, 1, values, scale);
    case 2: return little_factor_of(linear, 2, values, scale);
    case 3: return little_factor_of(linear, 3, values, scale);
    case 4: return little_factor_of(linear, 4, values, scale);
    default: return little_factor_of(linear, SD_LITTLE, values, scale);
    }
}

/* of n unknowns, a number that is known when this is compiled */
static inline __attribute__((always_inline)) void little_solve_of(const sd_little *lu, const int n, sd_number *x)
{
    sd_number w[SD_LITTLE];
#pragma GCC unroll 5
    for (int i = 0; i < n; i++) {
        sd_number rest = x[lu->row[i]];
#pragma GCC unroll 5
        for (int k = 0; k < i; k++)
            rest -= lu->lower[i][k] * w[k];
        w[i] = rest;
    }
#pragma GCC unroll 5
    for (int i = n - 1; i >= 0; i--) {
        sd_number rest = w[i];
#pragma GCC unroll 5
        for (int k = n - 1; k > i; k--)
            rest -= lu->upper[i][k] * w[k];
        w[i] = rest * lu->inverse[i];
    }
#pragma GCC unroll 5
    for (int i = 0; i < n; i++)
        x[i] = w[i];
}

/* x [n]: right side in, solution out */
static void little_solve(const sd_little *lu, int32_t n, sd_number *x)
{
    switch (n) {
    case 0: break;
    case 1: little_solve_of(lu, 1, x); break;
    case 2: little_solve_of(lu, 2, x); break;
    case 3: little_solve_of(lu, 3, x); break;
    case 4: little_solve_of(lu, 4, x); break;
    default: little_solve_of(lu, SD_LITTLE, x);
    }
}

#endif
