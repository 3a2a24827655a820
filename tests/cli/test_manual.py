"""What the product says of itself: `list`, `std`, `help` and the index of `explain` tell the truth."""

import json
from pathlib import Path

import browser
import pytest
from pages import read
from sysdyn.cli.main import run
from sysdyn.cli.manual import library, topics
from sysdyn.dsl.text import codes
from sysdyn.dsl.tree import syntax

GALLERY = Path(__file__).resolve().parents[2] / "models" / "gallery"
COMPONENTS = [e for e in library.entries() if e.kind == "component"]


def listed(capsys, *arguments):
    assert run(["list", "--json", *map(str, arguments)]) == 0
    return json.loads(capsys.readouterr().out)["result"]["models"]


@pytest.mark.parametrize("path", sorted(GALLERY.glob("*.sd")), ids=lambda p: p.stem)
@pytest.mark.one_in(30)
def test_every_listed_name_can_be_traced(path, tmp_path, capsys):
    """A scene that traces all of them in the units said (the first element of arrays) is free of errors."""
    text = path.read_text()
    for account in listed(capsys, path):
        items = []
        for r in account["readable"]:
            name, unit = _first(r["name"]), r["unit"]
            items.append(f"{name}{'' if unit == '1' else f' in {unit}'} as n{len(items)}")
        assert len(items) > 5
        traced = ",\n    ".join(items)
        scene = f"\nscene all_names of {account['model']} {{\n  time 0 s to 1 s\n  trace {traced}\n}}\n"
        model = tmp_path / path.name
        model.write_text(text + scene)
        assert run(["list", "--scene", "all_names", str(model)]) == 0
        capsys.readouterr()
        assert _names_and_units(model, account["model"]) == []


def _first(name):
    """`v[0..9].e` as `v[0].e`."""
    out = ""
    for k, part in enumerate(name.split("[")):
        inside, closed, rest = part.partition("]")
        out += part if k == 0 else "[" + ", ".join(i.split("..")[0] for i in inside.split(", ")) + closed + rest
    return out


def _names_and_units(path, model):
    """Errors that judging names and units finds, under the scene that traces everything."""
    from sysdyn.dsl import load
    from sysdyn.dsl.model import expression as ex
    from sysdyn.dsl.text.diagnostics import Report

    report = Report()
    document = load.read(path, report)
    with ex.fresh():
        load.network(document, document.models[model], document.scenes["all_names"], report, required=False)
    return [(d.code, d.message) for d in report if d.severity == "error" and d.code[:2] in ("E1", "E2", "E9")]


def test_list_gives_values_in_their_own_units(tmp_path, capsys):
    (tmp_path / "m.sd").write_text(
        "## A box.\nmodel box {\n  ## how heavy\n  param m = 1.5 t\n  param n = 3\n  param k[1..n]: kN/m = 2 kN/m\n"
        "  param d: N.s/m\n  input F: N = 3 N*sin(t/(1 s))\n  input G: N = 2 kN\n  coord x: translation = 12 cm\n"
        "  energy T* = 1/2*m*x'^2\n  energy V = sum(i in 1..n: 1/2*k[i]*x^2)\n  work F - d*x' + G on x\n}\n"
    )
    (account,) = listed(capsys, "m.sd")
    assert account["doc"].startswith("A box.")
    values = {p["name"]: (p["value"], p["unit"], p["doc"]) for p in account["parameters"]}
    assert values["m"] == (1.5, "t", "how heavy")
    assert values["n"] == (3.0, "1", None)
    assert values["k[1..3]"][:2] == ([2.0, 2.0, 2.0], "kN/m")
    assert values["d"][:2] == (None, "N.s/m")
    inputs = {p["name"]: p["value"] for p in account["inputs"]}
    assert inputs == {"F": "3 N*sin(t/(1 s))", "G": 2000.0}
    assert {"x", "x'", "x''", "x.e", "x.p"} <= {r["name"] for r in account["readable"]}
    assert run(["list", "m.sd"]) == 0
    out = capsys.readouterr().out
    assert "required, in N.s/m" in out
    assert "1.5 t" in out


def test_list_shows_levels_and_takes_them(capsys):
    (plain,) = listed(capsys, GALLERY / "ev_powertrain.sd")
    (other,) = listed(capsys, GALLERY / "ev_powertrain.sd", "--level", "G=losses")
    levels = {c["path"]: c for c in plain["components"]}
    assert levels["G"]["levels"] == ["ideal", "losses"]
    assert levels["G"]["level"] == "ideal"
    assert "G.drag.e" not in {r["name"] for r in plain["readable"]}
    assert "G.drag.e" in {r["name"] for r in other["readable"]}


def test_list_of_a_wrong_text_says_what_is_wrong(tmp_path, capsys):
    (tmp_path / "m.sd").write_text("model m {\n  param a = b\n}\n")
    assert run(["list", "m.sd"]) == 1
    assert "error E101" in capsys.readouterr().err


def test_every_component_has_an_example_that_uses_it():
    for entry in COMPONENTS:
        text = library.example(entry)
        assert text is not None, entry.name
        assert f": {entry.name}(" in text or f": {entry.name}." in text


@pytest.mark.parametrize("entry", COMPONENTS, ids=lambda e: e.name)
@pytest.mark.one_in(77)
def test_example_of_a_component_runs(entry, tmp_path, capsys):
    (tmp_path / "example.sd").write_text(library.example(entry))
    assert run(["check", "--strict", "example.sd"]) == 0, capsys.readouterr().err
    assert run(["simulate", "-q", "--backend", "numpy", "example.sd"]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("entry", library.entries(), ids=lambda e: e.name)
@pytest.mark.one_in(39)
def test_page_of_an_entry_holds_what_its_text_declares(entry, capsys):
    assert run(["std", entry.name]) == 0
    page = capsys.readouterr().out
    assert entry.line in page
    assert max(map(len, page.splitlines())) <= 132
    if entry.kind == "component":
        for statement in entry.item.body:
            if isinstance(statement, (syntax.ParamStatement, syntax.InputStatement)):
                assert f"\n  {statement.decl.name} " in page
            if isinstance(statement, syntax.PortStatement):
                assert all(f"{d.name} ({statement.domain.name})" in page for d in statement.decls)


def test_index_of_the_library_names_everything(capsys):
    assert run(["std"]) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines() if line.startswith("  ")}
    assert set(lines) == {e.name for e in library.entries()}
    assert all(len(line.split()) > 2 for line in lines.values()), "each has a line of its own"
    assert run(["std", "std.electrical", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["result"]["entries"]
    assert {e["module"] for e in found} == {"electrical"}


@pytest.mark.parametrize(("name", "said"), [("resitor", "nearest: 'resistor'"), ("kinetic", "help elements")])
def test_unknown_names_of_the_library_lead_on(name, said, capsys):
    assert run(["std", name]) == 2
    assert said in capsys.readouterr().err


@pytest.fixture
def site(tmp_path, capsys):
    assert run(["help", "--html", "site.html"]) == 0
    assert capsys.readouterr() == ("", "site.html\n")
    return tmp_path / "site.html"


def test_the_page_of_everything_is_whole_and_loads_nothing(site):
    page = read(site)  # links and ids fit, nothing comes from outside
    assert page.scripts == []
    assert set(topics.topics()) | {"std", "codes"} | set(codes.codes()) <= set(page.ids)
    assert {f"std-{e.module}-{e.name}" for e in library.entries()} <= set(page.ids)
    words = page.words
    for example in topics.examples():
        assert example.text.strip("\n") in words
    for entry in COMPONENTS:
        assert library.example(entry).strip("\n") in words
        assert entry.doc in words
    for code in codes.codes().values():
        assert code.title in words
    assert len(page.links) > 60, "pages and codes are linked where they are named"
    assert "**" not in words.replace("x**2", "").replace("x'**2", "")


def test_the_page_of_everything_goes_to_standard_output(capsys):
    assert run(["help", "--html", "-"]) == 0
    assert capsys.readouterr().out.startswith("<!doctype html>")
    assert run(["help", "units", "--html", "-"]) == 2


@pytest.mark.skipif(browser.found() is None, reason="there is no browser")
@pytest.mark.parametrize("width", [1200, 380])
def test_the_page_of_everything_in_a_browser(site, width):
    made = browser.Browser(width=width)
    try:
        made.open(site)
        assert made.errors == []
        assert [r for r in made.requests if not r.startswith("file:")] == []
        assert made.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), "it scrolls sideways"
    finally:
        made.close()
