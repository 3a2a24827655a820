/* Scaling, and the choice between dense, sparse and replayed factors: see linear.h. */
#include "linear/linear.h"
#include "linear/dense/little_lu.h"
#include "linear/lanes.h"
#include "linear/null_space.h"
#include "linear/sparse/sparse.h"
#include "linear/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define REFINE SD_HALF_OF_ITS_DIGITS /* pivots smaller than this part of their column: one step of iterative refinement */

void sd_linear_free(sd_linear *linear)
{
    if (!linear)
        return;
    free(linear->sparse ? linear->work2 : linear->work);
    free(linear->sum);
    sd_sparse_free(linear->sparse);
    sd_elimination_free(linear->elimination);
    free(linear->little);
    free(linear->null);
    if (linear->own_rows)
        free(linear->row_scale);
    free(linear->scaled);
    free(linear->dense);
    free(linear->pivot);
    free(linear);
}

sd_linear *sd_linear_new(int32_t n, const int32_t *column, const int32_t *row, const int32_t *order)
{
    sd_linear *linear = calloc(1, sizeof *linear);
    if (!linear)
        return NULL;
    size_t m = (size_t)n, nnz = (size_t)column[n];
    linear->n = n;
    linear->entries = column[n];
    linear->column = column;
    linear->row = row;
    linear->row_scale = calloc(2 * m + 1, sizeof(double));
    linear->scaled = calloc(nnz + SD_LANES, sizeof(sd_number));
    linear->pivot = calloc(order ? 1 : 2 * m + 1, sizeof(int32_t)); /* of dense ones */
    linear->place = !linear->pivot || order ? NULL : linear->pivot + m;
    linear->rank = n;
    if (order)
        linear->sparse = sd_sparse_new(n, n, order);
    else
        linear->dense = calloc(m * m + 1, sizeof(sd_number));
    linear->work = !order ? calloc(2 * m + 1, sizeof(sd_number)) : linear->sparse ? linear->sparse->x : NULL;
    if (!linear->row_scale || !linear->scaled || !linear->work || !linear->pivot || (!order && !linear->dense)) {
        sd_linear_free(linear);
        return NULL;
    }
    linear->column_scale = linear->row_scale + m;
    linear->own_scale = linear->own_rows = 1;
    linear->work2 = order ? NULL : linear->work + m;
    return linear;
}

sd_linear *sd_linear_ordered(int32_t n, const int32_t *column, const int32_t *row, const sd_order *order)
{
    sd_linear *linear = sd_linear_new(n, column, row, order ? order->columns : NULL);
    if (linear && linear->sparse && order->paired) {
        linear->sparse->paired = order->paired;
        linear->sparse->own = order->own;
        linear->sparse->position = order->own ? NULL : order->position;
        linear->sparse->most = order->most;
        linear->otherwise = order->otherwise;
    }
    return linear;
}

/* scaled := R values C with rows of largest entry 1 */
static void equilibrate(sd_linear *linear, const sd_number *values, const double *scale)
{
    for (int32_t i = 0; i < linear->n; i++)
        linear->row_scale[i] = 0.0;
    for (int32_t j = 0; j < linear->n; j++) {
        double s = linear->column_scale[j] = scale ? scale[j] : 1.0;
        for (int32_t e = linear->column[j]; e < linear->column[j + 1]; e++) {
            double size = sd_size(linear->scaled[e] = values[e] * s);
            if (size > linear->row_scale[linear->row[e]])
                linear->row_scale[linear->row[e]] = size;
        }
    }
    for (int32_t i = 0; i < linear->n; i++)
        linear->row_scale[i] = linear->row_scale[i] > 0.0 ? 1.0 / linear->row_scale[i] : 1.0;
    for (int32_t e = 0; e < linear->entries; e++)
        linear->scaled[e] *= linear->row_scale[linear->row[e]];
}

/* the same of the sum, whose entries are not kept */
static void equilibrate_sum(sd_linear *linear, const double *scale)
{
    const sd_matrix *sum = linear->sum;
    if (linear->own_scale)
        memcpy(linear->column_scale, scale, (size_t)linear->n * sizeof *scale);
    if (!linear->own_rows)
        return;
    for (int32_t i = 0; i < linear->n; i++)
        linear->row_scale[i] = 0.0;
    for (int32_t j = 0; j < linear->n; j++) {
        const double s = scale[j];
        const int32_t at = sum->at[j] - linear->column[j];
        for (int32_t e = linear->column[j]; e < linear->column[j + 1]; e++) {
            double size = sd_size(sd_entry_of_sum(sum, at + e, s));
            if (size > linear->row_scale[linear->row[e]])
                linear->row_scale[linear->row[e]] = size;
        }
    }
    for (int32_t i = 0; i < linear->n; i++)
        linear->row_scale[i] = linear->row_scale[i] > 0.0 ? 1.0 / linear->row_scale[i] : 1.0;
}

void sd_linear_left(const sd_linear *linear, char *left)
{
    memset(left, 0, (size_t)linear->n);
    for (int32_t k = 0; k < linear->n && linear->rank < linear->n; k++)
        if (linear->dense ? k >= linear->rank : linear->sparse->source[k] < 0)
            left[linear->dense ? linear->place[k] : linear->sparse->order[k]] = 1;
}

/* the factors of `elimination` serve: 1 */
static int serve_replayed(sd_linear *linear)
{
    linear->smallest = 1.0;
    linear->rank = linear->n;
    return linear->replayed = 1;
}

/* by the list of operations, if there is one and it serves: a column that nothing determines has no pivot there, which shows.
 * Where weak pivots are to be left, rows are exchanged */
static int replay(sd_linear *linear, const sd_number *values, const double *scale)
{
    if (!linear->elimination || linear->null_pivot > SD_LEAST_PIVOT || !sd_elimination_factor(linear->elimination, values, scale))
        return linear->replayed = 0;
    return serve_replayed(linear);
}

/* by dense factors of little ones, where they are wanted and serve; 0: not */
static int by_little(sd_linear *linear, const sd_number *values, const double *scale)
{
    if (!linear->little || linear->null_pivot > SD_LEAST_PIVOT || !little_factor(linear, values, scale))
        return 0;
    serve_replayed(linear);
    return linear->replayed = 2;
}

/* which columns the sparse factors may leave */
static void allow(sd_linear *linear)
{
    linear->sparse->idle = linear->idle;
    linear->sparse->null_pivot = linear->idle ? linear->null_pivot : 0.0;
}

/* rows that would not pivot where they belong have filled too much: any row may from now on */
static int without_pairs(sd_linear *linear)
{
    sd_sparse *lu = sd_sparse_new(linear->n, linear->n, linear->otherwise);
    if (!lu)
        return 2;
    sd_sparse_free(linear->sparse);
    linear->sparse = lu;
    if (linear->lent)
        sd_sparse_lend(lu, linear->lent);
    linear->work = lu->x;
    linear->otherwise = NULL;
    allow(linear);
    const sd_matrix matrix = scaled_matrix(linear);
    return sd_sparse_pivot(lu, &matrix);
}

static int sparse_factor(sd_linear *linear)
{
    int failed = 1;
    const sd_matrix matrix = scaled_matrix(linear);
    allow(linear);
    if (linear->sparse->pivoted && linear->sparse->rank == linear->n) /* a column that was left may have a pivot now */
        failed = sd_sparse_refactor(linear->sparse, &matrix);
    if (failed) {
        failed = sd_sparse_pivot(linear->sparse, &matrix);
        if (failed == 3)
            failed = without_pairs(linear);
        linear->pivotings++;
    }
    const sd_sparse *lu = linear->sparse;
    linear->smallest = lu->smallest;
    linear->rank = lu->rank;
    linear->bad_row = lu->bad_row;
    linear->bad_column = lu->bad_column;
    int refined = linear->smallest < REFINE || linear->rank < linear->n;
    if (!failed && refined && !linear->work2)
        linear->work2 = calloc((size_t)linear->n + 1, sizeof(sd_number));
    return !failed && refined && !linear->work2 ? 2 : failed;
}

/* all that was learnt of matrices before */
static void forget(sd_linear *linear)
{
    if (linear->sparse)
        linear->sparse->pivoted = 0;
    if (linear->elimination)
        sd_elimination_forget(linear->elimination);
    linear->pivoted = 1;
}

/* the scales where another one has them, or room for its own; 0: no memory */
static int place_scales(sd_linear *linear, double *row_scale, double *column_scale)
{
    size_t n = (size_t)linear->n, own = (row_scale ? 0 : n) + (column_scale ? 0 : n);
    double *room = own ? malloc((own + 1) * sizeof *room) : NULL;
    if (linear->own_rows)
        free(linear->row_scale);
    linear->own_rows = room && !row_scale;
    linear->own_scale = room && !column_scale;
    linear->row_scale = row_scale ? row_scale : room;
    linear->column_scale = column_scale ? column_scale : room + (row_scale ? 0 : n);
    return !own || room;
}

int sd_linear_borrow(sd_linear *linear, sd_number *work, double *row_scale, double *column_scale)
{
    int32_t longest = 0;
    for (int32_t j = 0; j < linear->n; j++)
        longest = linear->column[j + 1] - linear->column[j] > longest ? linear->column[j + 1] - linear->column[j] : longest;
    sd_matrix *sum = linear->sum ? linear->sum : malloc(sizeof *sum + (size_t)longest * sizeof(sd_number));
    if (!sum || !place_scales(linear, row_scale, column_scale)) {
        linear->sum = sum;
        return 2;
    }
    *sum = (sd_matrix){.column = linear->column, .row = linear->row, .row_scale = linear->row_scale};
    sum->room = (sd_number *)(sum + 1);
    linear->sum = sum;
    free(linear->scaled);
    linear->scaled = NULL;
    sd_sparse_lend(linear->sparse, work);
    linear->work = linear->lent = work;
    return 0;
}

void sd_linear_rest(sd_linear *linear)
{
    if (linear->sparse)
        sd_sparse_rest(linear->sparse);
    if (linear->sum && linear->own_rows) {
        free(linear->row_scale);
        linear->row_scale = linear->column_scale = NULL;
        linear->own_rows = 0;
    }
}

void sd_linear_scale_sum(sd_linear *linear, const double *a, const double *b, const int32_t *at, const sd_number *c,
                         const double *scale)
{
    sd_matrix *sum = linear->sum;
    sum->a = a;
    sum->b = b;
    sum->at = at ? at : linear->column;
    sum->c = *c;
    sum->column_scale = linear->column_scale; /* a copy of scale, which changes */
    equilibrate_sum(linear, scale);
}

int sd_linear_factor_sum(sd_linear *linear)
{
    linear->factorisations++;
    if (!linear->pivoted)
        forget(linear);
    linear->replayed = 0;
    int failed = sparse_factor(linear);
    if (!failed && linear->rank < linear->n)
        failed = null_vectors(linear);
    return failed;
}

/* with exchanges of rows, which small matrices are met to learn of */
static SD_APART int pivot(sd_linear *linear, const sd_number *values, const double *scale)
{
    equilibrate(linear, values, scale);
    int failed = linear->dense ? dense_factor(linear) : sparse_factor(linear);
    if (!failed && linear->rank < linear->n)
        failed = null_vectors(linear);
    if (linear->elimination && linear->rank == linear->n && !failed)
        sd_elimination_learn(linear->elimination, linear->scaled);
    return failed;
}

int sd_linear_factor(sd_linear *linear, const sd_number *values, const double *scale)
{
    linear->factorisations++;
    if (!linear->pivoted)
        forget(linear);
    return by_little(linear, values, scale) || replay(linear, values, scale) ? 0 : pivot(linear, values, scale);
}

int32_t *sd_linear_pivoted(sd_linear *linear)
{
    return &linear->pivoted;
}

void sd_linear_replayed(sd_linear *linear)
{
    if (linear->n <= SD_REPLAYED && !linear->elimination)
        linear->elimination = sd_elimination_new(linear->n, linear->column, linear->row);
}

void sd_linear_often(sd_linear *linear)
{
    sd_linear_replayed(linear);
    if (linear->n <= SD_LITTLE && !linear->little)
        linear->little = calloc(1, sizeof *linear->little);
}

void sd_linear_again(sd_linear *linear)
{
    if (linear->sparse)
        linear->sparse->pivoted = 0;
    linear->idle = NULL;
    linear->null_pivot = 0.0;
    linear->factorisations = linear->pivotings = 0;
    linear->replayed = 0;
}

/* rest := what x leaves of the right side that is there; of rows that are left over, how much of an unknown */
static void note_rest(sd_linear *linear, const sd_number *x, sd_number *rest)
{
    const sd_matrix matrix = scaled_matrix(linear);
    double most = 1.0;
    linear->left_over = 0.0;
    for (int32_t j = 0; j < linear->n; j++) {
        const sd_number *value = sd_column_of(&matrix, j);
        most = fmax(most, sd_size(x[j]));
        for (int32_t e = linear->column[j]; e < linear->column[j + 1]; e++)
            rest[linear->row[e]] -= *value++ * x[j];
    }
    for (int32_t i = 0; i < linear->n && linear->rank < linear->n; i++)
        linear->left_over = fmax(linear->left_over, sd_size(rest[i]) / most);
}

static SD_APART void solve_pivoted(sd_linear *linear, sd_number *x)
{
    int32_t n = linear->n;
    sd_number *rest = linear->work2;
    if (linear->sparse && linear->smallest >= REFINE && linear->rank == n) {
        sd_sparse_solve(linear->sparse, x, linear->work, linear->row_scale, linear->column_scale);
        return;
    }
    for (int32_t i = 0; i < n; i++)
        rest[i] = x[i] *= linear->row_scale[i];
    scaled_solve(linear, x);
    if (linear->smallest < REFINE || linear->rank < n)
        note_rest(linear, x, rest);
    if (linear->smallest < REFINE) {
        scaled_solve(linear, rest);
        for (int32_t i = 0; i < n; i++)
            x[i] += isfinite(sd_size(rest[i])) ? rest[i] : 0.0;
    }
    if (linear->rank < n)
        shorten(linear, x);
    for (int32_t i = 0; i < n; i++)
        x[i] *= linear->column_scale[i];
}

void sd_linear_solve(sd_linear *linear, sd_number *x)
{
    if (linear->replayed == 2)
        little_solve(linear->little, linear->n, x);
    else if (linear->replayed)
        sd_elimination_solve(linear->elimination, x);
    else
        solve_pivoted(linear, x);
}

#ifndef SD_COMPLEX
/* 1 or -1: an even or odd number of exchanges makes the permutation [n]; met [n]: work, zeros */
static int parity(const int32_t *permutation, int32_t n, char *met)
{
    int sign = 1;
    for (int32_t i = 0; i < n; i++) {
        for (int32_t k = permutation[i]; k != i && !met[i]; k = permutation[k]) {
            met[k] = 1;
            sign = -sign;
        }
        met[i] = 0;
    }
    return sign;
}

int sd_linear_orientation(const sd_linear *linear)
{
    const int32_t n = linear->n, *rows, *columns = NULL;
    const double *pivot;
    size_t next = 1; /* from one pivot to the next: n + 1 along the diagonal of dense factors */
    if (linear->rank < n || linear->smallest < REFINE)
        return 0;
    if (linear->replayed == 2)
        rows = linear->little->row, pivot = linear->little->inverse;
    else if (linear->replayed) {
        const sd_elimination *e = linear->elimination->serves;
        rows = e->pivot_row, columns = e->pivot_column, pivot = e->cell;
    } else if (linear->sparse)
        rows = linear->sparse->source, columns = linear->sparse->order, pivot = linear->sparse->inverse;
    else
        rows = linear->pivot, columns = linear->place, pivot = linear->dense, next = (size_t)n + 1;
    char small[SD_REPLAYED] = {0}, *met = n <= SD_REPLAYED ? small : calloc((size_t)n, 1);
    if (!met)
        return 0;
    int sign = parity(rows, n, met) * (columns ? parity(columns, n, met) : 1);
    for (int32_t k = 0; k < n; k++)
        sign = pivot[k * next] < 0.0 ? -sign : sign;
    if (met != small)
        free(met);
    return sign;
}
#endif

double sd_linear_effort(const sd_linear *linear)
{
    const sd_sparse *lu = linear->replayed ? NULL : linear->sparse;
    return lu && lu->products ? (double)lu->products / (double)lu->entries : 0.0;
}
