/* Pairs of whole numbers in their order, by counting: what a sort of a few million of them would cost ten times. */
#ifndef SYSDYN_PAIRS_H
#define SYSDYN_PAIRS_H

#include <stdint.h>

/* number [n] := place of (first, second) among the distinct pairs in ascending order, first before second; first [n] in
 * 0..firsts-1, second [n] in 0..seconds-1; start [firsts + 1]: where the pairs of each first begin, each [n]: the second of
 * each distinct pair.  Returns how many are distinct; -1: no memory. */
int64_t sd_pairs(int32_t n, int32_t firsts, int32_t seconds, const int32_t *first, const int32_t *second, int32_t *number,
                 int32_t *start, int32_t *each);

/* first [start[firsts]]: of each distinct pair, by where those of each first begin */
void sd_firsts(int32_t firsts, const int32_t *start, int32_t *first);

#endif
