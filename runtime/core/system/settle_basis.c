/* A basis of the unknowns that the rows tell: see settle_basis.h. */
#include "system/settle_basis.h"
#include "linear/tuning.h"

#include <math.h>
#include <string.h>

#define LEAST_PIVOT SD_DEPENDENT /* part of its column below which a row of the basis follows from the others */
#define FILL 6          /* entries of the factors of a basis for each of its matrix, beyond which it is not tried any more */

/* 1 / weight of an unknown or rate, which carries the state or not; of a state that is to stay where it is 0 */
static inline double lift(const sd_settle *settle, int carries)
{
    return carries ? !settle->determined : 1.0 / settle->follows;
}

int sd_settle_basis_new(sd_settle *settle, const int32_t *order)
{
    const int32_t *column = settle->system->column;
    sd_sparse_free(settle->basis);
    settle->basis = sd_sparse_new(settle->unknowns + settle->rates, settle->rows, order);
    if (!settle->basis)
        return 2;
    settle->basis_entries = settle->system->entries;
    for (int32_t k = 0; k < settle->rates; k++)
        settle->basis_entries += column[settle->rate[k] + 1] - column[settle->rate[k]];
    settle->basis->null_pivot = LEAST_PIVOT;
    settle->basis->most = 1000000 + (int64_t)FILL * settle->basis_entries;
    return 0;
}

int *sd_settle_pivoted(sd_settle *settle)
{
    return settle->basis ? &settle->basis->pivoted : NULL;
}

/* whether the basis leaves an unknown open that follows from the state; of rates that no row needs nobody asks */
static int leaves_open(const sd_settle *settle)
{
    for (int32_t j = 0; j < settle->unknowns; j++)
        if (!settle->state[j] && settle->basis->place[j] == settle->rows)
            return 1;
    return 0;
}

/* puts the scaled slopes [entries] by an unknown, or by a rate, behind what there is of the column of each row; number: of
 * it among unknowns and rates */
static void add_to_basis(sd_settle *settle, int32_t unknown, int32_t number, const double *slope)
{
    const sd_system *system = settle->system;
    double weight = lift(settle, settle->state[number]);
    for (int32_t e = system->column[unknown]; e < system->column[unknown + 1]; e++) {
        int32_t at = settle->basis_column[system->row[e] + 1]++; /* which is the end of that column at last */
        settle->basis_row[at] = number;
        settle->basis_value[at] = slope[e] * settle->row_scale[system->row[e]] * weight;
    }
}

/* G^T in scaled unknowns and rows, whose columns ascend */
static void lay_out_basis(sd_settle *settle)
{
    const sd_system *system = settle->system;
    int32_t *begin = settle->basis_column + 1, before = 0;
    memset(settle->basis_column, 0, ((size_t)settle->rows + 1) * sizeof *begin);
    for (int32_t e = 0; e < system->entries; e++)
        begin[system->row[e]]++;
    for (int32_t k = 0; k < settle->rates; k++)
        for (int32_t j = settle->rate[k], e = system->column[j]; e < system->column[j + 1]; e++)
            begin[system->row[e]]++;
    for (int32_t i = 0; i < settle->rows; i++) {
        int32_t number = begin[i];
        begin[i] = before;
        before += number;
    }
    for (int32_t j = 0; j < settle->unknowns; j++)
        add_to_basis(settle, j, j, settle->jy);
    for (int32_t k = 0; k < settle->rates; k++)
        add_to_basis(settle, settle->rate[k], settle->unknowns + k, settle->jyd);
}

int sd_settle_choose(sd_settle *settle)
{
    const double *value = settle->basis_value;
    lay_out_basis(settle);
    if (sd_first_bad(settle->basis_entries, value) >= 0)
        return 1;
    sd_sparse *lu = settle->basis;
    const sd_matrix matrix = {.column = settle->basis_column, .row = settle->basis_row, .value = value};
    if (!lu->pivoted || sd_sparse_refactor(lu, &matrix)) {
        int failed = sd_sparse_pivot(lu, &matrix);
        if (failed > 1) /* it fills too much */
            settle->refused = SD_BASIS_OUT;
        if (failed || (settle->determined && leaves_open(settle)))
            return 1;
    }
    settle->ready = SD_BY_BASIS;
    return 0;
}

double sd_settle_move_basic(sd_settle *settle, double *y, double *yd, double *state)
{
    int32_t n = settle->unknowns, moves = n + settle->rates;
    const double lifts[2] = {lift(settle, 0), lift(settle, 1)};
    double most[2] = {0.0, 0.0}, *b = settle->r; /* of what follows, of states; which is measured anew behind it */
    for (int32_t i = 0; i < settle->rows; i++)
        b[i] = -settle->r[i] * settle->row_scale[i];
    sd_sparse_basic(settle->basis, b, settle->step, settle->step + moves);
    for (int32_t j = 0; j < moves; j++) {
        const int carries = settle->state[j] != 0;
        const double move = settle->step[j] *= lifts[carries], size = fabs(move);
        most[carries] = size > most[carries] ? size : most[carries];
    }
    for (int32_t j = 0; j < n; j++)
        y[j] += settle->step[j] * settle->scale[j];
    for (int32_t k = 0; k < settle->rates; k++)
        yd[settle->rate[k]] += settle->step[n + k] * settle->scale[n + k];
    *state = fmax(*state, most[1]);
    return fmax(most[0], most[1]);
}
