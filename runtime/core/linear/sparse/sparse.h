/* Sparse LU of a matrix in compressed columns, with a given column order; it may have more rows than columns.
 *
 * Of a tall matrix A = G^T the n rows that pivot are kept: those columns of the wide G are a basis, chosen by size, and
 * sd_sparse_basic finds the solution of G x = b whose other unknowns are zero. */
#ifndef SYSDYN_SPARSE_H
#define SYSDYN_SPARSE_H

#include "linear/sparse/matrix.h"

#include <stdint.h>

typedef struct sd_sparse {
    int32_t n, rows;             /* columns; rows, as many or more */
    const int32_t *order;        /* [n] column of the matrix that is eliminated k-th; of the caller */
    const int32_t *position;     /* [n] column -> k, of the caller; NULL: not known */
    int32_t *place, *source;     /* [rows] row -> pivot position, n where it has none; [n] pivot position -> row,
                                    -1 of a column that was left out; those of the caller where each row pivots in its column */
    int32_t *pivots;             /* [n + rows] source and place where they are its own; NULL: they are the caller's */
    int32_t *first;              /* [n + 1] of the columns of L that fill alike (blocks.h): the first one; NULL: none do */
    int32_t *l_start, *u_start;  /* [n + 1] */
    int32_t *l_row, *u_row;      /* pivot positions; u in the order of elimination, diagonal apart */
    sd_number *l_value, *u_value, *inverse; /* inverse [n]: of the diagonal of U */
    int64_t l_room, u_room;
    int32_t *stack, *head, *mark, *count; /* [rows] search, while pivots are chosen */
    sd_number *block;            /* [rows + 1] what a block touches, while pivots are chosen */
    uint64_t *among;             /* bits of n positions, likewise */
    int32_t rest;                /* the position from which the factors are full (dense_rest.h); n: none */
    int32_t widest;              /* numbers that the widest block touches; 0: there is none */
    sd_number *room;             /* [widest] */
    sd_number *x;                /* [the larger of n and rows, + 1] work, of solutions by these factors too */
    int lent;                    /* 1: x is the caller's */
    int pivoted;                 /* a valid pattern exists */
    int paired;                  /* row own[c] pivots in column c wherever its entry will do: the order is one of A + A^T;
                                    2: however faint that is, of quasi-definite matrices */
    const int32_t *own;          /* [n] of the caller; NULL: row c */
    double smallest, null_pivot; /* least pivot as part of its column; below null_pivot a column is left out */
    const int32_t *idle;         /* [n] 1: which may be, of the caller; NULL: any */
    int32_t rank;                /* columns that were not left out */
    int64_t products, entries;   /* that the factors take on this pattern, and have */
    double dropped;              /* entries of L up to this size are left out, rows in excess that agree with it; 0: none.
                                    The factors serve once: no refactorising on such a pattern */
    int64_t most;                /* entries of the factors beyond which pivoting is given up; 0: none */
    int32_t bad_row, bad_column;
} sd_sparse;

sd_sparse *sd_sparse_new(int32_t rows, int32_t n, const int32_t *order);
void sd_sparse_free(sd_sparse *lu);
/* choose pivots and pattern: 0 done, 1 singular, 2 memory */
int sd_sparse_pivot(sd_sparse *lu, const sd_matrix *matrix);
/* new values on the old pattern: 0 done, 1 a pivot became unhealthy */
int sd_sparse_refactor(sd_sparse *lu, const sd_matrix *matrix);
/* work x from now on in room of the caller [as above] */
void sd_sparse_lend(sd_sparse *lu, sd_number *x);
/* lets go of the numbers of the factors until they are made anew; their pattern stays */
void sd_sparse_rest(sd_sparse *lu);
/* x := column_scale * (LU)^-1 (row_scale * x); the scales NULL: ones */
void sd_sparse_solve(sd_sparse *lu, sd_number *x, sd_number *work, const double *row_scale, const double *column_scale);
/* x [rows] with A^T x = b [n], zero where no pivot is; equations of columns that were left out are not judged; work [n] */
void sd_sparse_basic(const sd_sparse *lu, const sd_number *b, sd_number *x, sd_number *work);

#endif
