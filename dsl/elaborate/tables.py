"""Interpolation tables, written in the text or in a file beside it; values in SI units.

A file is comma-separated numbers, one row a line, in the units of the table's head; a first line of names and lines
that begin with '#' are passed over.  It must lie inside the folder of the text that names it.
"""

from __future__ import annotations

import re
import stat
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

from sysdyn.dsl.model.network import Table
from sysdyn.dsl.model.units import Unit
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.text.diagnostics import Place, Report, SourceText
from sysdyn.dsl.text.source import real
from sysdyn.dsl.tree import syntax

MAX_BYTES = 50_000_000
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
Row = tuple[float, ...]


def read_table(
    item: syntax.TableDefinition, units: Sequence[Unit], result: Unit, source: SourceText, report: Report
) -> Table | None:
    """The table's breakpoints and values; None after reporting E206."""
    name = item.name.name
    place = Place(source, item.name.span)
    try:
        # `[(0, 0), (1, 2)]` in the text, or `file "data.csv"` beside it
        if item.rows is not None:
            rows = _written(item, [*units, result], source, report)
        else:
            rows = _from_file(item, [*units, result], source, report)
    except Failed:
        return None
    # one argument: rows in increasing order, each argument once
    back = next((k for k, (a, b) in enumerate(pairwise(rows), 1) if a[0] >= b[0]), None) if len(units) == 1 else None
    if back is not None:
        where = place if item.rows is None else Place(source, item.rows[back].span)
        number = f"row {back + 1}" if item.rows is None else "this row"
        message = f"table {name}: {number} does not lie behind the one before it: arguments increase from row to row"
        report.error("E206", message, where, help="the rows in the order of their arguments, each once")
        return None
    # several arguments: the rows make a full grid, in any order
    problem = _grid_problem(rows, len(units), item.interpolation) if len(units) > 1 else None
    if problem or len(rows) < 2:
        report.error("E206", f"table {name}: {problem or 'two rows at least'}", place, help="(0, 0), (1, 2)")
        return None
    axes = tuple(tuple(sorted({row[k] for row in rows})) for k in range(len(units)))
    values = tuple(row[-1] for row in sorted(rows))
    return Table(name, item.interpolation, item.extrapolation or "clamp", axes, values, place)


def _grid_problem(rows: list[Row], arguments: int, interpolation: str) -> str | None:
    if arguments > 2 or interpolation not in ("linear", "hold"):
        return "a table of two arguments is linear or hold, and there are no larger ones"
    sizes = [len({row[k] for row in rows}) for k in range(2)]
    if len({row[:2] for row in rows}) != sizes[0] * sizes[1] or len(rows) != sizes[0] * sizes[1] or min(sizes) < 2:
        return "the rows must fill a grid, each point once"
    return None


def _written(item: syntax.TableDefinition, units: list[Unit], source: SourceText, report: Report) -> list[Row]:
    """Rows of a table in the text, in base units; Failed after reporting E206 of a row of another length."""
    rows = []
    for row in item.rows or ():
        if len(row.numbers) != len(units):
            message = f"a row of table {item.name.name} has {len(units)} numbers, {len(row.numbers)} given"
            heads = ", ".join([*(p.name for p in item.params), "value"])
            report.error("E206", message, Place(source, row.span), help=f"each row is ({heads})")
            raise Failed
        texts = [n.text.replace(" ", "") for n in row.numbers]
        rows.append(tuple(_to_base_unit(t, u) for t, u in zip(texts, units, strict=True)))
    return rows


def _from_file(item: syntax.TableDefinition, units: list[Unit], source: SourceText, report: Report) -> list[Row]:
    """Rows of a table's file, in base units; Failed after reporting E206. One line of names above the numbers is passed
    over.
    """
    place = Place(source, item.span)
    assert item.file is not None
    folder = real(source.name).parent
    path = real(folder / item.file)
    # `../secret.csv`, or a link that leads out
    if not path.is_relative_to(folder):
        help_ = "put the file beside the model"
        report.error("E206", f"table {item.name.name}: '{item.file}' is outside the model's folder", place, help=help_)
        raise Failed
    try:
        found = path.stat()
        # a folder, a pipe that never ends
        if not stat.S_ISREG(found.st_mode):
            raise OSError(22, "it is no regular file")
        if found.st_size > MAX_BYTES:
            raise OSError(27, "the file is too large")
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is no text"
        help_ = "a text of rows of numbers, separated by commas, beside the model"
        report.error("E206", f"table {item.name.name}: '{item.file}' cannot be read: {reason}", place, help=help_)
        raise Failed from None
    rows: list[Row] = []
    # rows of numbers; empty lines and remarks are passed over
    for number, line in enumerate(lines, 1):
        cells = [c.strip() for c in line.split(",")]
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            if len(cells) != len(units):
                raise ValueError
            rows.append(tuple(_to_base_unit(c, u) for c, u in zip(cells, units, strict=True)))
        except (ValueError, ZeroDivisionError, OverflowError):
            if rows or number > 1 or any(_NUMBER.fullmatch(c) for c in cells):  # else the names of the columns
                message = f"table {item.name.name}: line {number} of '{item.file}' is not {len(units)} numbers"
                example = ", ".join(("0.5", "1.2e-3", "7")[: len(units)])
                help_ = f"{len(units)} numbers a line, a comma between them: {example}"
                report.error("E206", message, place, help=help_)
                raise Failed from None
    return rows


def _to_base_unit(text: str, unit: Unit) -> float:
    if _NUMBER.fullmatch(text) is None:  # Python takes 1_0 and figures of other scripts too
        raise ValueError(text)
    value = float(text)
    if value - value != 0.0:
        raise ValueError(text)
    if unit.scale == 1 and not unit.offset:
        return value
    return float(Fraction(text) * unit.scale + unit.offset)
