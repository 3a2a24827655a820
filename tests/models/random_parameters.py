"""Models with every parameter times 0.3 to 3, through verify: python tests/models/random_parameters.py [NAME...]"""

from __future__ import annotations

import contextlib
import io
import json
import math
import random
import re
import sys
import zlib
from dataclasses import dataclass
from pathlib import Path

from sysdyn.cli.main import run
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.sizes import sizes
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import Report

MODELS = Path(__file__).resolve().parents[2] / "models"
SETS = 3
LEAST, MOST = 0.3, 3.0


@dataclass(frozen=True, slots=True)
class Tried:
    """One verify.  exit; disagreements: sentences; errors: (code, message)."""

    name: str
    settings: tuple[str, ...]
    exit: int
    disagreements: tuple[str, ...]
    errors: tuple[tuple[str, str], ...]


def names() -> list[str]:
    """seed/NAME and gallery/NAME of every model."""
    return [f"{room}/{p.stem}" for room in ("seed", "gallery") for p in sorted((MODELS / room).glob("*.sd"))]


def drawn(network: Network, name: str, number: int) -> tuple[str, ...]:
    """NAME=VALUE of every scalar parameter with a number of its own (sizes and expressions of others stay)."""
    draw = random.Random(zlib.crc32(f"{name} {number}".encode()))
    found = []
    for p in network.parameters:
        own = len(p.values) == 1 and not p.shape and not ex.variables(p.values[0])
        if not own or p.whole or any(n.op == "param" for n in ex.topological(p.values)):
            continue
        (value,) = evaluate([p.values[0]], lambda node: math.nan)
        if value and math.isfinite(value):
            factor = math.exp(draw.uniform(math.log(LEAST), math.log(MOST)))
            found.append(f"{p.name}={value * factor!r}")
    return tuple(found)


def tried(name: str, number: int) -> Tried:
    """verify of a model's first scene with one set of parameters."""
    path = MODELS / f"{name}.sd"
    scene = re.search(r"^scene (\w+)", path.read_text(), re.M)
    assert scene is not None
    report = Report()
    document = targets.read(str(path), report)
    target = targets.one(document, str(path), None, scene[1], report)
    assert target is not None
    with ex.fresh():
        network = load.network(target.document, target.model, target.scene, report, sizes(str(path))[1])
        assert network is not None
        settings = drawn(network, name, number)
    options = [item for setting in settings for item in ("--set", setting)]
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        code = run(["verify", str(path), "--scene", scene[1], "--json", "--max-wall", "60", *options])
    found = json.loads(output.getvalue())
    errors = tuple((d["code"], d["message"]) for d in found["diagnostics"] if d["severity"] == "error")
    apart = tuple(str(d) for d in found["result"].get("disagreements", ()))
    return Tried(name, settings, code, apart, errors)


if __name__ == "__main__":
    for one in (tried(name, k) for name in sys.argv[1:] or names() for k in range(SETS)):
        print(one.name, one.exit, one.disagreements, one.errors, " ".join(one.settings) if one.exit else "", flush=True)
