"""The grammar, its tables, and lark's own parser of it as a second witness."""

from __future__ import annotations

from pathlib import Path

import pytest
from sysdyn.dsl.parser import table
from sysdyn.dsl.parser.grammar import build_lark, table_text
from sysdyn.dsl.parser.lexing import CONTINUES
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.source import SourceText

CORPUS = sorted((Path(__file__).parent / "corpus").glob("*.sd"))


def test_the_tables_are_those_of_the_grammar():
    """Without conflicts: the grammar is built with strict=True, which raises where there is one."""
    pytest.importorskip("interegular")
    assert Path(table.__file__).read_text(encoding="utf-8") == table_text()


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

    text = (Path(table.__file__).parent / "sd.lark").read_text(encoding="utf-8")
    assert build_lark() is not None
    return Lark(text, parser="lalr", lexer="contextual", start="start", postlex=Newlines(), strict=True)


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: path.stem)
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
