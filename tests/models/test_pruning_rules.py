"""Each rule of pruning, broken, is noticed: what is left out of a table of texts is another then.

The texts are loaded once; a mutant is the text of a module with one place changed, and only says what it leaves out.
"""

import sys
import types
from pathlib import Path

import pytest
from sysdyn.compiler.network.pruning import prune_network
from sysdyn.dsl import load
from sysdyn.dsl.text.diagnostics import Report, SourceText
from test_pruning import ISLES, KEPT, OPEN, UNREAD, with_more

ROOM = Path(load.__file__).parents[1] / "compiler" / "network"
MODULES = ("influence", "dead_branches", "pruning")
LEVER = "  node w: translation\n  Mw: mass(m = 1 kg) w\n"
TEXTS = {
    **{name: with_more(lines) for name, lines in UNREAD.items()},
    **{f"kept: {name}": with_more(UNREAD[part] + f"  {line}\n") for name, (line, part) in KEPT.items()},
    "isles": ISLES,
    "open": OPEN,
    "constraint that reads": with_more(
        f"{UNREAD['island']}{LEVER}  input u: 1 = x.q/(1 m)\n  psi lever: z.f = (1 + u^2)*w.f\n"
    ),
    "ratio that reads": with_more(
        f"{UNREAD['island']}{LEVER}  input u: 1 = x.q/(1 m)\n"
        "  T: transformer(f1 = (1 + u^2)*f2) z -> ground, w -> ground\n"
    ),
    "gamma that reads": with_more("  implicit h: N ~ 0 N\n  gamma g: h = 1 N/m*x.q\n"),
    "expected": with_more("  node z: translation\n  Mz: mass(m = 1 kg) z\n  expect always: abs(z.f) <= 1 m/s\n"),
    "meter": with_more("  coord y: translation\n  energy T* = 1/2*(1 kg)*y'^2\n").replace("as v", "as v, audit.energy"),
    "accuracy": with_more("  coord y: translation\n  energy T* = 1/2*(1 kg)*y'^2\n").replace(
        "as v", "as v\n  accuracy 1e-3 on audit.energy"
    ),
    "open, given a start": OPEN.replace("}\nscene s", "  init d.e = 0 V\n}\nscene s", 1),
    "open, what is in it given": OPEN.replace("R3: resistor(R = 1 ohm)", "R3: capacitor(C = 1 F)").replace(
        "}\nscene s", "  init R3.e = 1 V\n}\nscene s", 1
    ),
    "open, read by what is traced": OPEN.replace(
        "}\nscene s", "  state z: V = 0 V\n  dynamic z' = (R3.e - z)/(1 s)\n}\nscene s", 1
    ).replace("as e", "as e, z"),
    "expected, nothing traced": ISLES.replace("trace x }", "expect always: abs(x) <= 9 m }"),
    "an event writes": with_more(
        "  coord y: translation\n  energy T* = 1/2*(1 kg)*y'^2\n  when x.q > 1 m { y.f = 0 m/s }\n"
    ),
    "open, a source": OPEN.replace("R3: resistor(R = 1 ohm)", "R3: current(i = 0 A)"),
    "energy that reads": with_more(
        "  state h: 1 = 0\n  dynamic h' = (x.q/(1 m) - h)/(1 s)\n  coord y: translation\n"
        "  energy T* = 1/2*(1 kg)*y'^2\n  energy V = 1/2*(1 N/m)*(2 + h)*y^2\n"
    ).replace("as v", "as v, h"),
    "open, no ground": OPEN.replace("ground", "b")
    .replace("a -> b\n  R1", "a -> e\n  node e: electrical\n  R4: resistor(R = 1 ohm) e -> b\n  R1")
    .replace("b -> b", "b -> a"),
    "open, of two-ports": OPEN.replace(
        "R3: resistor(R = 1 ohm) c -> d", "R3: gyrator(e1 = 1 ohm*f2) c -> d, b -> ground"
    ),
}
WINDING = OPEN.replace(
    "R3: resistor(R = 1 ohm) c -> d",
    "T: transformer(e1 = 2*e2) c -> ground, d -> g\n  node g: electrical\n"
    "  R3: resistor(R = 1 ohm) d -> g\n  R4: resistor(R = 1 Gohm) g -> ground",
).replace("  state w: V = 0 V\n  dynamic w' = (d.e - w)/(1 s)\n", "")
TIED = {
    "tied": "",
    "twice": "  R5: resistor(R = 1 Gohm) d -> ground\n",
    "read by a law": "  node h: electrical\n  E: voltage(v = d.e) h -> b\n  R5: resistor(R = 1 ohm) h -> b\n",
    "told": "  init g.e = 0 V\n",
    "of common flow": "  node x, y: translation\n  K: potential(e = 1 N/m*q) x -> ground\n"
    "  S: potential(e = 1 N/m*q) x -> y\n  D: dissipator(e = 1 N.s/m*f) x -> y\n"
    "  G: effort(e = 1 V/m*S.q) h -> b\n  node h: electrical\n  R5: resistor(R = 1 ohm) h -> b\n",
}
TEXTS |= {f"tied: {name}": WINDING.replace("}\nscene s", f"{lines}}}\nscene s", 1) for name, lines in TIED.items()}
TEXTS["tied: asked"] = WINDING.replace("as e }", "as e, g.e as g }", 1)
MUTANTS = {
    "influence": [
        ('MECHANICAL = frozenset("xnb")', 'MECHANICAL = frozenset("xn")'),
        ('MECHANICAL = frozenset("xnb")', 'MECHANICAL = frozenset("xb")'),
        ('MECHANICAL = frozenset("xnb")', 'MECHANICAL = frozenset("nb")'),
        ('MECHANICAL = frozenset("xnb")', 'MECHANICAL = frozenset("xnbus")'),
        ("[w.on], [w.effort]", "[w.on], []"),
        ("[w.on], [w.effort]", "[w.on, w.effort], []"),
        ("read_by(network, [d.expression]))", "frozenset())"),
        ('frozenset({("s", d.state.data[0])})', "read_by(network, [d.state, d.expression])"),
        ("Link(i, read_by(network, [i.target, i.value]), frozenset())", "Link(i, frozenset(), frozenset())"),
        (
            "Link(i, read_by(network, [i.target, i.value]), frozenset())",
            "Link(i, frozenset(), read_by(network, [i.target]))",
        ),
        ("(all_ - joined) | read_by", "read_by"),
        ("[signals_held(root)[0]], [root]", "[root], []"),
        ("[signals_held(root)[0]], [root]", "[signals_held(root)[0]], []"),
        ("found.joined | own", "found.joined"),
        ("if b.on is None:", "if True:"),
        ("along.joined | own", "own"),
        ("NOTHING if b.law is None else read_by(network, [b.law])", "NOTHING"),
        ("Link(b, own, reads)", "Link(b, own | reads, NOTHING)"),
        ('frozenset([*ends, ("b", b.name)])', 'frozenset([("b", b.name)])'),
        ('frozenset([*ends, ("b", b.name)])', "frozenset(ends)"),
        ('frozenset({("b", c.first), ("b", c.second)})', 'frozenset({("b", c.first)})'),
        ('frozenset({("c", c.name)})', "frozenset()"),
        ("Link(item, closed, read_by(network, [item.expression]))", "Link(item, closed, frozenset())"),
        (
            "Link(item, closed, read_by(network, [item.expression]))",
            "Link(item, read_by(network, [item.expression]), frozenset())",
        ),
        ("if len(left) == 1 and", "if False and"),
        ("(found[k].joined | found[k].reads) - kept", "found[k].joined - kept"),
        ("(found[k].joined | found[k].reads) - kept", "found[k].reads - kept"),
        ("for q in link.joined:\n            of", "for q in link.joined | link.reads:\n            of"),
        ("for piece in summands(e.expression)", "for piece in [e.expression]"),
        ('case "kappa" | "mu":\n            return "c", name', 'case "kappa" | "mu":\n            return "s", "none"'),
        ('case "e" if name in unknowns:', 'case "e" if False:'),
    ],
    "dead_branches": [
        ("read |= link.reads - link.joined if isinstance(link.item, Branch) else link.reads", "pass"),
        ("read = set(asked)", "read = set()"),
        ("links == 1 and", '(links == 1 or q[0] == "b") and'),
        ("q not in read}", '(q not in read or q[0] == "b")}'),
        ("links == 1 and", '(links == 1 or q[0] == "n") and'),
        ("q not in read}", '(q not in read or q[0] == "n")}'),
        ("n.name in grounded and ", ""),
        ('{"effort", "flow"} - {balanced}', '{"effort", "flow"}'),
        (' and b.kind in STORES | {"effort", "flow"} - {balanced}', ""),
        ("joins == 1", "joins > 0"),
        ("not part & told", "part"),
        ("told = set(asked)", "told = set()"),
        ("link.reads if plain else link.reads | link.joined", "link.reads"),
        ("link.reads if plain else link.reads | link.joined", "set() if plain else link.reads | link.joined"),
        ('b.domain.common == "effort" and None in', "None in"),
        ('balanced = "flow" if b.domain.common == "effort" else "effort"', 'balanced = "effort"'),
    ],
    "pruning": [
        ("roots += [n for e in network.expectations", "roots = roots + [n for e in ()"),
        ("return frozenset() if EVERYTHING in found else found", "return found - {EVERYTHING}"),
        ('any(name.startswith("audit.") for name, _ in scene.accuracy_on)', "False"),
        ("or not network.traced", ""),
        ("roots += [a.target for e in network.events", "roots = roots + [a.target for e in ()"),
        ("if len(left) == len(own):", "if left:"),
        ("if not dead:", "if True:"),
        ("range(len(network.branches) + 1)", "range(1)"),
        ('Removal("downstream" if read else "island"', 'Removal("island"'),
    ],
}  # fmt: skip


def _networks():
    for text in TEXTS.values():
        document, report = load.document(SourceText("m", text), Report()), Report()
        for scene in document.scenes.values():
            model = load.model_of(document, scene, report)
            network = load.network(document, model, scene, report)
            assert network is not None, (text, [d.message for d in report])
            yield network


@pytest.fixture(scope="module")
def networks():
    return list(_networks())


def _left_out(networks, cut):
    """What goes, by which rule, and what stays of the energies."""
    found = []
    for network in networks:
        left, parts = cut(network)
        found.append(([(p.rule, p.names, p.reads) for p in parts], [repr(e.expression) for e in left.energies]))
    return found


def _mutated(monkeypatch, changed, old, new):
    """`pruned` of the modules with one place of one of them changed."""
    for name in MODULES:
        text = (ROOM / f"{name}.py").read_text(encoding="utf-8")
        if name == changed:
            assert text.count(old) == 1, (name, old, text.count(old))
            text = text.replace(old, new)
        full = f"sysdyn.compiler.network.{name}"
        module = types.ModuleType(full)
        monkeypatch.setitem(sys.modules, full, module)
        exec(compile(text, full, "exec"), module.__dict__)  # noqa: S102 (our own text)
    return module.prune_network


@pytest.mark.long
def test_a_broken_rule_is_noticed(networks, monkeypatch):
    right = _left_out(networks, prune_network)
    assert right == _left_out(networks, _mutated(monkeypatch, "", "", ""))
    unnoticed = []
    for name, changes in MUTANTS.items():
        for old, new in changes:
            try:
                same = _left_out(networks, _mutated(monkeypatch, name, old, new)) == right
            except (KeyError, ValueError, AttributeError):
                same = False
            if same:
                unnoticed.append((name, old, new))
    assert not unnoticed
