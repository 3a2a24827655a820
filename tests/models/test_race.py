"""The peers of tests/bench/race.py: SUNDIALS on what `sysdyn compile` writes, against published end values."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))
import race
from test_benchmark import ENDS


def test_without_sundials_it_says_why(tmp_path, monkeypatch):
    monkeypatch.setattr(race, "LIBRARIES", ("that_is_not_there",))
    assert "that_is_not_there" in race.Peers(tmp_path).missing


@pytest.mark.long
def test_the_peers_reach_published_ends(tmp_path, monkeypatch):
    peers = race.Peers(tmp_path)
    if peers.missing:
        pytest.skip(f"no SUNDIALS: {peers.missing}")
    monkeypatch.setattr(race, "FORMS", ("0",))
    found = list(peers.runs("hires", 321.8122, 1.0))  # s: on a loaded machine a tenth of it
    assert {"ida", "bdf", "adams"} >= {who.split()[0] for who, _, _ in found}
    for number, wanted in ENDS["hires"].items():
        assert min(abs(values[f"y{number}"] / wanted - 1.0) for _, _, values in found) < 1e-6
    assert min(cpu for _, cpu, _ in found) > 0.0
