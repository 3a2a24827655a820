/* Where within a step something watched changes. */
#ifndef SYSDYN_CROSSING_H
#define SYSDYN_CROSSING_H

#include "run/run.h"

/* The first instant within modes->begin..end of the last step at which something watched changes, on the settled dense
 * output, and how many of modes->which; 0: none.  It is sought on the dense output as it is, and followed from there; the
 * point of the run is the settled one there. */
int32_t sd_run_crossing(sd_run *run, double end, double *t);

#endif
