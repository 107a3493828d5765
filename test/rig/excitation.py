"""Base accelerations on a grid finer than the record, band-limited by construction.

Nothing is interpolated or decimated by a filter: each waveform is synthesised on the fine grid, and
the reference is every `oversampling`-th point of it. Motion starts from rest with a ramp that has
all derivatives; with `lead_s` the ramp lies before the record, which then starts in mid-motion.
All waveforms have three axes; `amplitude` is one number or three.
"""

import dataclasses

import numpy as np
import scipy.fft
import scipy.signal

TAIL_SAMPLES = 64  # after the record, for clocks that run ahead


@dataclasses.dataclass(frozen=True)
class Excitation:
    """Acceleration [m/s²], shape (3, grid points), and where the record lies in it."""

    acceleration: np.ndarray
    rate_hz: float
    oversampling: int
    start: int    # grid point at which the record starts
    samples: int

    @property
    def step_s(self):
        """Spacing of the grid [s]."""
        return 1 / (self.rate_hz * self.oversampling)

    @property
    def reference(self):
        """Acceleration at the record's instants, shape (samples, 3)."""
        stop = self.start + self.samples * self.oversampling
        return self.acceleration[:, self.start:stop:self.oversampling].T.copy()


class Grid:
    """Time axis of an excitation; t = 0 is the record's first sample."""

    def __init__(self, rate_hz, duration_s, lead_s=0.0, oversampling=64, least=64,
                 tail_samples=TAIL_SAMPLES):
        """`least` oversampling may be below 64 only where the content ends far below `rate_hz`."""
        if oversampling < least or oversampling % 2:
            raise ValueError(f"oversampling {oversampling}: expected an even number from {least}")
        self.rate_hz, self.oversampling = rate_hz, oversampling
        self.samples = round(duration_s * rate_hz)
        lead = int(np.ceil(lead_s * rate_hz))
        self.start = lead * oversampling
        self.points = (lead + self.samples + tail_samples) * oversampling + 1
        self.grid_rate_hz = rate_hz * oversampling
        # Ramp: the lead, or a tenth of the record.
        self.ramp_s = (lead if lead else max(64, self.samples // 10)) / rate_hz

    @property
    def t(self):
        """Times of the grid points [s]."""
        return (np.arange(self.points) - self.start) / self.grid_rate_hz

    def ramped(self, waveforms, amplitude):
        """Excitation from unit waveforms (3, points), switched on smoothly."""
        begin = -self.start / self.grid_rate_hz
        ramp = smooth_step((self.t - begin) / self.ramp_s)
        return self.excitation(waveforms * ramp, amplitude)

    def excitation(self, waveforms, amplitude):
        """Excitation from unit waveforms (3, points)."""
        scale = np.broadcast_to(np.asarray(amplitude, float), 3)
        return Excitation(np.ascontiguousarray(waveforms * scale[:, None]), self.rate_hz,
                          self.oversampling, self.start, self.samples)


def smooth_step(x):
    """0 below 0, 1 above 1, with all derivatives continuous."""
    x = np.clip(x, 1e-3, 1 - 1e-3)
    return 0.5 * (1 + np.tanh((2 * x - 1) / (4 * x * (1 - x)) * 2))


def window(t, start_s, stop_s, ramp_s):
    """1 between the two times, 0 outside, with ramps of `ramp_s` inside."""
    return smooth_step((t - start_s) / ramp_s) * smooth_step((stop_s - t) / ramp_s)


def _noise(rng, grid, band_hz):
    """Gaussian noise of unit RMS with a flat spectrum in the band; period longer than the grid."""
    period = scipy.fft.next_fast_len(grid.points, real=True)
    waveforms = np.empty((3, grid.points))
    frequency = np.fft.rfftfreq(period, 1 / grid.grid_rate_hz)
    low, high = np.searchsorted(frequency, band_hz)
    low = max(low, 1)
    if high <= low:
        raise ValueError(f"band {band_hz} Hz: no line in it")
    for axis in range(3):
        spectrum = np.zeros(len(frequency), complex)
        spectrum[low:high] = rng.normal(size=(high - low, 2)) @ [1, 1j]
        waveforms[axis] = scipy.fft.irfft(spectrum, period)[:grid.points]
        waveforms[axis] *= period / (2 * np.sqrt(high - low))
    return waveforms


def band_noise(rng, rate_hz, duration_s, band_hz, amplitude=1.0, lead_s=0.0, oversampling=64):
    """Gaussian noise with a flat spectrum between two frequencies; amplitude is its RMS."""
    grid = Grid(rate_hz, duration_s, lead_s, oversampling)
    return grid.ramped(_noise(rng, grid, band_hz), amplitude)


def noise_bursts(rng, rate_hz, duration_s, band_hz, levels, amplitude=1.0, oversampling=64):
    """Noise in equally long bursts, each from rest to rest, of RMS amplitude * level."""
    grid = Grid(rate_hz, duration_s, 0.0, oversampling)
    edges = np.linspace(0, duration_s, len(levels) + 1)
    envelope = sum(level * window(grid.t, start, stop, (stop - start) / 4)
                   for level, start, stop in zip(levels, edges[:-1], edges[1:]))
    return grid.excitation(_noise(rng, grid, band_hz) * envelope, amplitude)


def multisine(rng, rate_hz, duration_s, band_hz, period_s, amplitude=1.0, lead_s=0.0,
              oversampling=64):
    """All harmonics of 1 / period_s in the band, equal, in random phase; amplitude is the RMS."""
    grid = Grid(rate_hz, duration_s, lead_s, oversampling)
    points = round(period_s * rate_hz) * oversampling
    if not np.isclose(points, period_s * grid.grid_rate_hz, rtol=1e-9):
        raise ValueError(f"period {period_s} s: expected a whole number of samples")
    harmonics = np.arange(max(1, int(np.ceil(band_hz[0] * period_s))),
                          int(band_hz[1] * period_s) + 1)
    place = (np.arange(grid.points) - grid.start) % points
    waveforms = np.empty((3, grid.points))
    for axis in range(3):
        spectrum = np.zeros(points // 2 + 1, complex)
        spectrum[harmonics] = np.exp(2j * np.pi * rng.random(len(harmonics)))
        period = scipy.fft.irfft(spectrum, points) * points / np.sqrt(2 * len(harmonics))
        waveforms[axis] = period[place]
    return grid.ramped(waveforms, amplitude)


def sines(rate_hz, duration_s, frequencies_hz, phases_rad, amplitude=1.0, lead_s=0.0,
          oversampling=64):
    """Sum of sines of equal amplitude, the same on all axes."""
    grid = Grid(rate_hz, duration_s, lead_s, oversampling)
    waveform = sum(np.sin(2 * np.pi * f * grid.t + p)
                   for f, p in zip(frequencies_hz, phases_rad))
    return grid.ramped(np.tile(waveform, (3, 1)), amplitude)


def swept_sine(rate_hz, duration_s, band_hz, amplitude=1.0, lead_s=0.0, oversampling=64):
    """Logarithmic sweep over the record's length, the same on all axes; amplitude is the peak."""
    grid = Grid(rate_hz, duration_s, lead_s, oversampling)
    low, high = band_hz
    rate = np.log(high / low) / duration_s
    # Before and after the record the frequency stays at the band's ends.
    inside = np.clip(grid.t, 0, duration_s)
    phase = 2 * np.pi * (low * np.expm1(rate * inside) / rate
                         + low * np.minimum(grid.t, 0)
                         + high * np.maximum(grid.t - duration_s, 0))
    return grid.ramped(np.tile(np.sin(phase), (3, 1)), amplitude)


def stepped_sine(rate_hz, duration_s, frequencies_hz, amplitude=1.0, oversampling=64):
    """One frequency after the other, each switched on and off smoothly, the same on all axes."""
    grid = Grid(rate_hz, duration_s, 0.0, oversampling)
    t = grid.t
    edges = np.linspace(0, duration_s, len(frequencies_hz) + 1)
    waveform = sum(np.sin(2 * np.pi * f * (t - start)) * window(t, start, stop, (stop - start) / 5)
                   for f, start, stop in zip(frequencies_hz, edges[:-1], edges[1:]))
    return grid.excitation(np.tile(waveform, (3, 1)), amplitude)


def shock(rate_hz, duration_s, width_s, shape="gaussian", at_s=None, amplitude=1.0,
          oversampling=64):
    """One shock, the same on all axes, in the record's middle unless `at_s` says otherwise.

    `width_s` is a Gaussian's standard deviation, or the length of a half sine. The half sine's
    corners are rounded by a Gaussian of a sixteenth of its length.
    """
    grid = Grid(rate_hz, duration_s, 0.0, oversampling)
    t = grid.t - (duration_s / 2 if at_s is None else at_s)
    if shape == "gaussian":
        waveform = np.exp(-0.5 * (t / width_s) ** 2)
    elif shape == "half_sine":
        waveform = np.where(np.abs(t) < width_s / 2, np.cos(np.pi * t / width_s), 0.0)
        spread = width_s / 16 * grid.grid_rate_hz
        taps = np.exp(-0.5 * (np.arange(-round(8 * spread), round(8 * spread) + 1) / spread) ** 2)
        waveform = scipy.signal.fftconvolve(waveform, taps / taps.sum(), mode="same")
    else:
        raise ValueError(f"shape {shape!r}: expected gaussian or half_sine")
    return grid.excitation(np.tile(waveform, (3, 1)), amplitude)
