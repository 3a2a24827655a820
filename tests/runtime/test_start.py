import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.failures import InconsistentStart
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start
from sysdyn.runtime.structure.order import freedom

# rows 0 of descriptor_values.json
REFERENCES = {
    "pendulum": (
        models.pendulum,
        {"q_x": 0.4063367357, "q_y": -2.304450142, "f_x": 0, "f_y": 0, "kappa_rod": 2.332668672},
        {"f_x": -1.677608803, "f_y": -0.295807695},
    ),
    "slider_crank": (
        models.slider_crank,
        {
            "q_3": 2.577935475,
            "f_2": 1.414213562,
            "f_3": -1.948736046,
            "kappa_crank": 2.298092371,
            "kappa_rod": 0.3622568847,
        },
        {"f_1": -1.894552251, "f_2": -3.762301999, "f_3": -1.694301436},
    ),
    "pendulum_spring": (
        models.pendulum_spring,
        {"q_1": 1.917702154, "q_2": -4.810330248, "kappa_rod": 2.777516448},
        {"f_1": -5.326449276, "f_2": -0.06, "f_3": 2.849852501},
    ),
    "nonlinear_fluid": (
        models.nonlinear_fluid,
        {"f_1": 0.4472135955, "f_2": -0.894427191, "f_3": -0.4472135955, "kappa_tank": -800000},
        {},
    ),
    "fluid_tank": (
        models.fluid_tank,
        {"f_1": 0.5, "f_2": 0.1666666667, "f_3": 0.3333333333, "kappa_tank": 0.6666666667},
        {"f_1": 0.5},
    ),
    "dc_motor": (models.dc_motor, {"e_1": 0, "e_2": 0}, {"f_c": 600, "f_a": 0}),
}


def started(made, t0=0.0):
    manifest, binding, module = made
    system = System(manifest, binding, load(module))
    return system, consistent_start(system, t0)


@pytest.mark.parametrize("name", REFERENCES)
@pytest.mark.long
def test_consistent_values_of_the_seed(name):
    make, values, rates = REFERENCES[name]
    system, state = started(make())
    names = system.unknown_names
    for unknown, value in values.items():
        assert state.y[names.index(unknown)] == pytest.approx(value, rel=2e-9, abs=1e-12), unknown
    for unknown, value in rates.items():
        assert state.yd[names.index(unknown)] == pytest.approx(value, rel=2e-9, abs=1e-12), unknown
    assert state.residual < 1e-11
    assert np.abs(system.residual(0.0, state.y, state.yd)).max() < 1e-8 * max(1.0, np.abs(state.y).max())


@pytest.mark.long
def test_guesses_move_and_say_for_whom_fixed_values_do_not():
    system, state = started(models.slider_crank())
    moved = {name: (before, after, why) for name, before, after, why in state.moved}
    assert set(moved) == {"q_2", "q_3", "f_2"}
    assert moved["q_2"][0] == 0.7
    assert "phi crank" in moved["q_2"][2]
    for item in system.description.initial:
        if item.fixed:
            place = system.form.at[item.family]
            assert state.y[place] == item.values[0]


def test_guess_moves_least():
    # two guesses, one row: the nearest point of the circle
    made = models.small(
        "x y",
        "f_x**2 + f_y**2",
        phi={"rod": "q_x**2 + q_y**2 - 1"},
        initial={"q_x": (0.6, False), "q_y": (1.2, False)},
    )
    system, state = started(made)
    places = [system.unknown_names.index(name) for name in ("q_x", "q_y")]
    nearest = np.array([0.6, 1.2]) / np.hypot(0.6, 1.2)
    assert np.linalg.norm(state.y[places]) == pytest.approx(1.0, abs=1e-12)
    assert np.abs(state.y[places] - nearest).max() < 0.05
    assert freedom(system, state)[0] == 2


def test_contradicting_fixed_values_are_named():
    made = models.small(
        "x y",
        "f_x**2 + f_y**2",
        phi={"rod": "q_x**2 + q_y**2 - 1"},
        initial={"q_x": (0.9, True), "q_y": (0.9, True), "f_x": (0, True)},
    )
    with pytest.raises(InconsistentStart) as caught:
        started(made)
    assert caught.value.kind == "fixed"
    assert caught.value.rows[0].label == "rod"
    assert {label.label for label in caught.value.candidates} <= {"q_x", "q_y"}
    assert caught.value.candidates
    assert 0.01 < caught.value.residual < 2.0


def test_effort_constraint_without_solution_is_named():
    made = models.small(
        "x",
        "f_x**2",
        work={"x": "e_g"},
        implicit=("g",),
        gamma={"load": "e_g**2 + 3.1 + f_x**2"},
        initial={"q_x": (0, True)},
    )
    with pytest.raises(InconsistentStart) as caught:
        started(made)
    assert caught.value.kind == "gamma"
    assert caught.value.rows[0].label == "load"
    assert caught.value.residual == pytest.approx(3.1, rel=1e-3)


@pytest.mark.long
def test_valve_at_rest_and_diode_that_overflows():
    _, state = started(models.nonlinear_fluid())
    assert state.residual < 1e-11
    # a diode driven far beyond exp's range from a guess of zero, and from one that overflows
    for guess in (0.0, 40.0):
        made = models.small(
            "c",
            "0",
            content="f_c**2/2",
            work={"c": "100 - e_d"},
            implicit=("d",),
            gamma={"diode": "f_c - 1e-14*(exp(e_d/0.025) - 1)"},
            initial={"e_d": (guess, False)},
        )
        system, state = started(made)
        voltage = state.y[system.unknown_names.index("e_d")]
        assert voltage == pytest.approx(0.025 * np.log((100 - voltage) / 1e-14 + 1), rel=1e-9)


@pytest.mark.long
def test_redundant_rows_are_tolerated():
    made = models.small(
        "x y",
        "f_x**2/2 + f_y**2/2",
        work={"y": "-9.81"},
        phi={"one": "q_x**2 + q_y**2 - 1", "two": "2*(q_x**2 + q_y**2 - 1)"},
        initial={"q_x": (np.sin(1), True), "q_y": (-0.5, False), "f_x": (0, True)},
    )
    system, state = started(made)
    assert state.y[system.unknown_names.index("q_y")] == pytest.approx(-np.cos(1), abs=1e-12)
    kappa = [state.y[system.unknown_names.index(name)] for name in ("kappa_one", "kappa_two")]
    assert kappa[0] + 2 * kappa[1] == pytest.approx(9.81 * np.cos(1) / 2, rel=1e-10)


@pytest.mark.long
def test_missing_fixed_values_are_counted():
    manifest, binding, module = models.pendulum()
    binding["initial"] = [item for item in binding["initial"] if item["family"] != "f_x"]
    system = System(manifest, binding, load(module))
    number, guesses = freedom(system, consistent_start(system, 0.0))
    assert number == 1
    assert "f_x" in guesses


@pytest.mark.long
def test_junction_currents_of_1e_12_at_the_guess():
    # seed system ebers_moll: the guess's currents are 1e-12 A, the start's 1.6e-3 A
    made = models.small(
        "1 2",
        "0",
        content="1000*f_1**2/2 + 4700*f_2**2/2",
        work={"1": "1.6 - e_1", "2": "-10 - e_2"},
        implicit=("1", "2"),
        gamma={"emitter": "e_1 - s_e", "collector": "e_2 - s_c"},
        states={
            "e": "(f_1 - 1e-12*(exp(s_e/0.026) - 1) + 0.495*2e-12*(exp(s_c/0.026) - 1))/1e-7",
            "c": "(f_2 + 0.99e-12*(exp(s_e/0.026) - 1) - 2e-12*(exp(s_c/0.026) - 1))/2e-8",
        },
        initial={"s_e": (0, True), "s_c": (-10, True), "e_2": (-10, False)},
        intangible=("1", "2"),
    )
    system, state = started(made)
    values = dict(zip(system.unknown_names, state.y, strict=True))
    assert values["f_1"] == pytest.approx(1.6e-3, rel=1e-12)
    assert values["e_2"] == pytest.approx(-10.0, rel=1e-12)
    assert abs(values["f_2"]) < 1e-15
