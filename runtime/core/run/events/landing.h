/* The point behind an event that a mode is entered by. */
#ifndef SYSDYN_LANDING_H
#define SYSDYN_LANDING_H

#include "run/run.h"

/* What keeps its value across an instant: of the unknowns as written those with state 1, in magnitudes; before, before_d
 * [written] := the point there. */
typedef struct sd_keeping {
    int32_t written;
    const int32_t *state;
    const double *magnitude;
    double still;                     /* what a state moves by and has not jumped */
    double *before, *before_d;
} sd_keeping;

/* y, yd := settled at t with the state where it is: 1; 0: that fails, or moves it.  Where constraints stay as they are a basis
 * that moves no state is enough. */
int sd_landing_keeps(sd_settle *settle, double t, double *y, double *yd, const sd_keeping *keeping);

/* Whether values [number] behind an instant differ from those before by more than that part of the largest so far. */
int sd_landing_jumps(int32_t number, const double *before, const double *behind, const double *largest, double part);

/* Whether one of n unknowns whose size nothing names, and that has stood at zero so far, moves: rate [n].  Of such a one
 * nothing is known but `unknown`. */
int sd_landing_shows(int32_t n, const int32_t *unnamed, const double *met, const double *magnitude, const double *rate,
                     double zero, double unknown);

/* Room for the rows of the last step up to t and of what happens there: 1; 0: not now; -1: never. */
int sd_landing_room(const sd_run *run, double t);

/* values [observed] at a point, whose sizes are kept */
void sd_landing_look(sd_run *run, double t, const double *y, const double *yd, double *values);

/* The parameters and the rows of a mode. */
void sd_landing_enter(sd_run *run, int32_t number);

/* m->y, m->yd := the point before an event, which is taken across it; m->p_before := the parameters there */
void sd_landing_leave(sd_run *run);

/* m->restart, m->rate := the point behind an event at t: 1, where the mode is what its values say; sides: from which its
 * relations come */
int sd_landing_arrives(sd_run *run, const double *sides, double t);

/* The same behind a transition, from m->before; the model is then in its mode.  0: it does not lead there, and nothing has
 * changed. */
int sd_landing_takes(sd_run *run, const sd_transition *one, double t);

#endif
