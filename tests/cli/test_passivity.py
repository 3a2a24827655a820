"""The certificate of `check --explain`: passive, lossless, or active with the element named; what proves it."""

import pytest
from sysdyn.cli.main import run
from texts import ROOT, run_json, write

SEED = ROOT / "models" / "seed"


def certified(capsys, path):
    code, found = run_json(capsys, "check", "--explain", str(path))
    assert code == 0, found["diagnostics"]
    return found["result"]["files"][0]["targets"][0]["passivity"]


VERDICTS = {
    "pendulum": ("lossless", True),
    "mass_spring": ("lossless", True),
    "mechanical_gyrator": ("lossless", True),
    "knife_edge": ("lossless", True),
    "two_link_arm": ("lossless", True),
    "lead_filter": ("passive", True),
    "dc_motor": ("passive", True),
    "diode_circuit": ("passive", True),
    "nonlinear_fluid": ("passive", True),
    "coulomb_slide": ("passive", True),
    "rectifier_motor_crank": ("passive", False),  # its motor is two implicit efforts
    "transactor_vcvs": ("active", False),
    "transactor_cccs": ("active", False),
    "integral_controller": ("active", False),
    "ebers_moll": ("active", False),
    "coulomb_planar": ("undecided", False),
}


@pytest.mark.parametrize("name", VERDICTS)
@pytest.mark.long
def test_the_verdict_of(name, capsys):
    found = certified(capsys, SEED / f"{name}.sd")
    verdict, proven = VERDICTS[name]
    assert found["verdict"] == verdict, found["lines"]
    assert verdict in ("active", "undecided") or found["proven"] == proven, found["lines"]


TEXT = """
model m {
  param a = 2 ohm
  param b = 0.3 V/A^3
  node s, n: electrical
  supply: effort(e = 5 V*sin(3 rad/s*t)) s -> ground
  r: dissipator(e = LAW) s -> n
  c: potential(q = CAP*e) n -> ground
  l: kinetic(p = 2 H*f) n -> ground
}
scene x of m { time 0 s to 1 s; trace n.e }
"""


@pytest.mark.parametrize(
    ("law", "cap", "verdict", "role", "how"),
    [
        ("a*f + b*f^3", "1 F", "passive", "dissipates", "intervals"),
        ("a*f*exp(-(f/(1 A))^2)", "1 F", "passive", "dissipates", "intervals"),
        ("(1 V)*sinh(f/(2 A))", "1 F", "passive", "dissipates", "intervals"),
        ("a*f*(2 + cos(f/(1 A)))", "1 F", "passive", "dissipates", "intervals"),
        # positive, though by intervals of its two terms nothing is known
        ("a*f*((f/(1 A))^2 - 1.9*f/(1 A) + 1)", "1 F", "passive", "dissipates", "sampled"),
        ("0*a*f", "1 F", "lossless", "conserves", "intervals"),
    ],
)
@pytest.mark.one_in(12)
def test_a_law_is_proven_or_sampled(law, cap, verdict, role, how, tmp_path, capsys):
    found = certified(capsys, write(tmp_path, TEXT.replace("LAW", law).replace("CAP", cap)))
    (r,) = [e for e in found["elements"] if e["name"] == "r"]
    assert r.keys() == {"name", "role", "how", "said"}  # and not the place, which holds the whole text
    assert (found["verdict"], r["role"], r["how"]) == (verdict, role, how)
    assert found["proven"] == (how != "sampled")
    assert {e["name"] for e in found["elements"] if e["role"] == "port"} == {"supply"}


ACTIVE = {
    "a negative damper as content": ("content D = -1/2*(0.5 N.s/m)*x'^2", "content of line 6"),
    "an exponent that is a parameter": ("param n: 1 = 3; content D = 1 W*(x'/(1 m/s))^n", "content of line 6"),
    "van der Pol": ("work 1 N.s/m*x' - 1 N.s^3/m^3*x'^3 on x", "work of line 6"),
    "a follower force": ("work 3 N/m*y on x", "work of line 6"),
    "negative damping as work": ("work 2 N.s/m*x' on x", "work of line 6"),
    "a spring that is stiffened": ("energy V = 1/2*(1 N/m + 1 N/m*sin(2 rad/s*t))*x^2", "energy of line 6"),
}


@pytest.mark.parametrize("name", ACTIVE)
def test_the_active_element_is_named(name, tmp_path, capsys):
    statement, element = ACTIVE[name]
    text = f"""model m {{
  coord x: translation = 0.1 m
  coord y: translation
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  energy V = 1/2*(4 N/m)*(x^2 + y^2)
  {statement}
}}
scene s of m {{ time 0 s to 1 s; trace x }}
"""
    found = certified(capsys, write(tmp_path, text))
    assert found["verdict"] == "active", found["lines"]
    assert [e["name"] for e in found["elements"] if e["role"] == "active"] == [element]


@pytest.mark.long
def test_works_that_only_exchange_power_conserve_it(tmp_path, capsys):
    """A magnetic force: each work alone supplies, both together nothing."""
    text = """model m {
  coord x, y: translation = 0.1 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  energy V = 1/2*(4 N/m)*(x^2 + y^2)
  work 3 N.s/m*y' on x
  work -3 N.s/m*x' on y
}
scene s of m { time 0 s to 1 s; trace x }
"""
    found = certified(capsys, write(tmp_path, text))
    assert found["verdict"] == "lossless"
    assert not found["proven"]


def test_the_words_on_the_terminal(tmp_path, capsys):
    assert run(["check", "--explain", str(SEED / "dc_motor.sd")]) == 0
    out, _ = capsys.readouterr()
    assert "passive (proven): H rises by no more than what the ports supply; ports: supply" in out
    assert "winding: dissipates, intervals: e f >= 0 over all values" in out
