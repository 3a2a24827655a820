/* Sparse LU of a square matrix in compressed columns, with a given column order. */
#ifndef SYSDYN_SPARSE_H
#define SYSDYN_SPARSE_H

#include "number.h"

#include <stdint.h>

typedef struct sd_sparse {
    int32_t n;
    int32_t *order;              /* [n] column of the matrix that is eliminated k-th */
    int32_t *place, *source;     /* [n] row -> pivot position, pivot position -> row */
    int32_t *l_start, *u_start;  /* [n + 1] */
    int32_t *l_row, *u_row;      /* pivot positions; u in the order of elimination, diagonal apart */
    sd_number *l_value, *u_value, *inverse; /* inverse [n]: of the diagonal of U */
    int64_t l_room, u_room;
    int32_t *stack, *head, *mark, *count; /* [n] search */
    sd_number *x;                /* [n] */
    int pivoted;                 /* a valid pattern exists */
    int diagonal;                /* row c pivots in column c wherever its entry will do: the order is one of A + A^T */
    double smallest;
    int32_t bad_row, bad_column;
} sd_sparse;

sd_sparse *sd_sparse_new(int32_t n, const int32_t *column, const int32_t *row, const int32_t *order);
void sd_sparse_free(sd_sparse *lu);
/* choose pivots and pattern: 0 done, 1 singular, 2 memory */
int sd_sparse_pivot(sd_sparse *lu, const int32_t *column, const int32_t *row, const sd_number *value);
/* new values on the old pattern: 0 done, 1 a pivot became unhealthy */
int sd_sparse_refactor(sd_sparse *lu, const int32_t *column, const int32_t *row, const sd_number *value);
/* x := column_scale * (LU)^-1 (row_scale * x); the scales NULL: ones */
void sd_sparse_solve(sd_sparse *lu, sd_number *x, sd_number *work, const double *row_scale, const double *column_scale);

#endif
