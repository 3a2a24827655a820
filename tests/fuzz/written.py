"""Texts and netlists that are written from a seed: events, arrays, levels, tables, numbers that overflow."""

from __future__ import annotations

import random

NUMBERS = ("0", "1", "2", "-1", "0.5", "1e3", "1e-3", "1e300", "1e-300", "1e308", "inf", "(1e300*1e300)", "-0", "7")
PLAIN = ("sin", "cos", "tanh", "exp", "ln", "sqrt", "abs", "sign", "floor", "step", "cosh", "frac")
SLIP = 0.03
"""Of the choices that are wrong on purpose: most texts mean something, so that what follows the front end is reached."""  # noqa: E501
SLIPS = (
    "w",
    "R.f",
    "part",
    "w[7]",
    "audit.x",
    "x.multiplier",
    "1 m",
    "x",
    "q0",
    "f(1, 2)",
    "x''",
    "inf",
    "(1",
    "sum(i in 1..w: i)",
)


class Writer:
    """One text; chance: where its choices come from."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.known = ["(x/(1 m))", "(y/(1 m))", "(w[1]/(1 m))", "(t/(1 s))", "n", "(x'/(1 m/s))"]
        self.labels = 0

    def any(self, *of: str) -> str:
        """One of them."""
        return self.chance.choice(of)

    def number(self) -> str:
        """A number, now and then one that is hardly any."""
        return self.any(*NUMBERS) if self.chance.random() < 0.06 else f"{self.chance.uniform(0.1, 3.0):.3g}"

    def label(self, kind: str) -> str:
        """A name that nothing else has."""
        self.labels += 1
        return f"{kind}{self.labels}"

    def plain(self, depth: int = 3) -> str:
        """An expression without a unit."""
        if self.chance.random() < SLIP:
            return self.any(*SLIPS)
        way = self.chance.randrange(12) if depth else self.chance.randrange(5)

        def inner() -> str:
            return self.plain(depth - 1)

        match way:
            case 0 | 1:
                return self.number()
            case 2 | 3 | 4:
                return self.chance.choice(self.known)
            case 5:
                return f"{self.any(*PLAIN)}({inner()})"
            case 6 | 7:
                return f"({inner()} {self.any('+', '-', '*', '+', '/')} {inner()})"
            case 8:
                return f"({inner()})^{self.any('2', '3', '0.5', '-1', self.number())}"
            case 9:
                return f"(if {inner()} {self.any('<', '>', '<=')} {inner()} then {inner()} else {inner()})"
            case 10:
                return f"{self.any('f', 'g', 'tab')}({inner()})"
            case _:
                return f"{self.any('sum', 'sum', 'prod')}(i in 1..{self.any('n', '3')}: {inner()}*w[i]/(1 m))"

    def text(self) -> str:
        """A file with a model and a scene, most of which means something."""
        lines = [
            f"fn f(u: 1) -> 1 = {self.any('u*u', 'sin(u) + u', 'u^3', 'g(u)', '1/(2 + u^2)', 'exp(-u^2)', '1/u')}",
            f"fn g(u: 1) -> 1 = {self.any('u', 'sqrt(1 + u^2)', 'abs(u)', 'u^2', 'sqrt(u)')}",
            f"table tab(u: 1) -> 1 {self.any('linear', 'pchip', 'cubic', 'hold')} {self.any('clamp', 'extend')} "
            f"[ (-1, {self.number()}), (0, 0), (1, {self.number()}), (2, 5) ]",
            "component part_ {",
            "  param a = 1",
            "  branch: translation",
            f"  level one {{ law e = {self.any('(a*1 N.s/m)*f', 'a*setsign(f/(1 m/s))*(1 N)')} }}",
            f"  level two default {{ law e = {self.any('(a*1 N/m)*q', '(a*1 N/m^3)*q^3', '(a*1 N.s/m)*f')} }}",
            "}",
            "model m {",
            "  param n = 3",
            f"  param k = {self.number()}",
            f"  coord x: translation {self.any('=', '=', '~')} {self.number()} m",
            f"  coord y: translation = {self.number()} m",
            f"  coord w[1..n]: translation = {self.number()} m",
            "  energy T* = 1/2*(1 kg)*(x'^2 + y'^2) + sum(i in 1..n: 1/2*(1 kg)*w[i]'^2)",
            f"  energy V = (1 J)*({self.plain()}) + 1/2*(3 N/m)*(x^2 + y^2)",
        ]
        lines += [f"  {self.statement()}" for _ in range(self.chance.randrange(5))]
        lines += [
            "}",
            f"scene s of m {{ time 0 s to {self.any('0.1', '0.5', '1', '1', '1e-9', '0')} s",
            f"  trace x, {self.any('y', 'w[1]', 'w[n]', 'x.f')} as v, {self.plain(1)} as u",
            f"  {self.any('accuracy 1e-3', 'set k = 2', 'limit steps 1000', '', '')}",
            "}",
        ]
        return "\n".join(lines) + "\n"

    def statement(self) -> str:
        """A statement of a model, and what it declares."""
        plain, name = self.plain, self.label("a")
        way = self.chance.randrange(16)
        found = (
            f"let {name} = {plain()}",
            f"work (1 N)*({plain(2)}) on {self.any('x', 'y', 'w[1]')}",
            "work -(1 N.s/m)*x' on x",
            f"phi {name}: x {self.any('=', '>=', '<=')} (1 m)*({plain(1)}) {self.any('', '', 'restitution 0.5')}",
            f"phi {name}: y >= -(0.1 m) restitution {self.any('0.5', '0', '1')}",
            f"psi {name}: x' = y'*({self.number()})",
            f"state {name} = {self.number()}; dynamic {name}' = ({plain(2)})/(1 s)",
            f"discrete {name} = {self.number()}; when {plain(2)} > {self.number()} {{ {name} := {plain(1)} }}",
            f"when x < {self.number()} m {{ x' := {self.any('-x', '-0.5*x', 'y')}' }}",
            f"discrete {name} = 0; every {self.any('10 ms', '0.1 s', '1e-6 s')} {{ {name} := {plain(2)} }}",
            f"content D = 1/2*(1 W)*({plain(1)})^2*(x'/(1 m/s))^2",
            f"{name}: part_(a = {self.number()}) on {self.any('x', 'x - y', 'w[1]', 'sqrt(x^2 + (1 m)^2)')}",
            f"{name}: part_.one(a = {self.number()}) x -> y",
            f"for i in 1..n {{ {name}[i]: part_(a = {self.number()}) on w[i] }}",
            f"expect {self.any('always', 'finally')}: {plain(1)} {self.any('<=', '>')} {plain(1)}",
            f"init {self.any('x', 'y', 'w[1]')}' = {self.number()} m/s",
        )[way]
        if way in (0, 6, 7, 9):
            self.known.append(name)
        return found


CARDS = (
    "R{k} {a} {b} {v}", "C{k} {a} {b} {v} ic={v}", "L{k} {a} {b} {v}", "V{k} {a} {b} dc {v}",
    "V{k} {a} {b} sin({v} {v} {v})", "V{k} {a} {b} pulse({v} {v} {v} {v} {v} {v} {v})", "I{k} {a} {b} {v}",
    "D{k} {a} {b} dm", "Q{k} {a} {b} 0 qm", "M{k} {a} {b} 0 0 mm w={v} l={v}", "E{k} {a} {b} {b} 0 {v}",
    "G{k} {a} {b} value={{v({a})^{v}}}", "B{k} {a} {b} v={{{v}*v({b})}}", "X{k} {a} {b} sub{k}", "X{k} {a} {b} sub",
    "F{k} {a} {b} V1 {v}", "K{k} L1 L2 {v}", "T{k} {a} 0 {b} 0 z0={v} td={v}", "S{k} {a} {b} {a} 0 sw",
    ".model dm d(is={v} n={v})", ".model qm npn(bf={v})", ".model mm nmos(vto={v})", ".model sw sw(vt={v})",
    ".subckt sub a b\nR1 a b {v}\nX1 a b sub\n.ends", ".subckt sub a b\nR1 a b {v}\n.ends", ".param p={v}",
    ".param p={{p+1}}", ".include {v}.cir", ".tran {v} {v}", ".ic v({a})={v}", ".end", "+ {v}", ".func g(x) {{g(x)}}",
    ".lib 'a\0b'", "* \x1b[2J", ".if ({v})\nR9 1 0 1\n.endif", ".temp {v}", "{v} {v} {v}", ".options {v}",
)  # fmt: skip
VALUES = (
    "1k",
    "1",
    "0",
    "-1",
    "1e400",
    "1e-400",
    "{p}",
    "{{1/0}}",
    "{2**9**9}",
    "1meg",
    "inf",
    "nan",
    "''",
    "é",
    "1u",
    "(",
    "{p^p}",
)


def netlist(chance: random.Random) -> str:
    """Cards in any order, some of which are none."""

    def card() -> str:
        found = chance.choice(CARDS)
        nodes = {"a": chance.choice("0123n"), "b": chance.choice("0123")}
        text = found.format(k=chance.randrange(1, 5), v="\1", **nodes)
        while "\1" in text:
            text = text.replace("\1", chance.choice(VALUES), 1)
        return text

    lines = ["title", *(card() for _ in range(chance.randrange(1, 14)))]
    whole = "\n".join(lines) + "\n"
    if chance.random() < 0.2:
        at = chance.randrange(len(whole))
        whole = whole[:at] + chance.choice("(){}='\"\0\n+") + whole[at + 1 :]
    return whole
