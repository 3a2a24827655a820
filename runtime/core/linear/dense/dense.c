#include "linear/dense/dense.h"
#include "linear/lanes.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SWEEPS 8             /* of the equilibration: 1e200 becomes 6 */
#define REFINED 2            /* rounds of iterative refinement: a weak direction is known as well as its residual is */
#define TURNS 60             /* sweeps of rotations; they converge quadratically, within ten */
#define TOLERANCE SD_SAME /* runtime/numerics/rank.py */
#define CERTAIN SD_CANCELS
#define GENERIC SD_GENERIC /* runtime/structure/structure.py */

static void rotate(int32_t n, double *a, double *b, double c, double s)
{
    for (int32_t k = 0; k < n; k++) {
        double x = a[k], y = b[k];
        a[k] = c * x - s * y;
        b[k] = s * x + c * y;
    }
}

static int finite(size_t number, const double *a)
{
    for (size_t k = 0; k < number; k++)
        if (!isfinite(a[k]))
            return 0;
    return 1;
}

void sd_orthogonal_rows(int32_t m, int32_t n, double *a, double *v, double *sigma)
{
    if (v) {
        memset(v, 0, (size_t)m * (size_t)m * sizeof *v);
        for (int32_t i = 0; i < m; i++)
            v[(size_t)i * m + i] = 1.0;
    }
    double most = 0.0;
    for (int32_t i = 0; i < m; i++) {
        sigma[i] = sd_dot(n, a + (size_t)i * n, a + (size_t)i * n);
        most = fmax(most, sigma[i]);
    }
    /* what is left of a row that depends on others is round-off, and orthogonal to nothing */
    double nothing = DBL_EPSILON * DBL_EPSILON * most;
    for (int turn = 0, turned = 1; turned && turn < TURNS; turn++) {
        turned = 0;
        for (int32_t i = 0; i < m; i++)
            for (int32_t j = i + 1; j < m; j++) {
                double *x = a + (size_t)i * n, *y = a + (size_t)j * n;
                double xx = sd_dot(n, x, x), yy = sd_dot(n, y, y), xy = sd_dot(n, x, y);
                if (xx <= nothing || yy <= nothing || fabs(xy) <= (4.0 + n) * DBL_EPSILON * sqrt(xx * yy))
                    continue;
                double zeta = (yy - xx) / (2.0 * xy);
                double t = (zeta >= 0.0 ? 1.0 : -1.0) / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
                double c = 1.0 / sqrt(1.0 + t * t), s = c * t;
                rotate(n, x, y, c, s);
                if (v)
                    rotate(m, v + (size_t)i * m, v + (size_t)j * m, c, s);
                turned = 1;
            }
    }
    for (int32_t i = 0; i < m; i++)
        sigma[i] = sqrt(sd_dot(n, a + (size_t)i * n, a + (size_t)i * n));
}

static double root(double size)
{
    return size > 0.0 ? 1.0 / sqrt(size) : 1.0;
}

void sd_factors(int32_t m, int32_t n, const double *a, const double *b, double *row, double *column)
{
    for (int32_t i = 0; i < m; i++)
        row[i] = 1.0;
    for (int32_t j = 0; j < n; j++)
        column[j] = 1.0;
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        for (int32_t i = 0; i < m; i++) {
            double size = 0.0;
            for (int32_t j = 0; j < n; j++) {
                size_t k = (size_t)i * n + j;
                size = fmax(size, fmax(fabs(a[k]), b ? fabs(b[k]) : 0.0) * row[i] * column[j]);
            }
            row[i] *= root(size);
        }
        for (int32_t j = 0; j < n; j++) {
            double size = 0.0;
            for (int32_t i = 0; i < m; i++) {
                size_t k = (size_t)i * n + j;
                size = fmax(size, fmax(fabs(a[k]), b ? fabs(b[k]) : 0.0) * row[i] * column[j]);
            }
            column[j] *= root(size);
        }
    }
}

/* scale over the roots of the largest, four at a time */
static SD_WIDE void over_roots(int32_t number, const double *restrict largest, double *restrict scale)
{
    for (int32_t k = 0; k < number; k++)
        scale[k] *= 1.0 / sqrt(largest[k] > 0.0 ? largest[k] : 1.0);
}

void sd_sparse_factors(int32_t m, int32_t n, int32_t entries, const int32_t *row_of, const int32_t *column_of,
                       const double *size, double *row, double *column)
{
    for (int32_t i = 0; i < m; i++)
        row[i] = 1.0;
    for (int32_t j = 0; j < n; j++)
        column[j] = 1.0;
    double *largest = malloc(((size_t)m + (size_t)n) * sizeof *largest + 8);
    if (!largest)
        return;
    for (int side = 0; side < 2 * SWEEPS; side++) {
        const int32_t *of = side % 2 ? column_of : row_of;
        double *scale = side % 2 ? column : row;
        int32_t number = side % 2 ? n : m;
        memset(largest, 0, (size_t)number * sizeof *largest);
        for (int32_t e = 0; e < entries; e++) {
            double scaled = size[e] * row[row_of[e]] * column[column_of[e]], most = largest[of[e]];
            largest[of[e]] = scaled > most ? scaled : most;
        }
        over_roots(number, largest, scale);
    }
    free(largest);
}

static double largest(int32_t m, const double *sigma)
{
    double most = 0.0;
    for (int32_t i = 0; i < m; i++)
        most = fmax(most, sigma[i]);
    return most;
}

static int above(int32_t m, const double *sigma, double least)
{
    int count = 0;
    for (int32_t i = 0; i < m; i++)
        count += sigma[i] > least;
    return count;
}

static void transpose(int32_t m, int32_t n, const double *a, double *to)
{
    for (int32_t i = 0; i < m; i++)
        for (int32_t j = 0; j < n; j++)
            to[(size_t)j * m + i] = a[(size_t)i * n + j];
}

int sd_rank(int32_t m, int32_t n, const double *a, double least)
{
    size_t number = (size_t)m * (size_t)n;
    if (!finite(number, a))
        return -1;
    int32_t few = m < n ? m : n, many = m < n ? n : m;
    double *work = malloc((number + (size_t)few + 1) * sizeof *work);
    if (!work)
        return -2;
    double *sigma = work + number;
    if (m <= n)
        memcpy(work, a, number * sizeof *work);
    else
        transpose(m, n, a, work);
    sd_orthogonal_rows(few, many, work, NULL, sigma);
    int found = above(few, sigma, least * largest(few, sigma));
    free(work);
    return found;
}

/* x [n] += the least-norm solution for a right side [m], by orthogonal rows of V^T a (wide) or of V^T a^T */
static void answer(int32_t m, int32_t n, const double *turned, const double *v, const double *sigma, double floor_,
                   const double *aim, double *x)
{
    int wide = m <= n;
    for (int32_t i = 0; i < (wide ? m : n); i++) {
        if (!(sigma[i] > floor_))
            continue;
        const double *vector = wide ? turned + (size_t)i * n : v + (size_t)i * n;
        double share = wide ? sd_dot(m, v + (size_t)i * m, aim) : sd_dot(m, turned + (size_t)i * m, aim);
        share = share / sigma[i] / sigma[i];
        for (int32_t j = 0; j < n; j++)
            x[j] += share * vector[j];
    }
}

int sd_nearest(int32_t m, int32_t n, const double *a, const double *aim, double least, double *x)
{
    if (!finite((size_t)m * (size_t)n, a) || !finite((size_t)m, aim))
        return -1;
    memset(x, 0, (size_t)n * sizeof *x);
    int32_t few = m < n ? m : n, many = m < n ? n : m;
    size_t number = (size_t)m * (size_t)n;
    double *memory = malloc(((size_t)few * few + (size_t)few + number + (size_t)m + 1) * sizeof *memory);
    if (!memory)
        return -2;
    double *v = memory, *sigma = v + (size_t)few * few, *turned = sigma + few, *rest = turned + number;
    if (m <= n)
        memcpy(turned, a, number * sizeof *turned);
    else
        transpose(m, n, a, turned);
    sd_orthogonal_rows(few, many, turned, v, sigma);
    double floor_ = least * largest(few, sigma);
    for (int round = 0; round <= REFINED; round++) {
        for (int32_t i = 0; i < m; i++)
            rest[i] = aim[i] - sd_dot(n, a + (size_t)i * n, x);
        answer(m, n, turned, v, sigma, floor_, rest, x);
    }
    free(memory);
    return 0;
}

/* to [n, n] := the entries of a pattern */
static void full(int32_t n, const int32_t *column, const int32_t *row, const double *value, double *to)
{
    memset(to, 0, (size_t)n * (size_t)n * sizeof *to);
    for (int32_t j = 0; j < n; j++)
        for (int32_t k = column[j]; k < column[j + 1]; k++)
            to[(size_t)row[k] * n + j] = value[k];
}

static void scaled(int32_t n, double *a, const double *row, const double *column)
{
    for (int32_t i = 0; i < n; i++)
        for (int32_t j = 0; j < n; j++)
            a[(size_t)i * n + j] *= row[i] * column[j];
}

int sd_regular(int32_t n, const int32_t *column, const int32_t *row, const double *value, double least)
{
    size_t number = (size_t)n * (size_t)n;
    double *a = malloc((number + 2 * (size_t)n + 1) * sizeof *a);
    if (!a)
        return -2;
    double *by_row = a + number, *by_column = by_row + n;
    full(n, column, row, value, a);
    int found = -1;
    if (finite(number, a)) {
        sd_factors(n, n, a, NULL, by_row, by_column);
        scaled(n, a, by_row, by_column);
        found = sd_rank(n, n, a, least);
        found = found < 0 ? found : found == n;
    }
    free(a);
    return found;
}

/* rows of a and b [n, n] divided by the largest entry of both */
static void rows_to_one(int32_t n, double *a, double *b)
{
    for (int32_t i = 0; i < n; i++) {
        double size = 0.0;
        for (int32_t j = 0; j < n; j++)
            size = fmax(size, fmax(fabs(a[(size_t)i * n + j]), fabs(b[(size_t)i * n + j])));
        for (int32_t j = 0; size > 0.0 && j < n; j++) {
            a[(size_t)i * n + j] /= size;
            b[(size_t)i * n + j] /= size;
        }
    }
}

/* the index of e x' + b x [n, n], equilibrated; v, w [n, n], sigma [n]: room */
static int shuffled(int32_t n, double *e, double *b, double *v, double *w, double *sigma, int32_t most)
{
    for (int32_t index = 0; index <= most; index++) {
        sd_orthogonal_rows(n, n, e, v, sigma);
        double top = largest(n, sigma), least = top > TOLERANCE ? TOLERANCE * top : INFINITY;
        if (above(n, sigma, least) == n)
            return index;
        /* rows of v^T b; those without derivatives are differentiated: e from b, b zero */
        for (int32_t i = 0; i < n; i++)
            for (int32_t j = 0; j < n; j++) {
                double sum = 0.0;
                for (int32_t k = 0; k < n; k++)
                    sum += v[(size_t)i * n + k] * b[(size_t)k * n + j];
                w[(size_t)i * n + j] = sum;
            }
        for (int32_t i = 0; i < n; i++) {
            size_t at = (size_t)i * n;
            int kept = sigma[i] > least;
            if (!kept)
                memcpy(e + at, w + at, (size_t)n * sizeof *e);
            for (int32_t j = 0; j < n; j++)
                b[at + j] = kept ? w[at + j] : 0.0;
        }
        rows_to_one(n, e, b);
    }
    return -1;
}

int sd_pencil_index(int32_t n, const int32_t *column, const int32_t *row, const double *e, const double *b, int32_t most)
{
    size_t number = (size_t)n * (size_t)n;
    double *memory = malloc((4 * number + 3 * (size_t)n + 1) * sizeof *memory);
    if (!memory)
        return -2;
    double *a = memory, *c = a + number, *v = c + number, *w = v + number;
    double *sigma = w + number, *by_row = sigma + n, *by_column = by_row + n;
    full(n, column, row, e, a);
    full(n, column, row, b, c);
    int found = -1;
    if (finite(number, a) && finite(number, c)) {
        sd_factors(n, n, a, c, by_row, by_column);
        scaled(n, a, by_row, by_column);
        scaled(n, c, by_row, by_column);
        for (size_t k = 0; k < number; k++)
            w[k] = c[k] + GENERIC * a[k];
        if (sd_rank(n, n, w, CERTAIN) == n)
            found = shuffled(n, a, c, v, w, sigma, most);
    }
    free(memory);
    return found;
}
