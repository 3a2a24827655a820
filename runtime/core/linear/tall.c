#include "linear/tall.h"

#include "linear/sparse.h"

#include <stdlib.h>
#include <string.h>

#define REFINEMENTS 2
#define ROUND_OFF 1e-14 /* what is left of a row in excess that agrees; of others the refinement makes up for it */

/* rest := b - A x */
static void miss(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const double *value,
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
        miss(lu->rows, lu->n, column, row, value, b, x, rest);
        sd_sparse_solve(lu, rest, rest + lu->rows, NULL, NULL);
        for (int32_t j = 0; j < lu->n; j++)
            x[j] += rest[j];
    }
}

int sd_determined(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const double *value,
                  const int32_t *order, double least, int64_t most, const double *b, double *x)
{
    sd_sparse *lu = sd_sparse_new(rows, columns, order);
    double *rest = malloc(((size_t)rows + (size_t)columns + 1) * sizeof *rest);
    int failed = lu && rest ? 0 : 2;
    if (!failed) {
        lu->most = most;
        lu->dropped = ROUND_OFF;
        failed = sd_sparse_pivot(lu, column, row, value);
        failed = failed == 2 ? 2 : failed || !(lu->smallest >= least);
    }
    memset(x, 0, (size_t)columns * sizeof *x);
    if (!failed)
        refine(lu, column, row, value, b, x, rest);
    free(rest);
    sd_sparse_free(lu);
    return failed;
}

int sd_left_open(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const double *value,
                 const int32_t *order, double least, int64_t most, double *x)
{
    sd_sparse *lu = sd_sparse_new(rows, columns, order);
    double *rest = calloc(2 * (size_t)rows + (size_t)columns + 1, sizeof *rest);
    double *none = rest + rows + columns; /* A x = 0 */
    int failed = lu && rest ? 0 : 2;
    if (!failed) {
        lu->most = most;
        lu->null_pivot = least;
        lu->dropped = ROUND_OFF;
        failed = sd_sparse_pivot(lu, column, row, value);
        for (int32_t k = 0; k < columns && !failed; k++)
            if (lu->source[k] >= 0)
                x[lu->order[k]] = 0.0;
    }
    if (!failed)
        refine(lu, column, row, value, none, x, rest);
    free(rest);
    sd_sparse_free(lu);
    return failed;
}
