/* The impulse where one gap closes in flight, and nothing else holds that may let go: runtime/events/impacts.py,
 * runtime/start/instant.py. */
#ifndef SYSDYN_STRIKE_H
#define SYSDYN_STRIKE_H

#include "run/run.h"

/* m->y := the point behind the impulse by which the gap of a strike opens again at t, from m->y, m->yd, whose values and
 * terms are m->values and m->high; 0: it is not as simple, and m->y is no point. */
int sd_strike_gap(sd_run *run, const sd_strike *strike, double t);

/* m->y := the same with the momenta that its flows have; 0: that fails */
int sd_strike_momenta(sd_run *run, const sd_strike *momenta, double t);

/* What is in flight behind an event at t, from m->values there: the gap of the strike (NULL: none) too, and nothing that
 * holds.  1; 0: it flies so low that the method has to be told, and nothing has changed. */
int sd_strike_throws(sd_run *run, const sd_strike *strike, double t);

#endif
