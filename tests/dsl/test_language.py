"""The pages of the language: every example is true, and nothing of the language is missing from them."""

import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from sysdyn.cli.main import run
from sysdyn.cli.manual import topics
from sysdyn.dsl.format.format import format_text
from sysdyn.dsl.model import dimensions, units
from test_code_examples import found

ROOT = Path(__file__).resolve().parents[2]
PAGES = topics.topics()
FENCES = topics.examples()
EXAMPLES = [e for e in FENCES if e.kind == "sd"]
LONGEST, WIDEST = 80, 114
LONG = ("tutorial",)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda e: f"{e.topic}{EXAMPLES.index(e)}")
@pytest.mark.long
def test_example_is_right_or_wrong_as_it_says(example):
    raised = found(example.text)
    errors = {c for c in raised if c[0] == "E"}
    assert errors == ({example.code} if example.code else set())


@pytest.mark.parametrize("example", [e for e in EXAMPLES if not e.code], ids=lambda e: f"{e.topic}{EXAMPLES.index(e)}")
@pytest.mark.one_in(77)
def test_scenes_of_an_example_run(example, tmp_path, capsys):
    """A coil whose linkage cannot pass 1 mWb stopped at 0.1 ms under 10 V (E930), on the page of components."""
    (tmp_path / "m.sd").write_text(example.text)
    for scene in re.findall(r"^scene (\w+) of", example.text, re.M):
        asked = ["simulate", "-q", "--backend", "numpy", str(tmp_path / "m.sd"), "--scene", scene]
        assert run([*asked, "-o", str(tmp_path / "out.h5")]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda e: f"{e.topic}{EXAMPLES.index(e)}")
def test_example_is_laid_out_as_fmt_does(example):
    assert format_text(example.text) == example.text


@pytest.mark.parametrize("page", PAGES.values(), ids=lambda t: t.name)
def test_page_is_one_page_and_prints(page, capsys):
    assert page.title
    assert len(page.text.splitlines()) <= LONGEST * (1 + (page.name in LONG))
    assert max(map(len, page.text.splitlines())) <= WIDEST
    assert run(["help", page.name]) == 0
    out = capsys.readouterr().out
    assert out.startswith(f"{page.name}: {page.title}\n")
    assert "```" not in out
    for example in (e for e in EXAMPLES if e.topic == page.name):
        assert all(line.strip() in out for line in example.text.splitlines())


def test_pages_are_named_in_their_order_and_by_the_readme():
    assert list(PAGES) == list(topics.FIRST)
    readme = (ROOT / "dsl" / "README.md").read_text()
    assert re.findall(r"\(language/(\w+)\.md\)", readme) == list(topics.FIRST)
    files = {p.stem for p in (ROOT / "dsl" / "language").glob("*.md")}
    assert files == set(PAGES)


def test_units_are_all_there():
    text = PAGES["units"].text
    said = re.search(r"Units: (.*?), and 1\.\s+Prefixes (.*?) stand before (.*?)\.\s", text, re.S)
    names, prefixes, takers = (set(part.replace("(or µ)", "").split()) for part in said.groups())
    assert names == set(units.names())
    for name in names:
        takes = {p for p in prefixes if units.find_unit(p + name) and units.find_unit(p + name) != units.find_unit("1")}
        assert (name in takers) == (len({p for p in takes if p + name not in names}) > 3), name
    assert prefixes == set("fpnumcdkMGT")


def test_functions_are_all_there():
    words = set(re.findall(r"[a-z_0-9]+", " ".join(re.findall(r"`([^`]*)`", PAGES["expressions"].text))))
    assert set(dimensions.FUNCTIONS) | {"sum", "prod", "dot", "cross", "norm"} <= words


def test_statements_are_all_there():
    """Each word that begins a statement in the grammar stands in the code of some page."""
    grammar = (ROOT / "dsl" / "parser" / "sd.lark").read_text()
    body = grammar.partition("// ---- units")[0]
    words = set(re.findall(r'^\??\w+: "([a-z]+)"', body, re.M)) | {"coord", "cocoord", "phi", "psi", "gamma"}
    assert len(words) > 35
    code = " ".join(a or b for a, b in re.findall(r"```sd(.*?)```|`([^`\n]*)`", _all(), re.S))
    said = set(re.findall(r"\b[a-z]+\b", code))
    assert words <= said, words - said


def _all():
    return "\n".join(page.text for page in PAGES.values())


@pytest.mark.parametrize(
    ("word", "name"), [("unit", "units"), ("functions", "expressions"), ("phi", "constraints"), ("scene", "scenes")]
)
def test_words_lead_to_their_page(word, name):
    assert topics.find_topic(word).name == name


def test_help_knows_commands_and_codes(capsys):
    assert run(["help"]) == 0
    out = capsys.readouterr().out
    assert all(f"  {name} " in out for name in PAGES)
    assert run(["help", "simulate"]) == 0
    assert capsys.readouterr().out.startswith("Usage: sysdyn simulate")
    assert run(["help", "e203"]) == 0
    assert "E203" in capsys.readouterr().out
    assert run(["help", "unts"]) == 2
    assert "nearest: 'units'" in capsys.readouterr().err


@pytest.mark.parametrize("page", sorted({e.topic for e in FENCES if e.kind == "sh"}))
def test_commands_of_a_page_run_in_their_order(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    commands = 0
    for fence in (f for f in FENCES if f.topic == page):
        if fence.file:
            (tmp_path / fence.file).write_text(fence.text)
        elif fence.kind == "sh":
            for line in fence.text.splitlines():
                name, *arguments = line.split()
                assert name == "sysdyn"
                assert run(arguments) == 0, (line, capsys.readouterr().err)
                commands += 1
    assert commands > 10
    assert (tmp_path / "control.html").stat().st_size > 10_000
    assert list(tmp_path.glob("golden/*/*.h5"))


def test_the_page_of_accuracy_names_every_exit_code():
    from sysdyn.cli import failures

    rows = re.findall(r"^\| (\d+) \|", PAGES["accuracy"].text, re.M)
    assert rows == ["0", "1", "2", "3", "4", "5", "130"]
    assert {failures.USAGE, failures.SOLVER, failures.FAULT, failures.INPUT_OUTPUT, failures.INTERRUPTED} <= set(
        map(int, rows)
    )
