"""The server: messages in, answers and notifications out, one at a time; the checks are another process's."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Sequence
from typing import Any

from sysdyn import __version__
from sysdyn.cli.lsp import completion, findings, hover, outline, positions, wire
from sysdyn.cli.lsp.checker import Accounts, Checker, visible_findings
from sysdyn.cli.lsp.documents import LONGEST, Document, Documents
from sysdyn.cli.run.check.checking import Checked
from sysdyn.dsl.text.diagnostics import Diagnostic
from sysdyn.dsl.text.source import Span

CAPABILITIES = {
    "positionEncoding": "utf-16",
    "textDocumentSync": {"openClose": True, "change": 2, "save": {"includeText": False}},
    "documentFormattingProvider": True,
    "codeActionProvider": {"codeActionKinds": ["quickfix", "source.fixAll"]},
    "hoverProvider": True,
    "definitionProvider": True,
    "referencesProvider": True,
    "renameProvider": True,
    "documentSymbolProvider": True,
    "completionProvider": {"triggerCharacters": [".", ":"]},
}
UNREADABLE = (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError)
"""What parameters that are not those of the protocol raise: told to the client, no fault."""
Send = Callable[[dict[str, Any]], None]


class RefusedError(Exception):
    """What was asked cannot be done; the message says why."""


class Server:
    """The state of one connection.  send: writes a message; exit_code: set when the client wants the server to end."""

    def __init__(self, send: Send, checker: Checker | None = None) -> None:
        self._send = send
        self.checker = checker or Checker()
        self.exit_code: int | None = None
        self._documents = Documents()
        self._found: dict[str, tuple[Diagnostic, ...]] = {}  # of the last check of each open document
        self._published: dict[str, dict[str, list[dict[str, Any]]]] = {}  # by the checked one, then by the shown one
        self._initialized = False
        self._shut = False
        self._requests: dict[str, Callable[[dict[str, Any]], Any]] = {
            "initialize": self._initialize,
            "shutdown": self._shut_down,
            "textDocument/formatting": self._formatting,
            "textDocument/codeAction": self._actions,
            "textDocument/hover": self._hover,
            "textDocument/definition": self._definition,
            "textDocument/references": self._references,
            "textDocument/rename": self._rename,
            "textDocument/documentSymbol": self._symbols,
            "textDocument/completion": self._completion,
        }
        self._notifications: dict[str, Callable[[dict[str, Any]], None]] = {
            "initialized": lambda _: self.checker.begin(),
            "exit": self._exit,
            "textDocument/didOpen": self._open_document,
            "textDocument/didChange": self._change_document,
            "textDocument/didSave": self._save_document,
            "textDocument/didClose": self._close_document,
            "workspace/didChangeWatchedFiles": self._others_changed,
        }

    def receive(self, message: dict[str, Any] | wire.BadMessage) -> None:
        """Answer a request, take note of a notification."""
        if isinstance(message, wire.BadMessage):
            self._refuse(None, message.code, str(message))
            return
        method, number = message.get("method"), message.get("id")
        # ids are numbers or texts
        if number is not None and type(number) not in (int, str):
            self._refuse(None, wire.INVALID_REQUEST, "the id of a message is a whole number or a text")
            return
        # an answer to what was never asked, or nonsense
        if not isinstance(method, str):
            if "id" not in message or not ("result" in message or "error" in message):
                self._refuse(number, wire.INVALID_REQUEST, "a message without a method")
            return  # an answer: nothing was asked
        params = message.get("params")
        given = params if isinstance(params, dict) else {}
        # a request wants an answer, whatever happens
        if "id" in message:
            self._answer(number, method, given)
        # notifications count between initialize and shutdown
        elif method == "exit" or (self._initialized and not self._shut and method in self._notifications):
            try:
                self._notifications[method](given)
            except UNREADABLE as error:
                print(f"sysdyn lsp: parameters of '{method}' that cannot be read: {error!r:.200}", file=sys.stderr)
            except Exception as error:
                _log(method, error)

    def _answer(self, number: Any, method: str, params: dict[str, Any]) -> None:
        """The answer to one request; a fault in it is told, and the next one is answered."""
        # out of turn: unknown, before `initialize`, after `shutdown`
        if method not in self._requests:
            self._refuse(number, wire.METHOD_NOT_FOUND, f"there is no method '{method[:100]}'")
        elif not self._initialized and method != "initialize":
            self._refuse(number, wire.NOT_INITIALIZED, "'initialize' comes first")
        elif self._shut or (self._initialized and method == "initialize"):
            self._refuse(number, wire.INVALID_REQUEST, f"'{method}' comes too late")
        else:
            try:
                result = self._requests[method](params)
            # what cannot be done now; parameters out of shape; a fault of our own
            except RefusedError as error:
                self._refuse(number, wire.REQUEST_FAILED, str(error))
            except UNREADABLE as error:
                self._refuse(number, wire.INVALID_PARAMS, f"parameters of '{method}' that cannot be read: {error!r}")
            except Exception as error:
                _log(method, error)
                self._refuse(number, wire.INTERNAL_ERROR, f"a fault in sysdyn: {type(error).__name__}: {error}")
            else:
                self._send({"id": number, "result": result})

    def _refuse(self, number: Any, code: int, message: str) -> None:
        self._send({"id": number, "error": {"code": code, "message": message}})

    # -- the life of a connection --------------------------------------------------------------------------

    def _initialize(self, _: dict[str, Any]) -> dict[str, Any]:
        self._initialized = True
        return {"capabilities": CAPABILITIES, "serverInfo": {"name": "sysdyn", "version": __version__}}

    def _shut_down(self, _: dict[str, Any]) -> None:
        self._shut = True

    def _exit(self, _: dict[str, Any]) -> None:
        self.exit_code = 0 if self._shut else 1

    # -- documents and their findings ----------------------------------------------------------------------

    def _open_document(self, params: dict[str, Any]) -> None:
        item = params["textDocument"]
        self._hold(Document(str(item["uri"]), str(item["text"]), item.get("version")), at_once=True)

    def _change_document(self, params: dict[str, Any]) -> None:
        item = params["textDocument"]
        document = self._documents.get(item["uri"])
        if document is not None:
            self._hold(document.apply_changes(params["contentChanges"], item.get("version")))

    def _save_document(self, params: dict[str, Any]) -> None:
        document = self._documents.get(params["textDocument"]["uri"])
        if document is not None:  # files beside it may have changed too
            self._ask(document, at_once=True)

    def _others_changed(self, _: dict[str, Any]) -> None:
        for document in self._documents.all():
            self.checker.ask(document.name)

    def _close_document(self, params: dict[str, Any]) -> None:
        """Forget a document that was closed; files that import it are checked again as it is on disk."""
        document = self._documents.get(params["textDocument"]["uri"])
        if document is None:
            return
        others = self._documents.dependent(document)
        self._documents.close(document.uri)
        self.checker.forget(document.name)
        self._found.pop(document.uri, None)
        self._publish(document.uri, {})
        for other in others:
            if other is not document:
                self.checker.ask(other.name)

    def _hold(self, document: Document, at_once: bool = False) -> None:
        self._documents.put(document)
        self._ask(document, at_once)

    def _ask(self, document: Document, at_once: bool = False) -> None:
        for other in self._documents.dependent(document):
            self.checker.ask(other.name, at_once)

    def publish_check(self, name: str, text: str | None, result: Checked | Accounts) -> None:
        """Publish what the check of a text found, if it is open still and no newer one waits."""
        document = self._documents.find_by_name(name)
        # the text changed, or was closed, while it was checked
        if document is None or document.source.text != text:
            return
        # what hover says of elements, not findings
        if not isinstance(result, Checked):
            document.accounts = result
            return
        found = visible_findings(result)
        self._found[document.uri] = tuple(found)
        listed = findings.by_uri(found, document.uri, self._documents.uri_of)
        if result.unread is not None:
            listed[document.uri].append(findings.unread(result.unread))
        self._publish(document.uri, listed)

    def _publish(self, checked: str, listed: dict[str, list[dict[str, Any]]]) -> None:
        """Show the diagnostics of a check, and what others found in the same texts; an open text has its own alone."""
        before = self._published.pop(checked, {})
        if listed:
            self._published[checked] = listed
        for uri in dict.fromkeys([*listed, *before, checked]):
            document = self._documents.get(uri)
            by = [self._published.get(uri, {})] if document is not None else [*self._published.values()]
            told = [d for found in by for d in found.get(uri, [])]
            params: dict[str, Any] = {"uri": uri, "diagnostics": [d for k, d in enumerate(told) if d not in told[:k]]}
            if document is not None and document.version is not None:
                params["version"] = document.version
            self._send({"method": "textDocument/publishDiagnostics", "params": params})

    # -- requests about a document -------------------------------------------------------------------------

    def _document(self, params: dict[str, Any]) -> Document | None:
        return self._documents.get(params["textDocument"]["uri"])

    def _formatting(self, params: dict[str, Any]) -> Any:
        document = self._document(params)
        if document is not None and document.long:
            raise RefusedError(f"the text is longer than {LONGEST} characters: sysdyn fmt lays it out")
        return None if document is None else findings.format_edits(document)

    def _actions(self, params: dict[str, Any]) -> Any:
        document = self._document(params)
        if document is None:
            return None
        start, end = (positions.offset(document.source, params["range"][side]) for side in ("start", "end"))
        only: Sequence[str] = params.get("context", {}).get("only") or ()
        return findings.actions(document, self._found.get(document.uri, ()), Span(start, end), only)

    def _document_and_offset(self, params: dict[str, Any]) -> tuple[Document, int] | None:
        document = self._document(params)
        return None if document is None else (document, positions.offset(document.source, params["position"]))

    def _hover(self, params: dict[str, Any]) -> Any:
        at = self._document_and_offset(params)
        return None if at is None else hover.hover(*at, self._found.get(at[0].uri, ()))

    def _definition(self, params: dict[str, Any]) -> Any:
        at = self._document_and_offset(params)
        return None if at is None else hover.definition(*at)

    def _references(self, params: dict[str, Any]) -> Any:
        at = self._document_and_offset(params)
        whole = bool(params.get("context", {}).get("includeDeclaration", True))
        return None if at is None else hover.references(*at, whole)

    def _rename(self, params: dict[str, Any]) -> Any:
        at = self._document_and_offset(params)
        if at is not None and at[0].long:
            raise RefusedError(f"the text is longer than {LONGEST} characters: its names are not looked for")
        try:
            return None if at is None else hover.rename_edits(*at, str(params["newName"]))
        except ValueError as error:
            raise RefusedError(str(error)) from None

    def _symbols(self, params: dict[str, Any]) -> Any:
        document = self._document(params)
        return None if document is None else outline.symbols(document.tree)

    def _completion(self, params: dict[str, Any]) -> Any:
        at = self._document_and_offset(params)
        return None if at is None else completion.complete(*at)


def _log(method: str, error: Exception) -> None:
    print(f"sysdyn lsp: {method}: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
    traceback.print_exception(error, file=sys.stderr)
