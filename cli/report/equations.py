"""The formulation's equations and the energy functions of a report: what `sysdyn equations` prints."""

from __future__ import annotations

from sysdyn.cli.equations import typeset
from sysdyn.cli.report.report_study import ReportStudy
from sysdyn.compiler.equations.algebra import Algebra
from sysdyn.compiler.equations.book import WORDS, algebra_of, equations
from sysdyn.compiler.equations.book import functions as state_functions

MOST = 200
"""Row families that a page typesets."""


def section(study: ReportStudy) -> str:
    """Every equation of the formulation."""
    compiled = study.prepared.compiled
    found = equations(_algebra(study), compiled.functions, compiled.form, MOST)
    lines = typeset.rows(found, study.typesetter, study.link, complementary=study.complementary)
    left = sum(r.block in WORDS for r in compiled.form.rows) - MOST
    more = f'<p class="soft">… {left} more</p>' if left > 0 else ""
    return f'<div class="equations">{"".join(lines)}</div>{more}'


def functions(study: ReportStudy) -> str:
    """The state functions and virtual work."""
    found = state_functions(_algebra(study), study.prepared.compiled.functions)
    text = "".join(typeset.functions(found, study.typesetter, complementary=study.complementary))
    return f'<div class="equations">{text}</div>' if text else '<p class="soft">none</p>'


def _algebra(study: ReportStudy) -> Algebra:
    compiled = study.prepared.compiled
    return algebra_of(compiled.form, [p.name for p in compiled.network.parameters if not p.shape])
