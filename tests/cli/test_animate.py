"""`sysdyn animate`: what plays is the motion of the trace."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from sysdyn.cli.main import run
from sysdyn.cli.page import animation
from sysdyn.runtime.trace.trace import Quantity, Trace

TEXT = """model arms {
  coord a: rotation = 2 rad
  coord b: rotation = 1 rad
  let x1 = 1 m*sin(a)
  let y1 = -1 m*cos(a)
  let x2 = x1 + 0.5 m*sin(b)
  let y2 = y1 - 0.5 m*cos(b)
  energy T* = 1/2*(1 kg)*(x1'^2 + y1'^2 + x2'^2 + y2'^2)
  energy V = (1 kg)*g0*(y1 + y2)
}
scene s of arms { time 0 s to 3 s; trace x1, y1 in mm as y1, x2, y2, a }
"""
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(autouse=True)
def trace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("m.sd").write_text(TEXT)
    assert run(["simulate", "-q", "m.sd", "--accuracy", "1e-6", "-o", "t.h5"]) == 0


def frames(element, attribute):
    (found,) = [a for a in element.iter(f"{SVG}animate") if a.get("attributeName") == attribute]
    assert found.get("dur") == "3s"
    return found.get("values").split(";")


def test_rods_keep_their_lengths_and_a_mark_follows_its_curve():
    assert run(["animate", "-q", "t.h5", "a", "--link", "0,0 x1,y1 x2,y2", "-o", "t.svg"]) == 0
    root = ElementTree.parse("t.svg").getroot()
    link = next(p for p in root.iter(f"{SVG}polyline") if p.get("stroke-width") == "3")
    places = np.array([[p.split(",") for p in text.split()] for text in frames(link, "points")], float)
    first, second = np.linalg.norm(np.diff(places, axis=1), axis=2).T
    assert first.size == 76  # 25 a second
    assert np.ptp(first) < 0.2  # pixels, of which a tenth is written
    assert first.mean() == pytest.approx(2.0 * second.mean(), rel=1e-3)
    found = Trace.open("t.h5")
    angle = np.arctan2(*(places[:, 1] - places[:, 0]).T)
    a = found["a"]
    wanted = CubicHermiteSpline(found.time, a.values, a.derivative)(np.linspace(0.0, 3.0, 76))
    assert np.abs(np.exp(1j * angle) - np.exp(1j * wanted)).max() < 1e-3
    mark = [c for c in root.iter(f"{SVG}circle") if c.get("r") == "4"]
    assert len(mark) == 1
    down = np.array(frames(mark[0], "cy"), float)
    assert abs(np.corrcoef(down, wanted)[0, 1]) > 0.9999


def test_points_are_found_by_their_names_and_the_page_loads_nothing(capsys):
    assert run(["animate", "t.h5", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)["result"]
    assert result == {
        "animation": "t.html",
        "trace": "t.h5",
        "seconds": 3.0,
        "links": [[["x1", "y1"]], [["x2", "y2"]]],
        "quantities": ["a"],
    }
    text = Path("t.html").read_text()
    assert "default-src 'none'" in text
    assert set(re.findall(r"https?://[\w./]*", text)) == {"http://www.w3.org/2000/svg"}
    assert run(["animate", "-q", "t.h5", "-o", "again.html"]) == 0
    assert Path("again.html").read_text() == text


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--link", "0,0 x1,yy1"), "has no quantity 'yy1'; nearest: 'y1'"),
        (("--link", "0,0 x1"), "'x1' is no point X,Y"),
        (("--link", " "), "points X,Y"),
        (("--link", "x1,a"), "'a' is in 1, other coordinates in m"),
        (("--speed", "0"), "--speed 0: more than 0"),
        (("-o", "t.gif"), "one of .html, .svg"),
        (("q",), "has no quantity 'q'"),
    ],
)
def test_wrong_usage(options, said, capsys):
    assert run(["animate", "t.h5", *options]) == 2
    assert said in capsys.readouterr().err


def test_what_is_no_trace_or_has_no_span(capsys):
    assert run(["animate", "m.sd"]) == 5
    assert run(["animate", "none.h5"]) == 5
    with pytest.raises(animation.UsageError, match="nothing moves"):
        animation.film(Trace("one.h5", np.zeros(1), {}, {}, {"x": Quantity("x", np.zeros(1), "m", None, None)}), None)
    capsys.readouterr()


def test_what_stands_still_and_what_is_no_number_for_a_while():
    time = np.linspace(0.0, 1.0, 11)
    x = Quantity("x", np.where(time < 0.5, time, np.nan), "m", None, None)
    y = Quantity("y", 0.0 * time, "m", None, None)
    none = Quantity("none", time * np.nan, "V", None, None)
    film = animation.film(Trace("t.h5", time, {}, {}, {"x": x, "y": y, "none": none}), 0.5)
    assert film.seconds == 2.0
    text = animation.drawing(film, animation.links_of(film.trace, ()), ["none"])
    ElementTree.fromstring(text)
    assert "nan" not in text
    assert "none: no numbers" in text
    assert text.count("<animate ") == 1  # cx of the point
