"""How far a signal is from the reference: per band in amplitude and phase, and as in the paper."""

import dataclasses

import numpy as np

from ..errors import FracAccelError

# Half-width [samples] of the interpolating kernel, and its Kaiser shape: errors below 1e-4 up to
# 0.8 of the Nyquist frequency.
_HALF_WIDTH = 32
_KAISER = 9.0
# Spread of a band's signal, of its largest value, below which it is one value and rounding.
_CONSTANT = 1e-9


@dataclasses.dataclass(frozen=True)
class BandError:
    """Errors within one band.

    Attributes
    ----------
    band_hz : tuple of float
    amplitude_error : float
        RMS of the signal over that of the reference, less 1, both within the band. A delay within
        the band does not change it; noise of one percent of the signal adds 5e-5.
    phase_error_deg : float
        Mean phase of the signal against the reference [degree], weighted by power.
    nrmse : float
        RMS of the error over the reference's standard deviation, both within the band.
    peak_error : float
        Largest error within the band over the reference's largest value there.
    """

    band_hz: tuple
    amplitude_error: float
    phase_error_deg: float
    nrmse: float
    peak_error: float


@dataclasses.dataclass(frozen=True)
class ErrorMetrics:
    """Errors of a signal against a reference.

    Attributes
    ----------
    total : BandError
        Over all that was asked for.
    bands : tuple of BandError
        Over its parts.
    median_relative_error_percent : float
        Median of |signal - reference| / |reference| over the samples, the measure of Pietruszczak's
        Tables 1 to 3. The relative error is singular where the reference crosses zero: there its
        peaks come from the reference's smallness, not from the sensor, and only the median
        survives them. For two sines it is ``|1 - gain|`` at zero phase, and grows with the phase
        whatever the gain.
    """

    total: BandError
    bands: tuple
    median_relative_error_percent: float

    def as_dict(self):
        """Plain numbers and lists."""
        return dataclasses.asdict(self)


def error_metrics(reference, signal, sampling_rate_hz, bands):
    """Errors of a signal against the reference at the same uniform instants.

    Parameters
    ----------
    reference, signal : array_like, shape (n,)
    sampling_rate_hz : float
    bands : sequence of (float, float)
        Adjoining bands [Hz] in ascending order; their union is judged as a whole, too.

    Returns
    -------
    ErrorMetrics
        NaN where a band holds no power of the reference.

    Raises
    ------
    FracAccelError
        If there are fewer than 16 samples.

    Notes
    -----
    The band limits are applied to the tapered record by its Fourier transform; a tenth of it at
    both ends is tapered and not judged.

    Examples
    --------
    >>> import numpy as np, frac_accel
    >>> motion = np.random.default_rng(0).normal(size=4000)
    >>> found = frac_accel.error_metrics(motion, 1.02 * motion, 1000.0, [(10, 100), (100, 300)])
    >>> [round(band.amplitude_error, 6) for band in found.bands]
    [0.02, 0.02]
    """
    reference, signal = np.asarray(reference, float), np.asarray(signal, float)
    if reference.shape != signal.shape or reference.ndim != 1:
        raise FracAccelError(f"reference and signal have shapes {reference.shape} and "
                             f"{signal.shape}, expected the same length")
    n = len(reference)
    if n < 16:
        raise FracAccelError(f"{n} common samples of reference and signal, expected at least 16")
    steady = bands[0][0] == 0
    if not steady:
        reference, signal = reference - reference.mean(), signal - signal.mean()
    taper = _taper(n)
    middle = taper == 1
    frequency = np.fft.rfftfreq(n, 1 / sampling_rate_hz)
    spectra = np.fft.rfft(reference * taper), np.fft.rfft(signal * taper)

    def judge(band):
        inside = (frequency >= band[0]) & (frequency <= band[1])
        x, y = spectra[0] * inside, spectra[1] * inside
        power = np.sum(np.abs(x)**2)
        if not power > 0:
            return BandError(tuple(band), *[float("nan")] * 4)
        transfer = np.sum(np.conj(x) * y) / power
        a, b = np.fft.irfft(x, n)[middle], np.fft.irfft(y, n)[middle]
        spread = np.std(a) if np.std(a) > _CONSTANT * np.max(np.abs(a)) else np.nan
        return BandError(
            tuple(map(float, band)),
            amplitude_error=float(np.sqrt(np.sum(np.abs(y)**2) / power) - 1),
            phase_error_deg=float(np.degrees(np.angle(transfer))),
            nrmse=float(np.sqrt(np.mean((b - a)**2)) / spread),
            peak_error=float(np.max(np.abs(b - a)) / np.max(np.abs(a))))

    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.abs(signal - reference) / np.abs(reference)
    relative = relative[np.isfinite(relative)]
    return ErrorMetrics(
        total=judge((bands[0][0], bands[-1][1])), bands=tuple(judge(band) for band in bands),
        median_relative_error_percent=float(100 * np.median(relative)) if len(relative)
        else float("nan"))


def interpolate(stamps_ns, values, at_ns, sampling_rate_hz):
    """Band-limited values of a uniform record at other instants.

    Parameters
    ----------
    stamps_ns : ndarray of int64, shape (n,)
        Ascending stamps; one that is late by a whole number of intervals leaves a gap, over which
        nothing is interpolated.
    values : ndarray, shape (n, 3)
    at_ns : ndarray of int64, shape (m,)
    sampling_rate_hz : float

    Returns
    -------
    ndarray, shape (m, 3)
        NaN where the record does not reach, or closer to its ends than half the kernel unless the
        instant is a sample's own.

    Notes
    -----
    A sinc under a Kaiser window (A. V. Oppenheim, R. W. Schafer, *Discrete-Time Signal
    Processing*, 3rd ed., section 7.5.3).
    """
    stamps_ns, at_ns = np.asarray(stamps_ns, np.int64), np.asarray(at_ns, np.int64)
    result = np.full((len(at_ns), 3), np.nan)
    if not len(stamps_ns):
        return result
    interval = 1e9 / sampling_rate_hz
    slot = np.round((stamps_ns - stamps_ns[0]) / interval).astype(np.int64)
    position = (at_ns - stamps_ns[0]) / interval
    nearest = np.round(position).astype(np.int64)
    offset = position - nearest
    place = np.searchsorted(slot, nearest)
    found = (place < len(slot)) & (slot[np.minimum(place, len(slot) - 1)] == nearest)
    # a nanosecond is what rounding of the stamps may take away
    own = found & (np.abs(at_ns - stamps_ns[np.minimum(place, len(slot) - 1)]) <= 1)
    result[own] = values[place[own]]
    reach = np.arange(-_HALF_WIDTH, _HALF_WIDTH + 1)
    inside = (found & ~own & (place >= _HALF_WIDTH) & (place < len(slot) - _HALF_WIDTH))
    inside[inside] &= (slot[place[inside] + _HALF_WIDTH] - slot[place[inside] - _HALF_WIDTH]
                       == 2 * _HALF_WIDTH)
    window = np.i0(_KAISER * np.sqrt(np.maximum(
        1 - ((offset[inside, None] - reach) / (_HALF_WIDTH + 0.5))**2, 0))) / np.i0(_KAISER)
    kernel = np.sinc(offset[inside, None] - reach) * window
    around = values[place[inside, None] + reach]
    result[inside] = np.einsum("ik,ikj->ij", kernel, around)
    return result


def octave_bands(low_hz, high_hz, most=6):
    """Up to `most` adjoining bands that divide a range, each an octave below the next."""
    edges = [high_hz]
    while len(edges) < most and edges[-1] / 2 > max(low_hz, 0) * 1.4:
        edges.append(edges[-1] / 2)
    edges.append(low_hz)
    return list(zip(edges[::-1][:-1], edges[::-1][1:]))


def _taper(n):
    """Raised cosines over a tenth at both ends, one between."""
    ramp = max(1, n // 10)
    rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(ramp) + 0.5) / ramp)
    return np.r_[rise, np.ones(n - 2 * ramp), rise[::-1]]
