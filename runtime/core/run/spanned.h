/* Rows of a step that holds many: points of the polynomial through settled ones.
 *
 * A point of a row is the method's polynomial, settled.  Where neither the equations nor their sources have a corner within
 * the step, it is smooth there, and the polynomial through settled points at Chebyshev's nodes tells it as far as round-off
 * (Trefethen, Approximation Theory and Practice: its error falls by a constant factor with each node).  Nothing is taken on
 * trust:
 * - at two points between the nodes, settled by themselves, it is there as far as a small part of the tolerance, in magnitudes:
 *   this is about what rows hardly tell, as of potentials that float;
 * - each row's own residual is what round-off leaves, as that of a settled point: this is about what happens between these
 *   points, as where a source has a pulse.  A row of which it is more is settled from there.
 */
#ifndef SYSDYN_SPANNED_H
#define SYSDYN_SPANNED_H

#include "run/run.h"

#define SD_SPANNING 17 /* nodes at most; and room for two points more */
#define SD_SPANNED_MOST 2000 /* unknowns of the settler: beyond it the room counts */

/* whether the rows of kind `kind` at t within the last step may be told from such nodes, which are looked for if nobody did */
int sd_run_spans(sd_run *run, int32_t kind);

/* run->point, point_d := the point at t of the polynomial; 1: it is settled */
int sd_run_span(sd_run *run, double t);

#endif
