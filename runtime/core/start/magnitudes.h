/* Magnitudes of unknowns by balancing rows: what is unknown is as large as makes its terms balance the others of a row.
 *
 * See runtime/model/scales.py, `propagate`, and runtime/start/starter.py, `scale`, which these are.
 */
#ifndef SYSDYN_MAGNITUDES_H
#define SYSDYN_MAGNITUDES_H

#include "system/assembly.h"

#include <math.h>
#include <stdint.h>

/* the larger, or what is no number */
static inline double sd_larger(double a, double b)
{
    return a >= b || isnan(a) ? a : b;
}

/* the smaller, or what is no number */
static inline double sd_smaller(double a, double b)
{
    return a <= b || isnan(a) ? a : b;
}

/* Rows of a matrix by its entries; depends on the structure alone, shared by threads. */
typedef struct sd_balance {
    int32_t unknowns, rows, entries, kinds;
    const int32_t *row, *column;      /* [entries] */
    const int32_t *kind;              /* [unknowns] number of the kind and unit, below `kinds` */
} sd_balance;

enum { SD_LARGEST = 1, SD_CAPPED = 2 };

/* found [unknowns]: zeros become what balances the rows; size [entries]: |coefficient|, 0: no place; excited [rows]:
 * magnitude of the free terms; silent [rows]: rows that propose nothing (NULL: none); flags: SD_LARGEST of several proposals, SD_CAPPED by the largest known of the kind.
 * Returns 0; -1: no memory. */
int sd_propagate(const sd_balance *balance, const double *size, const double *excited, const char *silent,
                 int32_t flags, double *found);

/* A point at which steep laws are asked what they make of a proposal, and room: [rows + 2 unknowns +
 * entries + SD_LANES] */
typedef struct sd_bearing {
    sd_system *system;
    double t;
    const double *y, *yd;
    double *work;
} sd_bearing;

/* small [entries]: 1 where a coefficient is small beside the largest of its row and kind, 2 where that is what is left of a
 * zero, which proposes nothing; freed by the caller, NULL: no
 * memory.  Several propagations with one `size` have it together. */
char *sd_small(const sd_balance *balance, const double *size);
/* bearing: proposals are what steep laws bear (NULL: as slopes say): by the slope of a diode that blocks 1e50 V balance a
 * current, and a fraction of one volt does */
int sd_propagate_beside(const sd_balance *balance, const double *size, const char *small, const double *excited,
                        const char *silent, const sd_bearing *bearing, int32_t flags, double *found);

/* scale [unknowns] := magnitudes of x, by the entries of a Jacobian and a residual at x, which are overwritten by their
 * magnitudes (what is no number counts as 0).  nominal [first]: 0 where there is none, NULL: nowhere; first: unknowns before the rates; rated [rows]: rows that say nothing of sizes
 * at first; member [first], members: number of the kind of an unknown.  Returns 0; -1: no memory. */
int sd_scale(const sd_balance *balance, const double *nominal, int32_t first, const char *rated, const int32_t *member,
             int32_t members, const double *x, double *jacobian, double *residual, double *scale);

/* size [points][sizes] := largest |entry| of dF/dy at (t, y [points][extended], yd) among those of each number: entry
 * [entries] places in the pattern, of [entries] their numbers; -1: no memory */
int sd_row_sizes(sd_system *system, double t, int32_t points, int32_t extended, const double *y, const double *yd,
                 int32_t entries, const int32_t *entry, const int32_t *of, int32_t sizes, double *size);

/* moves [rows] := how far each row of the system moves with t alone at t0 + span part[k], the largest of all parts; returns
 * the shortest time (s) in which one moves that far at the pace of part[0], INFINITY where none does by more than `noise`
 * of that; -1: no memory */
double sd_excitation(sd_system *system, double t0, double span, const double *y, const double *yd, const double *part,
                     int32_t parts, double noise, double *moves);

#endif
