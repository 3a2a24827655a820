/* The explicit Runge-Kutta method DOP853 of order 8 on the underlying equation, projected onto every constraint.
 *
 * Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, Springer 1993, sections II.5
 * (coefficients by Prince & Dormand), II.6 (dense output of order 7 by three more stages), II.10 (error from embedded
 * formulas of orders 5 and 3), IV.2 of volume II (step control with a memory, detection of stiffness).
 * Error test: as in bdf/bdf.h, over the state; multipliers and implicit efforts follow from it.
 * Between the ends of a step z = (slopes; kappa, mu, e) is the derivative of the interpolant of its integral.
 */
#ifndef SYSDYN_DOPRI_H
#define SYSDYN_DOPRI_H

#include "steppers/stepper.h"
#include "steppers/explicit/underlying.h"

enum { SD_DOPRI_STAGES = 12 };
enum { SD_DOPRI_ALL = 16 }; /* with the slopes at the new point and the stages of the dense output */
enum { SD_DOPRI_DENSE = 7 };

extern const double sd_dopri_c[SD_DOPRI_ALL], sd_dopri_a[SD_DOPRI_ALL][SD_DOPRI_ALL];
extern const double sd_dopri_e3[SD_DOPRI_STAGES], sd_dopri_e5[SD_DOPRI_STAGES];
extern const double sd_dopri_d[SD_DOPRI_DENSE - 3][SD_DOPRI_ALL];
extern const int sd_dopri_next[SD_DOPRI_ALL]; /* of each row of a: the first behind the leading one that is not zero */
enum { SD_DOPRI_NEXT = 5 }; /* the same of e3, e5 and d */

typedef struct sd_dopri {
    sd_ivp ivp;               /* of form 0 */
    sd_underlying *underlying;
    double patience;          /* steps still to be taken above which a stiff run is given up */
    double spare;             /* the same of one whose system is faster than its motion; 0: never */
    double opening;           /* over rtol^(1/8): the first step as an earlier run found it fit, 0: chosen; then as this one does */
    /* state of the integration */
    double error_accepted, speed; /* speed: h |lambda| of the last step */
    int32_t rejected, dense;  /* dense: the interpolant of the last step is there */
    int32_t stiff, smooth, outrun, even; /* steps counted */
    double *phi, *yd;         /* [n] the last accepted point */
    double *y[SD_DOPRI_ALL], *rate[SD_DOPRI_ALL]; /* [n] stages of the last step: point, slopes; y[0]: its start */
    double *f[SD_DOPRI_DENSE]; /* [n] the interpolant */
    double *moved, *moved_d, *memory;
} sd_dopri;

sd_dopri *sd_dopri_new(sd_system *system, sd_underlying *underlying);
void sd_dopri_free(sd_dopri *dopri);
void sd_dopri_start(void *dopri, double t, const double *y, const double *yd, double h);
int sd_dopri_step(void *dopri);
/* sum [n] := of the first `terms` of a_j k_j, where a is a row of e3, e5 or d */
void sd_dopri_add_up(int32_t n, int terms, const double *a, double *const *k, double *sum);
/* point of stage s of a step h: y0 + h sum a_sj k_j */
void sd_dopri_combine(sd_dopri *dopri, int s, double h);
/* dopri_dense.c: y, yd [n] at any t within the last step */
void sd_dopri_dense(const void *dopri, double t, double *y, double *yd);
/* those values projected onto every constraint, with the slopes there; as `onto` of stepper.h */
int sd_dopri_onto(void *dopri, double t, double *y, double *yd, double *moved);

#endif
