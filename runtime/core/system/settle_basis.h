/* Points settled within a basis: as many unknowns and rates as there are rows move, those that follow from the state before
 * the state (basic solutions). */
#ifndef SYSDYN_SETTLE_BASIS_H
#define SYSDYN_SETTLE_BASIS_H

#include "system/settle.h"

enum { SD_BASIS_OUT = 1 << 20 }; /* refusals of a basis that is not tried any more: it fills too much */

/* A basis without a pattern yet, the columns of whose matrix, the rows, are in this order; 2: no memory. */
int sd_settle_basis_new(sd_settle *settle, const int32_t *order);

/* The basis from slopes and scales; 1: there is none. */
int sd_settle_choose(sd_settle *settle);

/* One Newton step within the basis; the largest moves of all and of the state, in magnitudes. */
double sd_settle_move_basic(sd_settle *settle, double *y, double *yd, double *state);

#endif
