"""What compiling takes is counted apart, and is no part of a diagnosis' budget."""

import time

import numba
import numpy as np

from frac_accel.diagnosis.time_limit import TimeLimit
from frac_accel.simulation import (
    compiling,
    nonlinear_motion,  # noqa: F401  which has it counted
)


def test_compiling_does_not_count():
    @numba.njit
    def outer(values):
        return numba_sum(values) + values.max()

    @numba.njit
    def numba_sum(values):
        return values.sum()

    limit, before, start = TimeLimit(60.0), compiling.compiled_s(), time.process_time()
    assert outer(np.ones(3)) == 4.0
    took, compiled = time.process_time() - start, compiling.compiled_s() - before
    # what is compiled within something else counts once
    assert 0.5 * took < compiled <= took
    assert limit.spent_s() < 0.5 * took
    before = compiling.compiled_s()
    assert outer(np.ones(3)) == 4.0
    assert compiling.compiled_s() == before
