"""Small parts of the commands by themselves: letters, words, curves, shapes of sources, counted work, values."""

import ctypes
import dataclasses
import io
import pickle
import sys

import numpy as np
import pytest
from sysdyn.api import load
from sysdyn.cli.equations.letters import Letter, is_letter, letter_of_name
from sysdyn.cli.golden.structures import describe_change
from sysdyn.cli.main import run
from sysdyn.cli.page import curves
from sysdyn.cli.page.source_text import block, highlight
from sysdyn.cli.progress import ProgressLine
from sysdyn.cli.report.text import section
from sysdyn.cli.run import module_check
from sysdyn.cli.run.many import memory
from sysdyn.cli.run.start.contradiction import inconsistent
from sysdyn.cli.spice import sources
from sysdyn.cli.spice.writing import UnreadableCard
from sysdyn.cli.streams import Closed, standing_streams
from sysdyn.cli.trade import work
from sysdyn.cli.trade.errors import error_of
from sysdyn.compiler.binding.sampled_rows import Points, Sample
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText
from sysdyn.runtime.comparison.arrays import Arrays
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.model.failures import InconsistentStart
from sysdyn.runtime.trace.trace import Quantity, Trace
from sysdyn.values import dataclass


@pytest.mark.parametrize(
    ("text", "letter", "one"),
    [
        ("q1", Letter("q", ("1",), 0), True),
        ("m", Letter("m", (), 0), True),
        ("alpha_k", Letter("alpha", ("k",), 0), True),
        ("th2", Letter("th", ("2",), 0), True),
        ("arm.m", Letter("m", ("arm",), 0), False),
        ("spring", Letter("spring", (), 0), False),
        ("#offset rod", Letter("c", ("rod",), 0), False),
    ],
)
@pytest.mark.one_in(5)
def test_names_are_letters_where_they_are_one(text, letter, one):
    assert letter_of_name(text) == letter
    assert is_letter(text) == one


def test_a_rate_has_dots():
    assert letter_of_name("x", 2).dots == 2


def test_words_numbers_texts_and_comments_are_marked():
    assert highlight('param m = 1.5e3 "a<b" # 2 kg') == (
        '<span class="w">param</span> m = <span class="n">1.5e3</span> '
        '<span class="s">&quot;a&lt;b&quot;</span> <span class="c"># 2 kg</span>'
    )
    assert highlight("parameter x1") == "parameter x1"  # no word of the language, no number
    assert block("model a\n\n").count("\n") == 0


def test_a_models_text_has_an_address_a_line():
    class Study:
        sources = (SourceText("m.sd", "model m {\r\n}\r"), SourceText("<lib>", "unit kg"))

    found = section(Study)
    assert 'id="L0-1"' in found
    assert 'id="L0-2"' in found
    assert "<summary>&lt;lib&gt;</summary>" in found
    assert found.index("details") > found.index("L0-2")


def test_ticks_are_round_and_tell_each_other_apart():
    assert [label for _, label in curves.ticks(0.0, 10.0, 5)] == ["0", "2", "4", "6", "8", "10"]
    labels = [label for _, label in curves.ticks(1000.0, 1000.5, 5)]
    assert len(set(labels)) == len(labels) == 6


def test_a_frame_leaves_a_margin_and_maps_its_corners():
    frame = curves.frame_around(0.0, 4.0, [np.array([0.0, 1.0])])
    assert (frame.bottom, frame.top) == (-0.05, 1.05)
    assert frame.across(0.0) == curves.LEFT
    assert frame.across(4.0) == curves.WIDTH - curves.RIGHT
    assert frame.y_pixels(frame.top) == curves.TOP
    assert frame.y_pixels(frame.bottom) == curves.HEIGHT - curves.BOTTOM
    assert curves.frame_around(0.0, 0.0, [np.ones(2)]) is None
    flat = curves.frame_around(0.0, 1.0, [np.zeros(2)])
    assert (flat.bottom, flat.top) == (-1.0, 1.0)


def test_an_outline_breaks_where_there_are_no_numbers():
    time = np.linspace(0.0, 1.0, 5000)
    values = np.where(abs(time - 0.5) < 0.1, np.nan, np.sin(40.0 * time))
    pieces = curves.outline(Arrays(time, {"x": values}), "x", 0.0, 1.0)
    assert len(pieces) == 2
    assert pieces[0][0][-1] == pytest.approx(0.4, abs=0.01)
    assert pieces[1][0][0] == pytest.approx(0.6, abs=0.01)
    assert max(y.max() for _, y in pieces) == pytest.approx(1.0, abs=1e-3)
    assert sum(y.size for _, y in pieces) <= 2 * curves.COLUMNS


def test_an_outline_of_few_rows_is_their_cubic():
    """t^2 between two rows with their rates."""
    ((x, y),) = curves.outline(Arrays([0.0, 2.0], {"x": [0.0, 4.0]}, {"x": [0.0, 4.0]}), "x", 0.0, 2.0)
    assert y == pytest.approx(x**2)


TRAN = ("A", 1e-3, 0.1)


def test_a_sine_of_a_source_begins_with_its_phase():
    found = sources.SHAPES["sin"]([1.0, 2.0, 50.0, 0.0, 0.0, 30.0], TRAN)
    assert found.expression.startswith("1 A + (2 A)*sin(2*pi*(50 Hz)*t")
    late = sources.SHAPES["sin"]([1.0, 2.0, 50.0, 10e-3], TRAN)
    assert late.expression.startswith("if t < 10 ms then 1 A else")


def test_a_pulse_of_a_voltage_is_a_component_and_of_a_current_an_expression():
    given = [0.0, 5.0, 0.0, 0.0, 2e-3, 10e-3, 20e-3]
    volts = sources.SHAPES["pulse"](given, ("V", 1e-3, 0.1))
    assert volts.component == "pulse"
    assert "rise = 1 ms" in volts.arguments  # none is given: the step of .tran
    assert "delay" not in volts.arguments
    assert "clip(" in sources.SHAPES["pulse"](given, TRAN).expression


def test_points_of_a_source_must_ascend():
    found = sources.SHAPES["pwl"]([0.0, 1.0, 1e-3, 3.0], TRAN)
    assert (found.component, found.local) == ("piecewise_current", True)
    assert found.arguments == "n = 2, at = [0 s, 1 ms], i = [1 A, 3 A]"
    for wrong in ([0.0, 1.0], [0.0, 1.0, 0.0, 2.0], [0.0, 1.0, 1.0]):
        with pytest.raises(UnreadableCard):
            sources.SHAPES["pwl"](wrong, TRAN)
    assert sources.direct(3.0, "V").expression == "3 V"


def test_an_exponential_source_rises_and_fades():
    found = sources.SHAPES["exp"]([0.0, 1.0, 1e-3, 2e-3, 5e-3, 3e-3], TRAN)
    assert "max(t - 1 ms, 0 s)/(2 ms)" in found.expression
    assert "- (1 A)*(1 - exp(-max(t - 5 ms, 0 s)/(3 ms)))" in found.expression


COUNTS = {
    "steps": 10, "rejected_steps": 2, "residual_evaluations": 30, "jacobian_evaluations": 4, "factorisations": 5,
}  # fmt: skip


def test_work_counts_steps_entries_and_rows():
    """3 unknowns, 7 entries; steps that were refused count, rows cost more where constraints bend."""
    size, bent = work.Size(3, 7, bent=False), work.Size(3, 7, bent=True)
    assert work.work_of_steps(COUNTS, size, "bdf") == 12 * (369.0 + 3 * 3.2) + 7 * 2.58 * COUNTS["residual_evaluations"]
    matrices = COUNTS["jacobian_evaluations"] + COUNTS["factorisations"]
    evaluated = 3.85 * COUNTS["residual_evaluations"] + 31.9 * matrices
    assert work.work_of_steps(COUNTS, size, "radau") == pytest.approx(12 * 3 * 8.8 + 7 * evaluated)
    assert work.work_of_rows(100, size, "radau") == pytest.approx(105000.0 + 100 * (293.0 + 12.6 * 7))
    assert work.work_of_rows(100, bent, "radau") == pytest.approx(105000.0 + 100 * (293.0 + 71.0 * 7))
    assert work.step(size, "radau") == pytest.approx(3 * 8.8 + 7 * 3.85)


def trace(time, values, events=()):
    kept = {"x": Quantity("x", np.asarray(values, dtype=float), "m", 2.0, None)}
    return Trace("", np.asarray(time, dtype=float), {}, {}, kept, tuple(events))


def test_an_error_is_relative_to_the_magnitude_of_the_reference():
    time = np.linspace(0.0, 1.0, 11)
    one, two = trace(time, np.ones(11)), trace(time, 1.02 * np.ones(11))
    assert error_of(two, one, ["x"], 1e-4, 1.0) == pytest.approx(0.01)
    assert error_of(two, one, [], 1e-4, 1.0) == 0.0
    assert error_of(trace(time, np.full(11, np.nan)), one, ["x"], 1e-4, 1.0) == np.inf


def test_events_that_are_apart_are_an_error():
    time = np.linspace(0.0, 1.0, 101)
    bounce = [trace(time, np.ones(101), [Happened(t, "hits", "ball", "", "")]) for t in (0.503, 0.505)]
    assert error_of(bounce[0], bounce[1], ["x"], 1e-4, 1.0) == pytest.approx(2e-3)
    assert error_of(bounce[0], bounce[0], ["x"], 1e-4, 1.0) == 0.0


def test_what_changed_in_a_structure_is_told_by_its_first_lines():
    assert describe_change("index", 1, 3) == "index is 3, recorded 1"
    assert describe_change("rows", ["a", "b"], ["b", "a"]) == "rows are in another order"
    assert describe_change("rows", ["a", "b"], ["b", "c", "d"]) == "rows: 'c' is new, 'a' is gone and 1 more"
    assert describe_change("rows", [["a", 1]], []) == "rows: 'a 1' is gone"


def test_a_closed_stream_is_an_error_when_something_is_said(monkeypatch):
    stream = Closed("the standard output stream")
    assert stream.write("") == 0
    with pytest.raises(OSError, match="is closed"):
        stream.buffer.write("x")
    monkeypatch.setattr(sys, "stdout", None)
    with standing_streams():
        assert isinstance(sys.stdout, Closed)
    assert sys.stdout is None


def test_a_long_forecast_is_said_once_whatever_the_mode(monkeypatch):
    said = io.StringIO()
    monkeypatch.setattr(sys, "stderr", said)
    quiet, silent = ProgressLine("auto"), ProgressLine("never")
    for _ in range(2):
        quiet(0.1, 7200.0)
        silent(0.1, 7200.0)
    assert said.getvalue().count("about 2.0 h of integration lie ahead") == 1


def test_pages_are_kept_where_the_process_ends_with_its_command(monkeypatch):
    asked = []

    class Library:
        @staticmethod
        def mallopt(option, value):
            asked.append((option, value))

    monkeypatch.setattr(ctypes, "CDLL", lambda _: Library)
    for kept in (False, True):
        monkeypatch.setattr(memory, "is_keeping", lambda kept=kept: kept)
        memory.keep_pages()
    assert asked == [(-1, -1), (-4, 0)]  # M_TRIM_THRESHOLD, M_MMAP_MAX of malloc.h


@dataclass(frozen=True, slots=True)
class Point:
    x: float
    y: float = 2.0


@dataclass(frozen=True, slots=True)
class Held:
    x: float
    own: list[float] = dataclasses.field(default_factory=list)
    kept: dict[str, float] = dataclasses.field(default_factory=dict, compare=False, repr=False)
    last: int = dataclasses.field(default=7, compare=False)


class TestValues:
    def test_they_are_frozen_and_compared_by_their_fields(self):
        one = Point(1.0)
        assert one == Point(x=1.0, y=2.0)
        assert one != (1.0, 2.0)
        assert hash(one) == hash(Point(1.0))
        assert repr(one) == "Point(x=1.0, y=2.0)"
        with pytest.raises(dataclasses.FrozenInstanceError):
            one.x = 3.0
        with pytest.raises(dataclasses.FrozenInstanceError):
            del one.x

    def test_the_standard_library_knows_them(self):
        one = Point(1.0)
        assert dataclasses.is_dataclass(one)
        assert [f.name for f in dataclasses.fields(one)] == ["x", "y"]
        assert dataclasses.replace(one, y=5.0) == Point(1.0, 5.0)
        assert dataclasses.asdict(one) == {"x": 1.0, "y": 2.0}
        assert pickle.loads(pickle.dumps(one)) == one
        with pytest.raises(TypeError):
            Point()

    def test_what_fields_say_of_themselves(self):
        """As the standard decorator reads `field`: made anew for each value, left out of comparison and text."""
        standard = dataclasses.dataclass(frozen=True, slots=True)(
            type("Held", (), {"__annotations__": dict(Held.__annotations__), **{
                "own": dataclasses.field(default_factory=list),
                "kept": dataclasses.field(default_factory=dict, compare=False, repr=False),
                "last": dataclasses.field(default=7, compare=False),
            }})
        )  # fmt: skip
        for cls in (Held, standard):
            one, two = cls(1.0), cls(1.0, kept={"a": 2.0}, last=3)
            assert one.own is not two.own
            assert one == two != cls(1.0, [2.0])
            assert repr(two) == "Held(x=1.0, own=[], last=3)"
            assert (two.kept, one.kept, one.last) == ({"a": 2.0}, {}, 7)
            assert dataclasses.replace(two, x=5.0).kept is two.kept
            assert [f.name for f in dataclasses.fields(one) if f.compare] == ["x", "own"]
        assert pickle.loads(pickle.dumps(Held(2.0, [1.0]))) == Held(2.0, [1.0])

    def test_a_default_before_a_field_without_one_is_refused(self):
        with pytest.raises(TypeError, match="default"):

            @dataclass(frozen=True, slots=True)
            class Wrong:
                x: float = 1.0
                y: float


def test_numbers_of_a_few_digits_are_no_fault_of_a_module():
    """Below the least normal number the kinetic energy of a pulse's tail, 136 or 137 times the least of all."""
    rows, least = np.arange(4), 2.0**-1074
    said = np.array([[136.0 * least, 1.0, 3e-300, 0.0]])
    found = np.array([[137.0 * least, 1.0 + 3e-9, 3e-300 * (1.0 + 1e-8), least]])
    still, fast = (Points(np.zeros(1), np.ones((1, 1)), np.full((1, 1), rate)) for rate in (0.0, 1e162))
    sample = Sample(rows, said, np.abs(said))
    assert module_check._differing_points(found, sample, still).tolist() == [[False, True, True, False]]
    assert module_check._differing_points(found, sample, fast).tolist() == [[False, True, False, False]]


def test_a_start_that_no_point_gives_numbers_for_says_what_helps(tmp_path):
    """It was told as '0 of the terms is left over in ', of nothing (entropy by H/a.e of a node at 0 K)."""
    path = tmp_path / "m.sd"
    text = "model m { coord x: translation = 1 m; energy T* = 1/2*(1 kg)*x'^2 }\n"
    path.write_text(f"{text}scene s of m {{ time 0 s to 1 s }}\n")
    report = Report()
    inconsistent(load(path)._loaded.first.prepared, 0.0, InconsistentStart("stuck", 0.0), report)
    (found,) = report
    assert (found.code, found.message) == (
        "E903", "no start was found: wherever it was sought the equations are no numbers",
    )  # fmt: skip
    assert "below a division" in found.help


def test_what_explains_that_there_is_no_start_heeds_the_limit_of_wall_time(tmp_path):
    """A start was sought for each parameter that is zero, whatever the limit: 18 s where 3 s were given."""
    path = tmp_path / "m.sd"
    text = "model m { param k = 0; coord x, y: translation ~ 1 m; energy T* = 1/2*(1 kg)*(x'^2 + y'^2)"
    text += "; work k*(1 N) on x; phi rod: x^2 + y^2 = 4 m^2 }\n"
    path.write_text(f"{text}scene s of m {{ time 0 s to 1 s }}\n")
    prepared = load(path)._loaded.first.prepared
    for until, said in ((None, "with k = 0 there is no start"), (0.0, "no start was found")):
        report = Report()
        inconsistent(prepared, 0.0, InconsistentStart("stuck", 0.0), report, until)
        (found,) = report
        assert said in found.message


def test_where_constraints_are_redundant_check_says_how_many(tmp_path, capsys):
    """It said 'index None': the form as written has none."""
    path = tmp_path / "m.sd"
    text = "model m { coord x, y: translation = 0 m; energy T* = 1/2*(1 kg)*(x'^2 + y'^2); phi a: x = y\n"
    text += "phi b: 2*x = 2*y }\n"
    path.write_text(f"{text}scene s of m {{ time 0 s to 1 s; redundancy drop; trace x }}\n")
    assert run(["check", str(path)]) == 0
    assert capsys.readouterr().err.endswith("ok: coordinates 2, m1 2, m2 0, dof 1, 1 redundant\n")
