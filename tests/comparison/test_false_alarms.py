"""No false alarm: one model over formulations, methods, accuracies and backends, within ten times its accuracy."""

from itertools import product
from pathlib import Path

import pytest
from sysdyn.cli.diffing import differences, headline
from sysdyn.cli.failures import UsageError
from sysdyn.cli.running import Request, run
from sysdyn.dsl.diagnostics import Report
from sysdyn.runtime.comparison.recorded import Recorded
from sysdyn.runtime.comparison.verdict import Tolerance

SEED = Path(__file__).resolve().parents[2] / "models" / "seed"
MODELS = {"pendulum": 2, "mass_spring": 3, "lead_filter": 4, "solenoid": 2, "thermal_two_node": 1}
"""Models and how many formulations each has at least."""
FORMULATIONS = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian")
REFERENCE = 1e-6


def traces(model, folder):
    """(formulation, method, accuracy, backend, file) of all runs that exist; the reference first."""
    found = []
    compiled = product(FORMULATIONS, ("bdf", "radau"), (REFERENCE, 1e-4), ("c",))
    for setting in (*compiled, ("lagrangian", "bdf", 1e-4, "numpy")):
        formulation, method, accuracy, backend = setting
        file = str(folder / f"{len(found)}.h5")
        request = Request(
            str(SEED / f"{model}.sd"),
            formulation=formulation,
            method=method,
            accuracy=accuracy,
            backend=backend,
            output=file,
            timings=False,
        )
        try:
            ran = run(request, Report())
        except UsageError:
            continue
        if ran is not None and ran.exit == 0:
            found.append((*setting, file))
    return found


@pytest.mark.parametrize("model", MODELS)
def test_the_same_physics_is_equal(model, tmp_path, monkeypatch):
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "cache"))
    found = traces(model, tmp_path)
    assert len({formulation for formulation, *_ in found}) >= MODELS[model]
    reference = found[0]
    for setting in found[1:]:
        rtol = 10.0 * max(setting[2], REFERENCE)
        with Recorded(reference[-1]) as ref, Recorded(setting[-1]) as test:
            for one, two in ((ref, test), (test, ref)):
                verdict = differences(one, two, Tolerance(rtol))
                assert verdict.equal, (setting, headline(verdict))
