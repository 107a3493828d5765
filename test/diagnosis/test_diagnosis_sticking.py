"""Dry friction of a mass that moves so slowly that it sticks at each turn: it is no play."""

from unittest import mock

import numpy as np
import pytest
from rig.excitation import band_noise, noise_bursts
from rig.record import simulate_record
from rig.sensor import Sensor

from frac_accel import Samples, SensorModel, diagnose
from frac_accel.diagnosis.engine import Engine
from frac_accel.diagnosis.names import undetermined
from frac_accel.model.core import Oscillator
from frac_accel.model.effects import known_effects

CORE = {"type": "oscillator", "damping_order": 1.0, "sensitivity": 1.0}


@pytest.mark.parametrize("seed", [3, 1, 2])
def test_friction_beside_a_lag_in_slow_waves_is_named(seed):
    rng = np.random.default_rng([17, seed])
    core = {**CORE, "natural_frequency_hz": rng.uniform(1.0, 1.6),
            "damping_ratio": rng.uniform(0.4, 0.7)}
    level, corner_hz = rng.uniform(0.01, 0.03), rng.uniform(0.6, 1.2)
    record = simulate_record(
        Sensor(core, {"coulomb_friction": {"level": level}, "low_pass_lag": {
            "corner_hz": corner_hz}}),
        band_noise(rng, 50.0, 160.0, (0.07, 0.33)), rng, snr_db=66.0)
    found = diagnose((Samples.of(record.stamps_ns, record.reference),
                      Samples.of(record.sensor_stamps_ns, record.sensor)),
                     SensorModel.from_dict({"schema": "frac_accel/sensor_model/1", "core": core}))
    assert sorted(f.cause for f in found.findings) == ["coulomb_friction", "low_pass_lag"]
    sizes = {f.cause: f.effect for f in found.findings}
    assert sizes["coulomb_friction"].level == pytest.approx(level, rel=0.02)
    assert sizes["low_pass_lag"].corner_hz == pytest.approx(corner_hz, rel=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_stamps_that_jump_show_beside_friction_that_mostly_holds(seed):
    """One event, then quiet motion, which would show the jump on one side only, it was said; and
    what a jump makes of the motion without friction is another."""
    rng = np.random.default_rng([18, seed])
    core = {**CORE, "natural_frequency_hz": rng.uniform(40, 50),
            "damping_ratio": rng.uniform(0.3, 0.5)}
    causes = {"coulomb_friction": {"level": rng.uniform(0.12, 0.16)}, "time_step": {
        "at_s": rng.uniform(70.0, 90.0), "step_s": rng.uniform(0.01, 0.016)}}
    levels = [0.2, rng.uniform(15, 25), 1.0] + [rng.uniform(0.18, 0.22) for _ in range(9)]
    record = simulate_record(Sensor(core, causes), noise_bursts(
        rng, 100.0, 160.0, (1.0, 30.0), levels), rng, snr_db=60.0)
    found = diagnose((Samples.of(record.stamps_ns, record.reference),
                      Samples.of(record.sensor_stamps_ns, record.sensor)),
                     SensorModel.from_dict({"schema": "frac_accel/sensor_model/1", "core": core}),
                     time_limit_s=60)
    named = {f.cause: f.effect for f in found.findings}
    assert named.keys() == causes.keys()
    assert named["coulomb_friction"].level == pytest.approx(causes["coulomb_friction"]["level"],
                                                            rel=0.02)
    assert named["time_step"].step_s == pytest.approx(causes["time_step"]["step_s"], rel=0.02)


@pytest.mark.parametrize("beta, words", [(0.0, "beta is compatible with 0"), (0.1, None)])
def test_a_loop_without_what_opens_it_is_none(beta, words):
    """Such a spring is harder, and nothing else: a natural frequency that had moved by 0.1 % was
    named hysteresis, beta 0.00000 +- 0.00010."""
    effect = known_effects()["hysteresis"](0.0021, beta, 0.0024)
    told = undetermined(effect, [], [], {"strength": 4e-5, "beta": 1e-4, "gamma": 1.6e-3},
                        Oscillator(21.37, 0.051), 94.0)
    assert told is words if words is None else told.startswith(words)


def test_of_two_that_explain_as_much_the_model_keeps_one_without_a_name():
    """Far below its resonance a sensor with dry friction plays: which it is no record tells, and
    the corrected signal needs either."""
    rng = np.random.default_rng([29, 2])
    core = {**CORE, "natural_frequency_hz": rng.uniform(1500, 2500),
            "damping_ratio": rng.uniform(0.4, 0.7)}
    record = simulate_record(
        Sensor(core, {"coulomb_friction": {"level": rng.uniform(0.03, 0.08)},
                      "gain_drift": {"rate_per_s": -6e-4}}),
        band_noise(rng, 300.0, 30.0, (2, 60)), rng, snr_db=48.0)
    all_rivals = Engine.rivals

    def rivals(engine, best, cause, *more):
        if cause != "coulomb_friction":
            return all_rivals(engine, best, cause, *more)
        return [(0.0, best.causes - {cause} | {"backlash"})]
    with mock.patch.object(Engine, "rivals", rivals):
        found = diagnose((Samples.of(record.stamps_ns, record.reference),
                          Samples.of(record.sensor_stamps_ns, record.sensor)),
                         SensorModel.from_dict({"schema": "frac_accel/sensor_model/1",
                                                "core": core}))
    assert "coulomb_friction" not in {f.cause for f in found.findings}
    assert ["backlash", "coulomb_friction"] in [each["causes"] for each in found.suspects]
    assert "keeps coulomb_friction" in found.reason
    assert found.extended["nrmse"] < 0.1 * found.baseline["nrmse"]
