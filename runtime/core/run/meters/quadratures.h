/* Energies and powers at a point of a run, and the integrals of the powers over its last step: what the ledgers balance.
 *
 * By the quadrature of the method where it has one, at its own nodes; else by what the steps before tell, or by Lobatto's rule
 * of five points.  Sums up to rows within a step are those of one polynomial where many rows stand there.
 */
#ifndef SYSDYN_QUADRATURES_H
#define SYSDYN_QUADRATURES_H

#include "run/run.h"

/* out [audited]: kinetic and potential energy, powers dissipated and supplied, the rows of the ledgers */
void sd_run_audit(const sd_run *run, double t, const double *y, const double *yd, double *out);

/* run->integral [audited]: of the powers from the start of the last step to `to`, within that step; 1: point, point_d hold
 * the point there; sampled: sample and point do, which is the end of the step */
int sd_run_integrate(sd_run *run, double to);

/* sum: of the powers dissipated and supplied alone, by those at the nodes where they are known; else the same */
int sd_run_sum(sd_run *run, double to, double sum[2]);

/* The same where an event ends the step at `to`: Gauss's rule of degree 5, after many nodes 9, on settled points.  Within
 * a step the stages of what follows from constraints alone (the current of a source) are of lower order than their sum
 * over it. */
void sd_run_integrate_cut(sd_run *run, double to);

#endif
