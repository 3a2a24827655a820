"""By which strategy each scene of models/ finds its start, in every formulation.

`python tests/models/start_strategies.py [PATTERN]` prints the starts that need more than the first strategy, and the
counts.  The line of 100000 sections is left out.
"""

import io
import sys
from collections import Counter

from reduced import ROOT
from sysdyn.cli.options import EVERY
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import ready
from sysdyn.cli.run.start.starting import start
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.decoding import decode
from sysdyn.dsl.text.diagnostics import Report

LEFT_OUT = ("transmission_line.sd",)


def strategies(pattern, formulations=EVERY):
    """(file, scene, formulation, strategy) of every start of the files; None where there is none; what cannot be
    expressed is left out.
    """
    for path in sorted((ROOT / "models").glob(pattern)):
        document = targets.read(str(path), Report())
        for scene in document.scenes if path.name not in LEFT_OUT else ():
            for formulation in formulations:
                found = _strategy(path, document, scene, formulation)
                if found != "":
                    yield path.name, scene, formulation, found


def _strategy(path, document, scene, formulation):
    prepared, begun = _started(str(path), document, scene, formulation)
    if prepared is None:
        return ""
    return begun.state.strategy if begun else None


def _started(name, document, scene, formulation, report=None):
    """A target prepared without a compiler, and its start; None where there is none."""
    report = Report() if report is None else report
    with ex.fresh():
        target = targets.one(document, name, None, scene, report)
        prepared = target and ready(RunRequest(name, formulation=formulation, backend="numpy"), target, report)
        if prepared is None:
            return None, None
        begin = prepared.network.scene and prepared.network.scene.start
        return prepared, start(prepared, 0.0 if begin is None else prepared.binding.evaluate(begin), report)


def prepared_start(text, formulation, scene=None, report=None):
    """A text prepared without a compiler, and its start; None where there is none."""
    report = Report() if report is None else report
    document = load.document(decode("model.sd", io.BytesIO(text.encode())), report)
    return _started("model.sd", document, scene, formulation, report)


def started(text, formulation):
    """The start of a text, which must have one."""
    report = Report()
    _, begun = prepared_start(text, formulation, report=report)
    assert begun is not None, list(report)
    return begun


if __name__ == "__main__":
    counts = Counter()
    for *where, strategy in strategies(sys.argv[1] if len(sys.argv) > 1 else "*/*.sd"):
        counts[strategy] += 1
        if strategy != "newton":
            print(*where, strategy, flush=True)
    print(dict(counts), "of", counts.total())
