"""Small rooms of the language by themselves: order of dependence, claims that hold, tables that stop."""

import io

import pytest
from sysdyn.api import check
from sysdyn.dsl import load
from sysdyn.dsl.elaborate.scenes.stopping import drop_measuring_states
from sysdyn.dsl.model.dependence import in_order
from sysdyn.dsl.rules.lossless import WHAT
from sysdyn.dsl.text.decoding import decode
from sysdyn.dsl.text.diagnostics import Report


def test_names_stand_behind_what_they_use_and_circles_are_told():
    uses = {"a": "bc", "b": "d", "c": "d", "d": "", "x": "y", "y": "zx", "z": "y"}
    order, circles = in_order(uses, uses.__getitem__)
    assert sorted(order) == sorted(uses)
    assert all(order.index(one) < order.index(name) for name in "abcd" for one in uses[name])
    assert circles == [("y", "z", "y"), ("x", "y", "x")]


PORTS = """component pair {
  param R = 0 ohm
  port a, b: electrical
  lossless
  tie: dissipator(e = R*f) a -> b
}
model m {
  node x, y: electrical
  S: effort(e = 5 V) x -> ground
  C: potential(q = 1 F*e) y -> ground
  L: kinetic(p = 1 H*f) x -> y
  p: pair(R = %s) a = x, b = y
}
"""


@pytest.mark.parametrize(("resistance", "codes"), [("0 ohm", []), ("1e-3 ohm", ["E314"]), ("-1e-3 ohm", ["E314"])])
@pytest.mark.one_in(5)
def test_powers_of_a_lossless_component_add_up_to_zero(resistance, codes):
    """R f^2 is nothing at all currents where R is zero, whatever the law looks like."""
    found = [d for d in check(PORTS % resistance) if d.code == "E314"]
    assert [d.code for d in found] == codes
    assert all(WHAT["dissipator"] in d.message for d in found)


TABLE = """table T(t: s) -> N linear stop [ (0, 0), (2, 8) ]
model m {
  coord x: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2
}
scene s of m { time 0 s to 1 s; trace x, T(t) as pull }
"""


def test_a_table_that_a_trace_alone_reads_stops_the_run_by_a_state_of_its_own():
    """Which is gone again for whom no time passes."""
    report = Report()
    document = load.document(decode("m.sd", io.BytesIO(TABLE.encode())), report)
    network = load.network(document, document.models["m"], document.scenes["s"], report)
    assert not list(report.diagnostics)
    assert [s.name.startswith("T range") for s in network.states] == [True]
    still = drop_measuring_states(network)
    assert (still.states, still.dynamics) == ((), ())
    assert [o.name for o in still.observations] == ["x", "pull"]
    assert len(still.initials) == len(network.initials) - 1
