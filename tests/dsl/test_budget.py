"""One budget: what grows faster than the text is refused with its place and its size, in bounded work."""

import re

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.model import budget
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.names.resolve import Resolver
from sysdyn.dsl.text.diagnostics import MOST, Diagnostic, Report, SourceText, limit_findings

MODEL = """{head}model m {{
  param m = 2 kg
  coord x: translation = 3 m
  energy T* = 1/2*m*x'^2
  init x' = 0 m/s
{body}
}}
"""


def judged(body, head="", scene=None):
    """The network of a text, and what was found."""
    report = Report()
    document = load.document(SourceText("t", MODEL.format(head=head, body=body)), report)
    with ex.fresh():
        return load.network(document, document.models["m"], None, report), report


def visits(monkeypatch, body, head=""):
    """How often an expression of a text is resolved."""
    seen = []
    own = Resolver.resolve
    monkeypatch.setattr(Resolver, "resolve", lambda self, e: (seen.append(e), own(self, e))[1])
    network, report = judged(body, head)
    monkeypatch.setattr(Resolver, "resolve", own)
    assert network is not None, list(report)
    return len(seen)


NESTED = {
    "call": ("cosh(", ")"),
    "two arguments": ("atan2(", ", 2)"),
    "any number of arguments": ("min(3, ", ")"),
    "power": ("(1 + ", ")^2"),
    "condition": ("if x > 1 m then ", " else 3"),
    "sum over a range": ("sum(i in 1..2: ", ")"),
    "product over a range": ("prod(i in 1..2: ", ")"),
    "negative": ("-(", ")"),
    "quotient": ("1/(2 + ", ")"),
    "list": ("norm([", ", 1])"),
    "function of the file": ("g(", ")"),
}


@pytest.mark.parametrize("kind", NESTED)
@pytest.mark.one_in(12)
def test_every_expression_is_resolved_once(monkeypatch, kind):
    before, after = NESTED[kind]

    def text(depth):
        return f"  let y = {before * depth}x/(1 m){after * depth}"

    head = "fn g(u: 1) -> 1 = u + 1/(1 + u^2)\n"
    ones, few, many = (visits(monkeypatch, text(depth), head) for depth in (10, 20, 40))
    assert few > ones
    assert many - few == 2 * (few - ones)


@pytest.mark.long
def test_nested_calls_cost_as_many_lines_each(effort):
    def lines(depth):
        found, count = effort(lambda: judged(f"  let y = {'tanh(' * depth}x/(1 m){')' * depth}"))
        assert found[0] is not None
        return count

    lines(1)
    one, few, many = lines(1), lines(76), lines(151)
    assert many - few < 1.1 * (few - one)


def test_a_chain_of_functions_is_expanded_once_for_each_argument(monkeypatch):
    def head(count):
        chain = (f"fn f{k}(u: 1) -> 1 = f{k - 1}(u)*2 + f{k - 1}(u)\n" for k in range(1, count))
        return "fn f0(u: 1) -> 1 = u^3\n" + "".join(chain)

    ones, few, many = (visits(monkeypatch, f"  let y = f{n - 1}(x/(1 m))", head(n)) for n in (15, 30, 60))
    assert many - few == 2 * (few - ones)


DOUBLING = "fn f0(u: 1) -> 1 = u\n" + "".join(
    f"fn f{k}(u: 1) -> 1 = f{k - 1}(cosh(u))/f{k - 1}(tanh(u))\n" for k in range(1, 50)
)
BOXES = "component c0 {\n  param a = 2\n}\n" + "".join(
    f"component c{k} {{\n  left: c{k - 1}()\n  right: c{k - 1}()\n}}\n" for k in range(1, 40)
)
RESISTOR = "R[{at}]: dissipator(e = 2 ohm*f) a -> ground"
LARGE = {  # body, head, line of the finding
    "functions": ("  let y = f49(x/(1 m))", DOUBLING, 56),
    "components": ("  box: c39()", BOXES, None),
    "parameter": ("  param z[1..3000000000] = 1 m", "", 6),
    "coordinates": ("  coord z[1..7000000000]: translation", "", 6),
    "states": ("  param n = 2000000000\n  state s[1..n]\n  for i in 1..n { dynamic s[i]' = 1 rad/s }", "", 7),
    "nodes": ("  node a[1..5000000000]: electrical", "", 6),
    "branches": (f"  node a: electrical\n  for i in 1..5000000000 {{ {RESISTOR.format(at='i')} }}", "", 7),
    "a list out of an array": ("  param z[1..3000000000] = 1 m\n  let y = norm(z)", "", 7),
    "a range written out": ("  let b = [1, 2]\n  let y = sum(i in 1..3000000000: b[1]*i)", "", 7),
    "a triangle": (
        f"  node a: electrical\n  for i in 1..200000 {{ for j in 1..i {{\n    {RESISTOR.format(at='i, j')}\n  }} }}",
        "",
        8,
    ),
}


@pytest.mark.parametrize("kind", LARGE)
@pytest.mark.one_in(12)
def test_what_asks_for_more_than_there_is_has_a_place(kind, monkeypatch):
    monkeypatch.setattr(budget, "GRANTED", 1 << 30)  # what is counted one by one comes to its end sooner
    body, head, line = LARGE[kind]
    network, report = judged(body, head)
    assert network is None
    (found,) = [d for d in report if d.severity == "error"]
    assert found.code == "E119"
    # an instance is found too many inside the component that asks for it
    assert found.place.start[0] == line if line else found.place.start[0] in range(4, len(head.split("\n")))


def test_the_size_that_an_array_would_need_is_said():
    _, report = judged("  param z[1..3000000000] = 1 m")
    (found,) = report
    need = 3e9 * budget.NUMBER
    assert f"the 3000000000 elements of 'z' need {need / 1e9:.3g} GB" in found.message


def test_large_arrays_that_fit_are_taken():
    network, report = judged("  param z[1..1000000] = 1 m\n  let y = sum(i in 1..1000000: z[i])")
    assert network is not None, list(report)


def test_the_stages_after_the_front_end_draw_on_it_too(monkeypatch):
    from sysdyn.compiler.pipeline import compile_network
    from sysdyn.dsl.text.diagnostics import ModelError

    network, _ = judged("  energy V = 1 N*x")
    monkeypatch.setattr(budget, "memory_limit", lambda: 3 * budget.NODE)
    with pytest.raises(ModelError) as caught:
        compile_network(network, "lagrangian", "numpy")
    assert [d.code for d in caught.value.diagnostics] == ["E119"]
    assert budget._budget.left == float("inf")


def test_findings_beyond_the_cap_are_counted():
    text = "const a = 1\n" * 900
    source = SourceText("many.sd", text)
    errors = [Diagnostic("E101", f"said {k}", source.place(12 * k, 12 * k + 5)) for k in range(MOST + 37)]
    other = [Diagnostic("E101", "said", SourceText("few.sd", text).place(0, 3))]
    warnings = [Diagnostic("W201", f"said {k}", source.place(12 * k, 12 * k + 5)) for k in range(MOST)]
    kept = limit_findings([*errors, *other, *warnings])
    assert [d for d in kept if d.severity != "note"] == [*errors[:MOST], *other, *warnings]
    (note,) = [d for d in kept if d.severity == "note"]
    assert note.code == "N101"
    assert note.message == "37 more errors of this file are not shown"
    assert note.place == errors[MOST].place


def test_a_file_of_many_mistakes(tmp_path, capsys):
    import json

    from sysdyn.cli.main import run

    path = tmp_path / "many.sd"
    path.write_text(MODEL.format(head="", body="".join(f"  let a{k} = nothing{k}\n" for k in range(730))))
    assert run(["check", str(path)]) == 1
    err = capsys.readouterr().err
    assert len(re.findall(r"^error E101", err, re.M)) == MOST
    assert "530 more errors of this file are not shown" in err
    assert err.rstrip().endswith("730 errors")
    assert run(["check", "--json", str(path)]) == 1
    found = json.loads(capsys.readouterr().out)["diagnostics"]
    assert len(found) == MOST + 1


ELEMENTS = "state a[1..n]: 1 = 0\n  dynamic a[1]' = 1 s^-1\n  for i in 2..n {\n    dynamic a[i]' = 1 s^-1\n  }"


@pytest.mark.parametrize(
    ("body", "code"),
    [
        (f"param n = 1e300\n  {ELEMENTS}", "E805"),
        (f"param n = 1e9\n  {ELEMENTS}", "E119"),
        ("param n = 1e9\n  for i in 1..n {\n    require i*m > 0 kg\n  }", "E119"),
        ("param n = 1e9\n  param s = sum(i in 1..n: 1/i)", "E119"),
        ("param n = inf\n  param s = sum(i in 1..n: 1/i)", "E805"),
        ("param n = 1e200\n  param s = sum(i in 1..n*n: 1/i)", "E805"),
    ],
)
def test_a_size_beyond_all_memory_is_told_before_its_elements_are_gone_through(body, code):
    """By the command line, `--set n=1e20` of a beam took all memory and never came back."""
    network, report = judged(body)
    assert network is None
    assert {found.code for found in report.diagnostics} == {code}
