/* The order of pivots of an elimination (elimination.h): Markowitz's, with threshold pivoting in several matrices at once. */
#include "linear/elimination/elimination.h"
#include "linear/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STRONG SD_PIVOT /* a pivot is no smaller than this part of its column in the newest matrix */
#define OLDER 0.01         /* and in those before */

/* Matrices in full while they are eliminated: value [samples][n][n] by columns, zero outside the pattern; entry [n][n] by
 * columns: in the pattern, with what was filled.  Of what is left: row, column [open], place [n] of each row in `row`; of
 * each column c its rows below[c*n], as many as column_left[c]; counts of entries; size [n][SD_SAMPLES]: largest entries
 * of columns, -1 where they are not known */
typedef struct sd_full {
    int32_t n, samples, open;
    sd_number *value;
    char *entry;
    int32_t *row, *column, *place, *row_left, *column_left, *below;
    double *size;
} sd_full;

static void full_free(sd_full *full)
{
    free(full->value);
    free(full->entry);
    free(full->row);
    free(full->size);
}

static int32_t *rows_of(const sd_full *full, int32_t c) { return full->below + (size_t)c * (size_t)full->n; }

/* the largest of a column's entries that are left, of each matrix, where it is not known */
static void measure_column(const sd_full *full, int32_t c)
{
    if (full->size[c * SD_SAMPLES] >= 0.0)
        return;
    const size_t n = (size_t)full->n;
    const int32_t *row = rows_of(full, c), *end = row + full->column_left[c];
    for (int32_t s = 0; s < full->samples; s++) {
        const sd_number *column = full->value + ((size_t)s * n + (size_t)c) * n;
        double most = 0.0;
        for (const int32_t *i = row; i < end; i++) {
            double size = sd_size(column[*i]);
            most = size > most ? size : most;
        }
        full->size[c * SD_SAMPLES + s] = most;
    }
}

static void add_entry(sd_full *full, int32_t r, int32_t c)
{
    full->entry[(size_t)c * (size_t)full->n + (size_t)r] = 1;
    rows_of(full, c)[full->column_left[c]++] = r;
    full->row_left[r]++;
}

/* entries of the newest matrices in their places.  0; 1: one place has two entries */
static int fill_in(sd_full *full, const sd_elimination *e)
{
    size_t n = (size_t)full->n, entries = (size_t)e->entries;
    const sd_number *sample = e->sample + (size_t)(e->samples - full->samples) * entries;
    memset(full->value, 0, (size_t)full->samples * n * n * sizeof *full->value);
    for (size_t j = 0; j < n; j++)
        for (int32_t k = e->column[j]; k < e->column[j + 1]; k++) {
            size_t place = j * n + (size_t)e->row[k];
            if (full->entry[place])
                return 1;
            add_entry(full, e->row[k], (int32_t)j);
            for (size_t s = 0; s < (size_t)full->samples; s++)
                full->value[s * n * n + place] = sample[s * entries + (size_t)k];
        }
    for (int32_t k = 0; k < full->n; k++)
        full->row[k] = full->column[k] = full->place[k] = k;
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
    full->row = calloc(5 * n + all + 1, sizeof(int32_t));
    full->size = malloc((SD_SAMPLES * n + 1) * sizeof(double));
    int failed = !full->value || !full->entry || !full->row || !full->size ? 2 : 0;
    if (!failed) {
        full->column = full->row + n;
        full->place = full->column + n;
        full->row_left = full->place + n;
        full->column_left = full->row_left + n;
        full->below = full->column_left + n;
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

/* the entry that fills least of those large enough, of these the largest: its row and its place among the columns that
 * are left.  0: there is none */
static int choose_pivot(const sd_full *full, int32_t *row, int32_t *column)
{
    int64_t least = INT64_MAX;
    double best = 0.0;
    int32_t fewest = full->n;
    *row = *column = -1;
    for (int32_t i = 0; i < full->open; i++)
        fewest = full->row_left[full->row[i]] < fewest ? full->row_left[full->row[i]] : fewest;
    for (int32_t j = 0; j < full->open; j++) {
        int32_t c = full->column[j], others = full->column_left[c] - 1;
        if ((int64_t)(fewest - 1) * others > least)
            continue;
        for (const int32_t *r = rows_of(full, c), *end = r + others; r <= end; r++) {
            int64_t fill = (int64_t)(full->row_left[*r] - 1) * others;
            if (fill > least)
                continue;
            double healthy = health(full, *r, c);
            int alike = fill == least && healthy == best && j == *column; /* the first row, wherever the column lists it */
            if (healthy >= 1.0 && (fill < least || healthy > best || (alike && full->place[*r] < full->place[*row]))) {
                least = fill;
                best = healthy;
                *row = *r;
                *column = j;
            }
        }
    }
    return least < INT64_MAX;
}

/* takes r from the rows of column c that are left */
static void take_row(sd_full *full, int32_t r, int32_t c)
{
    int32_t *row = rows_of(full, c), last = row[--full->column_left[c]];
    while (*row != r)
        row++;
    *row = last;
}

/* column c, without row r, less what that row of the pivot's column p makes of it */
static void take_column(sd_full *full, int32_t r, int32_t p, int32_t c)
{
    const size_t n = (size_t)full->n;
    const int32_t *row = rows_of(full, p), *end = row + full->column_left[p];
    take_row(full, r, c);
    for (const int32_t *i = row; i < end; i++)
        if (!full->entry[(size_t)c * n + (size_t)*i])
            add_entry(full, *i, c);
    for (size_t s = 0; s < (size_t)full->samples; s++) {
        const sd_number *own = full->value + (s * n + (size_t)p) * n;
        sd_number *across = full->value + (s * n + (size_t)c) * n, by = across[r];
        for (const int32_t *i = row; i < end; i++)
            across[*i] -= own[*i] * by;
    }
    full->size[c * SD_SAMPLES] = -1.0;
}

/* eliminates with the pivot in row r and at place j of the columns that are left */
static void take(sd_full *full, int32_t r, int32_t j)
{
    size_t n = (size_t)full->n;
    int32_t p = full->column[j], last = full->row[--full->open];
    full->column[j] = full->column[full->open];
    full->row[full->place[r]] = last;
    full->place[last] = full->place[r];
    take_row(full, r, p);
    const int32_t *row = rows_of(full, p), *end = row + full->column_left[p];
    for (const int32_t *i = row; i < end; i++)
        full->row_left[*i]--;
    for (size_t s = 0; s < (size_t)full->samples; s++) {
        sd_number *own = full->value + (s * n + (size_t)p) * n;
        for (const int32_t *i = row; i < end; i++)
            own[*i] /= own[r];
    }
    for (int32_t k = 0; k < full->open; k++)
        if (full->entry[(size_t)full->column[k] * n + (size_t)r])
            take_column(full, r, p, full->column[k]);
}

int sd_elimination_order(sd_elimination *e, int32_t samples, char *entry)
{
    sd_full full;
    int failed = full_new(&full, e, samples);
    if (failed)
        return failed;
    for (int32_t k = 0; k < e->n; k++) {
        int32_t row, column;
        failed = !choose_pivot(&full, &row, &column);
        if (failed)
            break;
        e->pivot_row[k] = row;
        e->pivot_column[k] = full.column[column];
        take(&full, row, column);
    }
    memcpy(entry, full.entry, (size_t)e->n * (size_t)e->n);
    full_free(&full);
    return failed;
}
