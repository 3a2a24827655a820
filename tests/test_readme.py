"""The README shows what is in the repository."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()
BLOCKS = [block.partition("\n")[2] for block in README.split("```")[1::2]]


def test_the_first_block_is_the_pendulum_of_the_gallery():
    assert BLOCKS[0] == (ROOT / "models/gallery/pendulum.sd").read_text()


def test_the_first_command_prints_what_is_shown(tmp_path, monkeypatch, capsys):
    """Word for word but for the CPU's time, and numbers of round-off."""
    from sysdyn.cli.main import run

    def told(text):
        return re.sub(r"[0-9.]+ ms|constraints .*|[0-9.e+-]+(?= of 28)", "_", text).splitlines()

    monkeypatch.chdir(tmp_path)
    printed = ""
    for command in (["simulate", str(ROOT / "models/gallery/pendulum.sd")], ["plot", "pendulum-swing.h5"]):
        assert run(command) == 0
        printed += "".join(reversed(capsys.readouterr()))
    assert sorted(told(printed)) == sorted(told(BLOCKS[2]))
    assert (tmp_path / "pendulum-swing.png").read_bytes().startswith(b"\x89PNG")
    assert (ROOT / "models/gallery/pendulum.png").read_bytes().startswith(b"\x89PNG")


def test_diagnostics_are_what_check_prints(tmp_path):
    """Both rendered diagnostics, word for word."""
    text = (ROOT / "models/gallery/pendulum.sd").read_text()
    shown = [block for block in BLOCKS if block.startswith("error E")]
    wrong = [
        text.replace("sqrt(x^2 + y^2) = l", "x^2 + y^2 = l"),
        text.replace("~ -2 m          # a guess: the rod decides", "= -2 m"),
    ]
    for block, model in zip(shown, wrong, strict=True):
        assert model != text
        (tmp_path / "pendulum.sd").write_text(model)
        command = [sys.executable, "-m", "sysdyn.cli", "check", "pendulum.sd"]
        ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
        assert ran.returncode == 1
        assert ran.stderr == block


def test_the_network_example_runs(tmp_path):
    from sysdyn.cli.main import run

    (text,) = (block for block in BLOCKS if block.startswith("from std."))
    (tmp_path / "lead.sd").write_text(text)
    assert run(["fmt", "--check", str(tmp_path / "lead.sd")]) == 0
    assert run(["check", "--strict", "-q", str(tmp_path / "lead.sd")]) == 0
    assert run(["simulate", "-q", str(tmp_path / "lead.sd"), "-o", str(tmp_path / "lead.h5")]) == 0


def test_the_python_example_runs(tmp_path, monkeypatch, capsys):
    (code,) = (block for block in BLOCKS if "from sysdyn.api" in block)
    (tmp_path / "models").symlink_to(ROOT / "models")
    monkeypatch.chdir(tmp_path)
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith("6.0 ")


def test_gallery_table_names_every_model():
    page = (ROOT / "models/README.md").read_text(encoding="utf-8")
    for path in (ROOT / "models/gallery").glob("*.sd"):
        assert f"`{path.stem}`" in page


def test_the_page_is_short_and_its_links_lead_to_files():
    assert len(README.splitlines()) < 250
    for link in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / link).exists(), link


def test_the_page_of_measurements_names_every_program():
    bench = ROOT / "tests/bench"
    page = (bench / "README.md").read_text(encoding="utf-8")
    named = set(re.findall(r"([\w/]+\.py)\b", page))
    for name in named:
        assert (bench / name).is_file() or (ROOT / name).is_file(), name
    assert {path.name for path in bench.glob("*.py")} <= named
    for line in page.splitlines():
        assert len(line) <= (200 if line.startswith("|") else 120), line
