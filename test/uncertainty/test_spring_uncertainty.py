"""Uncertain coefficients of nonlinear springs and friction in the corrector's variance."""

import numpy as np
import pytest
import rig

from frac_accel import Corrector
from frac_accel.model import SensorModel
from frac_accel.signals.metrics import interpolate

RATE_HZ = 1000.0
EASY = {"natural_frequency": (0.1, 0.25), "damping_ratio": (0.1, 0.7)}
# Relative standard uncertainties of the coefficients: what a fit to a short record leaves open.
SPRING_STD = {"cubic_stiffness": {"alpha3": 0.5}, "quadratic_stiffness": {"alpha2": 0.5},
              "coulomb_friction": {"level": 0.3}, "hysteresis": {"strength": 0.1}}
CORE_STD = {"natural_frequency_hz": 0.005, "damping_ratio": 0.02, "sensitivity": 0.005}


def draw_case(seed, cause):
    """Random sensor, names and values of what is uncertain of it, and a correlated covariance."""
    rng = np.random.default_rng([43, seed])
    sensor = rig.draw_sensor(rng, RATE_HZ, effects=[cause], level=1.5, **EASY)
    names = [*CORE_STD, *(f"{cause}.{key}" for key in SPRING_STD[cause])]
    values = np.array([*(sensor.core[name] for name in CORE_STD),
                       *(sensor.effects[cause][key] for key in SPRING_STD[cause])])
    std = np.abs(values) * [*CORE_STD.values(), *SPRING_STD[cause].values()]
    mixing = rng.normal(size=(len(names),) * 2) + 2 * np.eye(len(names))
    correlation = mixing @ mixing.T
    scale = std / np.sqrt(np.diag(correlation))
    return rng, sensor, names, values, correlation * np.outer(scale, scale)


def model_of(sensor, names=(), covariance=()):
    document = sensor.to_model()
    if len(names):
        document["covariance"] = {"parameters": list(names),
                                  "matrix": np.asarray(covariance).tolist()}
    return SensorModel.from_dict(document)


def changed(sensor, names, values):
    core, effects = dict(sensor.core), {cause: dict(of) for cause, of in sensor.effects.items()}
    for name, value in zip(names, values.tolist()):
        cause, dot, key = name.partition(".")
        (effects[cause] if dot else core)[key if dot else cause] = value
    return core, effects


@pytest.mark.long
@pytest.mark.parametrize("cause", ["cubic_stiffness", "quadratic_stiffness"])
def test_two_standard_uncertainties_cover(cause):
    """Sensors drawn around the model, played by the independent simulator, 600 for each spring.

    As many know the coverage to about 1 %. Each is an axis of a sensor with three different ones.
    """
    covered, plain = [], []
    for seed in range(5):
        rng, sensor, names, values, covariance = draw_case(seed, cause)
        whole = Corrector(model_of(sensor, names, covariance), RATE_HZ)
        without = Corrector(model_of(sensor, names[:-1], covariance[:-1, :-1]), RATE_HZ)
        low, high = whole.design.axes[0].band_hz
        for run in range(40):
            drawn = [changed(sensor, names, one)
                     for one in rng.multivariate_normal(values, covariance, 3)]
            axes = {axis: {"core": core, "effects": effects}
                    for axis, (core, effects) in zip("xyz", drawn)}
            true = rig.Sensor(sensor.core, sensor.effects, axes)
            excitation = rig.band_noise(rng, RATE_HZ, 0.25, (max(low, 20.0), 0.9 * high),
                                        amplitude=1.5, lead_s=0.3)
            record = rig.simulate_record(true, excitation, rng, 80.0)
            noise = np.tile(record.noise_std**2, (len(record.sensor), 1))
            # after so long each record is a new start
            shift_ns = run * 10**10
            for corrector, verdicts in ((whole, covered), (without, plain)):
                result = corrector.process(record.sensor_stamps_ns + shift_ns, record.sensor, noise)
                truth = interpolate(record.stamps_ns, record.reference,
                                    result.stamps_ns - shift_ns, RATE_HZ)
                usable = np.isfinite(truth).all(axis=1)
                square = (result.values - truth)**2
                verdicts.append((square < 4 * result.variance)[usable])
    covered, plain = (np.concatenate(parts).mean() for parts in (covered, plain))
    assert 0.93 <= covered <= 0.97, (covered, plain)
    assert plain < 0.93, (covered, plain)


def corrected(model, record, edges=(0, None)):
    corrector = Corrector(model, RATE_HZ, noise_std=1e-4)
    parts = [corrector.process(record.sensor_stamps_ns[a:b], record.sensor[a:b])
             for a, b in zip(edges[:-1], edges[1:])]
    values, variance = (np.concatenate([getattr(part, name) for part in parts])
                        for name in ("values", "variance"))
    return values, variance, corrector.design.parameter_uncertainty[0]


@pytest.mark.parametrize("cause", SPRING_STD)
def test_it_is_the_derivative_of_the_corrected_samples(cause):
    """Against two corrections with the coefficient moved to both sides; and block by block."""
    rng, sensor, names, values, _ = draw_case(8, cause)
    name, value = names[-1], values[-1]
    excitation = rig.band_noise(rng, RATE_HZ, 0.5, (20.0, 150.0), amplitude=1.5, lead_s=0.3)
    record = rig.simulate_record(sensor, excitation, rng, 60.0)
    moved = []
    for sign in (-1, 1):
        core, effects = changed(sensor, [name], np.array([value * (1 + 1e-3 * sign)]))
        moved.append(corrected(model_of(rig.Sensor(core, effects)), record)[0])
    expected = (moved[1] - moved[0]) / 2e-3 * 0.2
    certain = corrected(model_of(sensor), record)[1]
    model = model_of(sensor, [name], [[(0.2 * value)**2]])
    _, variance, design = corrected(model, record)
    assert design.left_out == ()
    error = np.sqrt(np.maximum(variance - certain, 0)) - np.abs(expected)
    assert np.abs(error).max() < 1e-4 * np.abs(expected).max()
    edges = [0, *np.sort(rng.integers(0, len(record.sensor), 30)), len(record.sensor)]
    np.testing.assert_array_equal(corrected(model, record, edges)[1], variance)


def test_sensitivity_and_spring_together():
    """A sensitivity moves the whole of the corrected sample, the spring's part included."""
    rng, sensor, *_ = draw_case(3, "cubic_stiffness")
    sensor.effects["cubic_stiffness"]["alpha3"] *= 20
    record = rig.simulate_record(
        sensor, rig.band_noise(rng, RATE_HZ, 0.5, (20.0, 100.0), amplitude=1.5, lead_s=0.3), rng)
    gain = sensor.core["sensitivity"]
    values, variance, _ = corrected(model_of(sensor, ["sensitivity"], [[(0.03 * gain)**2]]), record)
    certain = corrected(model_of(sensor), record)[1]
    missed = np.sqrt(variance - certain) - 0.03 * np.abs(values)
    assert np.sqrt(np.mean(missed**2)) < 0.02 * 0.03 * np.sqrt(np.mean(values**2))


def test_what_bends_the_loop_is_left_out_and_said():
    _, sensor, *_ = draw_case(8, "hysteresis")
    names = ["damping_ratio", "hysteresis.strength", "hysteresis.beta"]
    design = Corrector(model_of(sensor, names, np.diag([1e-6, 1e-6, 1e-6])), RATE_HZ).design
    assert design.parameter_uncertainty[0].left_out == ("hysteresis.beta",)
    assert "hysteresis.beta" in str(design.summary()["axes"]["x"]["parameter_uncertainty"])
