/* The search for pivots of sparse.c: columns are eliminated from the left, and each takes the sparsest row whose entry is near the
 * largest of what is left of it. */
#ifndef SYSDYN_PIVOTS_H
#define SYSDYN_PIVOTS_H

#include "linear/sparse/blocks.h"
#include "linear/sparse/dense_rest.h"
#include "linear/sparse/substitute.h"
#include "linear/tuning.h"

#define THRESHOLD SD_PIVOT /* a sparser row may pivot if its entry is this close to the largest */
#define ROOM 2           /* entries of a factor for each of the matrix: room for them */
#define SMALL 10000      /* columns up to which room that was not taken is kept for the next pivoting */

/* where the rows that a position leads to end: in a block the first leads to all others */
static inline int32_t last_ahead(const sd_sparse *lu, int32_t k)
{
    return lu->first[k + 1] == lu->first[k] ? lu->l_start[k] + 1 : lu->l_start[k + 1];
}

/* rows reached from column c through the columns of L found so far: stack[top..n) */
static int32_t reach(sd_sparse *lu, const int32_t *column, const int32_t *row, int32_t c, int32_t stamp)
{
    int32_t top = lu->rows;
    for (int32_t e = column[c]; e < column[c + 1]; e++) {
        int32_t depth = 0;
        if (lu->mark[row[e]] == stamp)
            continue;
        lu->stack[0] = row[e]; /* the search path grows from the left, the result from the right */
        lu->mark[row[e]] = stamp;
        lu->head[0] = lu->place[row[e]] < 0 ? 0 : lu->l_start[lu->place[row[e]]];
        while (depth >= 0) {
            int32_t here = lu->stack[depth], k = lu->place[here], down = -1;
            int32_t last = k < 0 ? 0 : last_ahead(lu, k);
            for (int32_t p = lu->head[depth]; k >= 0 && p < last; p++) {
                if (lu->mark[lu->l_row[p]] != stamp) {
                    down = lu->l_row[p];
                    lu->head[depth] = p + 1;
                    break;
                }
            }
            if (down < 0) {
                lu->stack[--top] = here;
                depth--;
                continue;
            }
            depth++;
            lu->stack[depth] = down;
            lu->mark[down] = stamp;
            lu->head[depth] = lu->place[down] < 0 ? 0 : lu->l_start[lu->place[down]];
        }
    }
    return top;
}

/* room for one more column of L and of U */
static int grow(int64_t need, int64_t *room, int32_t **rows, sd_number **values)
{
    if (need <= *room)
        return 0;
    int64_t more = 2 * *room > need ? 2 * *room : need;
    int32_t *r = realloc(*rows, (size_t)more * sizeof *r);
    if (!r)
        return 2;
    *rows = r;
    sd_number *v = realloc(*values, (size_t)more * sizeof *v);
    if (!v)
        return 2;
    *values = v;
    *room = more;
    return 0;
}

/* part of the largest entry from which a row will do that a column has for its own */
static double own_threshold(const sd_sparse *lu, double threshold)
{
    return lu->paired > 1 && threshold > FAINT_PIVOT ? FAINT_PIVOT : threshold;
}

/* whether the own row of column c pivots there, which touches rows stack[top..) and whose largest entry is known */
static int takes_own(const sd_sparse *lu, const sd_matrix *matrix, int32_t c, int32_t own, int32_t top, double threshold,
                     double largest)
{
    double size = sd_size(lu->x[own]), before = 0.0;
    if (!lu->paired || lu->place[own] >= 0 || !(largest > 0.0))
        return 0;
    if (size >= own_threshold(lu, threshold) * largest)
        return 1;
    if (!is_long(lu) || lu->rows - top > NARROW || size < GROWN * largest)
        return 0;
    const sd_number *value = sd_column_of(matrix, c);
    for (int32_t e = matrix->column[c]; e < matrix->column[c + 1]; e++, value++)
        before = matrix->row[e] == own ? sd_size(*value) : before;
    return size >= before;
}

/* the row that pivots in column c: the sparsest among those whose entry is near the largest; -1 where all are zero */
static int32_t choose(const sd_sparse *lu, const sd_matrix *matrix, int32_t c, int32_t top, double *largest)
{
    int32_t best = -1;
    *largest = 0.0;
    for (int32_t i = top; i < lu->rows; i++)
        if (lu->place[lu->stack[i]] < 0 && sd_size(lu->x[lu->stack[i]]) > *largest)
            *largest = sd_size(lu->x[lu->stack[i]]);
    /* what is left below a part of its column must be what the matrix lacks */
    double threshold = lu->idle && lu->null_pivot > SD_LEAST_PIVOT ? 1.0 : THRESHOLD;
    int32_t own = lu->own ? lu->own[c] : c;
    if (takes_own(lu, matrix, c, own, top, threshold, *largest))
        return own;
    for (int32_t i = top; i < lu->rows && *largest > 0.0; i++) {
        int32_t r = lu->stack[i];
        if (lu->place[r] >= 0 || sd_size(lu->x[r]) < threshold * *largest)
            continue;
        if (best < 0 || lu->count[r] < lu->count[best] || (lu->count[r] == lu->count[best] && r < best))
            best = r;
    }
    return best;
}

/* lets go of the factors */
static void leave(sd_sparse *lu)
{
    free(lu->l_row), free(lu->u_row), free(lu->l_value), free(lu->u_value);
    lu->l_row = lu->u_row = NULL;
    lu->l_value = lu->u_value = NULL;
    lu->l_room = lu->u_room = 0;
}

/* room for factors of which nothing is known but the entries of their matrix */
static int begin(sd_sparse *lu, int64_t entries)
{
    int64_t room = ROOM * entries + lu->n;
    return grow(room, &lu->l_room, &lu->l_row, &lu->l_value) || grow(room, &lu->u_room, &lu->u_row, &lu->u_value);
}

/* lets go of what the columns of one factor have not taken */
static void fit(int64_t taken, int64_t *room, int32_t **rows, sd_number **values)
{
    size_t kept = (size_t)taken + 1;
    if ((int64_t)kept >= *room)
        return;
    int32_t *r = realloc(*rows, kept * sizeof *r);
    *rows = r ? r : *rows;
    sd_number *v = realloc(*values, kept * sizeof *v);
    *values = v ? v : *values;
    *room = (int64_t)kept;
}

/* x := column c, eliminated with the finished columns behind nu entries of U; how many these are, the rows are stack[top..) */
static int32_t reduce(sd_sparse *lu, const sd_matrix *matrix, int32_t c,
                      int32_t stamp, int64_t nu, int32_t *top)
{
    int32_t reached = 0, first = matrix->column[c], number = matrix->column[c + 1] - first;
    *top = reach(lu, matrix->column, matrix->row, c, stamp);
    const sd_number *value = sd_column_of(matrix, c);
    for (int32_t e = 0; e < number; e++)
        lu->x[matrix->row[first + e]] += value[e];
    for (int32_t i = *top; i < lu->rows; i++) {
        int32_t j = lu->place[lu->stack[i]];
        if (j >= 0)
            lu->u_row[nu + reached++] = j;
    }
    ascend(reached, lu->u_row + nu, lu->among);
    apply_columns(lu, reached, lu->u_row + nu, lu->source, lu->u_value + nu, lu->x, lu->block);
    return reached;
}

/* all from the k-th column on, behind nl and nu entries of the factors: 0 done, 1 singular, 2 memory */
static int eliminate_rest(sd_sparse *lu, const sd_matrix *matrix, int32_t k,
                          int64_t nl, int64_t nu)
{
    int32_t n = lu->n, m = n - k, failed = 0;
    sd_number *rest = calloc((size_t)m * (size_t)m, sizeof *rest);
    int32_t *own = malloc(((size_t)m + (size_t)n) * sizeof *own), *at = own ? own + m : NULL;
    if (!rest || !own || grow(nl + (int64_t)m * (m - 1) / 2, &lu->l_room, &lu->l_row, &lu->l_value))
        failed = 2;
    for (int32_t r = 0, i = 0; r < n && !failed; r++)
        if (lu->place[r] < 0) {
            own[i] = r;
            at[r] = i++;
        }
    lu->l_start[k] = (int32_t)nl;
    for (int32_t i = 0; i < m && !failed; i++) {
        int32_t c = lu->order[k + i];
        lu->u_start[k + i] = (int32_t)nu;
        if (grow(nu + k + i, &lu->u_room, &lu->u_row, &lu->u_value)) {
            failed = 2;
            break;
        }
        int32_t top = 0, reached = reduce(lu, matrix, c, k + i, nu, &top);
        for (int32_t p = top; p < n; p++) {
            int32_t r = lu->stack[p];
            if (lu->place[r] < 0)
                rest[(size_t)i * m + at[r]] = lu->x[r];
            lu->x[r] = 0.0;
        }
        nu += reached;
        for (int32_t p = 0; p < i; p++)
            lu->u_row[nu++] = k + p;
        nl += m - i - 1;
        lu->l_start[k + i + 1] = (int32_t)nl;
        lu->u_start[k + i + 1] = (int32_t)nu;
    }
    if (!failed)
        failed = factor_rest(lu, matrix, k, m, rest, own, at, own_threshold(lu, THRESHOLD));
    lu->rest = failed ? n : k;
    for (int32_t i = 0; i < m && !failed; i++) {
        lu->first[k + i] = k;
        memcpy(lu->l_row + lu->l_start[k + i], own + i + 1, (size_t)(m - i - 1) * sizeof *own);
    }
    free(rest);
    free(own);
    return failed;
}

/* in the numbers of the pivots, without rows that have none */
static void number_rows(sd_sparse *lu)
{
    int64_t kept = 0, p = 0;
    for (int32_t r = 0; r < lu->rows && lu->rows > lu->rank; r++)
        if (lu->place[r] < 0)
            lu->place[r] = lu->n;
    for (int32_t k = 0; k < lu->n; k++) {
        for (; p < lu->l_start[k + 1]; p++) {
            lu->l_row[kept] = lu->place[lu->l_row[p]];
            lu->l_value[kept] = lu->l_value[p];
            kept += lu->l_row[kept] < lu->n;
        }
        lu->l_start[k + 1] = (int32_t)kept;
    }
    lu->pivoted = 1;
}

/* with room for the search */
static int pivot_all(sd_sparse *lu, const sd_matrix *matrix)
{
    int32_t n = lu->n, rows = lu->rows;
    int64_t nl = 0, nu = 0;
    lu->pivoted = 0;
    lu->smallest = 1.0;
    lu->rank = lu->rest = n;
    for (int32_t i = 0; i < rows; i++) {
        lu->place[i] = -1;
        lu->mark[i] = -1;
        lu->x[i] = 0.0;
    }
    for (int32_t k = 0; k <= n; k++)
        lu->first[k] = -1;
    for (int32_t k = 0; k < n; k++) {
        int32_t c = lu->order[k];
        if (lu->most > 0 && nl + nu > lu->most) {
            leave(lu);
            return 3;
        }
        if (dense_from(lu, k, nl + nu)) {
            int failed = eliminate_rest(lu, matrix, k, nl, nu);
            if (!failed)
                number_rows(lu);
            return failed;
        }
        int32_t pivots = k - (n - lu->rank); /* columns that were left out have taken no row */
        if (grow(nl + rows - pivots, &lu->l_room, &lu->l_row, &lu->l_value) || grow(nu + k, &lu->u_room, &lu->u_row, &lu->u_value))
            return 2;
        lu->l_start[k] = (int32_t)nl;
        lu->u_start[k] = (int32_t)nu;
        int32_t top = 0, reached = reduce(lu, matrix, c, k, nu, &top);
        double size = column_size(matrix, c);
        nu += reached;
        double largest;
        int32_t pivot = choose(lu, matrix, c, top, &largest);
        double relative = size > 0.0 ? largest / size : 0.0;
        if (relative < lu->null_pivot && (!lu->idle || lu->idle[c])) { /* it follows from the others */
            lu->rank--;
            for (int32_t i = top; i < rows; i++)
                lu->x[lu->stack[i]] = 0.0;
            nu = lu->u_start[k];
            lu->source[k] = -1;
            lu->first[k] = k;
            lu->inverse[k] = 0.0;
            lu->l_start[k + 1] = (int32_t)nl;
            lu->u_start[k + 1] = (int32_t)nu;
            continue;
        }
        if (relative < lu->smallest) {
            lu->smallest = relative;
            lu->bad_column = c;
            lu->bad_row = pivot;
        }
        if (pivot < 0 || !isfinite(largest)) {
            for (int32_t r = 0; r < rows && pivot < 0; r++)
                if (lu->place[r] < 0)
                    lu->bad_row = pivot = r;
            lu->bad_column = c;
            return 1;
        }
        sd_number inverse = 1.0 / lu->x[pivot];
        lu->inverse[k] = inverse;
        lu->place[pivot] = k;
        lu->source[k] = pivot;
        int32_t block = lu->first[k] = block_of(lu, k, rows - top - reached - 1);
        if (block < k) {
            align(lu, block, k, pivot);
            for (int32_t l = lu->l_start[k - 1] + 1; l < lu->l_start[k]; l++) {
                lu->l_row[nl] = lu->l_row[l];
                lu->l_value[nl++] = lu->x[lu->l_row[l]] * inverse;
            }
        }
        for (int32_t i = top; i < rows; i++) {
            int32_t r = lu->stack[i];
            if (block == k && lu->place[r] < 0 && (lu->dropped == 0.0 || sd_size(lu->x[r] * inverse) > lu->dropped)) {
                lu->l_row[nl] = r;
                lu->l_value[nl++] = lu->x[r] * inverse;
            }
            lu->x[r] = 0.0;
        }
        lu->l_start[k + 1] = (int32_t)nl;
        lu->u_start[k + 1] = (int32_t)nu;
    }
    number_rows(lu);
    return 0;
}

/* room for the pivots that are to be chosen; 0: no memory */
static int provide_pivots(sd_sparse *lu)
{
    if (!lu->pivots)
        lu->pivots = calloc((size_t)lu->n + (size_t)lu->rows + 1, sizeof *lu->pivots);
    lu->source = lu->pivots;
    lu->place = lu->pivots ? lu->pivots + lu->n : NULL;
    return lu->pivots != NULL;
}

/* lets go of it where each row pivots in its own column: the order says so, too */
static void leave_pivots(sd_sparse *lu)
{
    if (!lu->position || lu->rank < lu->n || memcmp(lu->source, lu->order, (size_t)lu->n * sizeof *lu->order) != 0)
        return;
    lu->source = (int32_t *)lu->order; /* which nobody writes until pivots are chosen anew */
    lu->place = (int32_t *)lu->position;
    free(lu->pivots);
    lu->pivots = NULL;
}

/* lets go of what pivoting alone needs */
static void leave_search(sd_sparse *lu)
{
    free(lu->stack), free(lu->block), free(lu->among);
    lu->stack = lu->head = lu->mark = lu->count = NULL;
    lu->block = NULL;
    lu->among = NULL;
}

/* a line's are not counted */
static void count_products(sd_sparse *lu)
{
    lu->products = 0;
    lu->entries = (int64_t)lu->l_start[lu->n] + lu->u_start[lu->n] + lu->n;
    for (int32_t p = 0; p < lu->u_start[lu->n] && !is_line(lu); p++)
        lu->products += lu->l_start[lu->u_row[p] + 1] - lu->l_start[lu->u_row[p]];
}

/* room for what the widest block touches; 0: no memory */
static int provide_room(sd_sparse *lu)
{
    free(lu->room);
    lu->room = lu->widest ? malloc((size_t)lu->widest * sizeof *lu->room) : NULL;
    return !lu->widest || lu->room;
}

/* Pivots, and factors by them.  0 done, 1 singular, 2 no memory, 3 more entries than lu->most */
static int search_pivots(sd_sparse *lu, const sd_matrix *matrix)
{
    size_t rows = (size_t)lu->rows;
    lu->stack = calloc(4 * rows + 1, sizeof(int32_t)); /* of a large one the room counts: it is not kept */
    lu->block = malloc((rows + 1) * sizeof(sd_number));
    lu->among = calloc((size_t)lu->n / 64 + 1, sizeof(uint64_t));
    lu->first = lu->first ? lu->first : malloc(((size_t)lu->n + 1) * sizeof *lu->first);
    if (!lu->stack || !lu->block || !lu->among || !lu->first || !provide_pivots(lu)) {
        leave_search(lu);
        return 2;
    }
    lu->head = lu->stack + rows;
    lu->mark = lu->head + rows;
    lu->count = lu->mark + rows;
    const int32_t entries = matrix->column[lu->n];
    for (int32_t e = 0; e < entries; e++)
        lu->count[matrix->row[e]]++;
    unsigned before = sd_no_subnormals();
    int failed = lu->l_room == 0 && begin(lu, entries) ? 2 : pivot_all(lu, matrix);
    sd_subnormals(before);
    if (!failed && lu->n > SMALL) {
        fit(lu->l_start[lu->n], &lu->l_room, &lu->l_row, &lu->l_value);
        fit(lu->u_start[lu->n], &lu->u_room, &lu->u_row, &lu->u_value);
    }
    lu->widest = failed ? 0 : widest_block(lu);
    leave_search(lu);
    if (!failed && !provide_room(lu))
        return 2;
    if (!lu->widest && lu->n > SMALL) { /* no columns fill alike */
        free(lu->first);
        lu->first = NULL;
    }
    if (!failed) {
        leave_pivots(lu);
        count_products(lu);
    }
    return failed;
}

#endif
