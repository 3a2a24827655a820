"""Reference values that several rooms of the tests read; README.md beside it says what each file is and from where."""

import json
from pathlib import Path

FOLDER = Path(__file__).parent


def load(name):
    """The content of a data file, by its name in this folder."""
    return json.loads((FOLDER / name).read_text(encoding="utf-8"))
