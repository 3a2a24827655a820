"""Every component of the library, at every level, against a closed form in every formulation that expresses it."""

import control_table
import electrical_table
import fluid_table
import mechanical_table
import prelude_table
import pytest
import thermal_table
import transduce_table
from runs import library, names
from sysdyn.dsl.elaborate import files
from sysdyn.dsl.tree import syntax

TABLES = {
    "electrical": electrical_table.ROWS,
    "mechanical": mechanical_table.ROWS,
    "fluid": fluid_table.ROWS,
    "thermal": thermal_table.ROWS,
    "transduce": transduce_table.ROWS,
    "control": control_table.ROWS,
    "prelude": prelude_table.ROWS,
}
CASES = {
    f"{module}-{k}-{row.component}-{formulation}": (row, formulation)
    for module, rows in TABLES.items()
    for k, row in enumerate(rows)
    for formulation in row.formulations
}


@pytest.mark.parametrize(("row", "formulation"), CASES.values(), ids=CASES)
@pytest.mark.one_in(522)
def test_response(row, formulation, tmp_path, record_property):
    record_property("error", row.check(tmp_path, formulation))


def test_nothing_of_the_library_lacks_a_row():
    rows = {row.component for table in TABLES.values() for row in table}
    wanted = {
        name
        for component, entry in library().items()
        for name in ([f"{component}.{level.name.name}" for level in entry.levels] or [component])
    }
    assert wanted - rows == set()


def test_nothing_of_the_prelude_lacks_a_row():
    items = files.prelude().items
    rows = {row.component for row in TABLES["prelude"]}
    assert {i.name.name for i in items if isinstance(i, (syntax.DomainDefinition, syntax.BundleDefinition))} == rows
    texts = " ".join(row.text for row in TABLES["prelude"])
    assert [i.name.name for i in items if isinstance(i, syntax.ConstDefinition) and i.name.name not in texts] == []


@pytest.mark.long
def test_a_row_uses_its_component():
    rows = [row for table in TABLES.values() if table is not prelude_table.ROWS for row in table]
    assert [row.component for row in rows if row.component not in names(row.text)] == []


def test_everything_is_documented():
    documented = [(i.name.name, i.doc) for i in files.prelude().items]
    documented += [(name, entry.component.doc) for name, entry in library().items()]
    documented += [
        (f"{name}.{level.name.name}", level.doc)
        for name, entry in library().items()
        for level in entry.levels
        if not level.default
    ]
    assert not [name for name, doc in documented if not doc]
