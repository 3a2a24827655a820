"""Random networks whose sources step: what elements absorb adds up to nothing, in every formulation alike.

`python tests/models/random_jumps.py straight|curved NUMBER [FIRST_SEED]` prints the seeds where it does not, and a
table.  Trees of resistors, stores and sources with chords; about 40 percent of the stores said; sources step at 0.2 s,
by the text or by an event.  What each element absorbs is integrated twice: as traced, and by a dynamic variable of its
power (Tellegen: both add up to zero over all elements, whatever passes at once).  `curved`: half of the stores have a
cubic law.
"""

import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
from model_runs import FOUR
from sysdyn import api

CLOSE = 1e-5
"""Of the largest energy: what sums and formulations may be off by, at an accuracy of 1e-7."""
LAWS = {
    "R": "dissipator(e = {} ohm*f)",
    "C": "potential(q = {} F*e)",
    "L": "kinetic(p = {} H*f)",
    "V": "effort(e = {})",
    "I": "flow(f = {})",
}
CURVED = {
    "C": "potential(e = {} V*(q/(1 C) + 0.3*(q/(1 C))^3))",
    "L": "kinetic(f = {} A*(p/(1 Wb) + 0.3*(p/(1 Wb))^3))",
}
KINDS, OFTEN = ["R", "C", "L", "V", "I"], [0.25, 0.35, 0.2, 0.13, 0.07]
UNITS = {"V": "V", "I": "A", "C": "V", "L": "A"}


def network(seed, sort):
    """A text, and the names of its elements."""
    random = np.random.default_rng(seed)
    nodes = ["ground", *(f"n{k}" for k in range(int(random.integers(2, 5))))]
    edges = [(nodes[k], nodes[int(random.integers(k))]) for k in range(1, len(nodes))]
    edges += [tuple(random.choice(nodes, 2, replace=False)) for _ in range(int(random.integers(1, 4)))]
    lines, names, by_event = [], [], random.random() < 0.5
    for k, (a, b) in enumerate(edges):
        kind = str(random.choice(KINDS, p=OFTEN))
        name, value = f"{kind}{k}", f"{10.0 ** random.uniform(-1.0, 1.0):.3g}"
        if kind in "VI":
            before, behind = (f"{x:.3f} {UNITS[kind]}" for x in random.uniform(-3.0, 3.0, 2))
            value = f"u{k}" if by_event else f"(if t < 0.2 s then {before} else {behind})"
            lines += [f"discrete u{k} = {before}", f"when t > 0.2 s {{ u{k} := {behind} }}"] if by_event else []
        law = CURVED[kind] if sort == "curved" and kind in CURVED and random.random() < 0.5 else LAWS[kind]
        names.append(name)
        lines.append(f"{name}: {law.format(value)} {a} -> {b}")
        if kind in "CL" and random.random() < 0.4:
            said = f"{random.choice(['=', '~'])} {random.uniform(-2.0, 2.0):.3f} {UNITS[kind]}"
            lines.append(f"init {name}.{'e' if kind == 'C' else 'f'} {said}")
    for node in nodes[1:]:
        if random.random() < 0.6:
            names.append(f"g{node}")
            lines.append(f"g{node}: dissipator(e = 3 ohm*f) {node} -> ground")
    for name in names:
        lines += [f"state W{name}: J = 0 J", f"dynamic W{name}' = {name}.e*{name}.f"]
    read = ", ".join(f"{name}.energy as E{name}, W{name}" for name in names)
    head = f"model m {{\n  node {', '.join(nodes[1:])}: electrical\n  "
    scene = f"\n}}\nscene s of m {{ time 0 s to 0.4 s; accuracy 1e-7; trace {read} every 50 ms }}\n"
    return head + "\n  ".join(lines) + scene, names


def absorbed(text, names, folder):
    """By formulation, as traced and by powers [2, elements]; None where a formulation refuses."""
    (folder / "m.sd").write_text(text)
    found = {}
    for formulation in FOUR:
        try:
            trace = api.simulate(folder / "m.sd", output=folder / "m.h5", formulation=formulation)
        except (api.ModelError, api.SolverFailure):
            found[formulation] = None
            continue
        found[formulation] = np.array([[trace[sort + name].values[-1] for name in names] for sort in "EW"])
    return found


def judged(seed, sort, folder):
    """agree, refused (no formulation runs), or what is off."""
    found = absorbed(*network(seed, sort), folder)
    values = [item for item in found.values() if item is not None]
    if len(values) < len(found):
        return "some refuse" if values else "refused"
    size = max(float(np.abs(item).max()) for item in values) + 1e-9
    off = max(float(np.abs(item.sum(axis=1)).max()) for item in values) / size
    apart = max(float(np.abs(item - values[0]).max()) for item in values) / size
    return "agree" if max(off, apart) <= CLOSE else f"sums off by {off:.2g}, formulations apart by {apart:.2g}"


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    begin, counts = int(sys.argv[3]) if len(sys.argv) > 3 else 0, Counter()
    with tempfile.TemporaryDirectory() as made:
        for k in range(begin, begin + int(sys.argv[2])):
            verdict = judged(k, sys.argv[1], Path(made))
            counts[verdict if verdict in {"agree", "refused"} else "differ"] += 1
            if verdict not in {"agree", "refused"}:
                print(k, verdict, flush=True)
    print("".join(f"{name:>12}" for name in ("networks", "agree", "refused", "differ")))
    print("".join(f"{number:>12}" for number in (counts.total(), *(counts[n] for n in ("agree", "refused", "differ")))))
