/* The passes of a small condensed system as machine code: see condensed.h.
 *
 * Before the blocks: kept unknowns to their places, eliminated ones, rates, rows := 0.  Behind them: rows to theirs, rows q' - f.
 * The sums are those of the loops, in their order: digits do not depend on who computes them. */
#include "linear/elimination/machine_code.h"
#include "linear/number.h"
#include "system/condensed.h"

#include <stdlib.h>

#define LONG 3    /* unknowns a stretch, in the mean, from which loops are as good */
#define MOST 1500 /* operations: longer code leaves the nearest cache */
#define PART 6    /* of its operations: residuals after which writing it has paid */

struct sd_unrolled {
    sd_list before, behind;
    sd_code *code;
    int64_t asked, due; /* residuals so far; at which code is written */
    double number[];    /* factors and constant of each unknown, stretch by stretch */
};

/* where arrays begin among the places of both lists */
typedef struct places {
    int32_t z, zd, y, yd, r, behind_zd, behind_y, behind_r, out;
} places;

static int32_t numbers_of(const sd_condensed *condensed)
{
    int32_t numbers = 2; /* that machine code looks at */
    for (const sd_straight *s = condensed->straight, *end = s + condensed->straights; s < end; s++)
        numbers += s->number * (s->terms + 1);
    return numbers;
}

void sd_unrolled_renew(sd_unrolled *unrolled, const sd_condensed *condensed)
{
    double *to = unrolled->number;
    for (const sd_straight *s = condensed->straight, *end = s + condensed->straights; s < end; s++)
        for (int32_t i = 0; i < s->number; i++) {
            for (int32_t k = 0; k < s->terms; k++)
                *to++ = s->alike ? s->factor[k * s->alike] : s->factor[k * s->number + i];
            *to++ = s->constant ? s->constant[i] : s->terms ? -0.0 : 0.0; /* a zero that added to any number leaves it */
        }
}

/* the list of what stands before the blocks */
static int list_before(const sd_condensed *condensed, const places *p, sd_list *list)
{
    int32_t number = 0;
    int failed = 0;
    for (const sd_span *s = condensed->unknown, *end = s + condensed->unknown_spans; s < end; s++)
        for (int32_t i = 0; i < s->number; i++)
            failed |= sd_list_sum(list, SD_SUM_PLAIN, p->y + s->full + i, p->z + s->kept + i, -1);
    for (const sd_straight *s = condensed->straight, *end = s + condensed->straights; s < end; s++)
        for (int32_t i = 0; i < s->number; i++) {
            for (int32_t k = 0; k < s->terms; k++)
                failed |= sd_list_pair(list, number++, p->y + s->source[k] + i);
            failed |= sd_list_sum(list, SD_SUM_PLUS, p->y + s->place + i, number++, -1);
        }
    for (const sd_span *s = condensed->rate, *end = s + condensed->rate_spans; s < end; s++)
        for (int32_t i = 0; i < s->number; i++)
            failed |= sd_list_sum(list, SD_SUM_PLAIN, p->yd + s->full + i, p->zd + s->kept + i, -1);
    for (const sd_span *s = condensed->rest, *end = s + condensed->rest_spans; s < end; s++)
        for (int32_t i = 0; i < s->number; i++)
            failed |= sd_list_sum(list, SD_SUM_PLAIN, p->r + s->full + i, -1, -1);
    return failed;
}

/* and behind them */
static int list_behind(const sd_condensed *condensed, const places *p, sd_list *list)
{
    int failed = 0;
    for (const sd_span *s = condensed->rest, *end = s + condensed->rest_spans; s < end; s++)
        for (int32_t i = 0; i < s->number; i++)
            failed |= sd_list_sum(list, SD_SUM_PLAIN, p->out + s->kept + i, p->behind_r + s->full + i, -1);
    for (const int32_t *own = condensed->own, *end = own + 4 * (size_t)condensed->own_spans; own < end; own += 4)
        for (int32_t i = 0; i < own[0]; i++)
            failed |= sd_list_sum(list, SD_SUM_LESS, p->out + own[1] + i, p->behind_zd + own[2] + i, p->behind_y + own[3] + i);
    return failed;
}

static int write_lists(const sd_condensed *condensed, sd_unrolled *unrolled)
{
    const int32_t n = condensed->unknowns, full = condensed->full->unknowns, rows = condensed->full->rows;
    const int32_t numbers = numbers_of(condensed);
    const places p = {.z = numbers, .zd = numbers + n, .y = numbers + 2 * n, .yd = numbers + 2 * n + full,
                      .r = numbers + 2 * (n + full), .behind_zd = numbers, .behind_y = numbers + n,
                      .behind_r = numbers + n + full, .out = numbers + n + full + rows};
    sd_list_begin(&unrolled->before, (const int32_t[SD_ARRAYS - 1]){numbers, n, n, full, full});
    sd_list_begin(&unrolled->behind, (const int32_t[SD_ARRAYS - 1]){numbers, n, full, rows});
    return list_before(condensed, &p, &unrolled->before) | list_behind(condensed, &p, &unrolled->behind);
}

sd_unrolled *sd_unrolled_new(const sd_condensed *condensed)
{
    int32_t eliminated = 0, numbers = numbers_of(condensed), spans = condensed->rate_spans + condensed->own_spans;
    for (int32_t s = 0; s < condensed->straights; s++)
        eliminated += condensed->straight[s].number;
    int64_t operations = (int64_t)numbers + 2 * condensed->unknowns + condensed->rows + spans;
    if (operations > MOST || eliminated > LONG * condensed->straights)
        return NULL;
    sd_unrolled *unrolled = calloc(1, sizeof *unrolled + (size_t)numbers * sizeof(double));
    if (!unrolled)
        return NULL;
    unrolled->due = sd_code_early() ? 1 : operations / PART;
    sd_unrolled_renew(unrolled, condensed);
    return unrolled;
}

void sd_unrolled_free(sd_unrolled *unrolled)
{
    if (!unrolled)
        return;
    sd_code_free(unrolled->code);
    sd_list_clear(&unrolled->before);
    sd_list_clear(&unrolled->behind);
    free(unrolled);
}

static SD_APART void write_code(const sd_condensed *condensed, sd_unrolled *unrolled)
{
    if (write_lists(condensed, unrolled) == 0)
        unrolled->code = sd_code_new(&unrolled->before, &unrolled->behind, SD_REAL_NUMBERS);
}

int sd_unrolled_place(const sd_condensed *condensed, const double *z, const double *zd)
{
    sd_unrolled *unrolled = condensed->unrolled;
    if (!unrolled)
        return 0;
    if (++unrolled->asked == unrolled->due)
        write_code(condensed, unrolled);
    if (!unrolled->code)
        return 0;
    unrolled->code->first(unrolled->number, (double *)z, (double *)zd, condensed->y, condensed->yd, condensed->r);
    return 1;
}

void sd_unrolled_rows(const sd_condensed *condensed, const double *zd, double *r)
{
    sd_unrolled *unrolled = condensed->unrolled;
    unrolled->code->second(unrolled->number, (double *)zd, condensed->y, condensed->r, r, NULL);
}
