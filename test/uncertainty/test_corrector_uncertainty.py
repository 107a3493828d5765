"""The variance that the corrector gives with each sample: noise and parameters, block by block."""

import pathlib
import sys

import numpy as np
import pytest
import scipy.signal

from frac_accel import Corrector
from frac_accel.model import SensorModel
from frac_accel.uncertainty import corrected_uncertainty

RATE_HZ = 2000.0
BENCHMARKS = pathlib.Path(__file__).parents[2] / "benchmarks"


def model_of(core, std, effects=(), **more):
    return SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1", "core": core, "effects": list(effects),
        "covariance": {"parameters": list(std),
                       "matrix": np.diag(np.square(list(std.values()))).tolist()}, **more})


def random_model(rng, kind):
    core = {"natural_frequency_hz": rng.uniform(0.07, 0.2) * RATE_HZ,
            "damping_ratio": np.exp(rng.uniform(np.log(0.05), np.log(0.7))),
            "damping_order": 1.0, "sensitivity": rng.uniform(0.5, 2)}
    std = {"natural_frequency_hz": 0.005 * core["natural_frequency_hz"],
           "damping_ratio": 0.05 * core["damping_ratio"],
           "sensitivity": 0.002 * core["sensitivity"], "delay_s": 0.02 / RATE_HZ, "offset": 0.01}
    effects = [{"cause": "offset", "offset": 0.1}, {"cause": "time_delay", "delay_s": 1e-3}]
    if kind == "fractional":
        core["damping_order"], std["damping_order"] = rng.uniform(0.5, 0.9), 0.01
    if kind == "mounted":
        effects.append({"cause": "mounting_resonance", "frequency_hz": rng.uniform(300, 500),
                        "damping_ratio": rng.uniform(0.03, 0.2)})
        std["mounting_resonance.frequency_hz"] = 3.0
    if kind == "uncertain beyond the linear":
        std["natural_frequency_hz"] *= 16
    return model_of(core, std, effects)


def motion(rng, count, top_hz):
    band = scipy.signal.butter(6, [2.0, 0.8 * top_hz], "band", fs=RATE_HZ, output="sos")
    return scipy.signal.sosfilt(band, rng.normal(size=(count, 3)), axis=0) + [0.5, 0.0, 9.8]


@pytest.mark.parametrize("kind", ["classical", "fractional", "mounted",
                                  "uncertain beyond the linear"])
@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_propagation_over_the_whole_record(kind, seed):
    """Against `corrected_uncertainty`, which convolves the finished record with exact responses."""
    rng = np.random.default_rng([41, seed])
    model = random_model(rng, kind)
    corrector = Corrector(model, RATE_HZ, noise_std=1e-9)
    values = motion(rng, 8000, corrector.design.axes[0].band_hz[1])
    corrected = corrector.process(np.arange(8000) * 500_000, values)
    expected = corrected_uncertainty(model, corrected.values, RATE_HZ)
    # behind what the whole-record convolution does not know of the motion before and after
    inner = slice(2000, -200)
    design = corrector.design.parameter_uncertainty
    for axis in range(3):
        assert design[axis].method == expected.method[axis]
        assert design[axis].worst_error < 0.03
        found, wanted = (np.sqrt(variance[inner, axis])
                         for variance in (corrected.variance, expected.variance))
        assert np.sqrt(np.mean((found - wanted)**2)) < 0.03 * np.sqrt(np.mean(wanted**2))


@pytest.mark.parametrize("damping_order", [1.0, 0.6])
def test_a_slow_sensor_needs_few_taps_for_its_uncertainty(damping_order):
    """Where the inverse is long, the sensitivity filters need not be, and are as exact."""
    core = {"natural_frequency_hz": 0.02 * RATE_HZ, "damping_ratio": 0.2,
            "damping_order": damping_order}
    std = {"natural_frequency_hz": 0.4, "damping_ratio": 0.01, "sensitivity": 0.002}
    if damping_order != 1:
        std["damping_order"] = 0.01
    model = model_of(core, std)
    corrector = Corrector(model, RATE_HZ, noise_std=1e-9)
    inverse, design = corrector.design.axes[0], corrector.design.parameter_uncertainty[0]
    assert len(inverse.filter.taps) > 150
    assert max(len(one.taps) for one in design.filters) < 30
    assert design.worst_error <= 0.02
    loud = np.sqrt(sum(one.noise_gain**2 for one in design.filters))
    assert loud <= 0.2 * inverse.noise_gain
    values = motion(np.random.default_rng(5), 8000, 0.02 * RATE_HZ)
    result = corrector.process(np.arange(8000) * 500_000, values)
    expected = corrected_uncertainty(model, result.values, RATE_HZ).variance[2000:-400]
    found = result.variance[2000:-400]
    assert np.sqrt(np.mean((np.sqrt(found) - np.sqrt(expected))**2)) \
        < 0.03 * np.sqrt(np.mean(expected))


def test_noise_and_parameters_add_up():
    model = model_of({"natural_frequency_hz": 200.0, "damping_ratio": 0.3}, {"sensitivity": 0.02})
    certain = SensorModel(model.core)
    stamps, values = np.arange(2000) * 500_000, np.full((2000, 3), 9.8)
    noisy = np.full(values.shape, 0.01**2)
    by_noise = Corrector(certain, RATE_HZ).process(stamps, values, noisy).variance
    both = Corrector(model, RATE_HZ).process(stamps, values, noisy).variance
    np.testing.assert_allclose(both - by_noise, (9.8 * 0.02)**2, rtol=0.02)


def test_stated_standard_uncertainties_are_enough():
    core = {"natural_frequency_hz": 200.0, "damping_ratio": 0.3}
    whole = model_of(core, {"sensitivity": 0.02, "damping_ratio": 0.01})
    listed = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1", "core": core, "uncertainties": {
            "sensitivity": {"std": 0.02, "unit": "1"}, "damping_ratio": {"std": 0.01}}})
    values = motion(np.random.default_rng(3), 1000, 300.0)
    stamps = np.arange(1000) * 500_000
    one, other = (Corrector(model, RATE_HZ, noise_std=0.1).process(stamps, values)
                  for model in (whole, listed))
    np.testing.assert_allclose(one.variance, other.variance, rtol=1e-9)


@pytest.mark.parametrize("more, words", [
    ({"covariance": {"parameters": ["no_such"], "matrix": [[1.0]]}}, "no_such"),
    ({"covariance": {"parameters": ["damping_ratio"], "matrix": [[-1.0]]}}, "at least 0"),
    ({"uncertainties": {"damping_ratio": 0.1}}, "uncertainties"),
    ({"uncertainties": {"damping_ratio": {"std": "much"}}}, "uncertainties.damping_ratio.std"),
])
def test_what_cannot_be_used_is_said(more, words):
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 200.0, "damping_ratio": 0.3}, **more})
    design = Corrector(model, RATE_HZ).design
    assert design.parameter_uncertainty == (None,) * 3
    assert all(words in note for note in design.notes)
    assert words in design.summary()["axes"]["x"]["parameter_uncertainty"]


def test_an_axis_with_its_own_core_is_said_to_have_none():
    model = model_of({"natural_frequency_hz": 200.0, "damping_ratio": 0.3}, {"damping_ratio": 0.02},
                     axes={"z": {"core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.2}}})
    design = Corrector(model, RATE_HZ).design
    assert [bool(one) for one in design.parameter_uncertainty] == [True, True, False]
    assert "axes.z" in design.notes[2]


def test_an_axis_with_its_own_core_has_the_uncertainty_that_is_stated_of_it():
    core, own = {"natural_frequency_hz": 200.0, "damping_ratio": 0.3}, \
        {"natural_frequency_hz": 150.0, "damping_ratio": 0.2}
    both = model_of(core, {"damping_ratio": 0.02, "axes.z.damping_ratio": 0.05,
                           "axes.z.natural_frequency_hz": 2.0}, axes={"z": {"core": own}})
    common = model_of(core, {"damping_ratio": 0.02})
    alone = model_of(own, {"damping_ratio": 0.05, "natural_frequency_hz": 2.0})
    values = motion(np.random.default_rng(4), 2000, 200.0)
    stamps = np.arange(2000) * 500_000

    def variance(model):
        corrector = Corrector(model, RATE_HZ, noise_std=1e-9, bandwidth_hz=250.0,
                              max_delay_s=0.01)
        assert corrector.design.notes == ("",) * 3
        result = corrector.process(stamps, values)
        return np.sqrt(result.variance[-1500:]), corrector_variance(model, result.values)

    def corrector_variance(model, corrected):
        return np.sqrt(corrected_uncertainty(model, corrected, RATE_HZ).variance[-1500:])

    (found, offline), (of_common, _), (of_alone, _) = map(variance, (both, common, alone))
    np.testing.assert_allclose(found[:, :2], of_common[:, :2], rtol=1e-3)
    np.testing.assert_allclose(found[:, 2], of_alone[:, 2], atol=0.03 * of_alone[:, 2].max())
    inner = slice(200, -200)
    missed = (found - offline)[inner]
    assert np.sqrt(np.mean(missed**2)) < 0.03 * np.sqrt(np.mean(offline[inner]**2))


@pytest.mark.parametrize("name", ["axes.w.damping_ratio", "axes.z", "axes.z.no_such"])
def test_a_parameter_of_no_axis_is_named(name):
    design = Corrector(model_of({"natural_frequency_hz": 200.0, "damping_ratio": 0.3},
                                {name: 0.02}), RATE_HZ).design
    assert design.parameter_uncertainty == (None,) * 3
    assert name.removeprefix("axes.z.") in design.notes[2]


@pytest.mark.long
@pytest.mark.parametrize("relative_std", [
    {"natural_frequency_hz": 0.001, "damping_ratio": 0.01, "sensitivity": 0.001},
    {"natural_frequency_hz": 0.01, "damping_ratio": 0.10, "sensitivity": 0.001}])
def test_two_standard_uncertainties_cover_on_the_published_shock(relative_std):
    """PyDynamic's accelerometer example, with its own uncertainties of 1 % and 10 %, and smaller.

    Each of the 600 draws is another sensor with other noise, three of them at a time as the axes;
    so many know the coverage of the samples of the shock to about 1 %.
    """
    sys.path.insert(0, str(BENCHMARKS))
    try:
        import published_shock as example
    finally:
        sys.path.remove(str(BENCHMARKS))
    nominal = {"natural_frequency_hz": example.NATURAL_HZ, "damping_ratio": example.DAMPING,
               "sensitivity": example.STATIC_GAIN}
    std = {name: share * nominal[name] for name, share in relative_std.items()}
    corrector = Corrector(model_of(nominal, std), example.RATE_HZ,
                          bandwidth_hz=example.BANDWIDTH_HZ, max_delay_s=example.MAX_DELAY_S,
                          noise_std=example.NOISE_STD)
    rng = np.random.default_rng(7)
    stamps_ns = np.round(np.arange(example.SAMPLES) * 1e9 / example.RATE_HZ).astype(np.int64)
    covered = []
    for run in range(200):
        sensors = [{name: value + std[name] * rng.normal() for name, value in nominal.items()}
                   for _ in range(3)]
        clean = np.stack([example.sensor_output(sensor) for sensor in sensors], axis=1)
        start_ns = run * 10**9
        result = corrector.process(start_ns + stamps_ns,
                                   clean + example.NOISE_STD * rng.normal(size=clean.shape))
        instants = (result.stamps_ns - start_ns) * 1e-9
        error = result.values - example.shock(instants)[:, None]
        shock = np.abs(instants - example.SHOCK_AT_S) < 4 * example.SIGMA_S
        covered.append(error[shock]**2 < 4 * result.variance[shock])
    assert np.sum([len(part) for part in covered]) == 200 * 39
    assert 0.93 <= np.mean(covered) <= 0.97
