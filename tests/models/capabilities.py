"""Rows of a text against an independent solution, for the capabilities that the seed lists."""

from book_entries import BOOK, ENTRIES, begin, residual
from reference_values import load
from sysdyn.cli.main import run
from sysdyn.dsl.model import expression as ex
from sysdyn.runtime.structure.structure import structure

REFERENCES = load("references.json")


def entries(key, *formulations):
    found = [e for e in ENTRIES if e.key == key and (not formulations or e.formulation in formulations)]
    assert found, key
    return found


def meets(key, *formulations):
    """Every descriptor model of a system holds on its independent solution; returns (entry, form, facts) of each."""
    made = []
    for entry in entries(key, *formulations):
        with ex.fresh():
            prepared, found = begin(entry)
            assert residual(entry, prepared) < 1e-12, entry.name
            made.append((entry, prepared.compiled, structure(found.system, found.state)))
    return made


def counts(key, *formulations):
    """(n, m1, m2, m3, m4) of each model, all checked."""
    return {entry.counts[:5] for entry, _, _ in meets(key, *formulations)}


def printed(capsys, file, formulation, form="descriptor"):
    """The lines of `sysdyn equations` of a text of models/book."""
    options = ["--scene", "reference", "--formulation", formulation, "--form", form, "--quiet"]
    assert run(["equations", str(BOOK / f"{file}.sd"), *options]) == 0
    return [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]


RC = """model rc {
  node a: electrical
  C: potential(q = 2 F*e) a -> ground
  R: dissipator(e = 0.5 ohm*f) a -> ground
  init C.e = 3 V
}
scene s of rc {
  time 0 s to 1 s
  accuracy 1e-9
  trace C.power as absorbed, R.power as lost, R.energy as heat, C.V as stored, audit.energy as balance every 0.1 s
}
"""
