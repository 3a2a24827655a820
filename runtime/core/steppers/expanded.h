/* A stepper of a condensed system with the face of one of the whole system: what reads its points sees every unknown. */
#ifndef SYSDYN_EXPANDED_H
#define SYSDYN_EXPANDED_H

#include "system/condensed.h"
#include "system/settle.h"
#include "steppers/stepper.h"

typedef struct sd_expanded {
    sd_stepper face;
    sd_stepper *inner;
    const sd_condensed *condensed;
    double *y, *yd, *z, *zd, *memory; /* all unknowns of the point started from or shown last; kept ones */
    double *met, *magnitude;          /* [unknowns] of all, which grow with each step as in bdf.h; NULL: they do not */
} sd_expanded;

/* unknowns: of the full system; NULL without memory */
sd_expanded *sd_expanded_new(sd_stepper *inner, const sd_condensed *condensed, int32_t unknowns);
void sd_expanded_free(sd_expanded *expanded);
/* y, yd := all unknowns of the last point */
void sd_expanded_show(sd_expanded *expanded);
sd_stepper *sd_expanded_stepper(sd_expanded *expanded);
void sd_expanded_start(sd_expanded *expanded, double t, const double *y, const double *yd, double h);

#endif
