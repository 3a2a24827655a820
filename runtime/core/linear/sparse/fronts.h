/* Sparse factors by fronts (Duff & Reid, ACM Trans. Math. Software 9, 1983; Liu, SIAM Review 34, 1992): where an elimination
 * fills, as a grid's does, columns that touch the same rows pivot together in one small dense matrix.
 *
 * Every row pivots in its own column, by an order of A + A^T: the pattern is known before any number, and symmetric.  Columns
 * that differ in few rows share a front, zeros among them (Ashcraft & Grimes, ACM Trans. Math. Software 15, 1989), for a front
 * costs more besides its numbers.  A front holds some columns of L and rows of U in two panels, whose triangles are inverted
 * when they are done (Alvarado & Schreiber, SIAM J. Sci. Comput. 14, 1993), and hands what is left on to the one above.
 */
#ifndef SYSDYN_FRONTS_H
#define SYSDYN_FRONTS_H

#include "linear/sparse/sparse.h"

typedef struct sd_front {
    int32_t first, many, wide;  /* positions [first, first + many) pivot here and touch `wide` behind them */
    int32_t up, child, sibling; /* the front that takes what is left of this one; the last that it takes from itself; the one
                                   before this one that `up` takes from; -1: none */
    int32_t side;               /* on which stack its rest waits */
    int32_t behind, at;         /* where its lists, its panels begin */
    int32_t entries;            /* where those of the matrix that stand here end */
} sd_front;

typedef struct sd_front_entry {
    int32_t entry, column, place; /* of the matrix; in the panel of L, ~ of U */
} sd_front_entry;

struct sd_fronts {
    int32_t n, fronts, numbers; /* of panels */
    int64_t products, entries;  /* of such an elimination without zeros */
    sd_front *front;            /* each behind those that it takes from */
    sd_front_entry *entry;      /* by fronts */
    int32_t *behind, *there;    /* positions that fronts touch, in order; which line of the front above each is */
    int32_t *row, *column;      /* [n] of the matrix, by position */
    sd_number *value;           /* [numbers] panels: of L by columns, of U by lines, their triangles inverted */
    sd_number *left[2], *top[2]; /* what fronts leave, by turns, the last on top */
    sd_number *line, *panel;    /* room for two numbers a line of the widest front, and for the largest panel */
};

/* of a pattern whose columns are eliminated in this order, where row own[c] (NULL: c) pivots in column c; NULL: no memory, or
 * they would fill too little to be worth it, or with more than `most` entries (0: any) */
sd_fronts *sd_fronts_new(int32_t n, const sd_matrix *matrix, const int32_t *order, const int32_t *own, int64_t most);
void sd_fronts_free(sd_fronts *fronts);
/* 0: no memory for the numbers, which fronts that have rested have none of */
int sd_fronts_provide(sd_fronts *fronts);
void sd_fronts_rest(sd_fronts *fronts);
/* new values; the least pivot as part of what is left of its column, 0: one is no number */
double sd_fronts_factor(sd_fronts *fronts, const sd_matrix *matrix);
/* as sd_sparse_solve */
void sd_fronts_solve(const sd_fronts *fronts, sd_number *x, sd_number *work, const double *row_scale,
                     const double *column_scale);

#endif
