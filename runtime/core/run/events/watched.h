/* Changes of what is watched within a step. */
#ifndef SYSDYN_WATCHED_H
#define SYSDYN_WATCHED_H

#include "run/run.h"

/* Whether something watched changes within the last step.  A step is as long as its unknowns allow, and a function of them may
 * turn much faster: where it does, as many parts as it takes to follow it are looked at, and it changes within
 * t_clear..t_seen, the first of them but for what settling moves.  Else t_clear is the begin of the step. */
int sd_run_changes(sd_run *run, double from);

#endif
