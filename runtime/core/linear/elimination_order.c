/* The order of pivots of an elimination (elimination.h): Markowitz's, with threshold pivoting in several matrices at once. */
#include "linear/elimination.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STRONG 0.1         /* a pivot is no smaller than this part of its column in the newest matrix */
#define OLDER 0.01         /* and in those before */

/* Matrices in full while they are eliminated: value [samples][n][n] by columns; left: rows and columns that are left, `open`
 * of both; their counts of entries; size [n][SD_SAMPLES]: largest entries of columns in rows that are left, -1 where
 * they are not known */
typedef struct sd_full {
    int32_t n, samples, open;
    sd_number *value;
    char *entry;                 /* [n][n] by columns: in the pattern, with what was filled */
    int32_t *row, *column, *row_left, *column_left;
    double *size;
} sd_full;

static void full_free(sd_full *full)
{
    free(full->value);
    free(full->entry);
    free(full->row);
    free(full->size);
}

/* the largest of a column's entries that are left, of each matrix, where it is not known */
static void measure_column(const sd_full *full, int32_t c)
{
    if (full->size[c * SD_SAMPLES] >= 0.0)
        return;
    size_t n = (size_t)full->n;
    for (int32_t s = 0; s < full->samples; s++) {
        const sd_number *column = full->value + ((size_t)s * n + (size_t)c) * n; /* zero outside the pattern */
        double most = 0.0;
        for (int32_t i = 0; i < full->open; i++) {
            double size = sd_size(column[full->row[i]]);
            most = size > most ? size : most;
        }
        full->size[c * SD_SAMPLES + s] = most;
    }
}

/* entries of the newest matrices in their places.  0; 1: one place has two entries */
static int fill_in(sd_full *full, const sd_elimination *e)
{
    size_t n = (size_t)full->n, entries = (size_t)e->entries;
    const sd_number *sample = e->sample + (size_t)(e->samples - full->samples) * entries;
    for (size_t j = 0; j < n; j++) {
        for (size_t s = 0; s < (size_t)full->samples; s++)
            memset(full->value + (s * n + j) * n, 0, n * sizeof *full->value);
        for (int32_t k = e->column[j]; k < e->column[j + 1]; k++) {
            size_t place = j * n + (size_t)e->row[k];
            if (full->entry[place])
                return 1;
            full->entry[place] = 1;
            full->row_left[e->row[k]]++;
            full->column_left[j]++;
            for (size_t s = 0; s < (size_t)full->samples; s++)
                full->value[s * n * n + place] = sample[s * entries + (size_t)k];
        }
    }
    for (int32_t k = 0; k < full->n; k++)
        full->row[k] = full->column[k] = k;
    full->open = full->n;
    for (int32_t c = 0; c < full->n; c++)
        full->size[c * SD_SAMPLES] = -1.0;
    return 0;
}

/* the newest `samples` matrices.  0; 2: no memory; 1: one place has two entries */
static int full_new(sd_full *full, const sd_elimination *e, int32_t samples)
{
    size_t n = (size_t)e->n, all = n * n;
    *full = (sd_full){.n = e->n, .samples = samples};
    full->value = malloc(((size_t)samples * all + 1) * sizeof(sd_number));
    full->entry = calloc(all + 1, 1);
    full->row = calloc(4 * n + 1, sizeof(int32_t));
    full->size = calloc(SD_SAMPLES * n + 1, sizeof(double));
    int failed = !full->value || !full->entry || !full->row || !full->size ? 2 : 0;
    if (!failed) {
        full->column = full->row + n;
        full->row_left = full->column + n;
        full->column_left = full->row_left + n;
        failed = fill_in(full, e);
    }
    if (failed)
        full_free(full);
    return failed;
}

/* the least part of its column that an entry is in the older matrices over OLDER, in the newest over STRONG */
static double health(const sd_full *full, int32_t r, int32_t c)
{
    size_t n = (size_t)full->n, place = (size_t)c * n + (size_t)r;
    const double *size = full->size + c * SD_SAMPLES;
    double least = INFINITY;
    measure_column(full, c);
    for (size_t s = 0; s < (size_t)full->samples; s++) {
        double enough = (s + 1 == (size_t)full->samples ? STRONG : OLDER) * size[s], own = sd_size(full->value[s * n * n + place]);
        if (!(own >= enough) || !(enough > 0.0))
            return 0.0;
        least = own < least * enough ? own / enough : least;
    }
    return least;
}

/* where among the rows and columns that are left the entry stands that fills least of those large enough, of these the
 * largest.  0: there is none */
static int choose_pivot(const sd_full *full, int32_t *row, int32_t *column)
{
    int64_t least = INT64_MAX;
    double best = 0.0;
    int32_t fewest = full->n;
    for (int32_t i = 0; i < full->open; i++)
        fewest = full->row_left[full->row[i]] < fewest ? full->row_left[full->row[i]] : fewest;
    for (int32_t j = 0; j < full->open; j++) {
        int32_t c = full->column[j], others = full->column_left[c] - 1;
        const char *entry = full->entry + (size_t)c * (size_t)full->n;
        if ((int64_t)(fewest - 1) * others > least)
            continue;
        for (int32_t i = 0, seen = 0; seen <= others; i++) {
            int32_t r = full->row[i];
            if (!entry[r])
                continue;
            seen++;
            int64_t fill = (int64_t)(full->row_left[r] - 1) * others;
            if (fill > least)
                continue;
            double healthy = health(full, r, c);
            if (healthy >= 1.0 && (fill < least || healthy > best)) {
                least = fill;
                best = healthy;
                *row = i;
                *column = j;
            }
        }
    }
    return least < INT64_MAX;
}

/* column c without what row r of the pivot's column p makes of it */
static void take_column(sd_full *full, int32_t r, int32_t p, int32_t c)
{
    size_t n = (size_t)full->n, across = (size_t)c * n, own = (size_t)p * n;
    for (int32_t k = 0; k < full->open; k++) {
        int32_t i = full->row[k];
        if (!full->entry[own + (size_t)i])
            continue;
        if (!full->entry[across + (size_t)i]) {
            full->entry[across + (size_t)i] = 1;
            full->row_left[i]++;
            full->column_left[c]++;
        }
        for (size_t s = 0; s < (size_t)full->samples; s++) {
            sd_number *a = full->value + s * n * n;
            a[across + (size_t)i] -= a[own + (size_t)i] * a[across + (size_t)r];
        }
    }
    full->size[c * SD_SAMPLES] = -1.0;
}

/* eliminates with the pivot at place i of the rows and j of the columns that are left */
static void take(sd_full *full, int32_t i, int32_t j)
{
    size_t n = (size_t)full->n;
    int32_t r = full->row[i], p = full->column[j];
    full->open--;
    full->row[i] = full->row[full->open];
    full->column[j] = full->column[full->open];
    for (int32_t k = 0; k < full->open; k++) {
        int32_t other = full->row[k];
        if (!full->entry[(size_t)p * n + (size_t)other])
            continue;
        full->row_left[other]--;
        for (size_t s = 0; s < (size_t)full->samples; s++) {
            sd_number *own = full->value + (s * n + (size_t)p) * n;
            own[other] /= own[r];
        }
    }
    for (int32_t k = 0; k < full->open; k++) {
        int32_t c = full->column[k];
        if (!full->entry[(size_t)c * n + (size_t)r])
            continue;
        full->column_left[c]--;
        take_column(full, r, p, c);
    }
}

int sd_elimination_order(sd_elimination *e, int32_t samples, char *entry)
{
    sd_full full;
    int failed = full_new(&full, e, samples);
    if (failed)
        return failed;
    for (int32_t k = 0; k < e->n && !failed; k++) {
        int32_t i, j;
        failed = !choose_pivot(&full, &i, &j);
        if (failed)
            break;
        e->pivot_row[k] = full.row[i];
        e->pivot_column[k] = full.column[j];
        take(&full, i, j);
    }
    memcpy(entry, full.entry, (size_t)e->n * (size_t)e->n);
    full_free(&full);
    return failed;
}
