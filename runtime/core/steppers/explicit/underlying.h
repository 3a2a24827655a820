/* The underlying ordinary differential equation of a descriptor form: slopes at a point, and its constraints.
 *
 * State x = (q, f, p, s); q' = f.  At a point the rows of form 0 (dynamics, momentum_rate, phi_acceleration, psi_rate,
 * gamma, lambda) are solved for z = (f', p', s'; kappa, mu, e).  For the Lagrangian family that is
 *      [ M      Phi_q^T  Psi_f^T ] [ f'    ]   [  Y  ]
 *      [ Phi_q                   ] [ kappa ] = [ -Z1 ]
 *      [ Psi_f                   ] [ mu    ]   [ -Z2 ]
 * whose elimination gives the book's A1..A4 (3.55)-(3.66); with p' and momentum_rate it gives A5..A8 (4.30)-(4.39), f
 * being carried beside p.  Without implicit efforts z is linear there: one solution from the right side at z = 0 (the
 * reactions need not be evaluated); else Newton's iteration.
 *
 * The same factors project a state: [M A^T; A 0] [dx; l] = [0; -constraint] is the least change in the metric of the
 * inertia (Lubich 1991; Hairer & Wanner II, section VII.2), of q onto phi, of f and p onto phi_rate, psi and momentum.
 */
#ifndef SYSDYN_UNDERLYING_H
#define SYSDYN_UNDERLYING_H

#include "system/assembly.h"
#include "linear/linear.h"

typedef struct sd_written sd_written;

typedef struct sd_underlying {
    sd_system *system;           /* form 0 */
    sd_system *matrix;           /* the same rows, with the entries that the matrix holds alone */
    sd_system *applied;          /* the same rows without the reactions of multipliers */
    sd_system *position, *velocity; /* phi; phi_rate, psi, momentum: in the rows of their derivatives.  NULL: none */
    sd_linear *linear;           /* of the matrix [solved] */
    int32_t n, first, solved, direct; /* first: the rows before it are q' = f; direct: z is linear */
    const int32_t *unknown;      /* [solved] unknown of each column */
    const int32_t *rate;         /* [solved] 1: its derivative is solved for, 2: and constraints move it; 0: itself */
    const int32_t *column;       /* [n] column of an unknown, -1 for q */
    const int32_t *source;       /* [entries of linear] place in dF/dy, dF/dyd */
    const int32_t *from_rate;    /* [entries of linear] 1: in dF/dyd */
    const double *magnitude;     /* [n] */
    const int32_t *displaced;    /* [rows] 1: a row of phi in `position` */
    const double *goal_position, *goal_velocity; /* [rows] what the constraints are moved onto; NULL: zero */
    double tolerance;            /* of Newton's iteration, in magnitudes */
    double *values, *r, *step, *rest, *memory;
    int32_t *place_y, *place_yd; /* [entries of system] place of dF/dy, dF/dyd in the matrix, one behind it where they have none */
    sd_written *list;            /* [lists] the blocks of the matrix */
    double *written;             /* behind the rows r: what they write, one behind the other, and a zero */
    int32_t *from, *more;        /* [entries of linear] which of these each is; [mores][2]: entry, another that is added to it */
    int32_t lists, mores, flows; /* flows: some are solved for themselves */
    int32_t ready, placed, bad_row, bad_column; /* placed: the tables above are there */
    double *factored;            /* [entries of linear] whose factors the linear system had, */
    int64_t factored_at;         /* when it had made so many; -1: it has others */
    double drift;                /* how far the last projection moved first, in magnitudes */
} sd_underlying;

sd_underlying *sd_underlying_new(sd_system *system, sd_linear *linear);
void sd_underlying_free(sd_underlying *underlying);
/* other rows are held: factors of those of before go */
void sd_underlying_switched(sd_underlying *underlying);
/* before a start: Newton's tolerance; what is solved for itself has no slope in yd [n] */
void sd_underlying_begin(sd_underlying *underlying, double tolerance, double *yd);
/* z at (t, x): y [n] holds x and a guess of (kappa, mu, e), yd [n] one of the slopes; both are completed.  0 or a
 * cause (enum sd_cause) */
int sd_underlying_slopes(sd_underlying *underlying, double t, double *y, double *yd);
/* residuals of the constraints at (t, y), in the rows of their derivatives: position, velocity [rows], 0 where none is */
void sd_underlying_constraints(sd_underlying *underlying, double t, const double *y, double *position, double *velocity);
/* x in y [n] moved onto the constraints at t, by the factors of the last slopes or fresh ones; 0 or a cause */
int sd_underlying_project(sd_underlying *underlying, double t, double *y, const double *yd);

#endif
