import sys
from pathlib import Path

import pytest
from sysdyn.dsl.model import expression

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def fresh():
    """A store of expressions of a test's own."""
    with expression.fresh():
        yield
