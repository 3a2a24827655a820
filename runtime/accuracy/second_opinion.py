"""A second, independent run beside the one that is handed back: another method at other tolerances.

Two runs of one method may share what they do not see, and its estimate rests on them alone. The second run takes a
tenth of the tolerance that should do, is compared at the same instants, and its trace is thrown away.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from sysdyn.runtime.accuracy.control import Achieved
from sysdyn.runtime.accuracy.pairs import difference
from sysdyn.runtime.accuracy.runs import Runs
from sysdyn.runtime.accuracy.way import Way
from sysdyn.runtime.integrate.request import LONGEST
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure

OTHER = {"bdf": "radau", "radau": "bdf", "rosenbrock": "radau", "dopri": "radau", "energy": "dopri"}


def confirm(runs: Runs, achieved: Achieved, target: Floats) -> Achieved:
    """`achieved` of these runs as a second one by another method leaves it: the larger of both estimates, not met where
    they are further apart than target [quantities] or the second run fails.
    """
    import tempfile

    # the other implicit method, at tolerances of its own
    way: Way = replace(runs.way, method=OTHER[runs.method])
    law, wanted = way.law, float(np.min(target, initial=1.0))
    tolerance = max(law.ratio * law.tolerance(wanted if wanted < 1.0 else 1e-4), law.finest)
    with tempfile.TemporaryDirectory(prefix="sysdyn-") as folder:
        # its trace goes to a folder that vanishes
        options = replace(runs.options, output=Path(folder) / "second.h5", watch=None)
        second = Runs(runs.start, options, way)
        # the same columns, instants and state at the start
        second.columns, second.begin = runs.columns, runs.begin
        second.instants.close(runs.instants.common)
        second.compared.jumps = runs.compared.jumps
        try:
            apart, over = difference(runs.compared.samplings[-1], second.run_sampled(tolerance, LONGEST), target)
        # the user's limit of time is not the second run's failure
        except SolverFailure as failure:
            if failure.cause == "max_wall":
                raise
            return replace(achieved, error_estimate=None, met=False)
        # its work counts in both cases
        finally:
            runs.accounts.take(second.accounts)
            if second.writer is not None:
                second.writer.discard()
    estimate = max(achieved.error_estimate or 0.0, apart)
    # two runs without a common digit
    if not np.isfinite(estimate):
        return replace(achieved, error_estimate=None, met=False)
    return replace(achieved, error_estimate=estimate, met=achieved.met and over <= 1.0, runs=achieved.runs + 1)
