/* The start of one of many runs, from the nominal one by one settling; what may not be another than there (see many.h). */
#ifndef SYSDYN_MANY_START_H
#define SYSDYN_MANY_START_H

#include "run/many/many.h"

/* every structure as it was set up */
void sd_many_restore(const sd_region *region, int32_t regions);

/* points are settled in these magnitudes */
void sd_many_scale(sd_settle *settle, const double *magnitude, double tau);

/* y, yd of passes[0] := the consistent start with these anchors */
int sd_many_begin(sd_many *many, const double *anchor);

#endif
