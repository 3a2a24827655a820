"""Each code's page in `explain` tells the truth: its bad text raises the code, its good text does not."""

import json

import numpy as np
import pytest
from sysdyn.api import compile_model
from sysdyn.cli.console import Console
from sysdyn.cli.main import run
from sysdyn.cli.run.check.checking import check_target
from sysdyn.cli.run.request.targets import all_targets
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text import codes
from sysdyn.dsl.text.diagnostics import ModelError, SourceText

PAGES = codes.codes()
ELSEWHERE = {"W302", "W921", "E605"}
"""What a second file is needed for (test_authors.py, cli/test_lock.py), and what Python alone can ask for."""
CHECKED = sorted({c for c, page in PAGES.items() if page.by == codes.CHECK} - ELSEWHERE)
RUN = sorted(set(PAGES) - set(CHECKED) - ELSEWHERE)


def found(text: str) -> list[str]:
    console = Console("check", as_json=True, quiet=True, color="never")
    try:
        document = load.document(SourceText("example.sd", text), console.report)
        for target in all_targets(document, console.report):
            with ex.fresh():
                check_target(target, console.report)
    except ModelError as error:
        console.report.extend(error.diagnostics)
    return [d.code for d in console.report]


@pytest.mark.parametrize("code", [c for c in CHECKED if c != "N101"])
@pytest.mark.one_in(15)
def test_bad_example_raises_its_code_alone(code):
    raised = found(PAGES[code].bad)
    assert code in raised
    assert {c for c in raised if c[0] == "E"} <= {code}


@pytest.mark.parametrize("code", sorted(PAGES))
@pytest.mark.one_in(7)
def test_good_example_is_free_of_it(code):
    raised = found(PAGES[code].good)
    assert code not in raised
    assert not [c for c in raised if c[0] == "E"]


def said_by(command, text, folder, monkeypatch, capsys):
    """Codes and messages that a command of a page finds; its settings of the environment come first."""
    monkeypatch.chdir(folder)
    (folder / "example.sd").write_text(text)
    settings, _, arguments = command.partition("sysdyn ")
    if settings:
        monkeypatch.setenv("SYSDYN_CACHE", str(folder / "cache"))
    for name, value in (pair.split("=") for pair in settings.split()):
        monkeypatch.setenv(name, value)
    run([*("example.sd" if word == "FILE" else word for word in arguments.split()), "--json"])
    return [(d["code"], d["message"]) for d in json.loads(capsys.readouterr().out)["diagnostics"]]


def test_bad_example_of_a_compiled_module_is_refused_with_other_numbers(tmp_path):
    (tmp_path / "example.sd").write_text(PAGES["E605"].bad)
    module = compile_model(tmp_path / "example.sd", scene="go", formulation="co_lagrangian", backend="numpy")
    state = np.zeros(len(module.manifest["unknowns"]))
    module.residual(0.0, state, state)
    with pytest.raises(ModelError, match="E605: the law of Rs cannot be inverted: R is zero"):
        module.residual(0.0, state, state, {"R": 0.0})


@pytest.mark.parametrize("code", [*RUN, "N101"])
@pytest.mark.one_in(30)
def test_bad_example_of_a_run_raises_its_code_alone(code, tmp_path, monkeypatch, capsys):
    raised = said_by(PAGES[code].by, PAGES[code].bad, tmp_path, monkeypatch, capsys)
    if code == "E901":  # a finding without a place
        assert raised[0][1].startswith("E901: ")
        return
    assert code in [c for c, _ in raised]
    assert {c for c, _ in raised if c[0] == "E"} <= ({"E101"} if code == "N101" else {code})


@pytest.mark.parametrize("code", [c for c in RUN if not PAGES[c].by.startswith("sysdyn import")])
@pytest.mark.one_in(12)
def test_good_example_of_a_run_runs(code, tmp_path, monkeypatch, capsys):
    command = f"sysdyn {PAGES[code].by.partition('sysdyn ')[2].split()[0]} FILE"
    raised = [c for c, _ in said_by(command, PAGES[code].good, tmp_path, monkeypatch, capsys)]
    assert code not in raised
    assert not [c for c in raised if c[0] == "E"]
