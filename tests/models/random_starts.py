"""Random networks whose stores are partly said: every formulation must begin with the contents of the closed form.

`python tests/models/random_starts.py scalar|arrays NUMBER [FIRST_SEED]` prints the seeds that do not, and a table.
`scalar`: trees of resistors, capacitors and inductors with chords (loops of capacitors, meshes of inductors, both in
series), sizes a thousand apart; about a third of the stores each is fixed, guessed, open.  `arrays`: chains of
families of stores over sections, said over ranges.  All are compared with the closed form.
"""

import sys
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from model_runs import FOUR
from start_strategies import prepared_start
from sysdyn.runtime.events.observer import Observer

KINDS = {"resistor": ("R", "ohm", ""), "capacitor": ("C", "F", "e"), "inductor": ("L", "H", "f")}
UNITS = {"e": "V", "f": "A"}
HEAD = "from std.electrical import resistor, capacitor, inductor\nmodel net {\n"
CLOSE = 1e-6
"""Of the largest content of its kind: what two formulations may differ by."""
NONE = 1e-12
"""Entries of bases of unit vectors that are round-off."""


@dataclass
class Circuit:
    """Elements (name, kind, value, from, to), what is said of them {name: (word, value)}, and the text."""

    elements: list = field(default_factory=list)
    said: dict = field(default_factory=dict)
    text: str = ""


def circuit(seed, saying="=~"):
    """A circuit of which a part is said."""
    random, found = np.random.default_rng(seed), Circuit()
    nodes = ["ground", *(f"n{k}" for k in range(int(random.integers(2, 6))))]
    edges = [(nodes[k], nodes[int(random.integers(k))]) for k in range(1, len(nodes))]
    for _ in range(int(random.integers(1, 5))):
        a, b = random.choice(len(nodes), 2, replace=False)
        edges.append((nodes[a], nodes[b]))
    lines = []
    for k, (a, b) in enumerate(edges):
        kind = str(random.choice(["resistor", "capacitor", "capacitor", "inductor"]))
        value = float(f"{10.0 ** random.uniform(-1.5, 1.5):.4g}")
        letter, unit, _ = KINDS[kind]
        lines.append(f"  x{k}: {kind}({letter} = {value!r} {unit}) {a} -> {b}")
        found.elements.append((f"x{k}", kind, value, a, b))
    stores = [(name, KINDS[kind][2]) for name, kind, *_ in found.elements if KINDS[kind][2]]
    if not stores:
        return circuit(seed + 1_000_000, saying)
    for name, content in stores:
        say = str(random.choice(["=", "~", ""]))
        value = float(f"{random.uniform(-2.0, 2.0):.3f}")
        if say and say in saying:
            found.said[name] = say, value
            lines.append(f"  init {name}.{content} {say} {value!r} {UNITS[content]}")
    for node in nodes[1:]:  # every node leaks: what floats is another matter
        lines.append(f"  leak_{node}: resistor(R = 3 ohm) {node} -> ground")
    traced = "".join(f"; trace {name}.{content}" for name, content in stores)
    head = f"{HEAD}  node {', '.join(nodes[1:])}: electrical"
    found.text = "\n".join([head, *lines, "}", f"scene run of net {{ time 0 s to 1 s{traced} }}\n"])
    return found


def closed_form(of):
    """Efforts of capacitors and flows of inductors, in their order: the least sum of squares of changes of contents,
    first of those that are guessed, then of those that nothing is said of, such that voltages around loops of
    capacitors add up to zero.  None where what is fixed contradicts that.
    """
    nodes = list({n: 0 for *_, a, b in of.elements for n in (a, b) if n != "ground"})
    capacitors = [e for e in of.elements if e[1] == "capacitor"]
    incidence = np.zeros((len(capacitors), len(nodes)))
    for k, (*_, a, b) in enumerate(capacitors):
        for node, sign in ((a, 1.0), (b, -1.0)):
            if node != "ground":
                incidence[k, nodes.index(node)] += sign
    left, sigma, _ = np.linalg.svd(incidence) if capacitors else (np.zeros((0, 0)), np.zeros(0), None)
    around = left[:, int((sigma > 1e-9).sum()) :].T  # loops [loops, capacitors]
    size = np.array([value for _, _, value, *_ in capacitors])
    around = np.where(np.abs(around) > NONE, around, 0.0) / size
    held = size * [of.said.get(name, ("", 0.0))[1] for name, *_ in capacitors]
    words = np.array([of.said.get(name, ("", 0.0))[0] for name, *_ in capacitors])
    small, aim = 1e-9 * np.abs(around).max(initial=0.0), -around @ held
    for word, below in (("~", words == ""), ("", np.zeros(len(words), dtype=bool))):
        left, sigma, _ = np.linalg.svd(around[:, below])
        rest = left[:, int((sigma > small).sum()) :].T
        held[words == word] += (
            np.linalg.pinv(rest @ around[:, words == word], rcond=1e-9)
            @ (rest @ aim)
            * (np.abs(rest @ around[:, words == word]).max(initial=0.0) > small)
        )
        aim = -around @ held
    if np.abs(aim).max(initial=0.0) > 1e-9 * max(np.abs(held / size).max(initial=0.0), 1.0):
        return None
    found = dict(zip((name for name, *_ in capacitors), held / size, strict=True))
    found |= {name: of.said.get(name, ("", 0.0))[1] for name, kind, *_ in of.elements if kind == "inductor"}
    return np.array([found[name] for name, *_ in of.elements if name in found])


def array(seed):
    """A chain of 3 to 6 sections; in each of its elements with luck a capacitor to ground, one to the next section, an
    inductor beside it, one to ground; more of them at the ends.  Said over ranges that need not be whole; the last
    guess counts, a fixed value before all.
    """
    random, found = np.random.default_rng(seed), Circuit()
    n = int(random.integers(3, 7))
    lines = [f"  param n = {n}", "  node v[1..n]: electrical"]
    families = [("Cg", "capacitor", 0, n), ("Cs", "capacitor", 1, n - 1), ("Ls", "inductor", 1, n - 1)]
    families += [("Lg", "inductor", 0, n), ("Ch", "capacitor", 0, n), ("Lt", "inductor", 1, n - 1)]
    taken = [family for family in families if random.random() < 0.55] or families[:2]
    for name, kind, step, high in taken:
        low = 1
        if random.random() < 0.4:  # a part of the sections alone
            low, high = sorted(int(k) for k in random.integers(low, high + 1, 2))
        letter, unit, content = KINDS[kind]
        value, ends = float(f"{10.0 ** random.uniform(-1.5, 1.5):.4g}"), "v[i + 1]" if step else "ground"
        law = f"{kind}({letter} = {value!r} {unit}*(1 + i/10))"
        lines.append(f"  for i in {low}..{high} {{ {name}[i]: {law} v[i] -> {ends} }}")
        for i in range(low, high + 1):
            other = i + 1 if step else "ground"
            found.elements.append((f"{name}[{i}]", kind, value * (1.0 + i / 10.0), i, other))
        ranges = [sorted(int(k) for k in random.integers(low, high + 1, 2)) for _ in range(int(random.integers(0, 3)))]
        for k, (first, last) in enumerate(ranges if ranges[:1] != ranges[1:] else ranges[:1]):
            say = "~" if k or random.random() < 0.75 else "="
            said = float(f"{random.uniform(-2.0, 2.0):.3f}")
            lines.append(
                f"  for i in {first}..{last} {{ init {name}[i].{content} {say} {said!r} {UNITS[content]}*(1 + i/4) }}"
            )
            for i in range(first, last + 1):
                if found.said.get(f"{name}[{i}]", ("~",))[0] == "~":
                    found.said[f"{name}[{i}]"] = say, said * (1.0 + i / 4.0)
    lines.append("  for i in 1..n { leak[i]: resistor(R = 3 ohm) v[i] -> ground }")
    scene = "".join(f"; trace {name}.{KINDS[kind][2]}" for name, kind, *_ in found.elements)
    found.text = HEAD + "\n".join([*lines, "}", f"scene run of net {{ time 0 s to 1 s{scene} }}\n"])
    return found


def contents(text):
    """By formulation: values of what stores hold at the start; None where it has none."""
    found = {}
    for formulation in FOUR:
        prepared, begun = prepared_start(text, formulation, "run")
        if prepared is None:
            continue
        found[formulation] = None
        if begun is not None:
            system, state = begun.system, begun.state
            found[formulation] = Observer(system)(state.t, *state.for_form(system))
    return found


def judged(seed, sort="scalar", saying="=~"):
    """agree, refused (no formulation has a start), or how they differ."""
    of = circuit(seed, saying) if sort == "scalar" else array(seed)
    found, expected = contents(of.text), closed_form(of)
    values = [value for value in found.values() if value is not None]
    if not values:
        return "refused" if expected is None else "refused though there is a start"
    if len(values) != len(found):
        return f"some refuse: {[name for name, value in found.items() if value is None]}"
    size = max(float(np.abs(value).max()) for value in values)
    if expected is None:
        return "begins though what is fixed contradicts itself"
    apart = max(float(np.abs(value - expected).max()) for value in values)
    return "agree" if apart <= CLOSE * max(size, 1e-3) else f"apart by {apart / size:.2g}"


if __name__ == "__main__":
    begin = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    counts = Counter()
    for k in range(begin, begin + int(sys.argv[2])):
        verdict = judged(k, sys.argv[1])
        counts[verdict if verdict in {"agree", "refused"} else "differ"] += 1
        if verdict not in {"agree", "refused"}:
            print(k, verdict, flush=True)
    print("".join(f"{name:>12}" for name in ("networks", "agree", "refused", "differ")))
    print("".join(f"{number:>12}" for number in (counts.total(), *(counts[n] for n in ("agree", "refused", "differ")))))
