/* Chains of a sparse LU: positions that wait for one other each, a fixed step before them, which nothing else waits for.
 *
 * Along a line nearly every position is one of a chain, of two in turn where it is eliminated from both ends (order/both_ends.h).
 * A substitution passes over a chain without its pattern: right side, factors and solution are read once each, and what the
 * next position waits for stays in a register.  Sums are those of the pattern's, in their order. */
#ifndef SYSDYN_CHAINS_H
#define SYSDYN_CHAINS_H

#include "linear/sparse/dense_rest.h"

#include <stdlib.h>
#include <string.h>

#define SD_SHORTEST 32 /* positions of a chain: shorter ones are taken by the pattern */
#define SD_BEHIND 1    /* of sd_sparse.pulled: the position that waits for this one in L takes it itself, */
#define SD_BEFORE 2    /* and the one in U */

static void leave_chains(sd_sparse *lu)
{
    free(lu->lower), free(lu->upper), free(lu->pulled);
    lu->lower = lu->upper = NULL;
    lu->pulled = NULL;
    lu->lowers = lu->uppers = 0;
}

/* how far each position is from the only column that it waits for, where that column has no other entry: distance [n], else 0;
 * count [n]: work */
static void measure_distances(int32_t n, const int32_t *start, const int32_t *row, int32_t *count, int32_t *distance)
{
    memset(count, 0, (size_t)n * sizeof *count);
    memset(distance, 0, (size_t)n * sizeof *distance);
    for (int32_t p = 0; p < start[n]; p++)
        count[row[p]]++;
    for (int32_t k = 0; k < n; k++)
        if (start[k + 1] - start[k] == 1 && count[row[start[k]]] == 1)
            distance[row[start[k]]] = abs(row[start[k]] - k);
}

/* The n positions as chains and, with step 0, what is between them; those that are waited for in a chain get `mark`.  sign: of
 * the step, -1 where the column stands before.  How many; -1: no memory */
static int32_t list_chains(int32_t n, const int32_t *distance, int32_t sign, char mark, sd_chain **list, char *pulled)
{
    int32_t found = 0, room = 0;
    for (int32_t from = 0, to; from < n; from = to) {
        for (to = from + 1; to < n && distance[to] == distance[from]; to++)
            continue;
        int32_t step = distance[from] && to - from >= SD_SHORTEST ? distance[from] : 0;
        for (int32_t k = from; step && k < to; k++)
            pulled[k + sign * step] |= mark;
        if (found && !step && !(*list)[found - 1].step) {
            (*list)[found - 1].to = to;
            continue;
        }
        if (found == room) {
            sd_chain *more = realloc(*list, (size_t)(room = 2 * room + 8) * sizeof *more);
            if (!more)
                return -1;
            *list = more;
        }
        (*list)[found++] = (sd_chain){from, to, step, 0};
    }
    return found;
}

static int32_t in_chains(int32_t number, const sd_chain *list)
{
    int32_t sum = 0;
    for (int32_t i = 0; i < number; i++)
        sum += list[i].step ? list[i].to - list[i].from : 0;
    return sum;
}

/* the chains of new factors, where most positions are in one; without memory there are none */
static void find_chains(sd_sparse *lu)
{
    int32_t n = lu->n;
    leave_chains(lu);
    if (lu->rank < n || lu->rows > n || (int64_t)lu->l_start[n] + lu->u_start[n] > 4 * (int64_t)n)
        return;
    int32_t *work = malloc((2 * (size_t)n + 1) * sizeof *work);
    lu->pulled = calloc((size_t)n + 1, 1);
    if (work && lu->pulled) {
        measure_distances(n, lu->l_start, lu->l_row, work, work + n);
        lu->lowers = list_chains(n, work + n, -1, SD_BEHIND, &lu->lower, lu->pulled);
        measure_distances(n, lu->u_start, lu->u_row, work, work + n);
        lu->uppers = list_chains(n, work + n, 1, SD_BEFORE, &lu->upper, lu->pulled);
    }
    free(work);
    for (int32_t i = 0; i < lu->lowers; i++)
        if (lu->lower[i].step)
            lu->lower[i].first = lu->l_start[lu->lower[i].from - lu->lower[i].step];
    for (int32_t i = 0; i < lu->uppers; i++)
        if (lu->upper[i].step)
            lu->upper[i].first = lu->u_start[lu->upper[i].to - 1 + lu->upper[i].step];
    if (in_chains(lu->lowers, lu->lower) < n / 2 || in_chains(lu->uppers, lu->upper) < n / 2)
        leave_chains(lu);
}

/* 1: the k-th position waits for one alone, which no other waits for, and one at most waits for it */
static inline int is_link(const sd_sparse *lu, int32_t k)
{
    if (!lu->lowers || lu->u_start[k + 1] - lu->u_start[k] != 1 || lu->l_start[k + 1] - lu->l_start[k] > 1)
        return 0;
    int32_t j = lu->u_row[lu->u_start[k]];
    return lu->l_start[j + 1] - lu->l_start[j] == 1 && lu->l_row[lu->l_start[j]] == k;
}

/* New values of its column on the pivot that it had: 1: that became unhealthy.  j: what it waits for; where entries stand: its
 * own in U, that of j in L, its own in L (-1: there is none) */
static inline int renew_link(sd_sparse *lu, const sd_matrix *matrix, int32_t k, int32_t j, int32_t u, int32_t before, int32_t l)
{
    int32_t c = lu->order[k], first = matrix->column[c], number = matrix->column[c + 1] - first;
    const sd_number *value = sd_column_of(matrix, c);
    sd_number pivot = 0.0, above = 0.0, below = 0.0;
    for (int32_t e = 0; e < number; e++) {
        int32_t p = lu->place[matrix->row[first + e]];
        if (p == k)
            pivot += value[e];
        else if (p == j)
            above += value[e];
        else
            below += value[e];
    }
    pivot -= lu->l_value[before] * above;
    lu->u_value[u] = above;
    sd_number inverse = lu->inverse[k] = 1.0 / pivot;
    double largest = sd_size(pivot);
    if (l >= 0) {
        lu->l_value[l] = below * inverse;
        largest = sd_size(below) > largest ? sd_size(below) : largest;
    }
    return !keeps_pivot(lu, matrix, k, pivot, largest);
}

static int refactor_link(sd_sparse *lu, const sd_matrix *matrix, int32_t k)
{
    int32_t u = lu->u_start[k], l = lu->l_start[k], j = lu->u_row[u];
    return renew_link(lu, matrix, k, j, u, lu->l_start[j], l < lu->l_start[k + 1] ? l : -1);
}

static inline sd_number right_side(const sd_sparse *lu, int32_t k, const sd_number *x, const double *row_scale)
{
    int32_t r = lu->source[k];
    return row_scale ? x[r] * row_scale[r] : x[r];
}

/* work := L^-1 of the right side along one chain; step: known where it is 1 or 2, and two positions stay in registers */
static inline __attribute__((always_inline)) void descend_chain(const sd_sparse *lu, const sd_chain *chain, const int32_t step,
                                                                const sd_number *x, const double *row_scale, sd_number *work)
{
    const sd_number *l = lu->l_value + chain->first;
    sd_number last = work[chain->from - 1], before = step == 2 ? work[chain->from - 2] : last;
    for (int32_t k = chain->from; k < chain->to; k++) {
        sd_number v = right_side(lu, k, x, row_scale) - *l++ * (step > 2 ? work[k - step] : before);
        before = step == 2 ? last : v;
        work[k] = last = v;
    }
}

/* what columns make of the positions that do not take it themselves */
static inline void descend_columns(const sd_sparse *lu, int32_t from, int32_t to, sd_number *work)
{
    for (int32_t k = from; k < to; k++)
        for (int32_t l = lu->l_start[k], end = lu->l_start[k + 1]; l < end && !(lu->pulled[k] & SD_BEHIND); l++)
            work[lu->l_row[l]] -= lu->l_value[l] * work[k];
}

static void descend_chains(const sd_sparse *lu, const sd_number *x, const double *row_scale, sd_number *work)
{
    for (const sd_chain *chain = lu->lower, *end = chain + lu->lowers; chain < end; chain++)
        for (int32_t k = chain->from; k < chain->to && !chain->step; k++)
            work[k] = right_side(lu, k, x, row_scale);
    for (const sd_chain *chain = lu->lower, *end = chain + lu->lowers; chain < end; chain++) {
        if (chain->step == 1)
            descend_chain(lu, chain, 1, x, row_scale, work);
        else if (chain->step == 2)
            descend_chain(lu, chain, 2, x, row_scale, work);
        else if (chain->step)
            descend_chain(lu, chain, chain->step, x, row_scale, work);
        int32_t own = chain->to - chain->step; /* columns before it are taken within the chain */
        descend_columns(lu, !chain->step || own < chain->from ? chain->from : own, chain->to, work);
    }
}

/* x := column_scale U^-1 work along one chain, at its beginning work too; step as above */
static inline __attribute__((always_inline)) void ascend_chain(const sd_sparse *lu, const sd_chain *chain, const int32_t step,
                                                               sd_number *x, const double *column_scale, sd_number *work)
{
    const sd_number *u = lu->u_value + chain->first, *inverse = lu->inverse;
    sd_number last = work[chain->to], before = step == 2 ? work[chain->to + 1] : last;
    for (int32_t k = chain->to - 1; k >= chain->from; k--) {
        sd_number v = (work[k] - *u-- * (step > 2 ? work[k + step] : before)) * inverse[k];
        int32_t c = lu->order[k];
        before = step == 2 ? last : v;
        last = v;
        if (step > 2)
            work[k] = v;
        x[c] = column_scale ? v * column_scale[c] : v;
    }
    work[chain->from] = last; /* what is before the chain may wait for these */
    if (step == 2)
        work[chain->from + 1] = before;
}

static inline void ascend_columns(const sd_sparse *lu, int32_t from, int32_t to, int solved, sd_number *x,
                                  const double *column_scale, sd_number *work)
{
    for (int32_t k = to - 1; k >= from; k--) {
        if (!solved) {
            work[k] *= lu->inverse[k];
            x[lu->order[k]] = column_scale ? work[k] * column_scale[lu->order[k]] : work[k];
        }
        for (int32_t p = lu->u_start[k], end = lu->u_start[k + 1]; p < end && !(lu->pulled[k] & SD_BEFORE); p++)
            work[lu->u_row[p]] -= lu->u_value[p] * work[k];
    }
}

static void ascend_chains(const sd_sparse *lu, sd_number *x, const double *column_scale, sd_number *work)
{
    for (const sd_chain *first = lu->upper, *chain = first + lu->uppers; chain-- > first;) {
        if (chain->step == 1)
            ascend_chain(lu, chain, 1, x, column_scale, work);
        else if (chain->step == 2)
            ascend_chain(lu, chain, 2, x, column_scale, work);
        else if (chain->step)
            ascend_chain(lu, chain, chain->step, x, column_scale, work);
        int32_t own = chain->from + chain->step; /* columns behind it are taken within the chain */
        ascend_columns(lu, chain->from, !chain->step || own > chain->to ? chain->to : own, chain->step != 0, x, column_scale,
                       work);
    }
}

#endif
