"""Texts and netlists that are written from a seed: events, arrays, levels, tables, numbers that overflow."""

from __future__ import annotations

import random

NUMBERS = ("0", "1", "2", "-1", "0.5", "1e3", "1e-3", "1e300", "1e-300", "1e308", "inf", "(1e300*1e300)", "-0", "7")
PLAIN = ("sin", "cos", "tanh", "exp", "ln", "sqrt", "abs", "sign", "floor", "step", "asin", "cosh", "frac", "setsign")
MEMBERS = ("q", "f", "e", "p", "power", "energy", "multiplier", "x", "")


class Writer:
    """One text; chance: where its choices come from."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.names = ["x", "y", "z"]

    def any(self, *of: str) -> str:
        """One of them."""
        return self.chance.choice(of)

    def number(self) -> str:
        """A number, now and then one that is hardly any."""
        return self.any(*NUMBERS) if self.chance.random() < 0.4 else f"{self.chance.uniform(0.1, 5.0):.3g}"

    def plain(self, depth: int = 3) -> str:
        """An expression without a unit."""
        way = self.chance.randrange(12) if depth else 0
        inner = lambda: self.plain(depth - 1)  # noqa: E731
        match way:
            case 0 | 1:
                return self.number()
            case 2 | 3:
                return f"({self.any('x', 'y', 'w[1]', 'w[n]', 'w')}/({self.any('1 m', '2 mm', '0 m')}))"
            case 4:
                return f"{self.any(*PLAIN)}({inner()})"
            case 5:
                return f"({inner()} {self.any('+', '-', '*', '/', '^')} {inner()})"
            case 6:
                return f"({inner()})^{self.number()}"
            case 7:
                return f"(if {inner()} {self.any('<', '>', '==', '<=')} {inner()} then {inner()} else {inner()})"
            case 8:
                return f"{self.any('f', 'g', 'tab')}({inner()})"
            case 9:
                return f"{self.any('sum', 'prod', 'max', 'min')}(i in {self.number()}..{self.any('n', '3', self.number())}: {inner()})"  # noqa: E501
            case 10:
                return f"{self.any('a', 'b', 'k', 's', 'd', 't/(1 s)', 'pi', 'n', 'part.a', 'box.x', 'part[1].a')}"
            case _:
                return f"{self.any('x', 'w', 'R', 'part', 'hit', 'audit', 'w[2]')}.{self.any(*MEMBERS)}"

    def text(self) -> str:
        """A file with a model and two scenes, most of which means something."""
        lines = [
            f"fn f(u: 1) -> 1 = {self.any('u*u', 'sin(u) + u', 'u^3', 'g(u)', '1/u', 'exp(u)')}",
            f"fn g(u: 1) -> 1 = {self.any('u', 'sqrt(u)', 'abs(u)', 'f(u)', 'u^0.5')}",
            f"table tab(u: 1) -> 1 {self.any('linear', 'pchip', 'cubic', 'hold')} {self.any('clamp', 'extend', 'stop')} "  # noqa: E501
            f"[ ({self.number()}, 0), (1, {self.number()}), (2, 5), ({self.number()}, 7) ]",
            "component part_ {",
            f"  param a = {self.number()}",
            f"  {self.any('branch: translation', 'port p: translation', 'branch: electrical')}",
            f"  {self.any('law e = (a*1 N.s/m)*f', 'law e = (1 N/m)*q', 'law e = setsign(f/(1 m/s))*(1 N)', 'law f = e*(1 m/N/s)')}",  # noqa: E501
            f"  level one default {{ {self.any('', 'let h = a', 'level two { }')} }}",
            "}",
            "model m {",
            f"  param n = {self.any('2', '3', '3', self.number())}",
            f"  param k = {self.plain(1)}",
            f"  coord x: translation {self.any('=', '~')} {self.number()} m",
            f"  coord y: translation = {self.number()} m",
            f"  coord w[{self.any('1..n', '1..2', '0..n', 'n..1')}]: translation = {self.number()} m",
            "  energy T* = 1/2*(1 kg)*(x'^2 + y'^2) + sum(i in 1..n: 1/2*(1 kg)*w[i]'^2)",
            f"  energy V = (1 J)*({self.plain()})",
        ]
        for _ in range(self.chance.randrange(7)):
            lines.append("  " + self.statement())
        lines += [
            "}",
            f"scene s of m {{ time 0 s to {self.any('0.1', '0.5', '0', '-1', '1e-9', '1e9')} s",
            f"  trace x, {self.any('y', 'w[1]', 'w[n]', 'x.f', 'w', 's', 'd')}, {self.plain(1)} as u",
            f"  {self.any('accuracy 1e-3', 'set k = ' + self.plain(1), 'limit steps 100', 'level part = one', '')}",
            "}",
        ]
        return "\n".join(lines) + "\n"

    def statement(self) -> str:
        """A statement of a model."""
        plain = self.plain
        return self.any(
            f"let a = {plain()}",
            f"let b = {plain()}",
            f"work (1 N)*({plain()}) on {self.any('x', 'y', 'w[1]', 'x^2/(1 m)', 'w')}",
            f"phi c: {self.any('x', 'x^2/(1 m)', 'w[1]')} {self.any('=', '>=', '<=')} (1 m)*({plain(2)}) {self.any('', 'restitution 0.5', 'while d > 0')}",  # noqa: E501
            f"psi v: x' = {self.any('y', 'x', 'w[1]')}'*({plain(1)})",
            f"state s: 1 = {self.number()}; dynamic s' = ({plain()})/(1 s)",
            f"discrete d = {self.number()}; when {plain(2)} > {self.number()} {{ d := {plain(2)} }}",
            f"when x > {self.number()} m {{ x' := {self.any('-x', '-0.5*x', 'y')}' }}",
            f"discrete h = 0; every {self.number()} s {{ h := {plain(2)} }}",
            f"content D = (1 W)*({plain(2)})",
            f"part: part_(a = {self.number()}) {self.any('x', 'x -> y', 'on x', 'on x - y', 'on w[1]')}",
            f"for i in 1..{self.any('n', '2', '0')} {{ part[i]: part_(a = {self.number()}) on w[i] }}",
            f"expect {self.any('always', 'finally', 'at 0.1 s')}: {plain(2)} {self.any('<=', '>', '==')} {plain(1)}",
            f"init {self.any('x', 'y', 'w[1]', 's')}{self.any('', chr(39))} = {self.number()} {self.any('m', 'm/s', '')}",  # noqa: E501
            f"implicit e: N; gamma r: e = (1 N)*({plain(2)}); work e on y",
            f"require {plain(1)} > 0",
            f"box: {self.any('nothing', 'part_', 'm')}({self.any('', 'a = 1')}) {self.any('', 'x')}",
        )


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
