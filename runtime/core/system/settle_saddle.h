/* Points settled by the least change: weights D of the state, the saddle-point matrix, a Gauss-Newton step (settle.h). */
#ifndef SYSDYN_SETTLE_SADDLE_H
#define SYSDYN_SETTLE_SADDLE_H

#include "system/settle.h"

/* Magnitude of rate k at a point: that of its unknown over the time in which unknowns change, or what it is there.  One
 * that has been larger says nothing: what is left of a row would be little beside a rate of no time long ago. */
double sd_settle_rate(const sd_settle *settle, int32_t k, const double *yd);

/* Slopes at (t, y, yd) in scaled unknowns, and row scales from the magnitudes of the terms.  met: the point is one of
 * the motion, with which magnitudes of unknowns grow, and has those of rates; an iterate may be anywhere.  0: no memory. */
int sd_settle_slopes(sd_settle *settle, double t, const double *y, const double *yd, int met);

/* the saddle-point matrix and its factors at (t, y, yd); 1: there are none */
int sd_settle_factorise(sd_settle *settle, double t, const double *y, const double *yd);

/* One step of x = (y, chosen yd); the largest moves of all and of the state, in magnitudes.  The state is drawn to where it
 * came from, what follows from it only held where it is: so in the end it exerts no pull. */
double sd_settle_move(sd_settle *settle, double *y, double *yd, double *state);

/* how far pair k is parted from where it was, in its magnitude; y, y0 [unknowns] */
double sd_settle_parted(const sd_settle *settle, int32_t k, const double *y, const double *y0);

#endif
