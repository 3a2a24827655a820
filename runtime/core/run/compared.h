/* Rows that nothing but the comparison of runs reads: their rates are the slopes of the dense output. */
#ifndef SYSDYN_COMPARED_H
#define SYSDYN_COMPARED_H

#include "run/run.h"

/* the row just written at t, once more for the comparison alone; begun: of the first step behind a restart */
void sd_run_compare(sd_run *run, double t, double *row, int begun);

#endif
