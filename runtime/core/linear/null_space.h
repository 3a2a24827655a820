/* Solutions by the factors of the scaled matrix of an sd_linear, and what it maps to zero: part of linear.c. */
#ifndef SYSDYN_NULL_SPACE_H
#define SYSDYN_NULL_SPACE_H

#include "linear/dense/dense_lu.h"
#include "linear/sparse/sparse.h"

#include <stdlib.h>

#define NULL_ROOM 20000000 /* numbers: where there would be more, what was left is zero */

/* the scaled matrix */
static sd_matrix scaled_matrix(const sd_linear *linear)
{
    return linear->sum ? *linear->sum
                       : (sd_matrix){.column = linear->column, .row = linear->row, .value = linear->scaled};
}

/* x [n]: right side in, solution out, both of the scaled matrix */
static void scaled_solve(sd_linear *linear, sd_number *x)
{
    if (linear->dense)
        dense_solve(linear, x, linear->work);
    else
        sd_sparse_solve(linear->sparse, x, linear->work, NULL, NULL);
}

/* v := v without its part along u, which has length one */
static void without(int32_t n, const sd_number *u, sd_number *v)
{
    sd_number along = 0.0;
    for (int32_t i = 0; i < n; i++)
        along += sd_conjugate(u[i]) * v[i];
    for (int32_t i = 0; i < n; i++)
        v[i] -= along * u[i];
}

/* v := v / |v|, or zero where that is no number */
static void to_length_one(int32_t n, sd_number *v)
{
    double most = 0.0, square = 0.0;
    for (int32_t i = 0; i < n; i++)
        most = sd_size(v[i]) <= most ? most : sd_size(v[i]);
    if (!(most > 0.0) || !isfinite(most)) {
        memset(v, 0, (size_t)n * sizeof *v);
        return;
    }
    for (int32_t i = 0; i < n; i++) {
        v[i] /= most;
        square += sd_square(v[i]);
    }
    for (int32_t i = 0; i < n; i++)
        v[i] /= sqrt(square);
}

/* null: orthonormal, by the solutions in which one column that was left is one and the others are zero */
static int null_vectors(sd_linear *linear)
{
    int32_t n = linear->n, found = 0;
    size_t room = (size_t)(n - linear->rank) * (size_t)n;
    linear->nulls = 0;
    if (room > NULL_ROOM)
        return 0;
    if (room > linear->null_room) {
        sd_number *null = realloc(linear->null, room * sizeof *null);
        if (!null)
            return 2;
        linear->null = null;
        linear->null_room = room;
    }
    for (int32_t k = linear->dense ? linear->rank : 0; k < n; k++) {
        if (linear->sparse && linear->sparse->source[k] >= 0)
            continue;
        int32_t c = linear->dense ? linear->place[k] : linear->sparse->order[k];
        sd_number *v = linear->null + (size_t)found * (size_t)n;
        memset(v, 0, (size_t)n * sizeof *v);
        const sd_matrix matrix = scaled_matrix(linear);
        const sd_number *value = sd_column_of(&matrix, c);
        for (int32_t e = linear->column[c]; e < linear->column[c + 1]; e++)
            v[linear->row[e]] -= *value++;
        scaled_solve(linear, v);
        v[c] = 1.0;
        to_length_one(n, v);
        for (int32_t j = 0; j < found; j++)
            without(n, linear->null + (size_t)j * (size_t)n, v);
        to_length_one(n, v);
        found++;
    }
    linear->nulls = found;
    return 0;
}

/* takes from x what lies in the directions that the matrix maps to zero */
static void shorten(const sd_linear *linear, sd_number *x)
{
    for (int32_t k = 0; k < linear->nulls; k++)
        without(linear->n, linear->null + (size_t)k * (size_t)linear->n, x);
}

#endif
