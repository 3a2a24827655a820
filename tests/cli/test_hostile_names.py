"""200 hostile strings through C, HTML, SVG, JSON, JUnit and the terminal: nothing executed, nothing escapes."""

import json
import os
import random
import re
import shutil
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import h5py
import pytest
from pages import Page
from sysdyn.cli.main import run
from texts import PENDULUM, write

ATOMS = [
    "</script>", "<script>alert(1)</script>", "<img src=x onerror=alert(1)>", "<!--", "-->", "]]>", "<![CDATA[", "*/",
    "/*", "//", "\\", "\\\n", "??/", "#include </etc/passwd>", "'", '"', "`touch pwned`", "$(touch pwned)",
    '; system("touch pwned");', "{{7*7}}", "%s%n", "${x}", "&lt;", "&#x3c;script&#x3e;", "javascript:alert(1)",
    "\x1b[2J", "\x1b]0;owned\x07", "\x9b31m", "\r", "\b", "\x7f", "\u202e", "\u2028", "\u200b",
    "日本", "url(http://x)",
    "<svg onload=alert(1)>", "</text>", "</title>", "<style>*{}",
    "__import__('os').system('touch pwned')", " ", "a", "0",
]  # fmt: skip
BATCHES, EACH = 10, 20
DRAWN = range(BATCHES if os.environ.get("SYSDYN_LONG") == "1" else 4)
"""Batches that are drawn: a second each."""


def strings(batch):
    """Twenty strings of a batch, always the same; the first atoms each come once."""
    chance = random.Random(f"hostile {batch}")
    made = ["".join(chance.choice(ATOMS) for _ in range(chance.randint(1, 4))) for _ in range(EACH)]
    return [f"{ATOMS[(batch * EACH + k) % len(ATOMS)]}{text}" for k, text in enumerate(made)]


def control(text):
    """Control characters in a text that is shown."""
    return {c for c in text if ord(c) < 32 or 127 <= ord(c) < 160} - {"\n"}


def files():
    """Every file below the folder, and what is in none of them."""
    return {str(p) for p in Path().rglob("*")}


def page(name):
    """The elements of a page; nothing in it loads, runs on an event, or leads elsewhere."""
    found = Page(Path(name).read_text(encoding="utf-8"))
    assert found.outside == [], found.outside
    return Counter(found.tags), found.scripts


def svg(name):
    """The elements of a picture, and attributes that would run or load something."""
    root = ET.fromstring(Path(name).read_bytes())
    for element in root.iter():
        for key, value in element.attrib.items():
            assert not key.lower().startswith("on")
            assert "javascript:" not in value
            assert "href" not in key or value.startswith("#"), value
    return Counter(element.tag for element in root.iter())


def traces(names, units):
    """good.h5, and bad.h5 with curves of these names and units."""
    Path("bad.h5").write_bytes(Path("good.h5").read_bytes())
    with h5py.File("bad.h5", "a") as file:
        for name, unit in zip(names, units, strict=True):
            file[name] = file["x"][:]
            for key, value in file["x"].attrs.items():
                file[name].attrs[key] = value
            file[name].attrs["label"] = unit
        file.attrs["title"] = file.attrs["model"] = file.attrs["scene"] = "".join(units)


def shown(capsys, *command):
    """What a command says where it is read by eye."""
    run([str(c) for c in command])
    said = capsys.readouterr()
    assert "a fault in sysdyn" not in said.err, said.err
    assert not control(said.out + said.err), command
    return said


@pytest.fixture
def good(tmp_path, monkeypatch):
    path = write(tmp_path, PENDULUM)
    monkeypatch.chdir(tmp_path)
    assert run(["simulate", "-q", path, "-o", "good.h5"]) == 0


def pictures(capsys, names):
    """Elements of everything that is drawn and written of bad.h5."""
    for end in ("svg", "html"):
        shown(capsys, "plot", "bad.h5", *names, "-o", f"p.{end}")
    shown(capsys, "plot", "bad.h5")
    shown(capsys, "diff", "good.h5", "bad.h5", "--html", "d.html", "--junit", "d.xml")
    shown(capsys, "diff", "bad.h5", "good.h5")
    cases = Counter(e.tag for e in ET.fromstring(Path("d.xml").read_bytes()).iter())
    return svg("p.svg"), page("p.html"), page("d.html"), cases


@pytest.mark.parametrize("batch", DRAWN)
@pytest.mark.one_in(5)
def test_names_of_traces(good, capsys, batch):
    units = strings(batch)
    names = list(dict.fromkeys(f"q{k}{u}".replace("/", "\u2215").replace("\0", "") for k, u in enumerate(units)))
    traces([f"q{k}" for k in range(len(names))], ["label"] * len(names))
    plain = pictures(capsys, [])
    before = files()
    traces(names, units)
    found = pictures(capsys, [])
    # a name may be cut in lines or letters of its own, which are elements of text: nothing else comes or goes
    for was, now in zip(plain[1:3], found[1:3], strict=True):
        assert set(now[0]) == set(was[0])
        assert now[0]["script"] == was[0]["script"]
        assert now[1] == was[1]
    assert set(found[0]) == set(plain[0])
    assert found[3] == plain[3]
    assert files() == before
    capsys.readouterr()
    run(["diff", "--json", "good.h5", "bad.h5"])
    listed = json.dumps(json.loads(capsys.readouterr().out), ensure_ascii=False)
    assert all(json.dumps(name, ensure_ascii=False)[1:-1] in listed for name in names)


def told(text):
    """The pendulum with a text in every place that takes one."""
    line = re.sub(r"[\r\n]", " ", text)
    quoted = line.replace("\\", "").replace('"', "'")
    model = PENDULUM.replace("model pendulum {", f"## {line}\nmodel pendulum {{\n  # {line}")
    model = model.replace("param m = 1.13 kg", f"param m = 1.13 kg  # {line}")
    roles = "  effort push: N\n  flow pace: m/s\n  momentum blow: N.s\n  displacement way: m\n  node common flow\n"
    domain = f'domain slow {{\n{roles}  ground "{quoted}"\n}}\n'
    return domain + model


def tokens(text):
    """C without comments and strings."""
    pattern = r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'"
    return re.sub(pattern, " ", text, flags=re.S).split()


@pytest.mark.parametrize("batch", range(BATCHES))
@pytest.mark.long
def test_strings_and_comments_of_texts(tmp_path, monkeypatch, capsys, batch):
    monkeypatch.chdir(tmp_path)
    wanted = None
    for number, text in enumerate(["a remark", *strings(batch)]):
        Path("model.sd").write_text(told(text), encoding="utf-8", newline="")
        before = files()
        said = shown(capsys, "compile", "model.sd", "-o", "out")
        written = ("residual.c", "binding.c", "binding.json", "sysdyn_model.h", "manifest.json")
        assert files() - before <= {"out", *(f"out/{name}" for name in written)}, files() - before
        if not Path("out/residual.c").exists():  # characters that no text may hold are refused with their place
            assert "error E" in said.err
            assert number
            continue
        made = tokens(Path("out/residual.c").read_text(encoding="utf-8"))
        wanted = wanted or made
        assert made == wanted, text
        shutil.rmtree("out")


@pytest.mark.long
def test_a_report_about_hostile_remarks(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    def reported(text):
        Path("model.sd").write_text(told(text), encoding="utf-8", newline="")
        said = shown(capsys, "report", "model.sd", "-o", "r.html")
        assert Path("r.html").exists(), said.err
        return page("r.html")

    plain = reported("a remark")
    printable = [s for batch in range(BATCHES) for s in strings(batch) if not control(s.replace("\n", " "))]
    assert len(printable) > 60
    # all in one text, each in a line of its own
    hostile = reported(" ".join(printable[:60])[:8000])
    assert hostile[1] == plain[1]
    assert set(hostile[0]) == set(plain[0])
    assert hostile[0]["script"] == plain[0]["script"]
    assert "pwned" not in files()
