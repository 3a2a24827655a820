"""Whether a model can only store and lose what its sources supply: lossless, passive, or active with the element named.

With H = T + V every model is  H' = (power of the ports) - (power of the dissipators) + (power of what is controlled);
stores, transformers, gyrators and workless constraints exchange power and keep it.  So it suffices to look at each
dissipator, content, controlled source and work:

    intervals   the law has the sign of its own variable, by interval arithmetic over all its values (a proof)
    sampled     the same at points over the decades: nothing was found that speaks against it

Sources and works that follow time and parameters alone, and constraints that time moves, are ports: what they supply is
the input of the certificate.  Controlled sources count together: a conductor of heat is two of them.
Received: a network with its branches, numbers bound.  Returned: a Certificate.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cache

import numpy as np
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.enclosures import enclose_over
from sysdyn.compiler.model.interpret import Value, evaluate
from sysdyn.compiler.model.terms import summands
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative, time_derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Network
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.values import dataclass

DECADES = tuple(s * m * 10.0**k for k in range(-9, 7) for m in (1.0, 3.0) for s in (1.0, -1.0))
"""Own variables at which a law is looked at, in SI units."""
POINTS = 200
"""Random points at which several unknowns are looked at together."""
ROUND_OFF = 1e-9
"""Of the terms of a power: what is below says nothing."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One element: role (dissipates, port, conserves, active, unknown), how that is known (intervals, sampled,
    structure), and what was seen.
    """

    name: str
    role: str
    how: str
    said: str
    place: Place


@dataclass(frozen=True, slots=True)
class Certificate:
    """verdict: lossless, passive, active, or undecided; findings: all elements that are not stores or two-ports."""

    verdict: str
    findings: tuple[Finding, ...]

    @property
    def proven(self) -> bool:
        """Whether intervals and structure alone say so."""
        return all(f.how != "sampled" for f in self.findings) and self.verdict != "undecided"

    def lines(self) -> list[str]:
        """The verdict in one line, then one for each element that it rests on."""
        how = "" if self.verdict in ("undecided", "active") else f" ({'proven' if self.proven else 'sampled'})"
        ports = dict.fromkeys(f.name for f in self.findings if f.role == "port")
        said = {
            "lossless": "stores and ports exchange energy, nothing is lost",
            "passive": "H rises by no more than what the ports supply",
            "active": "an element other than a port supplies energy",
            "undecided": "an element is not judged",
        }[self.verdict]
        first = f"{self.verdict}{how}: {said}; ports: {', '.join(ports) or 'none'}"
        return [first, *(f"  {f.name}: {f.role}, {f.how}: {f.said}" for f in self.findings if f.role != "port")]


def certificate(network: Network, binding: Binding) -> Certificate:
    """The certificate of a model with its numbers."""
    judge = _Judge(binding)
    found = tuple(judge.all(network))
    roles = {f.role for f in found}
    if "active" in roles:
        return Certificate("active", found)
    if "unknown" in roles:
        return Certificate("undecided", found)
    return Certificate("passive" if "dissipates" in roles else "lossless", found)


class _Judge:
    """Looks at each element with the numbers bound."""

    def __init__(self, binding: Binding) -> None:
        self.binding = binding
        self.senses: frozenset[str] = frozenset()
        self.random = np.random.default_rng(17)

    def all(self, network: Network) -> Iterator[Finding]:
        """Every element that may lose or supply power."""
        controlled: list[tuple[str, Node, Place]] = []
        self.senses = frozenset(s.sense.data for s in network.switches if s.sense is not None)
        sets = {s.label for s in network.switches if s.holds is not None}
        closing = [c for c in network.constraints if c.kind == "gamma" and c.name in sets]  # u = 0, or s = sense
        signs = {ex.var(c.name, "e", *c.at): ex.call("sign", c.expression.args[1]) for c in closing}
        for b in network.branches:
            if b.domain.pseudo or b.law is None:
                continue
            yield from self._branch(b, ex.substitute(b.law, signs) if signs else b.law, network, controlled)
        yield from self._contents(network)
        yield from self._stores(network)
        yield from self._works(network, controlled)
        yield from self._constraints(network)
        if controlled:
            yield self._together(controlled)

    # -- one element -------------------------------------------------------------------------------------------

    def _branch(
        self, b: Branch, law: Node, network: Network, controlled: list[tuple[str, Node, Place]]
    ) -> Iterator[Finding]:
        """Findings on a branch by its kind; what controlled sources deliver is appended to `controlled`."""
        own = ex.var(b.name, "bf" if b.side == "e" else "be", *b.at)
        name = b.name.partition("#")[0]
        # e f >= 0 on its own
        if b.kind == "dissipator":
            yield self._judge_sign(name, law, own, b.place)
        elif b.kind in ("effort", "flow"):
            read = {n for n in ex.variables(law) if n.op == "var"}
            # V(t): a port of the system
            if not read:
                yield Finding(name, "port", "structure", "a source that follows time and parameters", b.place)
            # e = -R f written as a source
            elif read == {own}:
                yield self._judge_sign(name, law, own, b.place)
            # e = k f2: judged together with the others
            else:
                controlled.append((name, ex.mul(law, _conjugate(b, own)), b.place))
        elif b.kind in ("kinetic", "potential"):
            yield from self._find_time_varying_store(name, law, b.place)

    def _judge_sign(self, name: str, law: Node, own: Node, place: Place) -> Finding:
        """A law and its own variable: e f >= 0?"""
        # the sense of a dry friction stands in it: it opposes its own motion by its form
        if self._sliding(law):
            return Finding(name, "dissipates", "structure", "dry friction, against its own sliding", place)
        fixed = cache(self._parameter_value)
        # a proof: law(f) >= 0 over f >= 0 and <= 0 over f <= 0, as R f
        above, below = (enclose_over(law, {own: r}, fixed) for r in ((0.0, np.inf), (-np.inf, 0.0)))
        if above[0] >= 0.0 and below[1] <= 0.0:
            none = above[1] == 0.0 and below[0] == 0.0
            said = "no effort" if none else "e f >= 0 over all values"
            return Finding(name, "conserves" if none else "dissipates", "intervals", said, place)
        # no proof, as a product of unknowns: look at points over the decades
        largest = 0.0
        others = sorted((n for n in ex.variables(law) if n is not own), key=lambda n: n.number)
        for x in DECADES:
            values = dict(zip(others, self._numbers(len(others)), strict=True)) | {own: x}
            value = self._value(law, values)
            if np.isfinite(value) and x * value < 0.0 and abs(value) > ROUND_OFF * largest:
                return Finding(name, "active", "sampled", f"e f = {x * value:.3g} W < 0 at {own} = {x:g}", place)
            largest = max(largest, abs(value)) if np.isfinite(value) else largest
        return Finding(name, "dissipates", "sampled", f"e f >= 0 at {len(DECADES)} points", place)

    def _find_time_varying_store(self, name: str, law: Node, place: Place) -> Iterator[Finding]:
        """A store whose law changes with time or signals is supplied through it."""
        moving = [n for n in ex.variables(law) if n.op == "time" or n.data[1] == "s"]
        if moving:
            yield Finding(name, "active", "structure", "the law of this store changes in time", place)

    def _stores(self, network: Network) -> Iterator[Finding]:
        for energy in network.energies:
            if energy.function in ("T*", "T", "V", "V*"):
                yield from self._find_time_varying_store(
                    f"energy of line {_line(energy.place)}", energy.expression, energy.place
                )

    def _contents(self, network: Network) -> Iterator[Finding]:
        """Contents D(f), G(e): the power is sum f dD/df; summand by summand where one variable moves it."""
        for energy in network.energies:
            if energy.function not in ("D", "G"):
                continue
            # D of flows, G of efforts; f too, which a displacement's rate is in a reflection
            kinds = ("f", "nf", "bf") if energy.function == "D" else ("e", "ne", "be", "f")
            own = sorted(
                (n for n in ex.variables(energy.expression) if n.op == "var" and _is_rate(n, kinds)),
                key=lambda n: n.number,
            )
            name = f"content of line {_line(energy.place)}"
            rates = {n: ex.var("#own", "bf", ex.const(float(k))) for k, n in enumerate(own)}
            inner = ex.substitute(energy.expression, dict(rates))
            slopes = {n: derivative(inner, v) for n, v in rates.items()}
            still = ex.substitute(energy.expression, dict.fromkeys(own, ex.const(0.0)))
            # friction against a moving belt: power comes in through the belt
            if own and not ex.is_const(still, 0.0) and self._sliding(energy.expression):
                yield Finding(name, "port", "structure", "what it slides on moves", energy.place)
            # one variable: the sign of its slope
            if len(own) == 1:
                yield self._judge_sign(name, slopes[own[0]], rates[own[0]], energy.place)
            # several: a quadratic form, or samples
            elif own:
                yield self._quadratic(name, inner, list(rates.values()), energy.place)

    def _quadratic(self, name: str, content: Node, own: Sequence[Node], place: Place) -> Finding:
        """A content of several variables: proven where its second derivatives are numbers, else at points."""
        slopes = [derivative(content, v) for v in own]
        second = [[derivative(s, v) for v in own] for s in slopes]
        still = dict.fromkeys(own, ex.const(0.0))
        # the second derivatives are numbers, as those of f^T R f / 2: eigenvalues decide
        if not any(ex.variables(n) for row in second for n in row):
            matrix = np.array([[self._parameter_value(n) for n in row] for row in second])
            flat = all(self._parameter_value(ex.substitute(s, still)) == 0.0 for s in slopes)
            values = np.linalg.eigvalsh((matrix + matrix.T) / 2.0)
            if flat and values[0] >= -1e-14 * abs(values).max():
                role = "dissipates" if values[-1] > 0.0 else "conserves"
                return Finding(name, role, "structure", "its matrix is positive semidefinite", place)
            if flat:
                return Finding(name, "active", "structure", f"its matrix has the eigenvalue {values[0]:.3g}", place)
        # of other contents the power at random points
        power = ex.add(*(ex.mul(v, s) for v, s in zip(own, slopes, strict=True)))
        return self._sample_power(name, [power], place)

    def _works(self, network: Network, controlled: list[tuple[str, Node, Place]]) -> Iterator[Finding]:
        """Findings on works, each summand of an effort by what it reads; those of other unknowns are appended to
        `controlled`.
        """
        given = {u.name for u in network.unknowns}
        for work in network.works:
            name = f"work of line {_line(work.place)}"
            try:
                rate = time_derivative(work.on)
            except ValueError:
                yield Finding(name, "unknown", "structure", "the rate of its displacement is not known", work.place)
                continue
            for effort in summands(work.effort):
                effort = _explicit(effort, network, given)
                read = {n for n in ex.variables(effort) if n.op == "var"}
                # -c sign(v)
                if sliding := self._sliding(effort):
                    yield self._friction(name, effort, sliding, work.place)
                # F(t)
                elif not read:
                    yield Finding(name, "port", "structure", "it follows time and parameters", work.place)
                # an implicit effort: its gamma says what it does
                elif any(n.data[1] == "e" and n.data[0] in given for n in read):
                    yield self._implicit(name, effort, rate, network, work.place)
                elif not read <= {work.on}:  # the effort of one displacement along itself has a potential
                    controlled.append((name, ex.neg(ex.mul(effort, rate)), work.place))

    def _sliding(self, root: Node) -> list[Node]:
        """The senses of dry friction in an expression."""
        return [n for n in ex.topological([root]) if n.op == "param" and n.data in self.senses]

    def _friction(self, name: str, effort: Node, senses: Sequence[Node], place: Place) -> Finding:
        """A work whose effort follows the sense of a motion, and works along it."""
        values = [self._value(effort, dict.fromkeys(senses, sense)) for sense in (1.0, -1.0)]
        read = any(n.op == "var" for n in ex.variables(effort))
        if not read and values[0] <= 0.0 <= values[1]:
            return Finding(name, "dissipates", "structure", "dry friction, against the motion it follows", place)
        return Finding(name, "unknown", "structure", "its effort follows a sense of sliding and more", place)

    def _implicit(self, name: str, effort: Node, rate: Node, network: Network, place: Place) -> Finding:
        """An implicit effort closed by one gamma that is linear in one flow: its flow as a law of it."""
        unknowns = [n for n in ex.variables(effort) if n.op == "var" and n.data[1] == "e"]
        flows = [n for n in ex.variables(rate) if n.op == "var"]
        closing = [c for c in network.constraints if c.kind == "gamma" and unknowns[0] in ex.variables(c.expression)]
        # e in `gamma: e + R*f = 0`: solve for f, whose law in e has a sign
        if len(unknowns) == len(flows) == len(closing) == 1:
            gamma, own = closing[0].expression, unknowns[0]
            slope = derivative(gamma, flows[0])
            known = {n for n in ex.variables(gamma) if n.op == "var"} <= {own, flows[0]}
            if known and not ex.variables(slope) and self._parameter_value(slope) != 0.0:
                flow = ex.neg(ex.div(ex.substitute(gamma, {flows[0]: ex.const(0.0)}), slope))
                part = derivative(effort, own)
                if not ex.variables(part):
                    return self._judge_sign(
                        name, ex.neg(ex.mul(ex.substitute(rate, {flows[0]: flow}), part)), own, place
                    )
        return Finding(name, "unknown", "structure", "an effort constraint gives its effort", place)

    def _constraints(self, network: Network) -> Iterator[Finding]:
        for c in network.constraints:
            if c.kind != "gamma" and any(n.op == "time" for n in ex.variables(c.expression)):
                yield Finding(c.name, "port", "structure", "a motion that time prescribes", c.place)

    # -- what is controlled ------------------------------------------------------------------------------------

    def _together(self, controlled: Sequence[tuple[str, Node, Place]]) -> Finding:
        """Controlled sources and works by what they absorb together; the first that supplies most is named."""
        found = self._sample_power(
            ", ".join(dict.fromkeys(name for name, _, _ in controlled)),
            [power for _, power, _ in controlled],
            controlled[0][2],
        )
        if found.role != "active":
            return found
        worst = min(controlled, key=lambda item: self._least(item[1]))
        return Finding(worst[0], "active", found.how, f"controlled: {found.said}", worst[2])

    def _sample_power(self, name: str, powers: Sequence[Node], place: Place) -> Finding:
        """The sum of absorbed powers at random points."""
        leaves = sorted({n for p in powers for n in ex.variables(p)}, key=lambda n: n.number)
        lost = False
        for _ in range(POINTS):
            values = dict(zip(leaves, self._numbers(len(leaves)), strict=True))
            parts = np.array([self._value(p, values) for p in powers])
            if not np.isfinite(parts).all():
                continue
            total, size = float(parts.sum()), float(np.abs(parts).sum())
            if total < -ROUND_OFF * size:
                return Finding(name, "active", "sampled", f"absorbs {total:.3g} W at a point", place)
            lost |= total > ROUND_OFF * size
        role = "dissipates" if lost else "conserves"
        return Finding(name, role, "sampled", f"at {POINTS} points", place)

    def _least(self, power: Node) -> float:
        leaves = sorted(ex.variables(power), key=lambda n: n.number)
        points = (dict(zip(leaves, self._numbers(len(leaves)), strict=True)) for _ in range(POINTS))
        return min((v for p in points if np.isfinite(v := self._value(power, p))), default=0.0)

    # -- numbers -----------------------------------------------------------------------------------------------

    def _numbers(self, count: int) -> list[float]:
        """Random numbers over the decades, of both signs."""
        size = 10.0 ** self.random.uniform(-3.0, 3.0, count)
        return [float(v) for v in size * self.random.choice([-1.0, 1.0], count)]

    def _value(self, root: Node, values: dict[Node, float]) -> float:
        with np.errstate(all="ignore"):
            found = evaluate([root], lambda n, args: values[n] if n in values else self._leaf(n, args))[0]
            return float(np.ravel(found)[0])

    def _parameter_value(self, root: Node) -> float:
        if root.op == "param" and not root.args:  # most of what a netlist asks
            return float(np.ravel(self._leaf(root, []))[0])
        return self._value(root, {})

    def _leaf(self, node: Node, args: list[Value]) -> Value:
        """What no unknown changes; of arrays the first element stands for all, and one for none (an empty range)."""
        if node.op == "param" and node.args:
            return float(next(iter(np.ravel(self.binding.parameters.values[node.data])), 1.0))
        if node.op == "index":
            return 1.0
        return self.binding.parameters.lookup(node, args)


def _is_rate(node: Node, kinds: Iterable[str]) -> bool:
    """A flow, or the rate of a displacement."""
    return (node.data[1] in kinds and node.data[2] == 0) or (node.data[1] in ("q", "nq", "bq") and node.data[2] == 1)


def _line(place: Place) -> int:
    return place.source.text.count("\n", 0, place.span.start) + 1


def _explicit(effort: Node, network: Network, given: set[str]) -> Node:
    """An effort with the implicit unknowns that a gamma gives as expressions of what is none."""
    change: dict[Node, Node] = {}
    read = (n for n in ex.variables(effort) if n.op == "var" and n.data[0] in given)
    for own in sorted(read, key=lambda n: n.number):
        closing = [c for c in network.constraints if c.kind == "gamma" and own in ex.variables(c.expression)]
        for c in closing:
            slope = derivative(c.expression, own)
            rest = ex.substitute(c.expression, {own: ex.const(0.0)})
            if not ex.variables(slope) and not any(n.op == "var" and n.data[0] in given for n in ex.variables(rest)):
                change[own] = ex.neg(ex.div(rest, slope))
                break
    return ex.substitute(effort, change) if change else effort


def _conjugate(b: Branch, own: Node) -> Node:
    """The own variable of a source, by its nodes where these have it in common."""
    letter = own.data[1][1]
    common = "e" if b.domain.common == "effort" else "f"
    if letter != common or b.plus is None or b.minus is None:
        return own
    ends = [ex.const(0.0) if t.node is None else ex.var(t.node, f"n{letter}", *t.at) for t in (b.plus, b.minus)]
    return ex.sub(ends[0], ends[1])
