"""Several nodes handled as one port, and what is found in a component told where the author used it: by hand."""

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.elaborate.scenes.slices import element_of, ranges_of
from sysdyn.dsl.format.format_expressions import format_expression
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.text.diagnostics import Report, SourceText

LINK = """
bundle pair { x, th: translation }
component link {
  port a, b: pair
  K: potential(e = 4 N/m*q) a.x -> b.x
  D: dissipator(e = 3 N.s/m*f) a.th -> b.th
}
"""


def read(text):
    """The network of model m; findings that are no notes."""
    report = Report()
    document = load.document(SourceText("m.sd", text), report)
    network = load.network(document, document.models["m"], None, report) if "m" in document.models else None
    return network, [d for d in report if d.severity == "error"]


def ends(body, head=""):
    """Of each branch that a component made its ends: nodes with their indices; None: ground."""
    network, said = read(f"{LINK}{head}model m {{ {body} }}")
    assert not said, said

    def shown(end):
        return end.node and ", ".join([end.node, *map(to_text, end.at)])

    return {b.name: (shown(b.plus), shown(b.minus)) for b in network.branches}


def test_a_port_of_a_bundle_takes_a_node_of_it_member_by_member():
    found = ends("node p, q: pair; L: link() a = p, b = q")
    assert found == {"L.K": ("p.x", "q.x"), "L.D": ("p.th", "q.th")}


def test_ground_grounds_every_member():
    assert ends("node p: pair; L: link() a = p, b = ground") == {"L.K": ("p.x", None), "L.D": ("p.th", None)}


def test_an_element_of_an_array_of_bundles_is_one():
    found = ends("node v[1..3]: pair; for i in 1..2 { L[i]: link() a = v[i], b = v[i + 1] }")
    assert found == {"L.K": ("v.x, i", "v.x, i + 1"), "L.D": ("v.th, i", "v.th, i + 1")}
    network, said = read(LINK + "model m { node v[1..3]: pair; node p: pair; L: link() a = v, b = p }")
    assert network is None
    assert [d.code for d in said] == ["E805"]


BOTH = """
bundle couple { l, r: pair }
component c { port p: couple; K: potential(e = 4 N/m*q) p.l.x -> p.r.x; D: dissipator(e = 1 N.s/m*f) p.l.th -> p.r.th }
"""


def test_a_bundle_of_bundles():
    found = ends("node n: couple; A: c() p = n", BOTH)
    assert found == {"A.K": ("n.l.x", "n.r.x"), "A.D": ("n.l.th", "n.r.th")}
    turned = "bundle skew { x: translation; th: rotation }\nbundle other { l, r: skew }\n"
    for kind in ("pair", "other"):  # one of its members alone; members of the same names that are others within
        network, said = read(f"{LINK}{BOTH}{turned}model m {{ node n: {kind}; A: c() p = n }}")
        assert network is None
        assert ("E401", "port 'p' of 'A' is a bundle couple, 'n' is none") in [(d.code, d.message) for d in said]


@pytest.mark.parametrize(
    ("body", "found"),
    [
        ("L: link() a = p, b = r", "port 'b' of 'L' is a bundle pair, 'r' is none"),  # other members
        ("L: link() a = p.x, b = q", "port 'a' of 'L' is a bundle pair, 'p.x' is none"),  # a node
        ("L: link() a = p, b = turned", "port 'b' of 'L' is a bundle pair, 'turned' is none"),  # of another domain
    ],
)
def test_what_does_not_fit_a_port(body, found):
    nodes = "node p, q: pair; node r: planar; node turned: skew;"
    network, said = read(f"{LINK}bundle skew {{ x: translation; th: rotation }}\nmodel m {{ {nodes} {body} }}")
    assert network is None
    assert ("E401", found) in [(d.code, d.message) for d in said]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("bundle a { x, y: translation; x: rotation }", ("E106", "'x' is declared twice")),
        ("bundle a { x: b }\nbundle b { y: a }", ("E801", "bundle 'a' contains itself: a -> b -> a")),
        ("bundle a { x: a }", ("E801", "bundle 'a' contains itself: a -> a")),
        ("bundle a { x: translatoin }", ("E202", "'translatoin' is not a domain")),
    ],
)
def test_bundles_that_cannot_be_read_are_told_once(text, found):
    network, said = read(f"{text}\nmodel m {{ node n: a }}")
    assert network is None
    assert [(d.code, d.message) for d in said] == [found]


# --- what a library's component is told of ----------------------------------------------------------------------------


def placed(tmp_path, body, head=""):
    """(line of the author's file, file and line of what is related) of the findings of a model that uses parts.sd."""
    (tmp_path / "parts.sd").write_text(PARTS)
    source = SourceText(str(tmp_path / "m.sd"), f"from parts import bad, holder\n{head}model m {{\n{body}\n}}\n")
    report = Report()
    document = load.document(source, report)
    load.network(document, document.models["m"], None, report)
    found = []
    for d in report:
        if d.code == "E324":
            name = d.place.source.name.rsplit("/", 1)[-1]
            text = d.place.source.text[d.place.span.start : d.place.span.end]
            near = [r.place.source.name.rsplit("/", 1)[-1] for r in d.related]
            found.append((name, text, [r.message for r in d.related], near))
    return found


PARTS = """component bad { param R = 1 ohm; branch: electrical; law e = R*f*(1/(R - R)) }
component holder { port a: electrical; B: bad() a -> ground }
"""


@pytest.mark.parametrize(
    "body", ["  node a: electrical\n  X: bad() a -> ground", "  node a: electrical\n  X: holder() a = a"]
)
def test_a_finding_in_a_component_is_told_at_the_statement_that_the_author_wrote(tmp_path, body):
    (found,) = placed(tmp_path, body)
    assert found[:2] == ("m.sd", body.rpartition("\n")[2].strip())
    assert found[2][0] == "in component 'bad'"
    assert found[3][0] == "parts.sd"


def test_of_statements_one_within_the_other_the_innermost_that_the_author_wrote_is_meant(tmp_path):
    mine = "component mine {\n  port a: electrical\n  Y: holder() a = a\n}\n"
    (found,) = placed(tmp_path, "  node a: electrical\n  X: mine() a = a", mine)
    assert found[:2] == ("m.sd", "Y: holder() a = a")


# --- slices -----------------------------------------------------------------------------------------------------------


def traced(text):
    report = Report()
    source = SourceText("m.sd", f"model m {{}}\nscene s of m {{ trace {text} }}")
    (scene,) = load.document(source, report).scenes.values()
    return scene.body[0].items[0].expr


@pytest.mark.parametrize(
    ("text", "element", "ranges"),
    [
        ("x[1..3]", "x[7]", 1),
        ("x[1..3]'", "x[7]'", 1),
        ("cell[1..3].c[2, 4..5].e", "cell[7].c[2, 8].e", 2),
        ("x[2]", "x[2]", 0),
        ("x[1..3] + 1", None, 0),  # no path
        ("f(x[1..3])", None, 0),
    ],
)
def test_the_ranges_of_a_path_from_left_to_right(text, element, ranges):
    path = traced(text)
    found = ranges_of(path)
    assert len(found) == ranges
    if element is not None:
        one = element_of(path, dict(zip(found, (7, 8), strict=False)))
        assert format_expression(one) == element
