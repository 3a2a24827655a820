"""`sysdyn equilibrium` where states of rest are not alone: each circle and sphere of them once, and truly at rest."""

import numpy as np
import pytest
from texts import ROOT, run_json, write

HAT = """
model hat {{
{coords}
  energy T* = 1/2*(1 kg)*({speeds})
  energy V = 1/4*(1 N/m^3)*({squares} - 1 m^2)^2
  content D = 1/2*(1 N.s/m)*({speeds})
}}
"""


@pytest.mark.parametrize("names", ["xy", "xyz"])
def test_a_hat_rests_on_its_rim_and_at_its_centre(tmp_path, capsys, names):
    """V = (r^2 - 1)^2/4: r = 1 is flat in all but one direction; at r = 0 eigenvalues are (+-sqrt(5) - 1)/2."""
    coords = "\n".join(f"  coord {n}: translation = {0.3 + 0.1 * k} m" for k, n in enumerate(names))
    speeds, squares = (" + ".join(f"{n}{power}" for n in names) for power in ("'^2", "^2"))
    path = write(tmp_path, HAT.format(coords=coords, speeds=speeds, squares=squares))
    code, said = run_json(capsys, "equilibrium", str(path), "--backend", "numpy")
    rim, centre = sorted(said["result"]["equilibria"], key=lambda e: -abs(e["values"]["x"]))
    assert code == 0
    assert abs(np.linalg.norm([rim["values"][n] for n in names]) - 1.0) < 1e-9
    assert (rim["free"], rim["stability"]) == (list(names), "undecided")
    assert max(abs(centre["values"][n]) for n in names) < 1e-9
    largest = max(re for re, _ in centre["eigenvalues"])
    assert abs(largest - (np.sqrt(5.0) - 1.0) / 2.0) < 1e-9


@pytest.mark.parametrize(
    ("path", "number"),
    [
        ("gallery/sixbar_redundant.sd", 2),  # push = weight*cos(th); a multiplier is open, nothing else
        ("seed/msd_velocity_source.sd", 1),  # anywhere, at rest: what round-off leaves of speeds tells nothing apart
        ("seed/lcr_nonlinear.sd", 1),  # the slope of f*abs(f) vanishes there
    ],
)
@pytest.mark.long
def test_round_off_tells_no_states_apart(capsys, path, number):
    code, said = run_json(capsys, "equilibrium", str(ROOT / "models" / path), "--backend", "numpy", "--tries", "8")
    found = said["result"]["equilibria"]
    assert (code, len(found)) == (0, number)
    if "sixbar" in path:
        angles = sorted(e["values"]["crank.th[1]"] for e in found)
        assert np.abs(np.cos(angles) - 2.0 / (3.5 * 9.80665)).max() < 1e-9
        assert {e["stability"] for e in found} == {"stable", "unstable"}
