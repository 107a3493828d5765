"""What a cause would change, by a screening, is what the independent simulator makes of it."""

import numpy as np
import pytest
from rig.hidden import draw_case

from frac_accel.diagnosis.problem import Problem
from frac_accel.model.effects import known_effects
from frac_accel.record import Record
from frac_accel.simulation import EDGE


@pytest.mark.parametrize("seed, other", [
    (7000, "cubic_stiffness"), (7001, "quadratic_stiffness"), (7002, "hysteresis")])
def test_dry_friction_beside_another_force_is_simulated(seed, other):
    """To first order it holds where the other force has the mass turn, and errs by half."""
    case = draw_case(seed, (other, "coulomb_friction"))
    beside, friction = (known_effects()[cause](**case.truth[cause])
                        for cause in (other, "coulomb_friction"))
    reference, sensor, celsius = case.samples()
    record = Record.of(reference, sensor, "x", celsius)
    used = record.valid.copy()
    used[:EDGE] = used[-EDGE:] = False
    problem = Problem(record, 0, case.model(), used)
    without = problem.measured - problem.simulate({other: beside})
    changed = problem.joined({other: beside}, "coulomb_friction", friction)
    left = np.sqrt(np.mean((without - changed)[used]**2))
    assert left < 1.1 * case.noise_std < 0.5 * np.sqrt(np.mean(without[used]**2))
