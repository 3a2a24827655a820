/* A stepper of a condensed system with the face of one of the whole system: what reads its points sees every unknown. */
#ifndef SYSDYN_EXPANDED_H
#define SYSDYN_EXPANDED_H

#include "system/condensed.h"
#include "system/settle.h"
#include "steppers/stepper.h"

typedef struct sd_expanded {
    sd_stepper face;                  /* which reads y of a start until the first step: it has no other before it, and no yd */
    sd_stepper *inner;
    const sd_condensed *condensed;
    double *z;                        /* [2 room] a point of kept ones; NULL: it stands in what the method has spare */
    size_t room;
    double *y;                        /* all unknowns of the last point, of steep laws; NULL */
    double *met, *magnitude;          /* [unknowns] of all, which grow with each step as in bdf/bdf.h; NULL: they do not */
} sd_expanded;

/* unknowns: of the full system; NULL without memory */
sd_expanded *sd_expanded_new(sd_stepper *inner, const sd_condensed *condensed, int32_t unknowns);
void sd_expanded_free(sd_expanded *expanded);

#endif
