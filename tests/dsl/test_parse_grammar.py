"""The grammar, its tables, and lark's own parser of it as a second witness."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from sysdyn.dsl.parser import grammar
from sysdyn.dsl.parser.grammar import build_lark, build_tables, load_tables
from sysdyn.dsl.parser.lexing import CONTINUES
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.source import SourceText

CORPUS = sorted((Path(__file__).parent / "corpus").glob("*.sd"))


def test_the_tables_are_those_of_the_grammar():
    """Without conflicts: the grammar is built with strict=True, which raises where there is one."""
    pytest.importorskip("interegular")
    assert load_tables() == build_tables(strict=True)


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A folder with the grammar and no tables."""
    text = (Path(grammar.__file__).parent / "sd.lark").read_text(encoding="utf-8")
    (tmp_path / "sd.lark").write_text(text, encoding="utf-8")
    monkeypatch.setattr(grammar, "_GRAMMAR", tmp_path / "sd.lark")
    monkeypatch.setattr(grammar, "_TABLES", tmp_path / "sd.tables")
    return tmp_path


def test_absent_tables_are_built_once_and_those_of_another_grammar_again(elsewhere, monkeypatch):
    tables = load_tables()
    assert {path.name for path in elsewhere.iterdir()} == {"sd.lark", "sd.tables"}
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "lark", None)
        assert load_tables() == tables
    with (elsewhere / "sd.lark").open("a", encoding="utf-8") as file:
        file.write("\nspare: NAME NAME\n")
    assert load_tables() == tables  # no rule leads there, but it was built
    assert (elsewhere / "sd.tables").read_text().partition("\n")[0] == grammar._fingerprint(
        (elsewhere / "sd.lark").read_text()
    )


def test_without_tables_and_lark_the_remedy_is_said(elsewhere, monkeypatch):
    monkeypatch.setitem(sys.modules, "lark", None)
    with pytest.raises(ImportError, match=r"tables of .*sd\.lark are not built, and lark is missing: pip install lark"):
        load_tables()


def test_a_folder_that_cannot_be_written_is_none_of_the_reader_s_business(elsewhere, monkeypatch):
    monkeypatch.setattr(grammar, "_TABLES", elsewhere / "missing" / "sd.tables")
    assert load_tables() == build_tables()


class Newlines:
    """The newline rule for lark: no look-ahead, dropped in ( ) [ ] and after what continues."""

    always_accept = ("_NL",)

    def process(self, stream):
        depth = 0
        last = "_NL"
        for token in stream:
            if token.type == "_NL":
                if ";" not in token and (depth or last in CONTINUES):
                    continue
                if last in ("_NL", "{"):
                    continue
                last = "_NL"
            else:
                depth += (token in ("(", "[")) - (token in (")", "]"))
                word = str(token)
                # 'T*' ends no line with an operator, a name 'on' none either
                last = "" if token.type in ("NAME", "STATE_FUNCTION") else word
            yield token


@pytest.fixture(scope="module")
def lark():
    pytest.importorskip("interegular")
    from lark import Lark

    text = (Path(grammar.__file__).parent / "sd.lark").read_text(encoding="utf-8")
    assert build_lark(strict=True) is not None
    return Lark(text, parser="lalr", lexer="contextual", start="start", postlex=Newlines(), strict=True)


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: path.stem)
@pytest.mark.long
def test_lark_accepts_the_corpus_too(lark, path):
    text = SourceText.read(path).text
    ours = parse(SourceText("t", text))[0]
    theirs = lark.parse(text)
    assert len(theirs.children) == len(ours.items)


WRONG = [
    "model m { time 0 s to 1 s }",
    "const a = 1 ** 2",
    "scene s of m { param k = 1 }",
    "const a = (1",
    "fn f() = 2",
]


@pytest.mark.parametrize("text", WRONG)
def test_lark_refuses_what_we_refuse(lark, text):
    from lark.exceptions import LarkError

    assert parse(SourceText("t", text))[1]
    with pytest.raises(LarkError):
        lark.parse(text)
