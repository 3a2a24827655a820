"""Files that commands write where the disk takes no more: what was there stays, and the message names the file."""

import errno
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from sysdyn.cli import whole_files
from sysdyn.cli.main import run
from texts import PENDULUM, write


@pytest.fixture
def small():
    """A function after which no file may be longer than 2000 bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    yield lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2000, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


def _names(folder):
    """All files but the journal of a sweep, with which it is resumed."""
    return {path.name for path in folder.iterdir() if path.suffix != ".runs"}


@pytest.mark.parametrize("command", ["plot", "sweep"])
@pytest.mark.long
def test_a_file_that_cannot_be_written_is_as_before(tmp_path, capsys, small, command):
    model = write(tmp_path, PENDULUM)
    assert run(["simulate", "-q", model, "-o", "a.h5"]) == 0
    out = "p.png" if command == "plot" else "s.h5"
    said = (
        ["plot", "-q", "a.h5", "-o", out]
        if command == "plot"
        else ["sweep", "-q", model, "--over", "l=2,2.1", "-o", out]
    )
    assert run(said) == 0
    content, files = (tmp_path / out).read_bytes(), _names(tmp_path)
    small()
    capsys.readouterr()
    assert run(said) == 5
    message = capsys.readouterr().err
    assert out in message
    assert message.count("\n") == 1
    assert (tmp_path / out).read_bytes() == content
    assert _names(tmp_path) == files


def test_whole_or_not_at_all(tmp_path, small):
    target, link = tmp_path / "page.html", tmp_path / "link.html"
    whole_files.write(target, "before")
    target.chmod(0o640)
    link.symlink_to(target)
    whole_files.write(link, "behind")
    assert (target.read_text(), link.is_symlink(), target.stat().st_mode & 0o777) == ("behind", True, 0o640)
    small()
    with pytest.raises(OSError, match=r"page\.html") as caught:
        whole_files.write(target, "x" * 3000)
    assert caught.value.errno == errno.EFBIG
    assert target.read_text() == "behind"
    assert _names(tmp_path) == {"link.html", "page.html"}


def test_a_text_beside_which_no_file_can_be_made_is_named(tmp_path):
    """Not the name of what would have been renamed to it."""
    target = tmp_path / "no_folder" / "m.lock"
    with pytest.raises(FileNotFoundError) as caught:
        whole_files.replace(target, "text")
    assert caught.value.filename == str(target)


@pytest.mark.parametrize(("mode", "code"), [("r+", 5), ("r", 0)])
@pytest.mark.one_in(2)
def test_a_trace_that_another_program_writes_is_said_to_be_held(tmp_path, capsys, mode, code):
    """And is as before; one that somebody reads is replaced."""
    model, output = write(tmp_path, PENDULUM), tmp_path / "o.h5"
    assert run(["simulate", str(model), "-q", "-o", str(output)]) == 0
    before = output.stat()
    script = "import h5py, sys; file = h5py.File(*sys.argv[1:]); print('held', flush=True); input()"
    command = [sys.executable, "-c", script, str(output), mode]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        capsys.readouterr()
        assert run(["simulate", str(model), "-q", "-o", str(output)]) == code
        assert (f"{output}: another program holds this file open" in capsys.readouterr().err) == (mode == "r+")
        other.communicate("\n")
    assert (output.stat().st_ino == before.st_ino) == (mode == "r+")


@pytest.mark.skipif(not Path("/dev/fd").is_dir(), reason="no names of open files here")
def test_a_pipe_takes_what_is_written_by_its_name():
    """`/dev/stdout | less`: the name leads to no path of the file system."""
    read, written = os.pipe()
    whole_files.write(f"/dev/fd/{written}", "a page")
    assert os.read(read, 100) == b"a page"
    os.close(read)
    os.close(written)
