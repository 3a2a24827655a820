/* What round-off leaves open of unknowns: see round_off.h. */
#include "start/round_off.h"
#include "linear/tuning.h"
#include "start/magnitudes.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TELLS SD_SMALL /* of the largest part that an unknown has of any row: where it has less, the row says nothing of it */

int sd_unresolved(const sd_system *system, const uint8_t *constraint, const double *y, const double *jy, double *found)
{
    double *size = calloc(2 * (size_t)system->rows + 1, sizeof *size), *leading = size + system->rows;
    if (!size) /* size, leading: largest term and largest slope of each row */
        return -1;
    memset(found, 0, (size_t)system->unknowns * sizeof *found);
    for (int32_t j = 0; j < system->unknowns; j++)
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++) {
            int32_t i = system->row[e];
            if (constraint[i] && isfinite(jy[e])) {
                size[i] = sd_larger(size[i], fabs(jy[e] * y[j]));
                leading[i] = sd_larger(leading[i], fabs(jy[e]));
            }
        }
    for (int32_t j = 0; j < system->unknowns; j++) {
        double most = 0.0;
        for (int pass = 0; pass < 2; pass++)
            for (int32_t e = system->column[j]; e < system->column[j + 1]; e++) {
                int32_t i = system->row[e];
                double slope = fabs(jy[e]);
                /* one that is round-off itself (a crank at its dead centre) tells nothing of the unknown */
                if (!constraint[i] || !isfinite(slope) || slope <= DBL_EPSILON * leading[i])
                    continue;
                if (pass == 0)
                    most = sd_larger(most, slope / leading[i]);
                else if (slope >= TELLS * most * leading[i])
                    found[j] = sd_larger(found[j], DBL_EPSILON * size[i] / slope);
            }
    }
    free(size);
    return 0;
}

/* what one sweep over the balances changes; leading [rows]: largest slope of a multiplier; row [rows]: work */
static int sweep(const sd_system *system, const uint8_t *balance, const uint8_t *multiplier, const uint8_t *flow,
                 const double *jy, double small, const double *leading, double *row, double *found)
{
    int changed = 0;
    memset(row, 0, (size_t)system->rows * sizeof *row);
    for (int pass = 0; pass < 2; pass++)
        for (int32_t j = 0; j < system->unknowns; j++)
            for (int32_t e = system->column[j]; e < system->column[j + 1]; e++) {
                int32_t i = system->row[e];
                double slope = fabs(jy[e]);
                if (!balance[i] || !isfinite(slope) || slope == 0.0)
                    continue;
                if (pass == 0) {
                    row[i] = sd_larger(row[i], slope * (multiplier[j] || flow[j] ? found[j] : 0.0));
                } else if (multiplier[j] && slope >= small * leading[i]) {
                    double before = found[j];
                    found[j] = sd_larger(before, row[i] / slope);
                    changed |= !(found[j] == before);
                }
            }
    return changed;
}

int sd_noise(const sd_system *system, const uint8_t *constraint, const uint8_t *balance, const uint8_t *multiplier,
             const uint8_t *flow, const double *y, const double *jy, double time, int32_t sweeps, double small, double *found)
{
    if (sd_unresolved(system, constraint, y, jy, found))
        return -1;
    double *leading = calloc(2 * (size_t)system->rows + 1, sizeof *leading), *row = leading + system->rows;
    if (!leading)
        return -1;
    for (int32_t k = 0; k < system->kinematics; k++)
        found[system->k_f[k]] = sd_larger(found[system->k_f[k]], found[system->k_q[k]] / time);
    for (int32_t j = 0; j < system->unknowns; j++)
        for (int32_t e = system->column[j]; e < system->column[j + 1] && multiplier[j]; e++)
            if (balance[system->row[e]] && isfinite(jy[e]))
                leading[system->row[e]] = sd_larger(leading[system->row[e]], fabs(jy[e]));
    for (int32_t k = 0; k < sweeps; k++)
        if (!sweep(system, balance, multiplier, flow, jy, small, leading, row, found))
            break;
    free(leading);
    return 0;
}
