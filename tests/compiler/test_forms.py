"""The forms between text and energies: printed, verified, and in the letters of their family.

SYSDYN_SNAPSHOTS=write writes the snapshots anew: read the difference before it is committed.
"""

import os
from dataclasses import replace
from pathlib import Path

import pytest
from sysdyn.cli.commands.model.compile_command import STAGES
from sysdyn.cli.main import run
from sysdyn.compiler.network.reflection import relabel
from sysdyn.compiler.network.verify import BrokenNetworkError, verify_network
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.network_text import show
from sysdyn.dsl.text.diagnostics import Report

ROOT = Path(__file__).resolve().parents[2]
DUMPS = Path(__file__).parent / "dumps"
CASES = [
    (model, formulation, stage)
    for model, formulation in (
        ("seed/lead_filter", "lagrangian"),
        ("seed/lead_filter", "co_hamiltonian"),
        ("seed/dc_motor", "hamiltonian"),
        ("seed/co_circuit", "co_lagrangian"),
        ("gallery/transmission_line", "lagrangian"),
        ("seed/pendulum", "lagrangian"),
    )
    for stage in STAGES[:3]
]


@pytest.mark.parametrize(("model", "formulation", "stage"), CASES)
@pytest.mark.one_in(12)
def test_a_stage_is_printed_as_it_was_read(model, formulation, stage, capsys):
    path = ROOT / "models" / f"{model}.sd"
    scenes = load.read(path, Report()).scenes
    command = ["compile", str(path), "--scene", next(iter(scenes)), "--formulation", formulation, "--dump", stage]
    assert run(command) == 0
    text = capsys.readouterr().out
    kept = DUMPS / f"{model.replace('/', '-')}-{formulation}-{stage}.txt"
    if os.environ.get("SYSDYN_SNAPSHOTS") == "write":
        kept.write_text(text, encoding="utf-8")
    assert text == kept.read_text(encoding="utf-8")


def network_of(model):
    document = load.read(ROOT / "models" / f"{model}.sd", Report())
    scene = next(iter(document.scenes.values()))
    made = load.network(document, document.models[".".join(scene.model.names)], scene, Report())
    assert made is not None
    return made


TWICE = ("seed/lead_filter", "seed/dc_motor", "seed/mechanical_gyrator", "gallery/fluid_tank")


@pytest.mark.parametrize("model", TWICE)
def test_the_other_letters_twice_are_the_letters_themselves(model):
    with ex.fresh():
        network = network_of(model)
        assert relabel(relabel(network)) == network
        assert show(relabel(network)) != show(network)


def test_nothing_of_nodes_and_branches_is_left_in_coordinates():
    with ex.fresh():
        made = compile_network(network_of("seed/lead_filter"))
        assert made.family.branches
        assert not made.network.branches
        with pytest.raises(BrokenNetworkError, match=r"no quantity of a coordinate|branches are left"):
            verify_network(made.family, coordinates=True)


def faults(network):
    """Networks of which one thing is wrong, with what the verifier says."""
    first, other = network.branches[0], network.branches[1]
    yield replace(network, branches=tuple(b for b in network.branches if b.name != "c")), "declared nowhere"
    yield replace(network, nodes=network.nodes[:-1]), "declared nowhere"
    stray = replace(first, law=ex.var("nobody", "s"))
    yield replace(network, branches=(stray, *network.branches[1:])), "nobody"
    loose = replace(first, law=ex.index("k"))
    yield replace(network, branches=(loose, *network.branches[1:])), "no loop"
    many = replace(first, law=ex.var(other.name, "bf", ex.const(1.0)))
    yield replace(network, branches=(many, *network.branches[1:])), "indices"


@pytest.mark.parametrize("number", range(5))
def test_the_verifier_sees_what_an_arrow_could_do_wrong(number):
    with ex.fresh():
        network = network_of("seed/lead_filter")
        verify_network(network)
        wrong, said = list(faults(network))[number]
        with pytest.raises(BrokenNetworkError, match=said):
            verify_network(wrong)
