/* Solutions by sparse factors: columns of L that fill alike by blocks (blocks.h), a line's in registers. */
#ifndef SYSDYN_SUBSTITUTE_H
#define SYSDYN_SUBSTITUTE_H

#include "linear/sparse/blocks.h"


/* work less `many` columns of one block from the k-th on, which stand there too */
static void substitute_block(const sd_sparse *lu, int32_t k, int32_t many, sd_number *work)
{
    const int32_t *row = lu->l_row + lu->l_start[k];
    sd_number *w = lu->room;
    int32_t wide = lessen_touched(lu, k, many, k, work, w);
    work[k] = w[0];
    for (int32_t p = 0; p < wide; p++)
        work[row[p]] = w[p + 1];
}

/* work[place] -= part, where those at two places are held apart */
static inline __attribute__((always_inline)) void lessen(int32_t place, int32_t one, int32_t two, sd_number part,
                                                         sd_number *at_one, sd_number *at_two, sd_number *work)
{
    if (place == two)
        *at_two -= part;
    else if (place == one)
        *at_one -= part;
    else
        work[place] -= part;
}

/* The solution of sd_sparse_solve from its right side in work */
static SD_WIDE void substitute_blocks(const sd_sparse *lu, sd_number *x, sd_number *work, const double *column_scale)
{
    int32_t n = lu->n, many;
    for (int32_t k = 0; k < n; k += many) {
        for (many = 1; lu->widest && lu->first[k + many] == lu->first[k];)
            many++;
        if (many >= SD_COLUMNS) {
            substitute_block(lu, k, many, work);
            continue;
        }
        many = 1;
        int32_t l = lu->l_start[k];
        lessen_places(lu->l_start[k + 1] - l, lu->l_row + l, lu->l_value + l, work[k], work);
    }
    for (int32_t k = n - 1; k >= 0; k--) {
        sd_number v = work[k] * lu->inverse[k];
        x[lu->order[k]] = column_scale ? v * column_scale[lu->order[k]] : v;
        int32_t u = lu->u_start[k];
        lessen_places(lu->u_start[k + 1] - u, lu->u_row + u, lu->u_value + u, v, work);
    }
}

/* The same along a line, where each place waits for one of those before it: what the next two wait for stays in registers */
static void substitute_line(const sd_sparse *lu, sd_number *x, sd_number *work, const double *column_scale)
{
    int32_t n = lu->n;
    sd_number next = n > 0 ? work[0] : 0.0, behind = n > 1 ? work[1] : 0.0;
    for (int32_t k = 0; k < n; k++) {
        sd_number v = work[k] = next;
        next = behind;
        behind = k + 2 < n ? work[k + 2] : 0.0;
        for (int32_t l = lu->l_start[k]; l < lu->l_start[k + 1]; l++)
            lessen(lu->l_row[l], k + 1, k + 2, lu->l_value[l] * v, &next, &behind, work);
    }
    next = n > 0 ? work[n - 1] : 0.0;
    behind = n > 1 ? work[n - 2] : 0.0;
    for (int32_t k = n - 1; k >= 0; k--) {
        sd_number v = next * lu->inverse[k];
        int32_t c = lu->order[k];
        next = behind;
        behind = k > 1 ? work[k - 2] : 0.0;
        x[c] = column_scale ? v * column_scale[c] : v;
        for (int32_t p = lu->u_start[k]; p < lu->u_start[k + 1]; p++)
            lessen(lu->u_row[p], k - 1, k - 2, lu->u_value[p] * v, &next, &behind, work);
    }
}

#endif
