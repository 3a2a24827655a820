/* The contract between a compiled model and the runtime, version 3.
 *
 * A compiled model (C library or Python module) is a set of BLOCKS.  A block is a group of rows of the
 * descriptor form; the runtime chooses which blocks stand where and so assembles every index form from
 * them.  Array sizes and parameters are run-time values: no generated text depends on them.
 *
 * Shapes
 *   p   [parameters]        values in SI units: scalar parameters first, then arrays and tables' numbers
 *   ix  [integers]          loop bounds, first indices, strides, offsets of arrays in p; tables of indices
 *   y   [unknowns]          the unknowns; family k begins at at[k]
 *   yd  [unknowns]          their time derivatives, same places
 *   r   [rows]              row family k begins at to[k]; a block ADDS to r
 *   v   [entries]           a block WRITES its Jacobian entries in the order its pattern lists them
 *
 * Blocks (missing ones have no rows; with T*, V, D, Q of the book and M = d2(T*)/df2)
 *   dynamics          Lagrange: M f' - Y;  Hamilton: p' - U (coordinates with momentum), -U (without)
 *   dynamics_rate     the total time derivative of balances without inertia (reads yd of e, kappa, mu)
 *   phi_reaction      Phi_q^T kappa, added to the rows of dynamics
 *   phi_normal        Phi_q^T kappa by coordinate, where the balances are not those of coordinates (Kane): for q' - f
 *   psi_reaction      Psi_f^T mu, added to the rows of dynamics
 *   momentum          p - dT/df (Hamilton), or dT/dp - f where the author gave T
 *   momentum_rate     its total time derivative
 *   phi, phi_rate, phi_acceleration    Phi;  Phi_q f + Phi_t;  Phi_q f' + Z1
 *   psi, psi_rate     Psi;  Psi_f f' + Z2
 *   gamma, gamma_rate Gamma and its total time derivative (reads yd of f, s, e); gamma_acceleration: the second one, where it
 *                     reads displacements alone
 *   lambda            s' - Lambda
 *   observe           one row family a traced quantity (and each side of an expect); reads y, yd and the audit
 *   observe_rate      their time derivatives, where known
 *   observe_scale     sum of the magnitudes of the terms of each
 *   B_scale           for a block B of the above that Newton sees: the sum of the magnitudes of its terms, for the row
 *                     families that hold a steep law alone (missing where none does)
 *   audit             kinetic energy T, potential energy V, power dissipated, power supplied; four rows a ledger (ledgers.h)
 *   ledger            what each element stores; the kind of a row: the number of its ledger, then `inertia` where the sign
 *                     of that is the sign of an inertia
 *   initial           one row family an `init` that is no unknown of this formulation: expression - value
 * Rates read f as yd of q, f' as yd of f: they never read yd of q.
 * q' = f has no block: the runtime writes those rows itself.
 */
#ifndef SYSDYN_MODEL_H
#define SYSDYN_MODEL_H

#include <stdint.h>

enum { SD_CONTRACT = 3 };

typedef struct sd_frame {
    const double *p;
    const int32_t *ix;
    const int32_t *at;
    const int32_t *to;
    const int32_t *spared; /* [kernels of the block] 1: nobody reads the rows of this kernel, which may leave them out where
                            * loops go round (never entries); NULL: all are read */
} sd_frame;

/* rows: r += block(t, y, yd);  entries: v = d block/dy or d block/dyd in the order of the pattern */
typedef void sd_rows(const sd_frame *frame, double t, const double *y, const double *yd, double *r);
typedef void sd_entries(const sd_frame *frame, double t, const double *y, const double *yd, double *v);

/* A C library exports `const int sd_contract = 3` and, for each block B of its manifest, functions
 *   sd_B_rows, sd_B_dy, sd_B_dyd
 * (dy, dyd only where the manifest lists entries for them).  A Python module defines CONTRACT = 3 and
 *   B_rows(p, ix, at, to, t, y, yd, r), B_dy(p, ix, at, to, t, y, yd, v), B_dyd(...)   on NumPy arrays.
 *
 * The manifest's "structure":
 *   families  [{"name", "kind", "owner", "unit", "nominal"}]          in the order of `at`
 *             kind: q f p s e kappa mu | audit.  owner: coordinate (q f p), constraint label (kappa, mu),
 *             the name itself otherwise.  `audit` families are scalars energy, kinetic, potential, dissipated,
 *             supplied, constraints: the runtime hands them to `observe` behind y.
 *   rows      [{"block", "label", "owner", "kind", "file", "line", "unit"}]   in the order of `to`;
 *             dynamics, dynamics_rate, phi_reaction, psi_reaction share the row families of block "dynamics" (owner:
 *             coordinate); phi, phi_rate, phi_acceleration those of "phi"; psi, psi_rate those of "psi"; gamma,
 *             gamma_rate those of "gamma"; momentum, momentum_rate those of "momentum"; observe,
 *             observe_rate, observe_scale those of "observe".
 *             rows of observe also hold {"name", "stored": bool, "rate": bool}.
 *   blocks    {name: {"kernels": [{"loops": [[lo, hi], ...], "rows": [REF, ...], "dy": [[REF row, REF column], ...],
 *             "dyd": [...], "reads": [family, ...], "rates": [...], "curved": [row family, ...], "bent": [...]}, ...]}}
 *             lo, hi: slots of ix (both ends included), or an INDEX where a bound follows an outer loop of the same
 *             nest (triangular sums).  v runs kernel by kernel, iteration by iteration (last loop
 *             fastest), entry by entry.  One place may occur several times: entries add up.  reads, rates: unknowns
 *             and derivatives that enter rows; curved: rows that are more than constants plus constants (parameters) times unknowns;
 *             bent: rows whose slopes change while a run goes on smoothly.  Any of the four may be missing: not known.
 *   REF       [family, [INDEX, ...]], INDEX = [loop or -1, offset slot of ix or -1, constant]:
 *             value = (loop variable or 0) + (ix[slot] or 0) + constant; INDEX = [loop, slot, constant, table]:
 *             ix[ix[table] + that value], from a table of indices that stands in ix behind all slots.
 *             Position in the family: row-major over its shape.
 *
 * The binding (made by the compiler for one set of parameter values; plain arrays):
 *   p, ix; shapes: for each family and row_shapes: for each row family a list of [first, last] (scalars: []);
 *   initial: [{"family", "positions": int array, "values": float array, "fixed": bool, "label", "file", "line"}]
 */
#endif
