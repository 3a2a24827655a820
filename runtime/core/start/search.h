/* The search for a start on small models: rows of the settled form in few unknowns, by Gauss-Newton steps of least norm.
 *
 * What runtime/numerics/gauss_newton.py does for a Problem and runtime/start/starter.py for its rows, on full matrices.
 */
#ifndef SYSDYN_SEARCH_H
#define SYSDYN_SEARCH_H

#include "system/assembly.h"
#include "start/magnitudes.h"

/* what a search may spend (runtime/numerics/work.py says what of) */
#define SD_GRANTED 3.6e9
#define SD_ITERATIONS 40
#define SD_EVALUATION 1e6
#define SD_EACH 40.0
/* how it goes on (runtime/numerics/gauss_newton.py) */
#define SD_HALVINGS 12
#define SD_LOST 3
#define SD_FOLDS 709

/* The equations of a start.  Unknowns x [unknowns] = y as written and those of the start alone, the derivatives that occur. */
typedef struct sd_rows_of_start {
    sd_system *system;                /* form "start" */
    sd_balance balance;               /* of all entries: those of y, of rates */
    int32_t written, rates;
    int32_t plain, rated;             /* entries of dF/dy that some block writes; of dF/dy' in the columns of the rates */
    int32_t k_spans;
    const int32_t *rate;              /* [rates] place in y */
    const int32_t *entry;             /* [plain + rated] place in the system's pattern; NULL beside `both` */
    const int32_t *k_span;            /* [k_spans][4] rows q' - f (assembly.h) */
    int32_t extended;                 /* length of y as blocks see it */
    const sd_system *both;            /* the system with slots in the entries of these equations (sd_both_slopes), or NULL */
} sd_rows_of_start;

/* r [rows]; values [entries] */
int sd_start_residual(const sd_rows_of_start *start, double t, const double *x, double *r);
int sd_start_jacobian(const sd_rows_of_start *start, double t, const double *x, double *values);

/* One problem: rows `use` in the unknowns `free`, which move from the guess by scale / weight. */
typedef struct sd_search {
    const sd_rows_of_start *start;
    const int32_t *use, *free;                      /* [rows], [unknowns] */
    const double *guess, *scale, *weight;           /* [unknowns] */
    double t;
    int32_t most;                                   /* iterations, but for those in which rows shrink as their terms do */
    double share, spent, largest;                   /* of the work (least_change.Work) */
    double *x, *scaled;                             /* [unknowns], [rows]: the best point, from x, and its scaled rows */
    double residual;                                /* the largest of them */
} sd_search;

/* 0; -2: no memory */
int sd_search_solve(sd_search *search);
/* the scaled rows at search->x and the largest of them, of a problem of any size */
int sd_search_measure(sd_search *search);

#endif
