"""A sensor far below its resonance whose spring is bent: its characteristic is a curve."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import butter, sosfiltfilt

from frac_accel import Corrector, Samples, SensorModel, diagnose, simulate

RATE, COUNT = 200.0, 6000


def motion_of(rng):
    """Motion of all axes whose level changes, and gravity on z."""
    band = [rng.uniform(0.2, 1), rng.uniform(10, 60)]
    motion = sosfiltfilt(butter(4, band, "band", fs=RATE, output="sos"),
                         rng.normal(size=(COUNT, 3)), axis=0)
    motion *= rng.uniform(1, 3) / motion.std(axis=0)
    level = 1 + 0.7 * np.sin(2 * np.pi * rng.uniform(1, 4) * np.arange(COUNT) / COUNT)
    return motion * level[:, None] + [0, 0, 9.81]


def seen(rng, motion, bent):
    """Both topics, the sensor's z axis bent, with noise on both."""
    sensor = motion.copy()
    sensor[:, 2] = bent
    stamps = np.round(1e9 * np.arange(COUNT) / RATE)
    return tuple(Samples.of(stamps, values + share * motion[:, 2].std() * rng.normal(
        size=values.shape)) for values, share in ((motion, 0.001), (sensor, 0.004)))


def carried(load, alpha2, alpha3):
    """Output under each load, by bracketing: load = q + alpha2 q² + alpha3 q³."""
    def excess(q, one):
        return q + alpha2 * q**2 + alpha3 * q**3 - one
    return np.array([brentq(excess, *sorted((0.0, 1.6 * one)), args=(one,)) for one in load])


def hidden(seed, law):
    rng = np.random.default_rng(seed)
    motion = motion_of(rng)
    most = np.abs(motion[:, 2]).max()
    bend = rng.choice([-1, 1]) * rng.uniform(0.02, 0.1)
    alpha2, alpha3 = (bend / most, 0.0) if law == "alpha2" else (0.0, bend / most**2)
    return motion, seen(rng, motion, carried(motion[:, 2], alpha2, alpha3)), alpha2 + alpha3


@pytest.mark.parametrize("law", ["alpha2", "alpha3"])
@pytest.mark.parametrize("seed", [3501, 3502, 3503, 3504])
def test_a_bent_characteristic_is_named(seed, law):
    _, pair, value = hidden(seed, law)
    found = diagnose(pair, axis="z")
    cause = {"alpha2": "quadratic_stiffness", "alpha3": "cubic_stiffness"}[law]
    assert found.verdict == "explained"
    bent, = (finding for finding in found.findings if finding.cause == cause)
    assert {finding.cause for finding in found.findings} <= {cause, "offset"}
    assert abs(getattr(bent.effect, law) - value) < 4 * bent.std[law]
    assert bent.std[law] < 0.2 * abs(value)


@pytest.mark.parametrize("law", [
    lambda x, size: np.where(x > 0, x, (1 - size) * x),
    lambda x, size: x * (1 + size * np.abs(x / x.std())),
    lambda x, size: x + 0.02 * size * x**5 / x.std()**4])
@pytest.mark.parametrize("seed", [3511, 3512])
def test_another_curve_has_no_name(seed, law):
    rng = np.random.default_rng(seed)
    motion = motion_of(rng) - [0, 0, 9.81]
    found = diagnose(seen(rng, motion, law(motion[:, 2], rng.uniform(0.03, 0.1))), axis="z")
    assert not {"quadratic_stiffness", "cubic_stiffness"} & {f.cause for f in found.findings}
    assert found.verdict not in ("consistent", "explained")


def test_simulated_and_taken_back():
    """The curve by bracketing; and a corrector that knows it gives the motion back."""
    rng = np.random.default_rng(3521)
    motion = motion_of(rng)
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1", "core": {"type": "gain", "sensitivity": 1.0},
        "effects": [{"cause": "quadratic_stiffness", "alpha2": 0.006},
                    {"cause": "cubic_stiffness", "alpha3": -2e-4}]})
    bent = simulate(model, motion, RATE)
    assert bent[:200, 2] == pytest.approx(carried(motion[:200, 2], 0.006, -2e-4), abs=1e-9)
    corrector = Corrector(model, RATE)
    given = corrector.process(np.round(1e9 * np.arange(COUNT) / RATE).astype(np.int64), bent)
    inside = (given.index > 200) & (given.index < COUNT - 200)
    error = given.values[inside, 2] - motion[given.index[inside], 2]
    assert np.std(error) < 2e-3 * np.std(motion[:, 2])
    assert np.std(bent[:, 2] - motion[:, 2]) > 20 * np.std(error)
