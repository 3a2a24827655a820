/* Whether a mode is what the values v [rows] of its switching functions and multipliers say at a point. */
#ifndef SYSDYN_FITS_H
#define SYSDYN_FITS_H

#include "run/events/modes.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>

#define FALLEN SD_SLIGHT /* of what else counts as zero, and of the height of its flight: a gap closes again below it */

#define ROUNDING (4.0 * DBL_EPSILON) /* of the terms of a value: what a sum of a few is rounded by */

/* what a row is that is zero but for round-off; a gap in flight is open until it ends */
static inline double sd_mode_zero(const sd_modes *m, int32_t row)
{
    return (m->known[row] ? ROUNDING : m->thrown[row] ? FALLEN * m->small : m->small) * m->largest[row];
}

/* what a watched row may fall by unseen: behind an impact nearly nothing, for bounces become small */
static inline double sd_mode_least(const sd_modes *m, int32_t row)
{
    return m->thrown[row] ? fmin(sd_mode_zero(m, row), FALLEN * m->height[row]) : sd_mode_zero(m, row);
}

/* the value at which it begins: that of a flight, else zero */
static inline double sd_mode_level(const sd_modes *m, int32_t row)
{
    return m->thrown[row] ? m->level[row] : 0.0;
}

/* the value through which it falls from one that it has had: what has been above zero ends there */
static inline double sd_mode_end(const sd_modes *m, int32_t row, double value)
{
    return value > 0.0 ? 0.0 : sd_mode_level(m, row);
}

static inline const sd_mode *sd_mode_now(const sd_modes *m)
{
    return m->now == SD_OWN ? &m->own : &m->mode[m->now];
}

/* Whether the inequalities that a transition turns, which touches none, could not have stayed as they were: what would
 * hold and open alike at this instant (a diode that conducts beside a capacitor) stays. */
int sd_mode_decided(const sd_modes *m, const sd_mode *from, const sd_transition *one, const double *v);

/* Whether every relation is on the side given, coming from `before`. */
int sd_mode_sides_fit(const sd_modes *m, const double *side, const double *before, const double *v);

/* The same behind an assignment: one whose value it changed, from was[k], has the side of its value but for round-off of its
 * terms [observed], however small it is. */
int sd_mode_assigned_fit(const sd_modes *m, const double *side, const double *before, const double *was, const double *v,
                         const double *terms);

/* Whether a relation that a transition does not cross is back where it was by less than counts: if it falls again, only the
 * handler sees it. */
int sd_mode_returns(const sd_modes *m, const sd_mode *from, const sd_transition *one, const double *v);

/* Whether every contact, law and relation is as the present mode says, relations coming from `before`. */
int sd_mode_fits(const sd_modes *m, const double *before, const double *v);

/* Whether no size shows first at the point behind an event: nothing begins to move there (integrate/weights/sizes.py). */
int sd_mode_sized(const sd_modes *m);

/* The same of a point that the state may have been assigned: nor has an unknown grown so that round-off leaves more of it. */
int sd_mode_ordinary(const sd_modes *m);

#endif
