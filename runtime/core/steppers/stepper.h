/* What all methods have in common: the problem (sd_ivp), and what the driver of an integration asks of a method (sd_stepper):
 * steps, values within the last step, a start.
 *
 * Every method (bdf/bdf.h, radau/radau.h, rosenbrock/rosenbrock.h, explicit/dopri.h, energy/energy.h) begins with an sd_ivp;
 * run.c knows methods by its stepper alone.
 */
#ifndef SYSDYN_STEPPER_H
#define SYSDYN_STEPPER_H

#include "linear/linear.h"
#include "system/assembly.h"
#include "system/settle.h"
#include "linear/tuning.h"

#include <float.h>

enum { SD_NODES = 7 };

enum sd_cause {
    SD_FINE = 0,
    SD_NEWTON = 1,     /* Newton's iteration does not converge */
    SD_ERROR_TEST = 2, /* the local error stays too large */
    SD_SINGULAR = 3,   /* the matrix is singular: row, column */
    SD_NONFINITE = 4,  /* the residual is not finite: row */
    SD_STEP = 5,       /* the step size fell below what t resolves */
    SD_STOPPED = 6,    /* a callback of the caller failed */
    SD_MEMORY = 7,
    SD_STIFF = 8,      /* an explicit method is held to tiny steps by stability */
    SD_OUTGROWN = 9    /* a solution beside this one grows by more within the step than the method follows */
};

typedef struct sd_stepper {
    void *self;
    const struct sd_ivp *ivp;
    int32_t n;                 /* unknowns of the points that it shows */
    const double *y, *yd;      /* [n] the last accepted point, or the one started from */
    /* one accepted step, or the cause of failure (enum sd_cause) */
    int (*step)(void *self);
    /* y, yd [n] at any t within the last step */
    void (*dense)(const void *self, double t, double *y, double *yd);
    /* before values within the last step are asked for: derivatives as exact as the values (NULL: nothing to do) */
    void (*refine)(void *self, sd_settle *settle);
    /* from (t, y, yd) with step h (0: chosen) */
    void (*start)(void *self, double t, const double *y, const double *yd, double h);
    /* a quadrature of the method's own order over the last step (nodes 0: values of `dense` serve): instants and
     * weights as parts of the step, y, yd [n] there; before the first start: as many as there may be */
    int32_t nodes;
    const double *node, *node_weight;
    double *const *node_y, *const *node_yd;
    double *const *part_y, *const *part_yd; /* y, yd [n] at the nodes of the part of the step up to where `dense` was asked
                                             * last, which is a step of its own; NULL: it is not */
    const double *length;      /* of the last step, which t does not resolve after many; NULL: the difference of its ends */
    const double *moves, *part_moves; /* [rows of block audit] what moves of displacements that took no time add to the
                                       * integrals over the last step, and over the part of it; NULL: nothing */
    int32_t collocated;        /* 1: at most SD_NODES nodes; a polynomial through them and the start serves within the step */
    /* y, yd [n] := those at node k, where they do not stand in node_y, node_yd (NULL: they do) */
    void (*show)(const void *self, int32_t k, double *y, double *yd);
    /* y alone [n] at any t within the last step, as far as powers and energies read it; NULL: dense gives it */
    void (*values)(const void *self, double t, double *y);
    /* y, yd [n] of `dense` at t moved onto the equations by what the method has at hand: 0, and how far in `moved`
     * (magnitudes); else they are as they were (NULL: it has nothing) */
    int (*onto)(void *self, double t, double *y, double *yd, double *moved);
    /* room [numbers] that the method does not read between its steps (NULL: it has none now) */
    double *(*spare)(void *self, size_t *numbers);
} sd_stepper;

/* An initial value problem under way: the first member of every method. */
typedef struct sd_ivp {
    /* the problem; the caller fills it in before a start */
    sd_system *system;
    int32_t n;                /* unknowns that are stepped */
    double rtol, t_end, h_max;
    double fixed_h;           /* length of every step; 0: chosen */
    const double *atol;       /* [n] explicit absolute tolerances, or NULL: rtol * magnitude */
    double *magnitude;        /* [n] of the unknowns; grows with max |y| */
    double *met;              /* [n] max |y| */
    const int8_t *test, *power; /* [n] as bdf/bdf.h says */
    sd_settle *project;       /* moves each accepted point onto every constraint (index 1 and 0), or NULL */
    /* how far it is */
    int32_t tested;           /* unknowns in the error test */
    double t, h, h_used;      /* the last accepted point; steps that come and that led there */
    double *ee, *weight;      /* [n] the last local error, and what the error test weighs it by */
    int64_t steps, rejected_steps, newton_failures;
    int64_t taken;            /* steps since the last start */
    int orientation;          /* sign of det(dF/dy + dF/dyd / h) as h vanishes; 0: nobody asked yet */
    int outgrown, resting;    /* the step under way was refused as SD_OUTGROWN; accepted steps in a row that had been */
    int32_t cause, bad_row, bad_column; /* of the failure of a step */
    sd_stepper stepper;
} sd_ivp;

#define SD_ROUND_OFF (10.0 * DBL_EPSILON) /* part of the largest that unknowns have been */
/* what step controls have in common (Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, II.4) */
#define SD_SAFETY 0.9
#define SD_SHRINK 0.2  /* of a step: what a refused one is cut to at least */
#define SD_FAILURES 12 /* of slopes or factors in one step: it is 4000 times shorter then */
#define SD_FIRST 1e-2  /* of the span: the first step at most */
#define SD_OPENING 3   /* steps that tell how long the first might have been */

#define SD_NOISY 10.0  /* times a correction that does not shrink any more: what such ones leave open */
#define SD_NOISE SD_SAME   /* part of an unknown up to which a correction may be that */
#define SD_SLACK SD_CANCELS /* of a step: what sums of steps may leave of the span */
#define SD_RESTS 400   /* steps, each of a quarter of an e-fold at least: what round-off moves off a rest has left it by then */
#define SD_SHORT SD_INSTANT /* of the span: what happens this early is resolved to round-off */

/* What round-off leaves open of an unknown, by the last of corrections that do not shrink any more: rows far from it with
 * large terms leave more of a small unknown open than its own digits. */
static inline double sd_open(double correction, double y, double met)
{
    double size = fmax(fabs(y), met);
    return fmax(SD_ROUND_OFF * met, fmin(SD_NOISY * fabs(correction), SD_NOISE * size));
}

/* The largest |y| met so far, and the magnitude that grows with it. */
static inline void sd_met(double size, double *met, double *magnitude)
{
    if (size > *met)
        *met = size;
    if (size > *magnitude)
        *magnitude = size;
}

/* stepper.c: what drives a method calls; from (t, y, yd) with a step of the method's choice */
void sd_stepper_start(sd_stepper *stepper, double t, const double *y, const double *yd);

/* what methods have in common (stepper.c): at t, where a start begins; which unknowns are tested */
void sd_begin(sd_ivp *ivp, double t);
/* magnitudes grow with y [n], and weight [n] := 1 / (atol + tolerance |y|); atol belongs to rtol */
void sd_weigh(sd_ivp *ivp, double tolerance, const double *y);
/* sum of squares of a - b [n] over the tested unknowns in the weights; b may be NULL */
double sd_squares(const sd_ivp *ivp, const double *a, const double *b);
/* a first step: at most `longest` and `part` of what changes by a tolerance in 1 / change, and what t resolves at least */
double sd_first_step(const sd_ivp *ivp, double longest, double part, double change);
/* h, fitted to t_end: the step ends there exactly, and never leaves less than its half for the last one.  slack: part of a
 * step that is round-off */
double sd_fitted(const sd_ivp *ivp, double slack);
/* the longest step; where few are left the length of as few that are all alike, whose factors serve to the end */
double sd_longest(const sd_ivp *ivp);
/* t + h is t, or nearly (the last bit of the span is a step nonetheless) */
int sd_too_small(const sd_ivp *ivp);
/* SD_OUTGROWN where a step of this length would lead onto a solution that others beside it leave: within it a real mode grows
 * so much that the method, whose stability function has a pole there, takes it for a decaying one.  An odd number of such modes
 * turns the sign of the determinant of the step's matrix G = jy + lead jyd, which `linear` has just factorised; g [entries]:
 * where it stands, scale [n]: of its columns.  What rests on such a solution for SD_RESTS steps is left there. */
int sd_outgrown(sd_ivp *ivp, sd_linear *linear, const double *jy, const double *jyd, double lead, double *g, const double *scale);
/* behind a cause no shorter step is tried */
int sd_ends(const sd_ivp *ivp, int cause);
/* the step of length h is accepted */
void sd_advance(sd_ivp *ivp);

#endif
