"""Efforts by class of a coordinate, momenta of all branches, drift: traced by name, against closed forms."""

import json

import numpy as np
import pytest
from sysdyn import api
from texts import run_json, write

PRIMAL = ("lagrangian", "hamiltonian")

ROD = """
model hanging {
  param m = 1.13 kg
  param l = 2.34 m
  coord x: translation = 1 m
  coord y: translation ~ -2 m
  energy T* = 1/2*m*(x'^2 + y'^2)
  energy V = m*g0*y
  content D = 1/2*(0.3 N.s/m)*x'^2
  phi rod: sqrt(x^2 + y^2) = l
  work 2 N*sin(3 rad/s*t) on x
}
scene s of hanging {
  time 0 s to 1 s
  trace x, y, x', y', rod.multiplier as k every 0.1 s
  trace x.inertial, x.potential, x.dissipative, x.source, x.implicit, x.constraint
  trace y.inertial, y.potential, y.constraint
  accuracy 1e-6
}
"""


def traced(path, **options):
    trace = api.simulate(str(path), backend="numpy", **options)
    return {name: trace[name].values for name in trace.names} | {"t": trace.time}


@pytest.mark.parametrize("formulation", PRIMAL)
def test_every_effort_class_of_a_pendulum_that_is_pushed(formulation, tmp_path):
    path = write(tmp_path, ROD)
    got = traced(path, formulation=formulation, output=str(tmp_path / "o.h5"))
    x, y, fx = got["x"], got["y"], got["x'"]
    close = {"rel": 1e-12, "abs": 1e-12}
    assert got["x.dissipative"] == pytest.approx(-0.3 * fx, **close)
    assert got["x.source"] == pytest.approx(2 * np.sin(3 * got["t"]), **close)
    assert got["x.potential"] == pytest.approx(0 * x, **close)
    assert got["x.implicit"] == pytest.approx(0 * x, **close)
    assert got["y.potential"] == pytest.approx(0 * x - 1.13 * 9.80665, **close)
    assert got["x.constraint"] == pytest.approx(-got["k"] * x / 2.34, **close)
    assert got["y.constraint"] == pytest.approx(-got["k"] * y / 2.34, **close)
    # Lagrange's principle: the efforts of a coordinate are in balance
    for c, kinds in (("x", ("potential", "dissipative", "source", "constraint")), ("y", ("potential", "constraint"))):
        others = sum(got[f"{c}.{kind}"] for kind in kinds)
        assert np.abs(got[f"{c}.inertial"] + others).max() < 1e-11
    # inertial: -m times the acceleration, by the slope of the flow on the circle's tangent
    along = (got["x.inertial"] * y - got["y.inertial"] * x) / 2.34
    driven = (got["x.source"] + got["x.dissipative"]) * y / 2.34 + 1.13 * 9.80665 * x / 2.34
    assert along == pytest.approx(-driven, rel=1e-10, abs=1e-10)


NETWORK = """
from std.mechanical import mass, spring, damper, force
model two {
  node a, b: translation
  M1: mass(m = 2 kg) a
  M2: mass(m = 3 kg) b
  K: spring(k = 50 N/m) a -> b
  K3: potential(e = 4 N/m^3*q^3) b
  B: damper(b = 0.7 N.s/m) a
  F: force(F = 2 N*sin(3 rad/s*t)) b
  init a.f = 1 m/s
}
scene s of two {
  time 0 s to 1 s
  trace a.q as qa, b.q as qb, a.f as fa, b.inertial, b.potential, b.source, a.dissipative, a.potential, a.inertial
  trace B.p, F.p, K.p every 0.25 s
  accuracy 1e-8
}
"""


@pytest.mark.parametrize("formulation", PRIMAL)
def test_efforts_at_the_nodes_of_a_network(formulation, tmp_path):
    path = write(tmp_path, NETWORK)
    got = traced(path, formulation=formulation, output=str(tmp_path / "o.h5"))
    qa, qb = got["qa"], got["qb"]
    assert got["a.potential"] == pytest.approx(-50 * (qa - qb), rel=1e-12, abs=1e-13)
    assert got["b.potential"] == pytest.approx(50 * (qa - qb) - 4 * qb**3, rel=1e-12, abs=1e-13)
    assert got["a.dissipative"] == pytest.approx(-0.7 * got["fa"], rel=1e-12, abs=1e-13)
    assert got["b.source"] == pytest.approx(-2 * np.sin(3 * got["t"]), rel=1e-12, abs=1e-13)
    assert np.abs(got["a.inertial"] + got["a.potential"] + got["a.dissipative"]).max() < 1e-11
    assert np.abs(got["b.inertial"] + got["b.potential"] + got["b.source"]).max() < 1e-11
    # p' = e of branches without a kinetic store, from zero
    assert got["B.p"] == pytest.approx(0.7 * qa, abs=1e-7)
    assert got["F.p"] == pytest.approx(2 / 3 * (1 - np.cos(3 * got["t"])), abs=1e-7)
    assert got["K.p"] == pytest.approx(2 * (1 - got["fa"]) - 0.7 * qa, abs=1e-6)


def test_efforts_of_an_array_with_an_implicit_effort(tmp_path):
    text = """
    model chain {
      param n = 3
      coord q[1..n]: translation = 0.1 m
      energy T* = sum(i in 1..n: 1/2*(2 kg)*q[i]'^2)
      energy V = sum(i in 1..n-1: 1/2*(7 N/m)*(q[i+1] - q[i])^2)
      implicit u: N
      gamma g: u = -3 N/m*q[1]
      work u on q[1]
      init q[2]' = 1 m/s
    }
    scene s of chain {
      time 0 s to 1 s
      trace q[1], q[2], q[3], q[2].potential as v2, q[1].implicit as u1, q[1].source as s1 every 0.5 s
      trace sum(i in 1..n: q[i].inertial + q[i].potential + q[i].implicit) as total
    }
    """
    got = traced(write(tmp_path, text), output=str(tmp_path / "o.h5"))
    assert got["v2"] == pytest.approx(-7 * (2 * got["q[2]"] - got["q[1]"] - got["q[3]"]), rel=1e-12, abs=1e-13)
    assert got["u1"] == pytest.approx(-3 * got["q[1]"], rel=1e-12)
    assert (got["s1"] == 0).all()
    assert np.abs(got["total"]).max() < 1e-12


@pytest.mark.long
def test_the_reaction_of_a_flow_constraint_is_its_effort(tmp_path):
    text = """
    model knife {
      coord x, y: translation = 0 m
      coord th: rotation = 0.4 rad
      energy T* = 1/2*(2 kg)*(x'^2 + y'^2) + 1/2*(0.5 kg.m^2)*th'^2
      psi edge: x'*sin(th) = y'*cos(th)
      work 1 N on x
      init x' = 1 m/s
      init th' = 0.7 rad/s
    }
    scene s of knife {
      time 0 s to 1 s
      trace th, edge.multiplier as mu, edge.on(x) as on every 0.2 s
      trace x.constraint as cx, y.constraint as cy, th.constraint as c3
    }
    """
    for formulation in (*PRIMAL, "kane"):
        got = traced(write(tmp_path, text), formulation=formulation, output=str(tmp_path / "o.h5"))
        assert got["cx"] == pytest.approx(-np.sin(got["th"]) * got["mu"], rel=1e-12)
        assert got["cy"] == pytest.approx(np.cos(got["th"]) * got["mu"], rel=1e-12)
        assert got["on"] == pytest.approx(got["cx"], rel=1e-12)
        assert (got["c3"] == 0).all()


CIRCUIT = """
model circuit {
  node a, b: electrical
  s: effort(e = 5 V) a -> ground
  r: dissipator(e = 10 ohm*f) a -> b
  c: potential(q = 1 mF*e) b -> ground
}
scene t of circuit {
  time 0 s to 50 ms
  trace r.p as p, s.p as sp, r.D as d, r.G as g, r.f as i every 10 ms
  accuracy 1e-8
}
"""


@pytest.mark.parametrize("formulation", [*PRIMAL, "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_the_momentum_content_and_cocontent_of_a_resistor(formulation, tmp_path):
    got = traced(write(tmp_path, CIRCUIT), formulation=formulation, output=str(tmp_path / "o.h5"))
    decay = np.exp(-got["t"] / 0.01)
    assert got["i"] == pytest.approx(0.5 * decay, abs=1e-8)
    assert got["p"] == pytest.approx(0.05 * (1 - decay), abs=1e-8)
    assert got["sp"] == pytest.approx(5 * got["t"], abs=1e-8)
    assert got["d"] == pytest.approx(5 * got["i"] ** 2, rel=1e-12)
    assert got["g"] == pytest.approx(got["d"], rel=1e-9)


@pytest.mark.long
def test_the_drift_is_what_a_projection_removes(tmp_path):
    text = ROD.replace("trace x, y,", "trace audit.drift as drift, audit.constraints as held, x, y,")
    path = write(tmp_path, text)
    largest = {}
    for method, rtol in (("bdf", 1e-3), ("bdf", 1e-6), ("dopri", 1e-3)):
        index = "1" if method == "bdf" else "auto"
        got = traced(path, method=method, index=index, rtol=rtol, output=str(tmp_path / "o.h5"))
        assert got["held"].max() < 1e-8
        assert got["drift"][0] < 1e-14
        largest[method, rtol] = got["drift"].max()
    assert 1e-7 < largest["bdf", 1e-3] < 1e-2
    assert largest["bdf", 1e-6] < 0.03 * largest["bdf", 1e-3]  # it follows the tolerance
    assert 0 < largest["dopri", 1e-3] < 1e-2


@pytest.mark.parametrize(
    ("text", "options", "code"),
    [
        (ROD.replace("work 2 N*sin(3 rad/s*t) on x", "work x.potential on y"), (), "E102"),
        (ROD.replace("x.inertial,", "x.inertia,"), (), "E102"),
        (NETWORK, ("--formulation", "co_lagrangian"), "E905"),
    ],
)
def test_what_no_effort_class_is(text, options, code, tmp_path, capsys):
    found = run_json(capsys, "simulate", str(write(tmp_path, text)), "--backend", "numpy", *options)[1]
    assert code in {d["code"] for d in found["diagnostics"]}


PORTS = """
component carriage {
  port p: translation
  port v: electrical
  node inner, far: translation
  energy V = 1/2*(100 N/m)*(p.q - inner.q)^2
  content D = 1/2*(2 N.s/m)*(p.f - inner.f)^2 + 0.5 N*abs(p.f)
  work 0.3 N*sin(10*t/(1 s)) on p.q
  phi lever: 2*p.q = far.q
  M: kinetic(p = 2 kg*f) inner
  H: kinetic(p = 0.1 kg*f) far
  K: potential(e = 30 N/m*q) on p.q^2/(1 m)
  R: dissipator(e = 3 ohm*f) v -> ground
}
component nested {
  port p: translation
  port v: electrical
  C: carriage() p = p, v = v
}
model rig {
  node x: translation
  node v: electrical
  M: kinetic(p = 1 kg*f) x
  F: effort(e = 4 N) ground -> x
  S: effort(e = 2 V) v
  X: nested() p = x, v = v
  init x.q = 0.1 m
  init x.f = 0.5 m/s
}
scene s of rig {
  time 0 s to 0.5 s
  trace M.energy, F.energy, energy_through(X.p) as port, energy_through(X.v) as heat
  accuracy 1e-6
}
"""


@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.long
def test_what_goes_through_a_port_counts_every_statement_inside(formulation, tmp_path):
    """State functions, friction, work, constraints, elements along expressions, of components within too: a node
    passes on what it is given.
    """
    got = traced(write(tmp_path, PORTS), formulation=formulation, output=str(tmp_path / "o.h5"))
    assert np.abs(got["port"]).max() > 0.1
    assert np.abs(got["port"] + got["M.energy"] + got["F.energy"]).max() < 1e-5 * np.abs(got["port"]).max()
    assert got["heat"] == pytest.approx(4.0 / 3.0 * got["t"], rel=1e-6)


@pytest.mark.parametrize("inside", ["energy T* = 1/2*(1 kg)*p.f^2", "phi stop: p.q >= -1 m"])
def test_a_port_whose_power_has_no_closed_form_is_refused(inside, tmp_path, capsys):
    text = (
        f"component part {{\n  port p: translation\n  {inside}\n}}\n"
        "model m {\n  node x: translation\n  A: part() p = x\n  M: kinetic(p = 1 kg*f) x\n  init x.q = 1 m\n}\n"
        "scene s of m {\n  time 0 s to 1 s\n  trace energy_through(A.p)\n}\n"
    )
    code, answer = run_json(capsys, "simulate", write(tmp_path, text))
    assert code == 1
    assert [d["code"] for d in answer["diagnostics"] if d["severity"] == "error"] == ["E608"]


@pytest.mark.parametrize("formulation", PRIMAL)
def test_what_a_port_carries_is_read_as_the_effort_or_the_flow(formulation, tmp_path):
    """All that is asked of the node: what is left of it moves the mass; the flow is that of the resistance."""
    traces = "trace X.p.e as e, X.v.f as i, M.e as m, F.e as f, X.p.e*X.p.f as power, energy_through(X.p) as w"
    text = PORTS.replace("trace M.energy, F.energy, energy_through(X.p) as port, energy_through(X.v) as heat", traces)
    got = traced(write(tmp_path, text), formulation=formulation, output=str(tmp_path / "o.h5"))
    assert np.ptp(got["e"]) > 1.0
    assert np.abs(got["e"] + got["m"] - got["f"]).max() < 1e-5 * np.abs(got["e"]).max()
    assert got["i"] == pytest.approx(2.0 / 3.0, rel=1e-9)
    work = np.concatenate([[0.0], np.cumsum(np.diff(got["t"]) * (got["power"][1:] + got["power"][:-1]) / 2)])
    assert got["w"] == pytest.approx(work, abs=0.02 * np.abs(work).max())


PIN = """
from std.mechanical import body2d, revolute2d
model pendulum {
  node b: planar
  B: body2d(m = 1.5 kg, J = 0.02 kg.m^2) cm = b
  P: revolute2d(ra = [0 m, 0 m], rb = [-0.2 m, 0 m]) a = ground, b = b
  init b.th.f = 3 rad/s
}
scene s of pendulum {
  time 0 s to 0.1 s
  trace P.b.x.e as x, P.b.y.e as y, b.th.q as th
  accuracy 1e-6
}
"""


@pytest.mark.long
def test_a_port_of_a_bundle_carries_the_force_of_a_pin(tmp_path):
    """Of a body at rest over its pin's side: m*(w^2*r) towards the pin, m*(g - a) upwards, both against the body's."""
    got = traced(write(tmp_path, PIN), output=str(tmp_path / "o.h5"))
    fall = 1.5 * 9.80665 * 0.2 / (0.02 + 1.5 * 0.2**2)
    assert got["x"][0] == pytest.approx(1.5 * 3.0**2 * 0.2, rel=1e-9)
    assert got["y"][0] == pytest.approx(-1.5 * (9.80665 - 0.2 * fall), rel=1e-9)


def test_what_can_be_read_of_ports_is_listed(tmp_path, capsys):
    code, answer = run_json(capsys, "list", write(tmp_path, PORTS))
    listed = json.dumps(answer["result"])
    assert code == 0
    assert "X.p.e" in listed
    assert "X.v.f" in listed


@pytest.mark.parametrize(
    ("was", "now", "said", "help_"),
    [
        ("P.b.x.e as x", "energy_through(P.b)", "'P.b' is a bundle of ports", "one of P.b.x, P.b.y, P.b.th"),
        ("P.b.x.e as x", "energy_through(b.x)", "'b.x' is no port of a component", "LABEL.PORT"),
        ("}\nscene", "  let F = P.b.x.e\n}\nscene", "what goes through a port is a result", "LABEL.PORT.e"),
    ],
)
def test_what_is_no_port_is_told(was, now, said, help_, tmp_path, capsys):
    code, answer = run_json(capsys, "check", write(tmp_path, PIN.replace(was, now, 1)))
    assert code == 1
    (found,) = [d for d in answer["diagnostics"] if d["severity"] == "error"]
    assert found["code"] == "E102"
    assert said in found["message"]
    assert help_ in found["help"]


LEVER = """
model lever {
  node x, y: translation
  A: kinetic(p = 1 kg*f) x
  B: kinetic(p = 2 kg*f) y
  T: transformer(f1 = (2 + sin(3*t/(1 s)))*f2) x -> ground, y -> ground
  F: effort(e = 4 N) ground -> x
  init x.f = 1 m/s
}
scene s of lever {
  time 0 s to 1 s
  trace T.power, T.energy, T.e1*T.f1 as one, A.energy
}
"""


@pytest.mark.parametrize("formulation", [*PRIMAL, "co_lagrangian", "co_hamiltonian"])
@pytest.mark.one_in(2)
def test_a_two_port_absorbs_nothing(formulation, tmp_path):
    """Any element has a power and an energy; those of a transformer, however its ratio moves, are zero."""
    got = traced(write(tmp_path, LEVER), formulation=formulation, output=str(tmp_path / "o.h5"))
    assert np.abs(got["one"]).max() > 1.0
    assert np.abs(got["T.power"]).max() < 1e-10 * np.abs(got["one"]).max()
    assert np.abs(got["T.energy"]).max() < 1e-4 * np.abs(got["A.energy"]).max()


ARRAYS = """
from std.electrical import resistor, capacitor, voltage
component pair {
  param R: ohm
  port p, n: electrical
  node m: electrical
  for i in 1..2 { Rs[i]: resistor(R = i*R) p -> m }
  C: capacitor(C = 1 mF) m -> n
  init C.e = 0 V
}
component row {
  port l, r: electrical
  node v[0..3]: electrical
  A: resistor(R = 0.1 ohm) l -> v[0]
  for i in 1..2 { S[i]: pair(R = i*1 ohm) p = v[i-1], n = v[i] }
  for i in 3..3 { S[i]: pair(R = 7 ohm) p = v[i-1], n = v[i] }
  B: resistor(R = 0.2 ohm) v[3] -> r
}
model m {
  node a: electrical
  V: voltage(v = 5 V) a
  for j in 1..2 { X[j]: row() l = a, r = ground }
}
scene s of m {
  time 0 s to 20 ms
  trace V.f + sum(j in 1..2: X[j].l.f) as node, X[2].B.f as i
  trace X[2].S[1].p.f as p1, X[2].S[2].p.f as p2, X[2].S[3].p.f as p3, X[2].S[3].n.f as n3
  trace energy_through(X[1].l) + energy_through(X[1].r) as whole
  trace X[1].A.energy + X[1].B.energy + sum(i in 1..3: X[1].S[i].C.energy) as some
  trace sum(i in 1..3: sum(k in 1..2: X[1].S[i].Rs[k].energy)) as others
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian"])
@pytest.mark.long
def test_ports_of_arrays_of_components_within_each_other(formulation, tmp_path):
    got = traced(write(tmp_path, ARRAYS), formulation=formulation, output=str(tmp_path / "o.h5"))
    i = got["i"]
    assert i.max() > 0.1
    assert np.abs(got["node"]).max() < 1e-9
    for name in ("p1", "p2", "p3"):
        assert got[name] == pytest.approx(i, abs=1e-9)
    assert got["n3"] == pytest.approx(-i, abs=1e-9)
    assert got["whole"] == pytest.approx(got["some"] + got["others"], rel=1e-5, abs=1e-12)
    assert got["whole"][-1] > 0.005


def test_arrays_of_ports(tmp_path):
    """Three sources over a star of resistors: its middle stands at 39/11 V."""
    text = """
    from std.electrical import resistor, voltage
    component star {
      port p[1..3]: electrical
      node m: electrical
      for i in 1..3 { R[i]: resistor(R = i*1 ohm) p[i] -> m }
    }
    component cart {
      port x[1..2]: translation
      M: kinetic(p = 2 kg*f) x[1]
      K: potential(e = 5 N/m*q) x[1] -> x[2]
    }
    model m {
      node v[1..3]: electrical
      node x[1..2]: translation
      V: voltage(v = 5 V) v[1]
      W: voltage(v = 3 V) v[2]
      U: voltage(v = 0 V) v[3]
      for k in 1..2 { S[k]: star() p = v }
      C: cart() x = x
      M: kinetic(p = 2 kg*f) x[2]
      init x[1].q = 1 m
    }
    scene s of m {
      time 0 s to 20 ms
      trace S[1].p[1].f as a, sum(k in 1..2: S[k].p[2].f) as b, sum(j in 1..3: S[2].p[j].f) as c
      trace C.x[1].e as left, C.x[2].e as right, C.K.e as spring, energy_through(C.x[2]) as work, M.energy as gained
    }
    """
    got = traced(write(tmp_path, text), output=str(tmp_path / "o.h5"))
    middle = 39 / 11
    assert got["a"] == pytest.approx(5 - middle, rel=1e-9)
    assert got["b"] == pytest.approx(2 * (3 - middle) / 2, rel=1e-9)
    assert np.abs(got["c"]).max() < 1e-12
    assert np.abs(got["left"]).max() < 1e-9  # nothing else is at the first cart
    assert got["right"] == pytest.approx(-got["spring"], rel=1e-12)
    assert got["work"] == pytest.approx(-got["gained"], rel=1e-4, abs=1e-9)


def test_what_acts_on_an_array_of_ports_by_a_statement_is_refused(tmp_path, capsys):
    text = """
    component hook {
      port x[1..2]: translation
      energy V = 1/2*(3 N/m)*(x[1].q - x[2].q)^2
    }
    model m {
      node x[1..2]: translation
      H: hook() x = x
      for i in 1..2 { M[i]: kinetic(p = 2 kg*f) x[i] }
      init x[1].q = 1 m
    }
    scene s of m { time 0 s to 1 s; trace H.x[1].e }
    """
    code, answer = run_json(capsys, "simulate", write(tmp_path, text))
    assert code == 1
    assert "acts on this array of ports" in answer["diagnostics"][0]["message"]


@pytest.mark.parametrize("formulation", [*PRIMAL, "kane"])
def test_an_inertia_at_a_port_takes_the_rate_of_its_momentum(formulation, tmp_path):
    text = """
    component cart {
      port x: translation
      energy T* = 1/2*(2 kg)*(1 + (x.q/(1 m))^2)*x.f^2
      energy V = 1/2*(3 N/m)*x.q^2
    }
    model m {
      node x: translation
      C: cart() x
      K: potential(e = 10 N/m*q) x
      B: dissipator(e = 1 N.s/m*f) x
      init x.q = 1 m
      init x.f = 0 m/s
    }
    scene s of m { time 0 s to 2 s; trace C.x.e as port, K.e + B.e as others }
    """
    got = traced(write(tmp_path, text), formulation=formulation, output=str(tmp_path / "o.h5"))
    assert np.abs(got["port"]).max() > 1.0
    assert got["port"] == pytest.approx(-got["others"], abs=1e-9)


def test_two_arrays_of_ports_at_one_array_of_nodes_are_not_told_apart(tmp_path, capsys):
    text = """
    component both {
      port p[1..2], q[1..2]: electrical
      R: dissipator(e = 2 ohm*f) p[1] -> q[2]
    }
    model m {
      node v[1..2]: electrical
      V: effort(e = 5 V) v[1]
      W: effort(e = 3 V) v[2]
      S: both() p = v, q = v
    }
    scene s of m { time 0 s to 1 s; trace S.p[1].f }
    """
    code, answer = run_json(capsys, "simulate", write(tmp_path, text))
    assert code == 1
    assert "'p' and 'q' are at one node" in answer["diagnostics"][0]["message"]
