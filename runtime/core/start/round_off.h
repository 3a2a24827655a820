/* What round-off leaves open of unknowns: see runtime/model/scales.py, `unresolved` and `noise`, which these are.
 *
 * jy [entries of the pattern]: dF/dy; constraint, balance [rows], multiplier, flow [unknowns]: 1 for those of the kind.
 */
#ifndef SYSDYN_ROUND_OFF_H
#define SYSDYN_ROUND_OFF_H

#include "system/assembly.h"

#include <stdint.h>

/* found [unknowns] := of the terms of the constraints that each stands in.  Returns 0; -1: no memory. */
int sd_unresolved(const sd_system *system, const uint8_t *constraint, const double *y, const double *jy, double *found);
/* The same, flows being differences of their displacements over a time (s), and multipliers balancing what flows make of
 * that, along `sweeps` rows at most; small: part of the largest slope of a row below which a multiplier is told nothing. */
int sd_noise(const sd_system *system, const uint8_t *constraint, const uint8_t *balance, const uint8_t *multiplier,
             const uint8_t *flow, const double *y, const double *jy, double time, int32_t sweeps, double small, double *found);

#endif
