/* Radau IIA of 3, 5 or 7 stages (order 5, 9, 13, stiffly accurate) for F(t, y, yd) = 0.
 *
 * Sources: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, sections IV.8 and VI.4; the
 * error estimate (8.19)-(8.20), Gustafsson's controller (8.25); the same authors, Stiff differential equations solved by
 * Radau methods, J. Comput. Appl. Math. 111 (1999).  Names of that book, declared once:
 *   c[i], A      nodes and coefficients; A^-1 has the eigenvalues gamma and lambda_k, conj(lambda_k)
 *   z[i]         Y_i - y_n of the stages; the derivatives there are K = A^-1 z / h
 *   theta        contraction of Newton's iteration
 * Unknowns that occur undifferentiated are stage values like the others: their K enters no row.  With simplified
 * Jacobians J = dF/dy, E = dF/dyd a Newton step is the real system (J + gamma/h E) w = r and, one for each pair, the
 * complex ones (J + lambda_k/h E) w = r on one pattern.
 * Error test, weights and Newton's norm: as in bdf/bdf.h, with the tolerance 0.1 rtol^(2/3) that fits an estimate of order 3;
 * it stands for more stages too, whose estimate has the order of the values within the step.
 * Values within a step: the polynomial of the stages.  For unknowns with derivatives, of three stages the quintic through
 * values and derivatives at the last three points, whose error is that of the method; of more the polynomial of the
 * stages with the derivative at the step's start besides, an order more.  Where an unknown is pulled back faster than
 * the step follows, its derivative is its error times that rate, and the polynomial of the stages serves.  The stage's K
 * at the end of a step has the multipliers' order only: where rows are asked for, derivatives come from the settled point,
 * and lead the unknowns that they take no further off the polynomial of the stages than the error test allows.
 */
#ifndef SYSDYN_RADAU_H
#define SYSDYN_RADAU_H

#include "system/assembly.h"
#include "linear/complex_linear.h"
#include "linear/linear.h"
#include "steppers/stepper.h"

enum { SD_METHODS = 3 };
enum { SD_STAGES = 7 }; /* at most */
enum { SD_PAIRS = 3 };
enum { SD_POINTS = 3 };
enum { SD_UNPULLED = 2 };
/* columns of sd_radau_lean: those that the factors left, those that may be left */
enum { SD_WHERE_LEFT = 1, SD_WHERE_IDLE };
/* of the control of steps */
#define SD_GROWTH 8.0         /* of the step at most; it shrinks to 1/5 at most */

/* Coefficients of one method (numerics/radau_coefficients.py); rows and columns of S of A^-1 = S diag(...) S^-1 */
typedef struct sd_radau_method {
    int32_t stages, pairs;
    double c[SD_STAGES], b[SD_STAGES], inverse[SD_STAGES][SD_STAGES], gamma;
    double complex lambda[SD_PAIRS];
    double column[SD_STAGES], row[SD_STAGES];
    double complex columns[SD_PAIRS][SD_STAGES], rows[SD_PAIRS][SD_STAGES];
    double estimate[SD_STAGES];
    double lift[SD_STAGES + 1]; /* of x, x^2, ...: zero at 0 and 1, slope 1 at 0 and none at any node */
    double taylor[2][SD_STAGES]; /* by z: Taylor coefficients s-1 and s of the stages' polynomial in the middle */
    double constant;             /* the estimate over Taylor coefficient s+1 */
} sd_radau_method;

extern const sd_radau_method sd_radau_methods[SD_METHODS];

typedef struct sd_radau {
    sd_ivp ivp;
    sd_linear *linear;
    sd_linear_z *complex_linear[SD_PAIRS]; /* NULL for those that no method needs */
    int32_t stages, most_stages; /* of the first step; at most */
    const int8_t *smooth;     /* [n] 1 where yd is the derivative, SD_UNPULLED: and is interpolated whatever pulls */
    const int32_t *common_from, *common; /* as in bdf/bdf.h: groups that are tested with h but for what they have in common */
    int32_t commons;
    /* state of the integration */
    double tolerance;         /* 0.1 rtol^(2/3) */
    double strict[SD_METHODS]; /* what the estimate of each method counts beside the first one's */
    double strict_first;       /* what it does in the first step, of three stages */
    double h_factored, h_before, h_accepted, error_accepted, theta, state_size;
    double growth;            /* of the next step at most where laws are steep */
    double longest;           /* step accepted */
    double follows;           /* behind a restart: tolerances by which what follows moves where slopes move the state by one
                               * (radau_dense.c); 0: not known yet */
    int32_t behind;           /* a restart */
    int32_t balances;         /* balances are steep: in rates, whose round-off grows as steps shrink */
    int32_t pressed;          /* a steep law lets no length of step do: corrections are shortened at once */
    int32_t ready, old_jacobian, rejected;
    int32_t lasting;          /* 1: slopes are what they were, wherever they are taken */
    const sd_radau_method *method, *used;           /* of the step at hand, of the last accepted one */
    int32_t since;                                  /* steps accepted since the method changed */
    int32_t hold;                                   /* steps that still take three stages */
    int32_t creeping;                               /* steps in a row for which Newton failed at first */
    int32_t strained, turned;                       /* in the last one Newton failed with fresh slopes; all its stages were
                                                     * solved for at once */
    double lead[SD_STAGES][SD_STAGES], h_lead;      /* A^-1 / h, of the h and the method that they were made for */
    const sd_radau_method *of_lead;
    double *phi, *yd;         /* [n] the last accepted point */
    double *last, *before;    /* [n] the points before it: the start of the last step, of the one before; last NULL: it is
                               * what the last stage leaves of phi */
    double *slope[SD_POINTS]; /* [n] derivatives at phi, last, before, for values within the step */
    int32_t refined[SD_POINTS];                     /* they are settled */
    double *z[SD_STAGES], *kept[SD_STAGES];         /* of this step, of the last accepted one */
    double *d[SD_STAGES];                           /* right sides and corrections */
    double *base[SD_STAGES], *full[SD_STAGES];      /* z before a correction that is shortened, and all of it; of steep
                                                     * laws alone, like moved, first and terms */
    double *moved[SD_STAGES];                       /* what the correction before this one did to z */
    double *first;            /* [n] d[0] while a correction is tried */
    char *led;                /* [n] 1: in the last step h |dF/dy| / |dF/dyd| of the row that holds its derivative was small:
                               * steps resolve its motion, and its derivative tells more than the stages alone */
    double (*gap)[SD_STAGES + 1][SD_STAGES + 1]; /* [methods]: sd_radau_gaps */
    double apart[SD_POINTS], bend[SD_POINTS]; /* of each of the last points x_i: the product of all 1 / (x_i - x_j), twice
                                               * their sum */
    double *at_zero;          /* [entries] dF/dy where all unknowns are zero, of steep laws; made when first needed */
    char *open;               /* [n] columns that factors left */
    double *y, *rate, *terms, *jy, *jyd, *g, *work; /* work: the memory of all vectors but phi, yd and slopes; a weight that is
                               * NULL is made where it is read */
    int32_t *at;              /* [n] of a large system whose columns are alike: where those of each begin in jy, jyd; else NULL,
                               * and they stand as in the pattern */
    double *newton_weight, *scale, *powered; /* of Newton's norm (NULL: as weight), of columns; their memory where powers of
                                              * h count */
    double complex *w[SD_PAIRS]; /* right sides and solutions */
    int32_t in_place;         /* the point of a stage, its rates and its residual take turns in d; y and rate stand there too,
                               * w where the point of the whole system does */
    struct sd_coupled *coupled;   /* radau_coupled.c: all stages at once; made when first needed */
} sd_radau;

/* stages: at most; complex_linear [(stages - 1) / 2] */
sd_radau *sd_radau_new(sd_system *system, sd_linear *linear, sd_linear_z *const *complex_linear, int32_t stages);
void sd_radau_free(sd_radau *radau);
/* lets go of all that the steps from the next start on make anew: until then it has no more than its last point */
void sd_radau_rest(sd_radau *radau);
void sd_radau_start(void *radau, double t, const double *y, const double *yd, double h);
int sd_radau_step(void *radau);
/* radau_dense.c: y, yd [n] at any t within the last step */
void sd_radau_dense(const void *radau, double t, double *y, double *yd);
/* settled derivatives at the points that sd_radau_dense uses, and which unknowns they lead */
void sd_radau_refine(void *radau, sd_settle *settle);
/* how far values within the step at hand may be off, in the weights of the error test, of what slopes do not lead */
double sd_radau_between(const sd_radau *radau);
/* 1: between the nodes of the step at hand, whose stages are z, a steep law is beyond all magnitudes: the step passes
 * over something that happens.  Works in y, rate, d[0] and terms. */
int sd_radau_astray(sd_radau *radau);
/* 1 / (node i - node j) of 0, c_1, ..., c_s; on the diagonal the product of the others in its row */
void sd_radau_gaps(double gap[SD_METHODS][SD_STAGES + 1][SD_STAGES + 1]);
/* what values within the step just accepted take of its points */
void sd_radau_note_points(sd_radau *radau);
/* z [stages] of a step of size h from the last step's polynomial */
void sd_radau_extrapolate(sd_radau *radau, double h);

/* the start of the last step */
static inline double sd_radau_last(const sd_radau *radau, int32_t i)
{
    return radau->last ? radau->last[i] : radau->phi[i] - radau->kept[radau->used->stages - 1][i];
}

/* weight of an unknown in the error test, of magnitudes that a step leaves as they are */
static inline double sd_radau_weight(const sd_radau *radau, int32_t i)
{
    if (radau->ivp.weight)
        return radau->ivp.weight[i];
    return 1.0 / (radau->tolerance * radau->ivp.magnitude[i] + radau->tolerance * fabs(radau->phi[i]));
}

/* the same in Newton's norm */
static inline double sd_radau_newton_weight(const sd_radau *radau, int32_t i)
{
    return radau->newton_weight ? radau->newton_weight[i] : sd_radau_weight(radau, i);
}

/* radau_rooms.c: room for what steps work in, where it rests; 0 or not: no memory */
int sd_radau_provide(sd_radau *radau);
/* right sides with what is extrapolated anew before the next step */
double *sd_radau_spare(void *radau, size_t *numbers);
/* radau.c: root mean square over the tested unknowns in the error weights; what the estimate of a method counts beside
 * that of three stages */
double sd_radau_norm(const sd_radau *radau, const double *x);
double sd_radau_strictness(const sd_radau *radau, const sd_radau_method *method);
/* radau_systems.c: out [n] := sum of weight[j] v[j] over the stages, of vectors with room for whole lanes; y, rate [n] := those
 * of a stage; then as they say there */
void sd_radau_combine(int stages, int32_t n, const double *weight, double *const *v, double *out);
void sd_radau_stage(sd_radau *radau, int s, double *y, double *rate);
int sd_radau_factorise(sd_radau *radau, int at_end);
/* the last factors are of the step at hand, but for what rounds a sum of steps */
int sd_radau_factored(const sd_radau *radau);
/* 1: so large that the room of matrices counts, which are then made where they are factorised */
int sd_radau_sparing(const sd_radau *radau);
/* radau_rooms.c: jy, jyd [entries] may be written, 0; -1: no memory.  Then, of a large system, columns that are alike from one to
 * the next, as those of a line, stand there once (`at`). */
int sd_radau_room_for_slopes(sd_radau *radau);
void sd_radau_share_slopes(sd_radau *radau);
int sd_radau_lean(sd_radau *radau, int where);
int sd_radau_residuals(sd_radau *radau);
double sd_radau_correct(sd_radau *radau);
/* how far the last correction moved the unknowns with derivatives, in Newton's weights */
double sd_radau_state_moved(const sd_radau *radau);
/* radau_newton.c: weights of its norm and scales of columns, their room; at the h of the moment */
void sd_radau_provide_weights(sd_radau *radau);
void sd_radau_weigh(sd_radau *radau);
void sd_radau_leave_below(sd_radau *radau, double null_pivot);
int sd_radau_iterations(const sd_radau *radau);
int sd_radau_iterate(sd_radau *radau, int full, int *used, double *retry);
int sd_radau_iterate_damped(sd_radau *radau, int *used);
double sd_radau_newton_tolerance(const sd_radau *radau);
double sd_radau_row_limit(const sd_radau *radau, double newton_tolerance);
/* radau_coupled.c: where the slopes of the step's start fade or turn within it, in one direction; else SD_NEWTON */
int sd_radau_iterate_coupled(sd_radau *radau, int *used);
void sd_radau_free_coupled(struct sd_coupled *coupled);
/* radau_choice.c: the length that the next step should have, by the error of this one and what Newton's iteration took; perhaps
 * with another number of stages */
double sd_radau_next_step(sd_radau *radau, double error, int iterations, int troubled);

#endif
