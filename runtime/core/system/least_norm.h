/* Multipliers of redundant constraints: the least of all that give the same reactions (Moore-Penrose).
 *
 * With J = [Phi_q; Psi_f] (rows as written) the reactions J^T kappa fix kappa up to the null space of J^T.  The least
 * kappa lies in the range of J: kappa := J l with J^T (kappa - J l) = 0, from
 *      [ I    J  ] [ r ]   [ kappa ]
 *      [ J^T -eps] [ l ] = [   0   ],    kappa := kappa - r
 * (columns of J scaled to one; eps makes directions harmless that no constraint moves).
 */
#ifndef SYSDYN_LEAST_NORM_H
#define SYSDYN_LEAST_NORM_H

#include "system/assembly.h"
#include "linear/linear.h"

typedef struct sd_least_norm {
    sd_system *system;         /* the settled form: J^T stands in its rows of dynamics */
    sd_linear *linear;         /* of the matrix above [multipliers + coordinates] */
    int32_t multipliers, coordinates, entries;
    const int32_t *place;      /* [multipliers] in y */
    const int32_t *source;     /* [entries] of J in dF/dy of the system */
    const int32_t *coordinate; /* [entries] column of J */
    const int32_t *slot, *slot_t, *slot_diagonal;   /* [entries], [entries], [multipliers + coordinates] */
    double *jy, *jyd, *matrix, *x, *size, *memory;
} sd_least_norm;

sd_least_norm *sd_least_norm_new(sd_system *system, sd_linear *linear, int32_t multipliers, int32_t coordinates);
void sd_least_norm_free(sd_least_norm *least);
/* the multipliers in y [unknowns] moved in place; 0 done, 1 the matrix is singular (unchanged) */
int sd_least_norm_apply(sd_least_norm *least, double t, double *y, const double *yd);

#endif
