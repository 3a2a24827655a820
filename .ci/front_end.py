"""The front end on a bare Python, without an environment: every model's network, and what a slip is told.

Usage: front_end.py WHEEL.  The language imports the standard library alone, so that it can be tried on any Python that
is at hand: a pattern or a type that one of them does not know is found here.
"""

import sys
import tempfile
import zipfile
from pathlib import Path

with tempfile.TemporaryDirectory() as folder:
    with zipfile.ZipFile(sys.argv[1]) as wheel:
        wheel.extractall(folder)
    sys.path.insert(0, folder)
    sys.dont_write_bytecode = True
    from sysdyn.dsl import load
    from sysdyn.dsl.text.diagnostics import Report

    number = 0
    for path in sorted((Path(folder) / "sysdyn" / "models").glob("*/*.sd")):
        report = Report()
        document = load.read(str(path), report)
        for model in document.models.values():
            if load.network(document, model, None, report) is not None:
                number += 1
        assert not report.failed, (path, [f"{d.code} {d.message}" for d in report])
    slip = Path(folder) / "slip.sd"
    slip.write_text("model m {\n  param k = 1 N/m\n  coord x: translation\n  energy V = 1/2*k*x**2\n}\n")
    report = Report()
    load.read(str(slip), report)
    assert [d.code for d in report] == ["E113"], [d.code for d in report]
print(f"{sys.version.split()[0]}: {number} networks")
