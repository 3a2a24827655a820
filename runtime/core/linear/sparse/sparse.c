/* Left-looking sparse LU (Gilbert & Peierls, SIAM J. Sci. Stat. Comput. 9, 1988) with threshold pivoting. */
#include "linear/sparse/sparse.h"
#include "linear/sparse/pivots.h"
#include "linear/sparse/substitute.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void sd_sparse_free(sd_sparse *lu)
{
    if (!lu)
        return;
    free(lu->pivots);
    free(lu->first);
    free(lu->room);
    free(lu->l_start);
    free(lu->l_row);
    free(lu->u_row);
    free(lu->l_value);
    free(lu->u_value);
    free(lu->inverse);
    if (!lu->lent)
        free(lu->x);
    free(lu);
}

sd_sparse *sd_sparse_new(int32_t rows, int32_t n, const int32_t *order)
{
    sd_sparse *lu = calloc(1, sizeof *lu);
    if (!lu)
        return NULL;
    size_t m = (size_t)n, all = (size_t)rows;
    lu->n = n;
    lu->rows = rows;
    lu->inverse = calloc(m + 1, sizeof(sd_number));
    lu->x = calloc((m > all ? m : all) + 1, sizeof(sd_number));
    lu->l_start = calloc(2 * m + 2, sizeof(int32_t));
    if (!lu->inverse || !lu->x || !lu->l_start) {
        sd_sparse_free(lu);
        return NULL;
    }
    lu->u_start = lu->l_start + m + 1;
    lu->order = order;
    return lu;
}

void sd_sparse_lend(sd_sparse *lu, sd_number *x)
{
    if (!lu->lent)
        free(lu->x);
    lu->x = x;
    lu->lent = 1;
}

void sd_sparse_rest(sd_sparse *lu)
{
    free(lu->l_value), free(lu->u_value), free(lu->inverse);
    lu->l_value = lu->u_value = lu->inverse = NULL;
}

/* the numbers of factors that have rested; 0: no memory */
static int provide_numbers(sd_sparse *lu)
{
    if (lu->inverse)
        return 1;
    lu->inverse = calloc((size_t)lu->n + 1, sizeof *lu->inverse);
    lu->l_value = malloc(((size_t)lu->l_room + 1) * sizeof *lu->l_value);
    lu->u_value = malloc(((size_t)lu->u_room + 1) * sizeof *lu->u_value);
    if (lu->inverse && lu->l_value && lu->u_value)
        return 1;
    sd_sparse_rest(lu);
    return 0;
}

int sd_sparse_pivot(sd_sparse *lu, const sd_matrix *matrix)
{
    return provide_numbers(lu) ? search_pivots(lu, matrix) : 2;
}

/* x := the k-th column, less the columns before it that stand among the first `number` entries of its column of U */
static void renewed(sd_sparse *lu, const sd_matrix *matrix, int32_t k, int32_t number)
{
    int32_t c = lu->order[k], from = lu->u_start[k], first = matrix->column[c], entries = matrix->column[c + 1] - first;
    const sd_number *value = sd_column_of(matrix, c);
    for (int32_t e = 0; e < entries; e++)
        lu->x[lu->place[matrix->row[first + e]]] += value[e];
    apply_columns(lu, number, lu->u_row + from, NULL, lu->u_value + from, lu->x, lu->room);
}

/* the k-th column from x, on the pivot that it had: 1: that became unhealthy */
static int divide_column(sd_sparse *lu, const sd_matrix *matrix, int32_t k)
{
    sd_number *x = lu->x, diagonal = x[k], inverse = 1.0 / diagonal;
    double largest = sd_size(diagonal);
    x[k] = 0.0;
    lu->inverse[k] = inverse;
    for (int32_t l = lu->l_start[k], end = lu->l_start[k + 1]; l < end; l++) {
        int32_t row = lu->l_row[l];
        sd_number v = x[row];
        x[row] = 0.0;
        lu->l_value[l] = v * inverse;
        largest = sd_size(v) > largest ? sd_size(v) : largest;
    }
    return !keeps_pivot(lu, matrix, k, diagonal, largest);
}

static int refactor_column(sd_sparse *lu, const sd_matrix *matrix, int32_t k)
{
    renewed(lu, matrix, k, lu->u_start[k + 1] - lu->u_start[k]);
    return divide_column(lu, matrix, k);
}

/* the columns of the rest, which are full: 1: a pivot became unhealthy, or there is no memory */
static int renew_rest(sd_sparse *lu, const sd_matrix *matrix)
{
    int32_t k = lu->rest, m = lu->n - k;
    sd_number *rest = malloc(((size_t)m * (size_t)m + 1) * sizeof *rest);
    if (!rest)
        return 1;
    for (int32_t i = 0; i < m; i++) {
        renewed(lu, matrix, k + i, lu->u_start[k + i + 1] - lu->u_start[k + i] - i);
        memcpy(rest + (size_t)i * m, lu->x + k, (size_t)m * sizeof *rest);
        memset(lu->x + k, 0, (size_t)m * sizeof *rest);
    }
    int failed = refactor_rest(lu, matrix, k, m, rest);
    free(rest);
    return failed;
}

int sd_sparse_refactor(sd_sparse *lu, const sd_matrix *matrix)
{
    if (!provide_numbers(lu))
        return 1;
    int failed = 0;
    lu->smallest = 1.0;
    memset(lu->x, 0, ((size_t)lu->n + 1) * sizeof *lu->x);
    unsigned before = sd_no_subnormals();
    for (int32_t k = 0; k < lu->rest && !failed; k++)
        failed = lu->source[k] >= 0 && refactor_column(lu, matrix, k);
    if (!failed && lu->rest < lu->n)
        failed = renew_rest(lu, matrix);
    sd_subnormals(before);
    if (failed)
        lu->pivoted = 0;
    return failed;
}

void sd_sparse_solve(sd_sparse *lu, sd_number *x, sd_number *work, const double *row_scale, const double *column_scale)
{
    int32_t n = lu->n;
    for (int32_t k = 0; k < n; k++) {
        int32_t r = lu->source[k];
        work[k] = r < 0 ? 0.0 : row_scale ? x[r] * row_scale[r] : x[r];
    }
    if (is_line(lu))
        substitute_line(lu, x, work, column_scale);
    else
        substitute_blocks(lu, x, work, column_scale);
}

void sd_sparse_basic(const sd_sparse *lu, const sd_number *b, sd_number *x, sd_number *work)
{
    memset(x, 0, (size_t)lu->rows * sizeof *x);
    for (int32_t k = 0; k < lu->n; k++) {
        sd_number v = b[lu->order[k]];
        for (int32_t p = lu->u_start[k]; p < lu->u_start[k + 1]; p++)
            v -= lu->u_value[p] * work[lu->u_row[p]];
        work[k] = v * lu->inverse[k];
    }
    for (int32_t k = lu->n - 1; k >= 0; k--) {
        for (int32_t l = lu->l_start[k]; l < lu->l_start[k + 1]; l++)
            work[k] -= lu->l_value[l] * work[lu->l_row[l]];
        if (lu->source[k] >= 0)
            x[lu->source[k]] = work[k];
    }
}
