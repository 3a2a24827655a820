"""Files that commands write where the disk takes no more: what was there stays, and the message names the file."""

import errno
import resource
import signal

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
