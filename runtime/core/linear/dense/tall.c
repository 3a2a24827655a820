#include "linear/dense/tall.h"

#include "linear/sparse/sparse.h"
#include "linear/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define REFINEMENTS 2
#define ROUND_OFF SD_BY_SUMS /* what is left of a row in excess that agrees; of others the refinement makes up for it */

void sd_miss(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const double *value,
             const double *b, const double *x, double *rest)
{
    memcpy(rest, b, (size_t)rows * sizeof *rest);
    for (int32_t j = 0; j < columns; j++)
        for (int32_t e = column[j]; e < column[j + 1]; e++)
            rest[row[e]] -= value[e] * x[j];
}

/* x towards A x = b, from where it is; rest [rows + columns] */
static void refine(sd_sparse *lu, const int32_t *column, const int32_t *row, const double *value, const double *b,
                   double *x, double *rest)
{
    for (int k = 0; k <= REFINEMENTS; k++) {
        sd_miss(lu->rows, lu->n, column, row, value, b, x, rest);
        sd_sparse_solve(lu, rest, rest + lu->rows, NULL, NULL);
        for (int32_t j = 0; j < lu->n; j++)
            x[j] += rest[j];
    }
}

int sd_determined(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const double *value,
                  const int32_t *order, const int32_t *idle, double least, int64_t most, const double *b, double *x, double *along)
{
    sd_sparse *lu = sd_sparse_new(rows, columns, order);
    double *rest = calloc(2 * (size_t)rows + (size_t)columns + 1, sizeof *rest);
    const double *none = rest + rows + columns; /* A x = 0 */
    int failed = lu && rest ? 0 : 2;
    if (!failed) {
        lu->most = most;
        lu->dropped = ROUND_OFF;
        lu->null_pivot = along ? least : 0.0;
        lu->idle = idle;
        failed = sd_sparse_pivot(lu, &(sd_matrix){.column = column, .row = row, .value = value});
        failed = failed ? failed : !(lu->smallest >= least);
    }
    for (int32_t k = 0; k < columns && !failed && along; k++)
        if (lu->source[k] >= 0)
            along[lu->order[k]] = 0.0;
    if (!failed && along && lu->rank < columns)
        refine(lu, column, row, value, none, along, rest);
    if (x)
        memset(x, 0, (size_t)columns * sizeof *x);
    if (!failed && x)
        refine(lu, column, row, value, b, x, rest);
    free(rest);
    sd_sparse_free(lu);
    return failed;
}

void sd_add_product(int32_t entries, const int32_t *row, const int32_t *column, const double *value, const double *x, double *out)
{
    for (int32_t e = 0; e < entries; e++)
        out[row[e]] += value[e] * x[column[e]];
}

void sd_add_sizes(int32_t entries, const int32_t *row, const int32_t *column, const double *value, const double *x, double *out)
{
    for (int32_t e = 0; e < entries; e++)
        out[row[e]] += fabs(value[e]) * x[column[e]];
}

int sd_to_size_one(int32_t rows, int32_t entries, const int32_t *row, double empty, double *value, double *size)
{
    double *power = calloc((size_t)rows + 1, sizeof *power);
    if (!power)
        return 2;
    for (int32_t e = 0; e < entries; e++)
        power[row[e]] = fmax(power[row[e]], fabs(value[e]));
    for (int32_t i = 0; i < rows; i++) { /* by a power of two before squares are formed, which could overflow */
        int exponent;
        frexp(power[i] > empty ? power[i] : 1.0, &exponent);
        power[i] = ldexp(1.0, exponent);
        size[i] = 0.0;
    }
    for (int32_t e = 0; e < entries; e++) {
        value[e] /= power[row[e]];
        size[row[e]] += value[e] * value[e];
    }
    for (int32_t i = 0; i < rows; i++)
        size[i] = size[i] > 0.0 ? sqrt(size[i]) : 1.0;
    for (int32_t e = 0; e < entries; e++)
        value[e] /= size[row[e]];
    for (int32_t i = 0; i < rows; i++)
        size[i] *= power[i];
    free(power);
    return 0;
}

/* of [columns] := the unknowns in the order in which rows determine one after the other, pivot: the bits of the entries by
 * which they do, one in each column; 0 where some are left.  room [3 rows] */
static int find_sequence(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const double *value,
                         double least, uint64_t *pivot, int32_t *of, int32_t *room)
{
    int32_t *left = room, *last = left + rows, *stack = last + rows, waiting = 0, found = 0;
    memset(room, 0, 2 * (size_t)rows * sizeof *room);
    for (int32_t c = 0; c < columns; c++)
        for (int32_t e = column[c]; e < column[c + 1]; e++) {
            left[row[e]]++;
            last[row[e]] ^= c; /* of the columns that are left: where it is one, its number */
        }
    for (int32_t r = 0; r < rows; r++)
        if (left[r] == 1)
            stack[waiting++] = r;
    while (waiting) {
        int32_t r = stack[--waiting], c = last[r], own = 0;
        if (!left[r])
            continue;
        double largest = 0.0;
        for (int32_t e = column[c]; e < column[c + 1]; e++) {
            largest = fmax(largest, fabs(value[e]));
            own = row[e] == r ? e : own;
        }
        if (!(fabs(value[own]) >= least * largest) || !(largest > 0.0))
            continue;
        pivot[own / 64] |= (uint64_t)1 << own % 64;
        of[found++] = c;
        for (int32_t e = column[c]; e < column[c + 1]; e++) {
            last[row[e]] ^= c;
            if (--left[row[e]] == 1)
                stack[waiting++] = row[e];
        }
    }
    return found == columns;
}

int sd_substituted(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const double *value,
                   double least, const double *b, double *x)
{
    uint64_t *pivot = calloc((size_t)column[columns] / 64 + 1, sizeof *pivot);
    int32_t *of = malloc(((size_t)columns + 1) * sizeof *of), *room = malloc((3 * (size_t)rows + 1) * sizeof *room);
    int failed = !pivot || !of || !room ? 2 : !find_sequence(rows, columns, column, row, value, least, pivot, of, room);
    free(room);
    double *rest = failed ? NULL : malloc(((size_t)rows + 1) * sizeof *rest);
    failed = failed || rest ? failed : 2;
    memset(x, 0, (size_t)columns * sizeof *x);
    for (int pass = 0; pass <= REFINEMENTS && !failed; pass++) {
        sd_miss(rows, columns, column, row, value, b, x, rest);
        for (int32_t k = 0; k < columns; k++) {
            int32_t own = column[of[k]];
            while (!(pivot[own / 64] >> own % 64 & 1))
                own++;
            double step = rest[row[own]] / value[own];
            x[of[k]] += step;
            for (int32_t e = column[of[k]]; e < column[of[k] + 1]; e++)
                rest[row[e]] -= value[e] * step;
        }
    }
    free(pivot);
    free(of);
    free(rest);
    return failed;
}
