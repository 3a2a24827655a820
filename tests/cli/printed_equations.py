"""Equations as `sysdyn equations` prints them."""

import numpy as np
from sysdyn.cli.analysis.operating_point import compile_target
from sysdyn.cli.main import run
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.dsl.model.calculus import without_signals
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.text.diagnostics import Report
from texts import ROOT

SEED = ROOT / "models" / "seed"


def printed(capsys, name, *options):
    assert run(["equations", str(SEED / f"{name}.sd"), *options, "--quiet"]) == 0
    return capsys.readouterr().out


# -- numbers -----------------------------------------------------------------------------------------------------------


def model(name, formulation):
    report = Report()
    made = compile_target(RunRequest(str(SEED / f"{name}.sd"), formulation=formulation, backend="numpy"), report)
    return None if made is None else made[1].compiled


class Values:
    """A random number for each parameter and unknown."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.known = {}

    def __call__(self, node):
        if node not in self.known:
            self.known[node] = float(self.random.uniform(0.4, 1.6))
        return self.known[node]

    def of(self, node):
        return evaluate([without_signals(node)], self)[0]
