"""Where radau takes more steps than stability leaves the explicit method, method auto goes on with that."""

import numpy as np
import pytest
from sysdyn.runtime.trace.trace import Trace
from texts import ROOT, run_json

CHAIN = str(ROOT / "models" / "gallery" / "chain_1000.sd")


@pytest.mark.long
def test_a_whipping_chain_is_the_explicit_methods(tmp_path, capsys):
    """Its fastest waves hold the dopri to its region of stability, and its tip holds radau to steps as short: a hundred
    links in 0.3 of the CPU, nearer to the motion.
    """

    def ran(name, *options):
        file = str(tmp_path / f"{name}.h5")
        asked = ("simulate", CHAIN, "--set", "n=100", "--until", "0.9", "-o", file, *options)
        code, found = run_json(capsys, *asked)
        assert code == 0, found["diagnostics"]
        return found["result"], Trace.open(file)

    result, trace = ran("auto")
    assert result["method"] == "dopri"
    assert result["met"]
    assert result["statistics"]["steps"] < 1000
    _, implicit = ran("radau", "--method", "radau", "--accuracy", "1e-5")
    for name in ("x[n]", "y[n]"):
        size = np.abs(implicit[name].values).max()
        assert np.abs(trace[name].values - implicit[name].values).max() < 1e-5 * size
    stiff, _ = ran("short", "--set", "b=100 N.s/m")  # drag that is stiff: the steps of radau are far longer
    assert stiff["method"] != "dopri"
