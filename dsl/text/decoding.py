"""Bytes to source text: limits on size, UTF-8, and a place for what is no text."""

from __future__ import annotations

from typing import BinaryIO

from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError
from sysdyn.dsl.text.source import SourceText

MAX_BYTES = 10_000_000
"""Longest file that is read; a model a thousand times smaller is already a large one."""


def decode(name: str, stream: BinaryIO) -> SourceText:
    """The text of a byte stream; a byte-order mark is dropped.

    Raises ModelError (E116) where there are more than `MAX_BYTES` bytes or where they are no UTF-8.
    """
    data = stream.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        message = f"the file is longer than {MAX_BYTES // 1_000_000} MB"
        place = SourceText(name, "").place(0, 0)
        raise ModelError([Diagnostic("E116", message, place, "a table of data belongs in a .csv file")])
    try:
        if b"\0" in data:  # UTF-16 without its mark, or no text
            at = data.index(b"\0")
            raise UnicodeDecodeError("utf-8", data, at, at + 1, "no character of a text")
        return SourceText(name, data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        text = data[: error.start].decode("utf-8-sig", "replace")
        source = SourceText(name, text)
        message = f"byte 0x{data[error.start]:02x} is not UTF-8: this is no text file"
        place = source.place(len(text), len(text))
        raise ModelError([Diagnostic("E116", message, place, "save the file as UTF-8")]) from None
