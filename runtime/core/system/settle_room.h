/* Room for points that settle: of a small system it is kept, of a large one taken for a point alone. */
#ifndef SYSDYN_SETTLE_ROOM_H
#define SYSDYN_SETTLE_ROOM_H

#include "system/settle.h"

/* room for one point, lent by the caller or its own from then on; 0: no memory */
int sd_settle_provide_point(sd_settle *settle);
/* room for the best point of an iteration without a basis, its own from then on; 0: no memory */
int sd_settle_provide_best(sd_settle *settle);
/* room for slopes, and for what a basis takes of them; 0: no memory */
int sd_settle_provide_slopes(sd_settle *settle);
/* largest scaled residual at (t, y, yd) [unknowns of the system], in that room; settle->own, constraints too
 * (settle_measure.c) */
double sd_settle_measure(sd_settle *settle, double t, const double *y, const double *yd);
/* whether room counts more than time */
int sd_settle_large(const sd_settle *settle);
/* of a large one lets go of it: rows of linear laws take new slopes once in many steps */
void sd_settle_leave_slopes(sd_settle *settle);

#endif
