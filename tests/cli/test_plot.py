"""`sysdyn plot`: pictures that are the same each time, and names that are not there."""

from pathlib import Path

import numpy as np
import pytest
from sysdyn.cli.failures import UsageError
from sysdyn.cli.main import run
from sysdyn.cli.page.panels import abbreviate, curve, in_order, panels_of, styled_curves, unit_text
from sysdyn.cli.page.sparkline import sparkline, told_apart
from sysdyn.runtime.trace.trace import Quantity, Trace
from texts import PENDULUM, write


@pytest.fixture
def traces(tmp_path):
    path = write(tmp_path, PENDULUM)
    assert run(["simulate", "-q", path, "-o", "a.h5"]) == 0
    assert run(["simulate", "-q", path, "-o", "b.h5", "--set", "l=1.4 m"]) == 0


def made(traces):
    """A trace of (name, unit, values)."""
    time = np.linspace(0.0, 1.0, 11)
    data = {n: Quantity(n, np.asarray(v(time)), u, None, None) for n, u, v in traces}
    return Trace("made.h5", time, {}, {}, data)


@pytest.mark.usefixtures("traces")
@pytest.mark.long
def test_pictures(capsys):
    assert run(["plot", "a.h5"]) == 0
    assert Path("a.png").read_bytes().startswith(b"\x89PNG\r\n")
    assert "a.png: speed, x, y" in capsys.readouterr().err
    assert run(["plot", "a.h5", "x", "audit/energy", "-o", "one.svg"]) == 0
    text = Path("one.svg").read_text()
    assert "audit.energy" in text
    assert "time, s" in text
    assert "swing of pendulum" in text
    assert "speed" not in text
    assert run(["plot", "a.h5", "b.h5", "x", "-o", "two.svg"]) == 0
    assert ">b<" in Path("two.svg").read_text()


@pytest.mark.usefixtures("traces")
def test_a_summary_without_a_file(capsys):
    assert run(["plot", "a.h5", "b.h5", "x", "speed"]) == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.split() == ["quantity", "unit", "min", "max", "0", "to", "1", "s"]
    assert [line.split()[:3] for line in lines] == [
        [name, label, unit] for name, unit in (("x,", "m"), ("speed,", "m/s")) for label in "ab"
    ]
    assert all(len(line) <= 100 for line in lines)
    assert run(["plot", "-q", "a.h5"]) == 0
    assert run(["plot", "a.h5", "-o", "a.svg"]) == 0
    assert capsys.readouterr().out == ""


def test_a_quotient_is_found_as_it_is_written():
    trace = made([("v\u2215(2 V)", "1", lambda t: t), ("v", "V", lambda t: 2.0 * t)])
    assert trace["v/(2 V)"].values[-1] == 1.0
    assert "v/(2 V)" in trace
    with pytest.raises(KeyError, match="v/w"):
        trace["v/w"]


def test_sparklines():
    time = np.linspace(0.0, 1.0, 5)
    assert sparkline(time, time, 0.0, 1.0, 8) == "▁▂▃▄▅▆▇█"
    assert sparkline(time, 0.0 * time + 3.0, 0.0, 1.0, 4) == "▅▅▅▅"
    assert sparkline(time, time, 0.0, 2.0, 8) == "▁▃▅▇█   "
    assert sparkline(time, time * np.nan, 0.0, 1.0, 8) == ""
    spike = np.where(np.arange(10_001) == 5000, 9.0, 0.0)
    assert max(sparkline(np.linspace(0.0, 1.0, 10_001), spike, 0.0, 1.0, 20)) > "▁"


@pytest.mark.usefixtures("traces")
@pytest.mark.parametrize("kind", ["png", "svg", "html"])
@pytest.mark.long
def test_the_same_trace_gives_the_same_bytes(kind):
    for name in ("one", "two"):
        assert run(["plot", "-q", "a.h5", "-o", f"{name}.{kind}"]) == 0
    assert Path(f"one.{kind}").read_bytes() == Path(f"two.{kind}").read_bytes()


@pytest.mark.usefixtures("traces")
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a.h5", "sped"], "nearest: 'speed'"),
        (["a.h5", "qqqqq"], "there are: "),
        (["a.h5", "-o", "a.pdf"], "a picture is one of .png, .svg, .html"),
        (["a.h5", "-o", "a"], "a picture is one of .png, .svg, .html"),
    ],
)
@pytest.mark.one_in(2)
def test_wrong_usage(arguments, said, capsys):
    assert run(["plot", *arguments]) == 2
    assert said in capsys.readouterr().err
    assert sorted(p.suffix for p in Path().iterdir()) == [".h5", ".h5", ".sd"]


def test_unreadable_files(tmp_path, capsys):
    assert run(["plot", "none.h5"]) == 5
    assert "none.h5: No such file or directory" in capsys.readouterr().err
    Path("text.h5").write_text("not HDF5")
    assert run(["plot", "text.h5"]) == 5
    assert "text.h5" in capsys.readouterr().err
    assert run(["plot", "."]) == 5


@pytest.mark.usefixtures("traces")
def test_a_picture_into_no_folder(capsys):
    assert run(["plot", "a.h5", "-o", "no/such.png"]) == 5


def test_layout_of_panels():
    trace = made(
        [
            ("a", "m", np.sin),
            ("b", "m", np.cos),
            ("far", "m", lambda t: 50.0 + np.sin(t)),
            ("force", "N", np.sin),
            ("flat", "m", lambda t: 0.0 * t + 0.5),
            ("tiny", "m", lambda t: 1e-3 * np.sin(t)),
        ]
    )
    names = [panel.names for panel in panels_of([trace], trace.names)]
    assert names == [["a", "b"], ["far"], ["force"], ["flat"], ["tiny"]]


@pytest.mark.long
def test_names_and_values_that_are_hard_to_draw(tmp_path):
    trace = made(
        [
            ("_hidden", "m", np.sin),
            ("$x^2$", "m", np.cos),
            ("угол", "1", np.sin),
            ("距離", "m", np.sin),
            ("nothing", "V", lambda t: t * np.nan),
            ("endless", "V", lambda t: np.where(t > 0.5, np.inf, t)),
        ]
    )
    from sysdyn.cli.page.picture import picture

    text = picture([("made", trace)], trace.names, "svg").decode()
    assert "_hidden" in text
    assert "$x^2$" in text
    assert "угол" in text


def test_an_empty_trace_can_be_drawn():
    trace = Trace("empty.h5", np.zeros(0), {"final": 0}, {}, {"x": Quantity("x", np.zeros(0), "m", 1.0, np.zeros(0))})
    from sysdyn.cli.page.picture import picture

    assert picture([("empty", trace)], ["x"], "png").startswith(b"\x89PNG")


def test_ends_of_a_range_are_told_apart():
    assert told_apart(999.998, 1000.0) == ("999.998", "1000")
    assert told_apart(1e6, 1e6 + 1.0) == ("1000000", "1000001")
    assert told_apart(2.0, 2.0) == ("2", "2")
    assert told_apart(0.123456789, 0.2) == ("0.12346", "0.2")


@pytest.mark.long
def test_many_quantities():
    trace = made([(f"x{k}", f"m{k}", np.sin) for k in range(2, 19)])
    from sysdyn.cli.page.picture import picture

    assert picture([("made", trace)], trace.names, "png").startswith(b"\x89PNG")


def test_many_curves_of_a_panel_can_be_told_apart():
    trace = made([(f"x[{k}]", "m", np.sin) for k in range(1, 15)])
    names = in_order(sorted(trace.names))
    assert names[:3] == ["x[1]", "x[2]", "x[3]"]
    (panel,) = panels_of([trace], names)
    for traces in ([("one", trace)], [("one", trace), ("two", trace)]):
        drawn = [(colour, dashes) for *_, colour, dashes in styled_curves(panel, traces)]
        assert len(set(drawn)) == len(drawn) == 14 * len(traces)
    assert abbreviate("a" * 30 + "b" * 30, 12) == "aaaaaaa…bbbb"
    assert abbreviate("short", 12) == "short"


def test_traces_in_other_units_share_an_axis():
    """What is drawn beside millimetres is in millimetres, and seconds are not drawn there."""
    small, large = made([("x", "mm", lambda t: 1e3 * t)]), made([("x", "m", lambda t: 2.0 * t)])
    (panel,) = panels_of([small, large], ["x"])
    assert (panel.unit, panel.high) == ("mm", pytest.approx(2e3 * large.time[-1]))
    np.testing.assert_allclose(curve(large, "x", panel.unit)[1], 2e3 * curve(large, "x")[0])
    with pytest.raises(UsageError, match=r"'x' is in s in .*, in mm in another trace"):
        panels_of([small, made([("x", "s", np.sin)])], ["x"])


def test_curves_are_hermite_interpolants():
    time = np.linspace(0.0, 3.0, 7)
    data = {"x": Quantity("x", time**3, "m", None, 3.0 * time**2)}
    fine, values = curve(Trace("cubic.h5", time, {}, {}, data), "x")
    assert fine.size > 500
    np.testing.assert_allclose(values, fine**3, atol=1e-12)


def test_curves_between_jumps_are_interpolants_too():
    """A sine in steps of unequal length, thrown to its negative at 2 s: between the rows of the jump it is upright."""
    time = np.concatenate([np.linspace(0.0, 0.1, 50), np.arange(0.5, 2.1, 0.5), [2.0], np.arange(2.5, 4.1, 0.5)])
    sign = np.where(np.arange(time.size) < np.flatnonzero(np.diff(time) == 0.0)[0] + 1, 1.0, -1.0)
    data = {"x": Quantity("x", sign * np.sin(2.0 * time), "m", None, sign * 2.0 * np.cos(2.0 * time))}
    fine, values = curve(Trace("thrown.h5", time, {}, {}, data), "x")
    away = fine != 2.0
    wanted = np.where(fine < 2.0, 1.0, -1.0) * np.sin(2.0 * fine)
    np.testing.assert_allclose(values[away], wanted[away], atol=4e-3)  # straight lines: 0.12
    assert values.max() > 0.998
    assert np.isin(time, fine).all()


@pytest.mark.parametrize(
    ("unit", "text"),
    [("1", ""), ("N.m", "N·m"), ("m/s^2", "m/s²"), ("V^-1", "V⁻¹"), ("kg.m2.s-2", "kg·m²·s⁻²"), ("(mm)/s", "(mm)/s")],
)
def test_units(unit, text):
    assert unit_text(unit) == text


@pytest.mark.usefixtures("traces")
@pytest.mark.parametrize(("size", "said"), [(None, "this is no HDF5 file"), (3000, "it is cut short")])
@pytest.mark.long
def test_what_is_no_trace_is_told_as_that(tmp_path, capsys, size, said):
    """HDF5's own words were 'Unable to synchronously open file'."""
    content = (tmp_path / "a.h5").read_bytes()
    (tmp_path / "c.h5").write_bytes(b"model m {}" if size is None else content[:size])
    for command in (["plot", "c.h5"], ["diff", "a.h5", "c.h5"]):
        assert run(command) == 5
        assert capsys.readouterr().err == f"sysdyn: c.h5: not readable as a trace: {said}\n"
