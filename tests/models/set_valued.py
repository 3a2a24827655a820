"""Models with set-valued relations: how they are run, and what is found in them."""

import pytest
from sysdyn import api

PRIMAL = pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
ALL = pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])


def run(tmp_path, text, formulation=None, accuracy=1e-6, **asked):
    (tmp_path / "model.sd").write_text(text)
    given = {"formulation": formulation, "accuracy": accuracy, "output": tmp_path / "out.h5"} | asked
    return api.simulate(tmp_path / "model.sd", **given)


def codes(text):
    return [(d.code, d.severity) for d in api.check(text) if d.severity == "error" or d.code == "N608"]
