/* Which columns pivot in which front, and where everything stands there: see fronts.h. */
#include "linear/sparse/front_lanes.h"

#include <stdlib.h>
#include <string.h>

#define CROWDED 3       /* entries a column from which a pattern is looked at */
#define FILLS 3         /* products an entry of its factors from which fronts serve better than columns */
#define BESIDE 16       /* zeros that cost what a front costs besides its numbers, */
#define A_LINE 2        /* and those that a line costs that it hands on */

/* --- the pattern ------------------------------------------------------------------------------------------------------ */

/* While fronts are found.  A column is known by its position in the order, as is the row that pivots there; `into`: the column
 * in whose front it pivots, the last of that front's own. */
typedef struct search {
    int32_t n;
    int32_t *row_at, *column_at;  /* [n] positions of rows and columns */
    int32_t *first, *entry, *far; /* entries by the earlier of their two positions [n + 1]; the later one, ~ in U */
    int64_t *start, room;         /* [n + 1] */
    int32_t *touched;             /* positions that columns touch behind themselves, column by column */
    int32_t *above, *into, *many; /* [n] first of those, n: none; columns of a front, at its last */
    int32_t *child, *sibling;     /* [n] the lists of fronts below */
    int32_t *mark, *size, *moved; /* [n + 1] work; columns at and below; new positions */
} search;

static void leave_search_of(search *s)
{
    free(s->start), free(s->touched), free(s->row_at), free(s->entry);
}

static void sort_entries(search *s, const sd_matrix *matrix)
{
    for (int32_t c = 0; c < s->n; c++)
        for (int32_t e = matrix->column[c]; e < matrix->column[c + 1]; e++) {
            int32_t p = s->row_at[matrix->row[e]], q = s->column_at[c];
            s->first[(p < q ? p : q) + 1]++;
        }
    for (int32_t k = 0; k < s->n; k++)
        s->first[k + 1] += s->first[k];
    memcpy(s->mark, s->first, (size_t)s->n * sizeof *s->mark);
    for (int32_t c = 0; c < s->n; c++)
        for (int32_t e = matrix->column[c]; e < matrix->column[c + 1]; e++) {
            int32_t p = s->row_at[matrix->row[e]], q = s->column_at[c], at = s->mark[p < q ? p : q]++;
            s->entry[at] = e;
            s->far[at] = p < q ? ~q : p;
        }
    memset(s->mark, 0, (size_t)s->n * sizeof *s->mark);
}

/* 0: no memory */
static int begin_search(search *s, int32_t n, const sd_matrix *matrix, const int32_t *order, const int32_t *own)
{
    const size_t step = (size_t)n + 1, entries = (size_t)matrix->column[n];
    s->n = n;
    s->room = 4 * (int64_t)entries;
    s->start = malloc(step * sizeof *s->start);
    s->touched = malloc((size_t)s->room * sizeof *s->touched);
    s->entry = malloc(2 * entries * sizeof *s->entry);
    int32_t *at = s->row_at = calloc(11 * step, sizeof *at);
    if (!s->start || !s->touched || !s->entry || !at)
        return 0;
    int32_t **const parts[] = {&s->column_at, &s->first, &s->above, &s->into, &s->many,
                               &s->child, &s->sibling, &s->mark, &s->size, &s->moved};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++)
        *parts[i] = at + (i + 1) * step;
    s->far = s->entry + entries;
    memset(s->child, 0xff, step * sizeof *s->child);
    for (int32_t k = 0; k < n; k++) {
        s->column_at[order[k]] = k;
        s->row_at[own ? own[order[k]] : order[k]] = k;
    }
    sort_entries(s, matrix);
    return 1;
}

/* the position of a sorted entry that is the later one */
static inline int32_t later_of(const search *s, int32_t at)
{
    return s->far[at] < 0 ? ~s->far[at] : s->far[at];
}

static inline void touch(search *s, int32_t k, int32_t position, int64_t *end)
{
    if (position <= k || s->mark[position] == k + 1)
        return;
    s->mark[position] = k + 1;
    s->above[k] = position < s->above[k] ? position : s->above[k];
    s->touched[(*end)++] = position;
}

static int32_t wide(const search *s, int32_t k)
{
    return (int32_t)(s->start[k + 1] - s->start[k]);
}

/* what columns touch by entries of their own, and through those that they are above; 0: no memory */
static int close_pattern(search *s)
{
    int64_t end = 0;
    for (int32_t k = 0; k < s->n; k++) {
        if (end + s->n - k > s->room) {
            s->room = 2 * s->room + s->n;
            int32_t *more = realloc(s->touched, (size_t)s->room * sizeof *more);
            if (!more)
                return 0;
            s->touched = more;
        }
        s->start[k] = end;
        s->above[k] = s->n;
        for (int32_t at = s->first[k]; at < s->first[k + 1]; at++)
            touch(s, k, later_of(s, at), &end);
        for (int32_t c = s->child[k]; c >= 0; c = s->sibling[c])
            for (int64_t p = s->start[c]; p < s->start[c + 1]; p++)
                touch(s, k, s->touched[p], &end);
        s->start[k + 1] = end;
        if (s->above[k] < s->n) {
            s->sibling[k] = s->child[s->above[k]];
            s->child[s->above[k]] = k;
        }
    }
    return 1;
}

/* Fronts below that cost more than the zeros that their columns bring pivot with the one above; its list: those that stay. */
static void amalgamate(search *s)
{
    for (int32_t k = 0; k < s->n; k++) {
        int32_t next, stay = -1;
        s->into[k] = k;
        s->many[k] = 1;
        for (int32_t c = s->child[k]; c >= 0; c = next) {
            next = s->sibling[c];
            int64_t zeros = (int64_t)s->many[c] * (s->many[k] + wide(s, k) - wide(s, c));
            if (zeros > BESIDE + A_LINE * wide(s, c)) {
                s->sibling[c] = stay;
                stay = c;
                continue;
            }
            s->into[c] = k;
            s->many[k] += s->many[c];
            for (int32_t below = s->child[c], after; below >= 0; below = after) {
                after = s->sibling[below];
                s->sibling[below] = stay;
                stay = below;
            }
        }
        s->child[k] = stay;
    }
    for (int32_t k = s->n - 1; k >= 0; k--)
        s->into[k] = s->into[s->into[k]];
}

/* new positions: of each front its own columns behind all that stand below it; the number of fronts */
static int32_t renumber(search *s)
{
    int32_t n = s->n, fronts = 0, root = 0;
    for (int32_t k = 0; k < n; k++) {
        s->size[k] = s->many[k];
        for (int32_t c = s->child[k]; c >= 0 && s->into[k] == k; c = s->sibling[c])
            s->size[k] += s->size[c];
    }
    for (int32_t k = n - 1; k >= 0; k--) { /* mark: where what is below a front begins, then where its own columns do */
        if (s->into[k] != k)
            continue;
        fronts++;
        if (s->above[k] == n) {
            s->mark[k] = root;
            root += s->size[k];
        }
        int32_t at = s->mark[k];
        for (int32_t c = s->child[k]; c >= 0; c = s->sibling[c]) {
            s->mark[c] = at;
            at += s->size[c];
        }
        s->mark[k] = at;
    }
    for (int32_t k = 0; k < n; k++)
        s->moved[k] = s->mark[s->into[k]]++;
    return fronts;
}

/* --- fronts ------------------------------------------------------------------------------------------------------------ */

/* the fronts, and in `by` that in which each new position pivots; 0: no memory, or they cannot be numbered */
static int place_fronts(sd_fronts *f, const search *s, int32_t *by)
{
    int64_t numbers = 0, behind = 0;
    for (int32_t k = 0; k < f->n; k++)
        by[s->moved[k]] = s->into[k];
    for (int32_t p = 0, i = 0; p < f->n; i++) {
        int32_t k = by[p];
        sd_front *front = &f->front[i];
        *front = (sd_front){.first = p, .many = s->many[k], .wide = wide(s, k), .up = -1, .child = -1};
        front->behind = (int32_t)behind;
        front->at = (int32_t)numbers;
        numbers += (int64_t)(front->many + whole_line(front->many)) * lines_of(front);
        behind += front->wide;
        if (numbers > INT32_MAX || behind > INT32_MAX)
            return 0;
        for (; p < front->first + front->many; p++)
            by[p] = i;
    }
    f->numbers = (int32_t)numbers;
    f->behind = malloc((2 * (size_t)behind + 1) * sizeof *f->behind);
    f->there = f->behind + behind;
    return f->behind != NULL;
}

/* The lists of fronts, in order: who touches it is asked position by position; which front is above which.  0: no memory */
static int list_fronts(sd_fronts *f, search *s, const int32_t *by)
{
    const int32_t n = f->n;
    int32_t *start = s->size, *next = s->mark;
    memset(start, 0, ((size_t)n + 1) * sizeof *start);
    for (int32_t k = 0; k < n; k++)
        for (int64_t p = s->start[k]; p < s->start[k + 1] && s->into[k] == k; p++)
            start[s->moved[s->touched[p]] + 1]++;
    for (int32_t p = 0; p < n; p++)
        start[p + 1] += start[p];
    int32_t *who = malloc(((size_t)start[n] + 1) * sizeof *who);
    if (!who)
        return 0;
    memcpy(next, start, (size_t)n * sizeof *next);
    for (int32_t k = 0; k < n; k++)
        for (int64_t p = s->start[k]; p < s->start[k + 1] && s->into[k] == k; p++)
            who[next[s->moved[s->touched[p]]]++] = by[s->moved[k]];
    for (int32_t i = 0; i < f->fronts; i++)
        next[i] = f->front[i].behind;
    for (int32_t p = 0; p < n; p++)
        for (int32_t w = start[p]; w < start[p + 1]; w++) {
            sd_front *front = &f->front[who[w]];
            front->up = front->up < 0 ? by[p] : front->up;
            f->behind[next[who[w]]++] = p;
        }
    free(who);
    return 1;
}

/* The entries sorted under the column k in the front where it pivots, from the `next` on; line: of each position there. */
static int32_t place_entries(sd_fronts *f, const search *s, const sd_front *front, int32_t k, const int32_t *line, int32_t next)
{
    const int32_t own = s->moved[k], from = (own - front->first) * lines_of(front);
    for (int32_t at = s->first[k]; at < s->first[k + 1]; at++) {
        const int32_t far = s->moved[later_of(s, at)], upper = s->far[at] < 0, place = from + line[far];
        f->entry[next++] = (sd_front_entry){s->entry[at], f->column[upper ? far : own], upper ? ~place : place};
    }
    return next;
}

/* Who is below whom, and on which of two stacks what a front leaves waits for the one above: on the other one than that's. */
static void order_fronts(sd_fronts *f)
{
    for (int32_t i = f->fronts - 1; i >= 0; i--) {
        sd_front *front = &f->front[i];
        front->side = front->up < 0 ? 0 : !f->front[front->up].side;
    }
    for (int32_t i = 0; i < f->fronts; i++) {
        sd_front *front = &f->front[i];
        if (front->up < 0)
            continue;
        front->sibling = f->front[front->up].child;
        f->front[front->up].child = i;
    }
}

/* The places of entries, and of what fronts hand on.  line: work [n]; at: the column of each position */
static void place_all(sd_fronts *f, const search *s, int32_t *line, const int32_t *at)
{
    int32_t next = 0;
    for (int32_t i = 0; i < f->fronts; i++) {
        sd_front *front = &f->front[i];
        const int32_t own = whole_line(front->many), *behind = f->behind + front->behind;
        for (int32_t p = 0; p < front->many; p++)
            line[front->first + p] = p;
        for (int32_t p = 0; p < front->wide; p++)
            line[behind[p]] = own + p;
        for (int32_t p = 0; p < front->many; p++)
            next = place_entries(f, s, front, at[front->first + p], line, next);
        front->entries = next;
        for (int32_t c = front->child; c >= 0; c = f->front[c].sibling)
            for (int32_t p = f->front[c].behind; p < f->front[c].behind + f->front[c].wide; p++)
                f->there[p] = line[f->behind[p]];
    }
}

/* room for what fronts leave, for lines and a panel; 0: no memory */
static int provide_rests(sd_fronts *f)
{
    int64_t waiting[2] = {0}, most[2] = {0};
    size_t lines = 0, panel = 0;
    for (int32_t i = 0; i < f->fronts; i++) {
        const sd_front *front = &f->front[i];
        const size_t here = (size_t)lines_of(front), numbers = here * (size_t)whole_line(front->many);
        lines = here > lines ? here : lines;
        panel = numbers > panel ? numbers : panel;
        waiting[front->side] += left_by(front);
        most[front->side] = waiting[front->side] > most[front->side] ? waiting[front->side] : most[front->side];
        for (int32_t c = front->child; c >= 0; c = f->front[c].sibling)
            waiting[!front->side] -= left_by(&f->front[c]);
    }
    f->left[0] = malloc((size_t)(most[0] + most[1] + 1) * sizeof *f->left[0]);
    f->left[1] = f->left[0] + most[0];
    f->line = malloc((2 * lines + 4 * IN_LANES + panel) * sizeof *f->line);
    f->panel = f->line + 2 * lines + 4 * IN_LANES;
    return f->left[0] && f->line;
}

/* NULL: no memory */
static sd_fronts *fronts_of(search *s, const sd_matrix *matrix, const int32_t *order, const int32_t *own)
{
    const size_t n = (size_t)s->n, entries = (size_t)matrix->column[s->n];
    sd_fronts *f = calloc(1, sizeof *f);
    int32_t *by = malloc((2 * n + 1) * sizeof *by), *at = by + n;
    if (f) {
        f->n = s->n;
        f->fronts = renumber(s);
        f->front = malloc(((size_t)f->fronts + 1) * sizeof *f->front);
        f->entry = malloc((entries + 1) * sizeof *f->entry);
        f->row = malloc((2 * n + 1) * sizeof *f->row);
    }
    int done = by && f && f->front && f->entry && f->row && place_fronts(f, s, by) && list_fronts(f, s, by);
    if (done) {
        f->column = f->row + n;
        for (int32_t k = 0; k < s->n; k++) {
            at[s->moved[k]] = k;
            f->column[s->moved[k]] = order[k];
            f->row[s->moved[k]] = own ? own[order[k]] : order[k];
        }
        order_fronts(f);
        place_all(f, s, s->mark, at);
        done = provide_rests(f);
    }
    free(by);
    if (!done)
        sd_fronts_free(f);
    return done ? f : NULL;
}

sd_fronts *sd_fronts_new(int32_t n, const sd_matrix *matrix, const int32_t *order, const int32_t *own, int64_t most)
{
    search s = {0};
    sd_fronts *f = NULL;
    int64_t products = 0, entries = n;
    int known = matrix->column[n] > CROWDED * (int64_t)n && begin_search(&s, n, matrix, order, own) && close_pattern(&s);
    for (int32_t k = 0; known && k < n; k++) {
        products += (int64_t)wide(&s, k) * wide(&s, k);
        entries += 2 * wide(&s, k);
    }
    if (known && products >= FILLS * entries && (most <= 0 || entries <= most)) {
        amalgamate(&s);
        f = fronts_of(&s, matrix, order, own);
    }
    if (f) {
        f->products = products;
        f->entries = entries;
    }
    leave_search_of(&s);
    return f;
}
