"""A link that undoes a part of the core that was identified: a filter in the place of both."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.signal as sig

from frac_accel import SensorModel, diagnose
from frac_accel.diagnosis.doubts.delays import undoes_the_core, undone_mounts
from frac_accel.diagnosis.engine import Engine
from frac_accel.diagnosis.flat import own_resonance_instead
from frac_accel.model.core import Gain, Oscillator
from frac_accel.model.effects import known_effects
from frac_accel.record import Record
from frac_accel.record.sources import pair_of

RATE, N = 4000.0, 8000
EFFECTS = known_effects()


def engine_and_fit(corner_hz, damping, link, is_known=False):
    """A third-order Butterworth filter, fitted by an oscillator and a link."""
    motion = sig.sosfiltfilt(sig.butter(4, 1500, fs=RATE, output="sos"),
                             np.random.default_rng(3).normal(size=N))
    turns = 1j * np.fft.rfftfreq(N, 1 / RATE) / corner_hz
    sensor = np.fft.irfft(np.fft.rfft(motion) / ((1 + turns) * (1 + turns + turns**2)), N)
    record = Record.of(*pair_of((motion, sensor), RATE, "x", "", ""), "x", None)
    core = EFFECTS["core_parameter_shift"](corner_hz, damping)
    engine = Engine(record, 0, SensorModel(Oscillator(corner_hz, damping, sensitivity=1.0)),
                    np.ones(N, bool), base={core.cause: core},
                    loose={core.cause: SimpleNamespace(effect=core, is_known=is_known)})
    return engine, engine.search.fit({core.cause: core, link.cause: link})


@pytest.mark.parametrize("seed", range(3))
def test_a_mount_that_undoes_a_lag_of_the_core_is_in_doubt(seed):
    corner = np.random.default_rng([7, seed]).uniform(600, 1000)
    mount = EFFECTS["mounting_resonance"](corner, 0.5)
    engine, fit = engine_and_fit(corner, 0.999, mount)
    assert fit.cost < 1e-4 * np.sum(engine.problem.measured**2)  # it is the filter
    words = undoes_the_core(engine, fit)["mounting_resonance"]
    assert words.startswith("its zero undoes a lag of")
    # what the sensor's maker states is there, whatever a mount does beside it
    assert not undoes_the_core(*engine_and_fit(corner, 0.999, mount, is_known=True))


def test_a_lag_beside_a_resonance_undoes_nothing():
    engine, fit = engine_and_fit(800.0, 0.5, EFFECTS["low_pass_lag"](800.0))
    assert not undoes_the_core(engine, fit)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(2))
def test_a_filter_of_third_order_is_named_beside_a_turn_that_was_not_known(seed):
    """An oscillator and a lag bent themselves to what came across, and left a little less."""
    rng = np.random.default_rng([8, seed])
    fine, count, corner = 8, 3 * N, rng.uniform(0.22, 0.27) * RATE
    time = np.arange(fine * count) / (fine * RATE)
    turns = np.cumsum(28 + 16 * np.sin(2 * np.pi * time / 5)) / (fine * RATE)
    # an engine: all axes have its orders, each with a phase of its own
    motion = sum(np.cos(2 * np.pi * order * turns[:, None] + rng.uniform(0, 7, 3))
                 * rng.uniform(0.5, 1, 3) for order in (*range(2, 32, 2), 1, 5))
    lines = 1j * np.fft.rfftfreq(len(motion), 1 / (fine * RATE))[:, None] / corner
    late = np.fft.irfft(np.fft.rfft(motion, axis=0) / ((1 + lines) * (1 + lines + lines**2)),
                        len(motion), axis=0)
    # what lies at the ends follows what the other end had
    reference, sensor = motion[2000:-2000:fine], late[2000:-2000:fine]
    x, y, z = np.radians(rng.choice([-1, 1], 3) * rng.uniform(0.3, 0.5, 3))
    sensor = sensor @ np.array([[1, z, -y], [-z, 1, x], [y, -x, 1]]).T
    level = reference[:, 0].std()
    reference = reference + 0.002 * level * rng.normal(size=reference.shape)
    sensor = sensor + 0.003 * level * rng.normal(size=sensor.shape)
    found = diagnose((reference, sensor), sampling_rate_hz=RATE)
    named = {finding.cause: finding for finding in found.findings}
    assert named.keys() <= {"low_pass_filter", "misalignment", "offset"}
    lag = named["low_pass_filter"].effect
    assert (lag.order, lag.family) == (3, "butterworth")
    assert lag.corner_hz == pytest.approx(corner, rel=0.01)


def flat_or_own(sensor, motion, core):
    """An engine with one core of unknown parameters, and what opens each fit."""
    record = Record.of(*pair_of((motion, sensor), RATE, "x", "", ""), "x", None)
    own = EFFECTS["sensitivity_error"](1.0) if isinstance(core, Gain) \
        else EFFECTS["core_parameter_shift"](core.natural_frequency_hz, core.damping_ratio)
    return Engine(record, 0, SensorModel(core), np.ones(N, bool), base={own.cause: own},
                  candidates=["mounting_resonance", "time_delay"],
                  loose={own.cause: SimpleNamespace(effect=own, is_known=False)})


@pytest.mark.parametrize("seed", range(4))
def test_a_mount_whose_lead_others_undo_is_the_sensor_itself(seed):
    """With a turn under gravity, a sensor of 22.4 Hz was flat, on a mount of 22.4 Hz, behind an
    average and a lead."""
    rng = np.random.default_rng([9, seed])
    frequency_hz, damping = rng.uniform(100, 300), rng.uniform(0.03, 0.1)
    motion = sig.sosfiltfilt(sig.butter(4, 0.6 * frequency_hz, fs=RATE, output="sos"),
                             rng.normal(size=N))
    s = 2j * np.pi * np.fft.rfftfreq(N, 1 / RATE)
    omega = 2 * np.pi * frequency_hz
    answer = omega**2 / (s**2 + 2 * damping * omega * s + omega**2)
    mount = EFFECTS["mounting_resonance"](frequency_hz, damping)

    def found(response, delay_s):
        sensor = np.fft.irfft(np.fft.rfft(motion) * response, N)
        engine = flat_or_own(sensor + 1e-3 * sensor.std() * rng.normal(size=N), motion, Gain(1.0))
        delay = EFFECTS["time_delay"](delay_s)
        return engine, engine.search.fit({**engine.search.base, mount.cause: mount,
                                          delay.cause: delay})
    lead_s = 2 * damping / omega
    engine, best = found(answer, lead_s)
    assert undone_mounts(engine, best) == {mount.cause: pytest.approx(lead_s, rel=0.1)}
    own = flat_or_own(engine.problem.measured, motion, Oscillator(frequency_hz, damping))
    fit = own_resonance_instead(own, best)
    assert fit.causes == {"core_parameter_shift"}
    assert fit.effects["core_parameter_shift"].natural_frequency_hz \
        == pytest.approx(frequency_hz, rel=1e-3)
    # a mount with its lead, and late by something else, stays one
    engine, best = found(answer * (1 + s * lead_s) * np.exp(-3 * lead_s * s), 3 * lead_s)
    assert not undone_mounts(engine, best)
    own = flat_or_own(engine.problem.measured, motion, Oscillator(frequency_hz, damping))
    assert own_resonance_instead(own, best) is None
