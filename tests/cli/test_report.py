"""`sysdyn report` and the pages of `plot`: self-contained, nothing of a file's text becomes markup, they zoom."""

import base64
import json
import re
from pathlib import Path

import browser
import h5py
import numpy as np
import pytest
from pages import read
from sysdyn.cli.equations.mathml import Typesetter, math, number
from sysdyn.cli.main import run
from sysdyn.cli.page.plots import thin
from sysdyn.cli.report.layout import places
from sysdyn.dsl.model import expression as ex
from texts import ARRAY, BROKEN, FAILING, PENDULUM, ROOT, write

SECTIONS = ("text", "network", "paynter", "energies", "equations", "unknowns", "start", "traces", "balance", "solver")
SEED = ROOT / "models" / "seed"

NETWORK = """\
model ladder {
  param n = 4
  param R = 2 ohm
  node v[0..n], w[1..n]: electrical
  source: effort(e = 1 V*sin(3 s^-1*t)) v[0] -> ground
  for i in 1..n {
    r[i]: dissipator(e = R*f) v[i - 1] -> w[i]
    l[i]: kinetic(p = 1 H*f) w[i] -> v[i]
    c[i]: potential(q = 1 F*e) v[i] -> ground
  }
  load: dissipator(e = R*f) v[n] -> ground
}

scene run of ladder {
  time 0 s to 2 s
  trace v[n].e as out every 50 ms
}
"""

HOSTILE = PENDULUM.replace(
    "model pendulum {", "# </pre><script>alert(1)</script> & <img src=x onerror=alert(2)>\nmodel pendulum {"
).replace("  expect always", '  expect golden "<b>.h5" within 1e-3\n  expect always')


@pytest.fixture(scope="module")
def chromium():
    if browser.found() is None:
        pytest.skip(f"there is no browser: none of {', '.join(browser.NAMES)}")
    made = browser.Browser()
    yield made
    made.close()


def report(path, *options):
    assert run(["report", "-q", str(path), "-o", "page.html", *options]) == 0
    return read(Path("page.html"))


def curves(text):
    """The data of a page's figures."""
    found = re.search(r'<script type="application/json" id="curves">(.*?)</script>', text, re.S)
    return json.loads(found[1])


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.one_in(2)
def test_a_page_of_every_formulation(formulation):
    page = report(SEED / "dc_motor.sd", "--formulation", formulation)
    assert set(SECTIONS) <= set(page.ids)
    assert page.tags["math"] > 8
    assert page.scripts == ["application/json", None]
    for word in ("winding", "gyrator", "degrees of freedom", "consistent start", "steps", "audit.energy"):
        assert word in page.words.lower(), word
    assert "not measured" not in page.words


def test_a_page_of_coordinates(tmp_path):
    page = report(write(tmp_path, PENDULUM))
    assert "asked for by phi rod" in page.words
    assert "1 guesses were moved" in page.words
    assert "phi rod" in page.words
    assert "dopri" in page.words
    assert "expect" in page.words


def test_flow_constraints_in_kanes_form():
    page = report(SEED / "knife_edge.sd", "--formulation", "kane", "--until", "0.1")
    assert "kane is written in q, f" in page.words


def test_families_stand_once(tmp_path):
    path = write(tmp_path, NETWORK)
    small, large = report(path), report(path, "--set", "n=40")
    assert small.tags["math"] == large.tags["math"]
    assert "v[0..n]" in small.words
    assert "r[1..n]" in small.words
    assert report(write(tmp_path, ARRAY, "array.sd")).tags["math"] > 5


def test_energies_of_the_elements_add_up(capsys):
    page = report(SEED / "dc_motor.sd")
    bars = [word for word in page.text if word.endswith(" J")]
    names = ("supply", "winding", "rotor", "bearing", "coil")
    found = {}
    for name in names:
        k = max(j for j, word in enumerate(page.text) if word == name and page.text[j + 1] in bars)
        found[name] = float(page.text[k + 1].removesuffix(" J").replace("−", "-"))
    stored, lost = found["coil"] + found["rotor"], found["winding"] + found["bearing"]
    assert stored + lost == pytest.approx(found["supply"], rel=1e-3)
    assert found["supply"] == pytest.approx(26.796, rel=1e-3)


def test_nothing_of_the_text_becomes_markup(tmp_path):
    folder = tmp_path / "<i>&"
    folder.mkdir()
    (folder / "a.sd").write_text(HOSTILE)
    assert run(["report", "-q", str(folder / "a.sd"), "-o", "page.html", "--backend", "numpy"]) in (1, 5)
    (folder / "a.sd").write_text(HOSTILE.replace('  expect golden "<b>.h5" within 1e-3\n', ""))
    page = report(folder / "a.sd")
    assert "<script>alert(1)</script>" in page.words
    assert page.scripts == ["application/json", None]
    assert "img" not in page.tags
    assert "i" not in page.tags or "<i>&" not in Path("page.html").read_text()


def hostile_trace(path):
    names = ["</script><script>document.title='taken'</script>", "<img src=x onerror=alert(1)>", "\u2028&amp;\"'"]
    with h5py.File(path, "w") as file:
        file.attrs["title"] = names[0]
        file["time"] = np.linspace(0.0, 1.0, 50)
        for k, name in enumerate(names):
            file[name.replace("/", "\u2215")] = np.sin(np.linspace(0.0, 9.0 + k, 50))
            file[name.replace("/", "\u2215")].attrs["units"] = f"<b>{k}"
    return path


def test_names_of_a_trace_stay_text(tmp_path):
    hostile_trace("bad.h5")
    assert run(["plot", "-q", "bad.h5", "-o", "bad.html"]) == 0
    page = read(Path("bad.html"))
    assert page.scripts == ["application/json", None]
    assert "img" not in page.tags
    assert "b" not in page.tags


def test_usage(tmp_path, capsys):
    path = write(tmp_path, PENDULUM)
    assert run(["report", path, "-o", "page.pdf"]) == 2
    assert "a report is an .html" in capsys.readouterr().err
    assert run(["report", path, "-o", "-", "--json"]) == 2
    capsys.readouterr()
    assert run(["report", "-q", path, "-o", "-"]) == 0
    assert capsys.readouterr().out.startswith("<!doctype html>")
    assert run(["report", path, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["result"]["report"] == "model-swing.html"
    assert answer["result"]["dof"] == 1
    assert run(["report", path, "-o", "no/such.html"]) == 5
    assert run(["report", write(tmp_path, BROKEN, "broken.sd")]) == 1
    assert not Path("broken-swing.html").exists()


def test_failures_stand_on_the_page(tmp_path, capsys):
    assert run(["report", write(tmp_path, FAILING), "-o", "page.html"]) == 1
    assert "expect failed" in read(Path("page.html")).words
    path = write(tmp_path, PENDULUM)
    assert run(["report", path, "-o", "page.html", "--max-steps", "3"]) == 3
    assert "limit of steps" in read(Path("page.html")).words


def test_without_a_scene_nothing_is_run(tmp_path):
    page = report(write(tmp_path, PENDULUM.split("scene")[0]))
    assert "nothing was run" in page.words.lower()
    assert set(SECTIONS) <= set(page.ids)


def test_pages_hold_the_curves(tmp_path):
    path = write(tmp_path, PENDULUM)
    assert run(["simulate", "-q", path, "-o", "a.h5"]) == 0
    assert run(["simulate", "-q", path, "-o", "b.h5", "--set", "l=1.4 m"]) == 0
    assert run(["plot", "-q", "a.h5", "b.h5", "x", "-o", "x.html"]) == 0
    data = curves(Path("x.html").read_text())
    read(Path("x.html"))
    ((first, second),) = [panel["curves"] for panel in data["panels"]]
    assert (first["label"], second["label"]) == ("a", "b")
    time = np.frombuffer(base64.b64decode(data["arrays"][first["time"]]), "<f8")
    assert time[0] == 0.0
    assert time[-1] == 1.0
    assert data["panels"][0]["unit"] == "m"
    assert data["unit"] == "s"


def test_thinned_curves_keep_spikes_and_gaps():
    time = np.linspace(0.0, 1.0, 100_001)
    values = np.zeros(time.size)
    values[12345], values[777] = 5.0, np.nan
    few, kept = thin(time, values, 500)
    assert few.size < 1600
    assert np.nanmax(kept) == 5.0
    assert np.isnan(kept).any()
    assert few[0] == 0.0
    assert few[-1] == 1.0


def test_layout_keeps_vertices_apart():
    edges = [("e1", "a"), ("e1", "b"), ("e2", "a"), ("e3", "a"), ("e4", "b"), ("e5", "b"), ("f", "c")]
    near = {}
    for one, other in edges:
        near.setdefault(one, []).append(other)
        near.setdefault(other, []).append(one)
    found = places(near, dict.fromkeys(near, 1.0))
    for one in found:
        for other in found:
            if one < other and found[one][0] == found[other][0]:
                assert abs(found[one][1] - found[other][1]) >= 1.0 - 1e-9


def test_expressions_are_typeset():
    types = Typesetter(["x", "coil"])
    with ex.fresh():
        x, f = ex.var("x", "q"), ex.var("coil", "f")
        text = math(types.expression(ex.linear(0.0, ((0.5, ex.mul(ex.param("m"), f, f)), (-1.0, ex.sqrt(x))))))
        assert "<mfrac><mn>1</mn><mn>2</mn></mfrac>" in text
        assert "<msub><mover accent='true'><mi>q</mi><mo>˙</mo></mover><mi>coil</mi></msub>" in text
        assert "<msqrt><mi>x</mi></msqrt>" in text
        shared = x
        for _ in range(60):  # 2^60 nodes as a tree
            shared = ex.call("sin", ex.add(ex.mul(shared, shared), shared))
        assert len(types.expression(shared)) < 100_000
    assert number(1e-9) == "<msup><mn>10</mn><mn>−9</mn></msup>"


def test_a_report_in_a_browser(tmp_path, chromium):
    report(SEED / "rectifier_motor_crank.sd", "--until", "0.05")
    chromium.open("page.html")
    assert chromium.errors == []
    assert len(chromium.requests) == 1
    assert chromium.evaluate("document.querySelectorAll('figure.plot path').length") > 3
    # formulas have a size: the browser knows MathML
    assert chromium.evaluate("document.querySelector('#equations math').getBoundingClientRect().width") > 30
    chromium.evaluate("document.querySelector('#equations a').click()")
    assert chromium.evaluate("document.querySelector('.source .line:target') !== null")
    assert chromium.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


def span(page):
    return [float(page.evaluate(f"document.querySelector('figure.plot').dataset.{key}")) for key in ("low", "high")]


def test_a_plot_zooms_in_a_browser(tmp_path, chromium):
    assert run(["simulate", "-q", write(tmp_path, PENDULUM), "-o", "a.h5"]) == 0
    assert run(["plot", "-q", "a.h5", "-o", "a.html"]) == 0
    chromium.open("a.html")
    assert chromium.errors == []
    assert span(chromium) == [0.0, 1.0]
    box = chromium.evaluate(
        "(b => [b.left, b.top, b.width])(document.querySelector('.plot svg').getBoundingClientRect())"
    )
    x, y = box[0] + box[2] / 2, box[1] + 100
    chromium.mouse("mouseMoved", x, y)
    assert chromium.evaluate("document.querySelector('.plot output').textContent") != ""
    chromium.mouse("mouseWheel", x, y, deltaX=0, deltaY=-200)
    chromium.evaluate("new Promise(done => setTimeout(done, 100))")
    low, high = span(chromium)
    assert 0.0 < low < high < 1.0
    chromium.mouse("mousePressed", x, y, button="left", clickCount=1)
    chromium.mouse("mouseMoved", x + 60, y, button="left", buttons=1)
    chromium.mouse("mouseReleased", x + 60, y, button="left", clickCount=1)
    nearer = span(chromium)
    assert low < nearer[0] < nearer[1] < high
    for count in (1, 2):
        chromium.mouse("mousePressed", x, y, button="left", clickCount=count)
        chromium.mouse("mouseReleased", x, y, button="left", clickCount=count)
    assert span(chromium) == [0.0, 1.0]
    # a click on a name hides its curve
    paths = "document.querySelectorAll('figure.plot path').length"
    before = chromium.evaluate(paths)
    chromium.evaluate("document.querySelector('.plot .key button').click()")
    assert chromium.evaluate(paths) == before - 1
    assert chromium.errors == []


def test_a_hostile_trace_in_a_browser(tmp_path, chromium):
    hostile_trace("bad.h5")
    assert run(["plot", "-q", "bad.h5", "-o", "bad.html"]) == 0
    chromium.open("bad.html")
    assert chromium.errors == []
    assert len(chromium.requests) == 1
    assert chromium.evaluate("document.title") != "taken"
    assert chromium.evaluate("document.querySelectorAll('img').length") == 0


def test_elements_of_a_model_with_events_have_their_energies(tmp_path, monkeypatch):
    """What events watch is no quantity of the scene: the run in which the powers are observed is made without them."""
    monkeypatch.chdir(tmp_path)
    report(ROOT / "models" / "gallery" / "bouncing_ball.sd", "--scene", "first")
    assert '<rect class="held"' in Path("page.html").read_text(encoding="utf-8")


def test_the_charge_of_an_element_is_no_letter_of_its_name():
    """C1 is q with C1 below, as `sysdyn equations` prints it; a coordinate q1 is its name."""
    types = Typesetter(["C1", "q1"], (), ["C1"])
    assert types.typeset_unknown("C1", "q", 0) == "<msub><mi>q</mi><mi>C1</mi></msub>"
    assert types.typeset_unknown("q1", "q", 0) == "<msub><mi>q</mi><mn>1</mn></msub>"


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_what_a_stop_takes_is_dissipated(tmp_path, restitution):
    """1 kg at 1 m/s: 0.5 J less what it keeps."""
    (tmp_path / "m.sd").write_text(f"""model stop {{
  coord x: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2
  init x' = 1 m/s
  phi wall: x <= 1 m restitution {restitution}
}}
scene s of stop {{ time 0 s to 2 s; trace x, x' }}
""")
    text = report(tmp_path / "m.sd").text
    lost = 0.5 * (1.0 - restitution**2)
    assert text[text.index("impacts and events") + 1] == f"{lost:.4g} J"
    row = len(text) - text[::-1].index("impacts and events")
    assert text[row] == f"{lost:.4g}"
