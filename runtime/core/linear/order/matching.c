#include "linear/order/matching.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NONE = -1 };

/* What a matching is made in: column [n + 1], row: the pattern; across [m + 1], of_row: the same by rows; matched [n], of [m]:
 * the partner of each column and row; free_rows [n], free_columns [m]: partners that are left; looks: entries looked at */
typedef struct {
    int32_t rows, columns;
    const int32_t *column, *row;
    int32_t *across, *of_row, *matched, *of, *free_rows, *free_columns, *stack;
    int64_t looks;
    int32_t waiting;
} Matching;

/* Matches column c with row r.  Columns and rows that one partner is left for wait on the stack, rows as -1 - r */
static void match(Matching *g, int32_t c, int32_t r)
{
    g->matched[c] = r;
    g->of[r] = c;
    g->looks += g->column[c + 1] - g->column[c] + g->across[r + 1] - g->across[r];
    for (int32_t k = g->column[c]; k < g->column[c + 1]; k++)
        if (--g->free_columns[g->row[k]] == 1 && g->of[g->row[k]] == NONE)
            g->stack[g->waiting++] = -1 - g->row[k];
    for (int32_t k = g->across[r]; k < g->across[r + 1]; k++)
        if (--g->free_rows[g->of_row[k]] == 1 && g->matched[g->of_row[k]] == NONE)
            g->stack[g->waiting++] = g->of_row[k];
}

/* Matches column c with a row that is left for it, where there is one: of those the one with the fewest columns */
static void match_column(Matching *g, int32_t c)
{
    int32_t best = NONE;
    for (int32_t k = g->column[c]; k < g->column[c + 1]; k++) {
        int32_t r = g->row[k];
        if (g->of[r] == NONE && (best == NONE || g->free_columns[r] < g->free_columns[best]))
            best = r;
    }
    g->looks += g->column[c + 1] - g->column[c];
    if (best != NONE)
        match(g, c, best);
}

/* What must be so, first: partners that are the only one left, and only then a choice (Karp & Sipser, FOCS 1981) */
static void match_what_must(Matching *g)
{
    for (int32_t c = 0; c < g->columns; c++)
        if (g->free_rows[c] == 1)
            g->stack[g->waiting++] = c;
    for (int32_t r = 0; r < g->rows; r++)
        if (g->free_columns[r] == 1)
            g->stack[g->waiting++] = -1 - r;
    for (int32_t next = 0; next < g->columns || g->waiting;) {
        int32_t k = g->waiting ? g->stack[--g->waiting] : next++;
        if (k >= 0) {
            if (g->matched[k] == NONE)
                match_column(g, k);
        } else if (g->of[-1 - k] == NONE) {
            int32_t r = -1 - k;
            g->looks += g->across[r + 1] - g->across[r];
            for (int32_t at = g->across[r]; at < g->across[r + 1] && g->of[r] == NONE; at++)
                if (g->matched[g->of_row[at]] == NONE)
                    match(g, g->of_row[at], r);
        }
    }
}

/* Searches a path from the column `root` to a row that is free, by columns that no other search of this pass has seen, and
 * turns it.  room: cheap, at, came, path [columns], seen [rows] := root of the search that came there, `pass` or above.  1: found */
static int augment(Matching *g, int32_t root, int32_t pass, int32_t *const room[5])
{
    int32_t *cheap = room[0], *at = room[1], *came = room[2], *path = room[3], *seen = room[4], depth = 0, end = NONE;
    const int32_t *column = g->column, *row = g->row;
    path[0] = root;
    at[root] = column[root];
    while (depth >= 0) {
        int32_t c = path[depth], next = NONE;
        for (; cheap[c] < column[c + 1] && g->of[row[cheap[c]]] != NONE; cheap[c]++)
            g->looks++;
        if (cheap[c] < column[c + 1]) {
            end = row[cheap[c]];
            break;
        }
        while (at[c] < column[c + 1] && next == NONE) {
            int32_t r = row[at[c]++];
            g->looks++;
            if (seen[r] != pass) {
                seen[r] = pass;
                next = r;
            }
        }
        if (next == NONE) {
            depth--;
            continue;
        }
        came[depth] = next;
        path[++depth] = g->of[next];
        at[path[depth]] = column[path[depth]];
    }
    for (int32_t d = depth; d >= 0; d--) { /* each column of the path takes the row of the next one */
        g->of[end] = path[d];
        g->matched[path[d]] = end;
        end = d ? came[d - 1] : NONE;
    }
    return depth >= 0;
}

int32_t sd_match(int32_t rows, int32_t columns, const int32_t *column, const int32_t *row, int32_t given, int32_t *matched,
                 int64_t *looks)
{
    size_t n = (size_t)columns, m = (size_t)rows, e = (size_t)column[columns];
    int32_t *room = calloc(4 * n + 4 * m + e + 3, sizeof *room);
    if (!room)
        return -1;
    Matching g = {.rows = rows, .columns = columns, .column = column, .row = row, .matched = matched};
    g.across = room;
    g.of_row = g.across + m + 2;
    g.of = g.of_row + e;
    g.free_columns = g.of + m;
    g.free_rows = g.free_columns + m;
    g.stack = g.free_rows + n; /* [n + m]: each waits once, and those with one partner from the start */
    int32_t *const search[5] = {g.free_rows, g.stack + n + m, g.stack + 2 * n + m, g.stack, g.free_columns};
    for (size_t k = 0; k < e; k++)
        g.free_columns[row[k]]++;
    for (int32_t r = 0; r < rows; r++) {
        g.of[r] = NONE;
        g.across[r + 2] = g.across[r + 1] + g.free_columns[r];
    }
    for (int32_t c = 0; c < columns; c++) {
        matched[c] = given ? matched[c] : NONE;
        if (matched[c] != NONE)
            g.of[matched[c]] = c;
        g.free_rows[c] = column[c + 1] - column[c];
        for (int32_t k = column[c]; k < column[c + 1]; k++)
            g.of_row[g.across[row[k] + 1]++] = c;
    }
    if (!given)
        match_what_must(&g);
    /* what a choice has left over: passes of disjoint searches, the last of which finds nothing (Pothen & Fan 1990) */
    memcpy(search[0], column, n * sizeof *column);
    for (int32_t r = 0; r < rows; r++)
        search[4][r] = NONE;
    int32_t pass = 0;
    for (int32_t more = 1; more; pass++) {
        more = 0;
        for (int32_t c = 0; c < columns; c++)
            if (matched[c] == NONE)
                more += augment(&g, c, pass, search);
    }
    int32_t found = 0;
    for (int32_t c = 0; c < columns; c++)
        found += matched[c] != NONE;
    *looks = g.looks;
    free(room);
    return found;
}

int32_t sd_peel(int32_t rows, int32_t columns, int32_t entries, const int32_t *row, const int32_t *column,
                const double *value, double least, int32_t *peeled)
{
    size_t m = (size_t)rows, n = (size_t)columns, e = (size_t)entries;
    int32_t *room = calloc(2 * n + m + e + 4, sizeof *room);
    int64_t *sum = calloc(n + 1, sizeof *sum);
    if (!room || !sum) {
        free(room);
        free(sum);
        return -1;
    }
    /* count of each column, sum of the numbers of its entries: of the one that is left, its number */
    int32_t *count = room, *of_row = count + n + 1, *list = of_row + m + 2, *stack = list + e;
    int32_t waiting = 0, left = rows;
    for (int32_t k = 0; k < entries; k++) {
        of_row[row[k] + 1]++;
        count[column[k]]++;
        sum[column[k]] += k;
    }
    for (int32_t r = 0; r < rows; r++)
        of_row[r + 1] += of_row[r];
    for (int32_t k = entries; k-- > 0;)
        list[--of_row[row[k] + 1]] = k;
    /* of_row[r + 1] is now where row r begins */
    memset(peeled, 0, m * sizeof *peeled);
    for (int32_t c = 0; c < columns; c++)
        if (count[c] == 1)
            stack[waiting++] = c;
    while (waiting) {
        int32_t c = stack[--waiting];
        if (count[c] != 1)
            continue;
        int32_t k = (int32_t)sum[c], r = row[k];
        if (peeled[r] || !(fabs(value[k]) >= least))
            continue;
        peeled[r] = 1;
        left--;
        int32_t end = r + 2 <= rows ? of_row[r + 2] : entries;
        for (int32_t at = of_row[r + 1]; at < end; at++) {
            int32_t j = column[list[at]];
            sum[j] -= list[at];
            if (--count[j] == 1)
                stack[waiting++] = j;
        }
    }
    free(sum);
    free(room);
    return left;
}
