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

#endif
