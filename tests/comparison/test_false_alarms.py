"""No false alarm: a scene over formulations, methods, accuracies and backends is equal to itself.

Two runs are held to TIMES the larger of the accuracies asked of them, or of what a run itself says that it missed its
accuracy by. Always: SLICE. SYSDYN_LONG=1: every scene of models/ at the sizes of its ci.toml (half an hour); -k
picks.
"""

import os
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import pytest
from sysdyn.cli.compare.diffing import common, differences, headline
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.request.sizes import sizes
from sysdyn.cli.run.running import Ran, run
from sysdyn.cli.verify.twins import free_quantities
from sysdyn.cli.verify.verification import METHODS, REFUSALS, TIMES
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.comparison.recorded import Recorded
from sysdyn.runtime.comparison.verdict import Tolerance

MODELS = Path(__file__).resolve().parents[2] / "models"
LONG = bool(os.environ.get("SYSDYN_LONG"))
SLICE = {
    "seed/pendulum.sd reference": 2,
    "seed/mass_spring.sd reference": 4,
    "seed/lead_filter.sd reference": 4,
    "seed/solenoid.sd reference": 2,
    "gallery/diode_circuit.sd mains": 1,
    "gallery/slider_crank.sd drive": 1,
}
"""Scenes and how many formulations each has at least: laws, constraints, quantities without rates."""
KNOWN = {
    "gallery/ev_powertrain.sd accurate": "radau at 1e-6: rates between steps are solved for from values, whose error a "
    "stiff current divides by its time constant; rows 0.5 s apart make it 1.6 limits between them (kane, current)",
}
"""Alarms that are true of a rate in the trace."""
FORMULATIONS = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian", "kane")
FINE = 1e-6
COARSE = (1e-4, 1e-3) if LONG else (1e-4,)
WALL = "120"


def scenes():
    """Every scene of models/ as FOLDER/FILE.sd SCENE."""
    found = []
    for path in sorted(p for p in MODELS.glob("*/*.sd") if p.parent.name != "book"):
        document = targets.read(str(path), Report())
        found += [f"{path.parent.name}/{path.name} {name}" for name in document.scenes]
    return found


def _marked(name):
    return pytest.param(name, marks=pytest.mark.xfail(reason=KNOWN[name], strict=True) if name in KNOWN else ())


@dataclass(frozen=True)
class Made:
    """One run: how, what it came to, its trace."""

    setting: tuple[str, str, float, str]
    ran: Ran
    file: str

    @property
    def accuracy(self):
        """What may be held against it."""
        return max(self.setting[2], self.ran.outcome.error_estimate or 0.0)


def runs(name, folder):
    """Yields all runs of a scene that exist; every other end than a refusal is a fault."""
    file, scene = name.split()
    path = str(MODELS / file)
    settings = [*product(METHODS, (FINE, *COARSE), ("c",)), ("bdf", COARSE[0], "numpy")]
    for formulation in FORMULATIONS:
        for method, accuracy, backend in settings:
            setting = formulation, method, accuracy, backend
            output = str(folder / f"{formulation}-{method}-{accuracy:g}-{backend}.h5")
            options = {"accuracy": accuracy, "backend": backend, "output": output, "max_wall": WALL}
            report = Report()
            ran = run(RunRequest(path, scene, None, formulation, method, settings=sizes(path)[1], **options), report)
            if ran is None and {d.code for d in report} & set(REFUSALS):
                break  # not expressible
            assert ran is not None, (setting, [d.message for d in report])
            assert ran.failure is None, (setting, ran.failure)
            yield Made(setting, ran, output)


def alarms(reference, made):
    """What the comparison says against two runs of the same physics, both ways."""
    tolerance = Tolerance(TIMES * max(reference.accuracy, made.accuracy))
    free = {name for r in (reference, made) for name in free_quantities(r.ran.prepared, r.ran.started)}
    with Recorded(reference.file) as ref, Recorded(made.file) as test:
        names = (set(ref.quantities) & set(test.quantities)) - free
        assert names, made.setting
        for one, other in ((ref, test), (test, ref)):
            verdict = differences(common(one, names), common(other, names), tolerance)
            if not verdict.equal:
                yield f"{made.setting} at {tolerance.rtol:g}: {headline(verdict)}"


@pytest.mark.parametrize("name", [_marked(name) for name in (scenes() if LONG else SLICE)])
@pytest.mark.long
def test_the_same_physics_is_equal(name, tmp_path, monkeypatch):
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "cache"))
    reference, *others = runs(name, tmp_path)
    assert len({reference.setting[0], *(made.setting[0] for made in others)}) >= SLICE.get(name, 1)
    print(f"{name}: {len(others)} pairs")
    found = [text for made in others for text in alarms(reference, made)]
    assert not found, "\n".join([f"{len(found)} alarms, reference {reference.setting}", *found])
