/* A x = b of a sparse matrix with as many rows as columns or more, and what it leaves open.
 *
 * As many rows as there are columns pivot, chosen by size (sparse/sparse.h); the others must agree, and whoever asks looks at
 * them.  Where every column has a pivot the solution is the only one, and so the one of least norm: one factorisation of the rows
 * stands for one of the saddle-point matrix of twice their size and four times their fill.
 */
#ifndef SYSDYN_TALL_H
#define SYSDYN_TALL_H

#include <stdint.h>

/* column [columns + 1], row, value [entries]: A by columns; order [columns] of elimination; least: pivot, as part of its
 * column, below which a column counts as not determined; most: entries of the factors (0: any number); b [rows] -> x
 * [columns], NULL: nobody asks.
 * along [columns], NULL: every column must have a pivot.  Else those may have none that are idle [columns] (NULL: all): they
 * are zero in x and as they came in along, which becomes a direction with A along = 0; zero where A determines x.
 * 0 done, 1 not determined, 2 no memory, 3 the factors fill too much */
int sd_determined(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const double *value,
                  const int32_t *order, const int32_t *idle, double least, int64_t most, const double *b, double *x, double *along);

/* The same where each row in turn has one unknown left: substitution needs no order and no factors, and makes the rows that
 * it takes hold to round-off.  0 done, 1 some unknown does not follow so, 2 no memory */
int sd_substituted(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const double *value,
                   double least, const double *b, double *x);

/* rest [rows] := b - A x */
void sd_miss(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const double *value,
             const double *b, const double *x, double *rest);

/* out += A x of a matrix by its entries: row, column, value [entries] */
void sd_add_product(int32_t entries, const int32_t *row, const int32_t *column, const double *value, const double *x,
                    double *out);
/* the same of the sizes of the values */
void sd_add_sizes(int32_t entries, const int32_t *row, const int32_t *column, const double *value, const double *x,
                  double *out);

/* Divides entries value [entries] in rows row by the sizes [rows] of these, which are handed on: the root of the sum of
 * their squares, of an empty row, whose entries are `empty` at most, one.  2 no memory */
int sd_to_size_one(int32_t rows, int32_t entries, const int32_t *row, double empty, double *value, double *size);

#endif
