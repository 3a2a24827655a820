"""The descriptor models of the seed's catalogue, the texts of models/book, and how these meet the known solutions."""

from dataclasses import dataclass

import numpy as np
from reduced import ROOT
from reference_values import load
from sysdyn.cli.analysis.operating_point import compile_target, model_at_start
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.dsl.text.diagnostics import Report

BOOK = ROOT / "models" / "book"
CATALOGUE, VALUES, REFERENCES = load("catalogue.json"), load("descriptor_values.json"), load("references.json")
BLOCKS = ("dynamics", "phi_reaction", "psi_reaction", "momentum", "phi", "psi", "gamma", "lambda")
WORDS = {"colagrangian": "co_lagrangian", "cohamiltonian": "co_hamiltonian"}
SUFFIX = {
    "inlet as implicit effort": "_inlet_as_implicit_effort",
    "inlet as rheonomic flow constraint": "_inlet_as_rheonomic_flow_constraint",
    "sin/cos form (regular at theta=pi/2)": "_sin_cos_form",
    "sin/cos form": "_sin_cos_form",
    "ODE in Lagrange coordinates (Ex 3.1)": "_lagrange_coordinates",
    "DAE, Cartesian (Ex 3.2, 4.1)": "_cartesian",
    "Lagrangian counterpart": "_lagrangian_counterpart",
    "minimal": "_minimal",
}
"""Of the catalogue's names of models, in the names of files."""


@dataclass(frozen=True)
class Entry:
    """A descriptor model of the catalogue; name: its key in descriptor_values.json."""

    key: str
    name: str
    file: str
    formulation: str
    counts: tuple[int, ...]
    index: int | None


def _entry(key, number, model):
    formulation = WORDS.get(model["form"], model["form"])
    suffix = SUFFIX[model["label"]] if model["label"] else ""
    if key == "mass_spring" and formulation.startswith("co_"):
        suffix = "_complementary"
    rows = ("phi", "psi", "implicit", "lam")
    counts = (model["n"], *(len(model[r]) for r in rows), len(model["transformed"] or ()))
    name = f"{key}|{model['form']}|{model['label'] or number}"
    return Entry(key, name, f"{key}{suffix}", formulation, counts, model["check"].get("index"))


ENTRIES = [_entry(key, k, m) for key, entry in CATALOGUE.items() for k, m in enumerate(entry["models"])]


def begin(entry):
    """The compiled text and its state at the start."""
    report = Report()
    path = str(BOOK / f"{entry.file}.sd")
    request = RunRequest(path, formulation=entry.formulation, backend="numpy", scene="reference")
    if entry.key == "redundant_pendulum":
        request = RunRequest(path, formulation=entry.formulation, backend="numpy", redundancy="minimum_norm")
    made = compile_target(request, report)
    assert made is not None, [f"{d.code} {d.message}" for d in report]
    found = model_at_start(*made, request, report)
    assert found is not None, [f"{d.code} {d.message}" for d in report]
    return made[1], found


def solution(entry):
    """(t, values by name) of the independent solution."""
    if entry.name in VALUES:
        held = VALUES[entry.name]
        for t, row in zip(held["t"], held["rows"], strict=True):
            yield t, dict(zip(held["names"], map(float, row), strict=True))
        return
    # the rod stated twice: any multipliers with 2 l kappa1 + 2 kappa2 = m (l om^2 + g cos th)
    assert entry.key == "redundant_pendulum"
    reference = REFERENCES[entry.key]
    m, length, g = (reference["parameters"][n] for n in ("m", "l", "g"))
    states = reference["state_values"]
    for t, th, om in zip(reference["t"], *(map(float, states[n]) for n in ("th", "om")), strict=True):
        s, c, a = np.sin(th), np.cos(th), -g / length * np.sin(th)
        values = {"q1": length * s, "q2": -length * c, "f1": length * om * c, "f2": length * om * s}
        values |= {"df1/dt": length * (a * c - om**2 * s), "df2/dt": length * (a * s + om**2 * c)}
        both = m * (length * om**2 + g * c) / 2
        yield t, values | {"kappa1": both / (3 * length), "kappa2": both * 2 / 3}


def state(form, row):
    """y, yd of a form at a row; NaN where the values list no rate."""
    co = form.formulation.startswith("co_")
    letters = {"q": "p", "f": "e", "p": "q"} if co else {"q": "q", "f": "f", "p": "p"}
    order = {kind: [f.owner for f in form.families if f.kind == kind] for kind in ("kappa", "mu")}
    y, yd = [], []
    for family in form.families:
        owner, kind = family.owner, family.kind
        if kind in letters:
            number = owner[1:]
            y.append(row[f"{letters[kind]}{number}"])
            rate = {"q": f"{letters['f']}{number}", "f": f"d{letters['f']}{number}/dt"}.get(kind)
            yd.append(row[rate] if rate else np.nan)
        elif kind in ("kappa", "mu"):
            y.append(row[f"{kind}{order[kind].index(owner) + 1}"])
            yd.append(np.nan)
        else:
            y.append(row.get(owner, 0.0))
            yd.append(np.nan if kind == "s" else 0.0)
    return np.array(y), np.array(yd)


def filled(oracle, t, y, yd):
    """The rates of momenta by their own definition, those of dynamic variables by their rows."""
    form = oracle.form
    start = np.where(np.isnan(yd), 0.0, yd)
    for kind, home, block in (("p", "momentum", "momentum_rate"), ("s", "lambda", "lambda")):
        columns = [int(oracle.at[j]) for j, f in enumerate(form.families) if f.kind == kind]
        rows = [int(oracle.to[k]) for k, r in enumerate(form.rows) if r.block == home]
        assert len(columns) == len(rows)
        if columns:
            v, r, c = oracle.entries(block, 1, t, y, start)
            matrix = np.zeros((oracle.to[-1], oracle.at[-1]))
            np.add.at(matrix, (r.astype(int), c.astype(int)), v)
            left = matrix[np.ix_(rows, columns)]
            start[columns] -= np.linalg.solve(left, oracle.rows(block, t, y, start)[rows])
    return start


def residual(entry, prepared):
    """The largest residual over all rows and instants, relative to the sum of the magnitudes of its terms."""
    form = prepared.compiled.form
    oracle = Oracle(form, prepared.binding)
    worst = 0.0
    for t, row in solution(entry):
        y, yd = state(form, row)
        yd = filled(oracle, t, y, yd)
        found = sum(oracle.rows(b, t, y, yd) for b in BLOCKS)
        scale = sum(oracle.magnitudes(b, t, y, yd) for b in BLOCKS)
        worst = max(worst, float(np.max(np.abs(found) / np.maximum(scale, 1e-3))))
    return worst
