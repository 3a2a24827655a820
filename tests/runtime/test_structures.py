import ctypes
import hashlib
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from sysdyn.compiler.program import emit_c_support, emit_numpy
from sysdyn.runtime.model import carrier, core_library

CORE = Path(__file__).parents[2] / "runtime" / "core"


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
@pytest.mark.long
def test_ctypes_structures_have_the_compilers_layout(tmp_path):
    pairs = [("Frame", "sd_frame"), ("Call", "sd_call"), ("System", "sd_system"), ("Linear", "sd_linear")]
    pairs += [("Ivp", "sd_ivp"), ("Bdf", "sd_bdf"), ("Radau", "sd_radau"), ("Stepper", "sd_stepper")]
    pairs += [
        ("Settle", "sd_settle"),
        ("LeastNorm", "sd_least_norm"),
        ("Run", "sd_run"),
        ("Ledgers", "sd_ledgers"),
        ("Record", "sd_record"),
    ]
    pairs += [
        ("Rules", "sd_rules"),
        ("Many", "sd_many"),
        ("Pass", "sd_pass"),
        ("Region", "sd_region"),
        ("RunClaim", "sd_claim"),
    ]
    pairs += [("RunSamples", "sd_samples"), ("Modes", "sd_modes"), ("Mode", "sd_mode"), ("Held", "sd_held")]
    pairs += [("Strike", "sd_strike"), ("Corners", "sd_corners"), ("Extrema", "sd_extrema")]
    pairs += [("Transition", "sd_transition"), ("Contact", "sd_contact"), ("Kink", "sd_kink"), ("Piece", "sd_piece")]
    pairs += [("Underlying", "sd_underlying"), ("Dopri", "sd_dopri"), ("Energy", "sd_energy")]
    pairs += [("Rosenbrock", "sd_rosenbrock")]
    pairs += [("Balance", "sd_balance"), ("Sizing", "sd_sizing"), ("Order", "sd_order")]
    pairs += [("RowsOfStart", "sd_rows_of_start"), ("Search", "sd_search")]
    pairs += [("Condensed", "sd_condensed"), ("Expanded", "sd_expanded"), ("PlaceSpan", "sd_span")]
    pairs += [("Straight", "sd_straight"), ("Left", "sd_left"), ("Lines", "sd_lines"), ("Shares", "sd_shares")]
    pairs += [("RadauMethod", "sd_radau_method")]
    pairs += [("Watch", "sd_watch"), ("Collocation", "sd_collocation")]
    headers = [
        f'#include "{path.relative_to(CORE)}"'
        for path in sorted(CORE.rglob("*.h"))
        if path.name not in ("complex_linear.h", "null_space.h", "dense_lu.h")
    ]
    lines = [*headers, "#include <stddef.h>", "#include <stdio.h>", "int main(void) {"]
    for name, tag in pairs:
        fields = [field[0].removesuffix("_") for field in getattr(core_library, name)._fields_]
        lines.append(f'printf("%zu\\n", sizeof({tag}));')
        lines += [f'printf("%zu\\n", offsetof({tag}, {field}));' for field in fields]
    source = tmp_path / "sizes.c"
    source.write_text("\n".join([*lines, "return 0; }"]))
    subprocess.run(["gcc", f"-I{CORE}", str(source), "-o", str(tmp_path / "sizes")], check=True)
    found = subprocess.run([str(tmp_path / "sizes")], check=True, capture_output=True, text=True).stdout.split()
    expected = []
    for name, _ in pairs:
        structure = getattr(core_library, name)
        expected.append(ctypes.sizeof(structure))
        expected += [getattr(structure, field[0]).offset for field in structure._fields_]
    assert [int(item) for item in found] == expected


CONTRACTS = {
    1: "da7d7f02b741f1788e20489ec42b69c77a427b0fdf7e9d642f416b45c0d25392",
    2: "36e6b82ac6ac33ecefe0dec8ff11dfddbedf80af805d01604ce418aa781080a6",
    3: "e5f75108df6c821a6ab83a5617f19b6850ac119ce69950d5a6aba5c4a018d433",
}
"""SHA-256 of model.h without white space, by SD_CONTRACT."""


def test_a_change_of_the_contract_raises_its_number():
    """What compiled models and this runtime agree on is all of model.h: what is made from another must be refused.

    Where this fails: raise SD_CONTRACT in model.h, sd_contract in compiler/program/emit_c_support.py, CONTRACT in
    emit_numpy.py and in runtime/model/carrier.py, and enter the number's hash here; a change of words alone enters its
    hash for the number that stands.
    """
    header = (CORE / "system" / "model.h").read_text()
    number = int(re.search(r"SD_CONTRACT = (\d+)", header)[1])
    assert hashlib.sha256("".join(header.split()).encode()).hexdigest() == CONTRACTS[number]
    assert number == carrier.CONTRACT == max(CONTRACTS)
    assert f"const int sd_contract = {number};" in emit_c_support.HEAD
    assert f"CONTRACT = {number}" in emit_numpy.HEAD


def test_every_structure_of_the_core_is_compared():
    """Structures that ctypes mirrors, against those that the test above asks the compiler about."""
    mirrored = {name for name in dir(core_library) if _is_structure(getattr(core_library, name))}
    text = Path(__file__).read_text()
    assert {name for name in mirrored if f'("{name}", "sd_' not in text} == set()


def _is_structure(item):
    return isinstance(item, type) and issubclass(item, ctypes.Structure) and item is not ctypes.Structure
