"""Random springs between two rows of masses, positions and stretches partly said over ranges: the complementary
family must begin with the stretches of the closed form.

`python tests/models/random_positions.py NUMBER [FIRST_SEED]` prints the seeds that do not, and how many do.
"""

import sys
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from start_strategies import prepared_start
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.events.observer import Observer

FAMILIES = {
    "S": ("x[i]", "x[i + 1]"),
    "T": ("x[i + 1]", "x[i]"),
    "Q": ("y[i]", "y[i + 1]"),
    "P": ("x[i]", "y[i]"),
    "D": ("x[i]", "y[i + 1]"),
    "U": ("x[i]", "y[1]"),
    "G": ("x[i]", "ground"),
    "H": ("ground", "y[i]"),
}
HEAD = """model net {{
  param n = {n}
  node x[1..n], y[1..n]: translation
  for i in 1..n {{
    M[i]: kinetic(p = 1 kg*f) x[i]
    N[i]: kinetic(p = 2 kg*f) y[i]
  }}
"""
UNSAID = 1e-3
"""Weight of a position of which nothing is said."""
CLOSE = 1e-4
"""Of the largest stretch: guesses of UNSAID pull at those that are said."""


@dataclass
class Springs:
    """Springs (name, from, to), what is said (name of a spring or node, word, value), and the text."""

    n: int
    springs: list = field(default_factory=list)
    said: list = field(default_factory=list)
    text: str = ""


def springs(seed):
    """Families over all sections or some; single springs between any two points; statements over ranges."""
    random = np.random.default_rng(seed)
    found, lines = Springs(int(random.integers(3, 7))), []

    def some(low, high):
        return sorted(int(k) for k in random.integers(low, high + 1, 2))

    def say(name, low, high):
        word, value = "~="[int(random.integers(2))], float(f"{random.uniform(-1.0, 1.0):.3f}")
        lines.append(f"  for i in {low}..{high} {{ init {name}[i].q {word} {value!r} m*(1 + i/4) }}")
        found.said += [(f"{name}[{i}]", word, value * (1 + i / 4)) for i in range(low, high + 1)]

    for name, ends in FAMILIES.items():
        if random.random() < 0.5:
            continue
        low, high = 1, found.n - any("i + 1" in end for end in ends)
        low, high = some(low, high) if random.random() < 0.4 else (low, high)
        lines.append(f"  for i in {low}..{high} {{ {name}[i]: potential(e = 3 N/m*q) {ends[0]} -> {ends[1]} }}")
        for i in range(low, high + 1):
            here = (end.replace("i + 1", str(i + 1)).replace("[i]", f"[{i}]") for end in ends)
            found.springs.append((f"{name}[{i}]", *here))
        if random.random() < 0.5:
            say(name, *some(low, high))
    for name in "xy":
        if random.random() < 0.5:
            say(name, *some(1, found.n))
    points = [*(f"{c}[{k}]" for c in "xy" for k in range(1, found.n + 1)), "ground"]
    for k in range(int(random.integers(1, 3))):
        a, b = random.choice(points, 2, replace=False)
        lines.append(f"  w{k}: potential(e = 3 N/m*q) {a} -> {b}")
        found.springs.append((f"w{k}", a, b))
    traced = "".join(f"; trace {name}.q" for name, *_ in found.springs)
    body = "\n".join([*lines, "}", f"scene run of net {{ time 0 s to 1 s{traced} }}\n"])
    found.text = HEAD.format(n=found.n) + body
    return found


def closed_form(of):
    """Stretches where masses of which nothing is said move least; None where statements contradict each other."""
    points = [f"{c}[{k}]" for c in "xy" for k in range(1, of.n + 1)]
    row = dict(zip(points, np.eye(len(points)), strict=True)) | {"ground": np.zeros(len(points))}
    row |= {name: row[a] - row[b] for name, a, b in of.springs}
    told = np.array([row[name] for name, *_ in of.said]).reshape(-1, len(points))
    values = np.array([value for *_, value in of.said])
    start = np.linalg.lstsq(told, values, rcond=None)[0]
    if np.abs(told @ start - values).max(initial=0.0) > 1e-9:
        return None
    _, sigma, right = np.linalg.svd(told)
    free = right[int((sigma > 1e-9).sum()) :].T
    rest = np.array([row[p] for p in points if p not in {name for name, *_ in of.said}]).reshape(-1, len(points))
    start = start - free @ np.linalg.lstsq(rest @ free, rest @ start, rcond=None)[0]
    return np.array([row[name] @ start for name, *_ in of.springs])


def judged(seed, formulation="co_lagrangian"):
    """agree, contradicting, refused (E806: it would have to be unrolled), or how they differ."""
    of, report = springs(seed), Report()
    expected = closed_form(of)
    if expected is None:
        return "contradicting"
    _, begun = prepared_start(of.text, formulation, "run", report)
    if begun is None:
        codes = {d.code for d in report}
        return "refused" if codes == {"E806"} else f"no start: {codes}"
    found = Observer(begun.system)(begun.state.t, *begun.state.for_form(begun.system))
    apart = float(np.abs(found - expected).max() / max(np.abs(expected).max(), 1.0))
    return "agree" if apart < CLOSE else f"apart by {apart:.2g}"


if __name__ == "__main__":
    begin = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    counts = Counter()
    for k in range(begin, begin + int(sys.argv[1])):
        verdict = judged(k)
        counts[verdict if verdict in {"agree", "contradicting", "refused"} else "differ"] += 1
        if verdict not in {"agree", "contradicting"}:
            print(k, verdict, flush=True)
    print(dict(counts))
