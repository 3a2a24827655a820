"""Small rooms of the command line by themselves."""

from types import SimpleNamespace

import pytest
from sysdyn.cli.failures import UsageError
from sysdyn.cli.memory_limit import LEAST, TooLittle
from sysdyn.cli.page.columns import align, fit_columns
from sysdyn.cli.page.figure_sources import destination, label, quantities


def test_a_process_without_room_for_numpy_is_told_how_much_it_takes():
    with pytest.raises(MemoryError, match=r"numpy needs 166 MB, 64 MB are allowed"):
        TooLittle(64 * 1024**2).find_spec("numpy")
    assert TooLittle(LEAST - 1).find_spec("json") is None


def test_a_picture_is_called_as_its_trace_and_goes_where_it_is_asked():
    console = SimpleNamespace(as_json=False)
    assert label("runs/pendulum-swing.h5") == "pendulum-swing"
    assert label("-") == "stdin"
    assert destination("runs/a.h5", None, console, (".png", ".svg"), "a plot") == ("a.png", ".png")
    assert destination("a.h5", "b.SVG", console, (".png", ".svg"), "a plot") == ("b.SVG", ".svg")
    assert destination("a.h5", "-", console, (".png", ".svg"), "a plot") == ("-", ".png")
    with pytest.raises(UsageError, match=r"a plot is one of \.png, \.svg"):
        destination("a.h5", "b.pdf", console, (".png", ".svg"), "a plot")


class Kept(dict):
    """A trace of names alone."""

    path = "t.h5"

    @property
    def names(self):
        return [name for name in self if not name.startswith("audit")]


def test_quantities_are_those_asked_for_each_once_and_meters_by_either_spelling():
    trace = Kept.fromkeys(["x", "v", "audit.energy"])
    assert quantities([trace], ["v", "audit/energy", "audit.energy", "x", "v"]) == ["v", "audit.energy", "x"]
    assert set(quantities([trace], [])) == {"x", "v"}
    with pytest.raises(UsageError, match=r"t\.h5 has no quantity 'w'; (nearest|there are)"):
        quantities([trace], ["w"])


def test_a_table_leaves_out_what_a_terminal_has_no_room_for():
    rows = [["", "name", "work", "drift", ""], [">", "radau", "1.2e6", "1e-12", "chosen"]]
    assert fit_columns(rows, ("drift", "work"), None) == (rows, "")
    assert fit_columns(rows, ("drift", "work"), 30) == (rows, "")
    assert fit_columns(rows, ("drift", "work"), 29)[0] == [["", "name", "work", ""], [">", "radau", "1.2e6", "chosen"]]
    assert fit_columns(rows, ("drift", "work"), 10)[1] == "10 columns have no room for drift; work"
    assert max(map(len, align(rows).split("\n"))) == 30
