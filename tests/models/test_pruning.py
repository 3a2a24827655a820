"""What a scene does not need is left out, and nothing that matters is.

The random models: `python tests/models/random_pruning.py 0 300` runs all of them; here a slice.
"""

import functools
import json
import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from model_runs import FOUR, attempt, trace_of
from random_pruning import compared
from sysdyn.cli.main import run as command
from sysdyn.compiler.network.pruning import prune_network
from sysdyn.dsl import load
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import Report, SourceText

PLANT = """
from std.electrical import resistor, capacitor, voltage
from std.mechanical import mass, spring, damper, force
from std.control import pid
from std.thermal import capacity, conductance
model m {
  node x: translation
  M: mass(m = 1 kg) x
  K: spring(k = 4 N/m) x
  B: damper(b = 0.4 N.s/m) x
  init x.q = 1 m
  init x.f = 0 m/s
  # more
}
scene s of m {
  time 0 s to 6 s
  trace x.q as q, x.f as v
}
"""
UNREAD = {
    "island": """
  node z: translation
  Mz: mass(m = 1 kg) z
  Kz: spring(k = 1e6 N/m) z
  init z.q = 1 m
""",
    "transactor": """
  node a, b: electrical
  Va: voltage(v = 1 V/m*x.q) a -> ground
  Ra: resistor(R = 1 ohm) a -> b
  Ca: capacitor(C = 1 uF) b -> ground
  init Ca.e = 0 V
""",
    "signal": """
  node z: translation
  Mz: mass(m = 1 g) z
  Fz: force(F = 1 N/(1 m/s)*x.f - 1e3 N/m*z.q) ground -> z
  init z.q = 0 m
  init z.f = 0 m/s
""",
    "controller": """
  ctl: pid(kp = 2 N/m, ki = 1 N/m/s, kd = 1 N.s/m, tau = 1 us, lo = -10 N, hi = 10 N, r = 1 m, y = x.q)
""",
    "heat": """
  node hot, cold: heat
  Ch: capacity(C = 1 J/K) hot -> ground
  Gh: conductance(G = 1e4 W/K) hot -> cold
  Cc: capacity(C = 1 mJ/K) cold -> ground
  Qh: flow(f = B.e*B.f) ground -> hot
  init Ch.e = 300 K
  init Cc.e = 300 K
""",
}
RULES = {"island": "island"}


def with_more(lines):
    return PLANT.replace("  # more\n", lines.strip("\n") + "\n")


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("name", UNREAD)
@pytest.mark.long
def test_an_unread_subsystem_costs_nothing(tmp_path, name, formulation):
    """The same steps within 2 as without it, the same trace, and the names of what is not there."""
    bare = _bare(formulation)
    found = trace_of(tmp_path, with_more(UNREAD[name]), formulation=formulation, backend="numpy")
    assert abs(found.statistics["steps"] - bare.statistics["steps"]) <= 2
    assert np.array_equal(found.time, bare.time)
    for quantity in ("q", "v"):
        assert np.max(np.abs(found[quantity].values - bare[quantity].values)) <= 1e-12
    with h5py.File(tmp_path / "trace.h5") as trace:
        said = bytes(trace.attrs["pruned"]).decode()
    assert said
    assert not set(said.split(", ")) & {"x", "M", "K", "B"}
    assert all(part.rule == RULES.get(name, "downstream") for part in _pruned(with_more(UNREAD[name]))[1])


@functools.cache
def _bare(formulation):
    with tempfile.TemporaryDirectory() as folder:
        return trace_of(Path(folder), PLANT, formulation=formulation, backend="numpy")


def _pruned(text, scene="s"):
    """What is left of a text under a scene, and what is not."""
    document, report = load.document(SourceText("m", text), Report()), Report()
    found = document.scenes[scene]
    network = load.network(document, load.model_of(document, found, report), found, report)
    assert network is not None, [d.message for d in report]
    return prune_network(network)


KEPT = {
    "read by a force": ("Fx: force(F = 0.1 N/V*b.e) ground -> x", "transactor"),
    "expected": ("expect always: abs(b.e) <= 10 V", "transactor"),
    "started together": ("let d = x.q - z.q\n init d = 0 m", "island"),
    "joined by a spring": ("Kxz: spring(k = 1 N/m) x -> z", "island"),
    "joined by a two-port": ("T: gyrator(e1 = 0.1*(1 V.s/m)*f2) b -> ground, x -> ground", "transactor"),
    "joined by an energy": ("energy V = 1/2*(1 N/m)*(x.q - z.q)^2", "island"),
    "joined by a constraint": ("psi tie: x.f - z.f = 0 m/s", "island"),
    "read by a signal in a constraint": (
        "input u: 1 = z.q/(1 m)\n node w: translation\n Mw: mass(m = 1 kg) w\n psi lever: x.f = (1 + u^2)*w.f",
        "island",
    ),
    "read by a gamma that acts": (
        "implicit h: N ~ 0 N\n gamma g: h = 0.1 N/V*b.e\n Fh: force(F = h) ground -> x",
        "transactor",
    ),
    "read by a state that acts": (
        "state h: V = 0 V\n dynamic h' = (b.e - h)/(1 s)\n Fh: force(F = 0.1 N/V*h) ground -> x",
        "transactor",
    ),
    "work on what is traced": ("work 0.1 N/V*b.e on x.q", "transactor"),
    "work on a branch": ("work 0.1 N/V*b.e on K.q", "transactor"),
    "read by an energy": (
        "state h: V = 0 V\n dynamic h' = (b.e - h)/(1 s)\n energy V = 1/2*(1 N/m/V)*(9 V + h)*x.q^2",
        "transactor",
    ),
    "joined along both": ("Ko: spring(k = 1 N/m) on x.q - z.q", "island"),
    "modulated element": ("Bm: dissipator(e = 0.1 N.s/m/V*(b.e + 9 V)*f) x -> ground", "transactor"),
}


@pytest.mark.parametrize("name", KEPT)
def test_what_acts_on_the_trace_is_kept(name):
    line, subsystem = KEPT[name]
    left, parts = _pruned(with_more(f"{UNREAD[subsystem]}  {line}\n"))
    assert parts == ()
    names = {b.name for b in left.branches}
    assert {"Va", "Ra", "Ca"} <= names or {"Mz", "Kz"} <= names


ISLES = """
model isles {
  coord x, y, z: translation = 1 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2 + z'^2)
  energy V = 1/2*(3 N/m)*x^2 + 1/2*(1e12 N/m)*y^2
  phi hold: z = 1 m
  work -(2 N/m)*x on z
  implicit u, w: N ~ 0 N
  gamma gu: u = 1 N/m*x
  gamma gw: w = 2*u
  expect static: dof == 2
}
scene sx of isles { time 0 s to 10 s; trace x }
scene sz of isles { time 0 s to 1 s; trace hold.multiplier }
scene su of isles { time 0 s to 1 s; trace u }
scene whole of isles { time 0 s to 0.01 ms; trace x, audit.energy }
scene silent of isles { time 0 s to 0.01 ms }
"""


@pytest.mark.parametrize(
    ("scene", "gone"),
    [("sx", "y z hold u w"), ("sz", "y u w"), ("su", "y z hold w"), ("whole", ""), ("silent", "")],
)
@pytest.mark.one_in(5)
def test_one_statement_over_islands_is_divided(tmp_path, scene, gone):
    ran, report = attempt(tmp_path, ISLES, scene=scene, backend="numpy")
    assert ran is not None, [d.message for d in report]
    assert ran.exit == 0, [d.message for d in report]  # the claim about the counts is of the whole model
    named = [name for part in ran.prepared.left_out for _, name in part.names]
    assert sorted(named) == sorted(gone.split())
    if scene == "sx":
        assert ran.outcome.statistics["steps"] < 200  # 469 067 with the stiff one


@pytest.mark.long
def test_no_prune_keeps_everything(tmp_path):
    ran, _ = attempt(tmp_path, ISLES, scene="sx", until="1e-6", no_prune=True)
    assert ran.prepared.left_out == ()
    assert {c.name for c in ran.prepared.network.coordinates} == {"x", "y", "z"}


OPEN = """
from std.electrical import resistor, capacitor, voltage, current
model m {
  node a, b, c, d: electrical
  V: voltage(v = 1 V*sin(t/(1 s))) a -> ground
  R1: resistor(R = 1 ohm) a -> b
  C1: capacitor(C = 1 F) b -> ground
  R2: resistor(R = 1 ohm) b -> c
  R3: resistor(R = 1 ohm) c -> d
  state w: V = 0 V
  dynamic w' = (d.e - w)/(1 s)
}
scene s of m { time 0 s to 5 s; trace b.e as e }
scene r of m { time 0 s to 5 s; trace b.e as e, d.e }
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(2)
def test_a_branch_that_ends_in_the_open_is_dead_where_nothing_reads_its_end(tmp_path, formulation):
    parts = _pruned(OPEN)[1]
    assert [(p.rule, [n for _, n in p.names]) for p in parts] == [
        ("downstream", ["w"]), ("dead branch", ["d", "R3"]), ("dead branch", ["c", "R2"])
    ]  # fmt: skip
    assert [n for p in _pruned(OPEN, "r")[1] for _, n in p.names] == ["w"]
    options = {"formulation": formulation, "at": "1,3,5", "backend": "numpy"}
    short = trace_of(tmp_path, OPEN, scene="s", **options)
    whole = trace_of(tmp_path, OPEN, scene="r", **options)
    for t in (1.0, 3.0, 5.0):
        a, b = (float(f["e"].values[np.flatnonzero(f.time == t)[0]]) for f in (short, whole))
        assert abs(a - b) <= 1e-3 * 0.8


ERRORS = {
    "E203": ("energy V = 1/2*(1 N/m)*y^2 + y", "energy"),
    "E101": ("energy V = 1/2*(1 N/m)*why^2", "name"),
    "E504": ("implicit h: N ~ 0 N\n work h on y", "no gamma"),
    "E517": ("phi one: y = 1 m\n phi two: y = 2 m\n phi three: y = 3 m", "rows"),
    "E325": ("K: potential(e = -(1 N/m)*q) on y", "sign"),
}


@pytest.mark.parametrize("code", ERRORS)
def test_an_error_in_a_pruned_part_stays_an_error(tmp_path, code):
    line = ERRORS[code][0]
    text = f"""
model m {{
  coord x, y: translation = 1 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  energy V = 1/2*(1 N/m)*x^2
  {line}
}}
scene s of m {{ time 0 s to 1 s; trace x }}
"""
    ran, report = attempt(tmp_path, text)
    assert ran is None
    assert code in {d.code for d in report if d.severity == "error"}


@pytest.mark.long
def test_the_start_of_a_pruned_part_is_not_asked_for(tmp_path, capsys):
    """`simulate` starts what it compiles; `check` starts the whole."""
    text = """
model m {
  coord x, y: translation = 1 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  energy V = 1/2*(1 N/m)*x^2
  phi far: y = 3 m
}
scene s of m { time 0 s to 1 s; trace x }
"""
    ran, report = attempt(tmp_path, text)
    assert ran is not None, list(report)
    assert ran.exit == 0
    assert command(["check", str(tmp_path / "model.sd"), "--json"]) == 1
    assert "E903" in {d["code"] for d in json.loads(capsys.readouterr().out)["diagnostics"]}


def test_explain_lists_what_was_left_out(tmp_path, capsys):
    (tmp_path / "model.sd").write_text(ISLES)
    assert command(["compile", str(tmp_path / "model.sd"), "--scene", "sx", "--explain", "-o", str(tmp_path)]) == 0
    said = capsys.readouterr()
    lines = [line for line in (said.out + said.err).splitlines() if line.startswith("8.7")]
    assert any("coordinate y" in line and "island" in line for line in lines)
    assert any("coordinate z" in line and "reads x" in line for line in lines)
    names = [u["name"] for u in json.loads((tmp_path / "manifest.json").read_text())["unknowns"]]
    assert names == ["x", "x'"]
    for more in ([], ["--scene", "sx", "--no-prune"]):
        assert command(["compile", str(tmp_path / "model.sd"), *more, "-o", str(tmp_path)]) == 0
        names = [u["name"] for u in json.loads((tmp_path / "manifest.json").read_text())["unknowns"]]
        assert {"y", "z", "hold.multiplier"} <= set(names)


LINE = """
from std.electrical import resistor, capacitor, voltage
model line {
  param n = 1000
  node v[0..n], a: electrical
  Va: voltage(v = 1 V*sin(3*t/(1 s))) a -> ground
  Ra: resistor(R = 1 ohm) a -> ground
  V: voltage(v = 1 V*sin(3*t/(1 s))) v[0] -> ground
  for i in 1..n {
    R[i]: resistor(R = 1 ohm) v[i - 1] -> v[i]
    C[i]: capacitor(C = 1 mF) v[i] -> ground
  }
}
scene s of line { time 0 s to 1 s; trace Ra.f as i }
"""


def test_unread_families_go_whole():
    left, parts = _pruned(LINE)
    assert [n for p in parts for _, n in p.names] == ["v", "V", "R", "C"]
    assert [b.name for b in left.branches] == ["Va", "Ra"]


@pytest.mark.long
def test_a_golden_keeps_the_structure_of_the_whole(tmp_path, capsys, monkeypatch):
    """What was recorded unpruned is still valid, and what the scene does not need is still watched."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.sd").write_text(with_more(UNREAD["transactor"].replace("1 uF", "1 F")))
    assert command(["golden", "record", "model.sd"]) == 0
    kept = json.loads(next((tmp_path / "golden").rglob("*.json")).read_text())["formulations"]
    assert any("Ca" in line for found in kept.values() for line in found["equations"])
    assert command(["golden", "check"]) == 0


def test_every_part_of_a_network_is_known_to_pruning():
    """A new kind of statement must be told to `influence.py` (and `pruning.py`) before it is listed here."""
    known = (
        "model place parameters tables coordinates unknowns states energies works constraints dynamics initials"
        " observations expectations statics goldens scene elements nodes branches couplings slopes quasis read"
        " discretes events switches levels speeds authors positions literal derived"
    )
    assert set(Network.__dataclass_fields__) == set(known.split())


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.one_in(12)
def test_random_models_agree_with_and_without(tmp_path, seed):
    assert compared(seed, tmp_path).worst <= 1.0


def test_a_quasi_velocity_of_what_is_not_asked_goes_with_it(tmp_path):
    """A skate that is traced beside one that is not: its closed form, in Kane's own unknowns."""
    text = """
model two {
  coord x, y: translation
  coord th: rotation
  coord X, Y: translation
  coord TH: rotation
  energy T* = 1/2*(2 kg)*(x'^2 + y'^2) + 1/2*(1 kg.m^2)*th'^2
  energy T* = 1/2*(3 kg)*(X'^2 + Y'^2) + 1/2*(1 kg.m^2)*TH'^2
  psi blade: x'*sin(th) - y'*cos(th) = 0
  psi other: X'*sin(TH) - Y'*cos(TH) = 0
  quasi v: m/s = x'*cos(th) + y'*sin(th)
  quasi V: m/s = X'*cos(TH) + Y'*sin(TH)
  work 4 N on x
  init x' = 1 m/s
  init th' = 0.5 rad/s
}
scene one of two { time 0 s to 2 s; trace x, th, v }
"""
    kept, whole = (trace_of(tmp_path, text, formulation="kane", no_prune=whole) for whole in (False, True))
    assert "X" in kept.attributes["pruned"]
    for name in ("x", "th", "v"):
        scale = np.abs(whole[name].values).max()
        assert np.abs(kept[name].values[-1] - whole[name].values[-1]) < 1e-4 * scale


BRIDGE = """
model m {
  node a, b, n, p, m: electrical
  V: effort(e = 10 V*sin(314 rad/s*t)) a -> n
  L: kinetic(p = 10 uH*f) a -> b
  D1: diode() b -> p
  D2: diode() n -> p
  D3: diode() m -> b
  D4: diode() m -> n
  C: potential(q = 1 mF*e) p -> m
  R: dissipator(e = 20 ohm*f) p -> m
  tie: dissipator(e = 1 Gohm*f) n -> ground
  init C.e = 0 V
}
component diode { branch: electrical; law f = e/(if e > 0 V then 20 mohm else 1 Mohm) }
scene s of m { time 0 s to 20 ms; trace C.e as v; accuracy 1e-5 }
"""
"""A source that only a resistor ties to the ground."""


def test_a_part_that_one_resistor_ties_to_the_ground_runs_as_if_it_floated(tmp_path):
    """The resistor stood beside the diodes with 1e-9 of their conductance (E516, E930)."""
    assert [n for p in _pruned(BRIDGE)[1] for _, n in p.names] == ["tie"]
    ends = [trace_of(tmp_path, BRIDGE, formulation=f)["v"].values[-1] for f in ("lagrangian", "co_lagrangian")]
    assert ends[0] == pytest.approx(ends[1], abs=2e-4)
    assert ends[0] > 5.0
