"""How large the recorded reference's own noise is, where the record shows it, and what it leaves.

Least squares on a noisy input is biased: of each frequency's motion, noise adds to the input what
the output does not have. The best linear estimate of the motion, the reference behind

.. math:: W(f) = 1 - N / S_{rr}(f)

with the density N of white noise, has an error that is not correlated with it, so that a fit to it
has no bias (regression calibration: R. J. Carroll et al., *Measurement Error in Nonlinear Models*,
2nd ed. (2006), chapter 4; N. Wiener's filter).
"""

import dataclasses

import numpy as np
from scipy.signal import csd, welch

from ..identification.response.recognise import recognise
from .noise import _given, _periods, _untrusted

_SEGMENTS = 32
_LONGEST = 1024
# Power of the noise, of the reference's, below which it bends no fit alone and has no name, and
# above which nothing is said.
_LEAST, _MOST = 1e-4, 0.1
# Share of the noise of a louder sensor (power) that a guess of the motion takes where it has none,
# from which any filter bends to do the same, however little of the reference's power that is.
_TAKEN = 0.01
# Quantile of the density that white noise cannot exceed, and by how much an estimate may.
_FLOOR, _SCATTERS = 0.05, 1.3
# A floor: coherence with the sensor below which nothing is shared, share of the frequencies that
# must have none, ratio of the densities there, and times what motion of that density would show in
# the sensor (power) that it may have: such motion would make the coherence at least 1/3. Where it
# has more, the share of the coherence that such motion would make up to which it makes none.
_SHARED, _WIDE, _EVEN, _LOUDEST, _ABSENT = 0.2, 0.15, 2.0, 2.0, 0.1
# An excess: lines of the spectrum, and coherence from which one counts; standard deviations by
# which it must stand out, squares of such deviations that it may leave a line, those that any
# filter must leave more, and rounds in which the deviations become known.
_LINES_SHARED, _COHERENT = 12, 0.3
_STANDS_OUT, _SCATTER, _NO_FILTER, _PASSES = 12.0, 1.2, 30.0, 4
# Share of a line that noise must have for the coherence to tell whether it is noise: that would be
# one less the share, and may be higher by as much as counts as nothing shared.
_NOISY = 0.2
# Share of the floor that the median of the segments must have.
_STEADY = 0.5
# Relative uncertainty at least: no noise is white to better than that.
_AS_WHITE = 0.02
# Rest: share of the stretches that may be at rest at least, how much louder than the quietest.
_STRETCH_S, _STRETCH, _STRETCHES, _LOUDER, _FEWEST = 0.5, 200, 20, 1.5, 3
# Of its signal, the sensor's scatter at rest.
_RESTS = 0.05


@dataclasses.dataclass(frozen=True)
class ReferenceNoise:
    """White noise of the reference.

    Attributes
    ----------
    std : float
        Standard deviation [m/s²].
    uncertainty : float
        Its standard uncertainty [m/s²].
    by : {"periods", "rest", "covariance", "floor", "excess"}
    bends : bool
        Whether it is enough to bend a fit; else it counts as noise only.
    is_much : bool
        Whether it is enough of the reference to be more than every instrument has.
    frequency_hz, share : tuple of float
        W at some frequencies.
    band_hz : float
        Frequency [Hz] up to which the two are compared.
    """

    std: float
    uncertainty: float
    by: str
    bends: bool
    is_much: bool
    frequency_hz: tuple
    share: tuple
    band_hz: float = np.inf

    @property
    def words(self):
        """Sentence without a full stop."""
        how = {"periods": "by what differs between its repeated periods",
               "rest": "where both stand still", "covariance": "as its messages state",
               "floor": "by what it has, evenly, at frequencies where the sensor has none of it",
               "excess": "by what it has, evenly, beyond the motion that the sensor shows"}
        return (f"the reference's own noise is {self.std:.3g} m/s^2 RMS, {how[self.by]}: it counts "
                "behind a filter that leaves as little of it as possible")

    def density(self, frequency_hz):
        """Its density [(m/s²)²/Hz], as far as it is compared, at some frequencies."""
        return self.std**2 / self.frequency_hz[-1] * (frequency_hz <= self.band_hz)


def reference_noise(record, column, used, covariance_std=None, transfer_function=None):
    """`ReferenceNoise` of an axis of a record, or None where it shows none that matters.

    Parameters
    ----------
    record : Record
    column : int
    used : ndarray of bool, shape (n,)
        Samples that count.
    covariance_std : float, optional
        What the reference's messages state [m/s²].
    transfer_function : callable, optional
        Of the model in use, from complex frequencies [rad/s]; a constant without it.
    """
    rate, moved = record.sampling_rate_hz, "reference" in record.resampled
    own_rate = record.topics[0].clock.rate_hz if moved else rate
    # from uneven instants noise is not white any more
    if used.sum() < 2 * _SEGMENTS or (moved and record.topics[0].clock.kind == "uneven"):
        return None
    one = record.reference[:, column]
    size = min(_LONGEST, len(one) // (_SEGMENTS // 2))
    frequency, own = welch(one, rate, nperseg=size)
    inner = _inner(frequency, record)
    power = float(np.var(one))
    most = np.quantile(own[inner], _FLOOR)
    for density, by, matters, taken in _estimates(record, column, used, covariance_std, own_rate,
                                                  most, size, (frequency, own), transfer_function):
        std = np.sqrt(density * own_rate / 2)
        part = density * rate / 2 / power
        bends = part > _LEAST or taken > _TAKEN
        if density <= _SCATTERS**2 * most and part < _MOST and (bends or matters):
            share = np.clip(1 - density / own, 0.0, 1.0)
            # a constant is no noise, and the first line holds what the window leaves of it
            share[:2] = 1.0, share[2]
            # nothing is compared beyond the band
            share[inner.stop:] = 0.0
            # of an excess that just stands out: as little is known of it
            count = {"covariance": np.inf, "floor": _WIDE * len(one),
                     "excess": _STANDS_OUT**2 / 2}.get(by, len(one) / 4)
            known = max(1 / np.sqrt(2 * count), _AS_WHITE)
            # as far as its own Nyquist frequency
            ends = (frequency[-1], own_rate / 2) if own_rate > rate else (own_rate / 2,)
            return ReferenceNoise(
                float(std), float(known * std), by, bool(bends), bool(part > _LEAST),
                (*frequency[frequency < ends[0]].tolist(), *ends),
                (*share[frequency < ends[0]].tolist(), *[float(share[-1])] * len(ends)),
                record.band_hz or np.inf)
    return None


def _inner(frequency, record):
    """Slice without the ends (what the window makes of the mean, half a line), within the band."""
    return slice(2, min(np.searchsorted(frequency, record.band_hz or np.inf), len(frequency) - 1))


def _estimates(record, column, used, covariance_std, own_rate, most, size, spectrum,
               transfer_function):
    """Densities [(m/s²)²/Hz], what shows them, whether they matter though they bend no fit, and the
    share of the sensor's noise that a guess of the motion takes as far as that is known, the best
    first.

    `own_rate` [Hz] is that at which the reference was sampled, `most` its lowest density,
    `spectrum` its frequencies and densities.
    """
    rate, one, two = record.sampling_rate_hz, record.reference[:, column], record.sensor[:, column]
    if "reference" not in record.resampled:
        # else a part of the noise is gone
        for std, by in ((_periods(one, used, recognise(one, rate).period_samples), "periods"),
                        (_at_rest(one, two, used, rate), "rest")):
            if std is not None:
                yield 2 * std**2 / rate, by, True, 0.0
    if _given(covariance_std) and not _untrusted(covariance_std, None,
                                                 _SCATTERS * np.sqrt(most * own_rate / 2)):
        yield 2 * covariance_std**2 / own_rate, "covariance", True, 0.0
    other = welch(two, rate, nperseg=size)[1]
    shared = np.abs(csd(one, two, rate, nperseg=size)[1])
    inner = _inner(spectrum[0], record)
    spectra = [values[inner] for values in (*spectrum, other, shared)]
    median = welch(one, rate, nperseg=size, average="median")[1][inner]
    segments = len(one) / size
    floor, is_heard, taken = _floor(*spectra[1:], median, segments)
    # an excess that bends nothing may be some other small thing
    for density, by, matters, share in (
            (floor, "floor", is_heard, taken),
            (_excess(*spectra, segments, transfer_function), "excess", False, 0.0)):
        if density is not None and not _is_shared(density, *spectra[1:]):
            yield density, by, matters, share


def _is_shared(density, own, other, shared):
    """Whether both share more than an even density of the reference's noise would leave: motion,
    which a low-pass takes from the sensor."""
    noisy = density > _NOISY * own
    coherence = shared**2 / np.maximum(own * other, 1e-300)
    return bool(noisy.any() and np.mean((coherence - 1 + density / own)[noisy]) > _SHARED)


def _at_rest(one, two, used, rate):
    """Scatter of the reference where neither it nor the sensor moves, and they share nothing."""
    length = max(_STRETCH, min(int(np.ceil(_STRETCH_S * rate)), len(one) // _STRETCHES))
    count = len(one) // length
    if count < 2 * _FEWEST:
        return None
    parts = [values[:count * length].reshape(count, length) for values in (one, two)]
    parts = [part - part.mean(axis=1, keepdims=True) for part in parts]
    whole = used[:count * length].reshape(count, length).all(axis=1)
    scatter = [np.where(whole, part.std(axis=1), np.inf) for part in parts]
    quiet = np.all([s < _LOUDER * s.min() for s in scatter], axis=0)
    if quiet.sum() < _FEWEST or not scatter[1].min() < _RESTS * two.std():
        return None
    shared = np.sum(parts[0][quiet] * parts[1][quiet])**2 / (
        np.sum(parts[0][quiet]**2) * np.sum(parts[1][quiet]**2))
    return float(np.sqrt(np.mean(parts[0][quiet]**2))) if shared < _SHARED**2 else None


def _floor(own, other, shared, median, segments):
    """An even density of the reference at frequencies where the sensor has none of it, or None;
    whether the sensor is quiet enough there to show motion of that density; and where it is not,
    the share of its noise that nothing in the density's place would take.

    Parameters
    ----------
    own, other, shared, median : ndarray, shape (n,)
        Densities of the reference, the sensor and both (absolute), and the median of the
        reference's over the segments.
    segments : float
        Of the record, side by side.
    """
    # one that most segments do not have is that of a few spikes
    if np.quantile(median, _FLOOR) < _STEADY * np.quantile(own, _FLOOR):
        return None, False, 0.0
    coherence = shared**2 / np.maximum(own * other, 1e-300)
    apart, together = coherence < _SHARED, coherence > 0.9
    if apart.mean() < _WIDE or not together.any():
        return None, False, 0.0
    low, high = np.quantile(own[apart], (0.1, 0.9))
    density = np.median(own[apart])
    gain = np.median(shared[together] / own[together])
    # the coherence that motion of that density would make, and what chance makes of none at least
    expected, chance = gain**2 * density / np.median(other[apart]), 1 / (2 * segments)
    is_heard = bool(expected * _LOUDEST >= 1)
    if high > _EVEN * low \
            or not is_heard and coherence[apart].mean() - chance > _ABSENT * expected:
        return None, False, 0.0
    return float(density), is_heard, 0.0 if is_heard else float(expected * apart.mean())


def _excess(frequency, own, other, shared, segments, transfer_function):
    r"""An even density of the reference beyond the motion that the sensor shows, or None.

    With the motion's density :math:`S_{aa}`, noise of density N on the reference, and the model's
    response H up to a gain g, :math:`S_{rr} = S_{aa} + N` and :math:`|S_{rs}| = g |H| S_{aa}`: a
    straight line with the intercept N. A filter that the model lacks bends it in proportion to the
    motion, smoothly over the frequency: where the motion's spectrum is smooth, too, nothing tells
    one from the other, and there is no answer (J. S. Bendat, A. G. Piersol, *Random Data*, 4th ed.
    (2010), chapter 6).

    Parameters
    ----------
    frequency, own, other, shared : ndarray, shape (n,)
        Frequencies [Hz], densities of the reference, the sensor and both (absolute).
    segments : float
        Of the record, side by side.
    transfer_function : callable or None
        As of `reference_noise`.
    """
    # those that overlap by half are worth one and a half times as many, and the real part of what
    # two signals share scatters by half as much (power)
    count = 3 * segments
    rows = shared**2 > _COHERENT * own * other
    if rows.sum() < _LINES_SHARED:
        return None
    frequency, own, other, shared = frequency[rows], own[rows], other[rows], shared[rows]
    response = np.ones(len(frequency)) if transfer_function is None \
        else np.abs(transfer_function(2j * np.pi * frequency))
    # chance makes a coherence, too
    motion = np.sqrt(np.maximum(shared**2 - 2 * own * other / count, 0.0)) / response
    slope = np.median(own / np.maximum(motion, 1e-300))

    def line(*columns):
        """Coefficients, squares that are left, and standard deviations."""
        weight = np.sqrt(count / (own * apart))
        matrix = np.stack(columns, axis=1) * weight[:, None]
        found = np.linalg.lstsq(matrix, own * weight, rcond=None)[0]
        left = np.sum((own * weight - matrix @ found)**2)
        return found, left, np.sqrt(np.diag(np.linalg.pinv(matrix.T @ matrix)))
    for _ in range(_PASSES):
        # density of what both have by themselves
        apart = np.maximum(own + slope**2 * other / response**2 - 2 * slope * motion, 1e-6 * own)
        (slope, density), left, (_, std) = line(motion, np.ones(len(motion)))
    bends = [motion * (frequency / frequency[-1])**power for power in (-2.0, 1.0, 2.0, 4.0)]
    filters = [line(motion, *bends[:k], *bends[k + 1:])[1] for k in range(4)]
    return float(density) if density > _STANDS_OUT * std and left < _SCATTER * len(motion) \
        and left + _NO_FILTER < min(filters) else None
