/* The pattern of a long line's factors, told by what changes along it.
 *
 * Nearly every column of either factor has one entry, as far from its diagonal as that of the column before: starts and rows
 * ascend by one, and whole ranges of positions are renewed by what is next in the factors.  Both orders of numbers are those of
 * the pattern. */
#ifndef SYSDYN_TOLD_H
#define SYSDYN_TOLD_H

#include "linear/sparse/dense_rest.h"

#include <stdlib.h>

#define SD_FEWER 64 /* times: so much shorter is what is told */

/* x[i] = i + offset from `from` on */
typedef struct sd_ascent {
    int32_t from, offset;
} sd_ascent;

typedef struct sd_ascents {
    int32_t number;
    sd_ascent *part;
} sd_ascents;

/* Positions [from, to) that wait for the one `step` before alone, as that waits for them: where the entries of the first one
 * stand in U, in its own column of L and in that of the one that it waits for */
typedef struct sd_links {
    int32_t from, to, step, u, l, before;
} sd_links;

struct sd_told {
    sd_ascents l_start, u_start, l_row, u_row;
    int32_t links;
    sd_links *link;
};

static void leave_told(sd_sparse *lu)
{
    if (!lu->told)
        return;
    free(lu->told->l_start.part), free(lu->told->u_start.part), free(lu->told->l_row.part), free(lu->told->u_row.part);
    free(lu->told->link);
    free(lu->told);
    lu->told = NULL;
}

/* x [n] as its ascents: 0; 1: these are not few, or there is no memory */
static int note_ascents(int32_t n, const int32_t *x, sd_ascents *found)
{
    int32_t number = 0;
    for (int32_t i = 0; i < n; i++)
        number += i == 0 || x[i] != x[i - 1] + 1;
    found->part = number > n / SD_FEWER ? NULL : malloc(((size_t)number + 1) * sizeof *found->part);
    for (int32_t i = 0; i < n && found->part; i++)
        if (i == 0 || x[i] != x[i - 1] + 1)
            found->part[found->number++] = (sd_ascent){i, x[i] - i};
    return !found->part;
}

static int32_t ascent_at(const sd_ascents *ascents, int32_t i)
{
    int32_t low = 0, high = ascents->number;
    while (high - low > 1) {
        int32_t middle = low + (high - low) / 2;
        if (ascents->part[middle].from <= i)
            low = middle;
        else
            high = middle;
    }
    return i + ascents->part[low].offset;
}

static inline int32_t l_begin(const sd_sparse *lu, int32_t k)
{
    return lu->told ? ascent_at(&lu->told->l_start, k) : lu->l_start[k];
}

static inline int32_t u_begin(const sd_sparse *lu, int32_t k)
{
    return lu->told ? ascent_at(&lu->told->u_start, k) : lu->u_start[k];
}

static inline int32_t l_row_at(const sd_sparse *lu, int32_t l)
{
    return lu->told ? ascent_at(&lu->told->l_row, l) : lu->l_row[l];
}

static inline int32_t u_row_at(const sd_sparse *lu, int32_t u)
{
    return lu->told ? ascent_at(&lu->told->u_row, u) : lu->u_row[u];
}

/* the ranges of links along two chains of one step, where they meet */
static void note_links(const sd_sparse *lu, sd_told *told)
{
    for (const sd_chain *lower = lu->lower, *end = lower + lu->lowers; lower < end; lower++)
        for (const sd_chain *upper = lu->upper, *last = upper + lu->uppers; upper < last; upper++) {
            int32_t step = lower->step, from = upper->from + step, to = upper->to + step;
            if (!step || upper->step != step)
                continue;
            from = from > lower->from ? from : lower->from;
            to = to < lower->to - step ? to : lower->to - step;
            if (from < to)
                told->link[told->links++] =
                    (sd_links){from, to, step, lu->u_start[from], lu->l_start[from], lu->l_start[from - step]};
        }
}

/* lets go of the pattern of a long line, which is told from now on; where it is not shorter so nothing changes */
static void tell(sd_sparse *lu)
{
    size_t most = (size_t)lu->lowers * (size_t)lu->uppers;
    sd_told *told = lu->told = most <= (size_t)lu->n / SD_FEWER ? calloc(1, sizeof *told) : NULL;
    if (!told)
        return;
    told->link = malloc((most + 1) * sizeof *told->link);
    if (!told->link || note_ascents(lu->n + 1, lu->l_start, &told->l_start) ||
        note_ascents(lu->n + 1, lu->u_start, &told->u_start) || note_ascents(lu->l_start[lu->n], lu->l_row, &told->l_row) ||
        note_ascents(lu->u_start[lu->n], lu->u_row, &told->u_row)) {
        leave_told(lu);
        return;
    }
    note_links(lu, told);
    free(lu->l_start), free(lu->l_row), free(lu->u_row);
    lu->l_start = lu->u_start = lu->l_row = lu->u_row = NULL;
}

/* room for a pattern that was told before; 0: no memory */
static int provide_pattern(sd_sparse *lu)
{
    size_t starts = 2 * (size_t)lu->n + 2;
    leave_told(lu);
    if (lu->l_start)
        return 1;
    lu->l_start = calloc(starts, sizeof *lu->l_start);
    lu->l_row = malloc(((size_t)lu->l_room + 1) * sizeof *lu->l_row);
    lu->u_row = malloc(((size_t)lu->u_room + 1) * sizeof *lu->u_row);
    lu->u_start = lu->l_start ? lu->l_start + starts / 2 : NULL;
    return lu->l_start && lu->l_row && lu->u_row;
}

#endif
