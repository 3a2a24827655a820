"""Messages of JSON-RPC 2.0 on a stream of bytes: heads with Content-Length, bodies of JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

PARSE_ERROR, INVALID_REQUEST, METHOD_NOT_FOUND, INTERNAL_ERROR = -32700, -32600, -32601, -32603
NOT_INITIALIZED, REQUEST_FAILED, INVALID_PARAMS = -32002, -32803, -32602
MOST = 64_000_000
"""Bytes of one message; longer ones are passed over."""
_LONGEST_HEAD = 4096
_END = b"\r\n\r\n"


class BadMessage(ValueError):  # noqa: N818 (what was received, not what failed)
    """A message that cannot be read; code: of JSON-RPC."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


class Inbox:
    """Bytes as they arrive; messages as they are whole."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._length: int | None = None
        self._passed = 0  # bytes that belong to a message too long to be read

    def put(self, data: bytes) -> Iterator[dict[str, Any] | BadMessage]:
        """The messages that are whole with these bytes; what is none is told as such, and the next one is read."""
        self._bytes += data
        while (found := self._next()) is not None:
            yield found

    def _next(self) -> dict[str, Any] | BadMessage | None:
        """The next message of the bytes so far, or what is wrong with them; None where more is needed."""
        while self._passed or self._length is None:
            # the body of a message that was too long is thrown away
            if self._passed:
                gone = min(self._passed, len(self._bytes))
                del self._bytes[:gone]
                self._passed -= gone
                if self._passed:
                    return None
                continue
            # the head
            end = self._bytes.find(_END)
            if end < 0:
                if len(self._bytes) <= _LONGEST_HEAD:
                    return None
                del self._bytes[: -len(_END)]
                return BadMessage(PARSE_ERROR, "there is no head of a message: Content-Length: N, an empty line")
            length = _length(bytes(self._bytes[:end]))
            del self._bytes[: end + len(_END)]
            if length is None:
                return BadMessage(PARSE_ERROR, "the head of a message has no Content-Length")
            # refused, and passed over
            if length > MOST:
                self._passed = length
                return BadMessage(PARSE_ERROR, f"a message of {length} bytes is longer than {MOST}")
            self._length = length
        if len(self._bytes) < self._length:
            return None
        # the head said how long it is
        body = bytes(self._bytes[: self._length])
        del self._bytes[: self._length]
        self._length = None
        return _read(body)


def _length(head: bytes) -> int | None:
    """What a head says of the length of its body."""
    for line in head.split(b"\r\n"):
        name, _, value = line.partition(b":")
        if name.strip().lower() == b"content-length" and value.strip().isdigit() and len(value) < 20:
            return int(value)
    return None


def _read(body: bytes) -> dict[str, Any] | BadMessage:
    """The object of a body."""
    try:
        found = json.loads(body, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        return BadMessage(PARSE_ERROR, f"a message is no JSON: {error}")
    if not isinstance(found, dict):
        return BadMessage(INVALID_REQUEST, "a message is no object")
    return found


def _no_number(word: str) -> float:
    raise ValueError(f"{word} is no number of JSON")


def written(message: dict[str, Any]) -> bytes:
    """A message with its head; lone halves of UTF-16 pairs, which no UTF-8 holds, are written as escapes."""
    body = json.dumps({"jsonrpc": "2.0", **message}, allow_nan=False).encode("ascii")
    return b"Content-Length: %d\r\n\r\n" % len(body) + body
