"""One-call functions of an exported model, on NumPy alone; they read `binding.json` beside this file.

All numbers but outputs in SI units; p: parameters in the order of binding.json, None: as bound.  values [entries]: a
matrix by columns on the pattern (sd_colptr, sd_rowind), as scipy.sparse.csc_array((values, rowind, colptr)) takes it.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]
_HELD, _SETTLED, _RANK, _NOISE = 1e-9, 2e-15, 1e-11, 1e-13
_ITERATIONS, _HALVINGS, _NEWTON = 60, 12, 30


class StartError(ArithmeticError):
    """No consistent start was found at these parameters."""


class _Form:
    """One index form: residual and the two parts of its Jacobian from blocks and tables."""

    def __init__(self, tables: dict[str, Any], ix: NDArray[np.int32]) -> None:
        for name, value in tables.items():
            if name != "calls":
                setattr(self, name, np.asarray(value, dtype=np.int32) if isinstance(value, list) else value)
        self.ix = ix
        self.made = [_Call(call) for call in tables["calls"]]
        self.columns = np.repeat(np.arange(tables["unknowns"]), np.diff(tables["column"]))

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)

    def residual(self, t: float, y: _Floats, yd: _Floats, p: _Floats) -> _Floats:
        """F [rows]."""
        r: _Floats = np.zeros(self.rows)
        r[self.k_row] = yd[self.k_q] - y[self.k_f]
        for call in self.made:
            call.rows(p, self.ix, call.at, call.to, t, y, yd, r)
        r[self.held_row] = y[self.held_unknown]
        return r

    def jacobian(self, t: float, y: _Floats, yd: _Floats, p: _Floats) -> tuple[_Floats, _Floats]:
        """dF/dy, dF/dyd [entries]."""
        parts = np.zeros((2, len(self.row)))
        parts[1, self.k_slot_q] += 1.0
        parts[0, self.k_slot_f] -= 1.0
        for call in self.made:
            for part, function, slots in zip(parts, (call.dy, call.dyd), (call.slot_dy, call.slot_dyd), strict=True):
                if function is not None:
                    v = np.zeros(len(slots))
                    function(p, self.ix, call.at, call.to, t, y, yd, v)
                    np.add.at(part, slots, v)
        parts[:, self.cleared] = 0.0
        parts[0, self.held_slot], parts[1, self.held_slot] = 1.0, 0.0
        return parts[0], parts[1]


class _Call:
    """A block with its tables."""

    def __init__(self, call: dict[str, Any]) -> None:
        self.block = call["block"]
        self.at, self.to, self.slot_dy, self.slot_dyd = (
            np.asarray(call[name], dtype=np.int32) for name in ("at", "to", "dy", "dyd")
        )
        self.rows = globals()[f"{self.block}_rows"]
        self.dy = globals()[f"{self.block}_dy"] if len(self.slot_dy) else None
        self.dyd = globals()[f"{self.block}_dyd"] if len(self.slot_dyd) else None


class _Model:
    """Everything of binding.json."""

    def __init__(self) -> None:
        said = json.loads(Path(__file__).with_name("binding.json").read_text(encoding="utf-8"))
        self.said, self.tables = said, said["tables"]
        self.ix, self.following_ix, self.at = (
            np.asarray(self.tables[name], dtype=np.int32) for name in ("ix", "following_ix", "at")
        )
        self.p, self.y0, self.yd0 = (np.asarray(said[name], dtype=float) for name in ("p", "y0", "yd0"))
        self.full_y, self.full_yd = (np.asarray(self.tables[name], dtype=float) for name in ("full_y", "full_yd"))
        self.form = _Form(self.tables["system"], self.ix)
        self.structural = np.asarray(self.tables["structural"], dtype=int)
        self.state = self.tables["state"]
        self.n = len(self.y0)

    def parameters(self, p: Any) -> _Floats:
        """P as an array.  ValueError where sizes would have to change."""
        if p is None:
            return self.p
        given: _Floats = np.asarray(p, dtype=float)
        if given.shape != self.p.shape:
            raise ValueError(f"p has {given.size} numbers, not {self.p.size}")
        if np.any(given[self.structural] != self.p[self.structural]):
            raise ValueError("a parameter on which sizes depend was changed: compile the model with it")
        return given


_MODELS: list[_Model] = []


def _model() -> _Model:
    if not _MODELS:
        _MODELS.append(_Model())
    return _MODELS[0]


def pattern() -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The pair (sd_colptr, sd_rowind) of the matrices' pattern."""
    said = _model().said
    return np.asarray(said["sd_colptr"], dtype=np.int32), np.asarray(said["sd_rowind"], dtype=np.int32)


def sd_residual(t: float, y: Any, yd: Any, p: Any = None) -> _Floats:
    """F(t, y, yd) [unknowns]; index form 0: yd - F(t, y)."""
    m = _model()
    p, y, yd = m.parameters(p), np.asarray(y, dtype=float), np.asarray(yd, dtype=float)
    if m.state is None:
        return m.form.residual(t, y, yd, p)
    found: _Floats = yd - _slopes(m, t, y, p)[1][m.state["places"]]
    return found


def sd_jacobian(t: float, y: Any, yd: Any, cj: float, p: Any = None) -> _Floats:
    """dF/dy + cj dF/dyd [entries]."""
    m = _model()
    p, y, yd = m.parameters(p), np.asarray(y, dtype=float), np.asarray(yd, dtype=float)
    if m.state is not None:
        return _state_jacobian(m, t, y, cj, p)
    jy, jyd = m.form.jacobian(t, y, yd, p)
    return jy + cj * jyd


def sd_mass(t: float, y: Any, yd: Any, p: Any = None) -> _Floats:
    """dF/dyd [entries]."""
    m = _model()
    if m.state is not None:
        columns = np.repeat(np.arange(m.n), np.diff(m.said["sd_colptr"]))
        return np.asarray(np.asarray(m.said["sd_rowind"]) == columns, dtype=float)
    return m.form.jacobian(t, np.asarray(y, dtype=float), np.asarray(yd, dtype=float), m.parameters(p))[1]


def sd_follow(p: Any) -> _Floats:
    """The parameters p with what follows from others (param b = 2*a) and constants of integrated rows written anew."""
    return _apply_following(np.array(_model().parameters(p)), [])


def _apply_following(p: _Floats, replaced: list[tuple[slice, _Floats]]) -> _Floats:
    """What follows written into p, in the order in which it is used; what is replaced does not follow."""
    m = _model()
    y = np.zeros(m.tables["followed"] + 1)
    for kind in ("parameter", "initial", "constant"):
        _groups(m, kind, p, y, replaced)
    return m.parameters(p)


def parameters(**changed: float) -> _Floats:
    """The parameters as bound but for those named (SI; arrays whole), and what follows from them."""
    m = _model()
    p = np.array(m.p)
    known = {item["name"]: slice(item["place"], item["place"] + item["size"]) for item in m.said["parameters"]}
    for name, value in changed.items():
        p[known[name]] = np.ravel(value)
    return _apply_following(m.parameters(p), [(known[name], p[known[name]].copy()) for name in changed])


def sd_outputs(t: float, y: Any, yd: Any, p: Any = None) -> _Floats:
    """What the scene traces; not a number where that reads a ledger of a whole run."""
    m = _model()
    p, y, yd = m.parameters(p), np.asarray(y, dtype=float), np.asarray(yd, dtype=float)
    tables = m.tables
    if not m.said["outputs"]:
        return np.zeros(0)
    # rates and multipliers are solved for first
    if m.state is not None:
        y, yd = _slopes(m, t, y, p)
    written = tables["written"]
    # the unknowns as the rows of outputs want them
    inside, rates = np.zeros((2, max(tables["system"]["extended"], written)))
    inside[:written], rates[:written] = y[:written], yd[:written]
    # ledgers are integrals of a run: not known at one instant
    meters = np.full(7, np.nan)
    if tables["audit"] is not None:
        found = np.zeros(tables["audited"])
        _observe(m, tables["audit"], t, inside, rates, p, found)
        meters[1:3] = found[:2]
    for place, value in zip(tables["audit_at"], meters, strict=True):
        if place >= 0:
            inside[place] = value
    w = np.zeros(tables["observed"])
    _observe(m, tables["observe"], t, inside, rates, p, w)
    return w[[output["row"] for output in m.said["outputs"]]]


def _observe(m: _Model, call: dict[str, Any], t: float, y: _Floats, yd: _Floats, p: _Floats, out: _Floats) -> None:
    at, to = (np.asarray(call[name], dtype=np.int32) for name in ("at", "to"))
    globals()[f"{call['block']}_rows"](p, m.ix, at, to, t, y, yd, out)


def _groups(m: _Model, kind: str, p: _Floats, y: _Floats, replaced: Any = ()) -> None:
    """Values of all groups of one kind: into p, into y, or added up in p; what is replaced stands behind each group."""
    for group in m.tables["groups"]:
        if group["kind"] != kind:
            continue
        v = np.zeros(group["entries"])
        globals()[f"{group['block']}_dy"](p, m.following_ix, m.at, m.at, m.said["t0"], y, y, v)
        source, target = (np.asarray(group[name], dtype=int) for name in ("source", "target"))
        if kind == "constant":
            p[target] = 0.0
            np.add.at(p, target, v[source])
        else:
            (y if kind == "initial" else p)[target] = v[source]
        for places, value in replaced:
            p[places] = value


# -- index form 0 -----------------------------------------------------------------------------------------------------


def _solver(m: _Model, jy: _Floats, jyd: _Floats) -> Any:
    """The function A^-1 x of what is solved for at a point; SciPy where it is large."""
    chosen = m.state["selection"]
    values = np.where(np.asarray(chosen["from_rate"]) > 0, jyd[chosen["source"]], jy[chosen["source"]])
    n, pattern = len(chosen["unknown"]), chosen["pattern"]
    if n <= 400:
        full = np.zeros((n, n))
        full[pattern["row"], np.repeat(np.arange(n), np.diff(pattern["column"]))] = values
        return lambda b: np.linalg.solve(full, b)
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    return splu(csc_array((values, pattern["row"], pattern["column"]), shape=(n, n))).solve


def _slopes(m: _Model, t: float, state: _Floats, p: _Floats) -> tuple[_Floats, _Floats]:
    """The full layout (y, yd) at a state, everything that follows solved for."""
    form, chosen = m.form, m.state["selection"]
    unknown, rate = np.asarray(chosen["unknown"]), np.asarray(chosen["rate"]) > 0
    y, yd = np.array(m.full_y), np.array(m.full_yd)
    y[m.state["places"]] = state
    yd[form.k_q] = y[form.k_f]
    if chosen["direct"]:
        y[unknown[~rate]] = yd[unknown[rate]] = 0.0
    first = len(form.k_row)
    for _ in range(1 if chosen["direct"] else _NEWTON):
        r = form.residual(t, y, yd, p)
        step = -_solver(m, *form.jacobian(t, y, yd, p))(r[first:])
        yd[unknown[rate]] += step[rate]
        y[unknown[~rate]] += step[~rate]
        size = np.max(np.abs(step[~rate]) / (1.0 + np.abs(y[unknown[~rate]])), initial=0.0)
        if chosen["direct"] or size <= 1e-14:
            return y, yd
    raise ArithmeticError("the implicit unknowns do not converge")


def _state_jacobian(m: _Model, t: float, state: _Floats, cj: float, p: _Floats) -> _Floats:
    """A column of dF/dy is -A^-1 times the derivatives of the rows by that unknown."""
    form, chosen, places = m.form, m.state["selection"], m.state["places"]
    y, yd = _slopes(m, t, state, p)
    jy, jyd = form.jacobian(t, y, yd, p)
    first, n = len(form.k_row), len(chosen["unknown"])
    number = np.full(form.unknowns, -1)
    number[places] = np.arange(m.n)
    take = (form.row >= first) & (number[form.columns] >= 0)
    reads = np.zeros((n, m.n))
    np.add.at(reads, (form.row[take] - first, number[form.columns[take]]), jy[take])
    found = _solver(m, jy, jyd)(reads)
    rate = np.asarray(chosen["rate"]) > 0
    full = cj * np.eye(m.n)
    full[number[np.asarray(chosen["unknown"])[rate]]] += found[rate]
    full[number[form.k_q], number[form.k_f]] -= 1.0
    columns = np.repeat(np.arange(m.n), np.diff(m.said["sd_colptr"]))
    values: _Floats = full[m.said["sd_rowind"], columns]
    return values


# -- a consistent start: the nearest to the guesses, on all rows that hold there --------------------------------------


def sd_start(p: Any = None) -> tuple[_Floats, _Floats]:
    """Consistent (y, yd) at t0: initial values hold, guesses move least.  StartError where none is found."""
    m = _model()
    p = m.parameters(p)
    # the parameters of the compilation: its own start
    if np.array_equal(p, m.p):
        return m.y0.copy(), m.yd0.copy()
    if m.tables["start"] is None:
        raise StartError("the model is too large to be started anew here: compile it with these parameters")
    y, yd = (item[: m.tables["written"]] for item in _Seeking(m, np.array(p)).found())
    # the export has the states of an explicit form alone
    if m.state is not None:
        y, yd = _slopes(m, m.said["t0"], y[m.state["places"]], p)
        return y[m.state["places"]], yd[m.state["places"]]
    more = np.zeros(m.n - len(y))
    return np.concatenate([y, more]), np.concatenate([yd, more])


class _Seeking:
    """Gauss-Newton in u = weight (x - guess)/scale: each step the least u of the linearised rows."""

    def __init__(self, m: _Model, p: _Floats) -> None:
        self.m, self.p, self.tables = m, p, m.tables["start"]
        self.form = _Form(self.tables["system"], m.ix)
        self.n = self.tables["written"]
        self.rates = np.asarray(self.tables["rates"], dtype=int)
        self.unit = np.asarray(self.tables["scale"]) / np.asarray(self.tables["weight"])
        given = np.zeros(self.n)
        _groups(m, "initial", p, given)
        self.guess = np.concatenate([given, np.zeros(len(self.rates))])
        self.x = np.array(self.tables["known"], dtype=float)
        initial = self.tables["initial"]
        self.x[initial] = given[initial]

    def expand(self, x: _Floats) -> tuple[_Floats, _Floats]:
        """y, yd of x."""
        y, yd = x[: self.n].copy(), np.zeros(self.n)
        yd[self.rates] = x[self.n :]
        yd[self.tables["k_q"]] = y[self.tables["k_f"]]
        return y, yd

    def rows(self, x: _Floats) -> _Floats:
        """All rows at x."""
        return self.form.residual(self.m.said["t0"], *self.expand(x), self.p)

    def matrix(self, x: _Floats) -> _Floats:
        """Their derivatives by x [rows, x]."""
        jy, jyd = self.form.jacobian(self.m.said["t0"], *self.expand(x), self.p)
        full = np.zeros((self.form.rows, x.size))
        full[self.form.row, self.form.columns] = jy
        rates = np.zeros((self.form.rows, self.n))
        rates[self.form.row, self.form.columns] = jyd
        full[:, self.n :] = rates[:, self.rates]
        return np.where(np.isfinite(full), full, 0.0)

    def found(self) -> tuple[_Floats, _Floats]:
        """y, yd after all stages."""
        for stage in self.tables["stages"]:
            holds = any(self.attempt(np.asarray(r, dtype=int), np.asarray(f, dtype=int)) for r, f in stage["trials"])
            if holds and stage["guess"]:
                self.guess = self.x.copy()
        if not holds:
            raise StartError("no consistent start was found at these parameters")
        # round-off beside its magnitude: rows whose slopes underflow leave a rate open
        rates = np.abs(self.x[self.n :]) <= _NOISE * np.asarray(self.tables["scale"])[self.n :]
        self.x[self.n :][rates] = 0.0
        return self.expand(self.x)

    def attempt(self, use: NDArray[np.int_], free: NDArray[np.int_]) -> bool:
        """Whether the rows hold at self.x afterwards; else it is what it was."""
        x, base, now = self.x.copy(), self.guess, np.inf
        # Gauss-Newton: the least change from the guess that meets the rows
        for m in range(_ITERATIONS):
            a = self.matrix(x)[np.ix_(use, free)]
            # rows are judged by the size of their terms
            size = np.abs(a) @ np.asarray(self.tables["scale"])[free]
            size = np.where(size > 0.0, size, 1.0)
            r = self.rows(x)[use]
            now = _largest(r / size)
            if m > 0 and now <= _SETTLED:
                break
            a = a * self.unit[free]
            norm = np.linalg.norm(a, axis=1)
            norm = np.where(norm > 0.0, norm, 1.0)
            # from where the change is counted, not from the last iterate
            aim = a @ ((x - base)[free] / self.unit[free]) - r
            if not np.isfinite(aim).all():
                break
            trial = x.copy()
            trial[free] = base[free] + self.unit[free] * np.linalg.lstsq(a / norm[:, None], aim / norm, _RANK)[0]
            # half the step until it comes nearer
            for _ in range(_HALVINGS):
                reached = _largest(self.rows(trial)[use] / size)
                nearer = reached < now or (m == 0 and now < _HELD and np.isfinite(reached))
                if nearer:
                    break
                trial = x + 0.5 * (trial - x)
            if nearer:
                x, now = trial, reached
            # again, counted from here
            elif base is self.guess:  # rows of terms that are small beside all of u: the least change
                base = x
            else:
                break
        if now < _HELD:
            self.x = x
        return bool(now < _HELD)


def _largest(scaled: _Floats) -> float:
    """The largest size; infinite where something is no number."""
    return float(np.max(np.abs(scaled), initial=0.0)) if np.isfinite(scaled).all() else np.inf
