/* Numbers of fronts: see fronts.h.  A line of a front is a row and a column: first those that pivot there, then those that it
 * touches, both filled up with zeros to whole lanes. */
#include "linear/sparse/front_lanes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void sd_fronts_free(sd_fronts *f)
{
    if (!f)
        return;
    sd_fronts_rest(f);
    free(f->front), free(f->behind), free(f->entry), free(f->row), free(f->left[0]), free(f->line);
    free(f);
}

int sd_fronts_provide(sd_fronts *f)
{
    if (!f->value)
        f->value = malloc(((size_t)f->numbers + 1) * sizeof *f->value);
    return f->value != NULL;
}

void sd_fronts_rest(sd_fronts *f)
{
    free(f->value);
    f->value = NULL;
}

/* The numbers of a front: its entries, and what those below have left of its panels. */
static void fill_panels(const sd_fronts *f, const sd_front *front, const sd_front_entry *entry, const sd_matrix *matrix,
                        sd_number *l, sd_number *u)
{
    const int32_t lines = lines_of(front);
    memset(l, 0, (size_t)front->many * (size_t)lines * sizeof *l);
    memset(u, 0, (size_t)whole_line(front->many) * (size_t)lines * sizeof *u);
    for (const sd_front_entry *end = f->entry + front->entries; entry < end; entry++)
        *(entry->place < 0 ? u + ~entry->place : l + entry->place) += sd_entry_of(matrix, entry->entry, entry->column);
    const sd_number *rest = f->top[!front->side];
    for (int32_t c = front->child; c >= 0; c = f->front[c].sibling) {
        const sd_front *below = &f->front[c];
        const int32_t *there = f->there + below->behind, wide = below->wide, step = whole_line(wide);
        rest -= left_by(below);
        for (int32_t j = 0; j < wide && there[j] < front->many; j++) {
            sd_number *lj = l + (int64_t)there[j] * lines, *uj = u + (int64_t)there[j] * lines;
            lj[there[j]] += rest[(int64_t)j * step + j];
            for (int32_t i = j + 1; i < wide; i++) {
                lj[there[i]] += rest[(int64_t)j * step + i];
                uj[there[i]] += rest[(int64_t)i * step + j];
            }
        }
    }
}

/* Columns of L and rows of U of a front; the least pivot as part of what is left of its column, 0: one is no number. */
static SD_WIDE double eliminate(const sd_front *front, sd_number *l, sd_number *u, sd_number *inverse)
{
    const int32_t many = front->many, lines = lines_of(front);
    double least = 1.0;
    for (int32_t j = 0; j < many; j++) {
        const int32_t from = j / IN_LANES * IN_LANES;
        sd_number *lj = l + (int64_t)j * lines, *uj = u + (int64_t)j * lines;
        sum_columns(LESS, lines - from, j, l + from, lines, u + j, lines, NULL, lj + from);
        sum_columns(LESS, lines - from, j, u + from, lines, l + j, lines, NULL, uj + from);
        for (int32_t i = from; i < j; i++)
            lj[i] = 0.0;
        double pivot = sd_size(lj[j]), largest = largest_of(lines - from, lj + from);
        if (!(pivot > 0.0) || !isfinite(largest))
            return 0.0;
        least = pivot < least * largest ? pivot / largest : least;
        inverse[j] = 1.0 / lj[j];
        scale_lines(lines - from, inverse[j], lj + from);
    }
    return least;
}

/* what a front leaves: less the products of its panels, and what those below have left of it */
static SD_WIDE void leave_rest(const sd_fronts *f, const sd_front *front, const sd_number *l, const sd_number *u,
                               sd_number *left)
{
    const int32_t lines = lines_of(front), own = whole_line(front->many), step = whole_line(front->wide);
    for (int32_t j = 0; j < front->wide; j++)
        sum_columns(MINUS, step, front->many, l + own, lines, u + own + j, lines, NULL, left + (int64_t)j * step);
    const sd_number *rest = f->top[!front->side];
    for (int32_t c = front->child; c >= 0; c = f->front[c].sibling) {
        const sd_front *below = &f->front[c];
        const int32_t *there = f->there + below->behind, wide = below->wide;
        int32_t pivots = 0;
        rest -= left_by(below);
        while (pivots < wide && there[pivots] < own)
            pivots++;
        for (int32_t j = pivots; j < wide; j++) {
            sd_number *to = left + (int64_t)(there[j] - own) * step - own;
            const sd_number *from = rest + (int64_t)j * whole_line(wide);
            for (int32_t i = pivots; i < wide; i++)
                to[there[i]] += from[i];
        }
    }
}

/* The triangle of a panel becomes its inverse, which solutions multiply with; inverse: of its diagonal, NULL: ones; by: room
 * for a column. */
static SD_WIDE void invert_triangle(int32_t many, int32_t lines, sd_number *panel, const sd_number *inverse, sd_number *by)
{
    const int32_t own = whole_line(many);
    for (int32_t k = many - 1; k >= 0; k--) {
        const int32_t from = k / IN_LANES * IN_LANES, next = k + 1;
        sd_number *column = panel + (int64_t)k * lines;
        for (int32_t i = from; i < own; i += IN_LANES) {
            SD_AT(by, i) = SD_FROM(column, i);
            SD_AT(column, i) = (sd_lanes){0.0};
        }
        column[k] = 1.0;
        sum_columns(LESS, own - from, many - next, column + lines + from, lines, by + next, 1, NULL, column + from);
        if (inverse)
            scale_lines(own - from, inverse[k], column + from);
    }
}

/* the panel of U, whose columns are filled up to whole lanes, by lines */
static SD_WIDE void turn_panel(int32_t own, int32_t lines, const sd_number *panel, sd_number *turned)
{
    for (int32_t k = 0; k < own; k += IN_LANES, panel += (int64_t)IN_LANES * lines)
        for (int32_t i = 0; i < lines; i++)
            SD_AT(turned, (int64_t)i * own + k) = across(panel + i, lines);
}

double sd_fronts_factor(sd_fronts *f, const sd_matrix *matrix)
{
    double least = 1.0;
    const sd_front_entry *entry = f->entry;
    f->top[0] = f->left[0];
    f->top[1] = f->left[1];
    for (int32_t i = 0; i < f->fronts && least > 0.0; i++) {
        const sd_front *front = &f->front[i];
        const int32_t many = front->many, lines = lines_of(front);
        sd_number *l = f->value + front->at, *u = f->panel, *inverse = f->line + lines;
        fill_panels(f, front, entry, matrix, l, u);
        entry = f->entry + front->entries;
        least = fmin(least, eliminate(front, l, u, inverse));
        leave_rest(f, front, l, u, f->top[front->side]);
        for (int32_t c = front->child; c >= 0; c = f->front[c].sibling)
            f->top[!front->side] -= left_by(&f->front[c]);
        f->top[front->side] += left_by(front);
        invert_triangle(many, lines, l, NULL, f->line);
        invert_triangle(many, lines, u, inverse, f->line);
        turn_panel(whole_line(many), lines, u, l + (int64_t)many * lines);
    }
    return least;
}

/* x at the pivots of a front, and behind them less what these take from it, by L */
static SD_WIDE void lessen_by_front(const sd_fronts *f, const sd_front *front, sd_number *x)
{
    const int32_t many = front->many, own = whole_line(many), wide = front->wide, lines = lines_of(front);
    const int32_t *behind = f->behind + front->behind;
    const sd_number *l = f->value + front->at;
    sd_number *pivoted = x + front->first, *line = f->line;
    sum_columns(SUM, own, many, l, lines, pivoted, 1, NULL, line);
    for (int32_t p = 0; p < many; p++)
        pivoted[p] = line[p];
    sum_columns(SUM, lines - own, many, l + own, lines, pivoted, 1, NULL, line + own);
    for (int32_t p = 0; p < wide; p++)
        x[behind[p]] -= line[own + p];
}

/* x at the pivots of a front, from what they touch, by U */
static SD_WIDE void find_in_front(const sd_fronts *f, const sd_front *front, sd_number *x)
{
    const int32_t many = front->many, own = whole_line(many), lines = lines_of(front);
    const sd_number *u = f->value + front->at + (int64_t)many * lines;
    sd_number *found = x + front->first, *line = f->line;
    sum_columns(SUM, own, front->wide, u + (int64_t)own * own, own, x, 1, f->behind + front->behind, line);
    for (int32_t p = 0; p < many; p++)
        found[p] -= line[p];
    sum_columns(SUM, own, many, u, own, found, 1, NULL, line);
    for (int32_t p = 0; p < many; p++)
        found[p] = line[p];
}

void sd_fronts_solve(const sd_fronts *f, sd_number *x, sd_number *work, const double *row_scale,
                     const double *column_scale)
{
    for (int32_t p = 0; p < f->n; p++) {
        int32_t r = f->row[p];
        work[p] = row_scale ? x[r] * row_scale[r] : x[r];
    }
    for (int32_t i = 0; i < f->fronts; i++)
        lessen_by_front(f, &f->front[i], work);
    for (int32_t i = f->fronts - 1; i >= 0; i--)
        find_in_front(f, &f->front[i], work);
    for (int32_t p = 0; p < f->n; p++) {
        int32_t c = f->column[p];
        x[c] = column_scale ? work[p] * column_scale[c] : work[p];
    }
}
