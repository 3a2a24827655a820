"""Mutants are what they say; verify kills one sign of each room of the lowering, and 95 % of a sample (SYSDYN_LONG)."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import run
from mutants import mutants

CHANGES = {
    "y = neg(x)": ["y = x"],
    "y = ex.neg(x)": ["y = x"],
    "y = ex.sub(a, b)": ["y = ex_.add(a, b)"],
    "y = sub(a, b)": ["y = ex_.add(a, b)"],
    "y = k + 1": ["y = k"],
    "y = k - 1": ["y = k"],
    "y = a - b": ["y = a + b"],
    "y = set(a) - b": [],
    "y = -x": ["y = x"],
    "y = 1.0 if c else -1.0": ["y = -1.0 if c else 1.0"],
    "y = x[0]": ["y = x[1]"],
    "y = x[1]": ["y = x[0]"],
    "y = m.rate": ["y = m.coordinate"],
    "y = model.mirror.conjugate": ["y = model.mirror.rate"],
    "y = 'q'": ["y = 'f'"],
    "y = 'bp'": ["y = 'bf'"],
    "y = c.units['q']": [],
    "y = f'{x[0]}'": [],
    "raise E(x[0])": [],
}
SIGNS = (
    ("forms/efforts.py", "efforts", "neg left out", "seed/dc_motor"),
    ("forms/kane.py", "_column", "neg left out", "seed/knife_edge"),
    ("network/reflection.py", "_coupling", "neg left out", "seed/dc_motor"),
)


@pytest.mark.parametrize("text", CHANGES)
@pytest.mark.one_in(12)
def test_each_kind_of_change(text):
    wanted = {ast.unparse(ast.parse(t)) for t in CHANGES[text]}
    assert wanted <= {m.text for m in mutants(text)}
    assert bool(wanted) == bool(mutants(text))


@pytest.mark.parametrize("name", run.LOWERING)
@pytest.mark.long
def test_mutants_of_the_lowering_compile_and_differ(name):
    found = run.sites(name)
    plain = ast.unparse(ast.parse((run.ROOT / "compiler" / name).read_text()))
    assert found
    for site in found[:: max(1, len(found) // 10)]:
        assert site.mutant.text != plain
        assert site.mutant.line in site.lines
        compile(run.changed(site.mutant.text), name, "exec")


@pytest.mark.long
def test_equivalents_are_mutants():
    """Every entry of EQUIVALENT names mutants that there are."""
    for name, function, text, _ in run.EQUIVALENT:
        assert any(s.function == function and text in s.source for s in run.sites(name)), (name, function, text)


@pytest.mark.parametrize(("name", "function", "what", "model"), SIGNS)
@pytest.mark.long
def test_one_sign_dies(name, function, what, model):
    command = [sys.executable, run.__file__, "--only", name, "--function", function, "--what", what]
    ran = subprocess.run([*command, "--models", model], capture_output=True, text=True, timeout=120, check=False)
    assert " 100.0 % dead" in ran.stdout, ran.stdout + ran.stderr
    assert "dead: " in ran.stdout


@pytest.mark.skipif(not os.environ.get("SYSDYN_LONG"), reason="some minutes: SYSDYN_LONG=1")
def test_a_sample_dies():
    ran = subprocess.run([sys.executable, run.__file__, "--sample", "60"], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout
