"""`--dump energies` in the letters of the family: what is T* of charges is V* of flux linkages."""

import re

import pytest
from sysdyn.cli.main import run

RLC = """from std.electrical import resistor, inductor, capacitor, voltage
model rlc {
  node a, b, c: electrical
  V: voltage(v = 1 V) a -> ground
  R: resistor(R = 1 ohm) a -> b
  L: inductor(L = 2 H) b -> c
  C: capacitor(C = 3 F) c -> ground
}
scene s of rlc {
  time 0 s to 1 s
  trace c.e
}
"""
PRIMAL = {"D": "0.5*R.R*C'^2", "T*": "0.5*L.L*C'^2", "V": "0.5*C^2/C.C"}
COMPLEMENTARY = {"G": "0.5*(a' - b')^2/R.R", "T": "0.5*(b - c)^2/L.L", "V*": "0.5*C.C*c'^2"}


@pytest.mark.parametrize(
    ("formulation", "functions", "kind"),
    [
        ("lagrangian", PRIMAL, "coordinate"),
        ("hamiltonian", PRIMAL, "coordinate"),
        ("kane", PRIMAL, "coordinate"),
        ("co_lagrangian", COMPLEMENTARY, "cocoordinate"),
        ("co_hamiltonian", COMPLEMENTARY, "cocoordinate"),
        ("co_kane", COMPLEMENTARY, "cocoordinate"),
    ],
)
@pytest.mark.one_in(3)
def test_state_functions_have_the_names_of_their_family(formulation, functions, kind, tmp_path, capsys):
    """The coil's energy is T of the flux linkage, the capacitor's V* of the voltage, the resistor's cocontent G."""
    path = tmp_path / "rlc.sd"
    path.write_text(RLC)
    assert run(["compile", str(path), "--formulation", formulation, "--dump", "energies"]) == 0
    out = capsys.readouterr().out
    assert dict(re.findall(r"^(\S+) \+= (.*)$", out, re.MULTILINE)) == functions
    assert set(re.findall(r"^(co\w*) \w", out, re.MULTILINE)) == {kind}
    assert run(["compile", str(path), "--formulation", formulation, "--dump", "coordinates"]) == 0
    stage = capsys.readouterr().out
    if formulation.startswith("co_"):  # as the stage before it
        assert all(f"  {name} += {text}" in stage for name, text in functions.items())
