/* The order of elimination of a line, from both ends at once.
 *
 * An order from one end makes every number of a solution wait for the one before it; from both ends two chains run beside
 * each other (the twisted factorisation; Golub & Van Loan, Matrix Computations 4, 4.3), and most of that time is gone.
 */
#ifndef SYSDYN_BOTH_ENDS_H
#define SYSDYN_BOTH_ENDS_H

#include <stdint.h>

/* order [n]: the elimination order of a matrix A whose rows pivot in their own columns; its second half is taken from the
 * end on, in turn with the first, where the factors of A + A^T are short and no longer than before.  1: it was, 0: it was
 * not; -1: no memory */
int sd_both_ends(int32_t n, const int32_t *column, const int32_t *row, int32_t *order);

#endif
