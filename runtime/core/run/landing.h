/* The point behind an event that a mode is entered by. */
#ifndef SYSDYN_LANDING_H
#define SYSDYN_LANDING_H

#include "run/run.h"

/* values [observed] at a point, whose sizes are kept */
void sd_landing_look(sd_run *run, double t, const double *y, const double *yd, double *values);

/* The parameters and the rows of a mode. */
void sd_landing_enter(sd_run *run, int32_t number);

/* m->y, m->yd := the point before an event, which is taken across it; m->p_before := the parameters there */
void sd_landing_leave(sd_run *run);

/* m->restart, m->rate := the point behind an event at t: 1, where the mode is what its values say; sides: from which its
 * relations come */
int sd_landing_arrives(sd_run *run, const double *sides, double t);

/* The same behind a transition, from m->before; the model is then in its mode.  0: it does not lead there, and nothing has
 * changed. */
int sd_landing_takes(sd_run *run, const sd_transition *one, double t);

#endif
