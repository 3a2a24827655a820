/* Elimination of a small matrix by a list of operations: found once, replayed with new values.
 *
 * The order of pivots is Markowitz's (1957) with threshold pivoting, on several matrices at once that the same run has
 * met; no row is exchanged later.  What is done then is a list of sums over fixed cells, which an interpreter runs.  Values are not scaled: a factorisation without exchanges is the same under any
 * scaling of rows and columns.  Its growth is judged in scaled terms: columns by magnitudes of the unknowns, rows by their
 * largest entry; multipliers and pivots beyond the limits say that another order is wanted.  Of laws that switch (diodes) one
 * order serves the matrices of some states: up to SD_ORDERS are kept, and the one that served last is tried first.
 */
#ifndef SYSDYN_ELIMINATION_H
#define SYSDYN_ELIMINATION_H

#include "linear/number.h"
#include "linear/sums.h"

#include <stdint.h>

#define SD_REPLAYED 100 /* largest matrix; above, loops over a pattern cost little more than the numbers themselves */

#define SD_SAMPLES 6    /* matrices of which an order is found */
#define SD_ORDERS 4     /* that are kept, where solutions are corrections that the next ones correct */

typedef struct sd_elimination sd_elimination;
struct sd_elimination {
    int32_t n, entries;
    const int32_t *column, *row; /* pattern, compressed columns, of the caller */
    int64_t prepared;            /* orders found so far */
    int32_t ready, scaled;       /* an order was found; the magnitudes of its columns are not all one */
    int32_t factors, inside;     /* cells of factors; of all */
    int32_t samples, seen;
    int32_t wait, missed;        /* matrices from one order to the next at least; that it did not serve since the last */
    sd_number *sample;           /* [SD_SAMPLES][entries] scaled matrices, the newest last */
    sd_number *cell;             /* inverse pivots, other factors; then n each: right side, magnitudes, sizes of rows, their
                                    growth */
    int32_t *pivot_row, *pivot_column; /* [n] */
    double growth;               /* largest multiplier that is borne, in scaled terms: it costs that many digits */
    double *weak;                /* [n] least size of each pivot, scaled, as its column was when the order was found */
    sd_list factor, solve;
    sd_elimination *other;       /* with another order; NULL: there is none */
    int32_t first;               /* of the first: matrices seen before an order is looked for */
    int32_t orders;              /* of the first: that it keeps at most, SD_ORDERS or as its owner says */
    sd_elimination *serves;      /* of the first: the one whose factors were the last that served */
    int64_t tries;               /* of the first: matrices so far */
    int64_t since, served;       /* of them the one at the last order; the last that it served */
};

sd_elimination *sd_elimination_new(int32_t n, const int32_t *column, const int32_t *row);
void sd_elimination_free(sd_elimination *elimination);
/* as new: nothing is known of any matrix */
void sd_elimination_forget(sd_elimination *elimination);
/* a matrix [entries] with rows of largest entry 1 that no order served; in time one is found for it and those before it */
void sd_elimination_learn(sd_elimination *elimination, const sd_number *scaled);
/* values [entries], scale [n] magnitudes of the unknowns or NULL.  1: factorised; 0: no order yet, or no healthy one */
int sd_elimination_factor(sd_elimination *elimination, const sd_number *values, const double *scale);
/* x [n]: right side in, solution out */
void sd_elimination_solve(sd_elimination *elimination, sd_number *x);

/* elimination_order.c: pivots of the newest `samples` matrices, and the filled pattern: entry [n][n] by columns, of the
 * caller.  0: found; 1: there is no such order; 2: no memory */
int sd_elimination_order(sd_elimination *elimination, int32_t samples, char *entry);

#endif
