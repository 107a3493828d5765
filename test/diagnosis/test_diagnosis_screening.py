"""What a cause would change, by a screening, is what the independent simulator makes of it."""

import numpy as np
import pytest
from rig.excitation import noise_bursts
from rig.hidden import draw_case
from rig.record import simulate_record
from rig.sensor import Sensor

from frac_accel import Samples, SensorModel, diagnose
from frac_accel.diagnosis.problem import Problem
from frac_accel.model.effects import known_effects
from frac_accel.record import Record


@pytest.mark.parametrize("seed, other", [
    (7000, "cubic_stiffness"), (7001, "quadratic_stiffness"), (7002, "hysteresis")])
def test_dry_friction_beside_another_force_is_simulated(seed, other):
    """To first order it holds where the other force has the mass turn, and errs by half."""
    case = draw_case(seed, (other, "coulomb_friction"))
    beside, friction = (known_effects()[cause](**case.truth[cause])
                        for cause in (other, "coulomb_friction"))
    reference, sensor, celsius = case.samples()
    record = Record.of(reference, sensor, "x", celsius)
    problem = Problem(record, 0, case.model(), record.valid)
    without = problem.measured - problem.simulate({other: beside})
    changed = problem.joined({other: beside}, "coulomb_friction", friction)
    left = np.sqrt(np.mean((without - changed)[problem.used]**2))
    assert left < 1.1 * case.noise_std < 0.5 * np.sqrt(np.mean(without[problem.used]**2))


@pytest.mark.parametrize("seed", [3, 4])
def test_a_stop_far_within_the_largest_swings_is_found(seed):
    """It was looked for from 0.6 of the largest output on: a cubic spring stood in its place."""
    rng = np.random.default_rng([13, seed])
    core = {"type": "oscillator", "natural_frequency_hz": rng.uniform(60, 80),
            "damping_ratio": rng.uniform(0.1, 0.3), "damping_order": 1.0, "sensitivity": 1.0}
    levels = np.r_[rng.uniform(0.4, 0.8, 11), 2.5]  # a pothole at the end

    def driven(effects):
        motion = noise_bursts(np.random.default_rng([12, seed]), 200.0, 30.0, (1.0, 40.0), levels)
        return simulate_record(Sensor(core, effects), motion, np.random.default_rng(1), snr_db=45)
    largest = np.max(driven({}).sensor[:, 0])
    true = {"gap": rng.uniform(0.2, 0.28) * largest, "stiffness": rng.uniform(0.2, 0.5)}
    record = driven({"impact_stop": true})
    found = diagnose((Samples.of(record.stamps_ns, record.reference),
                      Samples.of(record.sensor_stamps_ns, record.sensor)),
                     SensorModel.from_dict({"schema": "frac_accel/sensor_model/1", "core": core}))
    assert [finding.cause for finding in found.findings] == ["impact_stop"]
    effect = found.findings[0].effect
    assert (effect.gap, effect.stiffness) == pytest.approx(tuple(true.values()), rel=0.01)
