"""A pendulum by SciPy:

sysdyn compile models/seed/pendulum.sd --scene reference --index 0 --backend numpy -o pendulum
PYTHONPATH=pendulum python models/embedding/with_scipy.py
"""

import numpy as np
import residual
from scipy.integrate import solve_ivp
from scipy.sparse import csc_array

p = residual.parameters(l=1.2)  # m; what follows from it is computed anew
y, yd = residual.sd_start(p)
colptr, rowind = residual.pattern()
zero = np.zeros_like(y)


def slopes(t, y):
    """Index form 0 is r = yd - F(t, y): F is -r at yd = 0."""
    return -residual.sd_residual(t, y, zero, p)


def jacobian(t, y):
    """The matrix dF/dy on the pattern of binding.json."""
    values = -residual.sd_jacobian(t, y, zero, 0.0, p)
    return csc_array((values, rowind, colptr), shape=(y.size, y.size)).toarray()


run = solve_ivp(slopes, (0.0, 4.0), y, method="Radau", jac=jacobian, rtol=1e-9, atol=1e-11)
w = residual.sd_outputs(run.t[-1], run.y[:, -1], slopes(run.t[-1], run.y[:, -1]), p)
print(f"{w[0]:.9f} {w[1]:.9f}")  # q1 and q2 in m
