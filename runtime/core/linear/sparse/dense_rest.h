/* The rest of an elimination once it is dense: by columns in panels, so that a panel stays near while all behind it take it.
 *
 * What stands before it has been applied to all its columns; they become one block of L (blocks.h). */
#ifndef SYSDYN_DENSE_REST_H
#define SYSDYN_DENSE_REST_H

#include "linear/sparse/blocks.h"
#include "linear/tuning.h"

#include <math.h>
#include <string.h>

#define LONG 100000     /* columns of a line from which the room for its factors counts: */
#define GROWN SD_UNSEEN /* a column's own row pivots though its entry is that small, where elimination has only added to it
                         * (inductances and capacitances: two entries a column are left, not three) */
#define FAINT_PIVOT SD_OPEN /* and a column's own one of quasi-definite matrices, whose factors any of them has: refined once or
                         * twice their solutions are as good (those of 4650 masses at random: a fifth of the time) */
#define UNHEALTHY SD_SMALL /* refactorised pivots below this part of their column are chosen anew */
#define PANEL 32        /* columns that are applied to all behind them together */
#define REST_LEAST 64   /* columns of a rest that is worth it */
#define REST_MOST 4096  /* and those whose numbers have room */
#define NARROW 4        /* entries of both factors a column, or rows that it touches, up to which they are a line's */
#define REST_FILLED 0.8 /* of the rest that the last column before it reaches: so dense it is */

/* whether all from the k-th column on may be taken as dense, with so many entries of factors before */
static int dense_from(const sd_sparse *lu, int32_t k, int64_t entries)
{
    int64_t m = lu->n - k;
    if (k == 0 || m < REST_LEAST || m > REST_MOST || lu->rows != lu->n || lu->rank != lu->n)
        return 0;
    if (lu->idle || lu->null_pivot != 0.0 || lu->dropped != 0.0 || (lu->most > 0 && entries + m * m > lu->most))
        return 0;
    return lu->l_start[k] - lu->l_start[k - 1] >= REST_FILLED * (double)m;
}

/* where a column pivots: i itself if its own row will do, which stands at `own`, else where its entry is largest; -1: nowhere */
static int32_t rest_pivot(const sd_number *w, int32_t i, int32_t m, int32_t own, double threshold, double *largest)
{
    int32_t best = -1;
    *largest = 0.0;
    for (int32_t p = i; p < m; p++)
        if (sd_size(w[p]) > *largest) {
            *largest = sd_size(w[p]);
            best = p;
        }
    return best >= 0 && own >= i && sd_size(w[own]) >= threshold * *largest ? own : best;
}

static void swap(sd_number *one, sd_number *other)
{
    sd_number value = *one;
    *one = *other;
    *other = value;
}

/* the rows at i and at `best` change places in the columns of L before, from the k-th on, and in those from i on in `rest` */
static void exchange(sd_sparse *lu, int32_t k, int32_t i, int32_t best, int32_t m, sd_number *rest, int32_t *row, int32_t *at)
{
    if (best == i)
        return;
    for (int32_t j = 0; j < i; j++)
        swap(lu->l_value + lu->l_start[k + j] + i - j - 1, lu->l_value + lu->l_start[k + j] + best - j - 1);
    for (int32_t j = i; j < m; j++)
        swap(rest + (size_t)j * m + i, rest + (size_t)j * m + best);
    int32_t r = row[i];
    row[i] = row[best];
    row[best] = r;
    at[row[i]] = i;
    at[r] = best;
}

/* the i-th column of the rest as one of both factors */
static void keep_column(sd_sparse *lu, int32_t k, int32_t i, int32_t m, const sd_number *w)
{
    sd_number inverse = lu->inverse[k + i] = 1.0 / w[i], *l = lu->l_value + lu->l_start[k + i];
    for (int32_t p = i + 1; p < m; p++)
        l[p - i - 1] = w[p] * inverse;
    memcpy(lu->u_value + lu->u_start[k + i + 1] - i, w, (size_t)i * sizeof *w);
}

/* the columns of the rest [m, m], the first of them the k-th, as factors; row [m], at [rows]: which row stands where */
static int factor_rest(sd_sparse *lu, const sd_matrix *matrix, int32_t k, int32_t m, sd_number *rest,
                       int32_t *row, int32_t *at, double threshold)
{
    for (int32_t from = 0; from < m; from += PANEL) {
        int32_t to = from + PANEL < m ? from + PANEL : m;
        for (int32_t i = from; i < to; i++) {
            sd_number *w = rest + (size_t)i * m;
            int32_t c = lu->order[k + i], own = lu->own ? lu->own[c] : c;
            lessen_block(lu, k + from, i - from, m - from - 1, w + from);
            double size = column_size(matrix, c), largest;
            int32_t best = rest_pivot(w, i, m, lu->paired && lu->place[own] < 0 ? at[own] : -1, threshold, &largest);
            double relative = size > 0.0 ? largest / size : 0.0;
            if (relative < lu->smallest) {
                lu->smallest = relative;
                lu->bad_column = c;
                lu->bad_row = row[best < 0 ? i : best];
            }
            if (best < 0 || !isfinite(largest)) {
                lu->bad_column = c;
                lu->bad_row = row[best < 0 ? i : best];
                return 1;
            }
            exchange(lu, k, i, best, m, rest, row, at);
            lu->place[row[i]] = k + i;
            lu->source[k + i] = row[i];
            keep_column(lu, k, i, m, w);
        }
        for (int32_t j = to; j < m; j++)
            lessen_block(lu, k + from, to - from, m - from - 1, rest + (size_t)j * m + from);
    }
    return 0;
}

/* entries of both factors are those of a line */
static inline int is_line(const sd_sparse *lu)
{
    return (int64_t)lu->l_start[lu->n] + lu->u_start[lu->n] <= NARROW * (int64_t)lu->n;
}

static inline int is_long(const sd_sparse *lu)
{
    return lu->paired && lu->n > LONG;
}

/* 1: the k-th column, in which `largest` is left, may keep the pivot that it had */
static int keeps_pivot(sd_sparse *lu, const sd_matrix *matrix, int32_t k, sd_number pivot, double largest)
{
    double relative = largest > 0.0 ? sd_size(pivot) / largest : 0.0;
    if (lu->null_pivot > 0.0 && largest < lu->null_pivot * column_size(matrix, lu->order[k])) /* it may be left out now */
        relative = 0.0;
    lu->smallest = relative < lu->smallest ? relative : lu->smallest;
    const double least = lu->paired > 1 ? FAINT_PIVOT : is_line(lu) && is_long(lu) ? GROWN : UNHEALTHY;
    return relative >= least && isfinite(sd_size(pivot));
}

/* the i-th column of the rest, with all before it taken from it, on the pivot that it had; 1: that became unhealthy */
static int renew_column(sd_sparse *lu, const sd_matrix *matrix, int32_t k, int32_t i, int32_t m,
                        const sd_number *w)
{
    double largest = 0.0;
    for (int32_t p = i; p < m; p++)
        largest = sd_size(w[p]) > largest ? sd_size(w[p]) : largest;
    if (!keeps_pivot(lu, matrix, k + i, w[i], largest))
        return 1;
    keep_column(lu, k, i, m, w);
    return 0;
}

/* the same on the pivots that these columns had, rows in their order: 0 done, 1 one of them became unhealthy */
static int refactor_rest(sd_sparse *lu, const sd_matrix *matrix, int32_t k, int32_t m, sd_number *rest)
{
    for (int32_t from = 0; from < m; from += PANEL) {
        int32_t to = from + PANEL < m ? from + PANEL : m;
        for (int32_t i = from; i < to; i++) {
            lessen_block(lu, k + from, i - from, m - from - 1, rest + (size_t)i * m + from);
            if (renew_column(lu, matrix, k, i, m, rest + (size_t)i * m))
                return 1;
        }
        for (int32_t j = to; j < m; j++)
            lessen_block(lu, k + from, to - from, m - from - 1, rest + (size_t)j * m + from);
    }
    return 0;
}

#endif
