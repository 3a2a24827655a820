"""The loop of the server: whatever arrives first, a message of the client or an answer of the check."""

from __future__ import annotations

import os
import sys
from multiprocessing.connection import wait
from typing import Any

from sysdyn.cli.lsp.server import Server
from sysdyn.cli.lsp.wire import Inbox, written

CHUNK = 1 << 16


def run(source: int, target: int) -> int:
    """Serve a client that writes to one file descriptor and reads the other; the exit code.

    The end of its input without `exit` is an end without one: 1.
    """

    def send(message: dict[str, Any]) -> None:
        data = memoryview(written(message))
        while data:
            data = data[os.write(target, data) :]

    server, inbox = Server(send), Inbox()
    try:
        # messages of the client and answers of the checker, whichever comes first
        while server.exit_code is None:
            left = server.checker.go_on()
            pipe = server.checker.pipe
            ready = wait([source] if pipe is None else [source, pipe], left)
            if pipe is not None and pipe in ready:
                server.publish_check(*server.checker.answer())
            if source in ready:
                data = os.read(source, CHUNK)
                # the client ended its output
                if not data:
                    return 1
                for message in inbox.put(data):
                    server.receive(message)
                    if server.exit_code is not None:
                        break
    except BrokenPipeError:  # the client went away
        return 1
    finally:
        server.checker.end()
    return server.exit_code


def serve_standard_streams() -> int:
    """Serve over standard input and output; what anything else prints goes to standard error."""
    sys.stdout.flush()
    target = os.dup(1)
    os.dup2(2, 1)
    try:
        return run(0, target)
    finally:
        os.dup2(target, 1)
        os.close(target)
