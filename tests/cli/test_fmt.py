"""`sysdyn fmt`: in place, --check, --diff."""

import stat
from pathlib import Path

from sysdyn.cli.main import run
from texts import PENDULUM, write

UGLY = PENDULUM.replace("  param m = 1.13 kg", "     param m=1.13 kg").replace("  phi rod", "\n\n\n\n phi rod")


def test_in_place(tmp_path, capsys):
    path = write(tmp_path, UGLY)
    Path(path).chmod(0o640)
    assert run(["fmt", path]) == 0
    text = (tmp_path / "model.sd").read_text()
    assert text != UGLY
    assert "  param m = 1.13 kg\n" in text
    assert stat.S_IMODE(Path(path).stat().st_mode) == 0o640
    assert "formatted" in capsys.readouterr().err
    assert run(["fmt", path]) == 0
    assert (tmp_path / "model.sd").read_text() == text
    assert [p.name for p in tmp_path.iterdir()] == ["model.sd"]


def test_a_missing_file_does_not_stop_the_others(tmp_path, capsys):
    path = write(tmp_path, UGLY)
    assert run(["fmt", "missing.sd", path]) == 5
    assert "missing.sd: No such file" in capsys.readouterr().err
    assert (tmp_path / "model.sd").read_text() != UGLY


def test_check_writes_nothing(tmp_path, capsys):
    path = write(tmp_path, UGLY)
    assert run(["fmt", "--check", path]) == 1
    assert (tmp_path / "model.sd").read_text() == UGLY
    assert "not in the canonical layout" in capsys.readouterr().err
    assert run(["fmt", "--check", write(tmp_path, PENDULUM)]) == 0


def test_diff_prints_what_would_change(tmp_path, capsys):
    path = write(tmp_path, UGLY)
    assert run(["fmt", "--diff", path]) == 0
    out = capsys.readouterr().out
    assert out.startswith("--- ")
    assert "-     param m=1.13 kg\n" in out
    assert "+  param m = 1.13 kg\n" in out
    assert (tmp_path / "model.sd").read_text() == UGLY
    assert run(["fmt", "--diff", "--check", path]) == 1


def test_a_text_with_errors_is_left_alone(tmp_path, capsys):
    broken = UGLY + "scene {{{\n"
    path = write(tmp_path, broken)
    assert run(["fmt", path]) == 1
    assert (tmp_path / "model.sd").read_text() == broken
    assert "error E1" in capsys.readouterr().err


def test_a_link_stays_a_link(tmp_path):
    write(tmp_path, UGLY, "real.sd")
    (tmp_path / "link.sd").symlink_to(tmp_path / "real.sd")
    assert run(["fmt", "-q", str(tmp_path / "link.sd")]) == 0
    assert (tmp_path / "link.sd").is_symlink()
    assert (tmp_path / "real.sd").read_text() != UGLY
