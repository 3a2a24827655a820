"""Where a text jumps in time: exact instants, arrays, nested arguments, caps."""

import numpy as np
import pytest
from sysdyn.compiler.binding import instants as module
from sysdyn.compiler.binding.instants import instants
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText

HEAD = "model m {{ param n = 4; param T = 0.1 s; coord x[1..n]: translation = 0 m; "
BODY = "energy T* = sum(i in 1..n: 1/2*(1 kg)*x[i]'^2); {} }}\nscene s of m {{ time 0 s to 2 s; trace x[1] }}\n"


def found(statements, t1=2.0, tables="", settings=()):
    report = Report()
    text = tables + "\n" + (HEAD + BODY).format(statements)
    with ex.fresh():
        document = load.document(SourceText("m.sd", text), report)
        network = load.network(document, document.models["m"], document.scenes["s"], report, settings)
        assert network is not None, [d.message for d in report]
        model = compile_network(network, backend="numpy")
        return instants(model.form, model.bind(), 0.0, t1, network.tables)


def test_numbers_in_their_order_each_once():
    draw = np.random.default_rng(3)
    parts = [np.array([]), draw.integers(0, 9, 40) / 3.0, np.array([-1.0, 2.0, np.inf, np.inf, -np.inf])]
    assert module.distinct(*parts).tolist() == np.unique(np.concatenate(parts)).tolist()
    assert module.distinct(np.array([])).size == 0


def apart(times):
    """The instants that are more than one (runtime/integrate/jumps/segments.py); around a sine's stand two."""
    return times[np.diff(times, prepend=-np.inf) > 1e-13 * times.max(initial=0.0)]


def on_x(effort):
    return f"work {effort} on x[1]"


@pytest.mark.parametrize(
    ("effort", "expected"),
    [
        ("(1 N)*step(t - 0.3 s)", [0.3]),
        ("(1 N)*step(0.7 s - t)", [0.7]),
        ("(if t < 0.3 s then 1 N else 2 N)", [0.3]),
        ("(if t <= 0.3 s and t > T then 1 N else 2 N)", [0.1, 0.3]),
        ("(1 N)*abs(t - 1.1 s)/(1 s)", [1.1]),
        ("(1 N)*sign(3*t - 1.5 s)", [0.5]),
        ("(1 N)*floor(t/(0.5 s))", [0.5, 1.0, 1.5, 2.0]),
        ("(1 N)*ceil(t/(0.5 s))", [0.0, 0.5, 1.0, 1.5]),
        ("(1 N)*clip(t/(1 s), 0.25, 1.25)", [0.25, 1.25]),
        ("(1 N)*smoothstep((t - 0.5 s)/(0.25 s))", [0.5, 0.75]),
        ("(1 N)*(if mod(t, 0.5 s) < 0.125 s then 1 else 0)", [0.125, 0.5, 0.625, 1.0, 1.125, 1.5, 1.625, 2.0]),
        ("f(t)", [0.25, 0.5, 1.75]),
        ("(1 N)*step(t^2/(1 s^2) - 0.5625)", [0.75]),
        ("(1 N)*step(t - T - 0.25 s)", [0.35]),
        ("(1 N)*step(t - T*x[1]/(1 m))", []),
        ("(1 N)*sin(2*pi*t/(1 s))", []),
        ("(1 N)*step(t + 1 s)", []),
        ("(if t > 0 s then 1 N else 2 N)", [0.0]),
        ("(if t >= 0 s then 1 N else 2 N)", []),
        ("(1 N)*sign(sin(2*pi*t/(3 s)))", [0.0, 1.5]),
        ("(1 N)*abs(sin(2*pi*t/(3 s)))", [1.5]),
        ("(1 N)*mod(t, 1.25 s)/(1 s)", [1.25]),
    ],
)
def test_instants_of_one_argument(effort, expected):
    table = "table f(x: s) -> N linear clamp [ (0.25, 0), (0.5, 1), (1.75, 3) ]"
    result = found(on_x(effort), tables=table)
    assert result.note is None
    times = apart(result.times)
    assert len(times) == len(expected)
    np.testing.assert_allclose(times, expected, rtol=4e-15 if "sin" in effort else 4e-16)


@pytest.mark.long
def test_affine_arguments_give_the_very_double():
    for value in (0.3, 0.1, 1e-3, 1.7000000000000002, 2 / 3):
        assert found(on_x(f"(1 N)*step(t - {value!r} s)")).times.tolist() == [value]
        assert found(on_x(f"(if t < {value!r} s then 1 N else 0 N)")).times.tolist() == [value]


@pytest.mark.parametrize("method", ["linear", "hold", "pchip"])
def test_breakpoints_of_tables(method):
    table = f"table f(x: s) -> N {method} clamp [ (0, 0), (0.5, 1), (0.75, 3), (1.5, 2) ]"
    np.testing.assert_allclose(found(on_x("f(2*t)"), tables=table).times, [0.25, 0.375, 0.75])


@pytest.mark.long
def test_arrays_are_searched_at_once_and_their_size_is_data():
    text = "for i in 1..n { work (1 N)*step(t - i*T) on x[i] }"
    assert found(text).times == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert found(text, settings=(("n", "6"),)).times == pytest.approx(0.1 * np.arange(1, 7))
    inside = "work (1 N)*sum(i in 1..n: step(t - i*T)) on x[1]"
    assert found(inside).times == pytest.approx([0.1, 0.2, 0.3, 0.4])


def test_jumps_inside_an_argument_do_not_hide_others():
    # a sampled argument whose pieces are short
    result = found(on_x("(1 N)*step(mod(t, 1 ms)/(1 ms) - 0.25)"), t1=1.0)
    assert len(result.times) == 2000  # the end is one


def test_a_fast_argument_is_sampled_until_its_zeros_are_all_there():
    result = found(on_x("(1 N)*max(0, sin(2*pi*t*(1000 Hz)))"), t1=2.0)
    times = apart(result.times)
    assert len(times) == 3999
    np.testing.assert_allclose(times, np.arange(1, 4000) / 2000, rtol=1e-12)


def test_too_many_are_none_and_said():
    result = found(on_x("(1 N)*step(mod(t, 1 us) - 0.5 us)"))
    assert result.times.size == 0
    assert str(module.MOST) in result.note


def test_unknowns_are_no_instants():
    assert found("energy V = max(0, x[1]/(1 m))*(1 J); work (1 N)*step(x[1]/(1 m)) on x[2]").times.size == 0
