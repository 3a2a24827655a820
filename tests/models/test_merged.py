"""What is said of nodes that have merged, and of families of nodes of which a store each is a statement of its own."""

import numpy as np
import pytest
from model_runs import FOUR, attempt, trace_of


@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_a_sum_over_merged_nodes(tmp_path, backend):
    """The effort of each is a sum along the ladder, whose bounds follow the outer index."""
    text = """
    model ladder {
      param n = 3
      node m[0..n]: electrical
      V: effort(e = 1 V) m[0] -> ground
      for i in 1..n {
        R[i]: dissipator(e = 0.5 ohm*f) m[i - 1] -> m[i]
      }
      C: potential(q = 0.7 F*e) m[n] -> ground
      init C.e = 0.1 V
    }
    scene go of ladder {
      time 0 s to 1 s
      accuracy 1e-6
      trace sum(i in 1..n: m[i].e^2) as squares every 0.1 s
    }
    """
    trace = trace_of(tmp_path, text, backend=backend)
    across = 0.9 * np.exp(-trace.time / 1.05)
    nodes = [1.0 - across * k / 3.0 for k in (1, 2, 3)]
    assert trace["squares"].values == pytest.approx(sum(e**2 for e in nodes), rel=1e-5)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_nodes_of_one_family_are_joined_each_in_its_way(tmp_path, formulation):
    """Two masses, each written by itself: the constants of their integrated rows stand side by side."""
    text = """
    model pair {
      node x[1..2]: translation
      A: kinetic(p = 1 kg*f) x[1]
      B: kinetic(p = 2 kg*f) x[2]
      K: potential(e = 3 N/m*q) x[1] -> x[2]
      init x[1].f = 0.3 m/s
      init x[2].f = -0.2 m/s
      init K.q = 0.1 m
      state s: m/s = 0.1 m/s
      dynamic s' = (x[1].f - s)/(0.5 s)
    }
    scene go of pair {
      time 0 s to 1 s
      accuracy 1e-6
      trace x[1].f, x[2].f, K.q, s every 0.1 s
    }
    """
    trace = trace_of(tmp_path, text, formulation=formulation)
    w = np.sqrt(4.5)
    stretch = 0.1 * np.cos(w * trace.time) + 0.5 / w * np.sin(w * trace.time)
    assert trace["K.q"].values == pytest.approx(stretch, abs=1e-5)
    assert trace["x[1].f"].values + 2.0 * trace["x[2].f"].values == pytest.approx(-0.1 * np.ones(11), abs=1e-6)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("sign", ["=", "~"])
@pytest.mark.long
def test_capacitors_side_by_side_at_a_source(tmp_path, formulation, sign):
    """Their charges follow from the source: guesses move, fixed values that contradict it are named."""
    text = f"""
    model bank {{
      node b: electrical
      I: effort(e = 1 V) b -> ground
      for i in 1..3 {{
        C[i]: potential(e = 0.5 V/C*i*q) b -> ground
        init C[i].q {sign} 0.1 C
      }}
    }}
    scene go of bank {{
      time 0 s to 1 s
      trace b.e, C[3].q every 0.1 s
    }}
    """
    if sign == "~":
        assert trace_of(tmp_path, text, formulation=formulation)["C[3].q"].values == pytest.approx(2.0 / 3.0)
    else:
        ran, report = attempt(tmp_path, text, formulation=formulation)
        assert ran is None
        assert [d.code for d in report if d.severity == "error"] == ["E903"]
