"""Laws whose slope is zero with the values given have no inverse: they hold a variable instead."""

import pytest
from model_runs import FOUR, attempt, trace_of
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.load import document, network
from sysdyn.dsl.text.diagnostics import ModelError, Report, SourceText

MODEL = """
model machine {
  param R = 1 ohm
  param C = 0.5 F
  param m = 1 kg
  param d = 0.5 N.s/m
  node a, b: electrical
  node x: translation
  supply: effort(e = 1 V*sin(1 rad/s*t)) a -> ground
  Rs: dissipator(e = R*f) a -> b
  Cb: potential(q = C*e) b -> ground
  L: kinetic(p = 1 H*f) b -> ground
  coil: gyrator(e1 = (2 V.s/m)*f2) b -> ground, x -> ground
  mass: kinetic(p = m*f) x
  rub: dissipator(e = d*f) x -> ground
  init L.f = 0 A
}
scene go of machine {
  time 0 s to 3 s
  accuracy 1e-6
  trace b.e, Rs.f, x.f every 0.1 s
}
"""


def _text(what):
    if what == "literal":
        return MODEL.replace("e = d*f", "e = (0 N.s/m)*f")
    unit = {"R": "ohm", "C": "F", "m": "kg", "d": "N.s/m"}[what]
    return MODEL.replace("scene go of machine {", f"scene go of machine {{\n  set {what} = 0 {unit}")


@pytest.mark.parametrize("formulation", FOUR[2:])
@pytest.mark.parametrize("what", ["R", "C", "m", "d", "literal"])
@pytest.mark.one_in(3)
def test_a_flat_law_in_the_complementary_forms(tmp_path, what, formulation):
    found, expected = (trace_of(tmp_path, _text(what), formulation=f) for f in (formulation, "lagrangian"))
    for name in ("b.e", "Rs.f", "x.f"):
        assert found[name].values == pytest.approx(expected[name].values, abs=1e-4), name


def _compiled(what):
    report = Report()
    read = document(SourceText("machine", _text(what)), report)
    net = network(read, read.models["machine"], read.scenes["go"], report)
    assert net is not None, list(report)
    return compile_network(net, "co_lagrangian")


@pytest.mark.parametrize(
    ("what", "values", "said"),
    [
        ("d", {"R": 0.0}, "the law of Rs cannot be inverted: R is zero"),
        ("d", {"d": 2.0}, "the law of rub was compiled for d = 0, which is now 2"),
    ],
)
def test_a_binding_keeps_what_was_inverted(what, values, said):
    compiled = _compiled(what)
    compiled.bind({"R": 3.0})
    with pytest.raises(ModelError) as error:
        compiled.bind(values)
    assert [(d.code, d.message) for d in error.value.diagnostics] == [("E605", said)]


def test_a_modulus_of_zero_is_named(tmp_path):
    text = MODEL.replace("param R = 1 ohm", "param R = 1 ohm\n  param k = 0 V.s/m").replace("2 V.s/m", "k")
    ran, report = attempt(tmp_path, text, formulation="co_lagrangian")
    assert ran is None
    said = [(d.code, d.message) for d in report if d.severity == "error"]
    assert said == [("E605", "the law of coil cannot be inverted: k is zero")]
    trace_of(tmp_path, text, formulation="co_lagrangian", settings=(("k", "1"),))


def test_an_array_with_one_flat_law(tmp_path):
    text = """
    model chain {
      param R[1..3] = [1 ohm, 0 ohm, 2 ohm]
      node v[0..3]: electrical
      supply: effort(e = 1 V) v[0] -> ground
      for i in 1..3 {
        Rs[i]: dissipator(e = R[i]*f) v[i - 1] -> v[i]
        C[i]: potential(q = (1 F)*e) v[i] -> ground
      }
    }
    scene go of chain {
      time 0 s to 1 s
      trace v[3].e
    }
    """
    ran, report = attempt(tmp_path, text, formulation="co_lagrangian")
    assert ran is None
    assert [d.code for d in report if d.severity == "error"] == ["E605"]
    assert trace_of(tmp_path, text, formulation="lagrangian")["v[3].e"].values[-1] > 0.0
