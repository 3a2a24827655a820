/* An order of the columns of a large sparse matrix, in which partial pivoting fills little.
 *
 * Least approximate degree of A^T A with rows merged as they are eliminated (George & Ng, SIAM J. Sci. Stat. Comput. 8,
 * 1987; the degrees as Davis, Gilbert, Larimore & Ng, ACM Trans. Math. Softw. 30, 2004, COLAMD): linear for lines and
 * nets.
 */
#ifndef SYSDYN_ORDER_H
#define SYSDYN_ORDER_H

#include <stdint.h>

/* order [columns]: the columns in the order of elimination; column [columns + 1], row: the pattern; ahead
 * [columns + 1], behind: columns behind[ahead[c] ..] come behind c, for none of which others wait (NULL: none do); filled: entries of U at
 * most, whatever the pivots (of two rows for each pair of neighbours: those of a symmetric factor).  0; -1: no memory */
int sd_column_order(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const int32_t *ahead,
                    const int32_t *behind, int32_t *order, int64_t *filled);

/* peeled [rows]: 1 where a row of a matrix [rows, columns] can be taken away because it alone of those left stands in some
 * column, with an entry of `least` or more: such rows are independent of all others.  row, column, value [entries].
 * Returns how many are left; -1: no memory */
int32_t sd_peel(int32_t rows, int32_t columns, int32_t entries, const int32_t *row, const int32_t *column,
                const double *value, double least, int32_t *peeled);

/* A maximum matching of rows and columns: matched [columns] := row of each column, -1 where none is left for it; looks: entries
 * looked at, of the order of those of the pattern for lines and nets; given: from the partners that stand in matched, which stay
 * but where one has to make room.  Returns how many are matched; -1: no memory */
int32_t sd_match(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, int32_t given, int32_t *matched,
                 int64_t *looks);

#endif
