"""A finding in a library is told at the author's line; the library is a note."""

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.codes import codes
from sysdyn.dsl.text.diagnostics import Report

HEAD = """from std.electrical import resistor, capacitor, voltage

component stage {
  param R = 1 ohm
  port a, b: electrical
  inner: resistor(R = R) a -> b
  store: capacitor(C = 1 uF) b -> ground
}

model m {
  param k = 4
  node a, b, c: electrical
  V: voltage(v = 5 V) a -> ground
"""
LINES = [
    ("X: resistor(R = k) a -> b", "E214", "R = k"),
    ("X: capacitor(C = 3 H) a -> b", "E214", "C = 3 H"),
    ("X: resistor(R = -3 ohm) a -> b", "E322", "X: resistor(R = -3 ohm) a -> b"),
    ("X: stage(R = -3 ohm) a = a, b = b", "E322", "inner: resistor(R = R) a -> b"),
    ("for i in 1..2 { X[i]: resistor(R = -3 ohm) a -> b }", "E322", "X[i]: resistor(R = -3 ohm) a -> b"),
]


@pytest.mark.parametrize(("line", "code", "marked"), LINES, ids=[x[0] for x in LINES])
def test_a_finding_of_the_library_stands_at_the_authors_line(tmp_path, line, code, marked):
    path = tmp_path / "m.sd"
    rest = "  Y: resistor(R = 2 ohm) b -> c\n  Z: resistor(R = 3 ohm) c -> ground\n"
    path.write_text(f"{HEAD}  {line}\n{rest}}}\n")
    found = findings(path)
    (error,) = [d for d in found if d.code == code]
    assert error.place.file == str(path)
    assert text_of(error.place) == marked
    assert error.related[0].place.file == "std/electrical.sd"
    assert error.related[0].message.startswith("in component '")
    assert {d.code for d in found if d.severity == "error"} == {code}


def test_the_element_that_is_named_is_the_one_that_is_shown(tmp_path):
    path = tmp_path / "m.sd"
    wrong = "".join(f"  R{k}: resistor(R = {r} ohm) a -> b\n" for k, r in enumerate((1, -2, 3, -4)))
    path.write_text(
        f"{HEAD}{wrong}  Z: resistor(R = 3 ohm) b -> ground\n  Q: capacitor(C = 1 F) c -> ground\n"
        "  S: resistor(R = 1 ohm) c -> a\n}\n"
    )
    errors = [d for d in findings(path) if d.code == "E322"]
    assert [text_of(d.place) for d in errors] == ["R1: resistor(R = -2 ohm) a -> b", "R3: resistor(R = -4 ohm) a -> b"]


@pytest.mark.parametrize("component", ["resistor", "stage"])
@pytest.mark.parametrize(
    ("given", "code", "remedy"),
    [
        ("2 V", "E214", "write '2 ohm'"),
        ("2 ohm*sin(1 rad/s*t)", "E807", "numbers and parameters alone; 'input R' could vary"),
        ("[2 ohm, 3 ohm]", "E805", "one value"),
    ],
)
def test_an_argument_is_shown_where_it_stands_among_its_like(tmp_path, component, given, code, remedy):
    ends = "a -> b" if component == "resistor" else "a = a, b = b"
    values = ("1 ohm", given, "3 ohm")
    lines = "".join(f"  R{k}: {component}(R = {value}) {ends}\n" for k, value in enumerate(values))
    path = tmp_path / "m.sd"
    path.write_text(f"{HEAD}{lines}  Z: resistor(R = 3 ohm) b -> c\n  S: resistor(R = 1 ohm) c -> ground\n}}\n")
    (error,) = [d for d in findings(path) if d.severity == "error"]
    assert (error.code, error.place.file, text_of(error.place)) == (code, str(path), f"R = {given}")
    assert error.help == remedy
    assert error.related[0].message == f"in component '{component}'"


def test_a_library_of_ones_own_is_a_library(tmp_path):
    (tmp_path / "parts.sd").write_text(
        "component heavy {\n  param m: kg\n  branch: translation\n  law p = m*f\n  require m > 0 kg\n}\n"
    )
    path = tmp_path / "m.sd"
    path.write_text("from parts import heavy\n\nmodel m {\n  node x: translation = 1 m\n  M: heavy(m = -1 kg) x\n}\n")
    (error,) = [d for d in findings(path) if d.code == "E322"]
    assert error.place.file == str(path)
    assert error.place.start[0] == 5
    assert error.related[0].place.file.endswith("parts.sd")


@pytest.mark.parametrize("outside", ["extend", "clamp", "stop", ""])
def test_only_who_did_not_write_extend_is_warned_of_it(tmp_path, outside):
    """W302 of a table of another file; never in the text that says so itself, nor where that file alone reads it."""
    table = f"table pull(x: m) -> N linear {outside} [ (0, 0), (1, 4) ]\n"
    holder = "component spring {\n  branch: translation\n  law e = pull(q)\n}\n"
    page = codes()["W302"].bad
    path = tmp_path / "m.sd"
    path.write_text(table + page.partition("\n\n")[2])
    assert findings(path) == []
    (tmp_path / "curves.sd").write_text(table + holder)
    path.write_text(page)
    found = findings(path)
    assert [d.code for d in found] == ["W302"] * (outside == "extend")
    for warning in found:
        assert (warning.place.file, text_of(warning.place)) == (str(path), "pull")
        assert warning.related[0].place.file.endswith("curves.sd")
    path.write_text(
        "from curves import spring\n\nmodel m {\n  coord x: translation = 1 m\n"
        "  energy T* = 1/2*(1 kg)*x'^2\n  S: spring() x\n}\n"
    )
    assert findings(path) == []


def text_of(place):
    return place.source.text[place.span.start : place.span.end]


def findings(path):
    report = Report()
    document = load.read(path, report)
    with ex.fresh():
        load.network(document, document.models["m"], None, report, required=False)
    return list(report)


def test_a_branch_without_a_law_stands_where_its_element_does(tmp_path):
    """The author's place was read in the text of the library."""
    path = tmp_path / "m.sd"
    text = HEAD.replace("voltage", "voltage, diode", 1)
    rest = "  Y: resistor(R = 2 ohm) b -> c\n  Z: resistor(R = 3 ohm) c -> ground\n"
    path.write_text(f"{text}  D: diode.complementary() a -> b\n{rest}}}\n")
    report = Report()
    with ex.fresh():
        document = load.document(load.SourceText.read(path), report)
        network = load.network(document, document.models["m"], None, report)
        (branch,) = [b for b in network.branches if b.name == "D"]
    assert (branch.place.file, text_of(branch.place)) == (str(path), "D")
