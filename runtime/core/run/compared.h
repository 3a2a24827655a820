/* Rows that nothing but the comparison of runs reads: their rates are the slopes of the dense output. */
#ifndef SYSDYN_COMPARED_H
#define SYSDYN_COMPARED_H

#include "run/run.h"

/* the row just written at t, once more for the comparison alone; begun: of the first step behind a restart */
void sd_run_compare(sd_run *run, double t, double *row, int begun);
/* rows.c: the point of a row moved there, roughly where only runs are compared by it; rated: its rates are wanted too */
void sd_run_settle_row(sd_run *run, double t, int32_t kind, int rated);

#endif
