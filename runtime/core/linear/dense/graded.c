#include "linear/dense/graded.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NONE = 1 << 28 }; /* the cost of an entry that is zero: no sum of others reaches it */
#define AGREES SD_MET /* of the largest aim: what a row in excess may be missed by */
#define CERTAIN 1e8      /* bounds of its round-off that a pivot is above: half of its digits are known */
#define LIKELY 16.0      /* the same, where the step is a correction that is asked for again */
#define LARGE 0.25       /* of the largest entries at first: an exact pivot */

/* Powers of two [m], [n] for the rows and columns, and the cost of each entry: of the entries of its row the largest has
 * none. */
typedef struct {
    int32_t m, n;
    int32_t *cost;                 /* [m, n] */
    int32_t *row, *column;         /* exponents */
    int32_t *holder;               /* [m + 1] the column, from 1, that a row, from 1, is assigned to; 0: none */
    int32_t *way, *least;          /* [m + 1] of the search for one column: the row before, the cost of getting there */
    char *seen;                    /* [m + 1] */
    char *left;                    /* [n] told: columns without a row of their own; NULL: there may be none */
} scales;

static void cost(scales *s, const double *a)
{
    for (int32_t i = 0; i < s->m; i++) {
        const double *line = a + (size_t)i * s->n;
        int32_t *c = s->cost + (size_t)i * s->n, most = -NONE;
        for (int32_t j = 0; j < s->n; j++) {
            c[j] = NONE;
            if (line[j] != 0.0) {
                frexp(line[j], &c[j]);
                most = c[j] > most ? c[j] : most;
            }
        }
        s->row[i] = most > -NONE ? -most : 0;
        for (int32_t j = 0; j < s->n; j++)
            c[j] = c[j] == NONE ? NONE : most - c[j];
    }
}

/* Rows for the columns, the first before others, at least cost, by shortest augmenting paths (Jonker and Volgenant 1987); 0:
 * there are none.  Adds the dual solution to the exponents: cost - column - row is nowhere negative, and zero where assigned. */
static int assign(scales *s)
{
    int32_t m = s->m, n = s->n;
    int32_t *u = s->column - 1, *v = s->way + m + 1;
    memset(s->holder, 0, ((size_t)m + 1) * sizeof *s->holder);
    memset(v, 0, ((size_t)m + 1) * sizeof *v);
    memset(s->column, 0, (size_t)n * sizeof *s->column);
    for (int32_t j = 1; j <= n; j++) {
        int32_t at = 0;
        s->holder[0] = j;
        for (int32_t i = 0; i <= m; i++) {
            s->least[i] = NONE;
            s->seen[i] = 0;
        }
        do {
            int32_t next = 0, step = NONE, column = s->holder[at];
            s->seen[at] = 1;
            for (int32_t i = 1; i <= m; i++) {
                if (s->seen[i])
                    continue;
                int32_t c = s->cost[(size_t)(i - 1) * n + column - 1];
                int32_t there = c == NONE ? NONE : c - u[column] - v[i];
                if (there < s->least[i]) {
                    s->least[i] = there;
                    s->way[i] = at;
                }
                if (s->least[i] < step) {
                    step = s->least[i];
                    next = i;
                }
            }
            if (step == NONE)
                break;
            for (int32_t i = 0; i <= m; i++)
                if (s->seen[i]) {
                    u[s->holder[i]] += step;
                    v[i] -= step;
                } else if (s->least[i] != NONE)
                    s->least[i] -= step;
            at = next;
        } while (s->holder[at]);
        if (s->holder[at]) {
            if (!s->left)
                return 0;
            s->left[j - 1] = 1;
            continue;
        }
        for (; at; at = s->way[at])
            s->holder[at] = s->holder[s->way[at]];
    }
    for (int32_t i = 0; i < m; i++)
        s->row[i] += v[i + 1];
    return 1;
}

/* a, b and its round-off (NULL: not asked for) scaled; left [n]: columns without a row of their own; 1: done, 0: there are
 * some (NULL), -2: no memory */
static int scaled(int32_t m, int32_t n, double *a, double *b, double *noise, int32_t *column, char *left)
{
    size_t rows = (size_t)m + 1, full = (size_t)m * (size_t)n;
    int32_t *memory = malloc((full + 5 * rows) * sizeof *memory + rows);
    if (!memory)
        return -2;
    scales s = {m, n, memory, memory + full, column, memory + full + rows, memory + full + 2 * rows,
                memory + full + 4 * rows, (char *)(memory + full + 5 * rows), left};
    cost(&s, a);
    int done = assign(&s);
    for (int32_t i = 0; i < m && done; i++) {
        for (int32_t j = 0; j < n; j++)
            a[(size_t)i * n + j] = ldexp(a[(size_t)i * n + j], s.row[i] + column[j]);
        b[i] = ldexp(b[i], s.row[i]);
        if (noise)
            noise[i] = ldexp(noise[i], s.row[i]);
    }
    free(memory);
    return done;
}

static void swap(double *a, double *b)
{
    double kept = *a;
    *a = *b;
    *b = kept;
}

static int power_of_two(double value)
{
    int exponent;
    return fabs(frexp(value, &exponent)) == 0.5;
}

static void swap_rows(int32_t n, double *a, int32_t row, int32_t k)
{
    for (int32_t j = 0; j < n && row != k; j++)
        swap(a + (size_t)row * n + j, a + (size_t)k * n + j);
}

static void swap_columns(int32_t m, int32_t n, double *a, int32_t column, int32_t k)
{
    for (int32_t i = 0; i < m && column != k; i++)
        swap(a + (size_t)i * n + column, a + (size_t)i * n + k);
}

/* moves columns that are left behind the others, whose number it returns; own [n], column [n] of them */
static int32_t apart(int32_t m, int32_t n, double *a, char *left, int32_t *own, int32_t *column)
{
    int32_t first = n;
    for (int32_t j = 0; j < first;) {
        if (!left[j]) {
            j++;
            continue;
        }
        first--;
        swap_columns(m, n, a, j, first);
        int32_t kept[2] = {own[j], column[j]};
        own[j] = own[first];
        column[j] = column[first];
        own[first] = kept[0];
        column[first] = kept[1];
        left[j] = left[first];
        left[first] = 1;
    }
    return first;
}

/* line -= factor pivot from k on; of [n] each, with the bounds of their round-off, `open` that of the factor */
static void subtract(int32_t k, int32_t n, double factor, double open, const double *pivot, const double *pivot_open,
                     double *line, double *line_open)
{
    int exact = power_of_two(factor);
    for (int32_t j = k; j < n; j++) {
        double product = factor * pivot[j];
        line_open[j] += fabs(factor) * pivot_open[j] + open * fabs(pivot[j]);
        if (product == 0.0)
            continue;
        int summed = line[j] != 0.0;
        line[j] -= product;
        if (!exact && !power_of_two(pivot[j]))
            line_open[j] += DBL_EPSILON * fabs(product);
        if (summed && !power_of_two(line[j]))
            line_open[j] += DBL_EPSILON * fabs(line[j]);
    }
}

/* the largest entry of a from line k on, in columns below `last`; of equal ones one without round-off */
static void largest_entry(int32_t m, int32_t n, const double *a, const double *open, int32_t k, int32_t last, int32_t *row,
                          int32_t *column)
{
    double most = -1.0;
    for (int32_t i = k; i < m; i++)
        for (int32_t j = k; j < last; j++) {
            size_t e = (size_t)i * n + j;
            double size = fabs(a[e]);
            size += open[e] == 0.0 && size >= LARGE ? 2.0 : 0.0;
            if (size > most) {
                most = size;
                *row = i;
                *column = j;
            }
        }
}

/* a := its factors, lines moved so that pivots stand on the diagonal, b := L^-1 b, the `first` columns before the others;
 * place [n]: the column that was there; open [m, n], noise [m]: bounds of round-off; missing [m]: that of b as it was, moved
 * along.  Returns the number of pivots that are more than that. */
static int32_t eliminate(int32_t m, int32_t n, int32_t first, double *a, double *open, double *b, double *noise,
                         double *missing, int32_t *place)
{
    double certain = noise ? LIKELY : CERTAIN;
    for (int32_t j = 0; j < n; j++)
        place[j] = j;
    for (size_t e = 0; e < (size_t)m * (size_t)n; e++)
        open[e] = power_of_two(a[e]) ? 0.0 : DBL_EPSILON * fabs(a[e]);
    for (int32_t k = 0; k < n && k < m; k++) {
        int32_t row = k, column = k;
        largest_entry(m, n, a, open, k, first, &row, &column);
        size_t at = (size_t)row * n + column;
        if (first < n && (k >= first || !(fabs(a[at]) > certain * open[at]))) {
            first = n;
            largest_entry(m, n, a, open, k, first, &row, &column);
        }
        swap_rows(n, a, row, k);
        swap_columns(m, n, a, column, k);
        swap_rows(n, open, row, k);
        swap_columns(m, n, open, column, k);
        swap(b + row, b + k);
        if (noise) {
            swap(noise + row, noise + k);
            swap(missing + row, missing + k);
        }
        int32_t kept = place[k];
        place[k] = place[column];
        place[column] = kept;
        const double *pivot = a + (size_t)k * n, *pivot_open = open + (size_t)k * n;
        if (!(fabs(pivot[k]) > certain * pivot_open[k]))
            return k;
        for (int32_t i = k + 1; i < m; i++) {
            double *line = a + (size_t)i * n, *line_open = open + (size_t)i * n, factor = line[k] / pivot[k];
            double unsure = (line_open[k] + fabs(factor) * pivot_open[k]) / fabs(pivot[k]);
            line[k] = factor;
            if (factor == 0.0)
                continue;
            if (!power_of_two(pivot[k]) && !power_of_two(factor))
                unsure += DBL_EPSILON * fabs(factor);
            subtract(k + 1, n, factor, unsure, pivot, pivot_open, line, line_open);
            b[i] -= factor * b[k];
            if (noise)
                noise[i] += fabs(factor) * noise[k] + unsure * fabs(b[k]);
        }
    }
    return n < m ? n : m;
}

/* the columns that have entries, moved together in a: their number; place [n] */
static int32_t used(int32_t m, int32_t n, double *a, int32_t *place)
{
    int32_t found = 0;
    for (int32_t j = 0; j < n; j++) {
        int any = 0;
        for (int32_t i = 0; i < m && !any; i++)
            any = a[(size_t)i * n + j] != 0.0;
        if (any)
            place[found++] = j;
    }
    for (int32_t i = 0; i < m && found < n; i++)
        for (int32_t j = 0; j < found; j++)
            a[(size_t)i * found + j] = a[(size_t)i * n + place[j]];
    return found;
}

static double largest(int32_t number, const double *b)
{
    double most = 0.0;
    for (int32_t k = 0; k < number; k++)
        most = fabs(b[k]) > most || isnan(b[k]) ? fabs(b[k]) : most;
    return most;
}

/* whether a row that is left misses by more than round-off [number] */
static int missed(int32_t number, const double *b, const double *noise)
{
    for (int32_t i = 0; i < number; i++)
        if (!(fabs(b[i]) <= noise[i]))
            return 1;
    return 0;
}

/* whether entries of columns from k on are more than their round-off alone would be, and yet no pivots: what incidences
 * leave of nothing is nothing */
static int doubtful(int32_t m, int32_t n, const double *a, const double *open, int32_t k)
{
    for (int32_t i = k; i < m; i++)
        for (int32_t j = k; j < n; j++)
            if (!(fabs(a[(size_t)i * n + j]) <= open[(size_t)i * n + j]))
                return 1;
    return 0;
}

/* w := U^-1 w of the first k pivots; n: columns of a */
static void substitute(int32_t k, int32_t n, const double *a, double *w)
{
    for (int32_t i = k - 1; i >= 0; i--) {
        const double *line = a + (size_t)i * n;
        for (int32_t j = i + 1; j < k; j++)
            w[i] -= line[j] * w[j];
        w[i] /= line[i];
    }
}

/* doubt [k] of the solution x [k] by the inverse of the first k rows and columns, L U, so that errors which cancel do:
 * missing [k] of the rows, open [m, n] of U; w [k] is room */
static void doubts(int32_t k, int32_t n, const double *a, const double *open, const double *missing, const double *x,
                   double *w, double *doubt)
{
    memset(doubt, 0, (size_t)k * sizeof *doubt);
    for (int32_t i = 0; i < k; i++) {
        double unsure = 0.0;
        for (int32_t j = i; j < k; j++)
            unsure += open[(size_t)i * n + j] * fabs(x[j]);
        for (int32_t of_rows = 0; of_rows < 2; of_rows++) {
            double bound = of_rows ? missing[i] : unsure;
            if (bound == 0.0)
                continue;
            memset(w, 0, (size_t)k * sizeof *w);
            w[i] = 1.0;
            for (int32_t r = i + 1; r < k && of_rows; r++)
                for (int32_t j = i; j < r; j++)
                    w[r] -= a[(size_t)r * n + j] * w[j];
            substitute(k, n, a, w);
            for (int32_t j = 0; j < k; j++)
                doubt[j] += fabs(w[j]) * bound;
        }
    }
}

int sd_graded(int32_t m, int32_t n, double *a, double *b, double *noise, double *x, double *doubt)
{
    int32_t *own = malloc((3 * (size_t)n + 1) * sizeof *own + (size_t)n);
    double *open = malloc(((size_t)m * (size_t)n + (size_t)m + 2 * (size_t)n + 1) * sizeof *open);
    if (!own || !open) {
        free(own);
        free(open);
        return -2;
    }
    int32_t *column = own + n, *place = own + 2 * (size_t)n, k = used(m, n, a, own), first = k;
    char *behind = (char *)(own + 3 * (size_t)n + 1);
    double *missing = open + (size_t)m * (size_t)n, *room = missing + m, *unsure = room + n;
    memset(x, 0, (size_t)n * sizeof *x);
    memset(behind, 0, (size_t)n);
    if (noise)
        memset(doubt, 0, (size_t)n * sizeof *doubt);
    int failed = 1;
    if (k <= m || noise) {
        failed = scaled(m, k, a, b, noise, column, noise ? behind : NULL);
        failed = failed < 0 ? failed : !failed;
    }
    int32_t pivots = k, left = 0;
    if (!failed) {
        first = apart(m, k, a, behind, own, column);
        double most = largest(m, b);
        if (noise)
            memcpy(missing, noise, (size_t)m * sizeof *missing);
        pivots = eliminate(m, k, first, a, open, b, noise, missing, place);
        failed = !noise && (pivots < k || !(largest(m - k, b + k) <= AGREES * most));
        if (noise)
            left = missed(m - pivots, b + pivots, noise + pivots) ? SD_MISSED : doubtful(m, k, a, open, pivots) ? SD_DOUBTFUL : SD_DETERMINED;
    }
    if (!failed) {
        substitute(pivots, k, a, b);
        if (noise)
            doubts(pivots, k, a, open, missing, b, room, unsure);
        for (int32_t i = 0; i < pivots; i++) {
            int32_t j = own[place[i]], exponent = column[place[i]];
            x[j] = ldexp(b[i], exponent);
            if (noise)
                doubt[j] = ldexp(unsure[i], exponent);
        }
        for (int32_t i = pivots; i < k && first < k; i++)
            doubt[own[place[i]]] = INFINITY;
    }
    free(open);
    free(own);
    return failed ? failed : left;
}
