/* Magnitudes of the unknowns at a start, and after a run: what relative tolerances and scaled matrices refer to.
 *
 * The rules and their reasons stand in runtime/model/scales.py.
 */
#ifndef SYSDYN_SIZING_H
#define SYSDYN_SIZING_H

#include "system/assembly.h"
#include "linear/linear.h"
#include "start/magnitudes.h"

#include <stdint.h>

enum { SD_STATE = 1, SD_FLOW = 2, SD_OF_MOMENTUM = 4, SD_DISPLACEMENT = 8, SD_MOMENTUM = 16, SD_DYNAMIC = 32 };

/* What of it depends on the structure of a form alone; shared by threads. */
typedef struct sd_sizing {
    const sd_balance *balance;       /* rows of the Jacobian; kinds and units of the unknowns */
    const double *nominal;           /* [n] 0: none; NULL: nowhere */
    const int32_t *kind;             /* [n] a sum of the above */
    const int32_t *partner;          /* [n] of a momentum: the flow of its coordinate; -1; NULL where none is */
    /* places in the pattern of what a coordinate's own row holds of it: flows in rows of dynamics, displacements there,
     * flows in rows of momentum, momenta there */
    const int32_t *own[4];
    int32_t owns[4];
    int32_t efforts;                 /* rows of dynamics [efforts] and the places of their displacements */
    const int32_t *effort, *moved;
    int32_t parts, rungs;            /* of the span: where rows are asked how far they moved; of the time scale: steps tried */
    const double *part, *rung;
} sd_sizing;

/* far [n]: how far each unknown gets within tau, by the motion linearised at a start: of steps h <= tau by implicit Euler,
 * (jyd/h + jy) (y - y0) = jyd yd, the largest |y - y0|, at most tau |yd|; jy, jyd [entries], yd [n]; order: of columns as
 * sd_linear_new takes it; rung [rungs]: parts of tau that are tried.  0; -1: no memory.
 * A rate says little of a quantity that relaxes at once: 1 V on 1 uH behind 1 ohm makes 0.5 uWb, not 1 V times the time
 * scale of the rest.  Magnitudes taken from rates alone would hide such a transient from the error test. */
int sd_relaxed(const sd_system *system, const sd_order *order, int32_t rungs, const double *rung, const double *jy,
               const double *jyd, const double *yd, double tau, double *far);

/* found [n]: magnitudes at (t0, y, yd) of a run over the span, *tau: the time scale of the start; y, yd with room for the
 * audit, finite.  jy, jyd [entries], rate [n], order: of sd_relaxed, what says how far unknowns get (NULL: their rates
 * alone do); spent: jy, jyd may be overwritten.  0; -1: no memory. */
int sd_magnitudes(const sd_sizing *sizing, sd_system *system, double t0, double span, const double *y, const double *yd,
                  double *jy, double *jyd, const double *rate, const sd_order *order, int spent, double *found,
                  double *tau);

/* divisor [n]: what each unknown is divided by to compare it with its like, by the entries jy, jyd at a point.
 * Momenta of unlike inertias are as unlike as their flows are alike, displacements of unlike stiffnesses as their efforts
 * are: of momenta the inertia, of displacements one over the stiffness.  1 for all of a kind and unit of which one has
 * none, and for what else there is.  0; -1: no memory. */
int sd_compliance(const sd_sizing *sizing, const double *jy, const double *jyd, double *divisor);

/* found [n]: magnitudes after a run over the span: met [n], the largest it met; magnitude [n] it went by.  0; -1. */
int sd_confirmed(const sd_sizing *sizing, const sd_system *system, double span, const double *met,
                 const double *magnitude, double *found);

/* of what a run confirmed: what guesses of the next one are no larger than; infinite of flows where branches may
 * block (theirs are round-off), of what is no state, of what is named or never moved */
void sd_ceiling(const sd_sizing *sizing, int blocks, const double *met, double *found);

#endif
