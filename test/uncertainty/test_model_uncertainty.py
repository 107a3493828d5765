"""A model's uncertainty of amplitude and phase is that of a brute-force Monte Carlo."""

import numpy as np
import pytest

from frac_accel.errors import ModelError
from frac_accel.model import SensorModel
from frac_accel.model.core import Arx, Oscillator
from frac_accel.model.effects.low_pass_lag import LowPassLag
from frac_accel.uncertainty import UncertainAxis, response_uncertainty

# The sensor of PyDynamic's example deconv_FIR.py: 1 % on the frequency, 10 % on the damping, whose
# resonance is half as wide as its frequency is uncertain.
FREQUENCY_HZ, DAMPING_RATIO, SENSITIVITY = 36e3, 0.0055, 0.124
RELATIVE_STD = np.array([0.001, 0.01, 0.1])
NAMES = ["sensitivity", "natural_frequency_hz", "damping_ratio"]
GRID_HZ = np.unique(np.r_[np.linspace(100, 120e3, 60), np.linspace(34e3, 38e3, 60)])


def example(share):
    """Model, and 100 000 drawn responses (PyDynamic's `sos_FreqResp`) over the nominal one."""
    std = share * RELATIVE_STD * [SENSITIVITY, FREQUENCY_HZ, DAMPING_RATIO]
    model = SensorModel(Oscillator(FREQUENCY_HZ, DAMPING_RATIO, sensitivity=SENSITIVITY),
                        metadata={"covariance": {"parameters": NAMES,
                                                 "matrix": np.diag(std**2).tolist()}})
    rng = np.random.default_rng(20301)
    sensitivity, frequency, damping = np.array(
        [[SENSITIVITY], [FREQUENCY_HZ], [DAMPING_RATIO]]) \
        + std[:, None] * rng.standard_normal((3, 100_000))
    u = GRID_HZ[:, None] / frequency
    responses = sensitivity / (1 + 2j * damping * u - u**2)
    return model, responses / model.frequency_response(GRID_HZ)[:, None]


def first_order(model):
    uncertain = UncertainAxis.of(model)
    slopes = uncertain.slopes(2j * np.pi * GRID_HZ).real
    return np.sqrt(np.einsum("im,ij,jm->m", slopes, uncertain.covariance, slopes))


def test_monte_carlo_takes_over_where_the_line_fails():
    model, ratio = example(1.0)
    amplitude, phase = np.abs(ratio), np.degrees(np.angle(ratio))
    result = response_uncertainty(model, GRID_HZ)
    assert result.method == "Monte Carlo"
    wrong = first_order(model) / amplitude.std(axis=1)
    assert wrong.min() < 0.6 and wrong.max() > 2.5
    np.testing.assert_allclose(result.amplitude_std, amplitude.std(axis=1), rtol=0.1)
    np.testing.assert_allclose(result.phase_std_deg, phase.std(axis=1), rtol=0.1)
    for interval, draws, nominal in (
            (result.amplitude_interval / result.amplitude[:, None], amplitude, 0),
            (result.phase_interval_deg, phase, result.phase_deg[:, None])):
        inside = (draws >= (interval - nominal)[:, :1]) & (draws <= (interval - nominal)[:, 1:])
        assert np.all(np.abs(inside.mean(axis=1) - 0.9545) < 0.012)


def test_first_order_where_it_holds():
    model, ratio = example(0.01)
    result = response_uncertainty(model, GRID_HZ)
    assert result.method == "first order"
    np.testing.assert_allclose(result.amplitude_std, np.abs(ratio).std(axis=1), rtol=0.02)
    np.testing.assert_allclose(result.phase_std_deg, np.degrees(np.angle(ratio)).std(axis=1),
                               rtol=0.02)
    assert result.amplitude_interval[:, 1] == pytest.approx(
        result.amplitude * (1 + 2 * result.amplitude_std))


def test_correlated_parameters_of_core_link_and_delay():
    """Against draws of the whole model with a full covariance."""
    rng = np.random.default_rng(20302)
    names = ["natural_frequency_hz", "damping_ratio", "low_pass_lag.corner_hz", "delay_s"]
    values = np.array([180.0, 0.15, 400.0, 6e-4])
    root = values[:, None] * rng.uniform(-1, 1, (4, 4)) * 3e-3

    def model_of(values):
        return SensorModel(Oscillator(values[0], values[1]), [LowPassLag(values[2])], metadata={
            "covariance": {"parameters": names, "matrix": (root @ root.T).tolist()}})

    frequency = np.geomspace(2, 600, 40)
    model = model_of(values)
    result = response_uncertainty(model, frequency)
    draws = np.stack([
        model_of(draw).frequency_response(frequency) * np.exp(-2j * np.pi * frequency * draw[3])
        for draw in values + rng.standard_normal((4000, 4)) @ root.T])
    ratio = draws / model.frequency_response(frequency) * np.exp(2j * np.pi * frequency * values[3])
    # 4000 draws know a standard deviation to 1.1 %
    np.testing.assert_allclose(result.amplitude_std, np.abs(ratio).std(axis=0), rtol=0.05)
    np.testing.assert_allclose(result.phase_std_deg, np.degrees(np.angle(ratio)).std(axis=0),
                               rtol=0.05)


def test_draws_are_sensors():
    """A damping known to 60 % is drawn positive; a pole close to the unit circle inside it."""
    covariance = {"parameters": ["damping_ratio"], "matrix": [[0.06**2]]}
    uncertain = UncertainAxis.of(SensorModel(Oscillator(180.0, 0.1),
                                             metadata={"covariance": covariance}))
    damping = np.array([axis.core.damping_ratio for axis in uncertain.draws(5000)])
    assert damping.min() > 0 and np.mean(damping < 0.02) > 0.02
    covariance = {"parameters": ["a2", "b0"], "matrix": [[1e-4, 0], [0, 1e-4]]}
    core = Arx((1.0, 0.0, 0.0), (1.0, -1.2, 0.99), 1000.0)
    uncertain = UncertainAxis.of(SensorModel(core, metadata={"covariance": covariance}))
    assert all(abs(np.roots(axis.core.denominator)).max() < 1 for axis in uncertain.draws(500))


IDENTITY = [[1, 0], [0, 1]]
PAIR = ["natural_frequency_hz", "damping_ratio"]


@pytest.mark.parametrize("covariance, words", [
    (None, "covariance: missing"),
    ([1], "expected the keys parameters and matrix"),
    ({"parameters": PAIR}, "expected the keys parameters and matrix"),
    ({"parameters": "damping_ratio", "matrix": [[1]]}, "expected a list of names"),
    ({"parameters": ["damping_ratio", "dampness"], "matrix": IDENTITY},
     r"covariance.parameters\[1\]: dampness: no such parameter"),
    ({"parameters": ["damping_ratio"] * 2, "matrix": IDENTITY}, "damping_ratio stands twice"),
    ({"parameters": ["damping_ratio", "low_pass_lag.corner_hz"], "matrix": IDENTITY},
     "the model has no effect low_pass_lag"),
    ({"parameters": PAIR, "matrix": [[1, 0]]}, "expected 2 rows of 2 numbers"),
    ({"parameters": PAIR, "matrix": [[1, 0], [0]]}, "expected 2 rows of 2 numbers"),
    ({"parameters": PAIR, "matrix": [[1, 0], [0, "wide"]]}, r"matrix\[1\]\[1\]: 'wide' given"),
    ({"parameters": PAIR, "matrix": [[1, 0], [0, float("nan")]]}, r"matrix\[1\]\[1\]: nan given"),
    ({"parameters": PAIR, "matrix": [[1, 0.5], [0.4, 1]]}, "not symmetric"),
    ({"parameters": PAIR, "matrix": [[1, 0], [0, -1]]}, r"matrix\[1\]\[1\]: -1 given"),
    ({"parameters": PAIR, "matrix": [[1, 2], [2, 1]]}, "not positive semidefinite"),
])
def test_bad_covariance_is_named(covariance, words):
    metadata = {} if covariance is None else {"covariance": covariance}
    model = SensorModel(Oscillator(180.0, 0.1), metadata=metadata)
    with pytest.raises(ModelError, match=words):
        response_uncertainty(model, [100.0])


def test_covariance_of_another_axis_is_refused():
    common = Oscillator(180.0, 0.1)
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 180.0, "damping_ratio": 0.1},
        "axes": {"y": {"core": {"natural_frequency_hz": 190.0, "damping_ratio": 0.1}}},
        "covariance": {"parameters": ["damping_ratio"], "matrix": [[1e-4]]}})
    assert model.core == common
    response_uncertainty(model, [100.0], axis="z")
    with pytest.raises(ModelError, match="axes.y: has a model of its own"):
        response_uncertainty(model, [100.0], axis="y")
