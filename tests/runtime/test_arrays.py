import shutil
import subprocess
import sys

import chain_model as chain
import numpy as np
import pytest
from sysdyn.runtime.integrate.integrate import Integration, Request
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.core_library import ROW_HEAD
from sysdyn.runtime.model.failures import ContractError
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics import ordering
from sysdyn.runtime.start.start import consistent_start
from sysdyn.runtime.structure.structure import structure

MANIFEST = {"structure": chain.structure()}


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    if shutil.which("gcc") is None:
        pytest.skip("needs gcc")
    folder = tmp_path_factory.mktemp("chain")
    (folder / "chain.c").write_text(chain.C_SOURCE)
    target = folder / "chain-0123abcd.so"
    subprocess.run(["gcc", "-O2", "-shared", "-fPIC", str(folder / "chain.c"), "-o", str(target)], check=True)
    return load(target)


def end(system, t_end=0.5, **request):
    state = consistent_start(system, 0.0)
    integration = Integration(
        system, state, Request(t_end, np.linspace(0, t_end, 6), every_step=False, index=2, **request)
    )
    blocks = []
    finished = integration.run(blocks.append)
    rows = np.concatenate(blocks)
    return rows, finished, integration


@pytest.mark.parametrize("form", ["3", "2", "2v", "1", "settled", "start"])
@pytest.mark.parametrize("n", [1, 2, 5])
@pytest.mark.long
def test_library_and_module_agree_and_jacobians_are_derivatives(library, form, n):
    binding = chain.binding(n)
    compiled = System(MANIFEST, binding, library, form)
    numpy = System(MANIFEST, binding, load(chain.Chain), form)
    rng = np.random.default_rng(n)
    y, yd = rng.normal(size=compiled.unknowns), rng.normal(size=compiled.unknowns)
    assert np.allclose(compiled.residual(0, y, yd), numpy.residual(0, y, yd), rtol=1e-12, atol=1e-13)
    step = 1e-6 * np.eye(compiled.unknowns)
    for k, pair in enumerate(zip(compiled.jacobian(0, y, yd), numpy.jacobian(0, y, yd), strict=True)):
        assert np.allclose(*pair, rtol=1e-12, atol=1e-13)
        moved = [(y + d, yd, y - d, yd) if k == 0 else (y, yd + d, y, yd - d) for d in step]
        numeric = [(compiled.residual(0, a, b) - compiled.residual(0, c, d)) / 2e-6 for a, b, c, d in moved]
        assert np.allclose(compiled.dense(pair[0]), np.array(numeric).T, atol=1e-7)


def test_names_labels_and_kinds():
    system = System(MANIFEST, chain.binding(3), load(chain.Chain), "2")
    assert system.unknown_names[:4] == ("q_x[1]", "q_x[2]", "q_x[3]", "q_y[1]")
    assert system.unknown_names[-1] == "kappa.nu[3]"
    assert [system.row_label(k).label for k in (0, 6, 12, 15)] == [
        "q_x[1]' = f",
        "x[1]",
        "link[1]",
        "link[1]",
    ]
    assert system.row_label(15).kind == "phi_rate"
    assert (system.kinds == "nu").sum() == 3


def test_sparse_and_dense_give_the_same(library, monkeypatch):
    system = System(MANIFEST, chain.binding(8), library, "2")
    monkeypatch.setattr(ordering, "DENSE", 1000)
    dense, _, integration = end(system, rtol=1e-8)
    assert integration.linear.contents.dense
    monkeypatch.setattr(ordering, "DENSE", 0)
    system = System(MANIFEST, chain.binding(8), library, "2")
    sparse, _, integration = end(system, rtol=1e-8)
    assert integration.linear.contents.sparse
    assert integration.linear.contents.pivotings >= 1
    assert np.abs(sparse - dense)[:, ROW_HEAD:].max() < 1e-7


def test_long_chain(library):
    n = 300
    system = System(MANIFEST, chain.binding(n), library, "2")
    state = consistent_start(system, 0.0)
    assert state.residual < 1e-11
    facts = structure(system, state)
    assert (facts.index, facts.dof, facts.redundant) == (3, n, 0)
    rows, finished, integration = end(system, 0.1, rtol=1e-5)
    assert rows[:, 7].max() < 1e-12
    assert np.abs(rows[:, 6]).max() < 1e-4 * abs(rows[0, 3])
    assert finished.unsettled == 0
    assert integration.linear.contents.pivotings < 5


@pytest.mark.long
def test_two_carriers_give_the_same_run(library):
    binding = chain.binding(4)
    runs = [end(System(MANIFEST, binding, carrier, "2"), rtol=1e-7) for carrier in (library, load(chain.Chain))]
    assert np.abs(runs[0][0] - runs[1][0]).max() < 1e-9
    assert runs[0][1].statistics.steps == runs[1][1].statistics.steps


@pytest.mark.long
def test_patterns_of_a_large_array_need_no_loop(effort):
    def lines(n):
        manifest = {"structure": chain.structure()}
        system, count = effort(lambda: System(manifest, chain.binding(n), load(chain.Chain), "2"))
        assert system.unknowns == 6 * n
        return count

    few, many = lines(1000), lines(100000)
    assert many <= 1.05 * few, (few, many)


@pytest.mark.long
def test_patterns_of_a_large_array_import_no_scipy():
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import chain_model as chain\n"
        "from sysdyn.runtime.model.carrier import load; from sysdyn.runtime.model.system import System\n"
        "System({'structure': chain.structure()}, chain.binding(1000), load(chain.Chain), '2')\n"
        "assert 'scipy' not in sys.modules and 'h5py' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code, chain.__file__.rsplit("/", 1)[0]], check=True)


@pytest.mark.long
def test_start_of_small_models_imports_no_scipy():
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import chain_model as chain\n"
        "from sysdyn.runtime.model.carrier import load; from sysdyn.runtime.model.system import System\n"
        "from sysdyn.runtime.start.start import consistent_start\n"
        "from sysdyn.runtime.structure.structure import structure\n"
        "s = System({'structure': chain.structure()}, chain.binding(40), load(chain.Chain)); assert s.unknowns == 200\n"
        "structure(s, consistent_start(s, 0.0)); assert 'scipy' not in sys.modules and 'h5py' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code, chain.__file__.rsplit("/", 1)[0]], check=True)


def test_what_is_no_compiled_model(tmp_path, library):
    with pytest.raises(OSError, match=r"missing\.so"):
        load(tmp_path / "missing.so")
    with pytest.raises(ContractError, match="contract"):
        load(object())
    bad = chain.structure()
    bad["blocks"]["phi_rate_x"] = bad["blocks"]["phi"]
    manifest = {"structure": {**bad, "blocks": {**bad["blocks"], "psi": bad["blocks"]["phi"]}}}
    with pytest.raises(ContractError, match=r"psi|outside"):
        System(manifest, chain.binding(2), library)
