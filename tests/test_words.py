"""Names, docstrings and comments are in the words of the field; `words` (tests/data/words.py) says why each rule is."""

import pytest
from words import (
    LIMITS,
    MIRRORS,
    ROOMS,
    ROOT,
    SHARED_CLASSES,
    Found,
    is_bare,
    look_at_room,
    look_at_text,
    shared_classes,
)

RULES = ("functions", "modules", "twins", "openings", "undocumented")


@pytest.fixture(scope="module")
def found():
    return {room: look_at_room(ROOT, room) for room in ROOMS}


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("room", ROOMS)
def test_no_room_has_more_than_its_limit(found, room, rule):
    places = getattr(found[room], rule)
    assert len(places) <= getattr(LIMITS[room], rule), places


@pytest.mark.parametrize("room", ROOMS)
def test_every_room_has_its_share_of_comments(found, room):
    assert found[room].share >= LIMITS[room].comments


def test_a_class_has_a_name_of_its_own():
    shared = dict(shared_classes(ROOT))
    assert len(shared) <= SHARED_CLASSES, sorted(shared)
    assert [name for name, files in shared.items() if not any(f.startswith(MIRRORS) for f in files)] == []


@pytest.mark.parametrize("name", ["told", "_held", "of", "within", "reported", "_shown", "kept", "again", "__moved"])
def test_a_participle_or_preposition_is_no_name(name):
    assert is_bare(name)


@pytest.mark.parametrize(
    "name", ["report_fault", "need", "seed", "held_momenta", "sum_of", "step", "_accept", "is_closed"]
)
def test_a_verb_or_a_noun_is_a_name(name):
    assert not is_bare(name)


SAMPLE = '''
class Run:
    @property
    def failed(self):  # at the end of a line: none
        return False

    def told(self):
        """The same for a run."""

# a comment by itself
def _long(x):
{body}

def fixed():
    """A builder of the grammar."""
'''


def test_each_rule_on_a_sample():
    found = Found()
    look_at_text(found, SAMPLE.format(body="\n".join(["    x += 1"] * 10)), "a.py")
    assert [place.split()[-1] for place in found.functions] == ["told"]
    assert [place.split()[-1] for place in found.openings] == ["told"]
    assert found.undocumented == ["a.py:11 _long"]
    assert (found.comments, found.lines) == (1, 19)


def test_a_private_function_of_nine_lines_needs_no_docstring():
    found = Found()
    look_at_text(found, SAMPLE.format(body="\n".join(["    x += 1"] * 9)), "a.py")
    assert found.undocumented == []


def test_modules_and_classes_of_a_house(tmp_path):
    for path in ("dsl/a/told.py", "dsl/b/told.py", "dsl/utils.py", "dsl/__init__.py", "cli/told.py", "cli/__init__.py"):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text("class Run:\n    pass\n" if "told" in path else "class Walk:\n    pass\n")
    found = look_at_room(tmp_path, "dsl")
    assert found.modules == ["dsl/a/told.py", "dsl/b/told.py", "dsl/utils.py"]
    assert found.twins == ["dsl/a/told.py dsl/b/told.py"]
    assert dict(shared_classes(tmp_path)) == {
        "Run": ("cli/told.py", "dsl/a/told.py", "dsl/b/told.py"),
        "Walk": ("cli/__init__.py", "dsl/__init__.py", "dsl/utils.py"),
    }
