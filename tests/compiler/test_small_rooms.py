"""Small rooms of the compiler by themselves."""

import io

import pytest
from sysdyn.compiler.binding.jumps import jumps
from sysdyn.compiler.model.parameters import Parameters
from sysdyn.compiler.network.sticking import as_relations
from sysdyn.dsl import load
from sysdyn.dsl.text.decoding import decode
from sysdyn.dsl.text.diagnostics import Report


def network_of(text):
    report = Report()
    document = load.document(decode("m.sd", io.BytesIO(text.encode())), report)
    network = load.network(document, document.models["m"], document.scenes["s"], report)
    assert not list(report.diagnostics), list(report.diagnostics)
    return network


MOVED = """model m {
  coord x: translation = 0 m
  let z = x + %s
  energy T* = 1/2*(2 kg)*z'^2
}
scene s of m { time 0 s to 5 s; trace x }
"""


@pytest.mark.parametrize(
    ("law", "codes"),
    [
        ("1 m*floor(t/(1 s) - 0.5)", ["E520"]),
        ("1 m*max(t/(1 s), 3)", []),  # branches meet: a kink, and a rate
        ("1 m*(if t < 2 s then t/(1 s) else 4 - t/(1 s))", []),
        ("1 m*(if t < 2 s then t/(1 s) else 3 - t/(1 s))", ["E520"]),
        ("1 m*(if t < 7 s then 0 else 1)", []),  # behind the span
    ],
)
def test_what_is_differentiated_may_bend_and_not_jump_within_the_span(law, codes):
    network = network_of(MOVED % law)
    assert [d.code for d in jumps(network, Parameters(network, {}), (0.0, 5.0))] == codes


BLOCK = """model m {
  coord x: translation = 0 m
  energy T* = 1/2*(2 kg)*x'^2
  work 3 N on x
  %s
}
scene s of m { time 0 s to 1 s; trace x }
"""


def test_dry_friction_is_one_unknown_and_its_relation():
    """c setsign(v) between bodies: s, closed by v = 0 while it sticks; a model without it is handed on as it is."""
    smooth, rough = (network_of(BLOCK % more) for more in ("", "content D = 4 N*abs(x')"))
    assert as_relations(smooth) is smooth
    found = as_relations(rough)
    assert len(found.unknowns) == len(rough.unknowns) + 1
    assert [s.kind for s in rough.switches] == ["friction"]
    assert [s.kind for s in found.switches] == ["relation"]
    assert len(found.parameters) == len(rough.parameters) + 1
