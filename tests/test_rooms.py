"""The rooms' READMEs say what is there: files that exist, and the way of one parameter as it is really called."""

import inspect
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from sysdyn.cli.main import run

ROOT = Path(__file__).resolve().parents[1]
TOPS = ("dsl", "compiler", "runtime", "cli")
ROOMS = sorted(init.parent for top in TOPS for init in (ROOT / top).rglob("__init__.py"))
CORE = ROOT / "runtime" / "core"
OF_THE_CORE = sorted({path.parent for room in ("linear", "run", "steppers") for path in (CORE / room).rglob("*.c")})
STEP = re.compile(r"`([a-z_/]+\.py)`: `([\w.]+)`")

MODEL = """
model spring {
  param m = 1.13 kg
  param k = 4 N/m
  coord x: translation = 1 m
  energy T* = 1/2*m*x'^2
  energy V = 1/2*k*x^2
}
scene swing of spring { time 0 s to 1 s; trace x every 0.1 s }
"""


@pytest.mark.parametrize("room", [*ROOMS, *OF_THE_CORE], ids=lambda room: room.relative_to(ROOT).as_posix())
def test_every_room_has_a_page_of_files_that_exist(room):
    text = (room / "README.md").read_text(encoding="utf-8")
    assert text.startswith(f"# {room.name}: ")
    assert len(text.splitlines()) <= 60, "one page"
    places = [room, *room.parents[: len(room.relative_to(ROOT).parts)]]
    notes = room / "decisions.md"
    pages = text + (notes.read_text(encoding="utf-8") if notes.is_file() else "")
    for name in re.findall(r"`([a-z_/]+\.(?:py|c|h|lark|toml|js|md))`", pages):
        assert any((place / name).is_file() for place in places), name
    for name in re.findall(r"`([a-z_/]+/)`", text):
        assert (room / name).is_dir(), name


def test_each_room_of_the_core_includes_only_those_above_it():
    core = ROOT / "runtime" / "core"
    order = re.findall(r"^\| `(\w+)/` \|", (core / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert {path.relative_to(core).parts[0] for path in core.rglob("*.[ch]")} == set(order)
    for path in core.rglob("*.[ch]"):
        for room in re.findall(r'^#include "(\w+)/', path.read_text(encoding="utf-8"), re.MULTILINE):
            assert order.index(room) <= order.index(path.relative_to(core).parts[0]), path


def test_no_room_holds_more_files_than_one_takes_in():
    for room in [*ROOMS, *OF_THE_CORE]:
        assert sum(path.is_file() and path.suffix in {".py", ".c", ".h"} for path in room.iterdir()) <= 24, room


def tracked():
    """Paths of all files that are committed, relative to the root."""
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("not a clone")
    return subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()


OUTSIDE = re.compile(r"\.\./shared|shared/[A-Za-z]|SYSDYN_[S]HARED|/(?:work|home|root|Users)/[A-Za-z]")
"""Folders beside a clone, and absolute paths of one machine."""


def test_no_file_names_a_folder_outside_the_repository():
    named = {}
    for path in tracked():
        text = (ROOT / path).read_bytes()
        found = OUTSIDE.findall(text.decode("utf-8", "replace")) if b"\0" not in text else []
        if found and path != "tests/test_rooms.py":
            named[path] = found
    assert named == {}


def test_nothing_but_the_rooms_stands_at_the_top():
    """What a command leaves where it is run is not committed with the rest."""
    rooms = {"dsl", "compiler", "runtime", "cli", "models", "tests", "docs", ".ci", ".github"}
    files = {"pyproject.toml", "README.md", "CHANGELOG.md", "LICENSE", ".gitignore", ".pre-commit-hooks.yaml"}
    pages = {"ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md", "CITATION.cff"}
    assert {path.partition("/")[0] for path in tracked()} == rooms | files | pages


def test_every_room_stands_on_the_page_of_its_house():
    for room in ROOMS:
        if room.parent in {ROOT / top for top in TOPS}:
            assert f"`{room.name}/`" in (room.parent / "README.md").read_text(encoding="utf-8"), room


def test_the_walks_lead_to_files_and_names_that_exist():
    """Each begins at a page that leads on to the next, and names what is to be changed where it is defined."""
    page = (ROOT / "cli" / "walks.md").read_text(encoding="utf-8")
    assert page.count("\n## ") == 8
    for file in re.findall(r"`([a-z_A-Z/]+\.(?:py|c|h|md|toml))`", page):
        assert (ROOT / file).is_file(), file
    found = re.findall(r"`([a-z_/]+\.(?:py|c))`: `(\w+)`(?: and `(\w+)`)?", page)
    assert len(found) > 20
    for file, *names in found:
        text = (ROOT / file).read_text(encoding="utf-8")
        for name in filter(None, names):
            if file.endswith(".c"):
                assert re.search(rf"^(?:static )?\w+ \*?{name}\(", text, re.MULTILINE), (file, name)
            else:
                assert re.search(rf"^(?:class |def )?{name}\b", text, re.MULTILINE), (file, name)


def test_the_way_of_a_parameter_is_the_one_that_is_taken(tmp_path, monkeypatch):
    """The steps of cli/README.md are called, each for the first time after the one before it."""
    page = (ROOT / "cli" / "README.md").read_text(encoding="utf-8")
    steps = STEP.findall(page.partition("## The way of one parameter")[2])
    assert len(steps) > 15
    called: dict[tuple[str, str], int] = {}
    package = re.compile(rf"({'|'.join(TOPS)})(/\w+)*/\w+\.py$")

    def note(frame, event, argument):
        if event == "call" and frame.f_code.co_flags & inspect.CO_OPTIMIZED:  # no bodies of modules and classes
            found = package.search(frame.f_code.co_filename)
            if found and frame.f_code.co_name != "__del__":  # what an earlier test left behind
                called.setdefault((found[0], frame.f_code.co_qualname), len(called))

    model = tmp_path / "spring.sd"
    model.write_text(MODEL)
    monkeypatch.chdir(tmp_path)
    sys.setprofile(note)
    try:
        assert run(["simulate", "spring.sd", "--quiet"]) == 0
    finally:
        sys.setprofile(None)
    when = [_first(called, file, name) for file, name in steps]
    assert when == sorted(when), [f"{file}: {name}" for _, (file, name) in sorted(zip(when, steps, strict=True))]


def _first(called: dict[tuple[str, str], int], file: str, name: str) -> int:
    """When a function was first called, or any method of a class."""
    found = [n for (f, q), n in called.items() if f == file and (q == name or q.startswith(f"{name}."))]
    assert found, f"{file}: {name} is never called"
    return min(found)


def test_no_test_reads_a_clock_that_measures_speed():
    clock = re.compile(r"\b(?:process_time|perf_counter|getrusage|" + r"thread_time)\b|assert time\.monotonic\(\) -")
    assert not [
        p.name for p in (ROOT / "tests").rglob("test_*.py") if p.name != "test_rooms.py" and clock.search(p.read_text())
    ]
