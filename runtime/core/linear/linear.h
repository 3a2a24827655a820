/* Linear systems G x = b on one fixed pattern, factorised again and again with new values.
 *
 * Dense LU with partial pivoting of the smallest (numerics/ordering.py); else sparse LU: the column order is given,
 * rows are chosen by threshold partial pivoting (Gilbert & Peierls 1988), later matrices are refactorised on the found
 * pattern and pivots while these stay healthy and pivoted anew when not.  Before either, where a caller said so, the list of
 * operations that served small matrices before.
 * G is scaled: columns by the caller (magnitudes of the unknowns), rows by their largest scaled entry, so that
 * nano-farads and mega-pascals live in one matrix.
 */
#ifndef SYSDYN_LINEAR_H
#define SYSDYN_LINEAR_H

#include "linear/elimination/elimination.h"
#include "linear/number.h"

#include <stddef.h>
#include <stdint.h>

typedef struct sd_sparse sd_sparse;
typedef struct sd_matrix sd_matrix;
typedef struct sd_little sd_little;

#define SD_LITTLE 5 /* unknowns up to which dense factors are the cheapest (dense/little_lu.h) */

/* An order of elimination: columns [n], NULL: dense; paired: row own[c] (NULL: c) pivots in column c wherever its entry will do,
 * (position [n]: the place of each column in the order, NULL: not known)
 * and where such factors get longer than `most` entries (0: however long) the columns are taken as in `otherwise` [n], for any
 * pivots.  2: of matrices that are quasi-definite (Vanderbei, SIAM J. Optim. 5, 1995) that row pivots however faint it is, and
 * the caller refines what it solves.  Arrays of the caller. */
typedef struct sd_order {
    const int32_t *columns, *own, *otherwise, *position;
    int64_t most;
    int32_t paired;
} sd_order;

typedef struct sd_linear {
    int32_t n, entries;
    const int32_t *column, *row; /* pattern, compressed columns, of the caller */
    double *row_scale, *column_scale;
    sd_number *scaled;           /* entries of the scaled matrix, in whole lanes; a matrix may be put there to be factorised */
    sd_number *dense;               /* LU of small matrices, [n][n] by columns; NULL for sparse ones */
    int32_t *pivot;
    sd_sparse *sparse;
    sd_number *work, *work2;     /* [n]; work: of sparse factors theirs; work2: beside these where solutions are refined */
    double smallest;             /* smallest pivot relative to its column: 0 singular */
    int32_t bad_row, bad_column; /* where it was found */
    int64_t factorisations, pivotings;
    /* A column that nothing determines, where `idle` allows it: of all solutions the shortest is taken, in units of `scale`;
     * the row that is left over holds or not.  (Laws whose slopes underflow: the node between two diodes that block.) */
    double null_pivot;           /* part of its column below which a pivot is none; 0: every pivot counts */
    const int32_t *idle;         /* [n] 1: the column may be left; of the caller */
    int32_t *place;              /* [n] column that is eliminated k-th */
    int32_t rank;                /* of the last factors: n where no column was left */
    double left_over;            /* of the rows beyond the rank, in units of their largest term: what the last solution missed */
    sd_number *null;             /* [nulls][n] orthonormal, what the last factors map to zero */
    size_t null_room;
    int32_t nulls;               /* n - rank, or 0 where those would be too many */
    int32_t pivoted;             /* 0: pivots are chosen anew */
    int32_t replayed;            /* 1: the last factors are those of `elimination`; 2: of `little` */
    sd_elimination *elimination; /* NULL: every matrix is pivoted */
    const int32_t *otherwise;    /* of sd_order; NULL: the order stays */
    sd_matrix *sum;              /* R (A + c B) C instead of `scaled`, of which there is none; NULL: there is */
    sd_number *lent;             /* [n + 1] work of sparse factors that is the caller's; NULL: it is theirs */
    int32_t own_scale, own_rows; /* 1: column_scale, row_scale are not the caller's */
    sd_little *little;           /* NULL: little matrices are factorised as all others */
} sd_linear;

/* order: column order for the sparse factorisation, NULL for dense.  NULL without memory. */
sd_linear *sd_linear_new(int32_t n, const int32_t *column, const int32_t *row, const int32_t *order);
/* the same by an order; NULL: dense */
sd_linear *sd_linear_ordered(int32_t n, const int32_t *column, const int32_t *row, const sd_order *order);
void sd_linear_free(sd_linear *linear);
/* values [entries], linear->scaled or elsewhere; scale [n] magnitudes of the unknowns or NULL.  0 done, 1 singular (bad_row, bad_column), 2 memory. */
int sd_linear_factor(sd_linear *linear, const sd_number *values, const double *scale);
/* x [n]: right side in, solution out */
void sd_linear_solve(sd_linear *linear, sd_number *x);
/* left [n] := 1 for the columns that the last factors left */
void sd_linear_left(const sd_linear *linear, char *left);
/* Of sparse ones whose matrices will be A + c B: what follows from these is not kept, and work [n + 1] is room of the caller
 * which is free whenever they factorise or solve.  row_scale, column_scale [n]: where the scales of the last factors stand from
 * then on (NULL: in room of their own; those of another matrix of the pattern serve).  0 done, 2 no memory */
int sd_linear_borrow(sd_linear *linear, sd_number *work, double *row_scale, double *column_scale);
/* What is factorised next is A + c B in such scales: a, b, of which the entries of a column begin at `at` [n] (NULL: as in the
 * pattern), stay as they are until the next one; scale [n] of columns, where they are its own */
void sd_linear_scale_sum(sd_linear *linear, const double *a, const double *b, const int32_t *at, const sd_number *c,
                         const double *scale);
/* as sd_linear_factor, of that */
int sd_linear_factor_sum(sd_linear *linear);
/* lets go of the numbers of sparse factors, and of scales of their own where they borrowed: nothing is solved before the next
 * ones, for which they borrow again */
void sd_linear_rest(sd_linear *linear);
/* set to 0: the next factorisation chooses its pivots anew, and nothing is known of those before */
int32_t *sd_linear_pivoted(sd_linear *linear);
/* small matrices, of which there will be many, are eliminated by a list of operations (elimination/elimination.h) where it serves; the
 * pivots of others are chosen as before */
void sd_linear_replayed(sd_linear *linear);
/* the same, but for little ones, whose dense factors are unrolled */
void sd_linear_often(sd_linear *linear);
/* as new, but for the lists that served: for another run on matrices of the same kind */
void sd_linear_again(sd_linear *linear);

/* the sign of the determinant of what was factorised last: 1, -1; 0: it is singular, or its sign is that of round-off */
int sd_linear_orientation(const sd_linear *linear);

/* products of the last factors for each entry of them, of which a solution takes one; 0: few, or not counted */
double sd_linear_effort(const sd_linear *linear);

#endif
