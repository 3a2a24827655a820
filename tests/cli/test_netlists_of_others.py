"""Netlists as others write them: each is the circuit that ngspice 39 makes of it, or is refused by name.

Values are ngspice's, at small steps (the largest step a thousandth of the span or less), kept here.
"""

import json
import sys

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.cli.main import run
from sysdyn.cli.spice.model_text import ModelTextWriter
from sysdyn.cli.spice.reading import Reader
from sysdyn.cli.spice.writing import format_fast
from sysdyn.dsl.format.format import format_text
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText


def imported(text, folder, capsys):
    path, out = folder / "n.cir", folder / "n.sd"
    path.write_text(text)
    out.unlink(missing_ok=True)
    code = run(["import", str(path), "-o", str(out), "--json"])
    return code, json.loads(capsys.readouterr().out)["diagnostics"], out


RC = "V1 in 0 pulse(0 1 0 1n 1n 1 2)\nR1 in out 1k\nC1 out 0 1u\n"
CHARGING = {"v_out": {1e-3: 0.6321204, 5e-3: 0.9932621}}
HEATED = """I1 0 a 1m
D1 a 0 d
I2 0 b 1u
D2 b 0 d
V3 c 0 5
R3 c d 1k tc1=1m tc2=1u
M1 d g 0 0 mn w=10u l=1u
Vg g 0 2
V4 e 0 -5
R4 e f 1k
M2 f h 0 0 mp w=10u l=1u
V5 h 0 -2
Q1 q q2 0 qn
R6 c q 1k
I6 0 q2 1u
R8 r 0 1k tc=1m,1u
I8 0 r 1m
D9 s 0 d temp=60
I9 0 s 1m
.model d d(is=1e-14 n=1.1 eg=1.2 xti=2.5)
.model mn nmos(vto=1 kp=50u phi=0.7 lambda=0.01)
.model mp pmos(vto=-0.8 kp=20u phi=0.65 tnom=40)
.model qn npn(is=1e-15 bf=80 xtb=1.5)
.tran 1u 10u
"""
CIRCUITS = {
    "ic with uic": ("C1 a 0 1u\nR1 a 0 1k\n.ic v(a)=5\n.tran 10u 5m uic\n", {"v_a": {1e-3: 1.8393971}}),
    "ic with uic inside subcircuits": (
        "X1 o s\nR1 o 0 1k\nC5 o q 1u\nR5 q 0 1k\n.subckt s o\nR2 m o 1k\nC2 m 0 1u\nC1 o 0 1u\n.ends\n"
        ".ic v(o)=3 v(x1.m)=2\n.tran 10u 5m uic\n.print tran v(o) v(q)\n",
        {"v_o": {1e-4: 2.657693, 1e-3: 1.611154}, "v_q": {1e-4: -0.3248883, 1e-3: -0.7353992}},
    ),
    "a capacitor across a source with uic": (
        "V1 vcc 0 5\nC1 vcc 0 100n\nR1 vcc a 1k\nC2 a 0 1u\n.tran 10u 5m uic\n",
        {"v_a": {1e-3: 3.1606029, 5e-3: 4.9663103}},
    ),
    "shared nodes": (
        ".global vdd\nV1 vdd 0 5\nR9 vdd 0 1k\nX1 o s\nR1 o 0 1k\n.subckt s o\nX1 o t\n.ends\n"
        ".subckt t o\nR2 vdd o 1k\nC2 vdd o 1u\n.ends\n.tran 10u 5m\n",
        {"v_o": {1e-3: 2.5}, "v_vdd": {1e-3: 5.0}},
    ),
    "a derived parameter": (
        "V1 a 0 1\nX1 a b div r=2k\nX2 a c div\nX3 a d div r2=7k\n.subckt div i o r=1k\n.param r2={2*r}\n"
        "R1 i o {r}\nR2 o 0 {r2}\n.ends\nC1 b 0 1n\nC2 c 0 1n\nC3 d 0 1n\n.tran 10u 1m\n",
        {"v_b": {1e-3: 2 / 3}, "v_c": {1e-3: 2 / 3}, "v_d": {1e-3: 0.875}},
    ),
    "a parameter that a subcircuit hands on": (
        ".param g=1k\nV1 a 0 1\nX1 a b A g=7k\nR3 b 0 1k\nX2 a c A\nR4 c 0 1k\n.subckt A i o g=2k\nX1 i o B\n.ends\n"
        ".subckt B i o\nR1 i o {g}\n.ends\n.tran 1u 10u\n",
        {"v_b": {1e-5: 0.125}, "v_c": {1e-5: 1 / 3}},
    ),
    "parameters below their use": (
        ".param b={2*a}\n.tran {s} {1000*s}\nV1 i 0 1\nR1 i o {a}\nR2 o 0 {b}\n.param a=1k s=1u\n",
        {"v_o": {1e-3: 2 / 3}},
    ),
    "models of subcircuits": (
        "X7 q S\nI7 0 q 1m\nX8 p S2\nI8 0 p 1m\n.model d d(is=1e-14)\n.subckt S a\n"
        "D1 a 0 d\n.model d d(is=1e-10)\n.ends\n.subckt S2 a\nD1 a 0 d\n.ends\n.tran 1u 10u\n",
        {"v_q": {1e-5: 0.4168932}, "v_p": {1e-5: 0.6551179}},
    ),
    "temperature of 27": (
        HEATED.replace(" tnom=40", ""),
        {"v_a": {1e-5: 0.7206296852}, "v_b": {1e-5: 0.5240943019}, "v_d": {1e-5: 4.738154609}, "v_f": {1e-5: -4.856},
         "v_q": {1e-5: 4.919999701}, "v_q2": {1e-5: 0.6493463999}, "v_r": {1e-5: 1.0}, "v_s": {1e-5: 0.6604387731}},
    ),
    "temperature of 100, models at 20": (
        ".options temp=100 tnom=20 reltol=1e-4 noacct\n" + HEATED.replace(" tnom=40", ""),
        {"v_a": {1e-5: 0.5490203518}, "v_b": {1e-5: 0.3046916806}, "v_d": {1e-5: 4.773761733},
         "v_f": {1e-5: -4.88263067},         "v_q": {1e-5: 4.885107972}, "v_q2": {1e-5: 0.4927205318},
         "v_r": {1e-5: 1.0864}, "v_s": {1e-5: 0.6269404451}},
    ),
    "temperature of 100, one model at 40": (
        ".temp 100\n" + HEATED,
        {"v_a": {1e-5: 0.5865406871}, "v_b": {1e-5: 0.3422078207}, "v_d": {1e-5: 4.770635768},
         "v_f": {1e-5: -4.87595867},         "v_q": {1e-5: 4.889104976}, "v_q2": {1e-5: 0.5268099380},
         "v_r": {1e-5: 1.078329}, "v_s": {1e-5: 0.6604387731}},
    ),
    "a control block": (RC + ".tran 10u 5m\n.CONTROL\nrun\nplot v(out)\nfft v(out)\n.endc\n.end\nR7 in\n", CHARGING),
    "other analyses": (
        RC + ".op\n.ac dec 10 1 1k\n.tran 10u 5m\n.dc V1 0 1 0.1\n.four 1k v(out)\n.meas x max v(in)\n", CHARGING
    ),
    "a step of zero": (RC + ".tran 0 5m\n", CHARGING),
    "a step of zero and steep edges": (
        "V1 a 0 pulse(0 1 1u 0 0 4u 10u)\nR1 a 0 1k\n.tran 0 100m\n", {"v_a": {3e-6: 1.0, 8e-6: 0.0, 13e-6: 1.0}},
    ),
    "AC and DC anywhere": (
        "V1 a 0 sin(0 1 1k) ac 1 dc 0\nR1 a b 1k\nC1 b 0 100n\nV2 c 0 ac 1 90 dc 2 pwl(0,0 1m,1)\nR2 c 0 1\n"
        "V3 d 0 ac 1 dc 3\nR3 d 0 1\nV4 (e 0) sin 0 1 50 ac 1\nR4 e 0 1\nV5 f 0 3 ac 1\nR5 f 0 1\n.tran 10u 2m\n",
        {"v_b": {3e-4: 0.8434955, 1e-3: -0.450456, 1.7e-3: -0.5426581}, "v_c": {5e-4: 0.5}, "v_d": {1e-3: 3.0},
         "v_e": {1e-3: 0.309017}, "v_f": {1e-3: 3.0}},
    ),
    "polynomials": (
        "V1 a 0 pulse(0 1 0 1u 1u 5u 7u)\nR1 a 0 1k\nV2 c 0 1\nR3 c 0 1\nV5 e 0 pwl(0 0 1u 1 2u 0.5)\nR5 e 0 1\n"
        "E2 m 0 poly(2) a 0 c 0 0 1 1\nR2 m 0 1\n"
        "G1 0 g poly(2) (a,0) (c,0) 0 1m 2m 3m 4m 5m 6m\nR7 g 0 1\nH1 i 0 poly(2) V1 V2 1 2 3 4k 5 6\nR9 i 0 1\n"
        "E1 j 0 poly(3) a 0 c 0 e 0 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17\nR10 j 0 1\n"
        "F3 0 k poly(1) V2 0 2\nR11 k 0 1\n.tran 0.01u 20u\n",
        {"v_m": {6e-6: 2.0}, "v_g": {6e-6: 0.021}, "v_i": {6e-6: 4.007},
         "v_j": {1.5e-6: 127.49955}, "v_k": {6e-6: -2.0}},
    ),
    "nodes in brackets": (
        ".param gain = 1e5\nV1 p 0 sin(0 1 1k)\nE1 (o 0) (p m) {gain}\nR1 o m 9k\nR2 m 0 1k\n.tran 10u 2m\n",
        {"v_o": {2e-4: 9.5095764, 1.3e-3: 9.5095763}},
    ),
    "values as others write them": (
        "V1 a 0 pulse(0 1 0 1u 1u 5u 5u)\nR1 a 0 1k\nI1 0 b pulse(0 1m 1u 1u 1u 3u 4u)\nR2 b 0 1k\nG2 0 m a 0 1m m=3\n"
        "R13 m 0 1k\nR14 n 0 0\nI3 0 n 1m\nRl p 0 r=2k\nC1 p 0 c=1n\nI4 0 p 1m\nV6 k 0 sin(1 1 0)\nR11 k 0 1\n"
        "V7 l 0 exp(0 1)\nR12 l 0 1\n.tran 0.01u 20u\n",
        {"v_a": {5.6e-6: 0.6, 6.6e-6: 1.0}, "v_b": {6.6e-6: 1.0}, "v_m": {6.6e-6: 3.0}, "v_n": {6.6e-6: 1e-6},
         "v_p": {1.9e-5: 2.0}, "v_k": {6.6e-6: 1.8763067}},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(CIRCUITS))
@pytest.mark.one_in(12)
def test_a_netlist_is_the_circuit_that_it_is_elsewhere(name, tmp_path, capsys):
    text, wanted = CIRCUITS[name]
    code, found, out = imported(f"{name}\n{text}", tmp_path, capsys)
    assert code == 0, found
    assert not [d for d in found if d["severity"] == "warning"], found
    assert run(["fmt", "--check", str(out)]) == 0
    instants = sorted({t for values in wanted.values() for t in values})
    trace = simulate(out, scene="tran", accuracy=1e-7, output=tmp_path / "t.h5", at=instants)
    for node, values in wanted.items():
        got = [np.interp(t, trace.time, np.asarray(trace[node])) for t in values]
        assert got == pytest.approx(list(values.values()), rel=1e-4), node


def test_other_analyses_are_one_note(tmp_path, capsys):
    _, found, _ = imported(f"t\n{CIRCUITS['other analyses'][0]}", tmp_path, capsys)
    assert [(d["code"], d["line"]) for d in found] == [("N941", 5)]
    assert found[0]["message"].startswith("'.op', '.ac', '.dc', '.four', '.meas' are left out")
    _, found, _ = imported(f"t\n{RC}.control\ntran 1u 1m\n.endc\n", tmp_path, capsys)
    assert "outside of .control" in found[0]["help"]


@pytest.mark.parametrize(
    ("cards", "line", "said"),
    [
        ("Q1 a b 0 q\n.model q npn(level=4 is=1e-16)", 3, "level=4 is another device"),
        ("Q1 a b 0 q\n.model q npn(level=9)", 3, "level=9"),
        ("M1 a b 0 0 n\n.model n nmos(level=49 vth0=0.3)", 3, "level=49"),
        ("M1 a b 0 0 n\n.model n vdmos(rd=1)", 3, "is vdmos"),
        ("D1 a 0 d\n.model d d(level=3)", 3, "level=3"),
        ("E1 b 0 poly(1) a 0 5", 3, "POLY with one number"),
        ("E1 b 0 poly(x) a 0 5", 3, "POLY(x)"),
        ("F1 b 0 poly(2) v1", 3, "POLY(n)"),
        ("E1 b 0 a 0 5 6", 3, "behind the gain"),
        ("G1 b 0 cur={v(a)}", 3, "expressions are not known"),
        ("V2 b 0 pulse(0 1 0 1n 1n 1u 2u 5)", 3, "PULSE"),
        ("V2 b 0 pwl(0 0 1 1) r=0", 3, "'r'"),
        ("V2 b 0 1 rser=5", 3, "'rser'"),
        (".options scale=1e-6", 3, "scale"),
        (".temp 27 50", 3, ".temp T"),
        (".temp -300", 3, "no temperature"),
        (".temp 9999", 3, "no temperature"),
        (".tran 1u 1m\n.tran 1u 2m", 4, "twice"),
        (".param a={b} b={a}", 3, "depends on itself"),
        (".param a={b}", 3, "no parameter 'b'"),
        (".subckt s a\nX1 a s\n.ends\nX1 a s", 4, "inside itself"),
        (".subckt s a\nX1 a u\n.ends\n.subckt u a\nX1 a s\n.ends\nX1 a s", 7, "inside itself"),
        (".subckt s a\nR1 a 0 1\n.ends\n.subckt s a\nC1 a 0 1\n.ends", 6, "twice"),
        (".model d d(is=1)\n.model d d(is=2)", 4, "twice"),
        (".global b\nX1 a s\n.subckt s b\nR1 b 0 1k\n.ends", 4, "one node everywhere"),
        ("D1 a 0 d\n.model d d(n=0)", 3, "emission"),
        ("Q1 a b 0 q\n.model q npn(bf=0)", 3, "bf and br"),
        ("M1 a b 0 0 n l=1u\n.model n nmos(ld=1u)", 3, "no transistor"),
        ("D1 a 0 d\n.model d d(is={x})", 4, "no parameter 'x'"),
        (".ic v(b)=1\nR2 a b 1k\n.tran 1u 1m", 3, "no capacitor"),
        (".ic a=1", 3, "V(NODE)"),
        ("R1 a 0 r =", 3, "ends too early"),
        ("G1 a 0 m = 2", 3, "expressions are not known"),
        ("F1 a 0 poly m=2", 3, "POLY without"),
        (".ic v(zz)=1\nC1 b 0 1u\n.tran 1u 1m uic", 3, "no such node"),
        (".subckt s a\n.ic v(a)=1\n.ends", 4, "inside a subcircuit"),
        ("V2 b 0 exp(0 1)\n.tran 0 1m", 3, "time constants"),
    ],
)  # fmt: skip
def test_what_would_be_another_circuit_is_refused_by_name(cards, line, said, tmp_path, capsys):
    code, found, out = imported(f"title\nV1 a 0 1\n{cards}\nR9 b a 1k\n", tmp_path, capsys)
    errors = [d for d in found if d["severity"] == "error"]
    assert (code, [d["line"] for d in errors]) == (1, [line]), found
    assert said in errors[0]["message"]
    assert not out.exists()


@pytest.mark.parametrize(
    ("cards", "said"),
    [
        ("D1 b 0 d\n.model d d(bv=5.1 ibv=1m)", "bv, ibv"),
        ("M1 b a 0 0 n\n.model n nmos(cgso=1n gamma=0.5)", "cgso, gamma"),
        ("M1 b a 0 0 n ad=1p nrd=5\n.model n nmos(cj=1m rsh=10)", "cj, rsh, ad, nrd"),
        ("M1 b a 0 0 n\nL1 b 0 1u\n.model n nmos(vto=1)", "junctions of the bulk"),
        ("Q1 b a 0 q\n.model q npn(nf=1.2)", "nr"),
        ("Q1 b a 0 q\n.model q npn(vaf=50)", "vaf"),
        (".nodeset v(b)=1", ".nodeset"),
        (".options rshunt=1e6", "rshunt"),
        ("C1 b 0 1u cmod", "cmod"),
        ("L1 b 0 1m\nL2 a 0 1m m=2\nK1 L1 L2 0.5", "m of its card"),
    ],
)
def test_what_is_left_out_is_named(cards, said, tmp_path, capsys):
    code, found, _ = imported(f"title\nV1 a 0 1\n{cards}\nR9 b a 1k\n", tmp_path, capsys)
    assert (code, [d["code"] for d in found]) == (0, ["W941"]), found
    assert said in found[0]["message"]


def test_what_says_nothing_of_the_circuit_is_no_warning(tmp_path, capsys):
    cards = ".options reltol=1e-4 noacct method=gear\nM1 b a 0 0 n ad=1p as=1p pd=1u ps=1u nrd=1\n.model n nmos(kp=1m)"
    code, found, _ = imported(
        f"t\nV1 a 0 1\n{cards}\nD1 b 0 d off\n.model d d(type=silicon mfg=x)\nR1 a b 1\n", tmp_path, capsys
    )
    assert (code, found) == (0, [])


def test_transconductance_from_mobility_and_oxide(tmp_path, capsys):
    """KP = UO 3.9 eps0/TOX = 600e-4 m^2/V/s * 3.453e-11 F/m / 20 nm: 1.036e-4 A/V^2; W = 10 L, VTO = 1 V, VGS = 2 V."""
    cards = "V1 g 0 2\nV2 d 0 5\nM1 d g 0 0 n w=10u l=1u\n.model n nmos(tox=20n vto=1)\n.tran 1u 10u\n.print i(v2)\n"
    code, found, out = imported(f"t\n{cards}", tmp_path, capsys)
    assert code == 0
    assert "tox" in found[0]["message"]  # of its gate's capacitance
    trace = simulate(out, scene="tran", output=tmp_path / "t.h5")
    assert trace["i_v2"].values[-1] == pytest.approx(-0.5 * 600e-4 * 3.9 * 8.8541878e-12 / 20e-9 * 10.0, rel=1e-4)


def ladder(size):
    rungs = "".join(f"R{k} n{k} n{k + 1} 1\n" for k in range(size))
    return f"t\nV1 n0 0 1\n{rungs}R{size} n{size} 0 1\n.tran 1m 1\n"


def test_limits_of_the_language_are_those_of_import(tmp_path, capsys):
    """Lines of 1600 nodes and of 900 points."""
    code, found, out = imported(ladder(1600), tmp_path, capsys)
    assert (code, found) == (0, [])
    assert run(["check", str(out)]) == 0
    points = " ".join(f"{k}m {k % 7 / 3 + 0.123456:.6f}" for k in range(900))
    cards = f"V1 a 0 pwl({points})\nI1 0 b pwl({points})\nR1 a 0 1\nR2 b 0 1\n.tran 1m 20m\n"
    code, found, out = imported(f"t\n{cards}", tmp_path, capsys)
    assert (code, found) == (0, [])
    assert run(["fmt", "--check", str(out)]) == 0
    trace = simulate(out, scene="tran", accuracy=1e-7, output=tmp_path / "t.h5", at=[10.5e-3])
    for name in ("v_a", "v_b"):
        assert np.interp(10.5e-3, trace.time, trace[name].values) == pytest.approx(3.5 / 3 + 0.123456, rel=1e-6)


def test_many_elements_take_work_in_proportion():
    """A scan for names that stand twice took the square of their number (50 s of 40 000 elements; now 1.5 s)."""

    def calls(size):
        source, count = SourceText("n.cir", ladder(size)), 0

        def count_them(frame, event, what):
            nonlocal count
            count += 1

        sys.setprofile(count_them)
        try:
            format_fast(ModelTextWriter(Reader(source, Report()).netlist, source, Report()).text())
        finally:
            sys.setprofile(None)
        return count

    small = calls(500)  # and what is made once
    assert calls(4000) - calls(2000) < 5 * (calls(1000) - small)


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.one_in(2)
def test_subcircuits_within_each_other(inside, tmp_path, capsys):
    """150 levels run; 3000 are refused; defined beside each other or within."""

    def nested(levels):
        begin = "".join(f".subckt s{k} a\nX1 a s{k + 1}\n{'' if inside else '.ends'}\n" for k in range(levels))
        end = ".ends\n" * levels if inside else ""
        return f"t\nI1 0 a 1\nX1 a s0\n{begin}.subckt s{levels} a\nR1 a 0 7\n.ends\n{end}.tran 1m 1\n"

    code, found, out = imported(nested(150), tmp_path, capsys)
    assert (code, found) == (0, [])
    assert simulate(out, scene="tran", output=tmp_path / "t.h5")["v_a"].values[-1] == pytest.approx(7.0)
    code, found, _ = imported(nested(3000), tmp_path, capsys)
    assert (code, [d["code"] for d in found]) == (1, ["E941"])
    assert "more than 200 deep" in found[0]["message"]


@pytest.mark.parametrize("name", ["polynomials", "values as others write them", "temperature of 27", "ic with uic"])
def test_the_layout_is_the_formatters(name):
    """Also of runs of plain statements, which go by it."""
    source, report = SourceText("n.cir", f"t\n{CIRCUITS[name][0]}"), Report()
    text = ModelTextWriter(Reader(source, report).netlist, source, report).text()
    assert format_fast(text) == format_text(text)
