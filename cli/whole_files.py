"""Files that commands write: the one at the path is always whole; texts in them."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from pathlib import Path

from sysdyn.cli.streams import put


@contextlib.contextmanager
def naming_file(path: str | Path) -> Iterator[None]:
    """An OSError within names the file."""
    try:
        yield
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise


def write(path: str | Path, data: str | bytes) -> None:
    """To standard output where the path is '-'; else beside the file, then renamed: one that cannot be written leaves
    what was there.  OSError names the file.
    """
    if str(path) == "-":
        put(data)
        return
    content = data.encode("utf-8") if isinstance(data, str) else data
    with naming_file(path):
        if Path(path).exists() and not Path(path).is_file():  # a device, a pipe, a folder
            Path(path).write_bytes(content)
            return
        target = Path(os.path.realpath(path))
        try:
            replace(target, content)
        except PermissionError:  # the folder takes no new file, but this one may be written
            target.write_bytes(content)


def replace(target: Path, data: str | bytes) -> None:
    """Beside the file, then renamed, or not at all: it is never half written.  OSError names the file."""
    part = target.with_name(f".{os.urandom(8).hex()}.part")
    with naming_file(target):
        try:
            with part.open("xb") as stream:
                stream.write(data.encode("utf-8") if isinstance(data, str) else data)
            if target.exists():
                part.chmod(target.stat().st_mode)
            part.replace(target)
        except BaseException:
            part.unlink(missing_ok=True)
            raise


def toml_text(value: str) -> str:
    """A basic string of TOML; JSON's escapes are TOML's but for DEL and lone surrogates."""
    safe = value.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(safe, ensure_ascii=False).replace("\x7f", "\\u007F")
