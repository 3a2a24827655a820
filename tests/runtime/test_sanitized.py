"""A slice of the core's tests under the sanitizers; all of them: `python tests/runtime/sanitized.py`."""

import shutil
import subprocess

import pytest
from sanitized import FLAGS, SOONER, build, run

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
SLICE = {
    "test_linear.py": ("agrees_with_numpy", "refactorises", "without_a_pivot"),
    "test_radau.py": ("typed",),
    "test_dopri.py": ("text_jumps",),
    "test_starter.py": ("left_out",),
    "../models/test_event_friction.py": ("on_four_feet",),  # factors of more columns than rows
}


@pytest.mark.long
def test_a_slice_of_the_core_has_no_fault(tmp_path):
    files = [f"tests/runtime/{name}" for name in SLICE]
    chosen = " or ".join(part for parts in SLICE.values() for part in parts)
    code, said = run(build(tmp_path, SOONER), [*files, "-k", chosen])
    assert code == 0, said
    assert "passed" in said or "%]" in said


@pytest.mark.parametrize("flags", [FLAGS, SOONER], ids=["all", "sooner"])
@pytest.mark.parametrize("fault", ["a[n] = 1.0", "shift = 1 << (n + 31)", "a[0] = *(double *)(v[n] = 0)"])
@pytest.mark.long
def test_the_sanitizers_see_a_fault(tmp_path, fault, flags):
    source = tmp_path / "fault.c"
    source.write_text(
        f"int main(int n, char **v) {{ double a[1]; int shift = 0; (void)v; {fault};"
        " volatile double keep = a[0] + shift; return keep < -1e300; }\n"
    )
    flags = [flag for flag in flags if flag not in {"-fPIC", "-O1"}]
    subprocess.run(["gcc", *flags, str(source), "-o", str(tmp_path / "fault")], check=True)
    found = subprocess.run([str(tmp_path / "fault")], check=False, capture_output=True, text=True)
    assert found.returncode != 0
    assert "runtime error" in found.stderr or "AddressSanitizer" in found.stderr
