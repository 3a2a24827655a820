#include "linear/order/order.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DENSE 10.0 /* times the root of their number: rows that long say little of the order, columns that long go last */
enum { NONE = -1 };

/* Rows that are left, the merged ones behind; columns by score in lists that begin at `first`. */
typedef struct {
    int32_t columns, rows, made;        /* rows: room for numbers of rows; made: numbers given */
    int64_t *start;                     /* [rows + 1] of each row in `member` */
    int32_t *length;                    /* [rows]; 0: it is gone */
    int32_t *member;                    /* [room] columns of the rows, one row behind the other */
    int64_t used, room, filled;         /* filled: lengths of the merged rows */
    int32_t *of, *own, *count;          /* rows of each column: of[own[c] .. own[c] + count[c]] */
    int32_t *score, *next, *before, *first; /* [columns]; first [columns + 1] */
    int32_t *mark, *rest;               /* [columns]; [rows] members of a row outside the pivot's */
    int32_t *seen;                      /* [rows] at which pivot `rest` was begun */
    char *done;                         /* [columns] */
    const int32_t *ahead, *behind;      /* columns that wait for c: behind[ahead[c] .. ahead[c + 1]]; NULL: none do */
    int32_t *waits;                     /* [columns] for how many each does */
} graph;

static void enlist(graph *g, int32_t c, int32_t score)
{
    g->score[c] = score;
    g->before[c] = NONE;
    g->next[c] = g->first[score];
    if (g->first[score] != NONE)
        g->before[g->first[score]] = c;
    g->first[score] = c;
}

static void delist(graph *g, int32_t c)
{
    if (g->before[c] != NONE)
        g->next[g->before[c]] = g->next[c];
    else
        g->first[g->score[c]] = g->next[c];
    if (g->next[c] != NONE)
        g->before[g->next[c]] = g->before[c];
}

/* rows that are gone, and columns that are done, leave their room */
static void compact(graph *g)
{
    int64_t to = 0;
    for (int32_t r = 0; r < g->made; r++) {
        int64_t from = g->start[r], end = from + g->length[r];
        g->start[r] = to;
        for (; from < end; from++)
            if (!g->done[g->member[from]])
                g->member[to++] = g->member[from];
        g->length[r] = (int32_t)(to - g->start[r]);
    }
    g->used = to;
}

static int enough(graph *g, int64_t more)
{
    if (g->used + more <= g->room)
        return 1;
    compact(g);
    if (g->used + more <= g->room - g->room / 8)
        return 1;
    int64_t room = 2 * (g->used + more);
    int32_t *member = realloc(g->member, (size_t)room * sizeof *member);
    if (!member)
        return 0;
    g->member = member;
    g->room = room;
    return 1;
}

/* the rows of column c become one, without c; 0: no memory */
static int merge(graph *g, int32_t c, int32_t pivot)
{
    int64_t most = 0;
    for (int32_t k = 0; k < g->count[c]; k++)
        most += g->length[g->of[g->own[c] + k]];
    if (!enough(g, most))
        return 0;
    int32_t new = g->made++;
    int64_t begin = g->used, end = begin;
    for (int32_t k = 0; k < g->count[c]; k++) {
        int32_t r = g->of[g->own[c] + k];
        for (int64_t at = g->start[r]; at < g->start[r] + g->length[r]; at++) {
            int32_t j = g->member[at];
            if (!g->done[j] && g->mark[j] != pivot) {
                g->mark[j] = pivot;
                g->member[end++] = j;
            }
        }
        g->length[r] = 0;
    }
    g->start[new] = begin;
    g->length[new] = (int32_t)(end - begin);
    g->filled += end - begin;
    g->used = end;
    return 1;
}

/* degrees of the columns of the newest row */
static void rescore(graph *g, int32_t pivot, int32_t left)
{
    int32_t new = g->made - 1;
    int64_t begin = g->start[new], end = begin + g->length[new];
    for (int64_t at = begin; at < end; at++) {
        int32_t j = g->member[at], kept = 0;
        for (int32_t k = 0; k < g->count[j]; k++) {
            int32_t r = g->of[g->own[j] + k];
            if (!g->length[r])
                continue;
            g->of[g->own[j] + kept++] = r;
            if (g->seen[r] != pivot) {
                g->seen[r] = pivot;
                g->rest[r] = g->length[r];
            }
            g->rest[r]--;
        }
        g->count[j] = kept;
    }
    for (int64_t at = begin; at < end; at++) {
        int32_t j = g->member[at], kept = 0;
        int64_t score = g->length[new] - 1;
        for (int32_t k = 0; k < g->count[j]; k++) {
            int32_t r = g->of[g->own[j] + k];
            if (g->rest[r] <= 0) { /* all of it stands in the new row */
                g->length[r] = 0;
                continue;
            }
            score += g->rest[r];
            g->of[g->own[j] + kept++] = r;
        }
        g->of[g->own[j] + kept++] = new; /* it was in one of the rows that are gone */
        g->count[j] = kept;
        score = score < left ? score : left;
        if (g->waits[j]) {
            g->score[j] = (int32_t)score;
            continue;
        }
        delist(g, j);
        enlist(g, j, (int32_t)score);
    }
}

/* column c is done: what waited for it alone is listed; the least score of that, or the one given */
static int32_t release(graph *g, int32_t c, int32_t least)
{
    for (int32_t k = g->ahead ? g->ahead[c] : 0; g->ahead && k < g->ahead[c + 1]; k++) {
        int32_t j = g->behind[k];
        if (--g->waits[j] || g->done[j])
            continue;
        enlist(g, j, g->score[j]);
        least = g->score[j] < least ? g->score[j] : least;
    }
    return least;
}

/* All that is left stands in one row, from `begin` on: the last of its columns comes first, each time anew, but for what
 * waits for some of them */
static void end_with(const graph *g, int64_t begin, int32_t left, int32_t *order)
{
    for (int waiting = 0; waiting < 2; waiting++)
        for (int32_t k = left; k-- > 0;)
            if ((g->waits[g->member[begin + k]] > 0) == waiting)
                *order++ = g->member[begin + k];
}

/* order [last]: the columns that are listed, in the order of their elimination.  0; -1: no memory */
static int eliminate(graph *g, int32_t *order, int32_t last)
{
    int32_t least = 0, place = 0;
    for (int32_t pivot = 0;; pivot++) {
        while (least <= g->columns && g->first[least] == NONE)
            least++;
        if (least > g->columns)
            return 0;
        int32_t c = g->first[least];
        delist(g, c);
        g->done[c] = 1;
        order[place++] = c;
        /* a row that is gone since stands in no list but the column's */
        int32_t kept = 0;
        for (int32_t k = 0; k < g->count[c]; k++)
            if (g->length[g->of[g->own[c] + k]])
                g->of[g->own[c] + kept++] = g->of[g->own[c] + k];
        g->count[c] = kept;
        if (!kept) {
            least = release(g, c, least);
            continue;
        }
        if (!merge(g, c, pivot))
            return -1;
        int32_t left = g->length[g->made - 1];
        if (place + left == last) { /* it stands in for all rows */
            g->filled += (int64_t)left * (left - 1) / 2;
            end_with(g, g->start[g->made - 1], left, order + place);
            return 0;
        }
        rescore(g, pivot, g->columns - 1);
        for (int64_t at = g->start[g->made - 1]; at < g->start[g->made - 1] + g->length[g->made - 1]; at++)
            if (!g->waits[g->member[at]] && g->score[g->member[at]] < least)
                least = g->score[g->member[at]];
        least = release(g, c, least);
    }
}

int sd_column_order(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, const int32_t *ahead,
                    const int32_t *behind, int32_t *order, int64_t *filled)
{
    size_t n = (size_t)columns, entries = (size_t)column[columns], m = (size_t)rows + n;
    graph g = {.columns = columns, .rows = rows + columns, .made = rows, .ahead = ahead,
               .behind = behind, .room = (int64_t)(entries + entries / 2 + 64)};
    g.start = calloc(m + 1, sizeof *g.start);
    g.length = calloc(m + 1, sizeof *g.length);
    g.member = malloc((size_t)g.room * sizeof *g.member);
    g.of = malloc((entries + 1) * sizeof *g.of);
    g.own = malloc(8 * (n + 2) * sizeof *g.own);
    g.seen = malloc(2 * (m + 1) * sizeof *g.seen);
    g.done = calloc(n + 1, 1);
    int failed = -1;
    if (g.start && g.length && g.member && g.of && g.own && g.seen && g.done) {
        g.count = g.own + n + 2;
        g.score = g.count + n + 2;
        g.next = g.score + n + 2;
        g.before = g.next + n + 2;
        g.first = g.before + n + 2;
        g.mark = g.first + n + 2;
        g.waits = g.mark + n + 2;
        memset(g.waits, 0, n * sizeof *g.waits);
        g.rest = g.seen + m + 1;
        for (size_t k = 0; k < n + 2; k++)
            g.first[k] = g.mark[k] = NONE;
        for (size_t k = 0; k < m; k++)
            g.seen[k] = NONE;
        int32_t last = columns, long_row = (int32_t)fmax(16.0, DENSE * sqrt((double)columns));
        int32_t long_column = (int32_t)fmax(16.0, DENSE * sqrt((double)rows));
        for (int32_t c = 0; c < columns; c++) {
            if (column[c + 1] - column[c] > long_column) {
                g.done[c] = 1;
                continue;
            }
            for (int32_t k = ahead ? ahead[c] : 0; ahead && k < ahead[c + 1]; k++)
                g.waits[behind[k]]++;
            for (int32_t e = column[c]; e < column[c + 1]; e++)
                g.length[row[e]]++;
        }
        for (int32_t r = 0; r < rows; r++) {
            if (g.length[r] > long_row)
                g.length[r] = 0;
            g.start[r + 1] = g.start[r] + g.length[r];
        }
        g.used = g.start[rows];
        memset(g.rest, 0, (size_t)rows * sizeof *g.rest);
        for (int32_t c = 0, at = 0; c < columns; c++) {
            g.own[c] = at;
            for (int32_t e = column[c]; e < column[c + 1] && !g.done[c]; e++) {
                int32_t r = row[e];
                if (!g.length[r])
                    continue;
                g.of[at++] = r;
                g.member[g.start[r] + g.rest[r]++] = c;
            }
            g.count[c] = at - g.own[c];
        }
        for (int32_t c = columns - 1; c >= 0; c--) {
            if (g.done[c]) {
                order[--last] = c;
                continue;
            }
            int64_t score = 0;
            for (int32_t k = 0; k < g.count[c]; k++)
                score += g.length[g.of[g.own[c] + k]] - 1;
            g.score[c] = (int32_t)(score < columns ? score : columns);
            if (!g.waits[c])
                enlist(&g, c, g.score[c]);
        }
        failed = eliminate(&g, order, last);
        *filled = g.filled;
    }
    free(g.start);
    free(g.length);
    free(g.member);
    free(g.of);
    free(g.own);
    free(g.seen);
    free(g.done);
    return failed;
}
