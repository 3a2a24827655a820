/* Points that rows show as they are: nothing is moved, what they leave of the equations is looked at. */
#ifndef SYSDYN_SETTLE_SHOWN_H
#define SYSDYN_SETTLE_SHOWN_H

#include "system/settle.h"

/* 1: y, yd meet constraints and `told` rows as they come, in the scales of the last point that was moved (none yet: 0) */
int sd_settle_meets(sd_settle *settle, double t, double *y, double *yd);
/* whether constraints are `told` rows, too, and no others: they hold for each combination of points that meet them */
int sd_settle_sums_alone(const sd_settle *settle);
/* y, yd as sd_settle_meets would leave them, of a point that meets such rows; what it measured stays */
void sd_settle_as_met(const sd_settle *settle, double *y, double *yd);

#endif
