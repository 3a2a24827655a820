/* What the pattern of a matrix alone says of its rows: a partner for each, and which stand by themselves.
 *
 * What must be so first (Karp & Sipser, FOCS 1981), then passes of disjoint searches (Pothen & Fan, ACM Trans. Math. Softw.
 * 16, 1990): linear for lines and nets.
 */
#ifndef SYSDYN_MATCHING_H
#define SYSDYN_MATCHING_H

#include <stdint.h>

/* A maximum matching of rows and columns: matched [columns] := row of each column, -1 where none is left for it; looks: entries
 * looked at, of the order of those of the pattern for lines and nets; given: from the partners that stand in matched, which stay
 * but where one has to make room.  Returns how many are matched; -1: no memory */
int32_t sd_match(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, int32_t given, int32_t *matched,
                 int64_t *looks);

/* peeled [rows]: 1 where a row of a matrix [rows, columns] can be taken away because it alone of those left stands in some
 * column, with an entry of `least` or more: such rows are independent of all others.  row, column, value [entries].
 * Returns how many are left; -1: no memory */
int32_t sd_peel(int32_t rows, int32_t columns, int32_t entries, const int32_t *row, const int32_t *column,
                const double *value, double least, int32_t *peeled);

#endif
