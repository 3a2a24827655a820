/* Orders and lists of operations for small matrices: see elimination.h. */
#include "linear/elimination/elimination.h"

#include "linear/lanes.h"
#include "linear/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define GROWTH 1e4         /* of multipliers, where a solution is a correction that the next one corrects */
#define WEAK SD_HALF_OF_ITS_DIGITS /* pivots below this part of their column are for exchanges and refinement (linear.c) */
#define FIRST 3            /* matrices seen before an order is looked for, if nobody says more: one-off systems do not pay, */
#define SHARE 8            /* nor do large ones before this part of n */
#define MISSES 3           /* matrices that an order did not serve, each of which costs a fortieth of a search, before another is */
#define PAIRS 8000         /* longer lists are no longer straight: they leave the nearest cache */

static int32_t right(const sd_elimination *e, int32_t k) { return e->factors + k; }
static int32_t magnitude(const sd_elimination *e, int32_t k) { return e->factors + e->n + k; }
static int32_t size_of(const sd_elimination *e, int32_t k) { return e->factors + 2 * e->n + k; }
static int32_t growth_of(const sd_elimination *e, int32_t k) { return e->factors + 3 * e->n + k; }

static void drop_order(sd_elimination *e)
{
    e->ready = 0;
    sd_list_clear(&e->factor);
    sd_list_clear(&e->solve);
    free(e->cell);
    e->cell = NULL;
}

static void free_one(sd_elimination *e)
{
    drop_order(e);
    free(e->sample);
    free(e->pivot_row);
    free(e->weak);
    free(e);
}

static void free_others(sd_elimination *e)
{
    while (e->other) {
        sd_elimination *other = e->other;
        e->other = other->other;
        free_one(other);
    }
}

void sd_elimination_forget(sd_elimination *elimination)
{
    sd_elimination *e = elimination;
    free_others(e);
    drop_order(e);
    e->samples = e->seen = e->missed = 0;
    e->tries = e->since = e->served = 0;
    e->serves = e;
    e->wait = e->first > e->n / SHARE ? e->first : e->n / SHARE;
}

void sd_elimination_free(sd_elimination *elimination)
{
    if (!elimination)
        return;
    free_others(elimination);
    free_one(elimination);
}

sd_elimination *sd_elimination_new(int32_t n, const int32_t *column, const int32_t *row)
{
    sd_elimination *e = calloc(1, sizeof *e);
    if (!e)
        return NULL;
    e->n = n;
    e->entries = column[n];
    e->column = column;
    e->row = row;
    e->sample = calloc(SD_SAMPLES * (size_t)e->entries + 1, sizeof(sd_number));
    e->pivot_row = calloc(2 * (size_t)n + 1, sizeof(int32_t));
    e->weak = calloc((size_t)n + 1, sizeof(double));
    if (!e->sample || !e->pivot_row || !e->weak) {
        free_one(e);
        return NULL;
    }
    e->pivot_column = e->pivot_row + n;
    e->growth = GROWTH;
    e->orders = SD_ORDERS;
    e->first = FIRST;
    sd_elimination_forget(e);
    return e;
}

/* --- the lists -------------------------------------------------------------------------------------------------- */

/* the factor at pivot places (i, k): its entry less products of what is left of it, at places `left`, and above it */
static int list_factor(sd_elimination *e, const int32_t *cell, const int32_t *source, const int32_t *left, int32_t i, int32_t k)
{
    int32_t n = e->n, failed = 0;
    for (; *left < i && *left < k; left++)
        if (cell[*left * n + k] >= 0)
            failed |= sd_list_pair(&e->factor, cell[i * n + *left], cell[*left * n + k]);
    enum sd_sum_kind kind = k < i ? SD_SUM_TIMES : k == i ? SD_SUM_INVERSE : SD_SUM_PLAIN;
    return failed | sd_list_sum(&e->factor, kind, cell[i * n + k], source[i * n + k], cell[k * n + k]);
}

/* row i of the factors, its size before and the growth of its multipliers; left [n + 1]: work */
static int list_row(sd_elimination *e, const int32_t *cell, const int32_t *source, int32_t *left, int32_t i)
{
    int32_t n = e->n, failed = 0, filled = 0;
    for (int32_t k = 0; k < n; k++)
        if (source[i * n + k] >= 0)
            failed |= sd_list_pair(&e->factor, source[i * n + k], magnitude(e, k));
    failed |= sd_list_sum(&e->factor, SD_SUM_LARGEST, size_of(e, i), -1, -1);
    for (int32_t k = 0; k < n; k++)
        if (cell[i * n + k] >= 0)
            left[filled++] = k;
    left[filled] = n;
    for (int32_t f = 0; f < filled; f++)
        failed |= list_factor(e, cell, source, left, i, left[f]);
    for (int32_t f = 0; left[f] < i; f++)
        failed |= sd_list_pair(&e->factor, cell[i * n + left[f]], size_of(e, left[f]));
    return failed | sd_list_sum(&e->factor, SD_SUM_LARGEST, growth_of(e, i), -1, -1);
}

static int list_solution(sd_elimination *e, const int32_t *cell)
{
    int32_t n = e->n, failed = 0;
    for (int32_t i = 0; i < n; i++) {
        for (int32_t k = 0; k < i; k++)
            if (cell[i * n + k] >= 0)
                failed |= sd_list_pair(&e->solve, cell[i * n + k], right(e, k));
        failed |= sd_list_sum(&e->solve, SD_SUM_PLAIN, right(e, i), e->inside + e->pivot_row[i], -1);
    }
    for (int32_t i = n - 1; i >= 0; i--) {
        for (int32_t k = i + 1; k < n; k++)
            if (cell[i * n + k] >= 0)
                failed |= sd_list_pair(&e->solve, cell[i * n + k], e->inside + e->pivot_column[k]);
        failed |= sd_list_sum(&e->solve, SD_SUM_TIMES, e->inside + e->pivot_column[i], right(e, i), cell[i * n + i]);
    }
    return failed;
}

/* cell [n][n]: numbers of the factors, source [n][n]: entries of the matrix behind the cells; by pivot places, -1: none;
 * place [n]: work */
static void number_cells(sd_elimination *e, const char *entry, int32_t *cell, int32_t *source, int32_t *place)
{
    int32_t n = e->n;
    e->factors = n; /* inverse pivots first */
    for (int32_t i = 0; i < n; i++)
        for (int32_t k = 0; k < n; k++)
            cell[i * n + k] = k == i ? k : entry[e->pivot_column[k] * n + e->pivot_row[i]] ? e->factors++ : -1;
    e->inside = e->factors + 4 * n;
    memset(source, -1, (size_t)n * (size_t)n * sizeof *source);
    for (int32_t i = 0; i < n; i++)
        place[e->pivot_row[i]] = i;
    for (int32_t k = 0; k < n; k++)
        for (int32_t p = e->column[e->pivot_column[k]]; p < e->column[e->pivot_column[k] + 1]; p++)
            source[place[e->row[p]] * n + k] = e->inside + p;
}

/* below what a pivot is weak: by the largest entry of its column in the newest matrix */
static void measure_columns(sd_elimination *e)
{
    const sd_number *newest = e->sample + (size_t)(e->samples - 1) * (size_t)e->entries;
    for (int32_t k = 0; k < e->n; k++) {
        double largest = 0.0;
        for (int32_t p = e->column[e->pivot_column[k]]; p < e->column[e->pivot_column[k] + 1]; p++)
            largest = fmax(largest, sd_size(newest[p]));
        e->weak[k] = WEAK * largest;
    }
}

static int write_lists(sd_elimination *e, const char *entry)
{
    size_t all = (size_t)e->n * (size_t)e->n;
    int32_t *cell = malloc((2 * all + (size_t)e->n + 1) * sizeof *cell), *source = cell + all, *work = source + all, failed = 0;
    if (!cell)
        return 2;
    number_cells(e, entry, cell, source, work);
    e->cell = calloc((size_t)(e->inside + (e->entries > e->n ? e->entries : e->n)), sizeof(sd_number));
    for (int32_t i = 0; i < e->n && !failed; i++)
        failed = list_row(e, cell, source, work, i);
    failed = failed || !e->cell || list_solution(e, cell) || e->factor.pairs + e->solve.pairs > PAIRS;
    free(cell);
    return failed;
}

/* an order for the newest matrix and as many of those before it as one order fits */
static void prepare(sd_elimination *e)
{
    char *entry = malloc((size_t)e->n * (size_t)e->n + 1);
    int failed = entry == NULL;
    drop_order(e);
    for (int32_t samples = e->samples; samples > 0 && !failed; samples = samples / 2) {
        int none = sd_elimination_order(e, samples, entry);
        if (none && samples > 1)
            continue;
        failed = none || write_lists(e, entry);
        break;
    }
    free(entry);
    if (failed) {
        drop_order(e);
        return;
    }
    measure_columns(e);
    e->prepared++;
    e->ready = e->scaled = 1; /* its magnitudes are still to be written */
}

/* Who learns of a matrix that no order served: one that has none yet, or that served longest ago. */
static sd_elimination *pupil(sd_elimination *first)
{
    sd_elimination *found = first, *last = first;
    int orders = 0;
    for (sd_elimination *e = first; e; last = e, e = e->other, orders++) {
        if (!e->ready)
            return e;
        found = e->served < found->served ? e : found;
    }
    if (orders < first->orders && (last->other = sd_elimination_new(first->n, first->column, first->row))) {
        last->other->growth = first->growth;
        last->other->since = first->tries;
        found = last->other;
    }
    return found;
}

void sd_elimination_learn(sd_elimination *elimination, const sd_number *scaled)
{
    sd_elimination *e = pupil(elimination);
    size_t size = (size_t)e->entries;
    e->seen++;
    e->missed += e->ready;
    int due = elimination->tries - e->since >= e->wait && (!e->ready || e->missed >= MISSES);
    if (due || !(e->seen & (e->seen - 1))) { /* of the first ones the 1st, 2nd, 4th, ... */
        if (e->samples == SD_SAMPLES)
            memmove(e->sample, e->sample + size, (size_t)--e->samples * size * sizeof(sd_number));
        memcpy(e->sample + (size_t)e->samples++ * size, scaled, size * sizeof(sd_number));
    }
    if (!due)
        return;
    e->since = elimination->tries;
    e->missed = 0;
    e->wait += e->wait / 2; /* where no order lasts, looking for one stays cheap */
    prepare(e);
}

/* --- new values -------------------------------------------------------------------------------------------------- */

/* one sum; every place, also those of the caller's array, is one of `cell` */
static inline sd_number sum_of(const sd_sum *sum, const int32_t *pair, const sd_number *cell)
{
    sd_number value = sum->source < 0 ? 0.0 : cell[sum->source];
    if (sum->kind == SD_SUM_LARGEST) {
        double most = 0.0;
        for (int32_t p = sum->first; p < sum->last; p++) {
            double size = sd_size(cell[pair[2 * p]] * cell[pair[2 * p + 1]]);
            most = most > size ? most : size;
        }
        return most;
    }
    for (int32_t p = sum->first; p < sum->last; p++)
        value -= cell[pair[2 * p]] * cell[pair[2 * p + 1]];
    if (sum->kind == SD_SUM_TIMES)
        return value * cell[sum->by];
    return sum->kind == SD_SUM_INVERSE ? sd_inverse(value) : value;
}

/* outside [count]: the caller's array, which stands behind the cells meanwhile */
static void interpret(sd_elimination *e, const sd_list *list, const sd_number *outside, int32_t count)
{
    sd_number *cell = e->cell;
    memcpy(cell + e->inside, outside, (size_t)count * sizeof *cell);
    for (const sd_sum *sum = list->sum, *end = sum + list->sums; sum < end; sum++)
        cell[sum->target] = sum_of(sum, list->pair, cell);
}

/* multipliers of the newest factors are moderate, and what is left of each pivot's column is more than round-off */
static int is_healthy(const sd_elimination *e)
{
    const sd_number *inverse = e->cell, *size = e->cell + size_of(e, 0), *growth = e->cell + growth_of(e, 0);
    const sd_number *scale = e->cell + magnitude(e, 0);
    const double *weak = e->weak;
    for (int32_t k = 0; k < e->n; k++) { /* one by one: they were written so, and are not at hand in lanes */
        double row = sd_size(size[k]);
        if (!(sd_size(growth[k]) <= e->growth * row) || !(sd_size(inverse[k]) * row * weak[k] <= sd_size(scale[k])))
            return 0;
    }
    return 1;
}

/* the magnitudes of the pivots' columns; NULL: all of size one */
static SD_APART void measure(sd_elimination *e, const double *scale)
{
    sd_number *magnitudes = e->cell + magnitude(e, 0);
    const int32_t *column = e->pivot_column, n = e->n;
    e->scaled = scale != NULL;
    if (!scale)
        for (int32_t k = 0; k < n; k++)
            magnitudes[k] = 1.0;
    else {
#pragma GCC unroll 4
        for (int32_t k = 0; k < n; k++)
            magnitudes[k] = scale[column[k]];
    }
}

/* by the order of this one */
static int factor(sd_elimination *e, const sd_number *values, const double *scale)
{
    if (!e->ready)
        return 0;
    if (scale || e->scaled)
        measure(e, scale);
    interpret(e, &e->factor, values, e->entries);
    return is_healthy(e);
}

int sd_elimination_factor(sd_elimination *elimination, const sd_number *values, const double *scale)
{
    sd_elimination *const first = elimination, *const last = first->serves;
    first->tries++;
    int found = factor(last, values, scale);
    for (sd_elimination *e = first; e && !found; e = e->other)
        if (e != last && (found = factor(e, values, scale)))
            first->serves = e;
    if (found)
        first->serves->served = first->tries;
    return found;
}

void sd_elimination_solve(sd_elimination *elimination, sd_number *x)
{
    sd_elimination *e = elimination->serves;
    interpret(e, &e->solve, x, e->n);
    memcpy(x, e->cell + e->inside, (size_t)e->n * sizeof *x);
}
