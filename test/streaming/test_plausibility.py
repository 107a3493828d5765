"""No absurd sample reaches a filter, every true shock does, however the stream is split."""

import numpy as np
import pytest
import rig
from random_models import model_of

from frac_accel import Corrector
from frac_accel.errors import ModelError
from frac_accel.model import SensorModel
from frac_accel.model.core import CORES
from frac_accel.signals.metrics import interpolate
from frac_accel.streaming.plausibility import CEILING, LEARN, LOOK, Plausibility

RATE = 1000.0
START = 1_700_000_000_000_000_000
MODELS = {
    "classical": {"core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.2}},
    "fractional": {"core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.2,
                            "damping_order": 0.5}},
    "ac coupled": {"core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.2},
                   "effects": [{"cause": "ac_coupling", "corner_hz": 1.0}]},
    "cubic": {"core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.2},
              "effects": [{"cause": "cubic_stiffness", "alpha3": 1e-4}]},
}


def model(name="classical", **more):
    document = {"schema": "frac_accel/sensor_model/1", **MODELS[name]}
    document["effects"] = [*document.get("effects", []), *more.pop("effects", [])]
    return SensorModel.from_dict({**document, **more})


def stamps_of(n):
    return START + np.arange(n, dtype=np.int64) * 1_000_000


def motion(seed, n=3000):
    rng = np.random.default_rng(seed)
    t = np.arange(n) / RATE
    waves = [sum(np.sin(2 * np.pi * rng.uniform(1, 100) * t + rng.uniform(0, 6)) for _ in range(5))
             for _ in range(3)]
    return np.stack(waves, axis=1) + [0, 0, 9.81] + 0.02 * rng.normal(size=(n, 3))


def corrected(kernel, values, blocks=None):
    edges = np.r_[0, blocks if blocks is not None else [], len(values)].astype(int)
    parts = [kernel.process(stamps_of(len(values))[a:b], values[a:b])
             for a, b in zip(edges[:-1], edges[1:])]
    parts.append(kernel.finish())
    return tuple(np.concatenate([getattr(part, name) for part in parts])
                 for name in ("index", "values", "variance"))


@pytest.mark.parametrize("spike", [1e30, -1e99, 1e100, 9e99, 1e307, 1e9, 1e4, 32767.0, -32768.0,
                                   160.0])
@pytest.mark.parametrize("name", MODELS)
def test_one_absurd_sample_leaves_no_trace_but_its_gap(name, spike):
    # behind a high-pass there is no gravity
    values = motion(1) - [0, 0, 9.81 * (name == "ac coupled")]
    spoilt = values.copy()
    spoilt[1500, 0] = spike
    kernel, other = (Corrector(model(name), RATE, noise_std=0.02) for _ in range(2))
    index, clean, _ = corrected(other, values)
    index_with, result, variance = corrected(kernel, spoilt)
    assert kernel.counters["implausible"] == 1 == kernel.counters["filled"]
    assert other.counters["implausible"] == 0
    np.testing.assert_array_equal(np.setdiff1d(index, index_with), [1500])
    error = result - clean[np.isin(index, index_with)]
    assert np.isfinite(variance).all()
    assert (np.abs(error) < 4 * np.sqrt(variance)).all()
    # and the doubt passes with the bridge
    assert np.sqrt(variance[-1]).max() < 1.05 * np.sqrt(variance[1000]).max()


@pytest.mark.parametrize("name", ["classical", "fractional"])
def test_spikes_at_random_places(name):
    """One sample in two hundred is at an int16's end: within six deviations of the truth."""
    rng = np.random.default_rng(2)
    values = motion(3, 8000)
    spoilt = values.copy()
    places = rng.choice(np.arange(8000), 40, replace=False)
    spoilt[places, rng.integers(0, 3, 40)] = rng.choice([32767.0, -32768.0], 40)
    kernel = Corrector(model(name), RATE, noise_std=0.02)
    index, result, variance = corrected(kernel, spoilt)
    truth_index, truth, _ = corrected(Corrector(model(name), RATE, noise_std=0.02), values)
    assert kernel.counters["implausible"] == 40
    error = result - truth[np.isin(truth_index, index)]
    assert (np.abs(error) < 6 * np.sqrt(variance)).all()


def half_sine(values, at, length, peak):
    shocked = values.copy()
    shocked[at:at + length] += peak * np.sin(np.pi * (np.arange(length) + 0.5) / length)[:, None]
    return shocked


@pytest.mark.parametrize("length", [4, 5, 8, 20, 200])
@pytest.mark.parametrize("peak", [30.0, 1000.0, 2e6])
def test_a_shock_out_of_rest_passes_whole(length, peak):
    """Up to the hardest that sensors are made for, from noise of a hundredth."""
    rest = 0.01 * np.random.default_rng(4).normal(size=(1200, 3)) + [0, 0, 9.81]
    kernel = Corrector(model(), RATE)
    corrected(kernel, half_sine(rest, 700, length, peak))
    assert kernel.counters["implausible"] == 0


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_a_ringing_that_sets_in_at_once_passes_whole(share):
    t = np.arange(600)
    ring = 5000 * np.exp(-0.1 * t) * np.cos(np.pi * share * t)
    values = 0.01 * np.random.default_rng(5).normal(size=(1200, 3))
    values[600:] += ring[:, None]
    kernel = Corrector(model(), RATE)
    corrected(kernel, values)
    assert kernel.counters["implausible"] == 0


def test_a_step_and_a_gain_that_is_set_higher_pass_whole():
    values = motion(6)
    values[1000:2000] += 200.0
    values[2000:] *= 1000.0
    kernel = Corrector(model(), RATE)
    corrected(kernel, values)
    assert kernel.counters["implausible"] == 0


@pytest.mark.parametrize("seed", range(20))
def test_no_false_alarm_on_heavy_tails_and_coarse_steps(seed):
    rng = np.random.default_rng([7, seed])
    noise = [rng.normal(size=(4000, 3)), rng.laplace(size=(4000, 3)),
             np.round(0.3 * rng.normal(size=(4000, 3))) * 0.0981,
             np.cumsum(rng.normal(size=(4000, 3)), axis=0)][seed % 4]
    kernel = Corrector(model(), RATE)
    corrected(kernel, 10 ** rng.uniform(-4, 4) * noise if seed % 4 != 2 else noise)
    assert kernel.counters["implausible"] == 0


@pytest.mark.parametrize("at", [0, 1, 5, 20, 31, 32, 40])
def test_a_spike_among_the_first_samples(at):
    values = motion(8)
    values[at, 1] = 3e4
    kernel = Corrector(model("fractional"), RATE, noise_std=0.02)
    _, result, _ = corrected(kernel, values)
    assert kernel.counters["implausible"] == 1
    assert np.abs(result).max() < 40


def test_what_the_model_or_a_parameter_states_is_the_range():
    values = motion(9) - [0, 0, 9.81]
    values[1500] = [8.0, 0.0, 0.0]
    clipping = {"cause": "clipping", "lower": -6.0, "upper": 9.0}
    for kernel, count in (
            (Corrector(model(), RATE), 0),
            (Corrector(model(plausible_range=[-10.0, 8.5]), RATE), 0),
            (Corrector(model(plausible_range=[-10.0, 7.9]), RATE), 1),
            (Corrector(model(plausible_range=[-10.0, 8.5]), RATE, plausible_range=(-20, 7.5)), 1),
            (Corrector(model(effects=[clipping]), RATE), 0),
            (Corrector(model(effects=[{**clipping, "lower": -5, "upper": 6.5}]), RATE), 0),
            (Corrector(model(effects=[{**clipping, "lower": -5, "upper": 5.3}]), RATE), 1)):
        corrected(kernel, values)
        assert kernel.counters["implausible"] == count


@pytest.mark.parametrize("stated", ["ten", [1.0], [3.0, 2.0], [0.0, float("nan")]])
def test_a_bad_range_in_a_model_is_refused(stated):
    with pytest.raises(ModelError, match="plausible_range"):
        model(plausible_range=stated)


def test_what_lasts_but_is_beyond_any_use_is_never_true():
    values = motion(10)
    values[1500:, 2] = 1.01 * CEILING
    kernel = Corrector(model(), RATE)
    index, result, _ = corrected(kernel, values)
    assert kernel.counters["implausible"] == 1500
    assert np.abs(result).max() < 40 and index[-1] < 1500


def test_a_suspect_is_held_no_longer_than_it_takes():
    """The latency grows by `LOOK` samples, and only behind a suspect."""
    values = half_sine(motion(11), 1500, 400, 1e5)
    kernel = Corrector(model(), RATE)
    delay = None
    for i, (stamp, value) in enumerate(zip(stamps_of(3000), values)):
        result = kernel.process([stamp], value[None])
        if len(result) and i > 100:
            delay = max(delay or 0, i - int(result.index[0]))
    assert kernel.design.delay_samples <= delay <= kernel.design.delay_samples + LOOK


@pytest.mark.parametrize("seed", range(12))
def test_what_is_decided_does_not_depend_on_the_blocks(seed):
    rng = np.random.default_rng([12, seed])
    values = motion(seed, 2000) * 10 ** rng.uniform(-3, 2)
    for _ in range(rng.integers(1, 12)):
        at, kind = rng.integers(0, 1990), rng.integers(4)
        if kind == 0:
            values[at, rng.integers(3)] = rng.choice([1e30, 3e4, -3e4, np.nan, np.inf, 200.0])
        elif kind == 1:
            values[at:at + rng.integers(2, 300)] = np.nan
        elif kind == 2:
            values[at:at + rng.integers(1, 9)] += 10 ** rng.uniform(1, 7)
        else:
            values[at:at + 40:rng.integers(2, 7)] *= 1e4
    whole_kernel = Corrector(model("fractional"), RATE, noise_std=0.02)
    whole = corrected(whole_kernel, values)
    counters = whole_kernel.counters
    assert counters["samples"] == sum(counters[name] for name in (
        "given", "waiting", "warm_up", "cut_off", "duplicates", "stamps_back", "early",
        "not_finite", "implausible", "without_rate"))
    for blocks in (np.arange(2000), np.sort(rng.integers(0, 2000, 30))):
        kernel = Corrector(model("fractional"), RATE, noise_std=0.02)
        parts = corrected(kernel, values, blocks)
        assert all(a.tobytes() == b.tobytes() for a, b in zip(whole, parts))
        assert kernel.counters == counters


def test_endless_bad_samples_are_not_held_for_ever():
    low = np.full(3, -CEILING)
    range_ = Plausibility(low, -low, np.ones(3))
    good = np.random.default_rng(0).normal(size=(LEARN + 5, 3))
    bad = np.full((5000, 3), np.nan)
    values = np.concatenate([good, [[1e3, 0, 0]], bad])
    decided = 0
    for i, value in enumerate(values):
        decided += len(range_.judge(*([i],) * 2, value[None], value[None])[0])
        assert i + 1 - decided == range_.waiting <= 256
    assert decided > 5000


@pytest.mark.parametrize("kind", sorted(CORES))
def test_every_kind_of_core_has_a_range(kind):
    rng = np.random.default_rng(13)
    if kind == "gain":
        pytest.skip("needs no drawing")
    names = {"oscillator": "classical"}
    sensor = rig.draw_sensor(rng, RATE, names.get(kind, kind), ())
    record = rig.simulate_record(sensor, rig.band_noise(rng, RATE, 3.0, (5.0, 100.0)), rng)
    values = record.sensor.copy()
    values[2000, 0] = 1e30
    kernel = Corrector(model_of(sensor), RATE, noise_std=0.01)
    result = kernel.process(record.stamps_ns, values)
    assert kernel.counters["implausible"] == 1
    truth = interpolate(record.stamps_ns, record.reference, result.stamps_ns, RATE)
    assert np.nanmax(np.abs(result.values - truth)) < 10 * np.nanmax(np.abs(truth))
