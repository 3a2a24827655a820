/* Gauss collocation of order 12 on the underlying equation, moved onto every constraint and onto the energy balance.
 *
 * Source: E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd ed., Springer 2006: II.1.3 (Gauss methods),
 * IV.4 (projection), VIII.6 (fixed-point iteration, starting values), VIII.5 (compensated sums).
 * One step of constant h from x = (q, f, p, s):
 *      X_i = x + h sum_j a_ij g(X_j),      x1 = x + h sum_i b_i g(X_i),
 *      H(x1 + d) = H(x0) - int (dissipated - supplied),      constraints(x1 + d) = 0,
 * the integral by the same nodes, d along (-H_q, H_f) in the metric of the inertia: the balance of energy is closed to
 * round-off at every step however long the run, because it refers to the start and not to the step before.  Gauss's methods
 * are symmetric and symplectic, so that the other invariants of an oscillation do not drift with h constant either.
 * So that it is symmetric too (V.4.1), a step that misses more than round-off is made again from a point that misses the
 * contrary of one half.
 * The stages are found by fixed-point iteration, displacements from the newest flows: it contracts where the step resolves
 * the shortest period, and nothing else is integrated here.
 * Step: rtol is the error over one shortest period.  A step is compared with two halves of it where the solution is rougher
 * than wherever that was done before, and h shrinks then.  After some steps twice h is tried, each time in vain after twice as
 * many: changes become ever rarer.  Between the ends of a step a shorter one is made.
 */
#ifndef SYSDYN_ENERGY_H
#define SYSDYN_ENERGY_H

#include "steppers/stepper.h"
#include "steppers/explicit/underlying.h"

enum { SD_ENERGY_STAGES = 6 };

extern const double sd_energy_c[SD_ENERGY_STAGES], sd_energy_b[SD_ENERGY_STAGES];
extern const double sd_energy_a[SD_ENERGY_STAGES][SD_ENERGY_STAGES];

typedef struct sd_collocation {
    double *y[SD_ENERGY_STAGES], *rate[SD_ENERGY_STAGES]; /* [n] points and slopes of the stages */
} sd_collocation;

typedef struct sd_energy {
    sd_ivp ivp;               /* of form 0 */
    sd_underlying *underlying;
    double patience;          /* steps still to be taken above which a run is given up */
    const sd_call *audit;     /* block audit; NULL: there is no energy */
    int32_t audited;          /* its rows */
    /* state of the integration */
    double wanted;            /* the step that the accuracy asks for; h: the same, fitted to the end */
    double anchor, anchor_end; /* the steps to anchor_end are equal from here */
    int64_t count, done;      /* of these steps; taken of them */
    double rough;             /* roughness up to which the step is known to do */
    double before, rough_before; /* both before it was last tried longer */
    int64_t window, since;    /* steps until it is tried longer again; taken since it last changed */
    int64_t held;             /* steps in a row that the iteration kept short, and too many of them */
    int32_t limited;          /* the iteration did not converge when h last shrank */
    int32_t grown;            /* 1: it has grown, and did not shrink since; 2: this step decides whether it grows */
    double frequency;         /* the largest found at the last step (1/s) */
    double energy, lost;      /* what the store should hold; rest of its compensated sum */
    double content;           /* largest |T| + |V| met */
    int32_t finding, guessed; /* the first step is looked for; slopes of the last step serve as a guess */
    double dense_t;           /* instant of `inner`, within the last step */
    int32_t inner_ready;
    double *phi, *yd, *rest;  /* [n] the last accepted point; rests of its compensated sums */
    double *from, *from_d, *from_rest; /* [n] where the last step began */
    double from_t, from_energy;
    sd_collocation stage, side; /* of the last step; of halves and of values within a step */
    double *raw, *half, *half_rest, *inner, *inner_d, *trial, *old_y, *old_rate;
    double *begin, *position, *velocity; /* [n] where a symmetric step begins, [rows] what it misses */
    double *base;             /* [n] from where a point is moved onto the balance */
    double *sample, *work;    /* [audited] one of the rows of block audit; what a move of displacements took */
    double *moves, *inner_moves; /* [audited] what such moves took in the last step; within it */
    double *memory;
} sd_energy;

/* extended: unknowns that block audit may look at */
sd_energy *sd_energy_new(sd_system *system, sd_underlying *underlying, int32_t extended, int32_t audited);
void sd_energy_free(sd_energy *energy);
void sd_energy_start(void *energy, double t, const double *y, const double *yd, double h);
int sd_energy_step(void *energy);
/* y, yd [n] at any t within the last step */
void sd_energy_dense(const void *energy, double t, double *y, double *yd);
/* energy_collocation.c: the stages of a step h from (t, y + rest), their slopes being guesses; x1 = y + rest + h sum b g in
 * `out`, what rounding took of it in `out_rest`; 0 or a cause */
int sd_energy_collocate(sd_energy *energy, sd_collocation *stage, double t, const double *y, const double *rest, double h,
                        double *out, double *out_rest);
/* slopes guessed at t + (first + part c_i) of the step of `known` */
void sd_energy_guess(const sd_energy *energy, const sd_collocation *known, double first, double part,
                     sd_collocation *guess);
/* energy_balance.c: x in y [n] moved onto the constraints and onto T + V = target at t, less what the move of displacements
 * dissipates and more what it is supplied with, which `gained` [audited] gains; rate [n]: slopes near it */
int sd_energy_balance(sd_energy *energy, double t, double *y, const double *rate, double target, double *gained);
/* The last point moved by the contrary of half of what the raw step to t misses of the constraints and of T + V = target, in
 * `begin`; again 0: it misses nothing */
int sd_energy_symmetric(sd_energy *energy, double t, double target, int *again);
/* T + V at (t, y); its parts' magnitudes grow `content` */
double sd_energy_content(sd_energy *energy, double t, const double *y, const double *rate);
/* h sum b (dissipated - supplied) over the stages */
double sd_energy_drained(sd_energy *energy, const sd_collocation *stage, double t, double h);

#endif
