"""Error metrics against answers that are known exactly."""

import numpy as np
import pytest

from frac_accel.errors import FracAccelError
from frac_accel.signals.metrics import error_metrics, interpolate, octave_bands

RATE = 1000.0
N = 4000


def sine(frequency_hz, amplitude=1.0, phase_deg=0.0, n=N):
    t = np.arange(n) / RATE
    return amplitude * np.sin(2 * np.pi * frequency_hz * t + np.radians(phase_deg))


@pytest.mark.parametrize("gain, phase_deg", [(1.1, 0.0), (0.7, 0.0), (1.0, 5.0), (1.05, -30.0),
                                             (0.9, 120.0), (1.0, 179.0)])
def test_gain_and_phase_of_a_sine(gain, phase_deg):
    result = error_metrics(sine(20.0), sine(20.0, gain, phase_deg), RATE, [(5.0, 50.0)]).total
    assert result.amplitude_error == pytest.approx(gain - 1, abs=1e-3)
    assert result.phase_error_deg == pytest.approx(phase_deg, abs=0.05)
    distance = abs(gain * np.exp(1j * np.radians(phase_deg)) - 1)
    assert result.nrmse == pytest.approx(distance, abs=2e-3)
    assert result.peak_error == pytest.approx(distance, abs=2e-2)


def test_a_perfect_signal_has_no_error():
    x = np.random.default_rng(0).normal(size=N)
    result = error_metrics(x, x, RATE, [(10.0, 100.0), (100.0, 400.0)])
    for band in (result.total, *result.bands):
        assert (band.amplitude_error, band.nrmse, band.peak_error) == (0, 0, 0)
        assert abs(band.phase_error_deg) < 1e-12
    assert result.median_relative_error_percent == 0


def test_bands_are_told_apart():
    reference = sine(10.0) + sine(100.0)
    signal = sine(10.0, 1.2) + sine(100.0, 0.5, 45.0)
    result = error_metrics(reference, signal, RATE, [(5.0, 40.0), (40.0, 200.0)])
    low, high = result.bands
    assert low.amplitude_error == pytest.approx(0.2, abs=2e-3)
    assert low.phase_error_deg == pytest.approx(0, abs=0.1)
    assert high.amplitude_error == pytest.approx(-0.5, abs=2e-3)
    assert high.phase_error_deg == pytest.approx(45, abs=0.1)
    assert result.total.band_hz == (5.0, 200.0)


def test_offset_counts_only_in_a_band_from_zero():
    reference = sine(20.0) + 3.0
    signal = reference + 0.5
    away = error_metrics(reference, signal, RATE, [(5.0, 50.0)]).total
    assert away.nrmse < 1e-9 and abs(away.amplitude_error) < 1e-9
    within = error_metrics(reference, signal, RATE, [(0.0, 50.0)]).total
    assert within.nrmse == pytest.approx(0.5 * np.sqrt(2), rel=0.02)


def test_noise_outside_the_band_does_not_count():
    rng = np.random.default_rng(1)
    x = sine(20.0)
    noise = 0.1 * rng.normal(size=N)
    whole = error_metrics(x, x + noise, RATE, [(0.0, 500.0)]).total
    narrow = error_metrics(x, x + noise, RATE, [(15.0, 25.0)]).total
    assert whole.nrmse == pytest.approx(0.1 * np.sqrt(2), rel=0.1)
    assert narrow.nrmse == pytest.approx(whole.nrmse * np.sqrt(10 / 500), rel=0.4)


@pytest.mark.parametrize("gain", [0.8, 0.97, 1.002, 1.3])
def test_median_relative_error_is_the_gains_at_zero_phase(gain):
    """The paper's two sines: at zero phase the median is exactly |1 - gain|."""
    x = sine(10.0) + sine(27.0, 0.5)
    median = error_metrics(x, gain * x, RATE, [(5.0, 50.0)]).median_relative_error_percent
    assert median == pytest.approx(100 * abs(1 - gain), rel=1e-9)


def test_median_relative_error_survives_zero_crossings_and_grows_with_phase():
    medians = [error_metrics(sine(10.0), sine(10.0, 1.0, phase), RATE, [(5.0, 50.0)])
               .median_relative_error_percent for phase in (1.0, 2.0, 4.0)]
    assert medians == sorted(medians) and np.isfinite(medians).all()
    # |sin(x + p) / sin x - 1| is about p |cot x|, whose median is p
    assert medians[0] == pytest.approx(100 * np.radians(1.0), rel=0.03)


def test_silence_and_short_records():
    silent = error_metrics(np.zeros(100), np.ones(100), RATE, [(5.0, 50.0)])
    assert np.isnan(silent.total.nrmse)
    assert np.isnan(silent.median_relative_error_percent)
    assert np.isfinite(error_metrics(sine(100.0, n=16), sine(100.0, 1.1, n=16), RATE,
                                     [(0.0, 400.0)]).total.nrmse)
    with pytest.raises(FracAccelError, match="15 common samples"):
        error_metrics(np.zeros(15), np.zeros(15), RATE, [(0.0, 50.0)])
    with pytest.raises(FracAccelError, match="same length"):
        error_metrics(np.zeros(20), np.zeros(21), RATE, [(0.0, 50.0)])


def test_plain_numbers():
    result = error_metrics(sine(20.0), sine(20.0), RATE, [(5.0, 50.0)]).as_dict()
    assert set(result) == {"total", "bands", "median_relative_error_percent"}
    assert type(result["total"]["nrmse"]) is float


@pytest.mark.parametrize("share", [0.01, 0.3, 0.6, 0.8])
def test_interpolation_is_as_exact_as_it_says(share):
    """Errors below 1e-4 up to 0.8 of the Nyquist frequency."""
    frequency = share * RATE / 2
    stamps = np.arange(N) * 1_000_000
    values = np.stack([sine(frequency, 1.0, phase) for phase in (0, 40, 90)], axis=1)
    at = stamps[100:-100] + np.random.default_rng(2).integers(-500_000, 500_000, N - 200)
    expected = np.stack([np.sin(2 * np.pi * frequency * at * 1e-9 + np.radians(phase))
                         for phase in (0, 40, 90)], axis=1)
    result = interpolate(stamps, values, at, RATE)
    assert np.max(np.abs(result - expected)) < 1e-4


def test_interpolation_at_the_samples_is_the_samples_to_the_ends():
    stamps = np.arange(200) * 1_000_000
    values = np.random.default_rng(3).normal(size=(200, 3))
    np.testing.assert_array_equal(interpolate(stamps, values, stamps, RATE), values)


def test_interpolation_stops_at_gaps_and_ends():
    stamps = np.r_[np.arange(200), np.arange(203, 400)] * 1_000_000
    values = np.ones((397, 3))
    at = np.arange(-5, 405) * 1_000_000 + 300_000
    known = np.isfinite(interpolate(stamps, values, at, RATE)).all(axis=1)
    t = at / 1e6
    assert not known[(t < 30) | (t > 370) | ((t > 170) & (t < 232))].any()
    assert known[(t > 40) & (t < 160)].all() and known[(t > 240) & (t < 360)].all()
    assert np.isnan(interpolate(np.empty(0, np.int64), np.empty((0, 3)), at, RATE)).all()


def test_octave_bands():
    assert octave_bands(0, 800.0, most=3) == [(0, 200.0), (200.0, 400.0), (400.0, 800.0)]
    bands = octave_bands(30.0, 500.0)
    assert bands[0][0] == 30.0 and bands[-1][1] == 500.0
    assert all(a[1] == b[0] for a, b in zip(bands, bands[1:]))
