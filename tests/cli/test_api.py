"""`sysdyn.api`: the Python face."""

import numpy as np
import pytest
from sysdyn import api
from sysdyn.runtime.accuracy.accounts import Accounts
from sysdyn.runtime.accuracy.runs import Runs
from texts import ARRAY, BROKEN, FAILING, PENDULUM, STUCK, TWO_SCENES, write


@pytest.mark.long
def test_simulate_and_trace(tmp_path):
    trace = api.simulate(
        write(tmp_path, PENDULUM), accuracy=1e-6, set={"l": 2.0, "m": "900 g"}, at=[0.123, 0.5], until=1
    )
    assert trace.time[-1] == 1.0
    assert 0.123 in trace.time
    assert trace["x"].units == "m"
    assert trace["x"][0] == 1.0
    assert trace.parameters["m"] == (0.9, "kg")
    assert np.asarray(trace["y"]).shape == trace.time.shape
    again = api.Trace.open(trace.path)
    assert again.names == trace.names
    np.testing.assert_array_equal(again["x"], trace["x"])


def test_options_have_the_commands_names(tmp_path):
    path = write(tmp_path, TWO_SCENES)
    options = {
        "no_timings": True,
        "backend": "numpy",
        "formulation": "hamiltonian",
        "max_wall": 60,
        "o": tmp_path / "x.h5",
    }
    trace = api.simulate(path, scene="again", **options)
    assert "timings" not in trace.attributes
    assert trace.attributes["formulation"] == "hamiltonian"
    for wrong in ("l=2", 3, [1.0]):
        with pytest.raises(api.UsageError, match="names with their values"):
            api.simulate(path, scene="again", set=wrong)
        with pytest.raises(api.UsageError, match="names with their values"):
            api.load(path, scene="again").run(wrong)
    with pytest.raises(api.UsageError, match="colour"):
        api.simulate(path, scene="again", colour="red")
    with pytest.raises(api.UsageError, match="rtol 'fine': a number"):
        api.simulate(path, rtol="fine")
    with pytest.raises(api.UsageError, match="several scenes"):
        api.simulate(path)


def test_errors_are_raised(tmp_path):
    with pytest.raises(api.ModelError) as caught:
        api.simulate(write(tmp_path, BROKEN))
    assert caught.value.diagnostics[0].code == "E208"
    with pytest.raises(api.ModelError, match="E909"):
        api.simulate(write(tmp_path, FAILING))
    with pytest.raises(api.SolverFailure):
        api.simulate(write(tmp_path, STUCK), max_wall=20)
    with pytest.raises(FileNotFoundError):
        api.simulate("missing.sd")
    with pytest.raises(api.ModelError):
        api.compile_model(write(tmp_path, BROKEN))


def test_no_run_begins_when_the_wall_time_is_over(tmp_path, monkeypatch):
    """Runs that failed at once were followed by eleven others: 51 s of 100 000 sections where 3 s were given."""
    text = "model m { coord x: translation = 1 m; energy T* = 1/2*(1 kg)*x'^2; init x' = 0 m/s\n"
    text += "work -(1 N)*sqrt(1 - t/(1 us)) on x }\nscene s of m { time 0 s to 1 s }\n"
    begun, own = [], Runs.run
    monkeypatch.setattr(Runs, "run", lambda self, *given: (begun.append(self.method), own(self, *given))[1])
    monkeypatch.setattr(Accounts, "wall_left", lambda self: -1.0)
    with pytest.raises(api.SolverFailure, match="max_wall"):
        api.simulate(write(tmp_path, text))
    assert len(begun) == 1


@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_residual(tmp_path, backend):
    module = api.compile_model(write(tmp_path, PENDULUM), backend=backend)
    names = list(module.unknowns)
    assert [u["name"] for u in module.manifest["unknowns"]] == names
    rng = np.random.default_rng(1)
    y, ydot = rng.normal(size=len(names)), rng.normal(size=len(names))
    value = dict(zip(names, y, strict=True))
    r = module.residual(0.0, y, ydot)
    rows = [row["label"] for row in module.manifest["rows"]]
    phi = next(k for k, label in enumerate(rows) if "rod" in label)
    assert abs(r[phi]) == pytest.approx(abs(value["x"] ** 2 + value["y"] ** 2 - 2.34**2), rel=1e-12)
    changed = module.residual(0.0, y, ydot, {"l": 1.0})
    assert abs(changed[phi]) == pytest.approx(abs(value["x"] ** 2 + value["y"] ** 2 - 1.0), rel=1e-12)
    np.testing.assert_array_equal(module.residual(0.0, y, ydot), r)
    with pytest.raises(api.ModelError):
        module.residual(0.0, y, ydot, {"L": 1.0})


@pytest.mark.long
def test_backends_agree_on_residuals(tmp_path):
    for text in (PENDULUM, ARRAY):
        path = write(tmp_path, text)
        modules = [api.compile_model(path, backend=backend) for backend in ("c", "numpy")]
        n = len(modules[0].unknowns)
        rng = np.random.default_rng(2)
        y, ydot = rng.normal(size=n), rng.normal(size=n)
        one, other = (module.residual(0.3, y, ydot) for module in modules)
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12 * np.max(np.abs(one)))


@pytest.mark.long
def test_arrays_of_parameters_are_read_back(tmp_path):
    trace = api.simulate(write(tmp_path, ARRAY))
    assert trace.parameters["m[3]"] == (1.0, "kg")


def test_what_the_module_offers():
    names = {"Diagnostic", "Model", "ModelError", "Module", "NotMet", "SolverFailure", "Sweep", "Trace", "UsageError"}
    names |= {"Equilibrium", "Linearised", "NoState"}
    assert set(api.__all__) == names | {"check", "compile_model", "equilibria", "linearize", "load", "simulate"}


def test_a_trace_says_what_it_holds(tmp_path):
    trace = api.simulate(write(tmp_path, PENDULUM), until=0.1)
    assert list(trace) == list(trace.names)
    assert "x" in trace
    assert "audit/energy" in trace
    assert "/audit/energy" in trace
    assert 0 not in trace


HOSTILE = {
    "beyond doubles": 10**400,
    "thousands of digits": 10**5000,
    "nothing": None,
    "an object": object(),
    "a ragged list": [1, [2, 3]],
    "bytes": b"x",
    "complex": 1 + 2j,
    "half a character": "\ud800",
}
CALLS = {
    "set": lambda path, value: api.simulate(path, set={"m": value}),
    "all of set": lambda path, value: api.simulate(path, set=10**400 if value is None else value),
    "run": lambda path, value: api.load(path).run({"m": value}),
    "at": lambda path, value: api.load(path).run(at=[value]),
    "a number": lambda path, value: api.load(path).run(accuracy=-1 if value is None else value),
    "a name": lambda path, value: api.load(path, level={"x": value}),
    "names": lambda path, value: api.linearize(path, inputs=10**400 if value is None else value),
    "over": lambda path, value: api.load(path).sweep({"m": [value]}),
    "residual": lambda path, value: _residual(path, parameters={"m": value}),
    "t": lambda path, value: _residual(path, t="x" if value is None else value),
    "a text": lambda path, value: api.check(value if value != "\ud800" else None),
    "a path": lambda path, value: api.load(None if isinstance(value, int) else value),
}


def _residual(path, t=0.0, parameters=None):
    module = api.compile_model(path, backend="numpy")
    found = module.residual(t, module.y0, module.yd0, parameters)
    if np.isnan(found).any():
        raise api.UsageError("None is not a number, as NumPy says")


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("kind", HOSTILE)
def test_a_value_that_is_none_raises_the_errors_of_this_interface(call, kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = write(tmp_path, PENDULUM)
    with pytest.raises((api.UsageError, api.ModelError)) as caught:
        CALLS[call](path, HOSTILE[kind])
    assert 0 < len(str(caught.value)) < 300
