"""Which tests reach what at which cost, and a set of them that reaches all: CI runs that, the long suite the rest too.

    covering.py build FOLDER                    the package with counters in its core (gcc), beside the one installed
    covering.py measure FOLDER [pytest's own]   runs tests on it, into FOLDER/*.jsonl, *.bin, *.ids (needs `coverage`)
    covering.py choose FOLDER SECONDS           the marks of tests by which a covering set stays
    covering.py mark FOLDER SECONDS             writes them into the tests

Measured of each test: CPU seconds of its process and of those it started, branches of Python (arcs of lines), and
counters of gcc in C.  The set is found greedily: next is always the case that reaches most for its time, where a branch
that no case reached yet counts 1, one that one or two did 0.4 and 0.2 (two assertions see more than one).  Cheap
cases stay in any case.  A family of cases is thinned in the order of conftest's `one_in`, so that
a mark says what is kept.
"""

from __future__ import annotations

import ast
import ctypes
import heapq
import json
import math
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import zipfile
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = 0.6180339887498949  # tests/conftest.py
CHEAP = 0.1
"""Seconds of a case that stays whatever others reach: half of all cases, a twentieth of their time."""
WEIGHTS = np.array([1.0, 0.4, 0.2, 0.0])
"""Of a branch that none, one, two, more cases of the set reach."""
FUNCTION, ARCS = 0x01000000, 0x01A10000
"""Tags of gcc's files of counters."""

DUMP = """void __gcov_dump(void);
void __gcov_reset(void);
__attribute__((visibility("default"))) void covering_dump(void)
{
    __gcov_dump();
    __gcov_reset();
}
"""


def build(folder):
    """FOLDER/site: the package of this tree, whose core counts its branches and hands counters out when it is asked."""
    with tempfile.TemporaryDirectory() as scratch:
        tree = Path(scratch) / "tree"
        tree.mkdir()
        for name in subprocess.check_output(["git", "ls-files"], cwd=ROOT, text=True).splitlines():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tree / name)
        (tree / "runtime/core/linear/covering_dump.c").write_text(DUMP)
        project = tree / "pyproject.toml"
        text, flags = project.read_text(), 'extra-compile-args = ["-std=c11", "-O3"'
        text = text.replace("\nsources = [\n", '\nsources = [\n  "runtime/core/linear/covering_dump.c",\n', 1)
        text = text.replace(
            flags,
            'extra-link-args = ["--coverage"]\n' + flags.replace("-O3", "-O2") + ', "--coverage"',
            1,
        )
        project.write_text(text)
        subprocess.run([sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", scratch, str(tree)], check=True)
        with zipfile.ZipFile(next(Path(scratch).glob("*.whl"))) as wheel:
            wheel.extractall(folder / "site")


def measure(folder, arguments):
    """Tests that are not measured yet, by pytest with this file as its plugin."""
    paths = [str(folder / "site"), str(Path(__file__).parent)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "COVERING": str(folder)}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "covering", *arguments]
    return subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode


class Meter:
    """What a process of pytest measures: one line of a log and a row of numbers a test."""

    def __init__(self, folder):
        import coverage

        worker = f"{os.environ.get('PYTEST_XDIST_WORKER', 'main')}-{os.getpid()}"
        self.numbers, self.named = {}, 0
        self.place = Path(tempfile.mkdtemp(prefix="covering-"))
        os.environ["GCOV_PREFIX"] = str(self.place)
        package = folder / "site" / "sysdyn"
        self.core = ctypes.CDLL(str(next((package / "runtime").glob("_core*.so"))))
        self.arcs = coverage.Coverage(branch=True, data_file=None, source=[str(package)], config_file=False)
        self.arcs.config.disable_warnings = [
            "trace-changed",
            "no-data-collected",
            "module-not-imported",
            "not-measured",
        ]
        self.arcs.start()
        self.log, self.rows, self.names = (folder / f"{worker}.{end}" for end in ("jsonl", "bin", "ids"))
        self.size = 0

    def number(self, branch):
        """Its number in this process."""
        return self.numbers.setdefault(branch, len(self.numbers))

    def take(self):
        """Numbers of what was reached since the last time."""
        found = set()
        for file, arcs in list(self.arcs._collector.data.items()):  # contexts of its own would fill a data base
            found.update(self.number((file, arc)) for arc in list(arcs))
            arcs.clear()
        self.core.covering_dump()
        for path in self.place.rglob("*.gcda"):
            found.update(self.number(counter) for counter in counters(path))
        shutil.rmtree(self.place, ignore_errors=True)
        return found

    def note(self, name, seconds):
        """A test has ended."""
        found = np.fromiter(self.take(), dtype="<u4")
        with self.names.open("a") as file:
            file.writelines(json.dumps(name) + "\n" for name in list(self.numbers)[self.named :])
        self.named = len(self.numbers)
        with self.rows.open("ab") as file:
            file.write(found.tobytes())
        with self.log.open("a") as file:
            print(json.dumps({"id": name, "cpu": seconds, "n": found.size, "at": 4 * self.size}), file=file)
        self.size += found.size


def counters(path):
    """(file, function, number) of each counter of gcc that is not zero."""
    data, at, function = path.read_bytes(), 16, None
    while at + 8 <= len(data):
        tag, length = struct.unpack_from("<Ii", data, at)
        at += 8
        if tag == FUNCTION and length:
            function = struct.unpack_from("<I", data, at)[0]
        elif tag == ARCS and length > 0:
            for number in np.flatnonzero(np.frombuffer(data, "<u8", length // 8, at)):
                yield path.name, function, int(number)
        at += max(length, 0)  # below 0: so many zeros, not written


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Families as they are before conftest thins them; what is measured already is left out."""
    if "COVERING" in os.environ:
        folder = Path(os.environ["COVERING"])
        cases = [(item.nodeid, item.get_closest_marker("long") is not None) for item in items]
        (folder / "family.json").write_text(json.dumps(cases))
        done = {json.loads(line)["id"] for log in folder.glob("*.jsonl") for line in log.open()}
        items[:] = [item for item in items if item.nodeid not in done]


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item):
    """Measured around all that pytest does for one test."""
    if "COVERING" not in os.environ:
        return (yield)
    if not METERS:
        METERS.append(Meter(Path(os.environ["COVERING"])))
        METERS[0].take()  # what importing reaches is nobody's
    before = sum(os.times()[:4])
    result = yield
    METERS[0].note(item.nodeid, round(sum(os.times()[:4]) - before, 4))
    return result


METERS = []
"""Of this process, from its first test on."""


def measured(folder):
    """{case: (CPU seconds, branches it reaches)}, number of branches."""
    cases, branches = {}, {}
    for log in sorted(folder.glob("*.jsonl")):
        names = log.with_suffix(".ids").read_text().splitlines()
        table = np.array([branches.setdefault(name, len(branches)) for name in names], dtype=np.int64)
        rows = np.fromfile(log.with_suffix(".bin"), dtype="<u4")
        for line in log.read_text().splitlines():
            case = json.loads(line)
            begin = case["at"] // 4
            cases[case["id"]] = case["cpu"], np.unique(table[rows[begin : begin + case["n"]]])
    return cases, len(branches)


def families(folder):
    """{function: (share, case) of each that is not marked long}, in the order in which one_in(n) keeps them:
    it keeps a case whose share is below 1 / n.
    """
    found, number = defaultdict(list), Counter()
    for case, long in json.loads((folder / "family.json").read_text()):
        function = case.partition("[")[0]
        if not long:
            found[function].append((number[function] * GOLDEN % 1.0, case))
        number[function] += 1
    return {function: sorted(of) for function, of in found.items()}


def choose(folder, seconds):
    """{function: how many of its cases stay}, of those that were measured whole or in part."""
    cases, branches = measured(folder)
    family = {f: [case for _, case in of if case in cases] for f, of in families(folder).items()}
    family = {f: of for f, of in family.items() if of}
    reached, kept, spent = np.zeros(branches, dtype=np.int64), dict.fromkeys(family, 0), 0.0

    def worth(function):
        if kept[function] == len(family[function]):
            return 0.0
        cost, branch = cases[family[function][kept[function]]]
        return float(WEIGHTS[np.minimum(reached[branch], len(WEIGHTS) - 1)].sum()) / max(cost, 0.01)

    def keep(function):
        nonlocal spent
        cost, branch = cases[family[function][kept[function]]]
        reached[branch] += 1
        kept[function] += 1
        spent += cost

    for function, of in family.items():
        while kept[function] < len(of) and cases[of[kept[function]]][0] <= CHEAP:
            keep(function)
    queue = [(-np.inf, function) for function in family]
    while queue and spent < seconds:
        _, function = heapq.heappop(queue)
        value = worth(function)
        if value and queue and value < -queue[0][0]:
            heapq.heappush(queue, (-value, function))
        elif value:
            keep(function)
            heapq.heappush(queue, (-np.inf, function))
    total = sum(cost for cost, _ in cases.values())
    number = sum(kept.values())
    print(f"{number} of {len(cases)} cases, {spent:.0f} of {total:.0f} s, {(reached > 0).sum()} of {branches} branches")
    return kept


def marks(folder, seconds):
    """{function: "long", "one_in(n)" or ""}: how its cases are thinned to those that stay; of those measured alone.

    What stands in no room of tests/ judges the repository, which has no branches: it stays as it is.
    """
    family, kept = families(folder), choose(folder, seconds)
    return {f: mark([share for share, _ in family[f]], n) for f, n in kept.items() if f.count("/") > 1}


def mark(shares, kept):
    """The mark by which so many of a family of cases stay, or the fewest beyond that it can say."""
    if kept == 0:
        return "long"
    last, behind = shares[kept - 1], shares[kept:]
    if not behind:
        return ""
    n = math.ceil(1.0 / behind[0])
    while n * last >= 1.0:
        n -= 1
    return f"one_in({n})" if n > 1 else ""


def write_marks(wanted):
    """Put marks above the functions of tests whose present ones are others."""
    by_file = defaultdict(dict)
    for function, text in wanted.items():
        path, _, name = function.rpartition("::")
        by_file[path][name] = text
    for path, of in by_file.items():
        file = ROOT / path.partition("::")[0]
        lines, edits = file.read_text().split("\n"), []
        for node in ast.walk(ast.parse("\n".join(lines))):
            if isinstance(node, ast.FunctionDef) and node.name in of:
                edits.append((node, of[node.name]))
        for node, text in sorted(edits, key=lambda edit: -edit[0].lineno):
            old = [d for d in node.decorator_list if re.match(r"pytest\.mark\.(one_in|long)\b", ast.unparse(d))]
            here = f"@pytest.mark.{text}"
            if [f"@{ast.unparse(d)}" for d in old] == [here] * bool(text):
                continue
            if text:
                lines.insert(node.lineno - 1, here)
            for d in sorted(old, key=lambda d: -d.lineno):
                del lines[d.lineno - 1 : d.end_lineno]
        text = "\n".join(lines)
        if "@pytest." in text and not re.search(r"^import pytest$", text, re.MULTILINE):
            first = next(node for node in ast.parse(text).body if _imports(node))
            lines.insert(first.lineno - 1, "import pytest\n")
            text = "\n".join(lines)
        file.write_text(text)


def _imports(node):
    """An import of a module that is there."""
    named = isinstance(node, ast.ImportFrom) and node.module == "__future__"
    return isinstance(node, ast.Import | ast.ImportFrom) and not named


if __name__ == "__main__":
    verb, place, *rest = sys.argv[1:]
    place = Path(place).resolve()
    place.mkdir(parents=True, exist_ok=True)
    if verb == "build":
        build(place)
    elif verb == "measure":
        sys.exit(measure(place, rest))
    elif verb == "choose":
        for function, text in sorted(marks(place, float(rest[0])).items()):
            print(f"{text or 'all':12s} {function}")
    elif verb == "mark":
        write_marks(marks(place, float(rest[0])))
    else:
        sys.exit(__doc__)
