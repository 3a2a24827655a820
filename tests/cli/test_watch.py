"""`check --watch`: a change of a file, of a module or of a table is checked at once; an interruption ends it."""

import signal
import subprocess
import sys
import threading
import time

import pytest
from sysdyn.cli.main import run

MODEL = """from parts import k
model m {
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*k*x^2
}
"""


class Watched:
    """A running `check --watch`, its messages as they come."""

    def __init__(self, *arguments):
        command = [sys.executable, "-m", "sysdyn", "check", "--watch", *arguments]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        self.said = ""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self.process.stderr:
            self.said += line

    def close(self):
        self.process.kill()
        self.process.wait()
        self._reader.join(timeout=60)
        self.process.stderr.close()

    def until(self, text, times=1):
        """Wait until a text has been said so often."""
        end = time.monotonic() + 60.0
        while self.said.count(text) < times:
            assert time.monotonic() < end, self.said
            time.sleep(0.05)


@pytest.mark.long
def test_changes_are_checked_until_it_is_interrupted(tmp_path):
    (tmp_path / "parts.sd").write_text("const k = 4 N/m\n")
    (tmp_path / "m.sd").write_text(MODEL)
    watched = Watched("m.sd")
    try:
        watched.until("exit 0; waiting")
        (tmp_path / "m.sd").write_text(MODEL.replace("1/2*k", "1/2*kk"))
        watched.until("error E101: unknown name 'kk'")
        watched.until("exit 1; waiting")
        (tmp_path / "m.sd").write_text(MODEL)
        watched.until("exit 0; waiting", 2)
        (tmp_path / "parts.sd").write_text("const k = 4 N\n")  # a module of it
        watched.until("error E208")
        watched.process.send_signal(signal.SIGINT)
        assert watched.process.wait(timeout=60) == 130
    finally:
        watched.close()


@pytest.mark.parametrize("other", [["-"], ["m.sd", "--json"], ["m.sd", "--output-format", "sarif"]])
@pytest.mark.one_in(2)
def test_what_is_one_object_is_not_watched(tmp_path, capsys, other):
    (tmp_path / "m.sd").write_text("model m {\n  param a = 1\n}\n")
    assert run(["check", "--watch", *other]) == 2


def test_a_file_that_is_no_text_does_not_hide_the_others(tmp_path, capsys):
    (tmp_path / "a.sd").write_bytes(b"model \xff\xfe")
    (tmp_path / "b.sd").write_text("model m {\n  param a = b\n}\n")
    assert run(["check", "a.sd", "b.sd"]) == 1
    said = capsys.readouterr().err
    assert "E116" in said
    assert "E101" in said
