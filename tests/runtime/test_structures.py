import ctypes
import shutil
import subprocess
from pathlib import Path

import pytest
from sysdyn.runtime.model import core_library as lib

CORE = Path(__file__).parents[2] / "runtime" / "core"


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_ctypes_structures_have_the_compilers_layout(tmp_path):
    pairs = [("Frame", "sd_frame"), ("Call", "sd_call"), ("System", "sd_system"), ("Linear", "sd_linear")]
    pairs += [("Bdf", "sd_bdf"), ("Settle", "sd_settle"), ("Stepper", "sd_stepper"), ("Radau", "sd_radau")]
    pairs += [("LeastNorm", "sd_least_norm"), ("Run", "sd_run"), ("Ledgers", "sd_ledgers"), ("Record", "sd_record")]
    pairs += [("Many", "sd_many"), ("Pass", "sd_pass"), ("Region", "sd_region"), ("RunClaim", "sd_claim")]
    pairs += [("RunSamples", "sd_samples"), ("Modes", "sd_modes"), ("Mode", "sd_mode"), ("Held", "sd_held")]
    pairs += [("Transition", "sd_transition"), ("Contact", "sd_contact"), ("Kink", "sd_kink")]
    pairs += [("Underlying", "sd_underlying"), ("Dopri", "sd_dopri"), ("Energy", "sd_energy")]
    pairs += [("Balance", "sd_balance"), ("RowsOfStart", "sd_rows_of_start"), ("Search", "sd_search")]
    pairs += [("Condensed", "sd_condensed"), ("Expanded", "sd_expanded"), ("Span", "sd_span")]
    pairs += [("Straight", "sd_straight")]
    headers = [
        f'#include "{name}.h"'
        for name in ("run", "bdf", "radau", "dopri", "energy", "many", "search", "expanded")
    ]
    lines = [*headers, "#include <stddef.h>", "#include <stdio.h>", "int main(void) {"]
    for name, tag in pairs:
        lines.append(f'printf("%zu\\n", sizeof({tag}));')
        fields = [field[0].removesuffix("_") for field in getattr(lib, name)._fields_]
        lines += [f'printf("%zu\\n", offsetof({tag}, {field}));' for field in fields]
    source = tmp_path / "sizes.c"
    source.write_text("\n".join([*lines, "return 0; }"]))
    subprocess.run(["gcc", f"-I{CORE}", str(source), "-o", str(tmp_path / "sizes")], check=True)
    found = subprocess.run(
        [str(tmp_path / "sizes")], check=True, capture_output=True, text=True
    ).stdout.split()
    expected = []
    for name, _ in pairs:
        structure = getattr(lib, name)
        expected.append(ctypes.sizeof(structure))
        expected += [getattr(structure, field[0]).offset for field in structure._fields_]
    assert [int(item) for item in found] == expected
