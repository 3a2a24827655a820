"""The sections of a report in their order, as one page."""

from __future__ import annotations

from sysdyn.cli.page.document import document, escape
from sysdyn.cli.page.plots import SCRIPT, figures, hint
from sysdyn.cli.report import balance, equations, paynter, run, schematic, text
from sysdyn.cli.report.report_study import ReportStudy


def page(study: ReportStudy) -> str:
    """The whole page."""
    title = study.target.name
    sections = [
        ("text", "Text", text.section(study)),
        ("network", "Network", schematic.section(study)),
        ("paynter", "Paynter's diagram", paynter.section(study)),
        ("energies", "Energy functions", equations.functions(study)),
        ("equations", "Equations", equations.section(study)),
        ("unknowns", "Unknowns", paynter.unknowns(study)),
        ("passivity", "Passivity", run.passivity(study)),
        ("start", "Consistent start", run.start(study)),
        ("traces", "Traces", _traces(study)),
        ("balance", "Energy balance by element", _balance(study)),
        ("solver", "Solver", run.statistics(study) + "<h3>Time by stage</h3>" + run.stages(study)),
    ]
    # where the text expects something
    claims = run.expectations(study)
    if claims:
        sections.insert(9, ("expectations", "Expectations", claims))
    links = "".join(f'<a href="#{key}">{escape(name)}</a>' for key, name, _ in sections)
    # headline, findings and counts before the sections
    parts = [f"<h1>{escape(title)}</h1>", f'<p class="soft">{escape(_how(study))}</p>']
    parts += [f'<p class="bad">{escape(finding)}</p>' for finding in study.findings]
    parts += [run.counts(study), f"<nav>{links}</nav>"]
    parts += [f'<section id="{key}"><h2>{escape(name)}</h2>\n{body}\n</section>' for key, name, body in sections]
    return document(title, "\n".join(parts), script=SCRIPT)


def _how(study: ReportStudy) -> str:
    how = [study.prepared.formulation]
    if study.ran is not None:
        o = study.ran.outcome
        how += [o.method, f"index {o.index}", f"{o.reached:g} s in {o.statistics['steps']} steps"]
        if o.error_estimate is not None:
            how.append("estimated error " + ("below round-off" if o.below_round_off else f"{o.error_estimate:.1e}"))
    return ", ".join([study.sources[0].name, *how])


def _traces(study: ReportStudy) -> str:
    if study.trace is None:
        return '<p class="soft">Nothing was run.</p>'
    meters = [name for name in ("audit.energy", "audit.constraints") if name in study.trace]
    return hint() + figures([(study.target.name, study.trace)], [*study.trace.names, *meters])


def _balance(study: ReportStudy) -> str:
    if study.trace is None or study.shares is None:
        return balance.section(None, (), 0.0)
    energy = study.trace["audit.energy"].values
    labels = [study.link(share.place, escape(share.label)) for share in study.shares]
    return balance.section(study.shares, labels, float(energy[-1]) if energy.size else float("nan"))
