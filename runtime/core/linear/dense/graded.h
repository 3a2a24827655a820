/* Full matrices whose coefficients lie as far apart as conductances of diodes that conduct and that block (1 and 1e-170 S).
 *
 * Where incidences, exact numbers, hold large and small coefficients together, elimination keeps what singular values lose:
 * a node that nothing but leakage holds.  Rows and columns are scaled so that the assignment of largest product has entries
 * near one and no entry is larger (Olschowka and Neumaier, Linear Algebra Appl. 240, 1996), by powers of two, which round
 * nothing.  Pivots are powers of two, which round nothing either, while such are left, then the largest; with each entry
 * goes a bound of the round-off in it (Wilkinson, Rounding Errors in Algebraic Processes, 1963), which tells a small pivot
 * from what is left of a zero.
 */
#ifndef SYSDYN_GRADED_H
#define SYSDYN_GRADED_H

#include <stdint.h>

/* x [n]: what the rows a [m, n] determine by a x = b, both overwritten; columns without entries have zero.  noise [m]: bounds
 * of round-off in b, overwritten, of which doubt [n] is what they make of x; columns without a pivot beyond round-off have
 * zero then too, and rows are left.  Columns without a row of their own, the last ones, pivot last: some have none, and
 * infinite doubt.  NULL both: all columns have pivots.  Returns 0; 1: x is not found, for a pivot may be round-off, or rows in
 * excess do not agree with the others; 2: a row that is left misses by more than round-off; 3: entries of columns that are left
 * may be more; -2: no memory. */
enum { SD_DETERMINED, SD_NOT_FOUND, SD_MISSED, SD_DOUBTFUL };
int sd_graded(int32_t m, int32_t n, double *a, double *b, double *noise, double *x, double *doubt);

#endif
