"""What is printed: energy functions, equations and what their letters stand for, in text and LaTeX."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sysdyn.cli.equations.expression_writers import ExpressionWriter, Latex, TextWriter
from sysdyn.cli.equations.forms import FormContent
from sysdyn.cli.equations.letters import Letters
from sysdyn.compiler.equations.book import (
    CO_WORDS,
    REFLECTED,
    WORDS,
    EffortTerms,
    Equation,
    Function,
    Summed,
)
from sysdyn.compiler.equations.matrices import Matrix, unknowns
from sysdyn.compiler.equations.order import FactorOrder
from sysdyn.compiler.model.terms import Nest
from sysdyn.compiler.pipeline import CompiledModel
from sysdyn.dsl.model.expression import Node, index
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class EquationLine:
    """left = right, in text and LaTeX; condition: for which indices; label: of the row; place: in the author's
    text; more: added to the right side of the line before.
    """

    kind: str
    label: str
    text: tuple[str, str]
    latex: tuple[str, str]
    condition: tuple[str, str]
    place: Place | None
    more: bool = False

    def to_json(self) -> dict[str, object]:
        """The object of --json."""
        for_, in_latex = (f", {c}" if c else "" for c in self.condition)
        return {
            "kind": self.kind,
            "label": self.label,
            "text": f"{self.text[0]} {'+' if self.more else '='} {self.text[1]}{for_}".strip(),
            "latex": f"{self.latex[0]} {'+' if self.more else '='} {self.latex[1]}{in_latex}".strip(),
            "file": self.place.file if self.place else None,
            "line": self.place.start[0] if self.place else None,
        }


@dataclass(frozen=True, slots=True)
class Sheet:
    """Everything printed; legend: what multipliers belong to; senses: what the senses and directions of dry friction
    belong to; more: equations that were left out.
    """

    functions: tuple[EquationLine, ...]
    equations: tuple[EquationLine, ...]
    legend: tuple[tuple[str, str, int], ...]
    more: int = 0
    counted: tuple[str, ...] = ()
    senses: tuple[tuple[str, str, int], ...] = ()

    def to_text(self) -> str:
        """For a terminal."""
        parts = [_block(self.functions)] if self.functions else []
        if self.equations:
            parts.append(_block(self.equations) + (f"\n... {self.more} more" if self.more else ""))
        if self.legend:
            said = [f"{s} of {owner}, line {line}" if owner else s for s, owner, line in self.legend]
            said += [f"{s}, {what}, line {line}" for s, what, line in self.senses]
            parts.append("\n".join(said))
        if self.counted:
            parts.append("\n".join(self.counted))
        return "\n\n".join(parts)

    def to_latex(self) -> str:
        """Two align environments."""
        groups = [g for g in (self.functions, self.equations) if g]
        return "\n\n".join(
            "\\begin{align*}\n" + " \\\\\n".join(_latex(line) for line in group) + "\n\\end{align*}" for group in groups
        )


_NAMES = {"M": "M", "Φ_q": "\\Phi_q", "Ψ_f": "\\Psi_f", "Y": "Y", "U": "U", "Z1": "Z_1", "Z2": "Z_2"}
"""In LaTeX."""


def _grid(entries: Sequence[Sequence[str]]) -> str:
    """A matrix as text: a row a line."""
    wide = [max(len(row[k]) for row in entries) for k in range(len(entries[0]))]
    rows = ("[ " + "   ".join(text.ljust(n) for text, n in zip(row, wide, strict=True)) + " ]" for row in entries)
    return "\n".join(rows)


def _array(entries: Sequence[Sequence[str]]) -> str:
    return "\\begin{bmatrix} " + " \\\\ ".join(" & ".join(row) for row in entries) + " \\end{bmatrix}"


def _block(lines: Sequence[EquationLine]) -> str:
    wide = max(len(line.text[0]) for line in lines)
    return "\n".join(_row(line, wide) for line in lines)


def _row(line: EquationLine, wide: int) -> str:
    """One line; a matrix takes several."""
    head = f"{line.text[0].rjust(wide)} {'+' if line.more else '='} "
    text = line.text[1].replace("\n", "\n" + " " * len(head))
    return head + text + (f"    {line.condition[0]}" if line.condition[0] else "")


def _latex(line: EquationLine) -> str:
    condition = f" \\qquad {line.condition[1]}" if line.condition[1] else ""
    sign = "&\\quad {} + " if line.more else "&= "
    return f"  {line.latex[0]} {sign}{line.latex[1]}{condition}"


class Sheets:
    """Writes the forms of one compiled model."""

    def __init__(self, compiled: CompiledModel, named: Sequence[str]) -> None:
        self.compiled = compiled
        parameters = [p.name for p in compiled.network.parameters]
        self.letters = Letters(compiled.form, named, parameters, compiled.network.switches)
        order = FactorOrder(parameters)
        self.writers: tuple[ExpressionWriter, ExpressionWriter] = (
            TextWriter(self.letters, order),
            Latex(self.letters, order),
        )
        self.complementary = compiled.form.formulation.startswith("co_")

    def sheet(self, content: FormContent) -> Sheet:
        """What is printed, in both alphabets."""
        lines = [self._matrix(m) for m in content.matrices] + [self.line(e) for e in content.equations]
        legend = tuple(self.legend()) if content.equations else ((self._flows(), "", 0),)
        legend = () if any(e.kind == "element" for e in content.equations) else legend
        functions = tuple(self.function_line(f) for f in content.functions)
        said = ((self.writers[0].symbol(letter, ()), what, line) for letter, what, line in self.letters.slipping())
        return Sheet(functions, tuple(lines), legend, content.more, content.counted, tuple(said))

    def _matrix(self, matrix: Matrix) -> EquationLine:
        text, latex = ([[self._entry(w, e) for e in row] for row in matrix.rows] for w in self.writers)
        texts = (matrix.name, _grid(text)), (_NAMES.get(matrix.name, matrix.name), _array(latex))
        return EquationLine("matrix", matrix.name, *texts, ("", ""), None)

    def _flows(self) -> str:
        order = ", ".join(self.writers[0].expression(n) for n in unknowns(self.compiled.form, "f"))
        return f"f = ({order})"

    def _entry(self, writer: ExpressionWriter, terms: Sequence[Node]) -> str:
        return writer.sum_of([Summed((), term) for term in terms])

    def function_line(self, function: Function) -> EquationLine:
        """A state function or virtual work."""
        texts = tuple(self._function(writer, function) for writer in self.writers)
        name = REFLECTED[function.name] if self.complementary else function.name
        name = f"δ{name}" if function.efforts else name
        latex = name.replace("δ", "\\delta ").replace("*", "^{*}")
        return EquationLine("function", name, (name, texts[0]), (latex, texts[1]), ("", ""), None)

    def _function(self, writer: ExpressionWriter, function: Function) -> str:
        if not function.efforts:
            return writer.sum_of(function.terms)
        return _sum_text([self._effort(writer, effort) for effort in function.efforts], writer.minus)

    def _effort(self, writer: ExpressionWriter, effort: EffortTerms) -> str:
        """Q delta q, summed."""
        text = writer.sum_of([Summed((), term) for term in effort.terms])
        single = len(effort.terms) == 1 and (effort.terms[0].op != "sum" or len(effort.terms[0].args) == 1)
        text = writer.product([text if single else writer.parenthesize(text), writer.variation(effort.on)])
        for loop in reversed(effort.over):
            text = writer.total("sum", loop, text)
        return text

    def line(self, equation: Equation) -> EquationLine:
        """An equation in both alphabets."""
        words = WORDS | CO_WORDS if self.complementary else WORDS
        pairs = [(w.sum_of(equation.left), w.sum_of(equation.right)) for w in self.writers]
        conditions = [self._condition(w, equation.where, equation.fixed) for w in self.writers]
        own = {"element": "", "class": "flow on" if self.complementary else "effort on"}
        word = own.get(equation.kind, words.get(equation.kind, "rate of"))
        label = f"{word} {equation.owner}".strip()
        if equation.more:
            pairs = [("", right) for _, right in pairs]
        ends = (conditions[0], conditions[1])
        if equation.kind == "element":  # the edge of Paynter's diagram
            edge = equation.owner.rpartition("(")[2].removesuffix(")")
            ends = (", ".join(filter(None, (edge, ends[0]))), ", \\ ".join(filter(None, (edge, ends[1]))))
        return EquationLine(equation.kind, label, pairs[0], pairs[1], ends, equation.place, equation.more)

    def _condition(self, writer: ExpressionWriter, where: Nest, fixed: Sequence[tuple[int, Node]]) -> str:
        pieces = []
        for loop in where:
            first, last = writer.expression(loop.first), writer.expression(loop.last)
            ends = first if loop.first is loop.last else f"{first}..{last}"
            pieces.append(f"{writer.counter(loop.index)} = {ends}")
        pieces += [f"{writer.expression(index(f'#{d}'))} = {writer.expression(at)}" for d, at in fixed]
        return ", ".join(pieces)

    def legend(self) -> Iterator[tuple[str, str, int]]:
        """Multipliers with the constraints whose they are."""
        for kind, number, owner, line in self.letters.legend(self.compiled.form):
            yield {"kappa": "κ", "mu": "μ"}[kind] + str(number), owner, line


def _sum_text(pieces: Sequence[str], minus: str) -> str:
    found = list(pieces[:1])
    for piece in pieces[1:]:
        found.append(f"{minus} {piece.removeprefix(minus)}" if piece.startswith(minus) else f"+ {piece}")
    return " ".join(found) or "0"
