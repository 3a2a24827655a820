/* A model compiled by sysdyn, to be called by anyone: version 1.
 *
 *     cc -c residual.c binding.c      (C11; then link with -lm)
 *
 * The equations are F(t, y, y') = 0 in the index form that was asked for; names, units and meaning of each unknown, row,
 * parameter and output are in manifest.json and binding.json, in the order of the arrays here.  All numbers but w are in SI units.
 *
 *   y, yd   [sd_n_unknowns]    unknowns and their time derivatives
 *   p       [sd_n_parameters]  parameters, arrays and tables; begin with a copy of sd_p0
 *   r       [sd_n_unknowns]    residual: as many rows as unknowns
 *   values  [sd_n_entries]     a matrix by columns: the entries of column k stand at sd_colptr[k] .. sd_colptr[k + 1] - 1, in the
 *                            rows sd_rowind[...], ascending
 *   w       [sd_n_outputs]      what the scene traces, in the units that it names (binding.json)
 *
 * Every function returns 0; 1 where a point is none (a root of a negative number, no convergence: take a smaller step); -1
 * where nothing helps (no memory; a parameter on which sizes depend was changed: compile again).
 * No function keeps anything between calls: threads may call them at once.
 */
#ifndef SYSDYN_EXPORTED_MODEL_H
#define SYSDYN_EXPORTED_MODEL_H

#include <stdint.h>

#define SD_EXPORT_VERSION 1

#ifdef __cplusplus
extern "C" {
#endif

extern const int32_t sd_version; /* SD_EXPORT_VERSION of binding.c */
extern const int32_t sd_n_unknowns, sd_n_entries, sd_n_parameters, sd_n_outputs;
extern const int32_t sd_colptr[], sd_rowind[]; /* [sd_n_unknowns + 1], [sd_n_entries] */
extern const int32_t sd_differential[];        /* [sd_n_unknowns] 1: its derivative is part of the state's motion; 0: algebraic */
extern const double sd_t0;                     /* s: the instant of the start */
extern const double sd_p0[], sd_y0[], sd_yd0[]; /* parameters as bound, and the consistent start for them */
extern const double sd_scale[];                /* [sd_n_unknowns] magnitudes at the start, for absolute tolerances */

/* r = F(t, y, yd).  Index form 0: r = yd - F(t, y) */
int sd_residual(double t, const double *y, const double *yd, const double *p, double *r);
/* values = dF/dy + cj dF/dyd */
int sd_jacobian(double t, const double *y, const double *yd, double cj, const double *p, double *values);
/* values = dF/dyd, on the same pattern */
int sd_mass(double t, const double *y, const double *yd, const double *p, double *values);
/* what follows from other parameters (param b = 2*a), and the constants of integrated constraints, written anew in p: call it
 * after a parameter was changed, before sd_start; not where a value that follows was itself replaced */
int sd_follow(double *p);
/* a consistent start (y, yd) at sd_t0 for p: initial values of the text hold, guesses move least */
int sd_start(const double *p, double *y, double *yd);
/* traced quantities at a point; not a number where they read a ledger of a whole run (audit.energy, dissipated, supplied,
 * constraints) */
int sd_outputs(double t, const double *y, const double *yd, const double *p, double *w);

#ifdef __cplusplus
}
#endif

#endif
