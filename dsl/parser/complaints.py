"""Sentences for errors of syntax, in the author's terms: what was found, what was expected.

Pure functions from words and sets of terminals to (code, message, help).
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection

from sysdyn.dsl.model.functions import FUNCTIONS
from sysdyn.dsl.parser.shapes import OTHERS, SHAPES

# fmt: off
BLOCKS = ("model", "component", "scene", "domain", "bundle")
"""Items of a file that have a block."""
MODEL_WORDS = frozenset(
    {
        "param", "node", "port", "branch", "input", "output", "quasi", "coord", "cocoord", "implicit",
        "state", "discrete", "dynamic", "let", "law", "energy", "content", "work", "phi", "psi", "gamma", "init",
        "when", "every", "for", "level", "require", "expect", "lossless",
    }
)
SCENE_WORDS = frozenset(
    {
        "time", "set", "level", "init", "trace", "accuracy", "formulation", "solver", "redundancy", "limit",
        "expect", "when",
    }
)
ITEM_WORDS = frozenset(
    {
        "from", "domain", "bundle", "unit", "const", "fn", "table", "component", "model", "scene",
    }
)
DOMAIN_WORDS = frozenset(
    {
        "effort", "flow", "momentum", "displacement", "node", "ground", "pseudo",
    }
)
# fmt: on

_OWN = {
    "statement": MODEL_WORDS,
    "scene_statement": SCENE_WORDS,
    "item": ITEM_WORDS,
    "role": DOMAIN_WORDS,
    "bundle_member": frozenset[str](),
    "action": frozenset[str](),
}
_HERE = {
    "statement": "in a model",
    "scene_statement": "in a scene",
    "item": "at the top of a file",
    "role": "in a domain",
    "bundle_member": "in a bundle",
    "action": "among the actions of 'when' or 'every'",
}
_CONTINUE = "end the line above with a comma, or break it inside the parentheses"
_SIGNS = {
    "&": "and",
    "|": "or between conditions; abs(x)",
    "!": "not, !=",
    "%": "percent (the unit), or mod(a, b)",
    "\u2019": "' (the straight apostrophe)",
    "\u2018": "' (the straight apostrophe)",
    "\u201c": '" (the straight quotation mark)',
    "\u201d": '" (the straight quotation mark)',
    "\u2032": "' (the straight apostrophe)",
    "\u2212": "- (the hyphen of the keyboard)",
    "\u2013": "- (the hyphen of the keyboard)",
    "\u00b7": "* between factors, . between units",
    "\u00d7": "*",
    "\u22c5": "*",
    "\u2219": "*",
    "\u2217": "*",
    "\u00f7": "/",
    "\u2264": "<=",
    "\u2265": ">=",
    "\u2260": "!=",
    "\u00a0": "an ordinary space",
    "\u202f": "an ordinary space",
    "\u00b0": "deg",
    "@": "at, in 'expect at 1 s: ...'",
}
_ATOMS = frozenset({"<name>", "<number>", "<quantity>", "<text>", "(", "[", "-", "true", "false", "not", "if", "$"})
_OPERATORS = frozenset({"+", "-", "*", "/", "^", "==", "!=", "<", ">", "<=", ">=", "and", "or", "."})
_CLASSES = {
    "<number>": "a number",
    "<text>": 'a text in quotes "..."',
    "<index>": "2v",
    "<function>": "one of T* T V* V (energies), D G (contents)",
    "<newline>": "the end of the statement",
    "<end>": "the end of the file",
}
_GROUPS = (
    (frozenset({"effort", "flow", "momentum", "displacement"}), "'effort', 'flow', 'momentum' or 'displacement'"),
    (frozenset({"linear", "pchip", "cubic", "hold"}), "'linear', 'pchip', 'cubic' or 'hold'"),
)

_ASSIGNED = re.compile(r"=\s*([\w.]+\(.*->[^#]*)")
"""An element behind a sign of equality."""
_DECLARED = re.compile(r"(\w+)\s*\((.*?)\)\s*([\w\[\]]+\s*->\s*[\w\[\]]+)?\s*;?\s*(?:#.*)?$")
"""A label behind its component: name, parameters, nodes."""

_EXPRESSIONS = frozenset(
    {"energy", "content", "work", "let", "law", "phi", "psi", "gamma", "dynamic", "output", "const"}
)
"""Statements that end with an expression."""

MOTION = "energy T* = 1/2*m*x'^2, energy V, content D, work F on x: the equations of motion follow from them"
"""In place of an equation of motion."""

Complaint = tuple[str, str, str | None]
"""Code, message, help."""


def quote_token(text: str, kind: str = "") -> str:
    """What was found, for a message."""
    if kind == "<end>":
        return "the end of the file"
    if kind == "<newline>" or text in (";", "\n", "\r"):
        return "';'" if text == ";" else "the end of the line"
    shown = text if len(text) <= 40 else text[:36] + "..."
    return f"'{shown}'"


def character(sign: str) -> Complaint:
    """A character that begins no token."""
    name = unicodedata.name(sign, "a control character").lower()
    shown = f"'{sign}'" if sign.isprintable() and sign != "\u00a0" else "a character"
    unseen = "delete it: editors do not show it" if unicodedata.category(sign) in ("Cc", "Cf") else None
    unseen = "one character for the letter and its accent (Unicode NFC)" if unicodedata.combining(sign) else unseen
    return "E113", f"{shown} (U+{ord(sign):04X}, {name}) has no meaning here", _SIGNS.get(sign, unseen)


def first_token(text: str, kind: str, body: str) -> Complaint:
    """A sign where a statement should begin."""
    if text[0] in "/%!":
        return "E113", f"'{text}' begins no statement and no comment", "a comment begins with '#'"
    if kind == "<end>":
        return "E113", "the file ends where a statement should begin", None
    if text in ("}", ")", "]"):
        return "E112", f"'{text}' closes nothing that is open", None
    if kind == "<newline>":
        return "E113", "';' ends nothing here", None
    if text == "{":
        return "E109", "a statement cannot begin with '{'", "the '{' at the end of the line above"
    return "E109", f"a statement cannot begin with {quote_token(text, kind)}", _CONTINUE


def connection() -> Complaint:
    """A line that only continues the element above it."""
    return "E109", "a statement cannot begin with a connection", _CONTINUE


def conditional(after: str) -> Complaint:
    """`if` inside an expression; after: the rest of its line."""
    if re.match(r"(?!.*\bthen\b).*\belse\b", after):  # u if t > 1 s else 0
        return "E113", "a choice begins with its condition", "if c then a else b"
    message = "a conditional in a relation or inside an expression needs parentheses"
    return "E110", message, "(if ... then ... else ...)"


def unknown_statement(word: str, after: str, body: str, text: str = "") -> Complaint:
    """A statement whose first word begins no statement of this body; `after` is what stands behind it in the text."""
    here = _HERE[body]
    # a statement of another place: `trace x` in a model
    if word not in _OWN[body]:
        for words, place in (
            (SCENE_WORDS, "in a scene"),
            (MODEL_WORDS, "in a model or component"),
            (ITEM_WORDS, "at the top of a file"),
        ):
            if word in words:
                into = place.replace("in ", "into ", 1).replace("at the", "to the")
                help_ = (
                    f"const NAME = ..., or move it {into}" if word == "param" and body == "item" else f"move it {into}"
                )
                if body == "scene_statement":
                    named = re.match(r"\w+", after)
                    given = f"set {named[0] if named else 'u'} = ..."
                    help_ = {"output": "trace x in mm", "input": given}.get(word, help_)
                return "E107", f"'{word}' belongs {place}, not {here}", help_
    if body == "action":
        return "E113", "an action assigns: name := expression", None
    if body == "bundle_member":
        return "E113", "a bundle lists nodes: x, y: translation", None
    # `resistor(R = 1 ohm) a -> b` without a label
    if body == "statement" and (element := _element(word, after.partition("\n")[0], text)) is not None:
        return "E113", f"no statement begins with '{word}'; an element has a label", element
    # L = T - V as one function
    if word in ("L", "Lagrangian") and body == "statement" and re.match(r"=[^\n]*'", after) is not None:
        return "E113", f"no statement begins with '{word}'; a Lagrangian is written by its parts", MOTION
    # `k = 3 N/m` without its word
    if after.startswith("=") and not after.startswith("=="):
        wanted = "set" if body == "scene_statement" else "const" if body == "item" else "let"
        wanted = "law" if body == "statement" and word in ("e", "f", "q", "p") else wanted
        return (
            "E113",
            f"no statement begins with '{word}'; a value is given by a word before it",
            f"{wanted} {word} = ...",
        )
    # `spring.k = 3 N/m`
    if body != "item" and (member := re.match(r"(?:\.\w+)+'?(?=\s*=(?!=))", after)) is not None:
        path = f"{word}{member[0]}"
        given = f", set {path} = ... of a parameter" if body == "scene_statement" else ""
        return "E113", f"no statement begins with '{path}'", f"init {path} = ... where it begins{given}"
    # `x' = 3`
    if after.startswith("'"):
        help_ = f"init {word}' = ... where it begins, dynamic {word}' = ... of a state"
        help_ = f"names of a trace are joined by commas: trace x, {word}'" if body == "scene_statement" else help_
        help_ = MOTION if after.startswith("''") else help_
        return "E113", f"no statement begins with '{word}''", help_
    # `m*x'' = -k*x`
    if "''" in after.partition("=")[0] and "=" in after:
        return "E113", f"no statement begins with '{word}'; equations of motion are not written", MOTION
    # `x^2 + y^2 = l^2` without phi
    if after[:1] in "^*/+-" and after and "=" in after.partition("\n")[0]:
        return "E113", f"no statement begins with '{word}'; a constraint has a label", f"phi name: {word} ... = ..."
    from difflib import get_close_matches

    # `translation x = 1 m`, in the order of declarations in C
    named = re.match(r"(\w+)\s*([=~].*)", after.partition("#")[0])
    if body == "statement" and named is not None and word in ("translation", "rotation"):
        return "E113", f"no statement begins with '{word}'", f"coord {named[1]}: {word} {named[2].strip()}"
    # a word that differs by little, or one of other languages
    near = get_close_matches(word, sorted(_OWN[body] | MODEL_WORDS | SCENE_WORDS | ITEM_WORDS), 1, 0.7)
    said = OTHERS.get(word.lower(), "").replace("DOMAIN", word.lower())
    if after.startswith("(") and body == "statement" and not said and (not near or near[0] not in MODEL_WORDS):
        label = f"{word[0].upper()}1: {word}(...) a -> b"
        return "E113", f"no statement begins with '{word}'; an element has a label", label
    return "E113", f"no statement begins with '{word}'", said or (near[0] if near else None)


def _element(word: str, after: str, text: str) -> str | None:
    """The element that is meant by `R1 = resistor(...) a -> b`, by `resistor R1(...)` and by `R1 resistor(...)`."""
    assigned = _ASSIGNED.match(after)
    if assigned is not None:
        return f"{word}: {assigned[1].strip()}"
    declared = _DECLARED.match(after)
    if declared is None:
        return None
    turned = _is_component(declared[1], text) and not _is_component(word, text)
    label, component = (word, declared[1]) if turned else (declared[1], word)
    return f"{label}: {component}({declared[2]}) {declared[3] or 'a -> b'}"


def _is_component(name: str, text: str) -> bool:
    """Whether a file imports or declares a component of that name."""
    return re.search(rf"\bimport\b[\w\s,]*?\b{name}\b|^\s*component\s+{name}\b", text, re.MULTILINE) is not None


def unexpected_token(accepted: Collection[str], kind: str, text: str, line: str, word: str = "") -> Complaint:
    """A token that does not fit, with what would; `line` is the line up to it, `word` begins the statement."""
    said = f"expected {_describe_terminals(accepted)}, found {quote_token(text, kind)}"
    shape = SHAPES.get(word)
    # let x^2 + y^2 = l^2
    if word == "let" and text in ("^", "*", "+", "-", "/") and "=" not in line:
        return "E113", "a let names one value; a constraint has a label", "phi name: ... = ... of displacements"
    # param a = 1, b = 2
    if text == "," and word in ("param", "state", "let", "input", "output", "const", "discrete"):
        shape = f"one name a statement: {SHAPES.get(word, word + ' on = false')}"
    # work 2 x on q
    if kind == "<name>" and "*" in accepted and (word in _EXPRESSIONS or ")" in accepted):
        shape = f"factors are joined by '*': ... * {text}"
    # sum(x[i] for i in 1..n)
    reduced = re.search(r"\b(sum|prod|max|min)\((?:[^()]|\([^()]*\))*$", line)
    if text == "for" and reduced is not None:
        return "E113", said, f"the index stands first: {reduced[1]}(i in 1..n: ...)"
    # 3 sin(x): read as a unit
    unit = re.search(r"([\d.]+)\s+([^\W\d]\w*)$", line)
    if text == "(" and "*" in accepted and unit is not None:
        called = "(...)" if unit[2] in FUNCTIONS else "*(...)"
        meant = f"factors are joined by '*': {unit[1]}*{unit[2]}{called}"
        return "E113", f"'{unit[2]}' stands where a unit is read", meant
    # 3 N x[1]
    last = re.search(r"([\d.]+\s+[^\s()]*?)\s*([./]?)([^\W\d]\w*)$", line)
    if text == "[" and word != "param" and "*" in accepted and last is not None:
        meant = f"the variable stands apart: {last[1].strip()} {'/' if last[2] == '/' else '*'} {last[3]}[...]"
        return "E113", f"'{last[3]}' stands where a unit is read", meant
    if word == "work" and line.split()[-1:] == ["on"]:
        shape = SHAPES["work"]
    # param k: 3 N/m
    if word in ("param", "const", "coord", "state") and re.search(r":\s*[-+]?[\d.]+$", line):
        shape = f"a value stands behind '=': {SHAPES[word]}"
    if word == "param" and text == "[":
        shape = "a unit has no brackets: param k = 3 N/m"
    # node a b: electrical
    if (
        kind == "<name>"
        and "," in accepted
        and (word in ("from", "node", "port", "coord", "implicit") or "as" in accepted)
    ):
        colon = ":" in accepted and text in _DOMAINS
        joined = f"{' '.join(line.split())}{':' if colon else ','} {text}"
        shape = joined if word != "trace" else f"{joined}; a name of one's own: as {text}"
    # cell.a[1] = n1
    member = re.search(r"(\w+)(?:\.\w+|\[[^\]]*\])+\s*$", line)
    if text == "=" and "->" in accepted and member is not None:
        return "E113", said, f"a port is given whole, a bundle as one of nodes, an array as an array: {member[1]} = ..."
    # trace x as pos in mm
    if word == "trace" and text == "in":
        shape = "the unit stands before the name: trace x in mm as pos"
    return "E113", said, _hint(kind, text, line, accepted) or shape


def _describe_terminals(accepted: Collection[str]) -> str:
    """Terminals in the author's terms."""
    rest = set(accepted)
    parts: list[str] = []
    # groups of terminals by one word, so that the list is short
    if {"(", "<name>", "<number>"} <= rest:
        parts.append("an expression")
        rest -= _ATOMS
    elif "$" in rest:
        parts.append("a unit")
        rest -= {"$", "<name>", "<number>"}
    elif "<name>" in rest:
        parts.append("a name")
        rest -= {"<name>"}
    for words, said in _GROUPS:
        if words <= rest:
            parts.append(said)
            rest -= words
    # operators together
    if len(rest & _OPERATORS) > 2:
        parts.append("an operator")
        rest -= _OPERATORS | {"(", "[", "'", "^"}
    if {"<=", ">=", "=="} <= rest:
        parts.append("a comparison")
        rest -= {"==", "!=", "<", ">", "<=", ">="}
    if "<newline>" in rest:
        parts.append(_CLASSES["<newline>"])
        rest -= {"<newline>", "<end>", "}"}
    # what is left one by one, the first few
    signs = sorted(rest, key=lambda terminal: (terminal.isalpha(), terminal))
    parts.extend(_CLASSES.get(terminal, f"'{terminal}'") for terminal in signs[: max(1, 6 - len(parts))])
    if not parts:
        return "nothing more"
    return parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " or " + parts[-1]


_DOMAINS = ("translation", "rotation", "electrical", "hydraulic", "thermal", "heat", "planar")
"""Of the prelude: what stands behind the colon of a declaration."""
_OPENS = {")": "(", "]": "["}


def _hint(kind: str, text: str, line: str, accepted: Collection[str]) -> str | None:
    """The text to write for a slip that is easily named."""
    # each test is one slip, named by the token that does not fit and what stands before it
    before = line[-1:]
    if text in (")", "]") and text not in accepted and line.count(_OPENS[text]) <= line.count(text):
        return f"one '{'(' if text == ')' else '['}' more before it, or delete it"
    if text == "*" and before == "*":
        return "a power is written a^b"
    if text == "(" and "on" in accepted:
        return "a -> b, without parentheses"
    if text == "(" and "[" in accepted and "on" not in accepted and not {"*", "->"} & set(accepted):
        return "an index, or a range 0..n, stands in square brackets: v[0..n]"
    if text == ":" and ".." in accepted:
        return "a range is written with two points: 0..n"
    if text == "," and ":=" in line:
        return "actions stand on lines of their own, or ';' between them"
    if text == "+" and "<number>" in accepted:
        return "a number has no leading '+'"
    if text == "." and "<number>" in accepted:
        return "a number begins with a digit: 0.5"
    if kind == "<name>" and before.isdigit() and set(accepted) <= {",", ")"}:
        return "bare numbers here: their units stand in the head of the table"
    if text in ("<", ">", "<=", ">=", "==", "!=") and "and" in accepted:
        return "comparisons do not chain: a < b and b < c"
    if text in ("<", ">") and f"{text}=" in accepted:
        return f"{text}=, which holds at the contact too"
    if text == "," and "restitution" in accepted:
        return "phi name: left >= right restitution 0.7, without a comma"
    if text == "=" and line.rstrip().endswith("restitution"):
        return "restitution 0.7, without a sign"
    if text == "-" and "->" in accepted:
        return "a -> b: the arrow is one sign"
    if text == "if":
        return "the condition of a choice comes first: if c then a else b"
    if text != "<" and accepted and set(accepted) & {"then", "else"}:
        return "if c then a else b"
    if kind == "<name>" and "->" in accepted and before.isidentifier():
        return f"{before} -> {text}"
    if before == "." and kind != "<name>":
        return "a number ends with a digit: 5.0"
    divided = re.search(r"(\w[\w^/]*)/([a-z]\w*)$", line)
    if text == "(" and divided is not None:
        return f"{divided[2]} is read as a unit; to divide by its value: {divided[1]} / {divided[2]}(...)"
    number = re.search(r"[\d.]+$", line)
    if text == "1" and kind == "<number>" and number is not None:
        return f"a unit begins with a name: {number[0]} s^-1 for {number[0]} 1/s"
    return None
