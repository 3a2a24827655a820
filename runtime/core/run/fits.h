/* Whether a mode is what the values v [rows] of its switching functions and multipliers say at a point. */
#ifndef SYSDYN_FITS_H
#define SYSDYN_FITS_H

#include "run/modes.h"

/* what a row is that is zero but for round-off */
static inline double sd_mode_zero(const sd_modes *m, int32_t row)
{
    return m->small * m->largest[row];
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

/* Whether every contact, law and relation is as the present mode says, relations coming from `before`. */
int sd_mode_fits(const sd_modes *m, const double *before, const double *v);

/* Whether no size shows first at the point behind an event: nothing begins to move there (integrate/sizes.py). */
int sd_mode_sized(const sd_modes *m);

/* The same of a point that the state may have been assigned: nor has an unknown grown so that round-off leaves more of it. */
int sd_mode_ordinary(const sd_modes *m);

#endif
