"""Outputs that are alike as turns of one loop: the same numbers to the last bit, in a text that grows by tables."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from carriers import CCarrier
from sysdyn.compiler.pipeline import compile_network
from sysdyn.compiler.program import emit_c_rolled
from sysdyn.dsl import load
from sysdyn.dsl.model.expression import fresh
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText

sys.path.append(str(Path(__file__).parents[1] / "models"))
from handwritten import mesh, mixed, power_grid, stages


def compiled(text, formulation="lagrangian", *, gather=False):
    report = Report()
    with fresh():
        document = load.document(SourceText("n.sd", text), report)
        (model,), (scene,) = document.models.values(), document.scenes.values()
        found = load.network(document, model, scene, report)
        assert found is not None, list(report)[:3]
        return compile_network(found, formulation, gather=gather)


def values(model):
    """Everything that the C text computes at one point."""
    carrier = CCarrier(model.program, model.form, model.bind())
    draw = np.random.default_rng(3)
    y, yd = draw.normal(0.5, 0.1, carrier.at[-1]), draw.normal(size=carrier.at[-1])
    for block in model.program.blocks():
        yield block, carrier.rows(block, 0.3, y, yd)
        for part in ("dy", "dyd"):
            yield f"{block} {part}", carrier.entries(block, part, 0.3, y, yd)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.parametrize("text", [mixed(24), power_grid(24), stages(12)], ids=["mixed", "power_grid", "stages"])
@pytest.mark.long
def test_loops_through_tables_compute_the_same_numbers(text, formulation, monkeypatch):
    for limit, few in (("ALIKE", 4), ("TERMS", 8), ("LARGE", 1)):
        monkeypatch.setattr(emit_c_rolled, limit, few)
    model = compiled(text, formulation)
    rolled = dict(values(model))
    monkeypatch.setattr(emit_c_rolled, "LARGE", 10**9)
    for name, plain in values(model):  # factors of a product may stand in another order
        np.testing.assert_allclose(rolled[name], plain, rtol=1e-14, atol=0.0, err_msg=name)


@pytest.mark.long
def test_loops_that_share_a_function_compute_the_same_numbers(monkeypatch):
    monkeypatch.setattr(emit_c_rolled, "SHARED", 2)
    model = compiled(mesh(5, 24), gather=True)
    assert "loops that are alike" in model.text
    shared = dict(values(model))
    monkeypatch.setattr(emit_c_rolled, "SHARED", 10**9)
    for name, plain in values(model):
        assert shared[name].tobytes() == plain.tobytes(), name


@pytest.mark.long
def test_what_the_c_compiler_sees_hardly_grows_with_what_is_written_out():
    """Statements of C a bus, without tables: 150 where each row has its own."""
    few, many = (re.sub(r"= \{[^}]*\};", "", compiled(power_grid(n)).text).count(";") for n in (300, 600))
    assert (many - few) / 300 < 15
