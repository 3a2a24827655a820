"""Paynter's table: every state function, variable of the diagram, domain and family is refused or simulated rightly."""

import itertools
import os

import numpy as np
import pytest
from model_runs import FOUR, attempt, trace_of
from scipy.linalg import expm
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.paynter import REFLECTED_FUNCTIONS, STATE_FUNCTIONS, table
from sysdyn.dsl.text.codes import codes
from sysdyn.dsl.text.diagnostics import Report, SourceText

UNITS = {  # effort, flow, momentum, displacement
    "translation": ("N", "m/s", "N.s", "m"),
    "rotation": ("N.m", "rad/s", "N.m.s", "rad"),
    "electrical": ("V", "A", "Wb", "C"),
    "hydraulic": ("Pa", "m^3/s", "Pa.s", "m^3"),
    "thermal": ("K", "W/K", "K.s", "J/K"),
    "heat": ("K", "W", "K.s", "J"),
}
COMMON_FLOW = ("translation", "rotation")
PLACES = ("coord", "cocoord", "node", "branch")
LONG = os.environ.get("SYSDYN_LONG") == "1"


def has(domain, function):
    """Whether a domain has that edge: thermal ones have no kinetic stores, and heat has nowhere to go."""
    return domain != "heat" and (domain != "thermal" or STATE_FUNCTIONS[function].edge == "potential")


def unit(domain, letter):
    return dict(zip("efpq", UNITS[domain], strict=True))[letter]


def square(function, variable, domain, modulus, letter):
    """1/2 modulus x^2 in joule or watt, whatever the unit of x."""
    u = "W" if STATE_FUNCTIONS[function].edge == "dissipator" else "J"
    word = "content" if u == "W" else "energy"
    return f"{word} {function} = 1/2*({modulus} {u})*({variable}/(1 {unit(domain, letter)}))^2"


def names(place, domain):
    """How the four variables are written at a place; None where it has none."""
    own = {"e": "x.e", "f": "x.f", "p": "x.p", "q": "x.q"}
    if place == "node" and domain not in COMMON_FLOW:
        return {"e": "x.e", "f": None, "p": None, "q": None}
    return own if place != "branch" else {letter: letter for letter in "efpq"}


def held(place, domain):
    """The variables on which a state function may depend there: x.e of a coordinate or a mass is a rate."""
    return {"coord": "fpq", "cocoord": "epq", "branch": "efpq"}.get(place, "fpq" if domain in COMMON_FLOW else "e")


def written(place, domain, statements):
    """A model with these statements over one variable at a place, and what else makes it complete."""
    _e, f, _p, q = UNITS[domain]
    if place in ("coord", "cocoord"):
        return f"model m {{\n  {place} x: {domain} = 0.1 {q if place == 'coord' else unit(domain, 'p')}\n  " + (
            "\n  ".join(statements) + "\n}\n"
        )
    if place == "node":
        body = "\n  ".join(statements)
        return f"model m {{\n  node x: {domain}\n  S: flow(f = 0 {f}) x\n  {body}\n}}\n"
    body = "\n  ".join(statements)
    text = f"component c {{\n  branch: {domain}\n  {body}\n}}\n"
    return f"{text}model m {{\n  node x: {domain}\n  B: c() x\n  S: flow(f = 0 {f}) x\n}}\n"


def findings(text):
    report = Report()
    document = load.document(SourceText("text.sd", text), report)
    with ex.fresh():
        load.network(document, document.models["m"], None, report)
    return [d.code for d in report if d.severity == "error"]


EVERY = list(itertools.product(STATE_FUNCTIONS, "efpq", UNITS, PLACES))


@pytest.mark.parametrize(("function", "letter", "domain", "place"), EVERY)
@pytest.mark.one_in(2)
def test_a_function_of_one_variable(function, letter, domain, place):
    """Of its own variable alone: anything else is refused, with a code and a remedy."""
    variable = names(place, domain)[letter]
    if variable is None:
        return
    text = written(place, domain, [square(function, variable, domain, 2, letter)])
    known = STATE_FUNCTIONS[function]
    right = letter == known.own and letter in held(place, domain) and has(domain, function)
    found = findings(text)
    if right:
        assert not found
    else:
        assert found
        assert set(found) <= {"E307", "E309", "E320", "E213", "E518"}


@pytest.mark.parametrize(("function", "letter", "domain", "place"), EVERY)
@pytest.mark.one_in(2)
def test_beside_its_own_variable(function, letter, domain, place):
    """Another variable beside its own: as the table has it."""
    known, written_as = STATE_FUNCTIONS[function], names(place, domain)
    own, other = written_as[known.own], written_as[letter]
    there = held(place, domain)
    if own is None or other is None or letter == known.own or known.own not in there:
        return
    both = square(function, own, domain, 2, known.own) + f"*(1 + {other}/(1 {unit(domain, letter)}))"
    found = findings(written(place, domain, [both]))
    right = (
        letter in known.allowed_letters(complementary=place == "cocoord") and letter in there and has(domain, function)
    )
    assert (not found) == right, found


def test_the_page_prints_the_table():
    page = " ".join(codes()["E307"].why.split())
    for line in table().split("\n"):
        assert line in page


# -- what is allowed is simulated rightly ------------------------------------------------------------------

INERTIA, STIFFNESS, LOSS = 0.8, 3.0, 0.5  # kinetic p = 0.8 f, potential e = 3 q, dissipator e = 0.5 f
MODULI = {"T*": INERTIA, "T": 1 / INERTIA, "V": STIFFNESS, "V*": 1 / STIFFNESS, "D": LOSS, "G": 1 / LOSS}
TIMES = np.linspace(0, 2, 21)


def elements(domain, without):
    """The three elements at one node, all but the one that an energy stands for."""
    e, f, p, q = UNITS[domain]
    laws = {
        "kinetic": f"M: kinetic(p = {INERTIA} {p}*(f/(1 {f}))) x",
        "potential": f"K: potential(e = {STIFFNESS} {e}*(q/(1 {q}))) x",
        "dissipator": f"B: dissipator(e = {LOSS} {e}*(f/(1 {f}))) x",
    }
    return [law for edge, law in laws.items() if edge != without]


def expected(domain):
    """Momentum and displacement from 0.3 and 0.2: one flow for all between common-flow nodes, one effort elsewhere."""
    if domain in COMMON_FLOW:  # p' = -k q - b p/m, q' = p/m
        rates = np.array([[-LOSS / INERTIA, -STIFFNESS], [1 / INERTIA, 0.0]])
    else:  # p' = k q, q' = -p/m - k q/b
        rates = np.array([[0.0, STIFFNESS], [-1 / INERTIA, -STIFFNESS / LOSS]])
    return np.array([expm(rates * t) @ (0.3, 0.2) for t in TIMES])


DOMAINS = ["translation", "rotation", "electrical", "hydraulic"]
FACTORS = (DOMAINS, list(STATE_FUNCTIONS), ["branch", "node"], list(FOUR))
LAID_OUT = [
    one
    for one in itertools.product(*FACTORS)
    if LONG or sum(f.index(level) for f, level in zip(FACTORS, one, strict=True)) % 2 == 0
]
"""Domain, function, place, formulation; half of all, in which every three of them occur together."""


@pytest.mark.parametrize(("domain", "function", "place", "formulation"), LAID_OUT)
@pytest.mark.one_in(200)
def test_its_own_variable_is_simulated_rightly(tmp_path, domain, function, place, formulation):
    known = STATE_FUNCTIONS[function]
    variable = names(place, domain)[known.own]
    if variable is None or (place == "node" and domain in COMMON_FLOW and known.own == "e"):
        return
    statement = square(function, variable, domain, MODULI[function], known.own)
    e, f, p, q = UNITS[domain]
    rest = elements(domain, known.edge)
    start = {"kinetic": f"init M.p = 0.3 {p}", "potential": f"init K.q = 0.2 {q}"}
    begins = {"kinetic": ("p", p, 0.3), "potential": ("q", q, 0.2)}
    name = {"branch": "C", "node": "x"}[place]
    lines = [line for edge, line in start.items() if edge != known.edge]
    if known.edge in begins:
        letter, u, value = begins[known.edge]
        if domain in COMMON_FLOW:  # x.f, x.q
            target = f"x.f = {0.3 / INERTIA} {f}" if letter == "p" else f"x.q = {value} {u}"
        elif letter == "q":
            target = f"x.e = {STIFFNESS * value} {e}"
        else:
            target = f"{name}.p = {value} {u}"
        lines.append(f"init {target}")
    body = "\n  ".join([*rest, *lines, *([statement] if place == "node" else [f"{name}: c() x"])])
    component = f"component c {{\n  branch: {domain}\n  {statement}\n}}\n" if place == "branch" else ""
    common = "x.f in " + f if domain in COMMON_FLOW else "x.e in " + e
    text = f"{component}model m {{\n  node x: {domain}\n  {body}\n}}\n"
    text += f"scene s of m {{\n  time 0 s to 2 s\n  accuracy 1e-7\n  trace {common} as y every 0.1 s\n}}\n"
    trace = trace_of(tmp_path, text, formulation=formulation, backend="numpy")
    momentum, displacement = expected(domain).T
    wanted = momentum / INERTIA if domain in COMMON_FLOW else STIFFNESS * displacement
    np.testing.assert_allclose(trace["y"].values, wanted, atol=1e-6)
    assert np.abs(trace["/audit/energy"].values).max() < 1e-6


COORDINATES = {
    "coord": ("x.q", {"T*": "f", "T": "p", "V": "q", "D": "f"}),
    "cocoord": ("x.p", {"V*": "e", "V": "q", "T": "p", "G": "e"}),
}


@pytest.mark.parametrize("place", COORDINATES)
@pytest.mark.parametrize("domain", ["translation", "rotation", "electrical", "hydraulic"])
@pytest.mark.parametrize("transformed", [False, True])
@pytest.mark.long
def test_coordinates_are_simulated_rightly(tmp_path, domain, place, transformed):
    """One coordinate with all three stores, the inertia (compliance) said by either of its functions."""
    functions = ["T" if transformed else "T*", "V", "D"]
    if place == "cocoord":
        functions = [REFLECTED_FUNCTIONS[name] for name in functions]
    statements = [
        square(name, f"x.{(own := STATE_FUNCTIONS[name].own)}", domain, MODULI[name], own) for name in functions
    ]
    f, p, q, e = unit(domain, "f"), unit(domain, "p"), unit(domain, "q"), unit(domain, "e")
    if place == "coord":
        start, rate, forms = f"x: {domain} = 0.2 {q}", f"x.f = {0.3 / INERTIA} {f}", FOUR[:2]
        rates = np.array([[-LOSS / INERTIA, -STIFFNESS], [1 / INERTIA, 0.0]])
        wanted, traced = np.array([expm(rates * t) @ (0.3, 0.2) for t in TIMES])[:, 1], f"x.q in {q}"
    else:
        start, rate, forms = f"x: {domain} = 0.3 {p}", f"x.e = {0.2 * STIFFNESS} {e}", FOUR[2:]
        # 1/k e' + e/b + p/m = 0, p' = e
        rates = np.array([[-STIFFNESS / LOSS, -STIFFNESS / INERTIA], [1.0, 0.0]])
        wanted = np.array([expm(rates * t) @ (0.2 * STIFFNESS, 0.3) for t in TIMES])[:, 1]
        traced = f"x.p in {p}"
    body = "\n  ".join([f"{place} {start}", *statements, f"init {rate}"])
    text = f"model m {{\n  {body}\n}}\nscene s of m {{\n  time 0 s to 2 s\n  accuracy 1e-7\n"
    text += f"  trace {traced} as y every 0.1 s\n}}\n"
    for formulation in forms:
        trace = trace_of(tmp_path, text, formulation=formulation, backend="numpy")
        np.testing.assert_allclose(trace["y"].values, wanted, atol=1e-6)


@pytest.mark.parametrize("function", ["V", "V*"])
@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(12)
def test_thermal_stores(tmp_path, function, formulation):
    """Entropy that flows into a store of a true thermal domain: e = dV/dq."""
    own = STATE_FUNCTIONS[function].own
    statement = square(function, own, "thermal", MODULI[function], own)
    text = f"component c {{\n  branch: thermal\n  {statement}\n}}\nmodel m {{\n  node x: thermal\n  B: c() x\n"
    text += "  S: flow(f = 0.4 W/K) ground -> x\n  init x.e = 6 K\n}\n"
    text += "scene s of m {\n  time 0 s to 2 s\n  trace x.e as y every 0.1 s\n}\n"
    trace = trace_of(tmp_path, text, formulation=formulation, backend="numpy")
    np.testing.assert_allclose(trace["y"].values, 6 + STIFFNESS * 0.4 * TIMES, rtol=1e-6)


def test_a_kinetic_store_of_heat_is_refused(tmp_path):
    text = "model m {\n  node x: thermal\n  L: kinetic(p = 2 K^2.s/W*f) x\n  S: effort(e = 3 K) x\n}\n"
    ran, report = attempt(tmp_path, text, until="1")
    assert ran is None
    assert [d.code for d in report if d.severity == "error"] == ["E307"]
