"""The port-Hamiltonian view against the rows of the descriptor form, and what makes it one: E^T e = dH/dz, J = -J^T,
R = R^T >= 0."""

import json

import numpy as np
import pytest
from sysdyn.cli.analysis.operating_point import compile_target
from sysdyn.cli.main import run
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.compiler.equations.matrices import NoSuchEquations, rows_of
from sysdyn.compiler.equations.port_hamiltonian import port_hamiltonian
from sysdyn.compiler.forms.momenta import momentum
from sysdyn.compiler.model.interpret import evaluate
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.text.diagnostics import Report
from texts import ROOT, write

SEED = ROOT / "models" / "seed"
PASSIVE = (
    "pendulum", "bead_rod", "two_link_arm", "slider_crank", "knife_edge", "rolling_disk", "em_suspension", "solenoid",
    "inverted_pendulum", "lead_filter", "dc_motor", "diode_circuit", "lcr_nonlinear", "mechanical_gyrator",
    "electrical_transformer", "nonlinear_fluid", "co_circuit", "gear_pair", "rectifier_motor_crank", "parallelogram",
)  # fmt: skip


def viewed(path, formulation):
    """The view of a file's scene, the compiled model and a function that gives numbers to nodes."""
    report = Report()
    made = compile_target(RunRequest(str(path), formulation=formulation, backend="numpy"), report)
    assert made is not None, [d.message for d in report.diagnostics]
    _, prepared = made
    model = prepared.compiled
    return port_hamiltonian(model.energies, model.form), model, prepared.binding


class Point:
    """Random numbers for unknowns and their rates; momenta follow from flows where they must."""

    def __init__(self, binding, seed):
        self.binding, self.random, self.values = binding, np.random.default_rng(seed), {}

    def __call__(self, node):
        return float(np.ravel(evaluate([node], self._leaf)[0])[0])

    def solve(self, row, unknown):
        """A value of an unknown in which a row is linear."""
        self.values[unknown] = 0.0
        self.values[unknown] = -self(row) / self(derivative(row, unknown))

    def _leaf(self, node, args):
        if node.op in {"var", "time"}:
            return self.values.setdefault(node, float(self.random.uniform(0.2, 1.1) * self.random.choice([-1, 1])))
        return self.binding.parameters.lookup(node, args)


def dense(entries, shape, point):
    found = np.zeros(shape)
    for place, node in entries.items():
        found[place] = point(node)
    return found


def rate(node):
    return ex.var(*node.data[:2], *node.args, order=1)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("name", PASSIVE)
@pytest.mark.one_in(4)
def test_the_view_has_the_rows_of_the_form(name, formulation):
    with ex.fresh():
        view, model, binding = viewed(SEED / f"{name}.sd", formulation)
        n = len(view.z)
        for seed in range(3):
            point = Point(binding, seed)
            for row in rows_of(model.form, "momentum"):  # p - dT*/df = 0, or dT/dp - f = 0
                p, f = ex.var(row.owner, "p"), ex.var(row.owner, "f")
                if row.owner in stores(model):
                    point.solve(row.expression, f)
                else:
                    point.values[p] = point(momentum(model.energies, p))
            for row in rows_of(model.form, "gamma"):
                for own in ex.variables(row.expression) - set(view.z):
                    if own.data[1:] == ("e", 0):
                        point.solve(row.expression, own)
            e, z_rate = np.array([point(x) for x in view.e]), np.array([point(rate(x)) for x in view.z])
            mass, skew, loss = (dense(m, (n, n), point) for m in (view.mass, view.skew, view.loss))
            gain = dense(view.gain, (n, len(view.u)), point)
            u = np.array([point(x) for x in view.u])
            size = np.abs(mass).max() + np.abs(skew).max() + np.abs(loss).max()
            # what makes it a port-Hamiltonian system
            assert (skew == -skew.T).all()
            assert np.abs(loss - loss.T).max() <= 1e-13 * size
            assert np.linalg.eigvalsh((loss + loss.T) / 2).min() >= -1e-13 * size
            slopes = np.array([gradient(view, model, k, point) for k in range(n)])
            assert mass.T @ e == pytest.approx(slopes, rel=1e-11, abs=1e-12 * size * np.abs(e).max())
            # the same equations
            ours = mass @ z_rate - (skew - loss) @ e - gain @ u
            scale = 1e-11 * (np.abs(mass) @ abs(z_rate) + np.abs(skew - loss) @ abs(e) + np.abs(gain) @ abs(u)).max()
            for k, node in enumerate(view.z):
                theirs = row_of(model, node)
                if theirs is not None:
                    assert ours[k] == pytest.approx(point(theirs), abs=scale), node
            # and the balance of power: z'^T E^T e = -e^T R e + e^T G u where the rows hold
            assert e @ (skew @ e) == pytest.approx(0.0, abs=1e-12 * size * (e @ e))


def stores(model):
    return {n.data[0] for t in model.energies.function("T") for n in ex.variables(t.expression) if n.data[1] == "p"}


def gradient(view, model, k, point):
    """dH/dz_k, where f is a function of p: by the momentum rows (f = dT/dp)."""
    node = view.z[k]
    if node.data[1] == "p" and node.data[0] not in stores(model):
        return point(ex.var(node.data[0], "f"))
    if node.data[1] == "q" and any(z.data[1] == "p" and z.data[0] not in stores(model) for z in view.z):
        # at fixed p: -dT*/dq + dV/dq
        parts = [(-1.0, "T*"), (1.0, "T"), (1.0, "V")]
        total = (c * point(derivative(t.expression, node)) for c, f in parts for t in model.energies.function(f))
        return sum(total)
    return point(derivative(view.energy, node))


def row_of(model, node):
    """The row of the form that a row of the view is."""
    owner, kind, _ = node.data
    if kind in ("f", "p"):
        return {r.owner: r.expression for r in rows_of(model.form, "dynamics")}[owner]
    if kind == "q":
        return ex.sub(ex.var(owner, "q", order=1), flow(model, owner))
    block = {"kappa": "phi_rate", "mu": "psi"}.get(kind)
    if block is None:
        return None
    return ex.neg({r.owner: r.expression for r in rows_of(model.form, block)}[owner])


def flow(model, owner):
    return ex.var(owner, "f")


def test_gyroscopic_efforts_are_the_curl_of_the_momenta(tmp_path):
    """A rotating frame: T* = m/2 ((x' - w y)^2 + (y' + w x)^2) has J22 = 2 m w."""
    text = """
    model frame {
      param m = 2 kg
      param w = 3 rad/s
      coord x, y: translation = 0.1 m
      energy T* = 1/2*m*((x' - w*y)^2 + (y' + w*x)^2)
      energy V = 1/2*(5 N/m)*(x^2 + y^2)
    }
    scene s of frame { time 0 s to 1 s; trace x }
    """
    with ex.fresh():
        view, _, binding = viewed(write(tmp_path, text), "lagrangian")
        skew = dense(view.skew, (4, 4), Point(binding, 0))
    assert skew[2, 3] == pytest.approx(2 * 2 * 3, rel=1e-14)
    assert skew[3, 2] == -skew[2, 3]


def test_a_store_given_by_its_momentum(tmp_path):
    """T(p) = c sqrt(p^2 + (m c)^2): p is the unknown in either form, e = dT/dp."""
    text = """
    model fast {
      param m = 2 kg
      param c = 3 m/s
      coord x: translation = 0.2 m
      energy T = c*sqrt(x.p^2 + m^2*c^2)
      energy V = 1/2*(5 N/m)*x^2
      content D = 1/2*(0.4 N.s/m)*x'^2
    }
    scene s of fast { time 0 s to 1 s; trace x }
    """
    for formulation in ("lagrangian", "hamiltonian"):
        with ex.fresh():
            view, _, binding = viewed(write(tmp_path, text), formulation)
            point = Point(binding, 0)
            x, p = (point(z) for z in view.z)
            assert view.z[1].data[1] == "p"
            assert [point(e) for e in view.e] == pytest.approx([5 * x, 3 * p / np.hypot(p, 6)], rel=1e-14)
            assert dense(view.loss, (2, 2), point) == pytest.approx(np.diag([0, 0.4]), rel=1e-14)


def test_the_printed_view(capsys):
    assert run(["equations", str(SEED / "em_suspension.sd"), "--form", "port_hamiltonian"]) == 0
    out, _ = capsys.readouterr()
    assert "H = b0 f2^2/(2 (b1 + x)) + 1/2 M f_x^2" in out
    assert "[ -1   0                  -b0 f2/(b1 + x)^2   0    0  ]" in out
    assert run(["equations", str(SEED / "dc_motor.sd"), "--form", "port_hamiltonian", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["result"]
    assert [line["symbol"] if "symbol" in line else line.get("left") for line in found["equations"]]
    for alphabet in ("--latex", "--html"):
        assert run(["equations", str(SEED / "dc_motor.sd"), "--form", "port_hamiltonian", alphabet]) == 0
        assert "J" in capsys.readouterr().out


def test_what_has_no_such_view_says_why(capsys):
    with ex.fresh(), pytest.raises(NoSuchEquations, match="effort constraint"):
        viewed(SEED / "coulomb_planar.sd", "lagrangian")
    with ex.fresh(), pytest.raises(NoSuchEquations, match="no closed form"):
        viewed(SEED / "relativistic_mass.sd", "lagrangian")
    assert run(["equations", str(SEED / "coulomb_planar.sd"), "--form", "port_hamiltonian"]) == 1
    assert "E607" in capsys.readouterr().err
