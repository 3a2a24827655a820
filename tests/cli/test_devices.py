"""Cards of netlists as elements, against SPICE's own formulas: what numbers they have, how many stand side by side."""

import re

import pytest
from sysdyn.cli.spice.devices import CircuitScope, ModelValues
from sysdyn.cli.spice.model_text import DEVICES, ModelTextWriter
from sysdyn.cli.spice.netlist import UnreadableCard, cards
from sysdyn.cli.spice.reading import Reader
from sysdyn.cli.spice.temperature import Heat
from sysdyn.cli.spice.windings import Cores, coupled_coils
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText

THERMAL = 1.380649e-23 * 300.15 / 1.602176634e-19  # V: k T/q at 27 Celsius
MODELS = {
    "dm": ModelValues("d", {"is": 2e-14, "n": 1.5, "rs": 4.0}),
    "plain": ModelValues("d", {"is": 1e-14, "cjo": 1e-12}),
    "qn": ModelValues("npn", {"is": 1e-15, "bf": 50.0, "br": 3.0, "nf": 1.25}),
    "qp": ModelValues("pnp", {"is": 1e-15}),
    "mn": ModelValues("nmos", {"kp": 3e-5, "vto": 0.75, "lambda": 0.02}),
    "m2": ModelValues("nmos", {"level": 2.0}),
}


def scope(*names, uic=False, known=None, written=None):
    labels = {n: n for n in names} | {f"param {n}": f"p_{n}" for n in written or {}}
    node = {"0": "ground"}
    return CircuitScope(
        lambda n: node.get(n, n), labels, known or {}, MODELS.get, ("V", 1e-3, 1.0), uic, Heat(), written=written or {}
    )


def card(text):
    return cards(SourceText("n.cir", text), titled=False)[1][0]


def element(text, **more):
    one = card(text)
    return DEVICES[one.head[0]](one, scope(one.head, "v1", **more))


NUMBER = r"([-+.\deE]+) ?([fpnumkMG]?)(?:ohm|F|H|V|A|S)?"
SCALE = {"": 1.0, "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6, "G": 1e9}


def given(line, name):
    """The number that an argument has, in SI units."""
    found = re.search(rf"\b{name} = {NUMBER}", line)
    return float(found[1]) * SCALE[found[2]]


@pytest.mark.parametrize(
    ("text", "line", "initial"),
    [
        ("r1 a 0 4.7k", "r1: resistor(R = 4.7 kohm) a -> ground", ()),
        ("c1 a b 100n", "c1: capacitor(C = 100 nF) a -> b", ("init c1.f = 0 A",)),
        ("l1 a b 1m ic=2", "l1: inductor(L = 1 mH) a -> b", ("init l1.e = 0 V",)),
        ("r1 a b 1k m=2", "r1: resistor(R = 500 ohm) a -> b", ()),
        ("l1 a b 1m m=4", "l1: inductor(L = 250 uH) a -> b", ("init l1.e = 0 V",)),
        ("c1 a b 1n m=3", "c1: capacitor(C = 3 nF) a -> b", ("init c1.f = 0 A",)),
    ],
)
def test_passive_elements(text, line, initial):
    found = element(text)
    assert (found.lines, found.initial, found.left_out) == ((line,), initial, ())


def test_initial_conditions_are_used_where_they_are_asked_for():
    assert element("c1 a b 1n ic=2", uic=True).initial == ("init c1.e = 2 V",)
    assert element("c1 a b 1n", uic=True).initial == ("init c1.e = 0 V",)
    assert element("l1 a b 1m ic={x/2}", uic=True, known={"x": 3.0}).initial == ("init l1.f = 1.5 A",)


def test_what_a_card_says_beside_is_told():
    assert element("r1 a b 1k film").left_out == ("film",)
    assert element("r1 a b 1k rsh=3 tc1=1m").left_out == ("rsh",)
    assert element("d1 a b plain off pj=50").left_out == ("cjo", "pj")


def test_a_parameter_stays_a_name_where_it_has_the_unit():
    assert element("r1 a b {rx}", known={"rx": 5.0}, written={"rx": "ohm"}).lines[0] == "r1: resistor(R = p_rx) a -> b"
    assert element("c1 a b {rx}", known={"rx": 5.0}, written={"rx": "ohm"}).lines[0] == "c1: capacitor(C = 5 F) a -> b"


@pytest.mark.parametrize(
    ("said", "area"), [("", 1.0), (" 3", 3.0), (" area=3", 3.0), (" area=3 m=2", 6.0), (" 3 off", 3.0)]
)
def test_diodes_side_by_side_carry_more_through_less_resistance(said, area):
    node, diode, series = element(f"d1 a 0 dm{said}").lines
    assert node == "node d1_in: electrical"
    assert given(diode, "Is") == pytest.approx(2e-14 * area, rel=1e-14, abs=0.0)
    assert given(diode, "vT") == pytest.approx(1.5 * THERMAL, rel=1e-14, abs=0.0)
    assert diode.endswith("d1_in -> ground")
    assert given(series, "R") == pytest.approx(4.0 / area, rel=1e-14, abs=0.0)
    assert series.endswith("a -> d1_in")


@pytest.mark.parametrize(
    ("said", "area"), [("", 1.0), (" 2", 2.0), (" area=2", 2.0), (" ic=0.6,5", 1.0), (" 2 ic=0.6,5 m=3", 6.0)]
)
def test_transistors_of_ebers_and_moll_are_those_of_the_transport_form(said, area):
    """aF Ies = aR Ics = IS, aF = BF/(1 + BF), aR = BR/(1 + BR); a substrate may stand before the model."""
    for nodes in ("c b e", "c b e sub"):
        (line,) = element(f"q1 {nodes} qn{said}").lines
        forward, backward = given(line, "aF"), given(line, "aR")
        assert (forward, backward) == (pytest.approx(50.0 / 51.0), 0.75)
        assert forward * given(line, "Ies") == pytest.approx(1e-15 * area, rel=1e-13, abs=0.0)
        assert backward * given(line, "Ics") == pytest.approx(1e-15 * area, rel=1e-13, abs=0.0)
        assert given(line, "vT") == pytest.approx(1.25 * THERMAL, rel=1e-14, abs=0.0)
        assert line.startswith("q1: npn(")
        assert line.endswith("c = c, b = b, e = e")
    assert element("q1 c b e qp").local == ("pnp",)


@pytest.mark.parametrize(
    ("text", "line", "current"),
    [
        ("q1 a a e qn", "a -> e", 1e-15 * 51.0 / 50.0),  # what flows out of the emitter: IS/aF
        ("q1 c a a qn", "a -> c", 1e-15 * 4.0 / 3.0),
        ("q1 a a e qp", "e -> a", 1e-15 * 101.0 / 100.0),
    ],
)
def test_a_transistor_with_a_junction_short_is_a_diode(text, line, current):
    (found,) = element(text).lines
    assert found.startswith("q1: diode(")
    assert found.endswith(line)
    assert given(found, "Is") == pytest.approx(current, rel=1e-14, abs=0.0)


def test_field_effect_transistors():
    (line,) = element("m1 d g s 0 mn w=20u l=2u m=3").lines
    assert given(line, "beta") == pytest.approx(3e-5 * 10.0 * 3.0, rel=1e-14, abs=0.0)
    assert (given(line, "vto"), given(line, "lambda")) == (0.75, 0.02)
    assert given(element("m1 d g s 0 mn").lines[0], "beta") == 3e-5  # as wide as long
    with pytest.raises(UnreadableCard, match="level=2"):
        element("m1 d g s 0 m2")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("e1 a b c d 2", "e1: effort(e = 2*(c.e - d.e)) a -> b"),
        ("e1 a 0 c 0 -2", "e1: effort(e = (-2)*c.e) a -> ground"),
        ("e1 a 0 0 c 2", "e1: effort(e = 2*(-c.e)) a -> ground"),
        ("g1 a 0 c d 2m", "g1: flow(f = (2 mS)*(c.e - d.e)) a -> ground"),
        ("f1 a 0 v1 5", "f1: flow(f = 5*v1.f) a -> ground"),
        ("h1 a 0 v1 5k", "h1: effort(e = (5 kohm)*v1.f) a -> ground"),
    ],
)
def test_controlled_sources(text, line):
    assert element(text).lines == (line,)


def test_sources_have_a_direct_part_or_a_shape():
    assert element("v2 a 0 dc 5 ac 1").lines == ("v2: voltage(v = 5 V) a -> ground",)
    assert element("v2 a 0").lines == ("v2: voltage(v = 0 V) a -> ground",)
    assert "2*pi*(50 Hz)" in element("i1 a 0 dc 1 sin(0 2 50)").lines[0]
    with pytest.raises(UnreadableCard, match="are known"):
        element("v2 a 0 1 2")


def test_coupled_coils_are_one_element():
    coils = {c.head: c for c in map(card, ("l1 a 0 1m ic=2", "l2 b c 4m"))}
    one = card("k1 l1 l2 0.5")
    found = coupled_coils(one, scope("k1"), Cores([one], coils))
    assert found.lines == ("k1: coupled_inductors(L1 = 1 mH, L2 = 4 mH, k = 0.5) one = a -> ground, two = b -> c",)
    assert found.initial == ("init k1.one.e = 0 V", "init k1.two.e = 0 V")
    asked = coupled_coils(one, scope("k1", uic=True), Cores([one], coils))
    assert asked.initial == ("init k1.one.f = 2 A", "init k1.two.f = 0 A")
    again = card("k2 l2 l1 0.4")
    with pytest.raises(UnreadableCard, match="l1 and l2 are coupled already"):
        coupled_coils(again, scope("k1", "k2"), Cores([one, again], coils))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("d1 a b none", "no .model none"),
        ("d1 a b qn", "is npn, wanted is d"),
        ("d1 a b dm 0", "0 of a device are none"),
        ("d1 a b dm area=-1", "-1 of a device are none"),
        ("d1 a", "ends too early"),
        ("f1 a 0 v9 2", "no source 'v9'"),
        ("e1 a 0 value = {1}", "expressions are not known"),
    ],
)
def test_what_a_card_cannot_say(text, said):
    with pytest.raises(UnreadableCard, match=re.escape(said)):
        element(text)


# --- circuits ---------------------------------------------------------------------------------------------------------


def written(text):
    source, report = SourceText("n.cir", text), Report()
    made = ModelTextWriter(Reader(source, report).netlist, source, report).text()
    return made, [(d.code, d.message) for d in report]


def test_parameters_that_are_values_alone_stay_parameters_of_a_component():
    """rx is the value of resistors, k stands in an expression too: a number in each instance would be another one."""
    text, said = written(
        "t\n.subckt part a b rx=1k k=2\nR1 a c {rx}\nR2 c b {k*10}\n.ends\nX1 s 0 part rx=3k\nV1 s 0 1\n.tran 1u 1m\n"
    )
    assert said == []
    assert "param rx = 1 kohm" in text
    assert "x1: part(rx = 3 kohm) a = s, b = ground" in text
    assert "r2: resistor(R = 20 ohm)" in text
    both, _ = written("t\n.subckt part a b rx=1k\nR1 a c {rx}\nR2 c b {rx*2}\n.ends\nX1 s 0 part\nV1 s 0 1\n")
    assert "param rx" not in both
    assert "r1: resistor(R = 1 kohm)" in both
    two, said = written("t\n.subckt part a b k=2\nR2 a b {k*10}\n.ends\nX1 s 0 part k=3\nX2 s 0 part\nV1 s 0 1\n")
    assert said == []
    assert "x1: part() a = s" in two
    assert "x2: part_2() a = s" in two
    assert two.index("R = 20 ohm") < two.index("component part {") < two.index("R = 30 ohm")


def test_initial_voltages_of_nodes_are_those_of_capacitors_to_ground():
    text, said = written("t\nC1 a 0 1n\nC2 0 b 1n\nR1 a b 1k\n.ic v(a)=2 v(b)=3\n.tran 1u 1m\n")
    assert said == []
    assert "init c1.e = 2 V" in text
    assert "init c2.e = -3 V" in text
    assert "init c1.f" not in text
    _, said = written("t\nC1 a b 1n\nR1 a 0 1k\nR2 b 0 1k\n.ic v(a)=2\n")
    assert [c for c, _ in said] == ["E941"]


def test_what_is_shown_is_traced_by_its_names_at_its_step():
    text, _ = written("t\nV1 in 0 1\nR1 in out 1k\nC1 out 0 1n\n.print tran v(in,out) v(0,out) i(v1)\n.tran 1u 1m\n")
    assert re.search(r"trace in_?\.e - out_?\.e as v_in_out, -out_?\.e as v_out, v1\.f as i_v1 every 1 us", text)
    text, said = written("t\nV1 in 0 1\nR1 in 0 1k\n.tran 1n 1 0.5\n")
    assert "every 1 ms" in text  # 1e9 rows are a thousand
    assert said == [("N941", "the trace begins at 0 s, not at 0.5 s")]
