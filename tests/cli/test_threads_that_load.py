"""Several threads that read, compile and run texts at once find what one alone finds, to the bit."""

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from sysdyn import api, models
from sysdyn.dsl.model import budget
from sysdyn.dsl.model import expression as ex

TEXTS = ("gallery/pendulum.sd", "seed/dc_motor.sd", "seed/co_circuit.sd")


def _run(name):
    trace = api.load(Path(models.__file__).parent / name).run()
    return {quantity: np.asarray(trace[quantity]) for quantity in trace.names}


@pytest.mark.long
def test_threads_find_what_one_finds():
    alone = [_run(name) for name in TEXTS]
    limit, every = sys.getrecursionlimit(), sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        with ThreadPoolExecutor(4) as pool:
            together = list(pool.map(_run, TEXTS * 3))
    finally:
        sys.setswitchinterval(every)
    for found, wanted in zip(together, alone * 3, strict=True):
        assert found.keys() == wanted.keys()
        assert all((found[name] == wanted[name]).all() for name in wanted)
    assert sys.getrecursionlimit() == limit
    assert budget._budget.left == float("inf")


def test_a_thread_has_nodes_of_its_own():
    with ex.fresh(), ThreadPoolExecutor(1) as pool:
        mine = ex.param("m")
        assert ex.param("m") is mine
        assert pool.submit(lambda: ex.param("m")).result() is not mine
