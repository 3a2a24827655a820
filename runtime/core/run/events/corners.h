/* Instants at which the text of a model without events jumps or bends (integrate/jumps/crossing.py), passed without Python.
 *
 * The end of the last step is moved onto the equations of before the instant, then onto those behind it with the state held.
 * Where that moves a state, does not hold, or shows a first unknown of no known size nothing has been done: Python passes it.
 * Sizes of unknowns grow as in integrate/weights/sizes.py.
 */
#ifndef SYSDYN_CORNERS_H
#define SYSDYN_CORNERS_H

#include "run/events/modes.h"
#include "steppers/expanded.h"

#include <stdint.h>

typedef struct sd_corners {
    const sd_piece *piece;            /* [pieces] of the text */
    int32_t pieces, at;               /* at: the one that is stepped */
    int32_t unknowns, keeps, groups;
    double *t_end;                    /* of the method */
    const sd_expanded *expanded;      /* NULL: it steps every unknown */
    const int32_t *kept;              /* [keeps] that it steps, of which it has sizes of its own */
    double *own_magnitude, *own_met;  /* [keeps] */
    double *magnitude, *met, *resolved; /* [unknowns] */
    const int32_t *state, *differential, *unnamed; /* [unknowns] 1: keeps its value; has a rate; its size is not said */
    const int32_t *group;             /* [unknowns] of one kind and unit */
    double *largest;                  /* [groups] */
    sd_system *system;                /* with every unknown */
    const uint8_t *constraint, *balance, *multiplier, *flow; /* of sd_noise */
    double *jy, *jyd, *open;          /* [entries], [unknowns] */
    double *y, *yd, *before, *before_d, *rate, *seen; /* [unknowns] with room for what is audited; seen [observed] */
    double still, differs;            /* of its size: what a state moves by and has not jumped; what is seen to jump */
    double unknown_size, round_off, part; /* size of what nothing is known of; parts of sizes: zero; of its like, at least */
    double time, resolves;            /* s: of a step; magnitudes beside what round-off leaves open */
    int32_t sweeps;
} sd_corners;

struct sd_run;

/* Behind a step that has met the end of its piece: SD_RUNNING: the next one has begun; SD_FULL: no room for rows;
 * SD_FINISHED: there is none, or Python passes the instant. */
int sd_corners_end(struct sd_run *run);

#endif
