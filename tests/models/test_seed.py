"""The book's systems against the seed's reference values, as they stand and with everything changed.

Each formulation by the C code; by NumPy one of each model, at the finer accuracy two, and each set of changed values in
one formulation at least.  SYSDYN_LONG=1 takes all, the changed values at the finer accuracy too (minutes).
"""

import os
from pathlib import Path

import numpy as np
import pytest
from changed import CHANGED, EXTREME, STIFF
from reduced import ROOT, solution
from reference_values import load
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.trace.trace import Trace

ALLOWED = 1e-5
"""Of each variable's largest magnitude, at an accuracy of 1e-6."""
ASKED = {"rectifier_motor_crank": 3e-6}
"""Accuracies of what does not reach 1e-6 with all values: rows between steps of steep laws are interpolated."""
FINE = 1e-9
FINELY_ALLOWED = 1e-8
"""At an accuracy of FINE."""
LONG = os.environ.get("SYSDYN_LONG") == "1"
INTEGRATION = ("q10", "q20", "q30", "q40")
"""Constants of integration: by default what the initial values make them."""
FACTORS = (0.8, 1.3, 0.7, 1.5, 1.1)
SEED = ROOT / "models" / "seed"
MODELS = sorted(path.stem for path in SEED.glob("*.sd"))
REFERENCES = load("references.json")
CATALOGUE = load("catalogue.json")


COMPLEMENTARY = (
    "brake_by_wire", "co_circuit", "dc_motor", "diode_circuit", "electrical_transformer", "fluid_tank",
    "fluid_transformer", "gear_pair", "lc_ladder", "lcr_nonlinear", "lead_filter", "lever", "mass_spring",
    "mechanical_gyrator", "msd_velocity_source", "nonlinear_fluid", "nonlinear_spring", "pd_pump", "rack_pinion",
    "ram_cylinder", "relativistic_mass", "thermal_two_node", "transactor_cccs", "transactor_ccvs", "transactor_vccs",
    "transactor_vcvs", "two_tank", "voice_coil",
)  # fmt: skip
"""Networks whose laws can be read from momenta and flows as well as from displacements and efforts."""


def formulations(model):
    """What the catalogue says the model can be written in, and the complementary family where the text allows it."""
    entries = CATALOGUE[model]["models"] if model in CATALOGUE else []
    found = {m["form"] for m in entries} & {"lagrangian", "hamiltonian"}
    if model in COMPLEMENTARY:
        found |= {"co_lagrangian", "co_hamiltonian"}
    return sorted(found)


CASES = [(model, formulation) for model in MODELS for formulation in formulations(model)]


def simulated(tmp_path, model, *, formulation, times, backend="c", settings=(), accuracy=None):
    """Traced values at the instants asked for."""
    report = Report()
    request = RunRequest(
        str(SEED / f"{model}.sd"),
        scene="reference",
        formulation=formulation,
        backend=backend,
        accuracy=accuracy or ASKED.get(model, 1e-6),
        at=",".join(map(repr, times)),
        settings=tuple((name, repr(value)) for name, value in settings),
        output=str(tmp_path / "trace.h5"),
        max_wall="600",
    )
    ran = run(request, report)
    assert ran is not None, [f"{d.code} {d.message}" for d in report]
    assert ran.exit == 0
    assert ran.prepared.formulation == formulation
    assert ran.prepared.backend == backend
    assert not ran.outcome.warnings
    trace = Trace.open(tmp_path / "trace.h5")
    places = [int(np.argmin(np.abs(trace.time - t))) for t in times]
    np.testing.assert_allclose(trace.time[places], times, rtol=1e-14)
    return {name: trace[name].values[places] for name in trace.names}


def errors(found, wanted):
    """Largest error of each variable, relative to its largest magnitude."""
    result = {}
    for name, values in wanted.items():
        expected = np.asarray(values, dtype=float)
        size = np.max(np.abs(expected))
        result[name] = float(np.max(np.abs(found[name] - expected)) / (size if size > 0.0 else 1.0))
    return result


def test_every_model_of_the_issue_is_there():
    assert set(MODELS) == set(REFERENCES)
    assert set(CHANGED) | set(EXTREME) <= set(MODELS)
    assert all(len(sets) >= 3 for sets in CHANGED.values())
    assert len(CASES) >= 120


def settings_of(model, case):
    """Changed values: written by hand, else every parameter and initial value by another factor."""
    if model in CHANGED:
        return CHANGED[model][case]
    reference = REFERENCES[model]
    values = {k: v for k, v in reference["parameters"].items() if k not in INTEGRATION}
    values |= {f"{k}_0": v for k, v in reference["initial"].items()}
    return {name: value * FACTORS[(k + 2 * case) % len(FACTORS)] for k, (name, value) in enumerate(values.items())}


def in_numpy(model, formulation):
    """Formulations that NumPy runs too: a different one from model to model."""
    own = formulations(model)
    return LONG or (model != "rectifier_motor_crank" and formulation == own[MODELS.index(model) % len(own)])


@pytest.mark.parametrize(
    ("model", "formulation", "backend"),
    [(*case, backend) for case in CASES for backend in ("c", "numpy") if backend == "c" or in_numpy(*case)],
)
@pytest.mark.long
def test_reference_values(tmp_path, model, formulation, backend):
    reference = REFERENCES[model]
    found = simulated(tmp_path, model, formulation=formulation, backend=backend, times=reference["t"])
    assert set(found) == set(reference["variables"])
    worst = errors(found, reference["values"])
    assert max(worst.values()) <= ALLOWED, worst


def twice(model):
    """Formulations that are held to a finer accuracy too: two of a model, other ones from model to model."""
    own, k = formulations(model), MODELS.index(model)
    return own if LONG or len(own) < 3 else [own[k % len(own)], own[(k + 1) % len(own)]]


@pytest.mark.parametrize(("model", "formulation"), [case for case in CASES if case[1] in twice(case[0])])
@pytest.mark.long
def test_reference_values_at_the_finer_accuracy(tmp_path, model, formulation):
    reference = REFERENCES[model]
    found = simulated(tmp_path, model, formulation=formulation, times=reference["t"], accuracy=FINE)
    worst = errors(found, reference["values"])
    assert max(worst.values()) <= FINELY_ALLOWED, worst


def changed(tmp_path, model, formulation, settings, accuracy=None):
    """Errors with other values, against the reduced ODE."""
    reference = REFERENCES[model]
    known = set(reference["parameters"]) | {f"{name}_0" for name in reference["initial"]}
    assert set(settings) <= known
    times = sorted(
        {*reference["t"], *(0.5 * (a + b) for a, b in zip(reference["t"], reference["t"][1:], strict=False))}
    )
    wanted = witness(model, tuple(settings.items()), tuple(times))
    options = {"times": times, "settings": tuple(settings.items()), "accuracy": accuracy}
    found = simulated(tmp_path, model, formulation=formulation, **options)
    return errors(found, {name: wanted[name] for name in found})


def some(model, formulation, case):
    """Each set in one formulation, each formulation with one set."""
    own = formulations(model)
    k = own.index(formulation)
    return k % 3 == case if len(own) >= 3 else k == case % len(own)


@pytest.mark.parametrize(
    ("model", "formulation", "case"), [(*case, k) for case in CASES for k in range(3) if LONG or some(*case, k)]
)
@pytest.mark.long
def test_changed_values(tmp_path, model, formulation, case):
    worst = changed(tmp_path, model, formulation, settings_of(model, case))
    assert max(worst.values()) <= ALLOWED, worst


@pytest.mark.long
@pytest.mark.parametrize(("model", "formulation"), CASES)
@pytest.mark.parametrize("case", range(3))
def test_changed_values_at_the_finer_accuracy(tmp_path, model, formulation, case):
    if model in STIFF:
        pytest.skip("the witness itself is not that accurate")
    worst = changed(tmp_path, model, formulation, settings_of(model, case), FINE)
    assert max(worst.values()) <= FINELY_ALLOWED, worst


@pytest.mark.parametrize(
    ("model", "formulation", "case"),
    [
        (model, formulation, case)
        for model, sets in EXTREME.items()
        for k, formulation in enumerate(f for f in ("lagrangian", "hamiltonian") if f in formulations(model))
        for case in range(len(sets))
        if LONG or case % 2 == k or len(formulations(model)) == 1
    ],
)
@pytest.mark.long
def test_extreme_values(tmp_path, model, formulation, case):
    worst = changed(tmp_path, model, formulation, EXTREME[model][case])
    assert max(worst.values()) <= ALLOWED, worst


_WITNESSES = {}


def witness(model, settings, times):
    """The reduced ODE's solution; all formulations are compared with one."""
    if (model, settings) not in _WITNESSES:
        reference, values = REFERENCES[model], dict(settings)
        parameters = {name: values.get(name, value) for name, value in reference["parameters"].items()}
        initial = {name: values.get(f"{name}_0", value) for name, value in reference["initial"].items()}
        method, rtol = STIFF.get(model, ("DOP853", 1e-12))
        _WITNESSES[model, settings] = solution(reference["reduced_ode"], parameters, initial, times, method, rtol)
    return _WITNESSES[model, settings]


@pytest.mark.parametrize("model", [m for m in MODELS if "reduced_ode" in REFERENCES[m]])
@pytest.mark.one_in(12)
def test_the_witness_meets_the_reference_values(model):
    reference = REFERENCES[model]
    method, rtol = STIFF.get(model, ("DOP853", 1e-12))
    ode = reference["reduced_ode"]
    found = solution(ode, reference["parameters"], reference["initial"], reference["t"], method, rtol)
    worst = errors(found, reference["values"])
    assert max(worst.values()) <= 1e-8, worst


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.long
def test_parameters_have_the_books_names_and_values(model):
    from sysdyn.api import compile_model

    values = compile_model(SEED / f"{model}.sd", scene="reference", backend="numpy").parameters
    reference = REFERENCES[model]
    for name, value in reference["parameters"].items():
        if name in INTEGRATION:
            assert name in values
            continue
        assert values[name] == pytest.approx(value, rel=1e-14), name
    for name, value in reference["initial"].items():
        assert values[f"{name}_0"] == pytest.approx(value, rel=1e-14), name


def test_the_folder_holds_nothing_else():
    assert {path.suffix for path in Path(SEED).iterdir() if path.is_file()} <= {".sd", ".py"}
