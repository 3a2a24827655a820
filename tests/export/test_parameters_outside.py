"""Parameters of exported and of loaded modules: what follows from them, starts far from the bound one, refusals."""

import numpy as np
import pytest
from exported import COMPILER, Outside, compiled, module
from sysdyn import api

RLC = """
from std.electrical import resistor, capacitor, inductor, voltage
model rlc {
  param C = 10 uF
  param Z = 100 ohm
  param L = C*Z^2
  param R = sqrt(L/C)/10
  param V0 = 1 V*(R/(1 ohm))
  node a, b: electrical
  S: voltage(v = 2 V) a -> ground
  R1: resistor(R = R) a -> b
  L1: inductor(L = L) b -> ground
  C1: capacitor(C = C) b -> ground
  init C1.e = V0
  init L1.f = V0/Z
}
scene s of rlc {
  time 0 s to 1 ms
  trace b.e, L1.f, R1.f
}
"""
ROW = """
model row {
  param n = 3
  param k[1..n] = 2 N/m
  coord x[1..n]: translation = 1 m
  for i in 1..n { energy T* = 1/2*(1 kg)*x[i]'^2; energy V = 1/2*k[i]*x[i]^2 }
}
scene s of row {
  time 0 s to 1 s
  trace x[2]
}
"""


def written(tmp_path, text):
    path = tmp_path / "model.sd"
    path.write_text(text)
    return path


@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.parametrize("formulation", ["lagrangian", "co_hamiltonian"])
@pytest.mark.parametrize(("name", "value"), [("L", 0.5), ("R", 3e5), ("C", 2e-7)])
@pytest.mark.one_in(6)
def test_what_follows_from_a_parameter_that_follows(tmp_path, formulation, backend, name, value):
    """`parameters(L = 0.5)` left what follows from L as it was (R, V0, the coil: 10 V for 22); starts at scales far
    from those bound were not found.
    """
    if backend == "c" and COMPILER is None:
        pytest.skip("no C compiler")
    path = written(tmp_path, RLC)
    for kind in {"numpy", backend}:
        chosen = ("--scene", "s", "--formulation", formulation, "--backend", kind)
        assert compiled(tmp_path / kind, path, *chosen) == 0
    python = module(tmp_path / "numpy")
    p = python.parameters(**{name: value})
    values = {"C": 1e-5, "Z": 100.0, name: value}
    values = {"L": values["C"] * values["Z"] ** 2, **values}
    values = {"R": np.sqrt(values["L"] / values["C"]) / 10.0, **values}
    if backend == "c":
        outside = Outside(tmp_path / "c")
        code, *start = outside.start(p)
        assert code == 0
    else:
        start = python.sd_start(p)
    volts = values["R"]
    expected = [volts, volts / values["Z"], (2.0 - volts) / values["R"]]
    assert python.sd_outputs(0.0, *start, p) == pytest.approx(expected, rel=1e-7)


def test_arrays_in_every_door(tmp_path):
    """A list for an array was a TypeError in `simulate` and of a module."""
    path = written(tmp_path, ROW)
    exact = np.cos(np.sqrt(5.0))
    for given in ([2.0, 5.0, 2.0], np.array([2.0, 5.0, 2.0])):
        trace = api.simulate(path, set={"k": given}, output=tmp_path / "out.h5", accuracy=1e-8)
        assert trace["x[2]"][-1] == pytest.approx(exact, abs=1e-8)
        assert api.load(path, accuracy=1e-8).run(set={"k": given})["x[2]"][-1] == pytest.approx(exact, abs=1e-8)
    found = api.compile_model(path, scene="s")
    at = found.t0, found.y0, found.yd0
    assert found.residual(*at, {"k": [2.0, 5.0, 2.0]}) == pytest.approx(found.residual(*at, {"k[2]": 5.0}), rel=1e-15)
    assert np.abs(found.residual(*at, {"k[2]": 5.0}) - found.residual(*at)).max() == pytest.approx(3.0, rel=1e-12)


def test_vectors_of_another_length(tmp_path):
    """The residual read beyond the end of a vector that was too short, and told a number."""
    found = api.compile_model(written(tmp_path, ROW), scene="s")
    for y, yd in ((found.y0[:2], found.yd0), (found.y0, found.yd0[:1]), (np.zeros(99), found.yd0)):
        with pytest.raises(ValueError, match=f"{found.y0.size} unknowns"):
            found.residual(0.0, y, yd)


def test_an_error_is_told_before_notes(tmp_path):
    with pytest.raises(api.ModelError, match=r"^E113") as caught:
        api.simulate(written(tmp_path, RLC), until="x y", output=tmp_path / "out.h5")
    assert len(caught.value.diagnostics) > 1
    with pytest.raises(api.UsageError, match="max-steps"):
        api.load(tmp_path / "model.sd").run(max_steps=-1)


def test_sizes_of_a_module(tmp_path):
    """Of coordinates alone another size has other vectors; in index form 0 the state is that of the text."""
    path = written(tmp_path, ROW)
    found = api.compile_model(path, scene="s", index="2")
    y = np.append(np.ones(5), np.zeros(5))
    assert np.abs(found.residual(0.0, y, np.zeros(10), {"n": 5})).max() == 2.0
    with pytest.raises(ValueError, match="10 unknowns"):
        found.residual(0.0, found.y0, found.yd0, {"n": 5})
    found = api.compile_model(path, scene="s", index="0")
    with pytest.raises(api.ModelError, match="index form 0"):
        found.residual(0.0, found.y0, found.yd0, {"n": 5})


def test_names_that_there_are_not(tmp_path):
    """A formulation was a KeyError, a backend of any name taken."""
    path = written(tmp_path, ROW)
    for call in (api.simulate, api.load, lambda path, **said: api.compile_model(path, scene="s", **said)):
        for said in ({"formulation": "lagrange"}, {"backend": "fortran"}, {"index": "9"}):
            with pytest.raises(api.UsageError, match=next(iter(said.values()))):
                call(path, **said)
    at = api.compile_model(path, scene="s", index=2)
    assert at.manifest["index"] == api.compile_model(path, scene="s", index="2").manifest["index"]
    assert api.simulate(path, index=2, output=tmp_path / "out.h5").time[-1] == 1.0
