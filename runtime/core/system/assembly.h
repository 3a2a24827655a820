/* A system: residual and Jacobian assembled from the blocks of a compiled model.
 *
 * F(t, y, yd) = sum over calls of block(t, y, yd)  +  rows q' - f.
 * The index form is nothing but the choice of calls and of their tables `at` (where unknown families begin) and
 * `to` (where row families begin).  dF/dy and dF/dyd are kept apart on one pattern (compressed columns), so that
 * G = dF/dy + cj dF/dyd needs no new evaluation when cj changes.
 *
 * Shapes
 *   y, yd [unknowns]   r [rows]   column [unknowns + 1]   row, jy, jyd [entries]
 *   v [largest list of entries]           NULL: found for each Jacobian, as of a large system, where the room counts
 *   slot_dy [n_dy], slot_dyd [n_dyd]      place in jy / jyd of each entry of the block's list
 *   k_q, k_f, k_slot_q, k_slot_f [kinematics]             the rows q' - f and their two entries
 *   k_span [k_spans][4]                the same rows as stretches: number, first row, q and f
 *   k_scale [kinematics]               factors of these rows: beside Phi_q^T nu they are the inverse metric of q; NULL: ones
 *   held_row, held_unknown, held_slot [held]   rows that read "unknown = 0" in the place of their equation (the
 *                                      multiplier of a redundant constraint), with their entry
 *   held_rate [held]                   1: the row reads "derivative of the unknown = 0"
 *   cleared [clear]                    the other entries of these rows
 *   steady                             1: slopes are the same at every point between two starts of a method
 *   scale [scales]                     calls of the scale blocks of steep rows (none: no row is steep)
 * All arrays belong to the caller.
 */
#ifndef SYSDYN_ASSEMBLY_H
#define SYSDYN_ASSEMBLY_H

#include "linear/lanes.h"
#include "system/contract.h"

#include <math.h>

/* A stretch of a list of entries: `number` lines of `width` entries, of which the k-th of line i stands in place
 * first[k] + i step[k]. */
typedef struct sd_lines {
    int32_t number, width;
    const int32_t *first, *step;
} sd_lines;

typedef struct sd_call {
    sd_rows *rows;
    sd_entries *dy;
    sd_entries *dyd;
    sd_frame frame;
    int32_t n_dy, n_dyd;
    const int32_t *slot_dy, *slot_dyd;
    int32_t stretches_dy, stretches_dyd; /* of the lists, where there are no slots */
    const sd_lines *lines_dy, *lines_dyd;
} sd_call;

typedef struct sd_system sd_system;

/* What is left of a system when unknowns are eliminated (condensed.h): the functions below for its kept unknowns.
 * jacobian adds to jy, jyd; steep: s := magnitudes of the terms of steep rows, by `terms` of the whole system. */
typedef void sd_terms(sd_system *system, double t, const double *y, const double *rate, double *s);
typedef struct sd_left {
    void (*residual)(const struct sd_left *left, double t, const double *y, const double *yd, double *r);
    void (*jacobian)(const struct sd_left *left, double t, const double *y, const double *yd, double *jy, double *jyd);
    void (*steep)(const struct sd_left *left, double t, const double *y, const double *rate, double *s, sd_terms *terms);
} sd_left;

struct sd_system {
    int32_t unknowns, rows, entries, calls, kinematics, k_spans;
    const int32_t *column, *row;
    const sd_call *call;
    const int32_t *k_q, *k_f, *k_slot_q, *k_slot_f;
    const int32_t *k_span;
    const double *k_scale;
    int32_t held, clear;
    const int32_t *held_row, *held_unknown, *held_slot, *held_rate, *cleared;
    int32_t scales;
    const sd_call *scale;
    double *v;
    const int32_t *stop; /* nonzero: a callback of the caller failed, give up */
    int64_t residual_evaluations, jacobian_evaluations;
    const sd_left *left; /* the unknowns and rows are those that are left of another system; NULL: all are */
    int32_t steady;
    int32_t together;    /* 1: its blocks may be called by several threads at once */
};

/* the part of one behind that of the unknown before, so that unknowns which are moved by 1 + part move apart from each other:
 * steps of the golden ratio */
static inline double sd_next_part(double part)
{
    return fmod(part + 0.6180339887498949, 1.0);
}

/* r := F(t, y, yd) */
void sd_residual(sd_system *system, double t, const double *y, const double *yd, double *r);
/* the same added to r, rows q' - f and held ones put there, of a system that is not condensed */
void sd_add_rows(const sd_system *system, double t, const double *y, const double *yd, double *r);
/* jy := dF/dy, jyd := dF/dyd; where a slope is no number at the point itself (the root of an orifice at rest), at one so
 * near that it is steeper than any step resolves.  size: magnitudes of the unknowns, NULL where they are
 * not known.  Returns the first row with a slope that is none there either, or -1. */
int32_t sd_jacobian(sd_system *system, double t, const double *y, const double *yd, const double *size, double *jy,
                    double *jyd);
/* one of them, of a system that is not condensed; rate: dF/dyd */
void sd_slopes(const sd_system *system, double t, const double *y, const double *yd, int rate, double *values);
/* both in one list [entries], of a system without rows q' - f and held ones whose slots are places in it; slopes that are no
 * numbers as above.  0; -2: no memory */
int sd_both_slopes(const sd_system *system, double t, const double *y, const double *yd, double *values);
/* s := magnitudes of the terms of steep rows at (t, y), zero in others; rate as below */
void sd_steep_terms(sd_system *system, double t, const double *y, const double *rate, double *s);
/* The first steep row whose residual r is more than `limit` of the magnitudes of its terms at (t, y), -1 where every one
 * holds.  rate [unknowns]: magnitudes of the derivatives, as the method makes them of values; s [rows]: work.
 * g [entries], scale, met [unknowns]: slopes, magnitudes of y, the largest |y| so far; all: the other rows are judged too, by
 * the terms |g y| of the linear model. */
int32_t sd_first_unmet(sd_system *system, double t, const double *y, const double *rate, const double *r, double limit,
                       const double *g, const double *scale, const double *met, int all, double *s);
/* The first steep row whose residual r at (t, y) is more than `limit` of the magnitudes of its terms and what is open of the
 * unknowns [n], and of their changes in a step h, makes of it, the entries jy and jyd being those of the point, or of one
 * nearby; -1 where there is none.  rate, s, all: as above. */
int32_t sd_first_astray(sd_system *system, double t, const double *y, const double *rate, const double *r, double limit,
                        const double *jy, const double *jyd, double h, const double *open, int all, double *s);
/* position of the first number that is not finite, -1 where all are */
int32_t sd_first_bad(int32_t n, const double *x);
#define SD_FEW 32 /* numbers that are looked at one by one: what was just written so is not at hand in pairs */

/* 1: all are.  Of many by four sums that do not wait for each other; lanes would stand in memory outside the wide passes. */
static inline int sd_finite(int32_t n, const double *x)
{
    double a = 0.0, b = 0.0, c = 0.0, d = 0.0; /* x - x is 0 for a finite number and not a number otherwise */
    const int32_t whole = n < SD_FEW ? 0 : n - n % 4;
    for (int32_t i = 0; i < whole; i += 4) {
        a += x[i] - x[i];
        b += x[i + 1] - x[i + 1];
        c += x[i + 2] - x[i + 2];
        d += x[i + 3] - x[i + 3];
    }
    if (a + b + c + d != 0.0)
        return 0;
    for (int32_t i = whole; i < n; i++)
        if (x[i] - x[i] != 0.0)
            return 0;
    return 1;
}

/* yd[q] := y[f] of all rows q' - f in these stretches [spans][4] */
static inline void sd_follow_flows(const int32_t *span, int32_t spans, const double *y, double *yd)
{
    for (const int32_t *end = span + 4 * (size_t)spans; span < end; span += 4)
        for (int32_t i = 0; i < span[0]; i++)
            yd[span[2] + i] = y[span[3] + i];
}

#endif
