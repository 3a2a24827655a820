"""The object that --json prints (CONTRACT, version 1), as a small schema of our own."""

NUMBER = (int, float)
ENVELOPE = {
    "version": int,
    "command": (str, type(None)),
    "ok": bool,
    "exit": int,
    "diagnostics": list,
    "result": dict,
}
DIAGNOSTIC = {
    "code": str,
    "severity": str,
    "message": str,
    "help": (str, type(None)),
    "file": (str, type(None)),
    "line": (int, type(None)),
    "column": (int, type(None)),
    "end_line": (int, type(None)),
    "end_column": (int, type(None)),
    "related": list,
}
RELATED = {"file": str, "line": int, "column": int, "message": str}
STATISTICS = {
    "steps": int,
    "rejected_steps": int,
    "residual_evaluations": int,
    "jacobian_evaluations": int,
    "factorisations": int,
    "newton_failures": int,
    "error_estimate": (*NUMBER, type(None)),
}
TIMINGS = {"cpu_integrate_s": NUMBER, "wall_integrate_s": NUMBER, "cpu_compile_s": NUMBER, "wall_total_s": NUMBER}
SIMULATE = {
    "trace": str,
    "final": bool,
    "reached": NUMBER,
    "formulation": str,
    "method": str,
    "index": str,
    "start_strategy": str,
    "statistics": dict,
    "timings": dict,
    "error_estimate": (*NUMBER, type(None)),
    "expects": list,
}
EXPECT = {
    "text": str,
    "ok": (bool, type(None)),
    "value": (*NUMBER, type(None)),
    "time": (*NUMBER, type(None)),
}
MANIFEST = {
    "version": int,
    "model": str,
    "scene": (str, type(None)),
    "formulation": str,
    "index": (int, type(None)),
    "unknowns": list,
    "rows": list,
    "parameters": list,
}
UNKNOWN = {"name": str, "kind": str, "unit": str, "differential": bool}
ROW = {"label": str, "kind": str, "file": str, "line": int}
PARAMETER = {"name": str, "unit": str, "value": (*NUMBER, list)}
CHECK = {"files": list, "edits": list}
EDIT = {
    "diagnostic": int,
    "file": str,
    "line": int,
    "column": int,
    "end_line": int,
    "end_column": int,
    "text": str,
}
TARGET = {"scene": (str, type(None)), "model": str, "ok": bool}
FMT = {"changed": list}
LINEARIZE = {
    "E": list,
    "A": list,
    "B": list,
    "C": list,
    "D": list,
    "states": list,
    "inputs": list,
    "outputs": list,
    "eigenvalues": list,
    "participation": list,
    "modes": list,
    "reduced": dict,
    "transfer": list,
    "t": NUMBER,
    "point": dict,
    "moving": bool,
    "formulation": str,
    "index": str,
}
MODE = {"eigenvalue": list, "frequency": NUMBER, "damping": (*NUMBER, type(None)), "participation": dict}
EQUILIBRIUM = {"t": NUMBER, "formulation": str, "equilibria": list}
REST = {
    "values": dict,
    "stability": (str, type(None)),
    "by": (str, type(None)),
    "why": (str, type(None)),
    "eigenvalues": list,
    "energy": (str, type(None)),
    "stiffness": (list, type(None)),
    "conservative": (bool, type(None)),
    "residual": NUMBER,
    "free": list,
    "contacts": dict,
}
LINES = ("functions", "equations", "counted", "multipliers", "senses")
EQUATIONS = {"formulation": str, "form": str} | dict.fromkeys(LINES, list)
EQUATION = {
    "kind": str,
    "label": str,
    "text": str,
    "latex": str,
    "file": (str, type(None)),
    "line": (int, type(None)),
}
EXPLAIN = {"code": str, "text": str}
PLOT = {"picture": str, "traces": list, "quantities": list}


def conforms(value, schema):
    """Assert that an object has the keys of a schema, with their types."""
    assert isinstance(value, dict)
    for key, kind in schema.items():
        assert key in value, f"{key} is missing in {sorted(value)}"
        assert isinstance(value[key], kind), f"{key}: {value[key]!r}"
        if kind is int:
            assert not isinstance(value[key], bool), key


def envelope(found, command, result=None):
    """Assert that a whole object is as CONTRACT says; result: the schema of its result, where there is one."""
    assert list(found) == list(ENVELOPE)
    conforms(found, ENVELOPE)
    assert found["version"] == 1
    assert found["command"] == command
    assert found["ok"] == (found["exit"] == 0)
    for diagnostic in found["diagnostics"]:
        assert list(diagnostic) == list(DIAGNOSTIC)
        conforms(diagnostic, DIAGNOSTIC)
        assert diagnostic["severity"] in ("error", "warning", "note")
        assert diagnostic["message"]
        if diagnostic["line"] is not None:
            assert diagnostic["line"] >= 1
            assert diagnostic["column"] >= 1
            first = (diagnostic["line"], diagnostic["column"])
            assert (diagnostic["end_line"], diagnostic["end_column"]) >= first
        for related in diagnostic["related"]:
            conforms(related, RELATED)
    if result is not None:
        conforms(found["result"], result)
