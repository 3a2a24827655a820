"""The instant of a fast motion behind a long slow one, which adds up what each step leaves."""

from pathlib import Path

from sysdyn import api

VAN_DER_POL = Path(__file__).parents[2] / "models" / "benchmark" / "vdpol.sd"


def test_the_phase_of_van_der_pol_is_known_to_nanoseconds():
    """Radau against rosenbrock where v falls by 1e6 in a second, behind 1600 s of slow motion: it was off by 2e-8 s at
    any tolerance where Newton's iteration ended at what round-off of its stages may leave.
    """
    model = api.load(VAN_DER_POL)
    ways = ("rosenbrock", 1e-14), ("radau", 1e-13), ("radau", 2e-13), ("radau", 3e-13)
    v = [model.run(until=1614.287, method=m, rtol=r, max_steps=10**6)["y1"].values[-1] for m, r in ways]
    assert max(abs(other - v[0]) for other in v[1:]) < 1e6 * 3e-9
    for accuracy in (1e-6, 1e-8):
        assert model.run(accuracy=accuracy).met
