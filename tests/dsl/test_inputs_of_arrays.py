"""Arrays of components whose inputs read another element of the array: what is told, and where."""

from sysdyn.dsl import load
from sysdyn.dsl.text.diagnostics import Report, SourceText

CELLS = """component cell {{
  input u: 1
  state s = 0
  dynamic s' = (u - s)/(1 s)
  output y = {}
}}
model m {{
  param n = 3
  {}
  for i in 1..n {{
    c[i]: cell() u = c[i-1].y
  }}
}}
"""


def findings(text):
    report = Report()
    document = load.document(SourceText("m.sd", text), report)
    load.network(document, document.models["m"], None, report)
    return list(report)


def test_an_element_before_the_first_is_told_where_it_is_named():
    """And not where the component reads its input; a chain of outputs without a state is no state without a dynamic."""
    first = "c[0]: cell() u = 1"
    alone, through, right = (CELLS.format(*given) for given in (("s", ""), ("s + u", first), ("s", first)))
    (found,) = findings(alone)
    assert (found.code, *found.place.start) == ("E805", 11, 24)
    assert found.message == "index 0 of 'c' is outside 1..3: c[i-1]"
    (found,) = findings(through)
    assert (found.code, *found.place.start) == ("E105", 11, 22)
    assert "one definition" in found.help
    assert findings(right) == []
