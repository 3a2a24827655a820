/* What the driver of an integration asks of a method: steps, values within the last step, a start.
 *
 * Every method (bdf/bdf.h, radau/radau.h, explicit/dopri.h, energy/energy.h) holds one of these about itself;
 * run.c knows methods by nothing else.
 */
#ifndef SYSDYN_STEPPER_H
#define SYSDYN_STEPPER_H

#include "system/assembly.h"
#include "system/settle.h"

#include <float.h>

#define SD_NODES 7

enum sd_cause {
    SD_FINE = 0,
    SD_NEWTON = 1,     /* Newton's iteration does not converge */
    SD_ERROR_TEST = 2, /* the local error stays too large */
    SD_SINGULAR = 3,   /* the matrix is singular: row, column */
    SD_NONFINITE = 4,  /* the residual is not finite: row */
    SD_STEP = 5,       /* the step size fell below what t resolves */
    SD_STOPPED = 6,    /* a callback of the caller failed */
    SD_MEMORY = 7,
    SD_STIFF = 8       /* an explicit method is held to tiny steps by stability */
};

typedef struct sd_stepper {
    void *self;
    sd_system *system;
    int32_t n;
    const double *t, *t_end;
    const double *y, *yd;      /* [n] the last accepted point, or the one started from */
    const int64_t *taken;      /* steps since the last start */
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

#define SD_ROUND_OFF (10.0 * DBL_EPSILON) /* part of the largest that unknowns have been */
#define SD_NOISY 10.0  /* times a correction that does not shrink any more: what such ones leave open */
#define SD_NOISE 1e-9  /* part of an unknown up to which a correction may be that */
#define SD_SHORT 1e-9 /* of the span: what happens this early is resolved to round-off */

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

#endif
