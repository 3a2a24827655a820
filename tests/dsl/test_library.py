"""Files of the library are read once, however many values of a command line are told by their names."""

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.elaborate import files
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import Report, SourceText

TEXT = """from std.electrical import resistor
const half = 0.5
model one { node a: electrical; R1: resistor(R = 1 ohm) a -> ground }
"""


@pytest.mark.long
def test_a_module_is_parsed_once_for_many_values(monkeypatch):
    read = []
    monkeypatch.setattr(files, "parse", lambda source: read.append(source.name) or parse(source))
    files._of_library.cache_clear()
    files.prelude()
    read.clear()
    report = Report()
    document = load.document(SourceText("one.sd", TEXT), report)
    values = [load.constant(document, f"{k}*half*2 s", dim.TIME, "--at", report) for k in range(20)]
    assert values == [float(k) for k in range(20)]
    assert read == ["std/electrical.sd"]
    assert not list(report)


def test_a_name_imported_twice_is_one_and_two_of_one_name_are_told_where_they_are_asked_for(tmp_path):
    (tmp_path / "one.sd").write_text("const foo = 3\n")
    (tmp_path / "two.sd").write_text("const foo = 4\n")
    path = tmp_path / "m.sd"

    def told(*imports):
        path.write_text("\n".join((*imports, "model m { state s: 1 = 0; dynamic s' = foo/(1 s) }")))
        report = Report()
        files.FileScope(parse(SourceText.read(path))[0], report)
        return [(d.code, d.place.file, d.place.start[0]) for d in report.diagnostics]

    assert told("from one import foo, foo", "from one import foo") == []
    assert told("from one import foo", "from two import foo") == [("E106", str(path), 2)]
