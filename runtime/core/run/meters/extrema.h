/* Least and largest values between the rows of a run.
 *
 * Each accepted step is looked at in even parts, on its dense output as it is.  Where three looks in a row say that a
 * quantity turns beyond what is known, the parabola through them tells when, a narrower one around that instant tells
 * better, and the value counts that the point settled there has: of a crest what its tolerance leaves, not what rows miss.
 * Who watches what shall hold always sees these points.
 */
#ifndef SYSDYN_EXTREMA_H
#define SYSDYN_EXTREMA_H

#include <stdint.h>

struct sd_run;

typedef struct sd_extrema {
    int32_t number, columns;      /* looks in a row since a start; quantities */
    int32_t watched;              /* crests have rows of what is watched */
    double *least, *most;         /* [columns] within steps so far; INFINITY, -INFINITY: none */
    double *look[3], *settled;    /* [columns] the last two looks, this one; a settled point */
    double time[2];               /* of the last two looks (s) */
    double until;                 /* end of the last step that was looked at */
} sd_extrema;

/* nothing is known */
void sd_extrema_begin(sd_extrema *extrema);
/* the last step, up to where it counts */
void sd_extrema_within(struct sd_run *run);

#endif
