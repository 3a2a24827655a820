"""Every descriptor model of the book: residual on the independent solution, both carriers against the oracle."""

import numpy as np
import pytest
from carriers import CCarrier, NumpyCarrier
from catalogue import BLOCKS, convert, network, state
from reference_values import load
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.forms.descriptor import BLOCKS as ALL_BLOCKS
from sysdyn.compiler.forms.descriptor import WITHOUT_ENTRIES
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.calculus import differential, time_derivative
from sysdyn.dsl.model.evaluation import evaluate

CATALOGUE, VALUES = load("catalogue.json"), load("descriptor_values.json")
WITHOUT_VALUES = "redundant_pendulum|lagrangian|0"  # its multipliers are not determined
IN_C = (
    "pendulum|lagrangian|0",
    "ebers_moll|lagrangian|0",
    "solenoid|hamiltonian|1",
    "lc_ladder|lagrangian|0",
    "two_link_arm|hamiltonian|ODE in Lagrange coordinates (Ex 3.1)",
    "rectifier_motor_crank|hamiltonian|1",
)


def cases():
    for key, entry in CATALOGUE.items():
        for k, model in enumerate(entry["models"]):
            form = model["form"]
            if form in ("lagrangian", "hamiltonian"):
                name = f"{key}|{form}|{model['label'] or k}"
                yield pytest.param((key, k, name, "T*", form), id=name)
                if model["energy_after_legendre"]:
                    for to in ("hamiltonian", "lagrangian"):
                        yield pytest.param((key, k, name, "T", to), id=f"{name}, T given, {to}")


def test_every_entry_has_values():
    names = {c.values[0][2] for c in cases()}
    assert names - set(VALUES) == {WITHOUT_VALUES}
    assert {n for n in VALUES if "|co" not in n} == names - {WITHOUT_VALUES}
    assert len([c for c in cases() if c.values[0][3] == "T*"]) == 82


@pytest.fixture(params=list(cases()))
def case(request):
    key, k, name, energy, form = request.param
    entry = CATALOGUE[key]
    with x.fresh():
        net = network(entry, entry["models"][k], energy=energy)
        yield compile_network(net, form, "numpy", integrating=False), VALUES.get(name), name


def residual(oracle, t, y, yd):
    return sum(oracle.rows(b, t, y, yd) for b in BLOCKS), sum(oracle.magnitudes(b, t, y, yd) for b in BLOCKS)


def known_rates(oracle, values, k):
    """t, y, yd at one instant; s' and p', which the values do not list, from the rows that define them."""
    t, (_, y, yd) = values["t"][k], state(oracle.form, values, k)
    y, yd = np.array(y), np.array([0.0 if v is None else v for v in yd])
    r, _ = residual(oracle, t, y, yd)
    for number, equations in enumerate(oracle.form.rows):
        wanted = {"dynamics": "p", "lambda": "s"}.get(equations.block)
        for j, family in enumerate(oracle.form.families):
            if (family.owner, family.kind) == (equations.owner, wanted):
                yd[oracle.at[j]] = -r[oracle.to[number]]
    return t, y, yd


@pytest.mark.long
def test_residual_on_the_solution(case):
    compiled, values, name = case
    if name == WITHOUT_VALUES:
        return
    oracle = Oracle(compiled.form, compiled.bind())
    for k in range(len(values["t"])):
        t, y, yd = known_rates(oracle, values, k)
        r, scale = residual(oracle, t, y, yd)
        assert np.all(np.abs(r) <= 1e-12 * np.maximum(scale, 1e-3))
        for block in ("phi_rate", "phi_acceleration", "psi_rate", "momentum_rate"):
            r, scale = oracle.rows(block, t, y, yd), oracle.magnitudes(block, t, y, yd)
            assert np.all(np.abs(r) <= 1e-12 * np.maximum(scale, 1e-2)), block


@pytest.mark.one_in(4)
def test_energy_balance_is_an_identity(case):
    """d(T + V)/dt + dissipated - supplied = 0 at each state of the solution."""
    compiled, values, name = case
    if name == WITHOUT_VALUES:
        return
    oracle = Oracle(compiled.form, compiled.bind())
    rows = {r.owner: oracle.to[k] for k, r in enumerate(compiled.form.rows) if r.block == "audit"}
    for k in range(len(values["t"])):
        t, y, yd = known_rates(oracle, values, k)
        audit, scale = oracle.rows("audit", t, y, yd), oracle.magnitudes("audit", t, y, yd)
        rate = stored_rate(compiled.form, oracle, t, y, yd)
        balance = rate + audit[rows["dissipated"]] - audit[rows["supplied"]]
        size = abs(rate) + scale[rows["dissipated"]] + scale[rows["supplied"]]
        assert abs(balance) <= 1e-11 * max(size, 1e-3)


def stored_rate(form, oracle, t, y, yd):
    """The total derivative of kinetic + potential, from their nodes."""
    from dataclasses import replace

    rows = {k for k, r in enumerate(form.rows) if r.owner in ("kinetic", "potential") and r.block == "audit"}
    block = form.block("audit")
    kernels = tuple(
        replace(
            kernel,
            rows=tuple(replace(s, expression=time_derivative(s.expression)) for s in kernel.rows if s.row in rows),
        )
        for kernel in (block.kernels if block else ())
    )
    changed = replace(form, blocks=(replace(block, kernels=kernels),) if block else ())
    return Oracle(changed, oracle.binding).rows("audit", t, y, yd).sum()


def close(a, b):
    scale = np.max(np.abs(b), initial=1e-300)
    np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13 * scale)


def random_point(oracle, seed):
    random = np.random.default_rng(seed)
    return 0.37, random.uniform(0.2, 1.0, oracle.at[-1]), random.uniform(0.2, 1.0, oracle.at[-1])


@pytest.mark.one_in(26)
def test_carriers_agree_with_the_oracle(case, tmp_path):
    compiled, _, name = case
    binding = compiled.bind()
    oracle = Oracle(compiled.form, binding)
    carriers = [NumpyCarrier(compiled.program, compiled.form, binding, tmp_path)]
    if name in IN_C:
        carriers.append(CCarrier(compiled.program, compiled.form, binding))
    for seed in range(2):
        t, y, yd = random_point(oracle, seed)
        for block in ALL_BLOCKS:
            for carrier in carriers:
                close(carrier.rows(block, t, y, yd), oracle.rows(block, t, y, yd))
                if block not in WITHOUT_ENTRIES:
                    for order, part in enumerate(("dy", "dyd")):
                        v, _, _ = oracle.entries(block, order, t, y, yd)
                        close(carrier.entries(block, part, t, y, yd), v)


@pytest.mark.one_in(20)
def test_entries_are_the_rows_derivatives(case):
    """Richardson-extrapolated central differences of the rows against the entries, scattered by the pattern."""
    compiled, _, _ = case
    oracle = Oracle(compiled.form, compiled.bind())
    t, y, yd = random_point(oracle, 5)
    rows = [b for b in ALL_BLOCKS if b not in WITHOUT_ENTRIES and compiled.form.block(b)]
    for order in (0, 1):
        for block in rows:
            v, r, c = oracle.entries(block, order, t, y, yd)
            jacobian = np.zeros((oracle.to[-1], oracle.at[-1]))
            np.add.at(jacobian, (r.astype(int), c.astype(int)), v)
            direction = np.random.default_rng(7).uniform(-1, 1, oracle.at[-1])

            def along(h, order=order, block=block, direction=direction):
                a, b = (h * direction, 0.0) if order == 0 else (0.0, h * direction)
                return oracle.rows(block, t, y + a, yd + b) - oracle.rows(block, t, y - a, yd - b)

            slope = (8 * along(1e-4) - along(2e-4)) / 12e-4
            size = np.max(np.abs(oracle.magnitudes(block, t, y, yd)), initial=1.0)
            np.testing.assert_allclose(jacobian @ direction, slope, rtol=1e-7, atol=1e-9 * size)


WITH_STATES = [p for p in cases() if CATALOGUE[p.values[0][0]]["models"][p.values[0][1]]["s"]]


@pytest.mark.parametrize("which", [p for p in WITH_STATES if p.values[0][3] == "T*"])
def test_rates_of_states_are_those_of_the_reduced_system(which):
    """s' by lambda against d/dt of the state's map under the independent reduced equations."""
    key, k, name, _, form = which
    entry = CATALOGUE[key]
    reduced, model = entry["reduced"], entry["models"][k]
    held = load("references.json")
    states = held.get("systems", held)[key]["state_values"]
    with x.fresh():
        compiled = compile_network(network(entry, model), form, integrating=False)
        oracle = Oracle(compiled.form, compiled.bind())
        values = VALUES[name]
        names = {"t": x.time()} | {n: x.param(n) for n in entry["parameters"]}
        names |= {n: x.var(n, "s") for n in reduced["rhs"]}
        for n, text in reduced["aux"].items():
            names[n] = convert(text, names)
        rates = {names[n]: convert(text, names) for n, text in reduced["rhs"].items()} | {x.time(): x.const(1)}
        for j, t in enumerate(values["t"]):
            _, y, yd = known_rates(oracle, values, j)
            at = {names[n]: float(v[j]) for n, v in states.items()} | {x.time(): t}
            at |= {x.param(n): float(v) for n, v in entry["parameters"].items()}
            for s, text in zip(model["s"], model["s_map"], strict=True):
                map_ = convert(text, names)
                moving = {n: rates[n] for n in sorted(x.variables(map_), key=lambda n: n.number)}
                (expected,) = evaluate([differential(map_, moving)], at.__getitem__)
                family = next(i for i, f in enumerate(compiled.form.families) if (f.owner, f.kind) == (s, "s"))
                scale = oracle.magnitudes("lambda", t, y, yd).max()
                assert yd[oracle.at[family]] == pytest.approx(expected, rel=1e-10, abs=1e-12 * scale)
