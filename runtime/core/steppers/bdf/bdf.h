/* Variable-step, variable-order BDF for F(t, y, yd) = 0 with fixed leading coefficient.
 *
 * Source: K. E. Brenan, S. L. Campbell, L. R. Petzold, Numerical Solution of Initial-Value Problems in
 * Differential-Algebraic Equations, SIAM 1996, chapter 5.  Names of that chapter, declared once:
 *   phi[i]    modified divided differences of the solution (phi[0] = y), [unknowns] each
 *   psi[i]    t_n - t_(n-i-1);  alpha, beta, sigma, gamma: coefficients of the prediction and the error
 *   cj        yd = (predicted yd) + cj (y - predicted y);   G = dF/dy + cj dF/dyd
 *   ee        correction y - predicted y
 *   ns        steps taken with the present step size and order: from phi[ns] on the differences of the past, times beta, are
 *             those of the step under way
 * Error test: weights w_i = atol_i + rtol |y_i|, atol_i = rtol * magnitude_i; unknowns with test_i < 0 (multipliers,
 * implicit efforts, flows of massless coordinates) are left out, those with test_i = k count with h^k.
 * Of a group in `common` the part that its unknowns have in common (their mean in these weights) is left out too.
 * Newton's convergence test takes all of them, with h^power_i (1: index-2 unknowns, 2: index-3 multipliers).
 */
#ifndef SYSDYN_BDF_H
#define SYSDYN_BDF_H

#include "system/assembly.h"
#include "linear/linear.h"
#include "steppers/stepper.h"

enum { SD_MAX_ORDER = 5 };

typedef struct sd_bdf {
    sd_ivp ivp;
    sd_linear *linear;
    int32_t max_order;
    const int32_t *common_from, *common; /* [commons + 1] where each group begins in `common`: its unknowns */
    int32_t commons;          /* groups of unknowns that are states but for what they have in common */
    /* state of the integration */
    double cj, cj_factored, cj_last, cj_slopes, contraction;
    int32_t order, order_used, ns, rising, fresh_jacobian, jacobian_age, ready, extra;
    double psi[SD_MAX_ORDER + 2], alpha[SD_MAX_ORDER + 2], beta[SD_MAX_ORDER + 2], sigma[SD_MAX_ORDER + 2],
        gamma[SD_MAX_ORDER + 2];
    double *phi[SD_MAX_ORDER + 2];
    double *y, *yd, *delta, *moved, *moved_d;
    double *terms, *rate, *jy, *jyd, *g, *memory;
    double *own, *newton_power, *test_power, h_weighed; /* [n] weights and powers of h of unknowns in `apart`, and of which h */
    int32_t *powered, powers; /* [powers] unknowns that do not count alike at every h */
    int32_t *apart, aparts;   /* [aparts] lanes of unknowns that do not count alike in both tests */
    double error_next;        /* estimate of the local error at the order chosen next */
    /* what happened */
    int64_t orders;           /* sum of the orders of all steps */
} sd_bdf;

/* A stepper without its problem set; the caller fills the public fields, then calls sd_bdf_start. */
sd_bdf *sd_bdf_new(sd_system *system, sd_linear *linear);
void sd_bdf_free(sd_bdf *bdf);
void sd_bdf_start(void *bdf, double t, const double *y, const double *yd, double h);
/* one accepted step, or the cause of failure */
int sd_bdf_step(void *bdf);
/* y, yd [n] at any t within the last step; yd NULL: y alone */
void sd_bdf_dense(const void *bdf, double t, double *y, double *yd);

/* coefficients.c */
void sd_bdf_coefficients(sd_bdf *bdf, double *ck);
void sd_bdf_restore(sd_bdf *bdf);
/* bdf_passes.c */
void sd_bdf_weights(sd_bdf *bdf);
void sd_bdf_begin_powers(sd_bdf *bdf);
enum sd_test { SD_NEWTON_TEST, SD_LOCAL_ERROR_TEST };
void sd_bdf_weigh(sd_bdf *bdf, enum sd_test test);
void sd_bdf_predict(sd_bdf *bdf);
void sd_bdf_matrix(sd_bdf *bdf);
double sd_bdf_move(sd_bdf *bdf, int first);
void sd_bdf_orders(const sd_bdf *bdf, double *norm);
double sd_bdf_norm(const sd_bdf *bdf, const double *x, const double *minus);
void sd_bdf_interpolate(const sd_bdf *bdf, int32_t order, const double *value, const double *rate, double *y,
                        double *yd);
void sd_bdf_shift(sd_bdf *bdf);
void sd_bdf_balance(const sd_bdf *bdf, double *d);
/* controller.c */
int sd_bdf_test(sd_bdf *bdf, double ck, double *norm, double *error, int32_t *order_next);
void sd_bdf_accept(sd_bdf *bdf, const double *norm, int32_t order_next);
double sd_bdf_first_step(const sd_bdf *bdf);

#endif
