"""A slice of the random rectifiers; the whole is `python tests/events/ideal_rectifiers.py`."""

import re

import numpy as np
import pytest
from ideal_rectifiers import APART, Circuit, apart, voltage
from sysdyn.api import simulate


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 6, 8, 14, 22, 38, 42, 45, 48])
@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_a_run_and_one_by_the_bdf_agree(seed, tmp_path):
    assert apart(tmp_path, seed)[0] < 0.1 * APART


@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_a_charge_that_is_round_off_does_not_stop_a_run(tmp_path):
    """That of a diode which blocks from the start, beside 0.07 C, asked steps of 1e-19 s (E930)."""
    file = tmp_path / "m.sd"
    file.write_text(Circuit(10).text)
    first, second = (
        voltage(simulate(file, output=tmp_path / "a.h5", method=method, rtol=1e-8)) for method in ("radau", "bdf")
    )
    assert np.abs(first - second).max() < 1e-5 * np.abs(second).max()


FORMULATIONS = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian")


def _stores(folder, seed, formulation):
    """Voltages of capacitors and currents of coils at the start."""
    kinds = re.findall(r"(E\d+): (capacitor|inductor)", Circuit(seed).text)
    names = [f"{name}.e" if kind == "capacitor" else f"{name}.f" for name, kind in kinds]
    file = folder / "m.sd"
    file.write_text(re.sub("trace E[0-9]+.e as v", "trace " + ", ".join(names), Circuit(seed).text))
    found = simulate(file, output=folder / "a.h5", formulation=formulation, until="1 us", rtol=1e-4, unmet="warn")
    return np.array([found[name].values[0] for name in names])


@pytest.mark.parametrize(
    ("seed", "charged", "formulations"),
    [
        pytest.param(17, (), FORMULATIONS, marks=pytest.mark.long),
        (33, (), FORMULATIONS[2:]),  # E516, and a run that stops, in the others
        (34, (), FORMULATIONS),
        (36, (), FORMULATIONS),
        (23, (0.0, 137.732733), FORMULATIONS),
        (5, (0.0, 0.0, 200.787371, 0.0, 200.787371), FORMULATIONS[2:]),
        (27, (0.0, 0.0, 0.0, 141.819891), FORMULATIONS[2:]),
        (98, (0.0, 353.084628, 353.084628), FORMULATIONS[2:]),
        (149, (), FORMULATIONS[2:]),
    ],
)
@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_stores_begin_as_guessed_in_every_formulation(seed, charged, formulations, tmp_path):
    """But where an ideal source charges one through its diodes (23).  17 began with 9445 A in coils and 40 kV, 33 with
    494 V, 23 with 171 V on a capacitor behind a resistor, each in the complementary forms and told as met; 5, 98, 149
    were 50 to 240 V off: sets behind impulses had no start, milliohms charge in 0.2 us, round-off passed for rates.
    """
    for formulation in formulations:
        found = _stores(tmp_path, seed, formulation)
        aim = np.zeros(found.size)
        aim[: len(charged)] = charged
        assert np.abs(found - aim).max() < 1e-4, formulation


@pytest.mark.parametrize("seed", [4, 11, 26, 39])
@pytest.mark.filterwarnings("ignore")
@pytest.mark.one_in(5)
def test_six_digits(seed, tmp_path):
    """Behind an event inductors that megaohms tie move within 1e-9 s: values between the ends of the next steps
    followed the slopes of that motion (the ledger was off by 2e-2 J), sizes of currents were those of their first
    slopes, and a current that follows a resistor was off within steps that the error at their ends had passed.
    """
    file = tmp_path / "m.sd"
    file.write_text(Circuit(seed).text.replace("1e-4", "1e-6"))
    found = simulate(file, output=tmp_path / "a.h5")
    assert found.met
    other = voltage(simulate(file, output=tmp_path / "b.h5", method="bdf", rtol=1e-7, unmet="warn"))
    assert np.abs(voltage(found) - other).max() < 1e-5 * np.abs(other).max()


@pytest.mark.parametrize(
    ("seed", "accuracy", "end"),
    [(34, "1e-6", "14 ms"), pytest.param(20, "1e-4", "25 ms", marks=pytest.mark.one_in(4))],
)
@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_a_set_that_turning_one_after_the_other_does_not_find(seed, accuracy, end, tmp_path):
    """A source that two diodes short, six of whose neighbours must turn at once; a leak through a megohm that goes
    backwards through the one set of diodes while the other has a forward voltage (E930).
    """
    file = tmp_path / "m.sd"
    file.write_text(Circuit(seed).text.replace("1e-4", accuracy).replace("50 ms", end))
    found = simulate(file, output=tmp_path / "a.h5")
    assert found.met
    other = voltage(simulate(file, output=tmp_path / "b.h5", method="bdf", unmet="warn"))
    assert np.abs(voltage(found) - other).max() < 10.0 * float(accuracy) * np.abs(other).max()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_what_relaxes_at_once_behind_an_event_is_followed(tmp_path):
    """A diode that conducts 1.9 ns behind one that blocks, on the way of a leak, was found 1500 ns behind it, where the
    first stage of radau's step lay: 1.4e-4 of the largest voltage, told as 4.5e-5.
    """
    file = tmp_path / "m.sd"
    file.write_text(Circuit(13).text.replace("50 ms", "14 ms"))
    found = simulate(file, output=tmp_path / "a.h5", rtol=2.5e-6, method="radau")
    other = simulate(file, output=tmp_path / "b.h5", rtol=1e-8, method="bdf")
    times = [one.events[-1].time for one in (found, other)]  # of one of two diodes in series, whichever
    assert times[0] == pytest.approx(times[1], abs=1e-9)  # half a relaxation of the leak
    assert np.abs(voltage(found) - voltage(other)).max() < 5e-6 * np.abs(voltage(other)).max()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_what_follows_from_states_by_a_leak_tells_no_event_by_their_slopes(tmp_path):
    """Two coils whose currents differ by that of a megohm: potentials that followed from what slopes left between them
    put events up to 37 us late, of 134 in the place of 64, and voltages 1e-3 to 1e-4 off at tolerances to 1e-8.
    """
    file = tmp_path / "m.sd"
    file.write_text(Circuit(40).text)
    other = simulate(file, output=tmp_path / "b.h5", method="bdf", rtol=1e-7)
    found = simulate(file, output=tmp_path / "a.h5", method="radau", rtol=1e-6)
    assert len(found.events) < 1.2 * len(other.events)
    assert np.abs(voltage(found) - voltage(other)).max() < 2e-5 * np.abs(voltage(other)).max()
    asked = simulate(file, output=tmp_path / "a.h5")
    assert asked.met
    assert np.abs(voltage(asked) - voltage(other)).max() < 5e-5 * np.abs(voltage(other)).max()


@pytest.mark.parametrize("rtol", [1e-7, pytest.param(1e-8, marks=pytest.mark.one_in(4))])
@pytest.mark.filterwarnings("ignore")
@pytest.mark.one_in(2)
def test_rates_of_a_step_of_no_time_are_no_sizes(rtol, tmp_path):
    """Behind them rates that followed counted as met with residuals of 21 V, and the energy was off by 2100 J."""
    file = tmp_path / "m.sd"
    file.write_text(Circuit(40).text)
    other = simulate(file, output=tmp_path / "b.h5", method="bdf", rtol=1e-8)
    found = simulate(file, output=tmp_path / "a.h5", method="radau", rtol=rtol)
    # which of two diodes in a row turns at the begin is a matter of round-off
    assert [e.time for e in found.events] == pytest.approx([e.time for e in other.events], abs=1e-8)
    assert found.met
    assert np.abs(voltage(found) - voltage(other)).max() < 2e-6 * np.abs(voltage(other)).max()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_a_draft_finds_the_turn_of_what_a_leak_carries(tmp_path):
    """A millionth of the largest current was none in a draft: a diode that a megohm feeds turned a thousand volts late,
    60 times back and forth; of another net it went on for ever (58, stopped by its 30 s).
    """
    file = tmp_path / "m.sd"
    file.write_text(Circuit(1021).text)
    found = simulate(file, output=tmp_path / "a.h5")
    assert found.met
    other = simulate(file, output=tmp_path / "b.h5", method="bdf", rtol=1e-7)
    assert len(found.events) <= 1.1 * len(other.events)
    assert np.abs(voltage(found) - voltage(other)).max() < 1e-5 * np.abs(voltage(other)).max()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_a_source_that_is_zero_is_not_shorted_by_all_diodes(tmp_path):
    """Where a source without impedance goes through zero all four of its bridge may conduct, at that instant alone: the
    rate of its voltage is met by none of such points (singular).
    """
    file = tmp_path / "m.sd"
    file.write_text(Circuit(56).text.replace("50 ms", "15 ms"))
    found = simulate(file, output=tmp_path / "a.h5")
    assert found.met
    other = simulate(file, output=tmp_path / "b.h5", method="bdf", rtol=1e-7, unmet="warn")
    assert np.abs(voltage(found) - voltage(other)).max() < 5e-5 * np.abs(voltage(other)).max()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_rates_that_are_round_off_do_not_tell_two_sets_apart(tmp_path):
    """A bridge whose capacitor is empty conducts in all its diodes, and one lets go for what circles there; beside
    rates of nothing but round-off none of them seemed to go on alike (singular, E931, or not met).
    """
    file = tmp_path / "m.sd"
    text = Circuit(69).text.replace("time 0 s to 50 ms", "time 16 ms to 18 ms").replace("0.5 ms", "0.1 ms")
    file.write_text(text.replace("1e-4", "1e-5"))
    found = simulate(file, output=tmp_path / "a.h5")
    assert found.met
    by_the_bdf = [967.75772, 972.72563, 947.04134, 943.0156, 931.77943]  # at 1e-7
    at = np.interp([16.5e-3, 17e-3, 17.6e-3, 17.7e-3, 18e-3], found.time, found["v"].values)
    assert np.abs(at - by_the_bdf).max() < 1e-5 * by_the_bdf[0]


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
def test_no_event_of_a_polynomial(tmp_path):
    """A leak's transient of 1e-10 s within a first step of 5e-8: between 378 V and 4 V the polynomial of radau's stages
    lay at -28 kV, and diodes chattered (7000 events).
    """
    file = tmp_path / "m.sd"
    file.write_text(Circuit(27).text.replace("50 ms", "4.2 ms"))
    found = simulate(file, output=tmp_path / "a.h5", max_wall=100.0)
    other = simulate(file, output=tmp_path / "b.h5", method="bdf", accuracy=1e-5)
    assert np.abs(voltage(found) - voltage(other)).max() < 1e-4 * np.abs(voltage(other)).max()
    assert len(found.events) < 3 * len(other.events)


def test_the_same_for_ever():
    assert Circuit(5).text == Circuit(5).text
    assert len({Circuit(seed).text for seed in range(60)}) == 60


def test_what_floating_nodes_have_in_common_makes_no_sizes(tmp_path):
    """They begin at 1e12 V/s, which moves nothing: of sizes of 800 kA leaks turned diodes every 20 ns."""
    file = tmp_path / "model.sd"
    file.write_text(Circuit(24).text.replace("50 ms", "2 ms"))
    one, other = (simulate(file, output=tmp_path / f, formulation=f, max_wall=20.0) for f in FORMULATIONS[::2])
    assert other.statistics["steps"] < 1000
    assert np.abs(voltage(one) - voltage(other)).max() < 2e-4 * np.abs(voltage(one)).max()
