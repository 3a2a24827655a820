"""The entry of the command `sysdyn`: Ctrl-C waits until what answers it stands."""

from __future__ import annotations

import signal


def main() -> None:
    """Import the command line and run it; an interruption meanwhile comes behind that, and ends it as any other."""
    held = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
    from sysdyn.cli.main import main as command

    command(held=held)
