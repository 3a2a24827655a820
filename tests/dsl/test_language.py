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
EXAMPLES = topics.examples()
LONGEST, WIDEST = 80, 114


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda e: f"{e.topic}{EXAMPLES.index(e)}")
def test_example_is_right_or_wrong_as_it_says(example):
    raised = found(example.text)
    errors = {c for c in raised if c[0] == "E"}
    assert errors == ({example.code} if example.code else set())


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda e: f"{e.topic}{EXAMPLES.index(e)}")
def test_example_is_laid_out_as_fmt_does(example):
    assert format_text(example.text) == example.text


@pytest.mark.parametrize("page", PAGES.values(), ids=lambda t: t.name)
def test_page_is_one_page_and_prints(page, capsys):
    assert page.title
    assert len(page.text.splitlines()) <= LONGEST
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
        takes = {p for p in prefixes if units.known(p + name) and units.known(p + name) != units.known("1")}
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
    assert topics.named(word).name == name


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
