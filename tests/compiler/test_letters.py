"""Complementary forms in their own letters, and the displacement that they carry with the book's sign (5.44)."""

import json
from pathlib import Path

import pytest
from sysdyn import api
from sysdyn.cli.main import run

CIRCUIT = """
model circuit {
  node a, b: electrical
  Vs: effort(e = 0.4 V) a
  R: dissipator(e = 150 ohm*f) a -> b
  T: dissipator(e = 1 ohm*f + 30 ohm/A^2*f^3) a -> b
  C: potential(q = 3 uF*e + 1 uF/V^2*e^3) b
  L: kinetic(p = 0.2 H*f) a -> b
  init C.e = 0.25 V
}
scene go of circuit { time 0 s to 10 ms; accuracy 1e-8; trace C.q, C.e every 5 ms }
"""


@pytest.fixture
def circuit(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "circuit.sd").write_text(CIRCUIT, encoding="utf-8")
    return "circuit.sd"


@pytest.mark.long
def test_the_displacement_of_the_co_hamiltonian_is_minus_the_slope_of_the_coenergy(circuit):
    assert run(["compile", "-q", circuit, "--formulation", "co_hamiltonian", "-o", "out"]) == 0
    names = [u["name"] for u in json.loads(Path("out/manifest.json").read_text())["unknowns"]]
    y0 = json.loads(Path("out/binding.json").read_text())["y0"]
    charge = 3e-6 * 0.25 + 1e-6 * 0.25**3
    assert y0[names.index("b.q")] == pytest.approx(-charge, rel=1e-12)


@pytest.mark.parametrize("formulation", ["hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_a_traced_displacement_keeps_the_sign_of_its_element(circuit, formulation):
    trace = api.simulate(circuit, formulation=formulation, output="t.h5")
    e = trace["C.e"].values
    assert trace["C.q"].values == pytest.approx(3e-6 * e + 1e-6 * e**3, rel=1e-9)
    assert trace["C.q"].values[0] == pytest.approx(3e-6 * 0.25 + 1e-6 * 0.25**3, rel=1e-9)


def test_the_dump_speaks_of_efforts_and_displacements(circuit, capsys):
    assert run(["compile", circuit, "--formulation", "co_hamiltonian", "--dump", "descriptor"]) == 0
    text = capsys.readouterr().out
    assert "b.q (q, C)" in text
    assert "b' (e, V)" in text
    assert "displacement of b" in text
    assert "T.f (f, A)" in text
    assert "b += b.q + 3e-06*b' + 1e-06*b'^3" in text
    assert "momentum" not in text


def test_so_do_the_comments_of_the_generated_text(circuit):
    for backend, name in (("c", "residual.c"), ("numpy", "residual.py")):
        where = ["--formulation", "co_hamiltonian", "--backend", backend, "-o", backend]
        assert run(["compile", "-q", circuit, *where]) == 0
        text = Path(backend, name).read_text(encoding="ascii")
        comments = [line for line in text.splitlines() if line.lstrip().startswith(("/*", "#"))]
        assert any("displacement" in line for line in comments)
        assert not any("momentum" in line for line in comments)
