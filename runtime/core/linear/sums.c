/* Lists of sums: see sums.h. */
#include "linear/sums.h"

#include <stdlib.h>

/* room for one more, doubled when it is used up.  0; 2: no memory */
static int widen(void **items, int32_t used, int32_t *room, size_t size)
{
    if (used < *room)
        return 0;
    int32_t more = *room ? 2 * *room : 64;
    void *moved = realloc(*items, (size_t)more * size);
    if (!moved)
        return 2;
    *items = moved;
    *room = more;
    return 0;
}

int sd_list_pair(sd_list *list, int32_t a, int32_t b)
{
    if (widen((void **)&list->pair, list->pairs, &list->pair_room, 2 * sizeof(int32_t)))
        return 2;
    list->pair[2 * list->pairs] = a;
    list->pair[2 * list->pairs + 1] = b;
    list->pairs++;
    return 0;
}

int sd_list_sum(sd_list *list, enum sd_sum_kind kind, int32_t target, int32_t source, int32_t by)
{
    if (widen((void **)&list->sum, list->sums, &list->room, sizeof(sd_sum)))
        return 2;
    int32_t first = list->sums ? list->sum[list->sums - 1].last : 0;
    list->sum[list->sums++] = (sd_sum){kind, target, source, by, first, list->pairs};
    return 0;
}

void sd_list_clear(sd_list *list)
{
    free(list->sum);
    free(list->pair);
    *list = (sd_list){0};
}
