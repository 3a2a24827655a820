"""Rows that are left of the settled form where f_3 = f_1 - f_2 leaves the runs, by hand."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.condense.settled_rows import settled_rows
from sysdyn.runtime.condense.sums import ConstantSums
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System

SPRINGS = "q_1**2 + 2*q_2**2 + q_3**2"
NODE = {"node": "f_1 - f_2 - f_3"}
ALL = {"dynamics 1", "dynamics 2", "dynamics 3"}


def without(system, name, row):
    """Labels of the rows left where the unknown leaves by the row; None where it may not."""
    settled, empty = system.another("settled"), np.zeros(0, dtype=np.int64)
    place = np.array([system.unknown_names.index(name)])
    gone = np.array([system.row_label(k).label == row for k in range(system.rows)])
    one = np.zeros(1)
    numbers = ConstantSums(place, one, np.array([0, 0]), empty, np.zeros(0), np.zeros(0, dtype=np.int32), empty)
    kept = settled_rows(system, settled, gone, numbers)
    if kept is None:
        return None
    groups = [f"{group} {settled.description.rows[k].label}" for group, k, _ in settled.form.groups]
    return {group for group, here in zip(groups, kept, strict=True) if here}


def system(kinetic, **more):
    made = models.small("1 2 3", kinetic, SPRINGS, **more)
    structure = made[0]["structure"]
    names = [family["name"] for family in structure["families"]]
    structure["blocks"]["observe_rate"]["kernels"][0]["rates"] = [names.index(n) for n in more.get("observe", {})]
    return System(made[0], made[1], load(made[2]), "2v")


def test_the_row_that_defines_it_goes_with_its_rate():
    """No balance reads f_3': all of them stay, the sum and its derivative say nothing of what is left."""
    assert without(system("f_1**2/2", psi=NODE), "f_3", "node") == ALL


def test_the_balance_that_gives_its_rate_goes_too():
    """Nothing else reads f_3', so whatever f_3' has to be, balance 3 is met."""
    assert without(system("f_1**2/2 + f_3**2/2", psi=NODE), "f_3", "node") == ALL - {"dynamics 3"}


def test_two_balances_for_one_rate_say_more_than_that():
    """f_2'' - f_3' stands in two balances: their sum is a row of what is left, which none of those kept is."""
    assert without(system("f_1**2/2 + (f_2 - f_3)**2/2", psi=NODE), "f_3", "node") is None


@pytest.mark.parametrize(("seen", "left"), [("f_1", True), ("e_1", False)])
@pytest.mark.long
def test_rates_that_observers_read_must_be_left(seen, left):
    """The rate of e_1 = 2 f_3 follows from that of f_3 alone: where it is read f_3 stays."""
    law = {"implicit": ("1",), "gamma": {"law": "e_1 - 2*f_3"}, "observe": {seen: seen}}
    found = without(system("f_1**2/2", psi=NODE, **law), "f_3", "node")
    assert found == (ALL | {"gamma law"} if left else None)
