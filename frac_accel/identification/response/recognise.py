"""What kind of excitation a record was made with, as far as the reference shows it."""

import dataclasses

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import irfft, next_fast_len, rfft

# Blocks of the record in which the phase of a sine is followed, and the fewest that make a tone.
_BLOCKS = 1024
_FEWEST_BLOCKS = 4
_FEWEST_CYCLES = 4.0
# How far [rad] the phase of one sine may stray from a straight line.
_STRAIGHT = 0.4
# Share of the record's energy that must lie in sines for the record to be one of sines.
_TONAL = 0.7
# Frequency step times duration: below one, neighbours are the same line to the data (a sweep).
_STEP = 1.2
# Correlation between periods (a reference 6 dB above its own noise), and the drift [samples] over
# the record above which a period is no whole number of samples.
_PERIODIC = 0.8
_DRIFT = 0.1
_SHORTEST_PERIOD = 16
# Blocks of a record in which a fast sweep's phase is a parabola, the fewest samples of one, and
# amplitude of a block, of the largest, from which on it has a frequency; correlation with time from
# which on that goes evenly, in Hz or in octaves.
_CHIRPS, _OF_CHIRP, _LOUD, _EVEN = 128, 16, 0.1, 0.99
# Bandwidth times duration of one event, and the share of the record that it lasts.
_ONE_EVENT = 5.0
_SHORT = 0.2


@dataclasses.dataclass(frozen=True)
class Tone:
    """A stretch of one sine: samples ``start`` to ``stop`` (exclusive) at ``frequency_hz``."""

    start: int
    stop: int
    frequency_hz: float


@dataclasses.dataclass(frozen=True)
class Recognised:
    """Kind of excitation.

    Attributes
    ----------
    kind : str
        ``noise``, ``multisine``, ``stepped_sine``, ``sweep``, ``shock`` or ``sine``.
    words : str
        The same for a user, with its main figures.
    period_samples : int
        Period of a multisine; 0 for the others.
    tones : tuple of Tone
        Dwells of a stepped sine, or of the one sine.
    band_hz : tuple of float
        Lowest and highest frequency of sweeps and dwells; empty for the others.
    """

    kind: str
    words: str
    period_samples: int = 0
    tones: tuple = ()
    band_hz: tuple = ()


def recognise(reference, sampling_rate_hz):
    """Kind of excitation of a record.

    Parameters
    ----------
    reference : ndarray, shape (n,)
        Acceleration of the base.
    sampling_rate_hz : float

    Returns
    -------
    Recognised
        ``noise`` for whatever shows no other structure.
    """
    moving = reference - np.mean(reference)
    if _one_short_event(moving):
        return Recognised("shock", f"shock at {_peak(moving) / sampling_rate_hz:.4g} s")
    tones, energy = _tones(moving, sampling_rate_hz)
    tonal = bool(tones) and energy >= _TONAL * np.sum(moving**2)
    if tonal and _stepped(tones, sampling_rate_hz):
        tones = _joined(tones, sampling_rate_hz)
        frequencies = [tone.frequency_hz for tone in tones]
        if len(set(np.round(np.log(frequencies), 3))) == 1:
            return Recognised("sine", f"sine at {frequencies[0]:.4g} Hz", tones=tuple(tones),
                              band_hz=(frequencies[0], frequencies[0]))
        return Recognised("stepped_sine", f"stepped sine, {len(tones)} dwells from "
                          f"{min(frequencies):.4g} to {max(frequencies):.4g} Hz",
                          tones=tuple(tones), band_hz=(min(frequencies), max(frequencies)))
    period = _period(moving)
    if period:
        return Recognised("multisine", f"multisine of {len(moving) / period:.3g} periods of "
                          f"{period / sampling_rate_hz:.4g} s", period)
    passed = _passed(moving, sampling_rate_hz)
    if passed is not None or tonal and _swept(tones):
        words, first, last = passed or ("swept sine", *_band(moving, sampling_rate_hz))
        if passed is None and tones[0].frequency_hz > tones[-1].frequency_hz:
            first, last = last, first
        return Recognised("sweep", f"{words} from {first:.3g} to {last:.3g} Hz",
                          band_hz=(float(min(first, last)), float(max(first, last))))
    return Recognised("noise", "random noise or other broadband motion")


def _peak(moving):
    return int(np.argmax(np.abs(moving)))


def _one_short_event(moving):
    """Whether the energy lies in one event, as short as its bandwidth allows."""
    power = moving**2
    duration = power.sum()**2 / np.sum(power**2)
    if duration > _SHORT * len(moving):
        return False
    spectrum = np.abs(rfft(moving))**2
    bandwidth = spectrum.sum()**2 / np.sum(spectrum**2) / len(moving)
    return duration * bandwidth < _ONE_EVENT


def _analytic(values, length):
    """Values with their Hilbert transform as imaginary part."""
    analytic = np.empty(len(values), complex)
    # as real transforms: what one of complex numbers prepares stays in memory
    analytic.real, analytic.imag = values, irfft(-1j * rfft(values, length), length)[:len(values)]
    return analytic


def _tones(moving, rate):
    """Stretches in which the phase is a straight line, and the energy in them.

    None where they hold too little of it to matter.
    """
    n = len(moving)
    analytic = _analytic(moving, next_fast_len(n))
    size = max(4, n // _BLOCKS)
    count = n // size
    phase = np.unwrap(np.angle(analytic))[:count * size].reshape(count, size).mean(axis=1)
    # most of noise is no longer straight than this: all of it at once
    short = {length: _straight(sliding_window_view(phase, length))
             for length in range(_FEWEST_BLOCKS, 2 * _FEWEST_BLOCKS + 1) if length <= count}
    stretches, first = [], 0
    for begin in np.flatnonzero(short[_FEWEST_BLOCKS]).tolist() if short else ():
        if begin >= first:
            first = _straight_until(phase, begin, short)
            stretches.append((begin, first))
    before = np.r_[0.0, np.cumsum(moving**2)]
    if sum(before[last * size] - before[begin * size] for begin, last in stretches) \
            < _TONAL * before[-1]:
        return [], 0.0
    tones, energy = [], 0.0
    for begin, last in stretches:
        place = np.arange(last - begin) - (last - begin - 1) / 2
        slope = place @ phase[begin:last] / (place @ place)
        frequency = abs(slope) * rate / (2 * np.pi * size)
        tone = Tone(begin * size, last * size, float(frequency))
        if _is_sine(analytic[tone.start:tone.stop], tone, rate, size):
            tones.append(tone)
            energy += float(np.sum(moving[tone.start:tone.stop]**2))
    return _without_transitions(tones, moving), energy


def _without_transitions(tones, moving):
    """Tones without those between two dwells: at once shorter and weaker than their neighbours."""
    length = np.array([tone.stop - tone.start for tone in tones])
    level = np.array([np.std(moving[tone.start:tone.stop]) for tone in tones])

    def lesser(values, place):
        neighbours = [values[other] for other in (place - 1, place + 1) if 0 <= other < len(values)]
        return bool(neighbours) and values[place] < 0.5 * min(neighbours)
    return [tone for place, tone in enumerate(tones)
            if not (lesser(length, place) and lesser(level, place))]


def _straight(phases):
    """Whether phases, shape (..., blocks), lie on straight lines."""
    # phases of many turns would lose digits
    phases = phases - phases[..., :1]
    place = np.arange(phases.shape[-1]) - (phases.shape[-1] - 1) / 2
    line = np.outer(place, place / (place @ place)) + 1 / len(place)
    return np.max(np.abs(phases - phases @ line), axis=-1) < _STRAIGHT


def _straight_until(phase, first, short):
    """End of the longest straight stretch from one block on, at which there is one.

    `short` tells for short lengths at which blocks stretches begin.
    """
    def straight(length):
        return short[length][first] if length in short else _straight(phase[first:first + length])

    most = len(phase) - first
    good, bad = _FEWEST_BLOCKS, 2 * _FEWEST_BLOCKS
    while bad <= most and straight(bad):
        good, bad = bad, 2 * bad
    bad = min(bad, most + 1)
    while bad - good > 1:
        middle = (good + bad) // 2
        good, bad = (middle, bad) if straight(middle) else (good, middle)
    return first + good


def _is_sine(analytic, tone, rate, size):
    """Whether a stretch holds a few cycles, and little besides the one slowly varying sine."""
    if tone.frequency_hz * len(analytic) < _FEWEST_CYCLES * rate:
        return False
    still = analytic * np.exp(-2j * np.pi * tone.frequency_hz / rate * np.arange(len(analytic)))
    mean = still.reshape(-1, size).mean(axis=1)
    return size * np.sum(np.abs(mean)**2) > 0.9 * np.sum(np.abs(still)**2)


def _stepped(tones, rate):
    """Whether the frequency jumps between stretches, or stays where it is."""
    steps = [abs(b.frequency_hz - a.frequency_hz) / rate
             * min(a.stop - a.start, b.stop - b.start) for a, b in zip(tones, tones[1:])]
    same = [abs(b.frequency_hz / a.frequency_hz - 1) < 1e-3 for a, b in zip(tones, tones[1:])]
    return not steps or np.mean((np.array(steps) > _STEP) | np.array(same)) > 0.7


def _joined(tones, rate):
    """Tones with those put together that are one dwell, which its ramp had broken."""
    joined = tones[:1]
    for tone in tones[1:]:
        last = joined[-1]
        cycles = abs(tone.frequency_hz - last.frequency_hz) / rate * min(
            tone.stop - tone.start, last.stop - last.start)
        if tone.start == last.stop and cycles < _STEP:
            longer = max(last, tone, key=lambda part: part.stop - part.start)
            joined[-1] = Tone(last.start, tone.stop, longer.frequency_hz)
        else:
            joined.append(tone)
    return joined


def _swept(tones):
    """Whether the frequency goes one way nearly all the time."""
    directions = np.sign(np.diff([tone.frequency_hz for tone in tones]))
    return len(directions) > 1 and abs(np.sum(directions)) >= 0.8 * len(directions)


def _passed(moving, rate):
    """What kind of sweep it is, and its first and last frequency [Hz]; None without one.

    A fast sweep has no stretch of straight phase, but its phase is a parabola in each block.
    """
    n = len(moving)
    size = max(_OF_CHIRP, n // _CHIRPS)
    count = n // size
    if count < _CHIRPS // 4:
        return None
    analytic = _analytic(moving, next_fast_len(n))[:count * size]
    phase = np.unwrap(np.angle(analytic)).reshape(count, size)
    energy = np.sum(np.abs(analytic.reshape(count, size))**2, axis=1)
    place = np.arange(size) - (size - 1) / 2
    rows = np.linalg.qr(np.stack([np.ones(size), place, place**2], axis=1))[0]
    left = phase - (phase @ rows) @ rows.T
    # the whole of each block, so that noise counts for less
    frequency = phase @ place / (place @ place) * rate / (2 * np.pi)
    loud = energy > _LOUD**2 * energy.max()
    good = loud & (np.sqrt(np.mean(left**2, axis=1)) < _STRAIGHT) & (frequency > 0)
    # at both ends the analytic signal is not what its name says
    good[:2] = good[-2:] = False
    block, frequency = np.flatnonzero(good), frequency[good]
    if energy[good].sum() < _TONAL * energy.sum() or len(block) < _CHIRPS // 4:
        return None
    steps = np.sign(np.diff(frequency))
    if abs(steps.sum()) < 0.8 * len(steps) or np.ptp(frequency) * n / rate < len(block):
        return None
    ends = np.flatnonzero(loud)[[0, -1]] + [-0.5, 0.5]
    evenly = [abs(np.corrcoef(block, values)[0, 1]) for values in (frequency, np.log(frequency))]
    if max(evenly) < _EVEN:
        return "swept sine", frequency[0], frequency[-1]
    if evenly[0] >= evenly[1]:
        return "swept sine", *np.maximum(np.polyval(np.polyfit(block, frequency, 1), ends), 0)
    return "logarithmically swept sine", *np.exp(np.polyval(np.polyfit(
        block, np.log(frequency), 1), ends))


def _band(moving, rate):
    """Frequencies below which half a percent, and all but half a percent, of the energy lies."""
    energy = np.cumsum(np.abs(rfft(moving))**2)
    return np.searchsorted(energy, [0.005 * energy[-1], 0.995 * energy[-1]]) * rate / len(moving)


def _period(moving):
    """Period in samples, 0 where there is none of a whole number of samples."""
    n = len(moving)
    length = next_fast_len(2 * n, real=True)
    product = irfft(np.abs(rfft(moving, length))**2, length)[:n]
    power = np.r_[0, np.cumsum(moving**2)]
    lags = np.arange(n)
    # each lag by the energy of the two stretches that it compares
    energy = np.sqrt(np.maximum(power[n - lags] * (power[n] - power[lags]), 1e-300))
    alike = product / energy
    negative = np.flatnonzero(alike[:n // 2 + 1] < 0.5)
    if not len(negative):
        return 0
    first = max(negative[0], _SHORTEST_PERIOD)
    found = alike[first:n // 2 + 1]
    if not len(found) or found.max() < _PERIODIC:
        return 0
    # the shortest lag that is as good as the best: its multiples are as good
    spread = max(2e-3, 4 * (1 - found.max()) / np.sqrt(n))
    lag = first + int(np.flatnonzero(found > found.max() - spread)[0])
    reach = slice(lag, min(lag + max(lag // 8, 2), n // 2 + 1))
    lag += int(np.argmax(alike[reach]))
    return _whole(alike, lag, n)


def _whole(alike, lag, n):
    """The period nearest to a lag if it is a whole number of samples to the record's end."""
    for multiple in range(1, n // lag):
        # the last tenth of lags compares too little
        near = round(multiple * lag)
        if near > 0.9 * n and multiple > 1:
            break
        low = max(near - 2, 1)
        around = alike[low:min(near + 3, n)]
        top = low + int(np.argmax(around))
        if alike[top] < _PERIODIC or not 0 < top < n - 1:
            return 0
        left, middle, right = alike[top - 1:top + 2]
        bend = left - 2 * middle + right
        exact = top + (0.5 * (left - right) / bend if bend < 0 else 0.0)
        if abs(exact - multiple * lag) > max(_DRIFT, 0.02 * multiple):
            return 0
    return int(lag)
