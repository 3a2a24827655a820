"""The entry of the command `sysdyn`: Ctrl-C waits until what answers it stands."""

from __future__ import annotations

import signal
import sys


def main() -> None:
    """Import the command line and run it; an interruption meanwhile comes behind that, and ends it as any other."""
    held = None
    if sys.platform != "win32":  # which knows no masks of signals: there an interruption meanwhile ends the import
        held = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
    from sysdyn.cli.main import main as command
    from sysdyn.distribution import warn_of_other

    warn_of_other()

    command(held=held)
