"""`sysdyn import`: netlists against closed forms and, where it is installed, ngspice; hostile texts."""

import json
import math
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.cli.main import run
from sysdyn.cli.spice.netlist import UnreadableCard, number, value
from sysdyn.cli.spice.writing import quantity

NETLISTS = Path(__file__).with_name("netlists")


@pytest.mark.parametrize(
    ("text", "wanted"),
    [("4.7k", 4.7e3), ("10meg", 1e7), ("0.1n", 1e-10), ("100nF", 1e-7), ("1e-3", 1e-3), ("2.5MEGohm", 2.5e6),
     ("1m", 1e-3), ("-3.3", -3.3), ("1.5e3k", 1.5e6), ("1mil", 25.4e-6), (".5u", 5e-7), ("2f", 2e-15), ("x", None),
     ("1..2", None)],
)  # fmt: skip
def test_numbers(text, wanted):
    assert number(text) == wanted


@pytest.mark.parametrize(
    ("text", "wanted"),
    [("{2*r + 1k}", 1200.0), ("'sqrt(r)^2'", 100.0), ("{1/(2*pi*r)}", 0.5e-2 / math.pi), ("{-r}", -100.0)],
)
def test_expressions(text, wanted):
    assert value(text, {"r": 100.0}) == pytest.approx(wanted, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    ["{__import__('os').system('x')}", "{r.__class__}", "{(lambda: 1)()}", "{[1][0]}", "{'a'}", "{zz}", "{1/0}",
     "{9^9^9^9}", "{" + "(" * 300, "{r if r else 1}", "{f(1)}", "{1;2}", "{" + "1+" * 400 + "1}"],
)  # fmt: skip
def test_hostile_expressions_are_refused(text):
    with pytest.raises(UnreadableCard):
        value(text, {"r": 1.0})


def test_quantities_read_as_a_person_writes_them():
    assert [quantity(x, "ohm") for x in (4700.0, 1e-3, 0.0, 1e6, 123456.789)] == [
        "4.7 kohm", "1 mohm", "0 ohm", "1 Mohm", "123456.789 ohm",
    ]  # fmt: skip


def imported(netlist, folder, capsys):
    out = folder / "model.sd"
    code = run(["import", str(netlist), "-o", str(out), "--json"])
    return code, json.loads(capsys.readouterr().out), out


def traces(name, folder, capsys, accuracy=1e-7):
    code, found, out = imported(NETLISTS / f"{name}.cir", folder, capsys)
    assert code == 0, found["diagnostics"]
    assert run(["check", str(out), "--strict"]) == 0, capsys.readouterr()
    assert run(["fmt", "--check", str(out)]) == 0
    return simulate(out, scene="tran", accuracy=accuracy, output=folder / "t.h5")


@pytest.mark.long
def test_a_pulse_through_a_resistor_and_a_capacitor(tmp_path, capsys):
    """Linear rise in 1 us, 5 V for 3 ms: the closed form at the end of each edge and long after."""
    trace = traces("rc", tmp_path, capsys)
    v, tau = np.asarray(trace["v_out"]), 1e-3

    def ramp(t):  # answer to 5 V/us from 1 ms on
        s = np.maximum(t - 1e-3, 0.0)
        return 5e6 * (s - tau * -np.expm1(-s / tau))

    t = trace.time
    wanted = ramp(t) - ramp(t - 1e-6) - ramp(t - 1e-6 - 3e-3) + ramp(t - 2e-6 - 3e-3)
    first = t < 10.9e-3
    assert np.abs(v - wanted)[first].max() < 5e-6


def test_initial_conditions_and_parameters(tmp_path, capsys):
    """A damped series circuit at its resonance from 2 V and 0.1 A: SciPy's solution of its two equations."""
    from scipy.integrate import solve_ivp

    trace = traces("rlc", tmp_path, capsys)
    rate = 1.0 / (2 * 3.14159265 * math.sqrt(1e-3 * 1e-6))
    found = solve_ivp(
        lambda t, y: [(math.sin(2 * math.pi * rate * t) - 10.0 * y[0] - y[1]) / 1e-3, y[0] / 1e-6],
        (0.0, trace.time[-1]), [0.1, 2.0], "DOP853", trace.time, rtol=1e-11, atol=1e-12,
    )  # fmt: skip
    assert np.abs(np.asarray(trace["i_l1"]) - found.y[0]).max() < 1e-6 * 0.1
    assert np.abs(np.asarray(trace["v_3"]) - found.y[1]).max() < 1e-6 * 3.6


def test_controlled_sources(tmp_path, capsys):
    """v(a) = 1 k i; v(b) = 2 v(a); i(V2) = v(b)/1 k; v(h) = 500 i; v(d) = 300 i; 2 mS v(d) go into 1 k and 10 n."""
    trace = traces("ctrl", tmp_path, capsys)
    t = trace.time
    i = np.interp(t, [0.0, 1e-3, 2e-3], [0.0, 1e-3, 0.5e-3])
    assert np.abs(np.asarray(trace["v_h"]) - 500.0 * 2.0 * i).max() < 1e-9
    target = 1e3 * 2e-3 * 300.0 * 2.0 * i  # behind it by 10 us
    assert np.abs(np.asarray(trace["v_g"]) - target).max() < 2e-2 * 1.2
    assert abs(np.asarray(trace["v_g"])[-1] - target[-1]) < 1e-6


def test_subcircuits_become_components(tmp_path, capsys):
    code, found, _ = imported(NETLISTS / "inv.cir", tmp_path, capsys)
    text = found["result"]["text"]
    assert code == 0
    assert "component inv {" in text
    assert "param cl = 50 fF" in text
    assert re.search(r"x2: inv\(cl = 100 fF\) in_ = b, out = c, vdd = vdd", text)
    assert "beta = 0.00022 A/V^2" in text


@pytest.mark.parametrize("cards", ["K1 L1 L2 0.9\nK2 L3 L2 0.9\nK3 L1 L3 0.9\n", "K1 L1 L2 L3 0.9\n"])
def test_three_coils_on_one_core(cards, tmp_path, capsys):
    """A ramp of current through L1, the others open: i k sqrt(L1 L) over each; each coil is there once."""
    coils = "L1 a 0 1m\nL2 b 0 4m\nL3 0 c 9m\n"
    loads = "R1 a 0 1meg\nR2 b 0 1meg\nR3 c 0 1meg\n"
    path = tmp_path / "n.cir"
    path.write_text(f"t\nI1 0 a PWL(0 0 1m 1)\n{coils}{cards}{loads}.tran 10u 1m uic\n.print v(a) v(b) v(c) i(L1)\n")
    code, _, out = imported(path, tmp_path, capsys)
    assert code == 0
    trace = simulate(str(out), accuracy=1e-6, output=str(tmp_path / "t.h5"))
    for name, wanted in (("v_a", 1.0), ("v_b", 1.8), ("v_c", -2.7), ("i_l1", 1.0)):
        assert trace[name].values[-1] == pytest.approx(wanted, rel=2e-5), name


def test_perfect_coupling(tmp_path, capsys):
    """V = 1 ohm i1 + v, v2 = v/10, i1 + i2/10 = im, v = 1 H im': im' = (V - im)/1.001 s."""
    path = tmp_path / "n.cir"
    path.write_text(
        "t\nV1 a 0 10\nR1 a p 1\nL1 p 0 1\nL2 s 0 10m\nK1 L1 L2 1\nR2 s 0 10\n.tran 1m 1 uic\n.print v(s)\n"
    )
    code, _, out = imported(path, tmp_path, capsys)
    assert code == 0
    trace = simulate(str(out), accuracy=1e-6, output=str(tmp_path / "t.h5"))
    assert trace["v_s"].values[-1] == pytest.approx(np.exp(-1.0 / 1.001) / 1.001, rel=1e-5)


def test_subcircuits_and_files_called_as_parts_are(tmp_path, capsys):
    """A call with PARAMS: makes no node of the subcircuit's name."""
    path = tmp_path / "voltage.cir"
    path.write_text(
        "t\n.subckt resistor a b PARAMS: r=1k\nR1 a b {r}\n.ends\n"
        "V1 in 0 4\nX1 in diode resistor PARAMS: r=3k\nR2 diode 0 1k\n.tran 1u 1m\n"
    )
    code, found, out = imported(path, tmp_path, capsys)
    assert code == 0
    assert "node in_, diode: electrical" in found["result"]["text"]
    assert "model voltage_2 {" in found["result"]["text"]
    assert run(["check", str(out)]) == 0


FRONTS = {"inv": 1e-4, "latch": 1e-4}
"""Accuracy asked where gates switch: runs at 1e-5 and finer do not come closer to each other than 2e-6 to 2e-5."""
RELTOL = {"colpitts": "1e-6"}
"""Of ngspice where it cannot do 1e-7: its step becomes too small."""


def test_there_are_twenty_netlists():
    assert len(list(NETLISTS.glob("*.cir"))) == 20


@pytest.mark.skipif(shutil.which("ngspice") is None, reason="ngspice is not installed")
@pytest.mark.parametrize("name", sorted(p.stem for p in NETLISTS.glob("*.cir")))
@pytest.mark.long
def test_ngspice_agrees(name, tmp_path, capsys):
    """Every trace within 3e-4 of its largest value (between the rows both are interpolated by lines)."""
    trace = traces(name, tmp_path, capsys, FRONTS.get(name, 1e-6))
    text = (NETLISTS / f"{name}.cir").read_text()
    shown = re.search(r"(?im)^\.print tran (.*)$", text)[1].split()
    body = re.sub(r"(?im)^\.(print.*|end)$", "", text).rstrip()
    (tmp_path / "n.cir").write_text(
        f"{body}\n.options reltol={RELTOL.get(name, '1e-7')} abstol=1e-15 vntol=1e-9 chgtol=1e-18 trtol=1 "
        "method=gear maxord=4\n.control\n"
        "set wr_singlescale\nset wr_vecnames\nset numdgt=12\nrun\nlinearize\n"
        f"wrdata n.txt {' '.join(shown)}\nquit\n.endc\n.end\n"
    )
    subprocess.run(["ngspice", "-b", "n.cir"], cwd=tmp_path, capture_output=True, timeout=120, check=False)
    table = np.loadtxt(tmp_path / "n.txt", skiprows=1)
    for k, asked in enumerate(shown):
        kind, what = re.fullmatch(r"(?i)([vi])\((\w+)\)", asked).groups()
        values = np.interp(table[:, 0], trace.time, np.asarray(trace[f"{kind}_{what}".lower()]))
        assert np.abs(values - table[:, k + 1]).max() < 3e-4 * np.abs(table[:, k + 1]).max(), asked


def test_an_amplifier_of_many_frequencies_has_the_index_of_its_form(tmp_path, capsys):
    """A pole at 160 kHz behind a gain of 10000: ranks of the rows as written say 4."""
    assert run(["import", str(NETLISTS / "wien.cir"), "-o", str(tmp_path / "wien.sd")]) == 0
    assert run(["check", str(tmp_path / "wien.sd")]) == 0
    assert "index 2" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("R1 a 0", "ends too early"),
        ("R1 a 0 zz", "zz"),
        ("D1 a 0 none", "no .model none"),
        ("X1 a none", "no subcircuit 'none'"),
        ("O1 a 0 b 0 m", "letter O"),
        ("B1 a 0 V=1", "letter B"),
        ("V1 a 0 SFFM(0 1 1 1 1)", "are known"),
        ("V1 a 0 PWL(0 0 0 1)", "ascending"),
        ("K1 L1 L2 0.5", "two coils"),
        ("F1 a 0 V9 2", "V9".lower()),
        ("E1 a 0 value={1}", "expressions"),
        (".include ../secret.cir", "netlist's folder"),
        (".include /etc/passwd", "netlist's folder"),
        (".nonsense", "not known"),
        (".ends", "without .subckt"),
        (".subckt x a b", "no .ends"),
        (".param a", "NAME=VALUE"),
    ],
)
def test_what_cannot_be_said_is_named_with_its_line(line, said, tmp_path, capsys):
    path = tmp_path / "n.cir"
    path.write_text(f"title\nR9 a 0 1k\n{line}\n.end\n")
    code, found, out = imported(path, tmp_path, capsys)
    assert code == 1
    assert not out.exists()
    (error,) = [d for d in found["diagnostics"] if d["severity"] == "error"]
    assert error["code"] == "E941"
    assert said in error["message"]
    assert error["line"] == (1 if said == "no .ends" else 3)


def test_a_finding_of_an_included_file_stands_there(tmp_path, capsys):
    (tmp_path / "inner.cir").write_text("* parts\nR2 a 0 1k\nR1 a 0 zz\n")
    path = tmp_path / "n.cir"
    path.write_text("t\nV1 a 0 1\n.include inner.cir\nD1 a 0 none\n.tran 1 2\n")
    code, found, _ = imported(path, tmp_path, capsys)
    assert code == 1
    errors = [d for d in found["diagnostics"] if d["severity"] == "error"]
    assert {(Path(d["file"]).name, d["line"]) for d in errors} == {("inner.cir", 3), ("n.cir", 4)}


@pytest.mark.parametrize("kind", ["NPN", "PNP"])
@pytest.mark.long
def test_a_transistor_joined_to_a_diode(kind, tmp_path, capsys):
    """Collector and base are one node: (5 V - v)/1 kohm = IS/aF (exp(v/VT) - 1)."""
    path = tmp_path / "n.cir"
    supply = 5 if kind == "NPN" else -5
    cards = f".model q {kind}(is=1e-14 bf=100)\nV1 s 0 {supply}\nR1 s a 1k\nQ1 a a 0 q\nC1 a 0 1n\n"
    path.write_text(f"t\n{cards}.tran 1u 10u\n.print tran v(a)\n")
    code, found, out = imported(path, tmp_path, capsys)
    assert code == 0, found["diagnostics"]
    trace = simulate(out, scene="tran", accuracy=1e-7, output=tmp_path / "t.h5")
    v, volt = abs(np.asarray(trace["v_a"])[-1]), 1.380649e-23 * 300.15 / 1.602176634e-19
    assert (5.0 - v) / 1e3 == pytest.approx(1e-14 * 1.01 * math.expm1(v / volt), rel=1e-4)


def test_what_is_left_out_is_said(tmp_path, capsys):
    path = tmp_path / "n.cir"
    text = "t\n.model d d(is=1e-14 cjo=4p)\nV1 a 0 1\nR1 a b 1k\nD1 b 0 d\n.ac dec 10 1 1k\n.tran 1u 1m\n.end\n"
    path.write_text(text)
    code, found, _ = imported(path, tmp_path, capsys)
    assert code == 0
    assert {(d["code"], d["line"]) for d in found["diagnostics"]} == {("W941", 5), ("N941", 6)}


@pytest.mark.long
def test_names_and_titles_of_others_are_data(tmp_path, capsys):
    """Whatever they are, the text is one that `check` takes."""
    path = tmp_path / "n.cir"
    path.write_text(
        "title } model evil { \x1b[31m\nRif if then 1k\nR-2 then 0 2k\nRa.b if 0 1k\nVmodel if 0 1\nR1 1 0 1\n"
        "Rx 1 if 1\n.tran 1m 1\n"
    )
    code, _, out = imported(path, tmp_path, capsys)
    assert code == 0
    assert run(["check", str(out)]) == 0
    assert "\x1b" not in out.read_text()


def test_usage(tmp_path, capsys):
    assert run(["import", str(tmp_path / "none.cir")]) == 5
    (tmp_path / "n.cir").write_text("t\nR1 a 0 1\n")
    assert run(["import", str(tmp_path / "n.cir"), "-o", "x.txt"]) == 2
    capsys.readouterr()
    assert run(["import", str(tmp_path / "n.cir")]) == 0
    assert "resistor(R = 1 ohm) a -> ground" in capsys.readouterr().out
