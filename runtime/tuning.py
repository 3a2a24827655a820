"""Thresholds that the rooms of `runtime` share: each a value, what it is of, and why it is that.

What double arithmetic leaves of a number depends on how the number was made, not on who asks.  There is one level for
each way; a module that needs one gives it the name of what it decides there.  EPS is 2.2e-16.  Those that the core
shares stand in core/linear/tuning.h.
"""

from sysdyn.runtime import _core

BY_SUMS: float = _core.SD_BY_SUMS
"""Of its terms: what a sum of a hundred is off by, EPS / 2 each (Higham, Accuracy and Stability of Numerical
Algorithms, 4.2)."""

BY_FACTORS: float = _core.SD_BY_FACTORS
"""Of the largest: what a solution by factors of equilibrated rows is off by. EPS times a growth and a condition of
some hundreds together (Higham, Accuracy and Stability, 9.3): what is less is round-off."""

CANCELS: float = _core.SD_CANCELS
"""Of their magnitudes: what a sum of terms that cancel is off by where each was itself the outcome of some
operations, and of the span what instants by two formulas differ by."""

DEPENDENT: float = _core.SD_DEPENDENT
"""Of the largest: a singular value or pivot of a row that follows from others, whose coefficients each have the
round-off of CANCELS and as much from the elimination."""

MET: float = _core.SD_MET
"""Of its terms: what a row is missed by that Newton's method has met: its last correction is the square of one that
was 1e-5 at most."""

SAME: float = _core.SD_SAME
"""Of its size: what two ways to one number differ by: DEPENDENT, through a condition of a hundred. Rank, shares of
null vectors, and values that are asked whether they are zero."""

INSTANT: float = _core.SD_INSTANT
"""Of the span: what two programs' instants of one happening differ by, who round them and add up their steps."""

HALF_OF_ITS_DIGITS: float = _core.SD_HALF_OF_ITS_DIGITS
"""Of its size: the root of EPS, as which a double root, a difference quotient, or an iteration on rows that are met
to EPS knows a number."""

OPEN: float = _core.SD_OPEN
"""Of a unit vector, or the largest: ten times the above, where each of two has lost half of its digits."""

UNSEEN: float = _core.SD_UNSEEN
"""Of its size: a hundredth of the accuracy asked where none is said (1e-4); no result shows it, and slopes do not
notice it."""

SLIGHT: float = _core.SD_SLIGHT
"""Of its size: what cannot be told from nothing where a cube root of round-off (1e-5) stands between: threefold
roots, sets that are told apart by their points."""

SMALL: float = _core.SD_SMALL
"""Of its size: beside that it says nothing, or does not move what it stands beside beyond its linear surroundings;
and how far beside a point is looked, for what vanishes at a point by chance does not beside it."""

PERCENT = 0.01
"""Of its size: what is no coincidence where two ways should agree to much more."""

PIVOT: float = _core.SD_PIVOT
"""Of the largest entry of its column: what may pivot (the usual threshold of sparse elimination: Duff, Erisman, Reid,
Direct Methods for Sparse Matrices, 5.2: growth of ten a step at most)."""

HOPS = 3
"""Pivots in a row along which a value is handed on: balance, momentum, flow."""

DENSE = 300
"""Unknowns up to which matrices are full where singular values are asked for:
a decomposition takes some tenths of a second then."""

NULL_SPACE = 2 * DENSE
"""Unknowns up to which null vectors are taken, of matrices that are looked at once."""

IN_THE_CORE = 32
"""Unknowns up to which the core does by itself what NumPy does for larger ones: calls cost more than arithmetic
(core/linear/dense/dense.h)."""

GENERIC: float = _core.SD_GENERIC
"""1 / (1 + 1/e), of dF/dyd beside dF/dy: no ratio of small numbers, at which a regular pencil is a regular matrix."""

NO_EIGENVALUE = 0.7391
"""Of the size of rates: the root of cos x = x, in no simple ratio to any of them."""
