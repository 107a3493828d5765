"""The figures show what they are given, in a file of bearable size."""

from types import SimpleNamespace

import numpy as np
import pytest

from frac_accel.report import Page, figures

pytest.importorskip("plotly", reason="figures of reports are drawn by plotly")


@pytest.mark.parametrize("n", [7, 4000, 4001, 123_457, 1_000_000])
def test_envelope_keeps_the_extremes_of_every_stretch(n):
    rng = np.random.default_rng(n)
    x, values = np.arange(n) / 1000.0, rng.standard_normal(n)
    values[rng.integers(n)] = 50.0
    thin_x, thin = figures.envelope(x, values)
    assert len(thin) <= min(n, 4000)
    assert np.all(np.diff(thin_x) > 0)
    np.testing.assert_array_equal(thin, values[np.round(thin_x * 1000).astype(int)])
    # any window of some stretches' length has the same extremes, but for its ends
    size = max(-(-2 * n // 4000), 1)
    for first in rng.integers(0, max(n - 20 * size, 1), 20):
        window = slice(first, first + 20 * size)
        inside = (thin_x >= x[window][0]) & (thin_x <= x[window][-1])
        core = values[window][size:-size] if n > 4000 else values[window]
        assert thin[inside].max() >= core.max() and thin[inside].min() <= core.min()


def test_envelope_shows_gaps():
    values = np.ones(100_000)
    values[40_000:60_000] = np.nan
    x, thin = figures.envelope(np.arange(100_000.0), values)
    missing = x[np.isnan(thin)]
    assert len(missing) and missing.min() < 40_100 and missing.max() > 59_900
    assert np.all((missing >= 40_000) & (missing < 60_000))


def test_page_of_a_million_samples_is_small(tmp_path):
    n = 1_000_000
    rng = np.random.default_rng(0)
    time_s, signal = np.arange(n) / 2000.0, rng.standard_normal(n)
    page = Page("Long record")
    page.section("Signals").figure(figures.time_signals(
        {"measured": (time_s, signal), "model": (time_s, 0.9 * signal)}, (time_s, 0.1 * signal)))
    page.write(tmp_path / "r.html")
    assert (tmp_path / "r.html").stat().st_size < 8e6


def numbers(values):
    """Values of a trace, whichever way the installed plotly keeps them."""
    return np.asarray(values, float)


def test_bode_puts_points_on_the_branch_of_the_model():
    """A phase beyond half a turn is measured only up to whole turns."""
    frequency = np.geomspace(1, 100, 300)
    model = np.exp(-2j * np.pi * frequency * 0.02)
    at = np.geomspace(1, 100, 20)
    response = 1.01 * np.exp(-2j * np.pi * at * 0.02 + 0.1j)
    modelled = np.exp(-2j * np.pi * at * 0.02)
    points = SimpleNamespace(frequency_hz=at, response=response, std_amplitude=np.full(20, 0.005),
                             std_phase_rad=np.full(20, 0.02))
    curve = figures.ResponseCurve(frequency, model, (np.full(300, -0.02), np.full(300, 0.02)),
                                  (np.full(300, -0.1), np.full(300, 0.1)))
    figure = figures.bode(curve, points, modelled)
    amplitude, phase = [trace for trace in figure.data if trace.name == "measured"]
    np.testing.assert_allclose(numbers(amplitude.y), 1.01)
    np.testing.assert_allclose(numbers(amplitude.error_y.array), 1.01 * 2 * 0.005)
    np.testing.assert_allclose(numbers(phase.y), np.degrees(0.1 - 2 * np.pi * at * 0.02), atol=0.5)
    deviation = figures.response_deviation(curve, points, modelled)
    amplitude, phase = [trace for trace in deviation.data if trace.name == "measured"]
    np.testing.assert_allclose(numbers(amplitude.y), 1.0)
    np.testing.assert_allclose(numbers(phase.y), np.degrees(0.1))
    band = next(trace for trace in deviation.data if trace.name == "95 % interval")
    assert numbers(band.y).max() == pytest.approx(2.0)
    amplitude, phase = figures.response_interval(curve).data
    np.testing.assert_allclose(numbers(amplitude.y), 2.0)
    np.testing.assert_allclose(numbers(phase.y), np.degrees(0.1))


def test_correlation_draws_each_lag_and_the_bound():
    lags = np.arange(-3, 4)
    values = np.linspace(-1, 1, 7)
    figure = figures.correlation(lags, values, 0.2)
    band, stems, dots = figure.data
    assert numbers(band.y).max() == 0.2
    np.testing.assert_array_equal(numbers(stems.y)[1::3], values)
    np.testing.assert_array_equal(numbers(dots.y), values)
