"""Each code's page in `explain` tells the truth: its bad text raises the code, its good text does not."""

import pytest
from sysdyn.cli.commands.check_command import _target
from sysdyn.cli.console import Console
from sysdyn.cli.run.targets import all_targets
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text import codes
from sysdyn.dsl.text.diagnostics import ModelError, SourceText

ELSEWHERE = {
    "E901": "a scene that is not there is named on the command line",
    "E907": "found when simulating",
    "E909": "found when simulating, but for static claims",
    **dict.fromkeys(("E608", "W920", "E931", "E932", "E933", "E934"), "found when simulating"),
}
EXAMPLES = {code: page for code, page in codes.codes().items() if page.bad}


def found(text: str) -> list[str]:
    console = Console("check", as_json=True, quiet=True, color="never")
    try:
        document = load.document(SourceText("example.sd", text), console.report)
        for target in all_targets(document, console.report):
            with ex.fresh():
                _target(console, target)
    except ModelError as error:
        console.report.extend(error.diagnostics)
    return [d.code for d in console.report]


@pytest.mark.parametrize("code", sorted(set(EXAMPLES) - set(ELSEWHERE)))
def test_bad_example_raises_its_code_alone(code):
    raised = found(EXAMPLES[code].bad)
    assert code in raised
    assert {c for c in raised if c[0] == "E"} <= {code}


@pytest.mark.parametrize("code", sorted(c for c in EXAMPLES if EXAMPLES[c].good))
def test_good_example_is_free_of_it(code):
    raised = found(EXAMPLES[code].good)
    assert code not in raised
    assert not [c for c in raised if c[0] == "E"]
