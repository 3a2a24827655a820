"""An editor, as the language server sees it: JSON-RPC over the pipes of a process."""

import json
import select
import subprocess
import sys
import time
from contextlib import contextmanager
from itertools import count


class Editor:
    def __init__(self, folder):
        self.folder = folder
        self.process = subprocess.Popen(
            [sys.executable, "-m", "sysdyn", "lsp", "--stdio"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            cwd=folder,
            bufsize=0,
        )
        self._numbers = count(1)
        self._bytes = b""
        self.heard = []
        self.versions = {}

    def uri(self, name):
        return (self.folder / name).as_uri()

    def raw(self, data):
        self.process.stdin.write(data)

    def send(self, message):
        body = json.dumps({"jsonrpc": "2.0", **message}, ensure_ascii=False).encode()
        self.raw(b"Content-Length: %d\r\n\r\n" % len(body) + body)

    def tell(self, method, **params):
        self.send({"method": method, "params": params})

    def receive(self, seconds=30.0):
        """The next message of the server."""
        end = time.monotonic() + seconds
        while True:
            head, sign, rest = self._bytes.partition(b"\r\n\r\n")
            if sign:
                length = int(head.removeprefix(b"Content-Length: "))
                if len(rest) >= length:
                    self._bytes = rest[length:]
                    return json.loads(rest[:length])
            left = end - time.monotonic()
            ready = left > 0 and select.select([self.process.stdout], [], [], left)[0]
            assert ready, "the server is silent"
            data = self.process.stdout.read(65536)
            assert data, "the server has ended"
            self._bytes += data

    def answer(self, method, **params):
        """The whole answer to a request; what is told meanwhile is kept."""
        number = next(self._numbers)
        self.send({"id": number, "method": method, "params": params})
        while "id" not in (message := self.receive()):
            self.heard.append(message)
        assert message["id"] == number
        return message

    def ask(self, method, **params):
        message = self.answer(method, **params)
        assert "result" in message, message
        return message["result"]

    def begin(self):
        found = self.ask("initialize", processId=None, rootUri=None, capabilities={})
        self.tell("initialized")
        return found

    def open(self, name, text):
        self.versions[name] = 1
        document = {"uri": self.uri(name), "languageId": "sysdyn", "version": 1, "text": text}
        self.tell("textDocument/didOpen", textDocument=document)

    def change(self, name, *changes):
        self.versions[name] += 1
        document = {"uri": self.uri(name), "version": self.versions[name]}
        self.tell("textDocument/didChange", textDocument=document, contentChanges=list(changes))

    def close(self, name):
        self.tell("textDocument/didClose", textDocument={"uri": self.uri(name)})

    def findings(self, name, version=None):
        """The diagnostics that are published next for a document (of a version)."""
        while True:
            message = self.heard.pop(0) if self.heard else self.receive()
            params = message.get("params", {})
            if params.get("uri") == self.uri(name) and version in (None, params.get("version")):
                return params["diagnostics"]

    def at(self, method, name, text, word, shift=0, **more):
        """A request at a word of a text."""
        before = text[: text.index(word) + shift]
        line = before.count("\n")
        character = len(before.rpartition("\n")[2].encode("utf-16-le")) // 2
        where = {"line": line, "character": character}
        return self.ask(f"textDocument/{method}", textDocument={"uri": self.uri(name)}, position=where, **more)

    def end(self):
        self.ask("shutdown")
        self.tell("exit")
        return self.process.wait(10)


@contextmanager
def editor(folder):
    one = Editor(folder)
    try:
        yield one
    finally:
        one.process.kill()
        one.process.wait()
        for stream in (one.process.stdin, one.process.stdout, one.process.stderr):
            stream.close()
