"""The error budget: shares of residuals whose parts are known, and noise that is established."""

import numpy as np
import pytest
import scipy.signal as sig
from budget_cases import KINDS, draw, excitation, noise

from frac_accel.budget import Division, error_budget, established_noise, filters, unaccounted
from frac_accel.budget.blocks import FOLDS, Blocks
from frac_accel.budget.filters import Filters
from frac_accel.budget.modulated import Modulated

RATE = 100.0


def budget(residual, measured, simulated, reference, other=None, used=None):
    used = np.ones(len(residual), bool) if used is None else used
    return error_budget(residual, measured, simulated, reference, used, RATE, 0, other)


def covered(found, part, truth):
    """Whether an interval holds a true share, to a thousandth."""
    entry = next((entry for entry in found.parts if entry["part"] == part), None)
    if entry is None:
        return truth == 0
    return entry["ci95"][0] - 1e-3 <= truth <= entry["ci95"][1] + 1e-3


def test_each_kind_has_the_share_that_it_was_given():
    """Three draws of each kind, white and coloured noise beside it: its share and the noise's."""
    right, errors, others = [], [], []
    for seed in range(100, 100 + 3 * len(KINDS)):
        *signals, truth = draw(seed, n=4000)
        found = budget(*signals)
        right += [covered(found, part, share) for part, share in truth.items()]
        errors += [found.share(part) - share for part, share in truth.items()]
        others += [entry["share"] for entry in found.parts if entry["part"] not in truth]
        assert sum(entry["share"] for entry in found.parts) == pytest.approx(1)
    assert np.mean(right) >= 0.9
    assert np.median(np.abs(errors)) < 0.02
    assert np.quantile(others, 0.97) < 0.02


def test_three_kinds_beside_each_other():
    right = []
    for seed in range(6):
        kinds = tuple(np.random.default_rng(seed).choice(KINDS, 3, replace=False))
        *signals, truth = draw(seed, kinds, n=6000)
        found = budget(*signals)
        right += [covered(found, part, share) for part, share in truth.items()]
    assert np.mean(right) >= 0.85


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_noise_alone_gives_nothing(colour):
    """Of all parts of 15 records, short ones among them, at most as many stand out as intervals of
    95 % let, and none by much."""
    false, largest = [], 0.0
    for seed in range(15):
        rng = np.random.default_rng([seed, 31])
        n = (400, 2000, 8000)[seed % 3]
        reference, y = excitation(rng, n)
        e = noise(rng, n, colour)
        for entry in budget(e, y + e, y, reference).parts[:-1]:
            false.append(entry["share"] > 0.02 and entry["ci95"][0] > 1e-3)
            largest = max(largest, entry["share"] * false[-1])
    assert np.mean(false) <= 0.05
    assert largest < 0.1


def test_spikes_do_not_hide_a_gain_error():
    """0.1 % of spikes with forty times the gain error's RMS: the same linear power as without."""
    rng = np.random.default_rng(5)
    reference, y = excitation(rng, 8000)
    e = 0.04 * y + 0.005 * y.std() * rng.normal(size=8000)
    spiky = e.copy()
    spiky[rng.choice(np.arange(200, 7800), 8, replace=False)] += 1.6 * y.std()
    clean, found = budget(e, y + e, y, reference), budget(spiky, y + spiky, y, reference)
    assert found.share("bursts") == pytest.approx(1 - np.sum(e**2) / np.sum(spiky**2), abs=0.02)
    assert found.share("linear") * found.rms**2 == pytest.approx(
        clean.share("linear") * clean.rms**2, rel=0.02)


def test_one_sine():
    """A wrong gain on one sine is linear, its third harmonic is odd."""
    t = np.arange(6000) / RATE
    y = np.sin(2 * np.pi * 3.17 * t)
    rng = np.random.default_rng(1)
    e = 0.05 * y + 0.03 * np.sin(2 * np.pi * 3 * 3.17 * t) + 0.01 * rng.normal(size=len(t))
    reference = np.stack([y, 0 * y, 0 * y], axis=1)
    found = budget(e, y + e, y, reference)
    power = np.array([0.05**2 / 2, 0.03**2 / 2, 0.01**2])
    for part, share in zip(("linear", "odd", "noise"), power / power.sum()):
        assert found.share(part) == pytest.approx(share, abs=0.02)


def test_distortion_that_repeats_is_no_noise():
    """Odd multisine: what repeats on even lines is even, though no shape describes it."""
    rng = np.random.default_rng(2)
    period, count = 500, 12
    spectrum = np.zeros(period // 2 + 1, complex)
    spectrum[3:120:2] = np.exp(2j * np.pi * rng.random(59))
    y = np.tile(np.fft.irfft(spectrum, period), count)
    y /= y.std()
    odd_one = np.roll(y, 37) * np.roll(y, 80)  # a product of two distant values: even
    odd_one = odd_one - odd_one.mean()
    white = rng.normal(size=len(y))
    e = 0.01 * odd_one / odd_one.std() + 0.01 * white
    reference = np.stack([y, 0 * y, 0 * y], axis=1)
    used = np.ones(len(y), bool)
    division = Division(reference, used, RATE, 0)
    assert division.period == period
    found = division.of(e, y + e, y)
    assert found.share("even") == pytest.approx(0.5, abs=0.05)
    assert found.share("noise") == pytest.approx(0.5, abs=0.05)
    known = established_noise(e, y + e, reference, used, RATE)
    assert known.by == "periods" and known.rms == pytest.approx(0.01, rel=0.03)


@pytest.mark.parametrize("seed", range(6))
def test_what_repeats_is_no_noise_where_other_shapes_are_fitted_in_vain(seed):
    """Four periods: fits of other parts to so little make held-out data worse, by up to a half."""
    rng = np.random.default_rng(4200 + seed)
    period, count, rate = 624, 4, 100.0
    smooth = sig.butter(2, rng.uniform(2, 5), fs=rate, output="sos")

    def repeated():
        once = sig.sosfiltfilt(smooth, np.tile(rng.standard_normal(period), 3))[period:2 * period]
        return np.tile(once / np.std(once), count)
    x, distortion = repeated(), repeated()
    noise_share = rng.uniform(0.02, 0.15)
    scatter = rng.standard_normal(period * count)
    residual = 0.05 * (np.sqrt(1 - noise_share) * distortion + np.sqrt(noise_share) * scatter)
    found = budget(residual, x + residual, x, np.stack([x, 0 * x, 0 * x], axis=1))
    # the distortion may also be one that a filter or a curve makes of this motion
    assert found.share("noise") == pytest.approx(noise_share, abs=0.05)


def test_a_second_sensor_shows_what_is_the_references():
    rng = np.random.default_rng(3)
    reference, y = excitation(rng, 20_000)
    shared, own, others = rng.normal(size=(3, 20_000))
    e = 0.6 * shared + 0.8 * own
    found = budget(e, y + e, y, reference, 0.6 * shared + 1.2 * others)
    assert found.share("reference") == pytest.approx(0.36, abs=0.03)
    assert covered(found, "reference", 0.36)


def test_pictures_add_up():
    *signals, _ = draw(1, ("linear", "lines", "bursts"), n=4000)
    found = budget(*signals)
    for parts in (found.in_bands, found.along):
        assert sum(values.sum() for values in parts.values()) == pytest.approx(1, abs=1e-6)
        for part in ("linear", "lines", "bursts"):
            assert parts[part].sum() == pytest.approx(found.share(part), abs=0.05)
    assert np.diff(found.band_edges_hz).min() > 0 and found.band_edges_hz[-1] == RATE / 2


def test_a_drift_beside_a_sweep_is_no_distortion():
    """The sweep's level has a course in time, and a shape of it may have the drift's."""
    rng = np.random.default_rng(4)
    n = 12_000
    t = np.arange(n) / n
    y = (0.2 + t) * np.sin(2 * np.pi * n * (0.02 * t + 0.09 * t**2))
    drift = 0.02 * (t - 0.5)
    rest = drift - drift.mean() + 0.002 * rng.normal(size=n)
    found = budget(rest, y + rest, y, np.c_[y, 0 * y, 0 * y])
    assert found.share("even") < 0.02
    assert covered(found, "slow", np.mean((drift - drift.mean())**2) / np.mean(rest**2))


def test_motion_that_folds_is_no_distortion():
    """Harmonics of a gait above the Nyquist frequency come back below it, as those of its square
    do."""
    rng = np.random.default_rng(5)
    n, fine, rate = 6000, 8, 50.0
    phase = np.cumsum(1.8 / rate / fine * (1 + 0.1 * sig.lfilter(
        [1e-3], [1, -0.999], rng.normal(size=n * fine))))
    steps = np.mod(phase, 1.0)
    motion = sig.sosfilt(sig.butter(8, 19 / rate / fine * 2, output="sos"),
                         np.exp(-steps / 0.02) - 0.6 * np.exp(-steps / 0.05))
    lines = np.fft.rfft(motion)
    lines[np.fft.rfftfreq(n * fine, 1 / rate / fine) > rate / 2] = 0.0
    clean = np.fft.irfft(lines, n * fine)[::fine]
    rest = motion[::fine] - clean
    rest = rest + 0.05 * rest.std() * rng.normal(size=n)
    found = budget(rest, clean + rest, clean, np.c_[clean, 0 * clean, 0 * clean])
    assert found.share("even") + found.share("odd") < 0.1


@pytest.mark.parametrize("n", [32, 50, 200])
def test_very_short_records_have_a_budget(n):
    *signals, _ = draw(2, ("linear",), n=n)
    found = budget(*signals)
    assert sum(entry["share"] for entry in found.parts) == pytest.approx(1)


def test_nothing_left_and_nothing_moving():
    reference, y = excitation(np.random.default_rng(0), 1000)
    assert budget(0 * y, y, y, reference).parts == []
    still = budget(np.random.default_rng(1).normal(size=1000), y, 0 * y, 0 * reference)
    assert still.share("noise") > 0.95


@pytest.mark.parametrize("lags", [
    [(0, 0)], [(-3, 5)], [(-2, 4), (-1, 1)], [(-2, 4), (-2, 4), (0, 0)], [(-40, 70)]])
def test_filters_are_the_least_squares_of_the_other_blocks(lags, monkeypatch):
    """Against the matrix written out, with missing samples and samples left out, but no ridge."""
    monkeypatch.setattr(filters, "_RIDGES", (1e-12,))
    rng = np.random.default_rng(4)
    edge = max(max(-low, high) for low, high in lags) + 3
    n = 100 * edge
    inputs = [rng.normal(size=n) for _ in lags]
    target = np.convolve(inputs[0], [0.5, -1.0, 0.3], "same") + 0.1 * rng.normal(size=n)
    used, left_out = rng.random(n) > 0.05, rng.random(n) < 0.02
    # blocks of unlike lengths
    blocks = Blocks.of(np.linspace(1, 3, n) * rng.normal(size=n))
    predicted = Filters(inputs, lags, blocks, used).predict(target, left_out)
    columns = np.stack([np.roll(values, k) for values, (low, high) in zip(inputs, lags)
                        for k in range(low, high + 1)], axis=1)
    guard = max(high - low for low, high in lags)
    for fold in range(FOLDS):
        learnt = used & ~left_out
        learnt[:max(max(high for _, high in lags), 0)] = False
        learnt[n + min(min(low for low, _ in lags), 0):] = False
        for block in range(fold, len(blocks), FOLDS):
            learnt[slice(*blocks.guarded(block, guard))] = False
        weights = np.linalg.lstsq(columns[learnt], target[learnt], rcond=None)[0]
        for block in range(fold, len(blocks), FOLDS):
            rows = np.arange(max(blocks.edges[block], edge),
                             min(blocks.edges[block + 1], n - edge))
            assert np.allclose(predicted[rows], (columns @ weights)[rows], atol=1e-7)


def test_filters_that_leave_out_nothing_are_those_without():
    """Two diagnoses ended with an error: samples were left out, but none of those that count."""
    rng = np.random.default_rng(5)
    motion = rng.normal(size=4000)
    target = np.convolve(motion, [0.5, -1.0, 0.3], "same") + 0.1 * rng.normal(size=4000)
    made = Filters([motion], [(-3, 5)], Blocks.of(motion), np.ones(4000, bool))
    assert np.allclose(made.predict(target, np.zeros(4000, bool)), made.predict(target))


def test_modulated_follows_a_drift():
    n = 4000
    rng = np.random.default_rng(6)
    y, blocks = rng.normal(size=n), Blocks.of(rng.normal(size=n))
    truth = 0.3 * np.cos(np.pi * (np.arange(n) + 0.5) / n) * y
    found = Modulated(lambda a, b: y[a:b, None], truth, np.ones(n, bool), blocks).predict([1])
    assert np.std(found - truth) < 0.03 * np.std(truth)


def rest_record(scatter=0.02, n=6000, seed=7):
    """Motion between two rests; residual, measured, reference."""
    rng = np.random.default_rng(seed)
    reference, _ = excitation(rng, n)
    reference[:1500] = reference[-1500:] = 0.0
    e = scatter * rng.normal(size=n)
    return e, reference[:, 0] + e, reference


def test_noise_at_rest():
    e, measured, reference = rest_record()
    known = established_noise(e, measured, reference, np.ones(len(e), bool), RATE)
    assert known.by == "rest" and known.rms == pytest.approx(0.02, rel=0.15)


@pytest.mark.parametrize("frequency_hz", [7.0, 23.0])
def test_a_motor_that_runs_at_rest_is_no_noise(frequency_hz):
    """Its speed wanders, so that it is no line either."""
    e, measured, reference = rest_record()
    turns = np.cumsum(frequency_hz * (1 + 0.02 * np.interp(
        np.arange(len(e)), np.arange(0, len(e), 200), np.random.default_rng(1).normal(
            size=len(range(0, len(e), 200)))))) / 100.0
    motor = 0.3 * np.sin(2 * np.pi * turns)
    known = established_noise(e + motor, measured + motor, reference, np.ones(len(e), bool), 100.0)
    assert known.by != "rest" and any("narrow band around" in words for words in known.words)


@pytest.mark.parametrize("std, used_one", [(0.021, "rest"), (0.1, "rest"), (1e-3, "rest")])
def test_rest_is_believed_before_the_covariance(std, used_one):
    e, measured, reference = rest_record()
    known = established_noise(e, measured, reference, np.ones(len(e), bool), RATE, std)
    assert known.by == used_one
    assert bool(known.words) == (not 0.5 < std / 0.02 < 2)


def test_covariance_without_other_evidence():
    rng = np.random.default_rng(8)
    reference, y = excitation(rng, 4000)
    e = 0.023 * rng.normal(size=4000)
    every = np.ones(4000, bool)

    def by(std):
        return established_noise(e, y + e, reference, every, RATE, std).by
    assert by(0.022) == "covariance"
    assert by(0.01) is None      # a default
    assert by(0.3) is None       # more than is left
    assert by(float("nan")) is None


def test_rounded_values_at_rest_do_not_make_a_noiseless_sensor():
    e, measured, reference = rest_record(scatter=1e-4)
    rounded = 0.05 * np.round(measured / 0.05)
    known = established_noise(rounded - reference[:, 0], rounded, reference,
                              np.ones(len(e), bool), RATE)
    assert known.by == "rest" and known.rms == pytest.approx(0.05 / np.sqrt(12))


def test_a_second_sensor_establishes_no_noise_that_follows_the_motion():
    rng = np.random.default_rng(9)
    reference, y = excitation(rng, 8000)
    every, other = np.ones(8000, bool), rng.normal(size=8000)
    loud = 1 + 3 * (np.arange(8000) > 4000)
    reference *= loud[:, None]
    steady = rng.normal(size=8000)
    assert established_noise(steady, y, reference, every, RATE,
                             other_sensor_residual=other).by == "second_sensor"
    known = established_noise(steady * loud, y, reference, every, RATE, other_sensor_residual=other)
    assert known.by is None and "follows the motion" in known.words[0]


def test_what_is_unaccounted_for():
    rng = np.random.default_rng(10)
    reference, y = excitation(rng, 2000)
    every, e = np.ones(2000, bool), 0.1 * rng.normal(size=2000)
    nothing = established_noise(e, y + e, reference, every, RATE)
    found = unaccounted(0.1, 1.0, nothing)
    assert found["words"] == ("10 % of the output is unaccounted for; nothing in the record shows "
                              "that it is noise")
    stated = established_noise(e, y + e, reference, every, RATE, stated_std=0.08)
    assert stated.as_dict() == {"rms": 0.08, "by": "stated"}
    assert unaccounted(0.1, 1.0, stated)["fraction"] == pytest.approx(0.06)
    assert unaccounted(0.05, 1.0, stated)["fraction"] == 0


def test_a_resonance_is_found_linear_through_long_ringing():
    """A lightly damped sensor against a static gain, 2 % of noise."""
    rng = np.random.default_rng(11)
    reference, _ = excitation(rng, 20_000)
    pole = np.exp((-0.01 + 1j) * 0.5)
    a = np.real(np.poly([pole, pole.conj()]))
    measured = sig.lfilter([a.sum()], a, reference[:, 0])
    measured += 0.02 * measured.std() * rng.normal(size=20_000)
    found = budget(measured - reference[:, 0], measured, reference[:, 0], reference)
    assert found.share("linear") > 0.99
    assert found.share("noise") < 0.002
