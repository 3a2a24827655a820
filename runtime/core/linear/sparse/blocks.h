/* Columns of L that fill alike (supernodes: Demmel, Eisenstat, Gilbert, Li & Liu, SIAM J. Matrix Anal. Appl. 20, 1999).
 *
 * Of a block of columns j, j + 1, ... each has the rows of the one before without its first, which is where the next
 * one pivots.  So a block acts on one list of rows: what it touches is copied there and back once, and four columns at
 * a time pass over it.  Behind most of a large elimination stand a few such blocks, nearly dense. */
#ifndef SYSDYN_BLOCKS_H
#define SYSDYN_BLOCKS_H

#include "linear/lanes.h"
#include "linear/sparse/sparse.h"

#include <math.h>
#include <stdint.h>

enum { SD_COLUMNS = 4 }; /* of a block at a time; fewer are applied one by one */
#define SD_SCATTERED 32 /* positions up to which they are put in order one by one */

/* w -= a u[0] + b u[1] + c u[2] + d u[3], numbers in that order */
#ifdef SD_COMPLEX
static SD_WIDE void lessen_four(int32_t n, const sd_number *a, const sd_number *b, const sd_number *c, const sd_number *d,
                                const sd_number *u, sd_number *w)
{
    const sd_number *column[SD_COLUMNS] = {a, b, c, d};
    sd_lanes real[SD_COLUMNS], imaginary[SD_COLUMNS];
    for (int k = 0; k < SD_COLUMNS; k++) {
        double re = creal(u[k]), im = cimag(u[k]);
        real[k] = (sd_lanes){re, re, re, re};
        imaginary[k] = (sd_lanes){-im, im, -im, im};
    }
    int32_t p = 0;
    for (; p + 2 <= n; p += 2) { /* two numbers in four lanes */
        sd_lanes here = SD_FROM((const double *)w, 2 * p);
        for (int k = 0; k < SD_COLUMNS; k++) {
            sd_lanes l = SD_FROM((const double *)column[k], 2 * p);
            here -= l * real[k] + (sd_lanes){l[1], l[0], l[3], l[2]} * imaginary[k];
        }
        SD_AT((double *)w, 2 * p) = here;
    }
    for (; p < n; p++)
        for (int k = 0; k < SD_COLUMNS; k++)
            w[p] -= column[k][p] * u[k];
}
#else
static SD_WIDE void lessen_four(int32_t n, const sd_number *restrict a, const sd_number *restrict b,
                                const sd_number *restrict c, const sd_number *restrict d, const sd_number *restrict u,
                                sd_number *restrict w)
{
    sd_number u0 = u[0], u1 = u[1], u2 = u[2], u3 = u[3];
    for (int32_t p = 0; p < n; p++)
        w[p] = w[p] - a[p] * u0 - b[p] * u1 - c[p] * u2 - d[p] * u3;
}
#endif

/* w less `many` columns of one block from the j-th on; w[0] is where the first pivots, `wide` numbers are behind it */
static void lessen_block(const sd_sparse *lu, int32_t j, int32_t many, int32_t wide, sd_number *w)
{
    int32_t k = 0;
    for (; k + SD_COLUMNS <= many; k += SD_COLUMNS) {
        const sd_number *a = lu->l_value + lu->l_start[j + k], *b = lu->l_value + lu->l_start[j + k + 1];
        const sd_number *c = lu->l_value + lu->l_start[j + k + 2], *d = lu->l_value + lu->l_start[j + k + 3];
        sd_number *v = w + k;
        v[1] -= a[0] * v[0];
        v[2] = v[2] - a[1] * v[0] - b[0] * v[1];
        v[3] = v[3] - a[2] * v[0] - b[1] * v[1] - c[0] * v[2];
        lessen_four(wide - k - 3, a + 3, b + 2, c + 1, d, v, v + SD_COLUMNS);
    }
    for (; k < many; k++) {
        const sd_number *l = lu->l_value + lu->l_start[j + k];
        for (int32_t p = 0; p < wide - k; p++)
            w[k + 1 + p] -= l[p] * w[k];
    }
}

/* w := what these columns touch of x, where the first pivots at `at`, less them; how many numbers are behind that one */
static inline int32_t lessen_touched(const sd_sparse *lu, int32_t j, int32_t many, int32_t at, const sd_number *x, sd_number *w)
{
    const int32_t *row = lu->l_row + lu->l_start[j];
    int32_t wide = lu->l_start[j + 1] - lu->l_start[j];
    w[0] = x[at];
    for (int32_t p = 0; p < wide; p++)
        w[p + 1] = x[row[p]];
    lessen_block(lu, j, many, wide, w);
    return wide;
}

/* x less `many` columns of one block from the j-th on; u: what stood in x where they pivot, `at` the first; w: room */
static void apply_block(const sd_sparse *lu, int32_t j, int32_t many, int32_t at, sd_number *u, sd_number *x, sd_number *w)
{
    const int32_t *row = lu->l_row + lu->l_start[j];
    int32_t wide = lessen_touched(lu, j, many, at, x, w);
    x[at] = 0.0;
    for (int32_t i = 0; i < many; i++)
        u[i] = w[i];
    for (int32_t p = 0; p < wide; p++)
        x[row[p]] = p < many - 1 ? 0.0 : w[p + 1];
}

/* x at these rows, of which no two are equal, less v times l */
static inline __attribute__((always_inline)) void lessen_places(int32_t n, const int32_t *restrict row,
                                                                const sd_number *restrict l, sd_number v, sd_number *restrict x)
{
    int32_t p = 0;
    for (; p + 4 <= n; p += 4) {
        sd_number a = x[row[p]] - l[p] * v, b = x[row[p + 1]] - l[p + 1] * v;
        sd_number c = x[row[p + 2]] - l[p + 2] * v, d = x[row[p + 3]] - l[p + 3] * v;
        x[row[p]] = a;
        x[row[p + 1]] = b;
        x[row[p + 2]] = c;
        x[row[p + 3]] = d;
    }
    for (; p < n; p++)
        x[row[p]] -= l[p] * v;
}

/* x less column j of L; what stood in x where it pivots */
static inline sd_number apply_column(const sd_sparse *lu, int32_t j, int32_t at, sd_number *x)
{
    sd_number u = x[at];
    x[at] = 0.0;
    lessen_places(lu->l_start[j + 1] - lu->l_start[j], lu->l_row + lu->l_start[j], lu->l_value + lu->l_start[j], u, x);
    return u;
}

/* x less the columns of L at these positions, in order; u: what stood where each pivots, at rows (NULL: positions);
 * w: room of what the widest block touches, NULL: there is none */
static inline void apply_columns(const sd_sparse *lu, int32_t number, const int32_t *position, const int32_t *rows,
                                 sd_number *u, sd_number *x, sd_number *w)
{
    for (int32_t p = 0; p < number; p++) {
        int32_t j = position[p], many = 1;
        if (w && number >= SD_COLUMNS)
            while (p + many < number && position[p + many] == j + many && lu->first[j + many] == lu->first[j])
                many++;
        if (many < SD_COLUMNS) {
            u[p] = apply_column(lu, j, rows ? rows[j] : j, x);
            continue;
        }
        apply_block(lu, j, many, rows ? rows[j] : j, u + p, x, w);
        p += many - 1;
    }
}

/* positions in ascending order; among: bits of all, none set */
static void ascend(int32_t number, int32_t *position, uint64_t *among)
{
    if (number > SD_SCATTERED) {
        int32_t low = position[0], high = position[0], found = 0;
        for (int32_t p = 0; p < number; p++) {
            low = position[p] < low ? position[p] : low;
            high = position[p] > high ? position[p] : high;
            among[position[p] / 64] |= (uint64_t)1 << position[p] % 64;
        }
        for (int32_t word = low / 64; word <= high / 64; word++)
            for (; among[word]; among[word] &= among[word] - 1)
                position[found++] = 64 * word + __builtin_ctzll(among[word]);
        return;
    }
    for (int32_t p = 1; p < number; p++) {
        int32_t here = position[p], q = p;
        for (; q > 0 && position[q - 1] > here; q--)
            position[q] = position[q - 1];
        position[q] = here;
    }
}

/* the largest entry of a column of the matrix */
static double column_size(const sd_matrix *matrix, int32_t c)
{
    const sd_number *value = sd_column_of(matrix, c);
    double size = 0.0;
    for (int32_t e = 0; e < matrix->column[c + 1] - matrix->column[c]; e++)
        size = sd_size(value[e]) > size ? sd_size(value[e]) : size;
    return size;
}

/* whether a k-th column of `number` rows, the marked ones, is one of the block before it, and of which: its first; else k */
static int32_t block_of(const sd_sparse *lu, int32_t k, int32_t number)
{
    if (k == 0 || lu->dropped != 0.0 || lu->l_start[k] - lu->l_start[k - 1] != number + 1)
        return k;
    for (int32_t l = lu->l_start[k - 1]; l < lu->l_start[k]; l++)
        if (lu->mark[lu->l_row[l]] != k)
            return k;
    return lu->first[k - 1];
}

/* the row of the k-th pivot comes first among those that the columns before it in its block have left */
static void align(sd_sparse *lu, int32_t first, int32_t k, int32_t pivot)
{
    int32_t at = lu->l_start[k - 1];
    while (lu->l_row[at] != pivot)
        at++;
    int32_t behind = at - lu->l_start[k - 1];
    for (int32_t j = first; j < k; j++) {
        int32_t to = lu->l_start[j] + k - 1 - j, from = to + behind;
        sd_number value = lu->l_value[to];
        lu->l_value[to] = lu->l_value[from];
        lu->l_value[from] = value;
        lu->l_row[from] = lu->l_row[to];
        lu->l_row[to] = pivot;
    }
}

/* numbers that the widest block touches */
static int32_t widest_block(const sd_sparse *lu)
{
    int32_t widest = 0;
    for (int32_t j = 0; j + SD_COLUMNS <= lu->n; j++) {
        int32_t wide = lu->l_start[j + 1] - lu->l_start[j] + 1;
        if (lu->first[j] == j && lu->first[j + SD_COLUMNS - 1] == j && wide > widest)
            widest = wide;
    }
    return widest;
}

#endif
