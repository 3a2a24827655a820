"""The package: its list of folders; a wheel built from the source distribution works outside the repository."""

import os
import re
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SETUP = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
ROOMS = ("dsl", "compiler", "runtime", "cli", "models")


def test_every_package_is_listed():
    found = {}
    for room in ROOMS:
        for init in sorted((ROOT / room).rglob("__init__.py")):
            folder = init.parent.relative_to(ROOT).as_posix()
            named = {"cli/api": "sysdyn.api", "cli/sysdyn": "sysdyn"}
            found[named.get(folder, "sysdyn." + folder.replace("/", "."))] = folder
    assert SETUP["package-dir"] == found
    assert sorted(SETUP["packages"]) == sorted(found)


def test_every_room_is_typed():
    assert all((ROOT / room / "py.typed").is_file() for room in ROOMS)


def test_sources_of_the_core_are_listed():
    (module,) = SETUP["ext-modules"]
    core = {path.relative_to(ROOT).as_posix(): path for path in (ROOT / "runtime" / "core").rglob("*.[ch]")}
    included = re.findall(r'#include "([\w/]+\.c)"', "".join(path.read_text() for path in core.values()))
    twice = {f"runtime/core/{name}" for name in included}
    assert set(module["sources"]) == {path for path in core if path.endswith(".c")}
    assert set(module["depends"]) == {path for path in core if path.endswith(".h")} | twice


def built(folder):
    """(source distribution, wheel built from it): those of .ci/run where it names their folder."""
    if made := os.environ.get("SYSDYN_DIST"):
        return _distributions(Path(made))
    tree = folder / "tree"
    tree.mkdir(parents=True)
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    for name in filter(None, subprocess.run(listed, cwd=ROOT, capture_output=True, check=True).stdout.split(b"\0")):
        path = name.decode()
        if (ROOT / path).is_file():
            (tree / path).parent.mkdir(parents=True, exist_ok=True)
            (tree / path).write_bytes((ROOT / path).read_bytes())
    command = [sys.executable, "-m", "build", "--outdir", str(folder), str(tree)]
    made = subprocess.run(command, capture_output=True, text=True, check=False, timeout=500)
    assert made.returncode == 0, made.stdout[-3000:] + made.stderr[-3000:]
    return _distributions(folder)


def _distributions(folder):
    return next(folder.glob("*.tar.gz")), next(folder.glob("*.whl"))


@pytest.mark.first
def test_the_wheel_is_whole_and_works_outside_the_repository(tmp_path):
    """One build for both."""
    source, wheel = built(tmp_path / "dist")
    _holds_all_data(source, wheel)
    _works_outside_the_repository(wheel, tmp_path)


def _holds_all_data(source, wheel):
    with tarfile.open(source) as archive:
        in_source = {name.partition("/")[2] for name in archive.getnames()}
    with zipfile.ZipFile(wheel) as archive:
        in_wheel = set(archive.namelist())
    kinds = (".lark", ".sd", ".toml", ".h", ".c", ".yml")
    data = [p for room in ROOMS for p in (ROOT / room).rglob("*") if p.suffix in kinds]
    data += (ROOT / "dsl" / "language").glob("*.md")
    assert data
    for path in data:
        name = path.relative_to(ROOT).as_posix()
        assert name in in_source
        assert f"sysdyn/{name}" in in_wheel
    assert any(name.endswith("LICENSE") for name in in_wheel)
    assert "sysdyn/dsl/parser/sd.tables" in in_wheel
    assert f"sysdyn/runtime/_core{sysconfig.get_config_var('EXT_SUFFIX')}" in in_wheel


def _works_outside_the_repository(wheel, tmp_path):
    """In an environment that sees the installed dependencies, but this sysdyn alone."""
    place = tmp_path / "site"
    install = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--no-index",
        "--no-compile",  # what runs is compiled as it is imported: a tenth of all
        "--target",
        str(place),
        str(wheel),
    ]
    subprocess.run(install, check=True, timeout=300, capture_output=True)
    model = tmp_path / "pendulum.sd"
    model.write_text((ROOT / "models" / "gallery" / "pendulum.sd").read_text())
    home = tmp_path / "home"
    home.mkdir()
    environment = {"PATH": os.environ["PATH"], "HOME": str(home), "PYTHONPATH": str(place)}
    if fonts := os.environ.get("MPLCONFIGDIR"):  # matplotlib takes ten seconds to list them anew
        environment["MPLCONFIGDIR"] = fonts
    code = "import sysdyn.cli.main as m, sys; print(m.__file__, file=sys.stderr); m.main(sys.argv[1:])"

    def sysdyn(*arguments):
        # -S keeps an editable install's hooks away; the dependencies come back by name
        paths = [str(place), *(p for p in sys.path if p.endswith("site-packages"))]
        command = [sys.executable, "-S", "-c", f"import sys; sys.path[1:1] = {paths!r}; {code}", *arguments]
        return subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300, check=False
        )

    ran = sysdyn("simulate", "pendulum.sd")
    assert ran.returncode == 0, ran.stderr
    assert str(place) in ran.stderr
    assert ", c\n" in ran.stderr
    assert sysdyn("plot", "pendulum-swing.h5").returncode == 0
    assert (tmp_path / "pendulum-swing.png").read_bytes().startswith(b"\x89PNG")
    assert sysdyn("check", "--strict", "pendulum.sd").returncode == 0
    made = sysdyn("new", "swing")
    assert made.returncode == 0, made.stderr
    assert sysdyn("help", "units").stdout.startswith("units: ")
    assert sysdyn("std", "resistor").stdout.startswith("resistor: ")
