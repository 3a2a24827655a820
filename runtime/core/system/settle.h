/* Moves a point onto every equation that holds there: the rows as written and their hidden derivatives.
 *
 * Unknowns x = (y, chosen yd).  Rows: dynamics, momentum, momentum_rate, phi, phi_rate, phi_acceleration, psi,
 * psi_rate, gamma, gamma_rate, lambda (a system of assembly.h whose rows may be fewer than its unknowns).
 * Weighted least change (Gauss-Newton, each step the saddle-point system
 *      [ D   G^T ] [ z      ]   [ -D (x - x0) ]
 *      [ G  -eps ] [ lambda ] = [ -r          ]
 * in scaled unknowns z and rows): unknowns that carry the state have weight 1, those that follow from it almost
 * none.  eps makes redundant rows harmless.  The factors are kept from point to point while the iteration contracts.
 * Where the state meets its own rows already, nothing of it has to move, and a basic solution of G z = -r is the same
 * thing at a fraction of the cost: the unknowns that follow pivot first (`basis`).  One that moves the state by more
 * than is asked is not taken, and where events come and go none that leaves something open: of that the least is wanted.
 */
#ifndef SYSDYN_SETTLE_H
#define SYSDYN_SETTLE_H

#include "system/assembly.h"
#include "linear/linear.h"
#include "linear/sparse/sparse.h"

/* Of a condensed system the kept unknowns are moved; the others follow, and so do their rates. */
/* what an unknown is of the state: nothing, one of it, one whose differences from others (`pair`) are of it: what floating
 * stores hold, each difference with the weight 1; what their ends have in common follows */
#define SD_HELD 1e8 /* weight of the state in a second attempt, and across an instant */
enum { SD_STATELESS, SD_CARRIES, SD_DIFFERS };
enum { SD_OTHER, SD_CONSTRAINT, SD_RATE, SD_LEFT_OUT };

enum { SD_BY_NONE, SD_BY_MATRIX, SD_BY_BASIS }; /* what is ready */

typedef struct sd_settle {
    sd_system *system;
    sd_linear *linear;               /* of the saddle-point matrix [unknowns + rates + rows]; NULL: not there yet */
    int32_t unknowns, rates, rows;
    const int32_t *rate;             /* [rates] positions in yd, ascending */
    const int32_t *slot_y, *slot_y_t;     /* [entries] places of dF/dy in the matrix and its transpose, -1: none */
    const int32_t *slot_yd, *slot_yd_t;   /* [entries] the same of dF/dyd */
    const int32_t *slot_x, *slot_r;       /* [unknowns + rates], [rows] diagonal */
    const char *state;               /* [unknowns + rates] SD_STATELESS ... */
    const int32_t *pair;             /* [pairs][2] unknowns of which stores know the difference */
    const int32_t *slot_pair, *slot_pair_t; /* [pairs] its place in the matrix and its transpose */
    int32_t pairs;
    double follows;                  /* weight of the others: almost nothing */
    double *scale;                   /* [unknowns + rates] magnitudes */
    double time;                     /* s in which unknowns change: their magnitudes over it are those of rates, at least */
    double within;                   /* s of the step within which points are; 0: of none */
    const int32_t *sort;             /* [rows] SD_CONSTRAINT: counts in the norm of constraints; SD_RATE; SD_LEFT_OUT */
    const int32_t *k_span;           /* [k_spans][4] stretches of rows q' - f: yd[q] := y[f] afterwards */
    int32_t k_spans;
    double *jy, *jyd;                /* [entries]; of large ones where they are wanted alone, like the matrix of a basis and its
                                      * pattern */
    double *matrix, *row_scale, *r, *x, *x0, *step; /* all but row_scale: of one point alone */
    double *memory, *work;           /* what is known from point to point; room for one that is nobody's else, or NULL */
    double *lent;                    /* room of the caller for a point [lent_room], who set it; NULL: none */
    size_t lent_room;
    double *met, *usual;             /* [unknowns + rates] what followed at the last point that settled, one behind the other;
                                      * of steep laws [unknowns]: magnitudes before */
    sd_sparse *basis;                /* of G^T, its rows over the weights: what follows pivots first; or NULL */
    int32_t basis_entries;           /* of its matrix */
    int32_t *basis_column, *basis_row;            /* its pattern: [rows + 1], unknowns and rates of each row */
    double *basis_value;             /* [basis_entries] */
    double hold;                     /* weight of the state; 1 but in a second attempt */
    double enough;                   /* scaled residual with which a draft is content; 0: round-off */
    double slack;                    /* move of the state, in magnitudes, by which a basic solution may differ */
    double still;                    /* the same by which it may still be off the least change; 0: round-off */
    double most;                     /* the same by which a point may move it: one that moves it further stays; 0: any */
    int32_t ready;                   /* whose factors stand: 0 none, else of the matrix or the basis */
    int32_t refused;                 /* attempts by the basis that led nowhere */
    int32_t determined;              /* the basis serves only where all that follows from the state has a pivot in it */
    double residual, own, constraints; /* after the last call: largest scaled row, and among those that are not the
                                        rate of another; norm of the constraint rows */
    int64_t calls, failures;         /* calls - failures > 0: a point has been met */
    const struct sd_condensed *seen;       /* points are handed over as this system has them; NULL: with all unknowns */
    double *room;                    /* [2][unknowns] for the kept ones of a point with all of them; of one point alone */
    int (*provide)(void);            /* of large ones: makes `linear` and its places when they are wanted first; 0 done */
    double *taken;                   /* the matrix of such a one */
    double drift;                    /* norm of the constraint rows before the last call moved the point */
    double contracted;               /* largest residual beside the one before it, of the steps of the last call */
    double floor;                    /* residual that fresh factors have left: what old ones leave need not be less */
    const int8_t *told;              /* [rows] 1: constant sums, which points between steps keep (integrate/rows/bare.py); NULL: none */
} sd_settle;

sd_settle *sd_settle_new(sd_system *system, sd_linear *linear, int32_t rates);
/* takes the factors of the saddle-point matrix; 2: no memory */
int sd_settle_take(sd_settle *settle, sd_linear *linear);
/* The basis: order of the columns of G^T, the rows; determined: of what follows from the state alone, and all of that.
 * 2: no memory. */
int sd_settle_widen(sd_settle *settle, const int32_t *order, int32_t determined);
/* whether a pattern of the basis exists; NULL without one */
int *sd_settle_pivoted(sd_settle *settle);
/* of a large one lets go of the room for a point, which it has where nobody lent any */
void sd_settle_rest(sd_settle *settle);
void sd_settle_free(sd_settle *settle);
/* y, yd [unknowns] moved in place; 0 done, 1 it did not converge (they are unchanged) */
int sd_settle_point(sd_settle *settle, double t, double *y, double *yd);
/* z, zd [unknowns of the settler's system] := those of y, yd, of a condensed system the kept ones */
void sd_settle_take_point(const sd_settle *settle, const double *y, const double *yd, double *z, double *zd);
/* 1: the point holds as far as round-off lets it, in the scales of the last one that was moved (none yet: 0) */
int sd_settle_holds(sd_settle *settle, double t, double *y, double *yd);

#endif
