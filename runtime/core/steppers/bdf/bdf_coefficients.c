/* Coefficients of the fixed-leading-coefficient BDF, and how far the past's differences stretch (see bdf.h). */
#include "steppers/bdf/bdf.h"

#include <math.h>

/* Prepares a step of size h and the present order: psi, alpha, beta, sigma, gamma, cj; what makes phi "modified".
 * ck: constant of the local error against |y - predicted y|. */
void sd_bdf_coefficients(sd_bdf *bdf, double *ck)
{
    int32_t k = bdf->order;
    double h = bdf->ivp.h;
    if (h != bdf->ivp.h_used || k != bdf->order_used)
        bdf->ns = 0;
    bdf->ns = bdf->ns + 1 < bdf->order_used + 2 ? bdf->ns + 1 : bdf->order_used + 2;
    if (k + 1 >= bdf->ns) {
        double reach = h; /* t_(n+1) - t_(n+1-i) */
        bdf->alpha[0] = bdf->beta[0] = bdf->sigma[0] = 1.0;
        bdf->gamma[0] = 0.0;
        for (int32_t i = 1; i <= k; i++) {
            double old = bdf->psi[i - 1];
            bdf->psi[i - 1] = reach;
            bdf->beta[i] = bdf->beta[i - 1] * reach / old;
            reach = old + h;
            bdf->alpha[i] = h / reach;
            bdf->sigma[i] = i * bdf->sigma[i - 1] * bdf->alpha[i];
            bdf->gamma[i] = bdf->gamma[i - 1] + bdf->alpha[i - 1] / h;
        }
        bdf->psi[k] = reach;
    }
    double fixed = 0.0, variable = 0.0; /* leading coefficients times -h */
    for (int32_t i = 0; i < k; i++) {
        fixed -= 1.0 / (i + 1);
        variable -= bdf->alpha[i];
    }
    bdf->cj = -fixed / h;
    double tail = fabs(bdf->alpha[k] + fixed - variable);
    *ck = tail > bdf->alpha[k] ? tail : bdf->alpha[k];
}

/* Undoes sd_bdf_coefficients after a step that was not accepted. */
void sd_bdf_restore(sd_bdf *bdf)
{
    for (int32_t i = 1; i <= bdf->order; i++)
        bdf->psi[i - 1] = bdf->psi[i] - bdf->ivp.h;
}
