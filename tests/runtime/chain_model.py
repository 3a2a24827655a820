# ruff: noqa: PLR0917, E731, RUF100
"""A hanging chain of n links (point masses in a plane) as an array model: the NumPy backend and the same in C.

Masses m at (x_i, y_i), links of length a: phi_i = |r_i - r_(i-1)|^2 - a^2, r_0 = 0.  p = m, g, a; ix = 1, 2, n.
"""

import numpy as np

I, J = [0, -1, 0], [0, -1, -1]  # loop variable i, i - 1
QX, QY, FX, FY, KAPPA = range(5)
DX, DY, PHI = range(3)
FIRST, REST, ALL = [[0, 0]], [[1, 2]], [[0, 2]]
OBSERVED = [-1, 2, 0]  # the last mass


def _kernel(loops, rows, dy=(), dyd=()):
    reference = lambda family, index: [family, [index]]  # noqa: E731
    pair = lambda item: [reference(*item[0]), reference(*item[1])]  # noqa: E731
    return {
        "loops": loops,
        "rows": [reference(*row) for row in rows],
        "dy": [pair(item) for item in dy],
        "dyd": [pair(item) for item in dyd],
    }


def _both(row, columns, index=I):
    return [((row, index), (column, at)) for column in columns for at in (I, J)]


def structure():
    dynamics = [((DX, I), (FX, I)), ((DY, I), (FY, I))]
    reaction = [
        ((row, at), column)
        for row, q in ((DX, QX), (DY, QY))
        for at in (I, J)
        for column in ((q, I), (q, J), (KAPPA, I))
    ]
    first = [((DX, I), (QX, I)), ((DX, I), (KAPPA, I)), ((DY, I), (QY, I)), ((DY, I), (KAPPA, I))]
    one = lambda columns: [((PHI, I), (column, I)) for column in columns]  # noqa: E731
    blocks = {
        "dynamics": [_kernel(ALL, [(DX, I), (DY, I)], dyd=dynamics)],
        "phi_reaction": [
            _kernel(FIRST, [(DX, I), (DY, I)], first),
            _kernel(REST, [(DX, I), (DX, J), (DY, I), (DY, J)], reaction),
        ],
        "phi": [_kernel(FIRST, [(PHI, I)], one([QX, QY])), _kernel(REST, [(PHI, I)], _both(PHI, [QX, QY]))],
        "phi_rate": [
            _kernel(FIRST, [(PHI, I)], one([QX, QY, FX, FY])),
            _kernel(REST, [(PHI, I)], _both(PHI, [QX, QY, FX, FY])),
        ],
        "phi_acceleration": [
            _kernel(FIRST, [(PHI, I)], one([QX, QY, FX, FY]), one([FX, FY])),
            _kernel(REST, [(PHI, I)], _both(PHI, [QX, QY, FX, FY]), _both(PHI, [FX, FY])),
        ],
        "audit": [{"loops": [], "rows": [[3 + k, []] for k in range(4)], "dy": [], "dyd": []}],
        "observe": [{"loops": [], "rows": [[7, []], [8, []]], "dy": [], "dyd": []}],
        "observe_rate": [{"loops": [], "rows": [[7, []], [8, []]], "dy": [], "dyd": []}],
    }
    kinds = [
        ("q_x", "q", "x"),
        ("q_y", "q", "y"),
        ("f_x", "f", "x"),
        ("f_y", "f", "y"),
        ("kappa", "kappa", "link"),
    ]
    kinds += [
        ("audit." + n, "audit", n) for n in ["energy", "kinetic", "potential", "dissipated", "supplied", "constraints"]
    ]
    row = lambda block, label, **more: {  # noqa: E731
        "block": block,
        "label": label,
        "owner": label,
        "kind": block,
        "file": "chain.sd",
        "line": 1,
        "unit": "1",
        **more,
    }
    return {
        "families": [{"name": n, "kind": k, "owner": o, "unit": "1", "nominal": None} for n, k, o in kinds],
        "rows": [
            row("dynamics", "x"),
            row("dynamics", "y"),
            row("phi", "link"),
            *[row("audit", n) for n in ("kinetic", "potential", "dissipated", "supplied")],
            row("observe", "x_end", name="x_end", stored=True, rate=True),
            row("observe", "y_end", name="y_end", stored=True, rate=True),
        ],
        "blocks": {name: {"kernels": kernels} for name, kernels in blocks.items()},
    }


def binding(n, m=0.1, g=9.81, a=None, angle=0.3):
    a = 1.0 / n if a is None else a
    i = np.arange(1, n + 1)
    initial = lambda family, values, fixed=True: {  # noqa: E731
        "family": family,
        "positions": np.arange(n),
        "values": values,
        "fixed": fixed,
        "label": family,
        "file": "",
        "line": 0,
    }
    return {
        "p": np.array([m, g, a]),
        "ix": np.array([1, 2, n], dtype=np.int32),
        "shapes": [[[1, n]]] * 5 + [[]] * 6,
        "row_shapes": [[[1, n]]] * 3 + [[]] * 6,
        "initial": [
            initial("q_x", np.sin(angle) * a * i),
            initial("q_y", -np.cos(angle) * a * i, fixed=False),
            initial("f_x", np.zeros(n)),
        ],
    }


class Chain:
    """The NumPy backend."""

    CONTRACT = 3

    @staticmethod
    def _split(ix, at, y):
        n = ix[2]
        return [y[at[k] : at[k] + n] for k in range(5)]

    @staticmethod
    def _difference(x):
        return np.diff(x, prepend=0.0)

    @classmethod
    def dynamics_rows(cls, p, ix, at, to, t, y, yd, r):
        n = ix[2]
        _, _, ax, ay, _ = cls._split(ix, at, yd)
        r[to[DX] : to[DX] + n] += p[0] * ax
        r[to[DY] : to[DY] + n] += p[0] * ay + p[0] * p[1]

    @staticmethod
    def dynamics_dyd(p, ix, at, to, t, y, yd, v):
        v[:] = p[0]

    @classmethod
    def phi_reaction_rows(cls, p, ix, at, to, t, y, yd, r):
        n = ix[2]
        x, yy, _, _, k = cls._split(ix, at, y)
        for row, q in ((DX, x), (DY, yy)):
            force = 2 * cls._difference(q) * k
            r[to[row] : to[row] + n] += force
            r[to[row] : to[row] + n - 1] -= force[1:]

    @classmethod
    def phi_reaction_dy(cls, p, ix, at, to, t, y, yd, v):
        x, yy, _, _, k = cls._split(ix, at, y)
        dx, dy = cls._difference(x), cls._difference(yy)
        v[:4] = [2 * k[0], 2 * dx[0], 2 * k[0], 2 * dy[0]]
        rest = v[4:].reshape(-1, 12)
        for first, d in ((0, dx), (6, dy)):
            rest[:, first + 0] = rest[:, first + 4] = 2 * k[1:]
            rest[:, first + 1] = rest[:, first + 3] = -2 * k[1:]
            rest[:, first + 2] = 2 * d[1:]
            rest[:, first + 5] = -2 * d[1:]

    @classmethod
    def phi_rows(cls, p, ix, at, to, t, y, yd, r):
        x, yy, _, _, _ = cls._split(ix, at, y)
        r[to[PHI] : to[PHI] + ix[2]] += cls._difference(x) ** 2 + cls._difference(yy) ** 2 - p[2] ** 2

    @staticmethod
    def _fill(v, values):
        first = len(values)
        v[:first] = [2 * value[0] for value in values]
        rest = v[first:].reshape(-1, 2 * first)
        for k, value in enumerate(values):
            rest[:, 2 * k], rest[:, 2 * k + 1] = 2 * value[1:], -2 * value[1:]

    @classmethod
    def phi_dy(cls, p, ix, at, to, t, y, yd, v):
        x, yy, _, _, _ = cls._split(ix, at, y)
        cls._fill(v, [cls._difference(x), cls._difference(yy)])

    @classmethod
    def phi_rate_rows(cls, p, ix, at, to, t, y, yd, r):
        dx, dy, ux, uy = (cls._difference(item) for item in cls._split(ix, at, y)[:4])
        r[to[PHI] : to[PHI] + ix[2]] += 2 * (dx * ux + dy * uy)

    @classmethod
    def phi_rate_dy(cls, p, ix, at, to, t, y, yd, v):
        dx, dy, ux, uy = (cls._difference(item) for item in cls._split(ix, at, y)[:4])
        cls._fill(v, [ux, uy, dx, dy])

    @classmethod
    def phi_acceleration_rows(cls, p, ix, at, to, t, y, yd, r):
        dx, dy, ux, uy = (cls._difference(item) for item in cls._split(ix, at, y)[:4])
        ax, ay = (cls._difference(item) for item in cls._split(ix, at, yd)[2:4])
        r[to[PHI] : to[PHI] + ix[2]] += 2 * (ux**2 + uy**2 + dx * ax + dy * ay)

    @classmethod
    def phi_acceleration_dy(cls, p, ix, at, to, t, y, yd, v):
        ux, uy = (cls._difference(item) for item in cls._split(ix, at, y)[2:4])
        ax, ay = (cls._difference(item) for item in cls._split(ix, at, yd)[2:4])
        cls._fill(v, [ax, ay, 2 * ux, 2 * uy])

    @classmethod
    def phi_acceleration_dyd(cls, p, ix, at, to, t, y, yd, v):
        dx, dy = (cls._difference(item) for item in cls._split(ix, at, y)[:2])
        cls._fill(v, [dx, dy])

    @classmethod
    def audit_rows(cls, p, ix, at, to, t, y, yd, r):
        _, yy, u, w, _ = cls._split(ix, at, y)
        r[to[3]] += p[0] / 2 * (u @ u + w @ w)
        r[to[4]] += p[0] * p[1] * yy.sum()

    @staticmethod
    def observe_rows(p, ix, at, to, t, y, yd, r):
        r[to[7]] += y[at[QX] + ix[2] - 1]
        r[to[8]] += y[at[QY] + ix[2] - 1]

    @staticmethod
    def observe_rate_rows(p, ix, at, to, t, y, yd, r):
        r[to[7]] += y[at[FX] + ix[2] - 1]
        r[to[8]] += y[at[FY] + ix[2] - 1]


C_SOURCE = r"""
#include <stdint.h>
typedef struct { const double *p; const int32_t *ix, *at, *to; } frame;
#define ARGS const frame *F, double t, const double *y, const double *yd, double *r
#define N F->ix[2]
#define X(k) (y + F->at[k])
#define A(k) (yd + F->at[k])
#define D(x) (i ? (x)[i] - (x)[i - 1] : (x)[i])
const int sd_contract = 3;
static double *pair(double *v, int i, double value) { *v++ = 2 * value; if (i) *v++ = -2 * value; return v; }
void sd_dynamics_rows(ARGS) {
    for (int i = 0; i < N; i++) {
        r[F->to[0] + i] += F->p[0] * A(2)[i];
        r[F->to[1] + i] += F->p[0] * A(3)[i] + F->p[0] * F->p[1];
    }
}
void sd_dynamics_dyd(ARGS) { for (int i = 0; i < 2 * N; i++) r[i] = F->p[0]; }
void sd_phi_reaction_rows(ARGS) {
    for (int c = 0; c < 2; c++)
        for (int i = 0; i < N; i++) {
            double force = 2 * D(X(c)) * X(4)[i];
            r[F->to[c] + i] += force;
            if (i) r[F->to[c] + i - 1] -= force;
        }
}
void sd_phi_reaction_dy(ARGS) {
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 2; c++) {
            double d = D(X(c)), k = X(4)[i];
            if (!i) { *r++ = 2 * k; *r++ = 2 * d; continue; }
            *r++ = 2 * k; *r++ = -2 * k; *r++ = 2 * d; *r++ = -2 * k; *r++ = 2 * k; *r++ = -2 * d;
        }
}
void sd_phi_rows(ARGS) {
    for (int i = 0; i < N; i++) r[F->to[2] + i] += D(X(0)) * D(X(0)) + D(X(1)) * D(X(1)) - F->p[2] * F->p[2];
}
void sd_phi_dy(ARGS) { for (int i = 0; i < N; i++) for (int c = 0; c < 2; c++) r = pair(r, i, D(X(c))); }
void sd_phi_rate_rows(ARGS) {
    for (int i = 0; i < N; i++) r[F->to[2] + i] += 2 * (D(X(0)) * D(X(2)) + D(X(1)) * D(X(3)));
}
void sd_phi_rate_dy(ARGS) {
    for (int i = 0; i < N; i++) {
        for (int c = 0; c < 2; c++) r = pair(r, i, D(X(2 + c)));
        for (int c = 0; c < 2; c++) r = pair(r, i, D(X(c)));
    }
}
void sd_phi_acceleration_rows(ARGS) {
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 2; c++)
            r[F->to[2] + i] += 2 * (D(X(2 + c)) * D(X(2 + c)) + D(X(c)) * D(A(2 + c)));
}
void sd_phi_acceleration_dy(ARGS) {
    for (int i = 0; i < N; i++) {
        for (int c = 0; c < 2; c++) r = pair(r, i, D(A(2 + c)));
        for (int c = 0; c < 2; c++) r = pair(r, i, 2 * D(X(2 + c)));
    }
}
void sd_phi_acceleration_dyd(ARGS) { sd_phi_dy(F, t, y, yd, r); }
void sd_audit_rows(ARGS) {
    for (int i = 0; i < N; i++) {
        r[F->to[3]] += F->p[0] / 2 * (X(2)[i] * X(2)[i] + X(3)[i] * X(3)[i]);
        r[F->to[4]] += F->p[0] * F->p[1] * X(1)[i];
    }
}
void sd_observe_rows(ARGS) { r[F->to[7]] += X(0)[N - 1]; r[F->to[8]] += X(1)[N - 1]; }
void sd_observe_rate_rows(ARGS) { r[F->to[7]] += X(2)[N - 1]; r[F->to[8]] += X(3)[N - 1]; }
"""
