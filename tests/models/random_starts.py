"""Random networks whose stores are partly said: every formulation must begin with the contents of the closed form.

`python tests/models/random_starts.py SORT NUMBER [FIRST_SEED]` prints the seeds that do not, and a table.  `scalar`:
trees of resistors, capacitors and inductors with chords (loops of capacitors, meshes of inductors, both in series),
sizes a thousand apart; about a third of the stores each is fixed, guessed, open.  `others`: something is said of one or
two resistors too.  `bare`: nodes of capacitors or inductors alone.  `read`: dynamic variables read one to three
elements, which must move nothing.  `valves`: resistors are turbulent, many between equal potentials, where they are
flat or infinitely steep.  `arrays`: chains of families of stores over sections, said over ranges.
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
READ = [("J", "{0}.e*{0}.f"), ("Wb", "{0}.e"), ("C", "{0}.f")]
HELD = {"capacitor": ("C", "{0}.q/(1 s)"), "inductor": ("Wb", "{0}.p/(1 s)")}
HEAD = "from std.electrical import resistor, capacitor, inductor\nmodel net {\n"
CLOSE = 1e-6
"""Of the largest content of its kind: what two formulations may differ by."""
TURBULENT = ["e = {!r} ohm/(1 A)*f*abs(f)", "f = 1 A*sign(e)*sqrt(abs(e)/({!r} V))"]
NONE = 1e-12
"""Entries of bases of unit vectors that are round-off."""


@dataclass
class Circuit:
    """Elements (name, kind, value, from, to), what is said of them {name: (word, value)}, and the text."""

    elements: list = field(default_factory=list)
    said: dict = field(default_factory=dict)
    text: str = ""


def circuit(seed, saying="=~", sort="scalar"):
    """A circuit of which a part is said; bare: nodes that need not leak mostly do not."""
    turbulent = sort == "valves"

    def resistor(value):
        return f"dissipator({random.choice(TURBULENT).format(value)})" if turbulent else f"resistor(R = {value!r} ohm)"

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
        law = resistor(value) if kind == "resistor" else f"{kind}({letter} = {value!r} {unit})"
        lines.append(f"  x{k}: {law} {a} -> {b}")
        found.elements.append((f"x{k}", kind, value, a, b))
    stores = [(name, KINDS[kind][2]) for name, kind, *_ in found.elements if KINDS[kind][2]]
    if not stores:
        return circuit(seed + 1_000_000, saying, sort)
    for name, content in stores:
        say = str(random.choice(["=", "~", ""]))
        value = float(f"{random.uniform(-2.0, 2.0):.{0 if turbulent else 3}f}")
        if say and say in saying:
            found.said[name] = say, value
            lines.append(f"  init {name}.{content} {say} {value!r} {UNITS[content]}")
    ends = Counter(node for *_, a, b in found.elements for node in (a, b))
    leaking = [node for node in nodes[1:] if sort != "bare" or ends[node] < 2 or random.random() < 0.4]
    leaks = [f"leak_{node}" for node in leaking]  # what floats is another matter
    lines += [f"  {leak}: {resistor(3.0)} {leak[5:]} -> ground" for leak in leaks]
    read = [f"; trace {name}.{content}" for name, content in stores]
    told = [*(e[0] for e in found.elements if e[1] == "resistor"), *leaks]
    found.elements += [(name, "resistor", 3.0, name[5:], "ground") for name in leaks]
    for k, name in enumerate(random.permutation(told)[: int(random.integers(1, 3)) if sort == "others" else 0]):
        say, letter = str(random.choice(["=", "="] if k else ["=", "~"])), str(random.choice(["e", "f"]))
        found.said[str(name)] = say, float(f"{random.uniform(-2.0, 2.0):.3f}"), letter
        lines.append(f"  init {name}.{letter} {say} {found.said[str(name)][1]!r} {UNITS[letter]}")
        read.append(f"; trace {name}.e")  # what nothing asks for is not modelled
    for k in range(int(random.integers(1, 4)) if sort == "read" else 0):
        name, kind, *_ = found.elements[int(random.integers(len(found.elements)))]
        choice = [*READ, HELD[kind]] if kind in HELD else READ
        unit, power = choice[int(random.integers(len(choice)))]
        lines.append(f"  state z{k}: {unit} = 0 {unit}\n  dynamic z{k}' = {power.format(name)}")
        read.append(f"; trace z{k}")
    head = f"{HEAD}  node {', '.join(nodes[1:])}: electrical"
    found.text = "\n".join([head, *lines, "}", f"scene run of net {{ time 0 s to 1 s{''.join(read)} }}\n"])
    return found


def _null(matrix):
    """A basis of what a matrix takes from the left to zero, a row each; unit vectors where there are such."""
    left, sigma, _ = np.linalg.svd(matrix)
    found = left[:, int((sigma > 1e-9).sum()) :].T
    return np.where(np.abs(found) > NONE, found, 0.0)


def _potentials(of, across, nodes):
    """Of all nodes [nodes, stores], by what stores hold, where capacitors are sources of voltage, coils of current."""
    stores = [e for e in of.elements if e[1] != "resistor"]
    capacitors = [name for name, kind, *_ in stores if kind == "capacitor"]
    incidence = np.array([across[name] for name in capacitors]).reshape(len(capacitors), nodes)
    conductance = sum(np.outer(across[n], across[n]) / v for n, kind, v, *_ in of.elements if kind == "resistor")
    drive = np.zeros((nodes + len(capacitors), len(stores)))
    for k, (name, kind, value, *_) in enumerate(stores):
        if kind == "capacitor":
            drive[nodes + capacitors.index(name), k] = 1.0 / value
        else:
            drive[:nodes, k] = -across[name] / value
    whole = np.block([[conductance, incidence.T], [incidence, np.zeros((len(capacitors),) * 2)]])
    return (np.linalg.pinv(whole, rcond=1e-12) @ drive)[:nodes]


def closed_form(of):
    """Efforts of capacitors and flows of inductors, in their order: those at which what is fixed holds, voltages around
    loops of capacitors add up to zero and currents into cutsets of inductors too, with the least sum of squares of
    changes of contents, first of fluxes that are guessed, then of charges, then of what guesses of resistors miss, then
    of fluxes and charges that nothing is said of.  None where what is fixed contradicts itself.
    """
    nodes = list({n: 0 for *_, a, b in of.elements for n in (a, b) if n != "ground"})
    across = {name: np.zeros(len(nodes)) for name, *_ in of.elements}  # voltages by those of nodes
    for name, _, _, *ends in of.elements:
        for node, sign in zip(ends, (1.0, -1.0), strict=True):
            if node != "ground":
                across[name][nodes.index(node)] += sign
    stores = [e for e in of.elements if e[1] != "resistor"]
    size, is_c = (np.array([e[k] for e in stores]) for k in (2, 1))
    is_c = is_c == "capacitor"
    told = [
        (name, value, *of.said[name]) for name, kind, value, *_ in of.elements if kind == "resistor" and name in of.said
    ]

    def incidence(*kinds):
        found = [across[name] for name, kind, *_ in of.elements if kind in kinds]
        return np.array(found).reshape(len(found), len(nodes))

    around = _null(incidence("capacitor"))
    into = _null(incidence("capacitor", "resistor").T) @ incidence("inductor").T
    system = np.zeros((len(around) + len(into) + len(told), len(stores) + len(told)))  # of contents, what is missed
    system[: len(around), np.flatnonzero(is_c)] = around / size[is_c]
    system[len(around) : len(around) + len(into), np.flatnonzero(~is_c)] = into / size[~is_c]
    aim = np.zeros(len(system))
    for k, (name, resistance, _, value, letter) in enumerate(told, len(stores)):
        row = len(around) + len(into) + k - len(stores)
        voltage = across[name] @ _potentials(of, across, len(nodes))
        system[row, : len(stores)] = voltage / (1.0 if letter == "e" else resistance)
        system[row, k], aim[row] = -1.0, value
    words = [of.said.get(name, ("", 0.0))[0] for name, *_ in stores] + [word for _, _, word, *_ in told]
    sort = ["q" if c else "p" for c in is_c] + ["miss"] * len(told)
    found = np.append(size * [of.said.get(name, ("", 0.0))[1] for name, *_ in stores], np.zeros(len(told)))
    order = [("~", "p"), ("~", "q"), ("~", "miss"), ("", "p"), ("", "q")]
    level = np.array([len(order) if w == "=" else order.index((w, s)) for w, s in zip(words, sort, strict=True)])
    small = 1e-9 * np.abs(system).max(initial=0.0)
    for number in range(len(order)):
        left, sigma, _ = np.linalg.svd(system[:, (level > number) & (level < len(order))])
        rest = left[:, int((sigma > small).sum()) :].T
        own = rest @ system[:, level == number]
        found[level == number] += np.linalg.pinv(np.where(np.abs(own) > small, own, 0.0), rcond=1e-9) @ (
            rest @ (aim - system @ found)
        )
    if np.abs(aim - system @ found).max(initial=0.0) > 1e-9 * max(np.abs(found[: len(size)] / size).max(), 1.0):
        return None
    return found[: len(size)] / size


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
    found.elements += [(f"leak[{i}]", "resistor", 3.0, i, "ground") for i in range(1, n + 1)]
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
    of = array(seed) if sort == "arrays" else circuit(seed, saying, sort)
    found, expected = contents(of.text), closed_form(of)
    values = [value for value in found.values() if value is not None]
    if not values:
        return "refused" if expected is None else "refused though there is a start"
    if len(values) != len(found):
        return f"some refuse: {[name for name, value in found.items() if value is None]}"
    size = max(float(np.abs(value).max()) for value in values)
    if expected is None:
        return "begins though what is fixed contradicts itself"
    apart = max(float(np.abs(value[: expected.size] - expected).max()) for value in values)
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
