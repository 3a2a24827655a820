"""Components that no model of their file uses are judged too: `check` of a file of parts looked at nothing."""

from pathlib import Path

import pytest
from sysdyn import api, dsl
from sysdyn.dsl import load, unused_components
from sysdyn.dsl.text.diagnostics import Report, SourceText

LIBRARY = sorted((Path(dsl.__file__).parent / "std").glob("*.sd"))
PARTS = """
from std.electrical import resistor, capacitor, piecewise_voltage

component stage {
  param R: ohm
  port a, b: electrical
  R1: resistor(R = R) a -> b
  C1: capacitor(C = 1 H) b -> ground
}

component row {
  param n: 1
  param at[1..n]: s
  port p[0..n]: electrical
  input u: $u
  V: piecewise_voltage(n = n, at = at, v = [0 V, 1 V, 2 V]) p[0] -> p[n]
  for i in 1..n { R[i]: resistor(R = 1 kohm) p[i-1] -> p[i] }
  output twice = 2*u
  branch coil, core: electrical
  law coil.e = 1 ohm*coil.f
  law core.e = 1 V*core.f
}

component levelled {
  port a: translation
  level rough default { K: potential(e = 1 N/m*q) a -> ground }
  level fine extends rough { D: dissipator(e = 1 N/m*f) a -> ground }
}

component used {
  branch: electrical
  law e = 1 ohm*f
}
"""
USER = "model m {\n  node a: electrical\n  U: used() a -> ground\n  V: effort(e = 1 V) a -> ground\n}\n"


@pytest.mark.parametrize("file", LIBRARY, ids=lambda file: file.stem)
@pytest.mark.one_in(12)
def test_every_component_of_the_library_is_sound_alone(file):
    document = load.read(file, Report())
    assert {name: list(own) for name, own in unused_components.check_unused_components(document)} == {
        p.name.name: [] for p in unused_components.unused_components(document.file)
    }


@pytest.mark.parametrize("more", ["", USER])
def test_what_is_wrong_in_parts_is_found(more):
    """Wrong units in an element, in a law and at a level that is not the default, each once."""
    found = [(d.code, d.place.source.text[d.place.span.start : d.place.span.end]) for d in api.check(PARTS + more)]
    assert found == [("E214", "C = 1 H"), ("E208", "1 V*core.f"), ("E208", "1 N/m*f")]


def test_what_a_model_uses_is_judged_there():
    document = load.document(SourceText("m.sd", PARTS + USER), Report())
    assert [part.name.name for part in unused_components.unused_components(document.file)] == [
        "stage",
        "row",
        "levelled",
    ]
