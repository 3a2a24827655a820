/* Slopes whose z is linear, but for the blocks of the model, as machine code: see underlying.h.
 *
 * One list of sums leads from what the blocks wrote to z: entries that several of them wrote, the factors and the solution of the
 * elimination with their places renamed, rates of displacements.  It gives the digits of the passes that it stands for (matrix,
 * factors, right side, solution), which take three times its instructions of five unknowns. */
#include "linear/elimination/machine_code.h"
#include "steppers/explicit/underlying.h"

#include <stdlib.h>

struct sd_straight {
    sd_code *code;    /* before the blocks, and behind them; NULL: none for this order */
    int64_t order;    /* of the elimination: the one that its lists are of */
    sd_list list[2];
    int32_t *entry;   /* [entries of the matrix and one] where each is found */
};

/* Places behind the cells of the elimination: rows and what blocks write (u->r and on), then y and yd. */
typedef struct places {
    int32_t one, rows, written, zero, minus, check, sums, y, yd;
} places;

static places places_of(const sd_underlying *u)
{
    const sd_elimination *e = u->linear->elimination;
    places p = {.one = e->inside - 2, .rows = e->inside, .written = e->inside + (int32_t)(u->written - u->r)};
    const int32_t behind = p.written + u->writes;
    p.zero = behind + SD_ZERO;
    p.minus = behind + SD_MINUS_ONE;
    p.check = behind + SD_CHECK;
    p.sums = behind + SD_ENTRY_SUMS;
    p.y = p.sums + e->entries;
    p.yd = p.y + u->n;
    return p;
}

static int32_t place_of_z(const sd_underlying *u, const places *p, int32_t column)
{
    return (u->rate[column] ? p->yd : p->y) + u->unknown[column];
}

/* entries that several wrote are added up; the others are where they were written */
static int straight_entries(const sd_underlying *u, const places *p, int32_t *entry, sd_list *list)
{
    const sd_system *system = u->matrix;
    const int32_t entries = u->linear->entries;
    int failed = 0;
    for (int32_t e = 0; e < entries; e++)
        entry[e] = p->written + u->from[e];
    for (int32_t k = 0; k < u->mores; k++) {
        int32_t e = u->more[2 * k];
        failed |= sd_list_pair(list, p->written + u->more[2 * k + 1], p->minus);
        failed |= sd_list_sum(list, SD_SUM_PLAIN, p->sums + e, entry[e], -1);
        entry[e] = p->sums + e;
    }
    for (int32_t i = 0; i < system->clear; i++)
        entry[u->place_y[system->cleared[i]]] = entry[u->place_yd[system->cleared[i]]] = p->zero;
    for (int32_t i = 0; i < system->held; i++) {
        int32_t slot = system->held_slot[i];
        entry[u->place_y[slot]] = entry[u->place_yd[slot]] = p->zero;
        entry[(system->held_rate[i] ? u->place_yd : u->place_y)[slot]] = p->one;
    }
    return failed;
}

static int straight_factors(const sd_elimination *e, const int32_t *entry, sd_list *list)
{
    const int32_t inside = e->inside;
    int failed = 0;
    for (const sd_sum *sum = e->factor.sum, *end = sum + e->factor.sums; sum < end; sum++) {
        for (const int32_t *pair = e->factor.pair + 2 * sum->first; pair < e->factor.pair + 2 * sum->last; pair += 2)
            failed |= sd_list_pair(list, pair[0] < inside ? pair[0] : entry[pair[0] - inside], pair[1]);
        failed |= sd_list_sum(list, (enum sd_sum_kind)sum->kind, sum->target,
                              sum->source < inside ? sum->source : entry[sum->source - inside], sum->by);
    }
    return failed;
}

/* z := minus the solution of the rows */
static int straight_solution(const sd_underlying *u, const places *p, sd_list *list)
{
    const sd_elimination *e = u->linear->elimination;
    const int32_t inside = e->inside, rows = p->rows + u->first - inside;
    int failed = 0;
    for (const sd_sum *sum = e->solve.sum, *end = sum + e->solve.sums; sum < end; sum++) {
        int forward = sum->source >= inside;
        if (forward)
            failed |= sd_list_pair(list, rows + sum->source, p->one);
        for (const int32_t *pair = e->solve.pair + 2 * sum->first; pair < e->solve.pair + 2 * sum->last; pair += 2)
            failed |= sd_list_pair(list, pair[0], pair[1] < inside ? pair[1] : place_of_z(u, p, pair[1] - inside));
        failed |= sd_list_sum(list, (enum sd_sum_kind)sum->kind, forward ? sum->target : place_of_z(u, p, sum->target - inside),
                              forward ? -1 : sum->source, sum->by);
    }
    return failed;
}

static int straight_kinematics(const sd_underlying *u, const places *p, sd_list *list)
{
    int failed = 0;
    for (int32_t i = 0; i < u->system->kinematics; i++)
        failed |= sd_list_sum(list, SD_SUM_PLAIN, p->yd + u->system->k_q[i], p->y + u->system->k_f[i], -1);
    return failed;
}

/* both lists.  0; 2: no memory */
static int straight_lists(const sd_underlying *u, sd_straight *straight)
{
    const places p = places_of(u);
    sd_list *before = &straight->list[0], *behind = &straight->list[1];
    int failed = 0;
    for (int k = 0; k < 2; k++)
        sd_list_begin(&straight->list[k], (const int32_t[SD_ARRAYS - 1]){p.rows, p.y - p.rows, u->n, u->n});
    for (int32_t i = 0; i < u->system->rows; i++)
        failed |= sd_list_sum(before, SD_SUM_PLAIN, p.rows + i, -1, -1);
    for (int32_t j = 0; j < u->solved; j++)
        failed |= sd_list_sum(before, SD_SUM_PLAIN, place_of_z(u, &p, j), -1, -1);
    failed |= straight_kinematics(u, &p, before);
    failed |= straight_entries(u, &p, straight->entry, behind) | straight_factors(u->linear->elimination, straight->entry, behind);
    failed |= straight_solution(u, &p, behind);
    for (int32_t j = 0; j < u->solved; j++)
        failed |= sd_list_pair(behind, place_of_z(u, &p, j), p.zero);
    failed |= sd_list_sum(behind, SD_SUM_PLAIN, p.check, -1, -1);
    return u->flows ? failed | straight_kinematics(u, &p, behind) : failed;
}

/* code for the order that the elimination has now */
static SD_APART sd_straight *straight_code(sd_underlying *u)
{
    const sd_elimination *e = u->linear->elimination;
    sd_straight *straight = u->straight ? u->straight : calloc(1, sizeof *straight);
    u->straight = straight;
    if (straight && !straight->entry)
        straight->entry = malloc(((size_t)e->entries + 1) * sizeof *straight->entry);
    if (!straight || !straight->entry)
        return NULL;
    sd_code_free(straight->code);
    straight->code = NULL;
    straight->order = e->prepared;
    u->written[u->writes + SD_MINUS_ONE] = -1.0;
    if (straight_lists(u, straight) == 0)
        straight->code = sd_code_new(&straight->list[0], &straight->list[1], SD_REAL_NUMBERS);
    return straight;
}

void sd_straight_free(sd_straight *straight)
{
    if (!straight)
        return;
    sd_code_free(straight->code);
    for (int k = 0; k < 2; k++)
        sd_list_clear(&straight->list[k]);
    free(straight->entry);
    free(straight);
}

const sd_straight *sd_straight_of(sd_underlying *u)
{
    const sd_linear *linear = u->linear;
    const sd_elimination *e = linear->elimination;
    if (!e || !e->ready || e->scaled || !linear->pivoted || linear->null_pivot > SD_LEAST_PIVOT)
        return NULL;
    const sd_straight *straight = u->straight;
    if (!straight || straight->order != e->prepared) {
        if (!sd_elimination_worn(e))
            return NULL;
        straight = straight_code(u);
    }
    return straight && straight->code ? straight : NULL;
}

void sd_straight_clear(const sd_straight *straight, const sd_underlying *u, double *y, double *yd)
{
    straight->code->first(u->linear->elimination->cell, u->r, y, yd, NULL, NULL);
}

int sd_straight_solve(const sd_straight *straight, const sd_underlying *u, double *y, double *yd)
{
    straight->code->second(u->linear->elimination->cell, u->r, y, yd, NULL, NULL);
    return u->written[u->writes + SD_CHECK] == 0.0 && sd_linear_in_cells(u->linear);
}
