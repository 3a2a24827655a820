"""What stands side by side in netlists, and what is in strands between nodes of any neighbourhood."""

import sys
from pathlib import Path

import pytest
from sysdyn.compiler.network.neighbourhoods import RUN, laws_of, side_by_side
from sysdyn.compiler.network.strands import in_strands, strands
from sysdyn.dsl import load
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText

sys.path.append(str(Path(__file__).parents[1] / "models"))
from handwritten import ladder

pytestmark = pytest.mark.usefixtures("fresh")
HEAD = "from std.electrical import resistor, capacitor, voltage\nmodel net {\n"


def network(text):
    report = Report()
    document = load.document(SourceText("n.sd", text), report)
    (model,) = document.models.values()
    found = load.network(document, model, next(iter(document.scenes.values()), None), report)
    assert found is not None, list(report)[:3]
    return found, laws_of(found)


def written(nodes, elements):
    """A net of primitive branches: (name, law, from, to)."""
    lines = [f"  node {n}: electrical" for n in nodes]
    lines += [f"  {name}: {law} {a} -> {b}" for name, law, a, b in elements]
    return "model net {\n" + "\n".join(lines) + "\n}\n"


R, C = "dissipator(e = 2 ohm*f)", "potential(q = 1 F*e)"


def test_sections_of_a_ladder_are_two_runs_of_branches_and_a_family_of_nodes():
    sites, runs = side_by_side(*network(ladder(20)))
    assert len({family for family, _ in sites.values()}) == 1
    places = sorted(place for _, place in sites.values())
    assert places == list(range(len(sites)))
    by = {run.members[0][0].name[0]: run for run in runs}
    assert set(by) == {"R", "C"}
    assert by["C"].moves == (True, False)  # the other end is ground
    assert by["R"].moves == (True, True)
    for run in runs:
        numbers = [int(b.name[1:]) for b, _ in run.members]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_less_than_a_run_stays_as_it_is_written():
    assert side_by_side(*network(ladder(RUN - 2))) == ({}, [])


def test_laws_of_another_shape_are_not_alike():
    """Every other store is nonlinear: nodes are of two kinds, and stand side by side with those of their own."""
    nodes = [f"n{k}" for k in range(24)]
    laws = {0: C, 1: "potential(q = 1 F*e + 1 F/V*e^2)"}
    elements = [(f"r{k}", R, "hub", n) for k, n in enumerate(nodes)]
    for kinds in (1, 2):
        stores = [(f"c{k}", laws[k % kinds], n, "ground") for k, n in enumerate(nodes)]
        sites, runs = side_by_side(*network(written(["hub", *nodes], [*elements, *stores])))
        assert len({family for family, _ in sites.values()}) == kinds
        stored = [run for run in runs if run.members[0][0].kind == "potential"]
        assert [len(run.members) for run in stored] == [24 // kinds] * kinds


def star(arms, senses=1):
    """From one hub arms of two resistors, each to a bus of its own with two stores; of `senses` kinds."""
    nodes, elements = ["hub"], []
    for k in range(arms):
        nodes += [f"j{k}", f"b{k}"]
        ends = [(f"r{k}", "hub", f"j{k}"), (f"s{k}", f"j{k}", f"b{k}")]
        if k % senses:  # written the other way round
            ends = [(f"r{k}", f"j{k}", "hub"), (f"s{k}", f"b{k}", f"j{k}")]
        elements += [(name, R, a, b) for name, a, b in ends]
        elements += [(f"c{k}", C, f"b{k}", "ground"), (f"d{k}", C, f"b{k}", "ground")]
    return network(written(nodes, elements))


def test_a_strand_runs_through_nodes_that_two_branches_touch_alone():
    found = strands(*star(10), set())
    arms = max(found.classes, key=lambda one: len(one[0].branches))
    assert len(arms) == 10
    for strand in arms:
        assert len(strand.branches) == 2
        assert len(strand.nodes) == 3
        assert strand.nodes[1].startswith("j")
        assert {strand.nodes[0], strand.nodes[2]} & {"hub"}


def test_a_strand_the_other_way_round_is_the_same():
    found = strands(*star(10), set())
    strand = max(found.classes, key=lambda one: len(one[0].branches))[0]
    assert strand.reverse().reverse() == strand
    assert strand.reverse().nodes == strand.nodes[::-1]
    assert [sense for _, sense in strand.reverse().branches] == [not sense for _, sense in reversed(strand.branches)]


def test_strands_in_other_senses_are_other_classes():
    found = strands(*star(2 * RUN, 2), set())
    assert [len(same) for same in found.classes if len(same[0].branches) == 2] == [RUN, RUN]
    assert not [same for same in strands(*star(RUN, 2), set()).classes if len(same[0].branches) == 2]


def test_buses_of_one_kind_are_a_family():
    sites, runs = in_strands(*star(12), ({}, []))
    joints = {sites[f"j{k}"] for k in range(12)}
    assert len({family for family, _ in joints}) == 1
    assert sorted(place for _, place in joints) == list(range(12))
    held = {b.name for run in runs for b, _ in run.members}
    assert {f"r{k}" for k in range(12)} <= held
