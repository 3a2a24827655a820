"""What a system lacks that is no POSIX (a wheel for Windows): modules, signals, functions of `os`."""

import subprocess
import sys

MISSING = """
import os, signal, sys
import h5py, numpy, scipy.sparse, multiprocessing, tempfile, subprocess, shutil, pathlib  # which have their own ways
for name in ("fcntl", "resource"):
    sys.modules[name] = None
for name in ("SIGHUP", "pthread_sigmask", "pthread_kill"):
    delattr(signal, name)
names = "O_NOFOLLOW O_NONBLOCK O_CLOEXEC getuid getgid statvfs sysconf memfd_create sendfile sched_getaffinity"
for name in names.split():
    delattr(os, name)
shutil.disk_usage = lambda path: shutil._ntuple_diskusage(2**40, 0, 2**40)  # by statvfs here
shutil._USE_CP_SENDFILE = False
from sysdyn.cli.main import run
"""
MODEL = """
model decay {
  state x: 1 = 1
  dynamic x' = -1 Hz*x
}
scene s of decay {
  time 0 s to 1 s
  trace x every 0.1 s
}
"""


def test_a_model_is_checked_and_run_without_what_windows_lacks(tmp_path):
    (tmp_path / "m.sd").write_text(MODEL)
    commands = [["check", "m.sd"], ["simulate", "m.sd", "--backend", "numpy", "-q"], ["simulate", "m.sd", "-q"]]
    commands.append(["diff", "m-s.h5", "m-s.h5", "-q"])
    for command in commands:
        code = f"{MISSING}sys.exit(run({command!r}))"
        done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, (command, done.stdout, done.stderr)
    assert not list(tmp_path.glob(".m*"))
