/* Orders compared by the length of their factors (Liu, SIAM J. Matrix Anal. Appl. 11, 1990, row by row along the
 * elimination tree). */
#include "linear/order/both_ends.h"

#include <stdlib.h>
#include <string.h>

#define SHORT 8 /* entries of a factor for each unknown at most: of a line; of a net nobody need ask */

/* Neighbours of each unknown in A + A^T: of[start[k] .. start[k + 1]), some of them twice. */
typedef struct {
    int32_t n, *start, *of;
} graph;

static int neighbours(graph *g, int32_t n, const int32_t *column, const int32_t *row)
{
    size_t entries = (size_t)column[n], m = (size_t)n;
    g->n = n;
    g->start = calloc(m + 2 + 2 * entries, sizeof *g->start);
    if (!g->start)
        return -1;
    g->of = g->start + m + 2;
    for (int32_t c = 0; c < n; c++)
        for (int32_t e = column[c]; e < column[c + 1]; e++) {
            g->start[c + 2]++;
            g->start[row[e] + 2]++;
        }
    for (int32_t k = 0; k < n; k++)
        g->start[k + 2] += g->start[k + 1];
    for (int32_t c = 0; c < n; c++)
        for (int32_t e = column[c]; e < column[c + 1]; e++) {
            g->of[g->start[c + 1]++] = row[e];
            g->of[g->start[row[e] + 1]++] = c;
        }
    return 0;
}

/* entries of L below its diagonal, or any number above `most`; room [3 n]: places, parents in the elimination tree, marks */
static int64_t length(const graph *g, const int32_t *order, int64_t most, int32_t *room)
{
    int32_t n = g->n, *place = room, *parent = place + n, *mark = parent + n;
    int64_t found = 0;
    for (int32_t k = 0; k < n; k++) {
        place[order[k]] = k;
        parent[k] = mark[k] = -1;
    }
    for (int32_t k = 0; k < n && found <= most; k++) {
        mark[k] = k;
        for (int32_t e = g->start[order[k]]; e < g->start[order[k] + 1]; e++)
            for (int32_t j = place[g->of[e]]; j < k && mark[j] != k; j = parent[j]) {
                mark[j] = k;
                found++;
                if (parent[j] < 0)
                    parent[j] = k;
            }
    }
    return found;
}

int sd_both_ends(int32_t n, const int32_t *column, const int32_t *row, int32_t *order)
{
    graph g;
    int32_t *room = malloc((4 * (size_t)n + 1) * sizeof *room), *turned = room + 3 * (size_t)n;
    if (!room || neighbours(&g, n, column, row)) {
        free(room);
        return -1;
    }
    for (int32_t k = 0; k < n; k++)
        turned[k] = order[k % 2 ? n - 1 - k / 2 : k / 2];
    int64_t most = SHORT * (int64_t)n, before = length(&g, order, most, room);
    int better = before <= most && length(&g, turned, before, room) <= before;
    if (better)
        memcpy(order, turned, (size_t)n * sizeof *order);
    free(g.start);
    free(room);
    return better;
}
