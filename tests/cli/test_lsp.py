"""The language server through the protocol itself: positions and texts, not that something came."""

import json
import os
import signal
import time
from pathlib import Path

import pytest
import sysdyn.models
from editor import editor
from sysdyn.cli.lsp import hover, outline, positions
from sysdyn.cli.lsp.documents import Document
from sysdyn.cli.lsp.wire import BadMessage, Inbox
from sysdyn.cli.main import run
from sysdyn.cli.run.request.targets import all_targets
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.parser.parse import expected_words
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText

SPRING = """## A mass on a spring.
model spring {
  ## The mass that swings.
  param m = 1.5 kg
  param k = 4 N/m
  coord x: translation = 1 m
  energy T* = 1/2*m*x'^2
  energy V = 1/2*k*x^2
}
scene swing of spring { time 0 s to 1 s; trace x every 0.1 s }
"""
CIRCUIT = """from std.electrical import resistor

model rc {
  param R0 = 2 kohm
  node a, b: electrical
  E: effort(10 V) a -> ground
  R1: resistor(R = R0) a -> b
  C1: potential(q = 1 uF*e) b -> ground
}
"""


@pytest.fixture
def client(tmp_path):
    with editor(tmp_path) as one:
        one.begin()
        yield one


@pytest.mark.long
def test_a_connection_begins_and_ends(tmp_path):
    with editor(tmp_path) as one:
        early = one.answer("textDocument/hover", textDocument={"uri": "file:///x"}, position={})
        assert early["error"]["code"] == -32002
        found = one.begin()
        assert found["serverInfo"]["name"] == "sysdyn"
        assert found["capabilities"]["positionEncoding"] == "utf-16"
        assert found["capabilities"]["textDocumentSync"]["change"] == 2
        assert one.answer("textDocument/moniker")["error"]["code"] == -32601
        one.tell("$/cancelRequest", id=7)
        one.tell("$/setTrace", value="off")
        assert one.answer("textDocument/hover", textDocument=3, position=None)["error"]["code"] == -32602
        assert one.ask("shutdown") is None
        assert one.answer("textDocument/hover")["error"]["code"] == -32600
        one.tell("exit")
        assert one.process.wait(10) == 0


@pytest.mark.long
def test_an_exit_without_shutdown_is_one(tmp_path):
    with editor(tmp_path) as one:
        one.begin()
        one.tell("exit")
        assert one.process.wait(10) == 1
    with editor(tmp_path) as one:
        one.process.stdin.close()
        assert one.process.wait(10) == 1


@pytest.mark.long
def test_what_is_no_message_is_told_and_the_next_is_answered(client):
    client.raw(b"Content-Length: 5\r\n\r\n{oops")
    assert client.receive()["error"]["code"] == -32700
    client.raw(b"Content-Length: 2\r\n\r\n[]")
    assert client.receive()["error"]["code"] == -32600
    client.raw(b"Content-Length: many\r\n\r\n")
    assert client.receive()["error"]["code"] == -32700
    deep = b"[" * 100_000
    client.raw(b"Content-Length: %d\r\n\r\n" % len(deep) + deep)
    assert client.receive()["error"]["code"] == -32700
    assert client.answer("nothing")["error"]["message"] == "there is no method 'nothing'"
    assert client.end() == 0


def test_messages_arrive_in_pieces_and_together():
    whole = b"".join(b"Content-Length: %d\r\n\r\n%s" % (len(b), b) for b in (b'{"id":1}', '{"é":"😀"}'.encode()))
    inbox = Inbox()
    found = [m for k in range(len(whole)) for m in inbox.put(whole[k : k + 1])]
    assert found == [{"id": 1}, {"é": "😀"}]
    assert [*Inbox().put(whole * 2)] == found * 2
    (bad,) = Inbox().put(b"x" * 5000)
    assert isinstance(bad, BadMessage)


def test_positions_count_units_of_utf_16():
    source = SourceText("x", "a😀b\r\né😀\rz")
    offsets = [0, 1, 2, 3, 5, 6, 8]
    places = [(0, 0), (0, 1), (0, 3), (0, 4), (1, 0), (1, 1), (2, 0)]
    for at, (line, character) in zip(offsets, places, strict=True):
        assert positions.position(source, at) == {"line": line, "character": character}
        assert positions.offset(source, {"line": line, "character": character}) == at
    assert positions.offset(source, {"line": 0, "character": 2}) == 1, "inside a pair"
    assert positions.offset(source, {"line": 0, "character": 99}) == 3, "beyond the end of the line"
    assert positions.offset(source, {"line": 9, "character": 0}) == len(source.text)


def test_findings_are_those_of_check(client, tmp_path, capsys):
    """Errors, warnings and notes of unsaved text, with help and other places; columns behind astral characters."""
    wrong = SPRING.replace("1/2*m*x'^2", "1/2*n*x'^2").replace("m = 1.5 kg", "m = 1.5 kg # 😀\n  param m = 2 kg")
    wrong += "scene other of sprig { time 0 s to 1 s }\n"
    (tmp_path / "a.sd").write_text(wrong)
    assert run(["check", str(tmp_path / "a.sd"), "--json"]) == 1
    told = [d for d in json.loads(capsys.readouterr().out)["diagnostics"] if d["code"][0] == "E"]
    (tmp_path / "a.sd").write_text("")
    client.open("a.sd", wrong)
    found = client.findings("a.sd")
    assert len(told) > 2
    lines = wrong.split("\n")
    for d, t in zip(found, told, strict=True):
        assert d["code"] == t["code"]
        assert d["severity"] == 1
        assert t["message"] in d["message"]
        assert t["help"] in d["message"]
        head = lines[t["line"] - 1][: t["column"] - 1]
        assert d["range"]["start"] == {"line": t["line"] - 1, "character": len(head.encode("utf-16-le")) // 2}
        assert [r["location"]["range"]["start"]["line"] + 1 for r in d["relatedInformation"]] == [
            r["line"] for r in t["related"]
        ]
    client.change("a.sd", {"text": SPRING})
    assert client.findings("a.sd", 2) == []
    client.change("a.sd", {"text": wrong})
    assert len(client.findings("a.sd", 3)) == len(told)
    client.close("a.sd")
    assert client.findings("a.sd") == []
    assert client.end() == 0


@pytest.mark.long
def test_changes_are_made_in_order_and_the_newest_text_wins(client):
    text = SPRING.replace("A mass", "A 😀 mass")
    client.open("a.sd", text)
    assert client.findings("a.sd") == []
    at = {"line": 0, "character": 8}
    client.change(
        "a.sd",
        {"range": {"start": {"line": 0, "character": 5}, "end": at}, "text": ""},  # the astral one and a blank
        {"range": {"start": {"line": 6, "character": 18}, "end": {"line": 6, "character": 19}}, "text": "nn"},
    )
    for _ in range(5):
        client.change(
            "a.sd", {"range": {"start": {"line": 6, "character": 18}, "end": {"line": 6, "character": 19}}, "text": "n"}
        )
    (found,) = client.findings("a.sd", 7)
    assert found["code"] == "E101"
    assert found["range"] == {"start": {"line": 6, "character": 18}, "end": {"line": 6, "character": 20}}
    (symbol, _) = client.ask("textDocument/documentSymbol", textDocument={"uri": client.uri("a.sd")})
    assert symbol["name"] == "spring"
    published = [m for m in client.heard if m["params"].get("version", 0) in (2, 3, 4, 5, 6)]
    assert not published, "older texts are not checked"


@pytest.mark.long
def test_imports_are_read_from_open_documents_and_from_files(client, tmp_path):
    part = "component part {\n  branch: translation\n  param c = 1 N/m\n  law e = c*q\n}\n"
    user = "from parts import part\nmodel m {\n  node a: translation\n"
    user += "  M: kinetic(f = p/(1 kg)) a\n  S: part(c = 2 N/m) a\n}\n"
    (tmp_path / "parts.sd").write_text(part.replace("param c", "param d").replace("c*q", "d*q"))
    client.open("user.sd", user)
    (found,) = client.findings("user.sd")
    assert found["code"] == "E405"
    assert "'part' has no parameter 'c'" in found["message"]
    (tmp_path / "parts.sd").write_text(part)
    client.tell("workspace/didChangeWatchedFiles", changes=[])
    assert client.findings("user.sd") == [], "of the file"
    (tmp_path / "parts.sd").write_text("")
    client.open("parts.sd", part)
    client.findings("parts.sd")
    assert client.findings("user.sd") == [], "of the open document"
    (place,) = client.at("definition", "user.sd", user, "part(c")
    assert place == {
        "uri": client.uri("parts.sd"),
        "range": {"start": {"line": 0, "character": 10}, "end": {"line": 0, "character": 14}},
    }
    client.change("parts.sd", {"text": part.replace("law e", "law e e")})
    found = client.findings("parts.sd", 2)
    assert [d["severity"] for d in found] == [1]
    client.close("parts.sd")
    assert client.end() == 0


@pytest.mark.long
def test_names_of_files_are_as_the_editor_writes_them(client, tmp_path):
    """A URI with more signs escaped than need be, a folder with a blank, and a text that is no file."""
    folder = tmp_path / "a folder é#1"
    folder.mkdir()
    (folder / "parts.sd").write_text("component part {\n  branch: electrical\n  law e = 1 ohm*f\n}\n")
    text = "from parts import part\nmodel m {\n  node a: electrical\n  E: effort(e = 1 V) a\n  P: part(R = 2) a\n}\n"
    for uri in ((folder / "m.sd").as_uri().replace("m.sd", "%6D.sd"), "untitled:Untitled-1"):
        document = {"uri": uri, "languageId": "sysdyn", "version": 1, "text": text}
        client.tell("textDocument/didOpen", textDocument=document)
        message = client.receive()
        assert message["params"]["uri"] == uri
        code = "E103" if uri.startswith("untitled") else "E405"
        assert [d["code"] for d in message["params"]["diagnostics"]] == [code]


@pytest.mark.long
def test_layout_is_that_of_fmt(client, tmp_path, capsys):
    text = SPRING.replace("  param k = 4 N/m", "param   k=4 N/m").replace("A mass", "A 😀 mass")
    client.open("a.sd", text)
    options = {"tabSize": 2, "insertSpaces": True}
    document = {"uri": client.uri("a.sd")}
    (change,) = client.ask("textDocument/formatting", textDocument=document, options=options)
    lines = text.split("\n")
    first, last = change["range"]["start"], change["range"]["end"]
    assert first["character"] == last["character"] == 0
    new = "\n".join(lines[: first["line"]]) + "\n" + change["newText"] + "\n".join(lines[last["line"] :])
    (tmp_path / "b.sd").write_text(text)
    assert run(["fmt", str(tmp_path / "b.sd")]) == 0
    assert new == (tmp_path / "b.sd").read_text()
    assert last["line"] - first["line"] == 1
    client.change("a.sd", {"text": new})
    assert client.ask("textDocument/formatting", textDocument=document, options=options) == []
    client.change("a.sd", {"text": new + "model {"})
    assert client.ask("textDocument/formatting", textDocument=document, options=options) is None


@pytest.mark.long
def test_safe_changes_are_offered_and_mend(client):
    text = SPRING.replace("1/2*k*x^2", "1/2*k*x**2")
    client.open("a.sd", text)
    found = client.findings("a.sd")
    assert found
    where = found[0]["range"]
    given = {"textDocument": {"uri": client.uri("a.sd")}, "range": where, "context": {"diagnostics": found}}
    fix, everything = client.ask("textDocument/codeAction", **given)
    assert fix["kind"] == "quickfix"
    assert fix["title"] == "Replace '**' by '^'"
    assert fix["diagnostics"] == found[:1]
    (change,) = fix["edit"]["changes"][client.uri("a.sd")]
    column = text.split("\n")[7].index("**")
    assert change == {
        "range": {"start": {"line": 7, "character": column}, "end": {"line": 7, "character": column + 2}},
        "newText": "^",
    }
    assert everything["kind"] == "source.fixAll"
    assert everything["edit"]["changes"][client.uri("a.sd")] == [change]
    client.change("a.sd", {"range": change["range"], "text": change["newText"]})
    assert client.findings("a.sd", 2) == []
    assert client.ask("textDocument/codeAction", **given) == []


@pytest.mark.long
def test_hover_tells_what_a_name_is(client):
    client.open("a.sd", SPRING)
    assert client.findings("a.sd") == []
    while "in m" not in client.at("hover", "a.sd", SPRING, "x every")["contents"]["value"]:
        pass  # what the model has is told behind its findings
    said = client.at("hover", "a.sd", SPRING, "m*x'")
    assert said["range"] == {"start": {"line": 6, "character": 18}, "end": {"line": 6, "character": 19}}
    text = said["contents"]["value"]
    assert "param m = 1.5 kg" in text
    assert "parameter" in text
    assert "1.5 kg" in text
    assert "The mass that swings." in text
    assert client.at("hover", "a.sd", SPRING, "The mass") is None, "a comment"
    client.open("c.sd", CIRCUIT)
    text = client.at("hover", "c.sd", CIRCUIT, "resistor(R")["contents"]["value"]
    assert "component resistor" in text
    assert "- param `R: ohm" in text
    assert "R0" in client.at("hover", "c.sd", CIRCUIT, "R0)")["contents"]["value"]
    wrong = SPRING.replace("*m*", "*n*")
    client.change("a.sd", {"text": wrong})
    client.findings("a.sd", 2)
    assert "sysdyn explain E101" in client.at("hover", "a.sd", wrong, "n*x'")["contents"]["value"]


@pytest.mark.long
def test_definitions_and_references(client):
    client.open("c.sd", CIRCUIT)
    (place,) = client.at("definition", "c.sd", CIRCUIT, "R0)")
    assert place["range"] == {"start": {"line": 3, "character": 8}, "end": {"line": 3, "character": 10}}
    (place,) = client.at("definition", "c.sd", CIRCUIT, "b\n  C1")
    assert place["range"]["start"] == {"line": 4, "character": 10}
    (place,) = client.at("definition", "c.sd", CIRCUIT, "resistor(R")
    assert place["uri"].endswith("/std/electrical.sd")
    (place,) = client.at("definition", "c.sd", CIRCUIT, "electrical import")
    assert place["uri"].endswith("/std/electrical.sd")
    context = {"includeDeclaration": False}
    found = client.at("references", "c.sd", CIRCUIT, "a, b", context=context)
    assert [p["range"]["start"] for p in found] == [{"line": 5, "character": 18}, {"line": 6, "character": 23}]


@pytest.mark.long
def test_names_are_changed_where_they_mean_the_same(client):
    text = """component part {
  branch: electrical
  param R: ohm
  law e = R*f
}
model m {
  param R = 3 ohm
  param p = 2 uF
  param m = 1 kg # m
  coord x: translation = 1 m
  energy T* = 1/2*m*x'^2
  node a: electrical
  E: effort(1 V) a
  P: part(R = R) a
  C: potential(q = p*e) a
}
scene s of m { time 0 s to 1 s; set R = 2 ohm; trace P.R, R, P.f }
"""
    client.open("r.sd", text)
    (place,) = client.at("definition", "r.sd", text, "R = R) a")
    assert place["range"]["start"] == {"line": 2, "character": 8}, "of the component"
    (place,) = client.at("definition", "r.sd", text, "R) a")
    assert place["range"]["start"] == {"line": 6, "character": 8}, "of the model"
    changed = client.at("rename", "r.sd", text, "R = 3", newName="R0")["changes"][client.uri("r.sd")]
    assert [(c["range"]["start"]["line"], c["range"]["start"]["character"]) for c in changed] == [
        (6, 8),
        (13, 14),
        (16, 36),
        (16, 58),
    ]
    changed = client.at("rename", "r.sd", text, "R: ohm", newName="Rp")["changes"][client.uri("r.sd")]
    assert [(c["range"]["start"]["line"], c["range"]["start"]["character"]) for c in changed] == [
        (2, 8),
        (3, 10),
        (13, 10),
        (16, 55),
    ]
    changed = client.at("rename", "r.sd", text, "m = 1", newName="mass")["changes"][client.uri("r.sd")]
    starts = [(c["range"]["start"]["line"], c["range"]["start"]["character"]) for c in changed]
    assert starts == [(8, 8), (10, 18)], "no unit, no comment, no model"
    assert client.at("hover", "r.sd", text, "m\n  energy")["contents"]["value"] == "`m`: 1 m"
    where = {"line": 6, "character": 8}
    for name, said in (("p", "declared already"), ("1x", "cannot be a name"), ("param", "cannot be a name")):
        given = {"textDocument": {"uri": client.uri("r.sd")}, "position": where, "newName": name}
        assert said in client.answer("textDocument/rename", **given)["error"]["message"]


@pytest.mark.long
def test_levels_are_names_of_their_own(client):
    text = """component part {
  port p: electrical
  param electrical = 1 ohm
  level one default { R: dissipator(e = electrical*f) p }
  level electrical extends one { C: potential(q = 1 uF*e) p }
}
model m {
  node a: electrical
  E: effort(1 V) a
  P: part p = a
}
scene s of m { level P = electrical; time 0 s to 1 s; trace P.p.f }
"""
    client.open("l.sd", text)
    for word, place in (("electrical; time", (4, 8)), ("electrical*f", (2, 8)), ("one {", (3, 8))):
        (found,) = client.at("definition", "l.sd", text, word)
        assert tuple(found["range"]["start"].values()) == place, word
    (found,) = client.at("definition", "l.sd", text, "electrical\n  param")
    assert found["uri"].endswith("/std/prelude.sd")


@pytest.mark.long
def test_symbols_are_those_of_the_text(client):
    client.open("a.sd", SPRING)
    model, scene = client.ask("textDocument/documentSymbol", textDocument={"uri": client.uri("a.sd")})
    assert [model["name"], scene["name"]] == ["spring", "swing"]
    assert [(c["name"], c["detail"]) for c in model["children"]] == [
        ("m", "parameter"),
        ("k", "parameter"),
        ("x", "coordinate translation"),
    ]
    assert model["children"][0]["selectionRange"]["start"] == {"line": 3, "character": 8}


def _labels(client, name, text, word, shift=0):
    return {item["label"]: item for item in client.at("completion", name, text, word, shift)}


@pytest.mark.long
def test_completion_offers_what_fits(client):
    text = CIRCUIT.replace("  C1:", "  pa\n  C1:") + "scene s of rc { time 0 s to 1 s; trace R1. }\n"
    client.open("c.sd", text)
    words = _labels(client, "c.sd", text, "pa\n", 2)
    assert {"param", "node", "coord", "energy"} <= set(words)
    assert not {"trace", "model", "from"} & set(words)
    assert {"model", "component", "from"} <= set(_labels(client, "c.sd", text, "scene s"))
    assert not {"R0", "sin"} & set(words)
    text = text.replace("trace R1.", "set R0 = 2 ohm; trace R1.")
    client.change("c.sd", {"text": text})
    assert _labels(client, "c.sd", text, "R0 = 2 ohm")["R0"]["detail"].startswith("parameter")
    assert "R0" not in _labels(client, "c.sd", text, "trace R1")
    members = _labels(client, "c.sd", text, "R1. }", 3)
    assert {"e", "f", "q", "p", "R"} <= set(members)
    assert members["e"]["detail"] == "effort"
    names = _labels(client, "c.sd", text, "R0) a", 1)
    assert names["R0"]["detail"].startswith("parameter")
    assert "sin" in names
    assert names["R"]["insertText"] == "R = "
    parts = _labels(client, "c.sd", text, "resistor(R", 3)
    assert parts["resistor"]["detail"].startswith("component")
    assert parts["capacitor"]["detail"] == "std.electrical"
    (change,) = parts["capacitor"]["additionalTextEdits"]
    assert change == {
        "range": {"start": {"line": 0, "character": 35}, "end": {"line": 0, "character": 35}},
        "newText": ", capacitor",
    }
    assert "electrical" in _labels(client, "c.sd", text, "electrical\n  E", 2)
    assert {"V", "ohm"} <= set(_labels(client, "c.sd", text, "kohm", 1))
    assert "electrical" in _labels(client, "c.sd", text, "electrical import", 2)
    assert "resistor" in _labels(client, "c.sd", text, "resistor\n", 2)


@pytest.mark.long
def test_hostile_texts_harm_nobody(client):
    """Bytes of all kinds, deep nests and half messages: answers, and nothing else on standard output."""
    for k, text in enumerate(
        ("(" * 5000, "\x00\ud800", "model m { param a = __import__('os').system('x') }", "{" * 9999)
    ):
        name = f"h{k}.sd"
        document = {"uri": client.uri(name), "languageId": "sysdyn", "version": 1, "text": text}
        client.raw(_ascii({"method": "textDocument/didOpen", "params": {"textDocument": document}}))
        assert client.findings(name)
        client.at("completion", name, "\n", "\n")
        client.at("hover", name, "\n", "\n")
    client.send({"id": 1.5, "method": "shutdown"})
    assert client.receive()["error"]["code"] == -32600
    client.raw(_ascii({"id": float("nan"), "method": "shutdown"}))
    assert client.receive()["error"]["code"] == -32700
    client.tell("textDocument/didChange", textDocument=5)
    client.tell("textDocument/didOpen")
    assert client.end() == 0


@pytest.mark.long
def test_a_check_that_dies_is_told_and_the_next_text_is_checked(client, tmp_path):
    client.open("a.sd", SPRING)
    assert client.findings("a.sd") == []
    children = Path(f"/proc/{client.process.pid}/task/{client.process.pid}/children")
    if not children.exists():
        pytest.skip("not on this system")
    for child in children.read_text().split():
        os.kill(int(child), signal.SIGKILL)
    client.change("a.sd", {"text": SPRING.replace("*m*", "*n*")})
    found = client.findings("a.sd", 2)
    if "died" in found[0]["message"]:  # it was given the text before it was gone
        client.change("a.sd", {"text": SPRING.replace("*m*", "*n*")})
        found = client.findings("a.sd", 3)
    assert [d["code"] for d in found] == ["E101"]
    assert client.end() == 0


def test_json_is_refused(capsys):
    assert run(["lsp", "--json"]) == 2
    assert "standard output belongs to the protocol" in capsys.readouterr().out


@pytest.mark.parametrize("model", ["seed/dc_motor.sd", "gallery/ev_powertrain.sd"])
def test_a_name_changed_everywhere_leaves_a_model_what_it_is(model):
    """Every name of a model text under another one: the same kinds of network, and no errors."""
    path = Path(sysdyn.models.__file__).parent / model
    document = Document(path.as_uri(), path.read_text(), 1)
    declared = [*outline.items(document.tree)]
    declared += [d for i in declared if i.body for d in outline.body(document.source, i.body)]
    assert len(declared) > 10
    every = 1 if os.environ.get("SYSDYN_LONG") else 3
    for d in [*{d.place.span: d for d in declared}.values()][::every]:
        changes = hover.rename_edits(document, d.place.span.start, "other_name")["changes"][document.uri]
        text = document.source.text
        for change in reversed(changes):
            start, end = (positions.offset(document.source, change["range"][side]) for side in ("start", "end"))
            assert text[start:end] == d.name
            text = text[:start] + "other_name" + text[end:]
        report = Report()
        whole = load.document(SourceText(str(path), text), report)
        for target in all_targets(whole, report):
            with ex.fresh():
                load.network(whole, target.model, target.scene, report, required=False)
        assert not report.failed, (d.name, [f.message for f in report])


def test_words_that_the_grammar_allows():
    def words(text):
        return expected_words(SourceText("x", text))

    assert {"model", "component", "scene"} <= words("")
    assert "trace" not in words("")
    assert {"param", "law", "for"} <= words("model m {\n  param k = 1\n  ")
    assert words("model m {\n  coord x: translation ") >= {"tangible", "intangible"}
    assert "to" in words("scene s of m {\n  time 0 s ")
    assert "every" in words("scene s of m {\n  trace x ")
    assert words("model m { law e = (((" + "(" * 300) is not None


def _ascii(message):
    body = json.dumps({"jsonrpc": "2.0", **message}).encode()
    return b"Content-Length: %d\r\n\r\n" % len(body) + body


@pytest.mark.parametrize("name", ["t", "pi", "ground", "audit", "if", "true"])
@pytest.mark.long
def test_no_name_becomes_one_that_the_language_has(client, name):
    client.open("s.sd", SPRING)
    given = {"textDocument": {"uri": client.uri("s.sd")}, "position": {"line": 3, "character": 8}, "newName": name}
    assert "cannot be a name" in client.answer("textDocument/rename", **given)["error"]["message"]


@pytest.mark.long
def test_nine_megabytes_block_nobody(client):
    large = SPRING + "# " + "a" * 9_000_000 + "\n" + "model m {\n}\n" * 3
    client.open("large.sd", large)
    client.open("s.sd", SPRING)
    assert "param m = 1.5 kg" in client.at("hover", "s.sd", SPRING, "m = 1.5")["contents"]["value"]
    assert client.at("hover", "large.sd", SPRING, "m = 1.5") is None
    given = {"textDocument": {"uri": client.uri("large.sd")}}
    assert "longer than" in client.answer("textDocument/formatting", **given)["error"]["message"]
    client.change("large.sd", {"text": SPRING})  # the newer text ends the check of the older one
    assert client.findings("large.sd", 2) == []


@pytest.mark.long
def test_a_killed_server_leaves_no_checker(tmp_path):
    rows = "".join(f"  let a{k} = {'sin(' * 60}x/(1 m){')' * 60}\n" for k in range(3000))
    with editor(tmp_path) as one:
        one.begin()
        one.open("s.sd", SPRING)
        one.findings("s.sd")
        (children,) = Path(f"/proc/{one.process.pid}/task").glob("*/children")
        checkers = [int(pid) for pid in children.read_text().split()]
        one.open("busy.sd", SPRING.replace("  coord x", f"{rows}  coord x"))
        one.ask("textDocument/documentSymbol", textDocument={"uri": one.uri("s.sd")})
        one.process.kill()
        one.process.wait(10)
        assert checkers
        for _ in range(1000):
            if not any(_alive(pid) for pid in checkers):
                break
            time.sleep(0.02)
        assert not any(_alive(pid) for pid in checkers)


def _alive(pid):
    stat = Path(f"/proc/{pid}/stat")
    try:
        return stat.read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
