/* Room for points that settle: see settle_room.h. */
#include "system/settle_room.h"
#include "system/settle_basis.h"

#include <stdlib.h>

#define SMALL_POINT 20000 /* unknowns and rates up to which room for slopes is kept */
#define FIRST 24          /* points before an order of their matrix is looked for: that costs as much as it saves of these */

/* the matrix of the least change, which many rows of a trace may need */
static void take(sd_settle *settle, sd_linear *linear)
{
    settle->linear = linear;
    sd_linear_replayed(linear);
    if (linear->elimination)
        linear->elimination->first = FIRST;
}

sd_settle *sd_settle_new(sd_system *system, sd_linear *linear, int32_t rates)
{
    sd_settle *settle = calloc(1, sizeof *settle);
    if (!settle)
        return NULL;
    size_t m = (size_t)system->rows + 1, n = (size_t)(system->unknowns + rates) + 1;
    const size_t steep = system->scales > 0 ? (size_t)system->unknowns : 0;
    settle->memory = calloc(m + 2 * n + steep, sizeof(double));
    settle->taken = linear ? calloc((size_t)linear->entries + 1, sizeof(double)) : NULL;
    if (!settle->memory || (linear && !settle->taken)) {
        sd_settle_free(settle);
        return NULL;
    }
    settle->system = system;
    if (linear)
        take(settle, linear);
    settle->unknowns = system->unknowns;
    settle->rates = rates;
    settle->rows = system->rows;
    settle->hold = 1.0;
    settle->row_scale = settle->memory;
    settle->scale = settle->row_scale + m;
    settle->met = settle->scale + n;
    settle->usual = settle->met + n;
    settle->matrix = settle->taken;
    return settle;
}

int sd_settle_provide_point(sd_settle *settle)
{
    const sd_system *system = settle->system;
    size_t m = (size_t)settle->rows + 1, n = (size_t)(settle->unknowns + settle->rates) + 1;
    size_t kept = system->left ? (size_t)system->unknowns + 8 : 0, all = 2 * m + 2 * n + 2 * kept;
    double *next = settle->lent && settle->lent_room >= all ? settle->lent : settle->work;
    if (!next && !(next = settle->work = malloc(all * sizeof *next)))
        return 0;
    settle->r = next;
    settle->x0 = settle->r + m;
    settle->step = settle->x0 + n; /* unknowns, rates and rows; a basis is chosen there before it steps */
    settle->room = settle->step + n + m;
    if (settle->basis)
        sd_sparse_lend(settle->basis, settle->step);
    return 1;
}

int sd_settle_provide_best(sd_settle *settle)
{
    if (!settle->x)
        settle->x = malloc(((size_t)(settle->unknowns + settle->rates) + 1) * sizeof *settle->x);
    return settle->x != NULL;
}

static void free_slopes(sd_settle *settle)
{
    free(settle->jy);
    free(settle->basis_column);
    settle->jy = settle->jyd = settle->basis_value = NULL;
    settle->basis_column = settle->basis_row = NULL;
}

int sd_settle_provide_slopes(sd_settle *settle)
{
    size_t entries = (size_t)settle->system->entries + 1, rows = (size_t)settle->rows + 1;
    size_t basis = settle->basis ? (size_t)settle->basis_entries + 1 : 0;
    if (settle->jy)
        return 1;
    settle->jy = malloc((2 * entries + basis) * sizeof *settle->jy);
    settle->basis_column = basis ? malloc((rows + basis) * sizeof *settle->basis_column) : NULL;
    if (!settle->jy || (basis && !settle->basis_column)) {
        free_slopes(settle);
        return 0;
    }
    settle->jyd = settle->jy + entries;
    settle->basis_value = settle->jyd + entries;
    settle->basis_row = settle->basis_column + rows;
    return 1;
}

int sd_settle_large(const sd_settle *settle)
{
    return settle->unknowns + settle->rates > SMALL_POINT;
}

void sd_settle_leave_slopes(sd_settle *settle)
{
    if (sd_settle_large(settle))
        free_slopes(settle);
}

int sd_settle_take(sd_settle *settle, sd_linear *linear)
{
    settle->taken = calloc((size_t)linear->entries + 1, sizeof(double));
    if (!settle->taken)
        return 2;
    take(settle, linear);
    settle->matrix = settle->taken;
    return 0;
}

void sd_settle_free(sd_settle *settle)
{
    if (!settle)
        return;
    free(settle->taken);
    sd_sparse_free(settle->basis);
    free_slopes(settle);
    free(settle->work);
    free(settle->x);
    free(settle->memory);
    free(settle);
}

int sd_settle_widen(sd_settle *settle, const int32_t *order, int32_t determined)
{
    settle->determined = determined;
    free_slopes(settle); /* room for more is wanted */
    return sd_settle_basis_new(settle, order);
}

void sd_settle_rest(sd_settle *settle)
{
    if (!sd_settle_large(settle))
        return;
    free(settle->work);
    free(settle->x);
    settle->work = settle->x = NULL;
}
