/* Lists of sums of products over numbered places: what an elimination does, whatever its numbers are (elimination/elimination.c). */
#ifndef SYSDYN_SUMS_H
#define SYSDYN_SUMS_H

#include <stdint.h>

/* how the target of a sum is made of its pairs a, b: source - sum of a b; that times `by`; 1 / that; largest |a b| */
enum sd_sum_kind { SD_SUM_PLAIN, SD_SUM_TIMES, SD_SUM_INVERSE, SD_SUM_LARGEST };

/* one operation; source -1: 0 */
typedef struct sd_sum {
    int32_t kind, target, source, by, first, last; /* its pairs [first, last) */
} sd_sum;

typedef struct sd_list {
    int32_t sums, pairs, room, pair_room;
    sd_sum *sum;
    int32_t *pair;              /* [pairs][2] places a, b */
} sd_list;

/* a pair behind the last; a sum whose pairs are those behind the last one's.  0; 2: no memory */
int sd_list_pair(sd_list *list, int32_t a, int32_t b);
int sd_list_sum(sd_list *list, enum sd_sum_kind kind, int32_t target, int32_t source, int32_t by);
void sd_list_clear(sd_list *list);

#endif
