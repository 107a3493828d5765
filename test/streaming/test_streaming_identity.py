"""However a stream is split into blocks, the output is the same to the last bit, events and all."""

import numpy as np
import pytest
from random_models import draw_sensor, model_of

from frac_accel import Corrector, LiveSimulator
from frac_accel.errors import FracAccelError
from frac_accel.model import SensorModel
from frac_accel.model.core import Oscillator
from frac_accel.streaming.history import LONGEST

RATE = 1000.0
START = 1_700_000_000_000_000_000


def oscillator(damping_order=1.0, effects=(), natural_frequency_hz=150.0):
    return SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": natural_frequency_hz, "damping_ratio": 0.2,
                 "damping_order": damping_order},
        "effects": list(effects)})


def eventful_stream(rng, n=3000, jitter=0.02):
    """Stamps, values and variances with everything that goes wrong on the way."""
    interval = 1e9 / RATE
    times = np.arange(n) * interval + rng.normal(size=n) * jitter * interval
    values = np.cumsum(rng.normal(size=(n, 3)), axis=0) * 0.1
    variance = np.where(rng.random((n, 3)) < 0.3, np.nan, rng.random((n, 3)))
    for _ in range(rng.integers(0, 6)):  # gaps, from one sample to far beyond the filter's memory
        times[rng.integers(150, n):] += interval * rng.choice([1, 1, 2, 5, 40, 5000])
    stamps = START + times.astype(np.int64)
    for _ in range(rng.integers(0, 8)):
        at = rng.integers(1, n - 20)
        event = rng.choice(["duplicate", "back", "nan", "inf", "burst_nan", "clock_set_back",
                            "early"])
        if event == "duplicate":
            stamps[at] = stamps[at - 1]
        elif event == "back":
            stamps[at] -= int(3 * interval)
        elif event == "nan":
            values[at, rng.integers(3)] = np.nan
        elif event == "inf":
            values[at] = np.inf
        elif event == "burst_nan":
            values[at:at + rng.integers(2, 20)] = np.nan
        elif event == "clock_set_back":
            stamps[at:] -= int(rng.integers(30, 10_000) * interval)
        else:
            stamps[at] = stamps[at - 1] + int(0.05 * interval)
    return stamps, values, variance


def run(stream, stamps, values, variance, edges):
    parts = [stream.process(stamps[a:b], values[a:b], variance[a:b])
             for a, b in zip(edges[:-1], edges[1:])]
    parts.append(stream.finish())
    return tuple(np.concatenate([getattr(part, name) for part in parts])
                 for name in ("index", "stamps_ns", "values", "variance"))


def split(rng, n, kind):
    if kind == "one by one":
        return np.arange(n + 1)
    if kind == "fixed":
        return np.unique(np.r_[np.arange(0, n, rng.integers(2, 300)), n])
    return np.unique(np.r_[0, rng.integers(0, n, rng.integers(1, 60)), n])


def same(a, b):
    return all(x.shape == y.shape and x.tobytes() == y.tobytes() for x, y in zip(a, b))


def invariant(counters):
    return counters["samples"] == sum(
        counters.get(name, 0) for name in ("given", "waiting", "warm_up", "cut_off", "duplicates",
                                           "stamps_back", "early", "not_finite", "implausible",
                                           "without_rate", "faulty"))


def random_case(seed):
    """Stream and a maker of correctors; also for sweeps over more seeds."""
    rng = np.random.default_rng([4, seed])
    model = model_of(draw_sensor(rng, RATE, own_axes=0.3))
    if isinstance(model.core, Oscillator):
        model.metadata["covariance"] = {
            "parameters": ["natural_frequency_hz", "damping_ratio"],
            "matrix": [[0.25, 0.0], [0.0, (0.05 * model.core.damping_ratio)**2]]}
    rate = RATE if rng.random() < 0.6 else 0.0
    noise = 0.1 if rng.random() < 0.5 else None
    kernel = Corrector if rng.random() < 0.8 else LiveSimulator
    return rng, eventful_stream(rng), lambda: kernel(model, rate, noise_std=noise)


def check_case(seed):
    rng, stream, corrector = random_case(seed)
    n = len(stream[0])
    whole_stream = corrector()
    whole = run(whole_stream, *stream, [0, n])
    assert invariant(whole_stream.counters), whole_stream.counters
    for kind in ("one by one", "fixed", "random"):
        other = corrector()
        parts = run(other, *stream, split(rng, n, kind))
        assert same(whole, parts), kind
        assert other.counters == whole_stream.counters
    index, stamps, values, variance = whole
    assert np.isfinite(values).all()
    assert (np.diff(index) > 0).all()
    assert index.size == whole_stream.counters["given"]
    assert not np.any(variance <= 0)
    assert (stamps == stream[0][index] - whole_stream.design.sensor_delay_ns).all()


@pytest.mark.parametrize("seed", range(16))
def test_any_split_is_bit_identical(seed):
    check_case(seed)


def test_any_split_of_a_long_memory_is_bit_identical():
    """Single samples and blocks in turn, beyond where the motion before the start is looked for."""
    rng = np.random.default_rng(5)
    model, n = oscillator(0.6), 2 * LONGEST
    model.metadata["covariance"] = {"parameters": ["damping_ratio", "damping_order"],
                                    "matrix": [[1e-4, 0.0], [0.0, 1e-4]]}
    stream = START + np.arange(n) * 1_000_000, rng.normal(size=(n, 3)), np.full((n, 3), 1e-4)
    edges = np.unique(np.r_[np.minimum(np.cumsum(rng.choice([1, 1, 1, 2, 5, 200], n)), n), 0, n])
    whole = run(Corrector(model, RATE), *stream, [0, n])
    assert len(whole[0]) > LONGEST
    assert same(whole, run(Corrector(model, RATE), *stream, edges))


def test_invariant_holds_after_every_block():
    rng, stream, corrector = random_case(3)
    kernel = corrector()
    edges = split(rng, len(stream[0]), "random")
    for a, b in zip(edges[:-1], edges[1:]):
        kernel.process(*(part[a:b] for part in stream))
        assert invariant(kernel.counters)
        assert kernel.counters["samples"] == b


def test_empty_blocks_change_nothing():
    rng = np.random.default_rng(8)
    stream = eventful_stream(rng, 600)
    kernel, other = Corrector(oscillator(1.4), RATE), Corrector(oscillator(1.4), RATE)
    expected = run(kernel, *stream, [0, 600])
    assert same(expected, run(other, *stream, [0, 0, 0, 300, 300, 600, 600]))


def test_output_is_the_filter_and_only_late():
    """Against the plain convolution with the impulse response, and the stamps it belongs to."""
    rng = np.random.default_rng(9)
    values = rng.normal(size=(800, 3))
    stamps = START + np.arange(800) * 1_000_000
    kernel = Corrector(oscillator(effects=[{"cause": "time_delay", "delay_s": 0.0025}]), RATE)
    result = kernel.process(stamps, values)
    design = kernel.design
    assert result.index[0] == design.warm_up_samples - design.delay_samples
    assert result.index[-1] == 799 - design.delay_samples
    np.testing.assert_array_equal(result.stamps_ns, stamps[result.index] - 2_500_000)
    axis = design.axes[0].filter
    assert not axis.poles.size  # a classical sensor without links is inverted by taps alone
    expected = np.convolve(values[:, 0], axis.taps)[axis.lead:800 - axis.lead]
    np.testing.assert_allclose(result.values[:, 0], expected[result.index + design.delay_samples],
                               rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("order", [0.6, 1.0])
def test_new_model_loses_no_sample_and_continues_as_if_it_had_always_been_there(order):
    rng = np.random.default_rng(10)
    n, change = 3000, 1700
    stamps = START + np.arange(n) * 1_000_000
    values = rng.normal(size=(n, 3))
    old, new = oscillator(1.0), oscillator(order, natural_frequency_hz=120.0)
    kernel = Corrector(old, RATE)
    first = kernel.process(stamps[:change], values[:change])
    between = kernel.replace(new)
    last = kernel.process(stamps[change:], values[change:])
    index = np.concatenate([part.index for part in (first, between, last)])
    assert (np.diff(index) == 1).all()
    always = Corrector(new, RATE).process(stamps, values)
    after = np.concatenate([between.values, last.values])
    expected = always.values[np.isin(always.index, np.r_[between.index, last.index])]
    np.testing.assert_allclose(after, expected[-len(after):], rtol=1e-9, atol=1e-9)
    assert invariant(kernel.counters)


def test_refused_model_leaves_the_old_one_running():
    rng = np.random.default_rng(11)
    stamps, values = START + np.arange(900) * 1_000_000, rng.normal(size=(900, 3))
    kernel, untouched = Corrector(oscillator(), RATE), Corrector(oscillator(), RATE)
    kernel.process(stamps[:500], values[:500])
    untouched.process(stamps[:500], values[:500])
    with pytest.raises(FracAccelError):
        kernel.replace(oscillator(natural_frequency_hz=150.0, effects=[
            {"cause": "sensitivity_error", "gain": 0.0}]))
    with pytest.raises(FracAccelError):
        kernel.replace(oscillator(1.5), bandwidth_hz=499.0)
    a, b = (k.process(stamps[500:], values[500:]) for k in (kernel, untouched))
    assert a.values.tobytes() == b.values.tobytes()
    assert kernel.counters == untouched.counters


def test_model_that_cannot_be_inverted_statically_is_refused_at_once():
    """Cross-axis terms that make the axes parallel: refused by the constructor and by replace."""
    singular = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.2},
        "effects": [{"cause": "cross_axis_sensitivity", "x": 1.0, "y": 1.0, "z": 1.0}]})
    with pytest.raises(FracAccelError, match="cross_axis"):
        Corrector(singular, RATE)
    rng = np.random.default_rng(12)
    stamps, values = START + np.arange(900) * 1_000_000, rng.normal(size=(900, 3))
    kernel, untouched = Corrector(oscillator(), RATE), Corrector(oscillator(), RATE)
    for k in (kernel, untouched):
        k.process(stamps[:500], values[:500])
    with pytest.raises(FracAccelError, match="cross_axis"):
        kernel.replace(singular)
    a, b = (k.process(stamps[500:], values[500:]) for k in (kernel, untouched))
    assert a.values.tobytes() == b.values.tobytes()


def test_rate_that_is_never_known_is_said():
    kernel = Corrector(oscillator())
    kernel.process([START] * 5, np.zeros((5, 3)))
    assert kernel.counters["waiting"] == 5
    with pytest.raises(FracAccelError, match="sampling_rate_hz"):
        kernel.finish()


def test_short_stream_is_flushed_by_finish():
    kernel = Corrector(oscillator())
    stamps = START + np.arange(60) * 1_000_000
    assert len(kernel.process(stamps, np.ones((60, 3)))) == 0
    assert kernel.sampling_rate_hz is None
    assert len(kernel.finish()) > 0
    assert kernel.sampling_rate_hz == pytest.approx(1000.0)


@pytest.mark.parametrize("stamps, values, variance", [
    ([0, 1], np.zeros((3, 3)), None), ([0], np.zeros(3), None),
    ([0], np.zeros((1, 2)), None), ([0], np.zeros((1, 3)), np.zeros((1, 2))),
])
def test_wrong_shapes_are_named(stamps, values, variance):
    with pytest.raises(FracAccelError, match="shape"):
        Corrector(oscillator(), RATE).process(stamps, values, variance)


def test_the_first_name_of_the_rate_still_works():
    kernel = Corrector(oscillator(), sample_rate_hz=RATE)
    assert kernel.sample_rate_hz == kernel.sampling_rate_hz == RATE


@pytest.mark.parametrize("rate", [-1.0, np.nan, np.inf])
def test_bad_rate(rate):
    with pytest.raises(FracAccelError, match="sampling_rate_hz"):
        Corrector(oscillator(), rate)
