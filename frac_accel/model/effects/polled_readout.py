"""A sensor that samples by a clock of its own and is read by another one."""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..parameters import parameter
from .base import STAMPS, Effect, Reading
from .residual_power import slope_of
from .steady_beat import STEADY, Start, SteadyBeat

# Scatter of the stamps, in sampling intervals, from which an age is none.
_SCATTERED = 0.01
# Segments [samples] in which the beat's frequency must hold, longer ones for slower beats, and how
# many there must be.
_LENGTHS, _SEGMENTS = (1024, 4096, 16384), 4
# Share of the error that a beat in longer segments must make, over that of one in shorter ones.
_CLEARER = 1.1
# Lines of such a segment that are near another one; and, of the shortest and of longer ones, next
# to none and to the Nyquist frequency, where a lag is a slow one.
_NEAR_LINES, _SLOW_LINES = 20, (8, 4)
# Power of the beat's line over the median of all, and of those up to twice where the slope has this
# share of its power: beyond, most are empty. What is in the motion makes lines of its own: shares
# that the slope or its square may have there of all its power, or else of that near it.
_STANDS_OUT, _ALL, _IN_MOTION, _LINE_OF_MOTION = 4.5, 0.999, 0.05, 0.4
# Standard deviations of a sawtooth's harmonics from none, their size over that of the sawtooth with
# the same first one, which is less behind a filter, and the power that the second one may have out
# of its phase, over that in it.
_SIGNIFICANT, _HARMONIC, _OUT_OF_PHASE = 4.5, (0.3, 1.5), 0.5
# Share of the error's power that it must make, and how many times what a gain with the same beat
# would; the share by which the interval may differ in two halves of equal power.
_SHARE, _BETTER, _ALIKE = 0.05, 3.0, 0.25
# Share of a beat whose phase wanders that adds up at one frequency, below which it must make a
# larger share of the error: two clocks hardly wander, and a phase that is followed follows chance.
_ADDS_UP, _WANDERING = 0.9, 0.15
# Times that the time is halved within which the beat is followed.
_HALVINGS = 5
# Phases that the beat is divided into, and the share of them around the jump that is left out.
_PHASES, _AROUND_JUMP = 32, 0.25
# Deviations of the interval within which a rate of the sensor's clock goes with the beat, share by
# which filters may take from the interval, squares of deviations by which another rate must be
# farther off, and the highest rate that is looked at.
_WITHIN, _BY_FILTERS, _LIKELIER, _FASTEST = 3.0, 0.1, 6.0, 1000


@dataclasses.dataclass(frozen=True)
class PolledReadout(Effect):
    """The sensor samples every `interval_s` by a clock of its own; the logger reads the last value.

    How old that is runs through the interval again and again, `beat_hz` times a second. A live
    correction does not know where in the beat it is; what the age is on average is a delay.
    """

    cause = "polled_readout"
    read_off = True
    known_by_sample = True
    goes_with_size = True
    common_to_axes = True
    stage = STAMPS
    explanation = ("The sensor samples by a clock of its own and the logger reads its last value: "
                   "how old that is runs through one of the sensor's intervals again and again.")
    experiment = ("Read the sensor when it says that a new value is ready (its interrupt or its "
                  "queue): the beat is gone.")

    interval_s: float = parameter("s", minimum=0, maximum=10, null=0.0)
    beat_hz: float = parameter("Hz", minimum=0, fixed=True)

    def mean_delay_s(self):
        return self.interval_s / 2

    @classmethod
    def recognised(cls, seen, shown):
        """The residual follows the slope by a lag that is a sawtooth of time."""
        own = seen.on_own_clock()
        # values between samples have no age; rounding of steady motion beats, too
        if own is None or seen.is_coarse or seen.found.jitter_rms_s * own[3] > _SCATTERED:
            return None
        measured, output, used, rate, place = own
        beat = Beat.of(measured, output, used)
        if beat is None:
            return None
        interval = 1 / beat.own_rate if beat.own_rate else beat.interval
        words = f"{beat.own_rate * rate:.5g} Hz" if beat.own_rate \
            else f"some {rate / interval:.2g} Hz"
        added = seen.at_instants(beat.added, place)
        error = seen.measured - seen.output
        return cls(interval / rate, beat.frequency * rate), Reading(
            {"interval_s": beat.std / rate, "beat_hz": beat.frequency_std * rate},
            error[seen.used], (error - added)[seen.used],
            f"a lag that runs through {1e3 * interval / rate:.3g} ms as a sawtooth, "
            f"{beat.frequency * rate:.4g} times a second, makes {beat.share:.0%} of the error: the "
            f"sensor samples at {words}; {beat.steadiness}; on average a value is "
            f"{1e3 * interval / rate / 2:.3g} ms old", added=added)


class Beat(NamedTuple):
    """A lag that is a sawtooth of time, in what a simulation leaves; in sampling intervals.

    Attributes
    ----------
    frequency, frequency_std : float
        Its mean, and the standard uncertainty by which it wanders.
    interval, std : float
        The sawtooth's height, and its standard uncertainty.
    own_rate : float or None
        Samples of the sensor's own clock in each of the record's, where one goes with the beat.
    share : float
        Of the error's power.
    added : ndarray, shape (n,)
        What it adds to the output.
    steadiness : str
        How its phase runs over the record, in words.
    """

    frequency: float
    frequency_std: float
    interval: float
    std: float
    own_rate: float | None
    share: float
    added: np.ndarray
    steadiness: str

    @classmethod
    def of(cls, measured, output, used):
        """The beat in what a simulation leaves, or None; arrays of shape (n,)."""
        slope = slope_of(output) * used
        sizes = dict.fromkeys(min(length, len(output) // _SEGMENTS) for length in _LENGTHS)
        best = None
        for size in sizes:
            found = cls._in_segments(measured, output, used, slope, size) \
                if size >= 8 * _SLOW_LINES[0] else None
            # in longer segments a phase that wanders looks steadier than it is
            if found and (best is None or found.share > best.share * (
                    1.0 if found.own_rate and not best.own_rate else _CLEARER)):
                best = found
        return best

    @classmethod
    def _in_segments(cls, measured, output, used, slope, size):
        """The same of a beat whose frequency holds in segments of so many samples."""
        error = measured - output
        level = (output - output[used].mean()) * used
        total = float(np.sum((error * used)**2))
        error = _without_slow(error * used, slope, level, size)
        shared, power = error * slope, slope**2
        line = _line(shared, slope, size)
        if line is None:
            return None
        frequency = line / size
        stands_out, rising, phase = max(
            ((*_stands_out(error, slope, phase), phase) for phase in
             _phases(shared, frequency, size)), key=lambda entry: entry[0])
        if stands_out < _SIGNIFICANT:
            return None
        height, height_std = _height_of_both_halves(shared, power, phase, rising)
        if height <= 0:
            return None
        added = _folded(shared, power, phase) * slope
        explained = _explained(error, added)
        if explained < _SHARE * total or explained < _BETTER * _explained(
                error, _folded(error * level, level**2, phase) * level):
            return None
        turned = np.unwrap(phase)[::size] / (2 * np.pi)
        beat = float((turned[-1] - turned[0]) / (size * (len(turned) - 1)))
        wanders = float(np.std(np.diff(turned) / size) / np.sqrt(len(turned) - 1))
        first = abs(np.sum(shared * np.exp(-1j * phase)))
        start = Start.of(shared, beat, wanders, rising, first)
        words = f"its phase wanders: at one frequency {min(start.adds_up, 1):.0%} of it adds up"
        # as well as the first harmonic's phase is known (D. C. Rife, R. R. Boorstyn, IEEE Trans.
        # Inf. Theory 20 (1974) 591-598)
        by_chance = float(np.sqrt(6 * np.sum(shared**2)) / (2 * np.pi * len(shared) * first))
        if wanders < by_chance:
            wanders, words = by_chance, STEADY
        steady = start.is_steady and SteadyBeat.of(measured, output, used, start,
                                                   height if rising else -height) or None
        taken = float(np.sum(error**2) - np.sum(_without_slow(
            (measured - output - steady.added) * used, slope, level, size)**2)) if steady else 0.0
        if steady and taken > explained and abs(abs(steady.height) - height) < _ALIKE * height:
            beat, wanders, words = steady.frequency, steady.frequency_std, steady.words
            added, explained = steady.added, taken
            # a phase that wanders a little makes it smaller
            height_std = float(np.hypot(steady.height_std, height - abs(steady.height)))
            height = abs(steady.height)
        elif start.adds_up < _ADDS_UP and explained < _WANDERING * total:
            return None
        else:
            steady = None
        rates = _own_rates(beat, height, height_std, rising)
        if not len(rates):
            return None
        own = float(rates[0]) if len(rates) == 1 else None
        if steady and own:
            height_std = wanders / own**2
        return cls(beat, wanders, height, height_std, own, explained / total, added, words)


def _line(shared, slope, size):
    """Line of a segment's spectrum where a lag beats that the motion does not have, or None."""
    powers = [np.mean(np.abs(np.fft.rfft(_segments(values, size)))**2, axis=0)
              for values in (shared, slope, slope**2)]
    slow = _SLOW_LINES[size > _LENGTHS[0]]
    inner = slice(slow, -slow)
    line = slow + int(np.argmax(powers[0][inner]))
    ends = int(np.searchsorted(np.cumsum(powers[1]), _ALL * powers[1].sum()))
    held = powers[0][slow:max(2 * ends, line) + 1]
    if powers[0][line] < _STANDS_OUT * max(np.median(powers[0][inner]), np.median(held)) \
            or any(_has_line(power, line) for power in powers[1:]):
        return None
    return line


def _has_line(power, line):
    there = power[line - 2:line + 3].sum()
    near = power[max(line - _NEAR_LINES, 0):line + _NEAR_LINES + 1].sum()
    return there > max(_IN_MOTION * power.sum(), _LINE_OF_MOTION * near)


def _without_slow(error, slope, level, size):
    """An error without the lag and the gain that it has over some time: no beat."""
    from scipy.signal import fftconvolve
    window = np.hanning(size // 2)

    def around(values):
        return fftconvolve(values, window, "same")
    both, bottom = around(slope * level), 1e-9 * np.mean(level**2) * window.sum() + 1e-300
    slopes, levels = (np.maximum(around(values**2), bottom) for values in (slope, level))
    shared, own = around(error * slope), around(error * level)
    determinant = np.maximum(slopes * levels - both**2, 1e-6 * slopes * levels)
    return error - ((levels * shared - both * own) * slope
                    + (slopes * own - both * shared) * level) / determinant


def _segments(values, size):
    count = 2 * (len(values) // size) - 1
    rows = size // 2 * np.arange(count)[:, None] + np.arange(size)
    return np.hanning(size) * values[rows]


def _phases(shared, frequency, size):
    """Phases [rad] that the beat may have, each of shape (n,), of a cosine: those of one frequency,
    and some that wander."""
    from scipy.signal import fftconvolve
    count = np.arange(len(shared))
    start = Start.of(shared, frequency, 1 / (4 * size), True, 1.0)
    yield 2 * np.pi * (start.frequency * count + start.turn - 0.25)
    even = 2 * np.pi * frequency * count
    turned = shared * np.exp(-1j * even)
    for halved in range(_HALVINGS):
        yield even + np.angle(fftconvolve(turned, np.hanning(size >> halved), "same"))


def _stands_out(error, slope, phase):
    """Standard deviations by which a lag's further harmonics are those of a sawtooth, below zero
    where they are others; and whether it rises.

    They are fitted beside the first one and the second out of phase; the errors are what all of
    these leave.
    """
    found = []
    # out of phase with the second harmonic of a sawtooth, whether that rises or falls
    lower = np.stack([np.sin(phase), np.cos(phase), np.cos(2 * phase)], axis=1)
    for rising in (True, False):
        turn = _turn(phase, rising)
        higher = turn - np.sin(2 * np.pi * turn) / np.pi
        columns = slope[:, None] * np.column_stack([lower, higher])
        inverse = np.linalg.pinv(columns.T @ columns, hermitian=True)
        sizes = inverse @ (columns.T @ error)
        scores = columns * (error - columns @ sizes)[:, None]
        std = np.sqrt(np.diag(inverse @ (scores.T @ scores) @ inverse))[3]
        first, own = np.pi * np.hypot(*sizes[:2]), sizes[3] if rising else -sizes[3]
        is_like = _HARMONIC[0] < own / max(first, 1e-300) < _HARMONIC[1] \
            and (2 * np.pi * sizes[2])**2 < _OUT_OF_PHASE * own**2
        found.append((own / max(std, 1e-300) if is_like else -1.0, rising))
    return max(found)


def _turn(phase, rising):
    """Turns from the middle of a sawtooth's slope, whose first harmonic is a cosine of a phase."""
    # a rising one is zero a quarter before its crest
    return (phase / (2 * np.pi) + (0.25 if rising else -0.25) + 0.5) % 1 - 0.5


def _places(phase):
    return np.floor(phase / (2 * np.pi) * _PHASES).astype(int) % _PHASES


def _folded(shared, power, phase):
    """Factor by phase, of each sample, shape (n,), that takes most of the error."""
    place = _places(phase)
    sums = [np.bincount(place, values, _PHASES) for values in (shared, power)]
    return (sums[0] / np.maximum(sums[1], 1e-300))[place]


def _height_of_both_halves(shared, power, phase, rising):
    """As `_height`; 0 where two halves of equal power have another one."""
    middle = int(np.searchsorted(np.cumsum(power), power.sum() / 2))
    (one, one_std), (two, two_std) = (_height(shared[half], power[half], phase[half], rising)
                                      for half in (slice(middle), slice(middle, None)))
    height, std = _height(shared, power, phase, rising)
    alike = max(_ALIKE * height, _WITHIN * np.hypot(one_std, two_std))
    return height if abs(two - one) < alike else 0.0, std


def _height(shared, power, phase, rising):
    """Height of the sawtooth, and its standard uncertainty, by its slope away from its jump."""
    turn = _turn(phase, rising)
    kept = abs(turn) < 0.5 - _AROUND_JUMP / 2
    weight = np.where(kept, power, 0.0)
    total = max(weight.sum(), 1e-300)
    centre = weight @ turn / total
    spread = max(weight @ (turn - centre)**2, 1e-300)
    height = np.sum((shared * (turn - centre))[kept]) / spread
    std = np.sqrt(np.sum((shared * (turn - centre))[kept]**2)) / spread
    return float(height if rising else -height), float(std)


def _explained(error, added):
    return float(np.sum(2 * error * added - added**2))


def _own_rates(beat, interval, std, rising):
    """Rates of the sensor's clock, in samples of the record, that go with a beat: whole ones and
    the beat. Where one of them is far more likely, that."""
    rates = np.arange(1, _FASTEST) + (-beat if rising else beat)
    # what is behind a filter, or jumps gradually, is less high
    longer = np.maximum(1 / rates - interval - _BY_FILTERS / rates, 0.0)
    off = np.where(1 / rates > interval, longer, interval - 1 / rates) / std
    rates, off = rates[off < _WITHIN], off[off < _WITHIN]
    first = np.argsort(off)[:2]
    if len(first) == 2 and np.diff(off[first]**2)[0] > _LIKELIER:
        return rates[first[:1]]
    return rates
