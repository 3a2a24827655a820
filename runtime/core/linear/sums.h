/* Lists of sums of products over numbered places: what an elimination does, whatever its numbers are, and other straight passes.
 *
 * A place is one of up to SD_ARRAYS arrays, which follow each other.  Who runs a list says where they stand: an interpreter
 * (elimination/elimination.c), or machine code (elimination/machine_code.h).
 */
#ifndef SYSDYN_SUMS_H
#define SYSDYN_SUMS_H

#include <stdint.h>

#define SD_ARRAYS 6

/* how the target of a sum is made of its pairs a, b: source - sum of a b; that times `by`; 1 / that; largest |a b|; (sum of a b) +
 * source; source - by.  The last two of machine code alone */
enum sd_sum_kind { SD_SUM_PLAIN, SD_SUM_TIMES, SD_SUM_INVERSE, SD_SUM_LARGEST, SD_SUM_PLUS, SD_SUM_LESS };

/* one operation; source -1: 0 */
typedef struct sd_sum {
    int32_t kind, target, source, by, first, last; /* its pairs [first, last) */
} sd_sum;

typedef struct sd_list {
    int32_t sums, pairs, room, pair_room;
    sd_sum *sum;
    int32_t *pair;              /* [pairs][2] places a, b */
    int32_t end[SD_ARRAYS - 1]; /* behind the places of each array; INT32_MAX: there is none behind it */
} sd_list;

/* a pair behind the last; a sum whose pairs are those behind the last one's.  0; 2: no memory */
int sd_list_pair(sd_list *list, int32_t a, int32_t b);
int sd_list_sum(sd_list *list, enum sd_sum_kind kind, int32_t target, int32_t source, int32_t by);
/* no sums, of arrays of so many places each; 0: there are no more */
void sd_list_begin(sd_list *list, const int32_t *places);
void sd_list_clear(sd_list *list);

#endif
