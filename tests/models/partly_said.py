"""Random circuits and mechanisms with one-way elements, switches and junctions, of whose stores a part is said: no two
formulations may begin with other contents of stores, and no start may take long.

`python tests/models/partly_said.py SORT NUMBER [FIRST_SEED]` prints the texts that begin apart, that some formulation
alone refuses, and that take more than SLOW seconds of CPU; then a table.  SORT: circuits or mechanics.
"""

import sys
import time
from collections import Counter

import numpy as np
from model_runs import FOUR
from start_strategies import prepared_start
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.events.observer import Observer

CLOSE = 1e-6
"""Of the largest content of its kind, or of NOTICED: what two formulations may differ by."""
NOTICED = 1e-3
"""V, A, m/s, N: contents that are less are compared with this."""
SLOW = 5.0
"""s of CPU that a start may take."""
ELECTRICAL = ("capacitor", "current", "diode", "inductor", "resistor", "switch", "voltage")
MECHANICAL = ("coulomb", "damper", "force", "mass", "spring", "velocity")
GATES = ("if sin(300 Hz*t) > 0 then 1 else 0", "if g then 1 else 0", "if t < 2 ms then 1 else 0")
VOLTS = ("{0} V", "{0} V*sin(400 rad/s*t)", "(if t < 2 ms then 0 V else {0} V)", "{0} V*cos(400 rad/s*t)")
FORCES = ("{0} N", "{0} N*sin(3 rad/s*t)", "{0} N*cos(3 rad/s*t)")


def _value(random, low, high):
    """Between powers of ten."""
    return f"{10.0 ** random.uniform(low, high):.4g}"


def _signed(random, most):
    return f"{random.uniform(-most, most):.4g}"


def _ends(random, nodes):
    """Edges of a tree from ground, and some beside it."""
    edges = [(nodes[int(random.integers(k))], nodes[k]) for k in range(1, len(nodes))]
    for _ in range(int(random.integers(2, 6))):
        edges.append(tuple(str(n) for n in random.choice(nodes, 2, replace=False)))
    return [edge if random.random() < 0.5 else edge[::-1] for edge in edges]


def _circuit_element(random, k):
    """Mostly one source of voltage, from ground; hardly ever one of current, which asks for a way."""
    kind = str(random.choice(["U", "C", "R"] if k == 0 else [*"RRRRRRRRCCCCCCLLSSDDDDJJI"]))
    match kind:
        case "R":
            law = f"resistor(R = {_value(random, 1, 4)} ohm)"
        case "C":
            law = f"capacitor(C = {_value(random, -2, 2)} uF)"
        case "L":
            law = f"inductor(L = {_value(random, -1, 2)} mH)"
        case "U":
            law = f"voltage(v = {random.choice(VOLTS).format(_signed(random, 12.0))})"
        case "I":
            law = f"current(i = {_signed(random, 0.01)} A)"
        case "S":
            law = f"switch(gate = {random.choice(GATES)})"
        case "D":
            law = "diode.complementary()"
        case "J":
            law = "diode()"
    return kind, f"{kind}{k}", law


def circuit(seed):
    """Text of a circuit of 5 to 11 elements between up to five nodes, and its contents."""
    random = np.random.default_rng(seed)
    nodes = ["ground", *(f"n{k}" for k in range(1, int(random.integers(3, 7))))]
    lines, contents = [], []
    for k, (a, b) in enumerate(_ends(random, nodes)):
        kind, name, law = _circuit_element(random, k)
        lines.append(f"  {name}: {law} {a} -> {b}")
        if kind in "CL":
            content, unit, most = ("e", "V", 10.0) if kind == "C" else ("f", "A", 0.1)
            contents.append(f"{name}.{content}")
            say = str(random.choice(["=", "~", "~", ""]))
            if say:
                lines.append(f"  init {contents[-1]} {say} {_signed(random, most)} {unit}")
    names = ", ".join(nodes[1:])
    head = f"from std.electrical import {', '.join(ELECTRICAL)}\nmodel net {{\n  node {names}: electrical\n"
    head += "  discrete g = false\n  every 1 ms { g := not g }\n  lossless\n"
    efforts = "".join(f"; trace {n}.e" for n in nodes[1:])
    traced = "".join(f"; trace {name}" for name in contents)
    return f"{head}{chr(10).join(lines)}\n}}\nscene run of net {{ time 0 s to 5 ms{traced}{efforts} }}\n", contents


def mechanism(seed):
    """Text of masses on a line between springs, dampers, dry friction, forces and velocities, and its contents.

    Of all springs the lengths are said, or of none: beside some that are both positions and lengths would be guessed.
    """
    random = np.random.default_rng(seed)
    lengths = random.random() < 0.5
    nodes = ["ground", *(f"x{k}" for k in range(1, int(random.integers(2, 6))))]
    lines, contents, kinds = [], [], ["spring", "spring", "damper", "damper", "coulomb", "coulomb", "force", "velocity"]
    for k, (a, b) in enumerate(_ends(random, nodes)):
        match str(random.choice(kinds, p=[0.2, 0.2, 0.15, 0.15, 0.1, 0.1, 0.07, 0.03])):
            case "spring":
                law, content = f"spring(k = {_value(random, 0, 3)} N/m)", f"k{k}.e"
                contents.append(content)
                if lengths:
                    say = str(random.choice(["=", "~", "~", "~"]))
                    lines.append(f"  init {content} {say} {_signed(random, 5.0)} N")
                name = f"k{k}"
            case "damper":
                name, law = f"d{k}", f"damper(b = {_value(random, -1, 2)} N.s/m)"
            case "coulomb":
                name, law = f"c{k}", f"coulomb(Fc = {_value(random, -1, 1)} N)"
            case "force":
                name, law = f"f{k}", f"force(F = {random.choice(FORCES).format(_signed(random, 8.0))})"
            case "velocity":
                name, law = f"v{k}", f"velocity(v = {_signed(random, 1.0)} m/s)"
        lines.append(f"  {name}: {law} {a} -> {b}")
    for node in nodes[1:]:
        if random.random() < 0.7:
            lines.append(f"  m_{node}: mass(m = {_value(random, -1, 1)} kg) {node}")
            contents.append(f"{node}.f")
            say = str(random.choice(["=", "~", ""]))
            if say:
                lines.append(f"  init {node}.f {say} {_signed(random, 2.0)} m/s")
    names = ", ".join(nodes[1:])
    head = (
        f"from std.mechanical import {', '.join(MECHANICAL)}\nmodel net {{\n  node {names}: translation\n  lossless\n"
    )
    traced = "".join(f"; trace {name}" for name in contents)
    return f"{head}{chr(10).join(lines)}\n}}\nscene run of net {{ time 0 s to 1 s{traced} }}\n", contents


TEXTS = {"circuits": circuit, "mechanics": mechanism}


def starts(text, formulations=(*FOUR, "kane")):
    """By formulation that can express it: what the quantities of the trace begin at, or the codes by which it refuses;
    s of CPU.
    """
    found = {}
    for formulation in formulations:
        report, began = Report(), time.process_time()
        prepared, begun = prepared_start(text, formulation, "run", report)
        if prepared is None and found:  # it cannot express this text
            continue
        spent, value = time.process_time() - began, sorted({d.code for d in report if d.severity == "error"})
        if begun is not None and not value:
            system, state = begun.system, begun.state
            with np.errstate(all="ignore"):
                value = Observer(system)(state.t, *state.for_form(system))
        found[formulation] = value, spent
    return found


def largest_difference(contents, found):
    """Largest difference between the contents of two formulations, as a part of the largest of its kind."""
    values = [value[: len(contents)] for value, _ in found.values() if isinstance(value, np.ndarray)]
    if len(values) < 2 or not contents:
        return 0.0
    kinds = [name.partition(".")[2] for name in contents]
    size = dict.fromkeys(kinds, NOTICED)
    for k, kind in enumerate(kinds):
        size[kind] = max(size[kind], *(abs(float(v[k])) for v in values))
    spread = np.max(values, axis=0) - np.min(values, axis=0)
    return max(float(spread[k]) / size[kind] for k, kind in enumerate(kinds))


def judged(sort, seed):
    """A word on one text, and s of CPU of its longest start."""
    text, contents = TEXTS[sort](seed)
    found = starts(text)
    longest = max(spent for _, spent in found.values())
    refused = {name: value for name, (value, _) in found.items() if not isinstance(value, np.ndarray)}
    if len(refused) == len(found):
        return f"refused {next(iter(refused.values()))}", longest
    if (far := largest_difference(contents, found)) > CLOSE:
        return f"apart by {far:.2g}", longest
    return (f"some refuse {refused}" if refused else "agree"), longest


def main(sort, number, first=0):
    counts, longest = Counter(), 0.0
    for seed in range(first, first + number):
        verdict, spent = judged(sort, seed)
        longest = max(longest, spent)
        counts[verdict.split()[0]] += 1
        if not verdict.startswith(("agree", "refused")):
            print(seed, verdict, flush=True)
        if spent > SLOW:
            counts["slow"] += 1
            print(seed, f"takes {spent:.1f} s: {verdict}", flush=True)
        if verdict.startswith("refused"):
            counts[verdict] += 1
    print(dict(counts), f"longest {longest:.2f} s")


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
