/* A system seen through the unknowns that are left when others are eliminated, exactly and once for all.
 *
 * Eliminated unknowns e are sums of kept ones z with constant factors: e = c + T z, from rows that constants make of
 * unknowns (a resistor's law, the balance of a node) and whose derivatives no row reads.  Kept rows r(t, (z, e(z)), z')
 * are a system of its own, with dr/dz = J_z + J_e T.  Steppers see that one; what reads a trace sees every unknown again
 * (expanded.h).
 *
 * Shapes
 *   unknowns, rows: kept ones; full: the system with all of them
 *   unknown, row: spans of kept places, one behind the other in both
 *   rate: those of the kept unknowns whose rates a block reads; rest: kept rows that a block adds to
 *   own [own_spans][4]: kept rows q' - f that no block adds to, as stretches: number, kept row, kept q, place of f in y
 *   straight: eliminated unknowns in an order in which each reads kept ones and those before it
 *   from, to, share [products]: entry `to` of the kept matrix += share * entry `from` of the full one
 *   y, yd [full unknowns + 8 at least], r [full rows], slope [full entries]: work; slope NULL: found for each Jacobian, as of a
 *   large system, where the room counts
 */
#ifndef SYSDYN_CONDENSED_H
#define SYSDYN_CONDENSED_H

#include "system/assembly.h"

typedef struct sd_span {
    int32_t full, kept, number;
} sd_span;

/* y[place + i] = constant[i] + sum over k of factor[k * number + i] * y[source[k] + i]; alike, where each term has one
 * factor: how far those of its terms stand apart, else 0; audited: powers and energies read these, or what does; rated: rows show
 * rates of these, or of what is a sum of these */
typedef struct sd_straight {
    int32_t place, number, terms, alike, audited, rated;
    const int32_t *source;  /* [terms] */
    const double *factor;   /* [terms][number], or [terms][alike] */
    const double *constant; /* [number], NULL: zeros */
} sd_straight;

/* A stretch of products, told as sd_lines are; share [width]: of every line */
typedef struct sd_shares {
    int32_t number, width;
    const int32_t *from, *from_step, *to, *to_step;
    const double *share;
} sd_shares;

typedef struct sd_condensed {
    sd_left left;
    sd_system *full;
    int32_t unknowns, rows, unknown_spans, row_spans, rate_spans, rest_spans, own_spans, straights;
    int32_t observed_rates; /* 0: nobody reads rates of eliminated unknowns before a point is settled */
    const sd_span *unknown, *row, *rate, *rest;
    const int32_t *own;
    const sd_straight *straight;
    int64_t products;
    const int32_t *from, *to;       /* NULL: products are told by their stretches */
    const double *share;
    int64_t stretches;
    const sd_shares *shares;
    double *y, *yd, *r, *slope;
} sd_condensed;

/* the functions of assembly.h read `system` through it, with the numbers that it has now */
void sd_condensed_bind(sd_condensed *condensed, sd_system *system);

/* A residual in parts: the point z in y, then the rates zd in yd as far as blocks read them, then its rows.  in_place: these may
 * stand where zd does (each row q' - f is that of its own unknown). */
void sd_condensed_place(const sd_condensed *condensed, const double *z);
void sd_condensed_place_rates(const sd_condensed *condensed, const double *zd);
void sd_condensed_rows(const sd_condensed *condensed, double t, const double *zd, double *r);
int sd_condensed_in_place(const sd_condensed *condensed);

/* the kept ones of x from z */
void sd_condensed_put(const sd_condensed *condensed, const double *z, double *x);
/* all unknowns x of the full system from kept values z; rate: x and z are derivatives.  What is neither kept nor
 * eliminated stays as it is */
void sd_condensed_expand(const sd_condensed *condensed, const double *z, double *x, int rate);
/* of all unknowns x those that powers and energies read; the others stay as they are */
void sd_condensed_audited(const sd_condensed *condensed, const double *z, double *x);
/* y, yd of a point that is observed but not settled: rates only as far as they are read */
void sd_condensed_show(const sd_condensed *condensed, const double *z, const double *zd, double *y, double *yd);
/* of rates yd, whose kept ones stand there, those that rows show */
void sd_condensed_shown_rates(const sd_condensed *condensed, double *yd);
/* the eliminated ones of x from its kept ones */
void sd_condensed_complete(const sd_condensed *condensed, double *x, int rate);
void sd_condensed_gather(const sd_condensed *condensed, const double *x, double *z);

#endif
