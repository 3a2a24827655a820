"""Laws whose slope is zero with the values given have no inverse: they hold a variable instead."""

import numpy as np
import pytest
from model_runs import FOUR, attempt, trace_of
from scipy.integrate import solve_ivp
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
@pytest.mark.long
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


_GYRATOR = "gyrator(e1 = (2 V.s/m)*f2)"


@pytest.mark.parametrize(("law", "parameter"), [("e1 = k*f2", "k = {} V.s/m"), ("f2 = k*e1", "k = {} m/V/s")])
@pytest.mark.long
def test_a_modulus_of_zero_is_a_short_circuit_or_open(tmp_path, law, parameter):
    """The primal forms divide by a transconductance, the others by a transresistance: zero in the text, or set."""
    text = MODEL.replace(_GYRATOR, f"gyrator({law})")
    zero, two = (text.replace("param R", f"param {parameter.format(k)}\n  param R") for k in "02")
    alone = trace_of(tmp_path, MODEL.replace(f"coil: {_GYRATOR} b -> ground, x -> ground", ""))["b.e"].values
    for formulation in FOUR:
        for text, settings in ((zero, ()), (two, (("k", "0"),))):
            trace = trace_of(tmp_path, text, formulation=formulation, settings=settings)
            assert np.abs(trace["b.e"] - (0.0 if law.startswith("e1") else alone)).max() < 1e-6, formulation
            assert not trace["x.f"].values.any(), formulation


def test_a_modulus_passes_zero_where_its_law_is_turned(tmp_path):
    """b.e of two capacitors C b' = u - b - g c, C c' = g b with g = sin(2 t): it passes zero, at the start too."""
    text = """
    model amplifier {
      node a, b, c: electrical
      supply: effort(e = 2 V*cos(3 rad/s*t)) a -> ground
      Rs: dissipator(e = 1 ohm*f) a -> b
      Cb: potential(q = 1 F*e) b -> ground
      Y: gyrator(f1 = 1 S*sin(2 rad/s*t)*e2) b -> ground, c -> ground
      Cc: potential(q = 1 F*e) c -> ground
    }
    scene go of amplifier {
      time 0 s to 4 s
      accuracy 1e-8
      trace b.e, c.e every 0.1 s
    }
    """

    def rates(t, y):
        return 2 * np.cos(3 * t) - y[0] - np.sin(2 * t) * y[1], np.sin(2 * t) * y[0]

    for formulation in FOUR:
        trace = trace_of(tmp_path, text, formulation=formulation)
        b, c = solve_ivp(rates, (0, 4), (0, 0), rtol=1e-11, atol=1e-12, t_eval=trace.time).y
        assert max(np.abs(trace["b.e"] - b).max(), np.abs(trace["c.e"] - c).max()) < 1e-8, formulation


@pytest.mark.long
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
    last = [trace_of(tmp_path, text, formulation=f)["v[3].e"].values[-1] for f in FOUR]
    assert last == pytest.approx([last[0]] * 4, rel=1e-3)
    assert last[0] > 0.0


@pytest.mark.long
def test_an_inductor_of_zero_between_nodes_is_a_wire(tmp_path):
    """A fault in sysdyn in the complementary forms: what holds nothing was guessed to hold nothing."""
    text = MODEL.replace("param R", "param L0 = 0 H\n  param R").replace(
        "a -> b", "a -> w\n  L0_: kinetic(p = L0*f) w -> b"
    )
    text = text.replace("node a, b", "node a, b, w")
    alone = trace_of(tmp_path, MODEL)["b.e"].values
    for formulation in FOUR:
        assert np.abs(trace_of(tmp_path, text, formulation=formulation)["b.e"] - alone).max() < 1e-6, formulation


@pytest.mark.parametrize("given", ["param", "discrete"])
@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(12)
def test_what_is_fixed_of_a_store_that_holds_nothing_is_not_forgotten(tmp_path, formulation, given):
    """A capacitor of 0 F at 1 V where a divider says 3 V: all forms had begun at 3 V without a word."""
    text = f"""
    model divider {{
      {given} C0 = 0 F
      node a, b: electrical
      supply: effort(e = 5 V) a -> ground
      upper: dissipator(e = 2 ohm*f) a -> b
      lower: dissipator(e = 3 ohm*f) b -> ground
      C: potential(q = C0*e) b -> ground
      init C.e = 1 V
    }}
    scene go of divider {{
      time 0 s to 1 s
      trace b.e
    }}
    """
    ran, report = attempt(tmp_path, text, formulation=formulation)
    assert ran is None
    assert [d.code for d in report if d.severity == "error"] == ["E903"]
    trace = trace_of(tmp_path, text.replace("C.e = 1 V", "C.e = 3 V"), formulation=formulation)
    assert trace["b.e"].values == pytest.approx(3.0, abs=1e-9)
