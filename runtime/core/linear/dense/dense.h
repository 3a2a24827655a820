/* Decisions of rank on small full matrices: what runtime/numerics and runtime/structure/structure.py ask LAPACK of larger
 * ones, without a hundred microseconds of calls around a few of arithmetic.
 *
 * Singular values by one-sided Jacobi rotations (Hestenes 1958; Demmel and Veselic 1992: to high relative accuracy);
 * equilibration by Ruiz (2001), as in runtime/numerics/equilibrate.py.  Matrices are row by row.
 */
#ifndef SYSDYN_DENSE_H
#define SYSDYN_DENSE_H

#include <stdint.h>

/* of two vectors [n] */
static inline double sd_dot(int32_t n, const double *a, const double *b)
{
    double sum = 0.0;
    for (int32_t k = 0; k < n; k++)
        sum += a[k] * b[k];
    return sum;
}

/* Rotates the rows of a [m, n] among each other until they are orthogonal: a := V^T a, v [m, m] := V^T (NULL: not wanted),
 * sigma [m] := lengths of the rows, the singular values of a and, where m > n, zeros. */
void sd_orthogonal_rows(int32_t m, int32_t n, double *a, double *v, double *sigma);

/* row [m], column [n]: factors that bring the largest |entry| of each line of the matrices a and b (NULL: one) near 1 */
void sd_factors(int32_t m, int32_t n, const double *a, const double *b, double *row, double *column);

/* the same of a matrix by its entries: row_of, column_of, |value| [entries] */
void sd_sparse_factors(int32_t m, int32_t n, int32_t entries, const int32_t *row_of, const int32_t *column_of,
                       const double *size, double *row, double *column);

/* how many singular values of a [m, n] are above `least` of the largest; -1: entries that are no numbers; -2: memory */
int sd_rank(int32_t m, int32_t n, const double *a, double least);

/* x [n] of least norm with the least |a x - aim|, a [m, n]; singular values below `least` of the largest are zero.  Returns
 * 0; -1: entries that are no numbers; -2: no memory. */
int sd_nearest(int32_t m, int32_t n, const double *a, const double *aim, double least, double *x);

/* 1: the square matrix of these entries [column n + 1, row], equilibrated, is regular: no singular value below `least` of
 * the largest; 0: it is not; -1: entries that are no numbers; -2: memory */
int sd_regular(int32_t n, const int32_t *column, const int32_t *row, const double *value, double least);

/* index of the pencil e x' + b x by the entries of both on one pattern, by the shuffle algorithm (structure.py); -1: it has
 * none below `most`, or is not regular at the point asked; -2: memory */
int sd_pencil_index(int32_t n, const int32_t *column, const int32_t *row, const double *e, const double *b, int32_t most);

#endif
