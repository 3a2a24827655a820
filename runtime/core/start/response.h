/* How far unknowns are moved by what moves with t: the response to sources that start at zero.
 *
 * Slopes at a start say nothing of it where every source is still zero, and rows with all else held at the start say too
 * much: 2 V on a diode that nothing else relieves drive 1e8 A.  One step of implicit Euler, F(t, y0 + d, d / h) = 0, is
 * relieved by all that moves with it.  Newton's method follows d
 *   from t0 to t0 + quick with h = quick: what moves with t has moved by then, and d is what it plainly makes of the
 *       unknowns (least),
 *   on with t held and h from quick to the span: what it would make of them if it stayed there (most).  What is pushed
 *       goes no further than with the square of time: where the path ends before, at h, most is (span / h)^2 of what was
 *       found, and in proportion where t came less far than t0 + quick.
 *
 * Both are bounds, for either alone misleads: a step of `quick` knows nothing of what arrives later (the far end of a line,
 * what integrates), one of the span overrates what turns round with its source.  Measured on 384 runs (models/, four
 * formulations): 0.976 of the evaluations of the residual in the geometric mean, the most 1.34, the least 0.21; ring at
 * 1e-4 a tenth of the time.  Bounds from steps of the start's own time scale where nothing moves with t cost 1.01 to 1.02
 * (a car's drive line, the beam: 2 to 5 times), so there are none.
 */
#ifndef SYSDYN_RESPONSE_H
#define SYSDYN_RESPONSE_H

#include "linear/linear.h"
#include "start/magnitudes.h"
#include "system/assembly.h"

#include <stdint.h>

/* least, most [n]: bounds of the largest |y - y0| in a run from (t0, y [n]) over the span (s); quick (s): in which what moves
 * with t does so; scale [n]: magnitudes so far; order: of sd_linear_ordered.  1: found; 0: no path begins, or it is too
 * much work; -1: no memory. */
int sd_response(const sd_balance *balance, sd_system *system, const sd_order *order, double t0, double quick, double span,
                const double *y, const double *scale, double *least, double *most);

#endif
