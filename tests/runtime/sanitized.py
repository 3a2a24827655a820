"""The core under the address and the undefined-behaviour sanitizer: `python tests/runtime/sanitized.py [PYTEST ARGS]`.

The sources are built as pyproject.toml names them, with the sanitizers, into a folder of their own; a Python that has
the sanitizer's library before all others then runs the tests of the core with that build in place of the installed one.
A fault ends the process with the sanitizer's report.  Without arguments: all tests of tests/runtime.
"""

import os
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
PLAIN = ("-O0", "-g1", "-std=c11", "-fPIC")
FLAGS = (*PLAIN, "-fsanitize=address,undefined", "-fno-sanitize-recover=undefined")
SOONER = (*FLAGS, "-fno-sanitize=null,alignment,pointer-overflow")
"""In half the time: what leaves an array, or is read through NULL, the address sanitizer sees as well."""
OPTIONS = {
    "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=1",  # CPython keeps what it has to its end
    "UBSAN_OPTIONS": "print_stacktrace=1",
}
PRELUDE = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("sysdyn.runtime._core", sys.argv[1])
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
import sysdyn.runtime
sys.modules["sysdyn.runtime._core"] = sysdyn.runtime._core = module
from sysdyn.runtime.model import core_library
assert core_library._core.__file__ == sys.argv[1]
import pytest
sys.exit(pytest.main(sys.argv[2:]))
"""


def build(folder, flags=FLAGS):
    """The core's library with the sanitizers, as the package's extension module; two compilers side by side."""
    import sysconfig

    with (ROOT / "pyproject.toml").open("rb") as file:
        (module,) = tomllib.load(file)["tool"]["setuptools"]["ext-modules"]
    include = [f"-I{sysconfig.get_path('include')}", f"-I{np.get_include()}", f"-I{ROOT / 'runtime' / 'core'}"]
    objects = [folder / (Path(source).stem + ".o") for source in module["sources"]]

    def compiled(pair):
        source, target = pair
        subprocess.run(["gcc", *flags, *include, "-c", str(ROOT / source), "-o", str(target)], check=True)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(compiled, zip(module["sources"], objects, strict=True)))
    library = folder / "_core.so"
    subprocess.run(["gcc", *flags, "-shared", *map(str, objects), "-lm", "-o", str(library)], check=True)
    return library


def run(library, arguments):
    """The exit code of pytest with the library in place of the installed core, and what it said."""
    found = subprocess.run(["gcc", "-print-file-name=libasan.so"], check=True, capture_output=True, text=True).stdout
    env = {**os.environ, **OPTIONS, "LD_PRELOAD": str(Path(found.strip()).resolve())}
    command = [sys.executable, "-c", PRELUDE, str(library), "-q", "-p", "no:cacheprovider", *arguments]
    found = subprocess.run(command, check=False, env=env, cwd=ROOT, capture_output=True, text=True)
    return found.returncode, found.stdout + found.stderr


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        code, said = run(build(Path(made)), sys.argv[1:] or ["tests/runtime"])
    print(said)
    sys.exit(code)
