"""A record beside the best simulation of it, and what it shows by itself."""

import dataclasses
import functools

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import periodogram

from ..model.effects import Effect, known_effects
from ..record.resampling import band_limited, filled, inner_filter, inner_taps, taken_away
from ..signals.convolution import refined
from .gain import gain
from .leftover import rounding_errors

# Samples of a stretch, and share of a record for which it must move, so that the size of what is
# left can be compared with the motion's: not in a shock.
_STRETCH = 64
_LASTS = 0.1
# Times the rate at which the output is known before it is read between instants by a cubic spline.
_FINE = 4
# Steps of the lattice from which on a signal moves between two samples that are not neighbours.
_MOVES_ON = 3.0
# Standard deviations of the stamps' scatter beyond which a stamp is none of it.
_OF_SCATTER = 6.0


@dataclasses.dataclass(frozen=True)
class Seen:
    """A record beside the best simulation of it, for causes that it shows by itself.

    Attributes
    ----------
    record : Record
    found : Integrity
    axis : int
        Column of the record's axis.
    measured, output : ndarray, shape (n,)
    rows, used : ndarray of bool, shape (n,)
        Samples that are there, and those of them that the fit counted.
    spikes : ndarray of bool, shape (n,)
        Samples that it did not count since they stand far out.
    is_coarse : bool
        Whether the values' lattice accounts for much of what is left.
    parts : callable
        Gives the error budget of what is left: shares by part, where they are above zero for
        certain.
    unguessed : callable
        Gives the output, shape (n,), of the reference as it was recorded, where the fit has it
        behind a filter that guesses the motion from a noisy one; else None.
    """

    record: object
    found: object
    axis: int
    measured: np.ndarray
    output: np.ndarray
    rows: np.ndarray
    used: np.ndarray
    spikes: np.ndarray
    is_coarse: bool
    parts: object
    unguessed: object

    @property
    def is_uneven(self):
        """Whether samples of a topic lie on no uniform instants: what is between them is a guess.
        """
        return any(topic.clock.kind == "uneven" for topic in self.record.topics or ())

    @functools.cached_property
    def repeated(self):
        """Share of the sensor's samples that say what the one before says, of those between whose
        neighbours the signal moves on, by more than its lattice; without those that its lattice
        makes the same, about as many as it lets be a step higher, or lower."""
        topic = self.record.topics[1] if self.record.topics else None
        values = topic.values[:, self.axis] if topic else self.measured
        step = (topic.step(self.axis) if topic else self.found.step) or 0.0
        across = np.abs(values[2:] - values[:-2])
        moves = across > max(_MOVES_ON * step, float(np.median(across)))
        if not moves.any():
            return 0.0
        change = np.abs(values[1:-1] - values[:-2])[moves]
        beside = np.mean((change > step / 2) & (change < 1.5 * step)) / 2
        return max(float(np.mean(change == 0) - beside), 0.0)

    @functools.cached_property
    def of_one_error(self):
        """What comparing the two makes of an error of 1 in one of the sensor's samples, around it,
        shape (2 k + 1,), at the record's instants; None where the sensor has none of its own.

        Of a sensor with more samples than there are instants, each has less to say.
        """
        record = self.record
        if record.band_hz is None:
            return None if "sensor" in record.resampled else np.ones(1)
        taps = inner_taps(record.sampling_rate_hz, record.band_hz, len(self.output))
        if "sensor" not in record.resampled:
            return taps
        clock = record.topics[1].clock
        return None if clock.kind == "uneven" else taps / np.sqrt(
            max(clock.rate_hz / record.sampling_rate_hz, 1.0))

    def slope_beyond(self, noise):
        """Power of the sensor's slope [output units an instant] that the filter to the band which
        is compared takes away.

        `noise` is the power that errors have within the band, and as densely beyond it.
        """
        record, topic = self.record, self.record.topics[1]
        if record.band_hz is None:
            return 0.0
        values = filled(topic.clock.slot, topic.values)[0][:, self.axis]
        rate = record.sampling_rate_hz
        turns, density = periodogram(values, topic.clock.rate_hz / rate, window="hann")
        moving = np.maximum(density - noise / (record.band_hz / rate), 0.0)
        away = taken_away(rate, record.band_hz, len(self.output), rate * turns)
        return float(np.sum((2 * np.pi * turns)**2 * moving * away) * turns[1])

    def rounding(self):
        """Errors, shape (n,), that a coarse lattice leaves of noisy simulated values."""
        return next(rounding_errors((self.measured - self.output) * self.used, self.output,
                                    self.used, self.found.step))

    def at_stamps(self, even=True):
        """Values as they were recorded, where the fit counted samples, the simulated output at
        their instants, and at the stamps that they carry, each of shape (m,); without a jump of
        these if they are to be `even`."""
        topic = self.record.topics[1]
        seconds = (topic.stamps_ns - topic.stamps_ns[0]) * 1e-9
        stamped = self.record.place(seconds)
        if "sensor" in self.record.resampled:
            return self._beside(stamped)
        slot = (topic.clock.slot + np.round(np.median(
            stamped + self.record.lag_s * self.record.sampling_rate_hz - topic.clock.slot)))
        # about the instants of their own clock: what runs away from the reference's is no scatter,
        # nor are few stamps that are far off
        stamps = topic.clock.even_s(topic.stamps_ns)
        off = self.record.sampling_rate_hz * (stamps - topic.clock.instants_s(topic.stamps_ns))
        off = off - np.median(off)
        good = (slot >= 0) & (slot < len(self.output)) & (
            np.abs(off) <= _OF_SCATTER * topic.clock.scatter_s * self.record.sampling_rate_hz)
        if not even:
            off += self.record.sampling_rate_hz * (seconds - stamps)
        good[good] = self.used[slot[good].astype(int)]
        slot = slot[good].astype(int)
        return self.measured[slot], self.output[slot], self._output_at(slot + off[good])

    def as_counted(self):
        """The same, but at the instants that they would have if no sample were missing."""
        if "sensor" in self.record.resampled:
            clock, count = self.record.topics[1].clock, len(self.record.topics[1])
            start = clock.instants_s(self.record.topics[1].stamps_ns)[0]
            return self._beside(self.record.place(start + np.arange(count) / clock.rate_hz))
        counted = np.flatnonzero(self.record.valid)
        used = self.used[counted]
        return (self.measured[counted][used], self.output[counted][used],
                self.output[:len(counted)][used])

    def as_recorded(self):
        """Values before they were resampled or filtered, the simulated output at their instants,
        and which of them lie where the fit counted samples."""
        if self.record.band_hz is not None and self.record.topics:
            return self._before_resampling()[2:]
        return self.measured[self.rows], self.output[self.rows], self.used[self.rows]

    def on_own_clock(self):
        """Values as they were recorded, the simulated output at their instants, which of them the
        fit counted, all of shape (m,), their rate [Hz], and their places among the record's
        instants; None where they have no uniform instants of their own. What is missing does not
        count."""
        record = self.record
        if any(topic.is_moved for topic in record.topics or ()) or self.is_uneven:
            return None
        if record.band_hz is None or not record.topics:
            return (self.measured, self.output, self.used, record.sampling_rate_hz,
                    np.arange(len(self.output)))
        topic = record.topics[1]
        good, place, values, output, used = self._before_resampling()
        slot = topic.clock.slot[good].astype(int)
        every = np.arange(slot[0], slot[-1] + 1)
        there = np.zeros(len(every), bool)
        there[slot - slot[0]] = used
        return (*(np.interp(every, slot, one) for one in (values, output)), there,
                topic.clock.rate_hz, np.interp(every, slot, place))

    def at_instants(self, values, place):
        """What some values of the sensor's own clock, at places, are at the record's instants,
        shape (n,): within the band that is compared."""
        record, count = self.record, len(self.output)
        if record.band_hz is None:
            return values
        rate = record.sampling_rate_hz
        own = rate * (len(place) - 1) / (place[-1] - place[0])
        # what is faster is not folded down
        there = band_limited(values[:, None], own, place[0] / rate, rate, 0.0, count)[:, 0]
        return inner_filter(rate, record.band_hz, count)(there)

    def _before_resampling(self):
        """Which of the topic's samples are `as_recorded`, their places, and those."""
        topic = self.record.topics[1]
        place = self.record.place(topic.clock.instants_s(topic.stamps_ns))
        slot = np.round(place).astype(int)
        good = (slot >= 0) & (slot < len(self.output))
        good[good] = self.rows[slot[good]]
        return (good, place[good], topic.values[good, self.axis], self._output_at(place[good]),
                self.used[slot[good]])

    def _beside(self, place):
        """Values before they were resampled, the output at their instants and at other places."""
        good, _, values, output, used = self._before_resampling()
        return values[used], output[used], self._output_at(place[good][used])

    def _output_at(self, place):
        """Simulated output between the record's instants."""
        spline = CubicSpline(np.arange(len(self._fine_output)) / _FINE, self._fine_output)
        return spline(np.clip(place, 0, len(self.output) - 1))

    @functools.cached_property
    def _fine_output(self):
        # a filter by windows would ripple: under gravity, by more than stamps that scatter do
        return refined(self.output, _FINE)


def by_sample(engine, fitted):
    """What the record shows by itself beside a fit, sample by sample, shape (n,): no noise, and
    nothing that the motion makes."""
    p = engine.problem
    total = np.zeros(len(p.record))
    for _, _, reading in readings(engine, fitted, engine.found, {},
                                  lambda cls: cls.known_by_sample):
        if reading.added is not None:
            total[p.coherent] += reading.added
    return total * p.used


def added(engine, fitted):
    """The same, of a fit's residual: without what was taken off the record."""
    off = engine.problem.record.taken_off
    return by_sample(engine, fitted) - (0.0 if off is None else off)


def grows_with_motion(engine, fitted):
    """Whether a fit leaves noise that a cause lets come and go with the motion's size."""
    # what a reading needs is far less work than the error budget
    return any(gain(reading.before, reading.after).is_relevant for _, _, reading in readings(
        engine, fitted, engine.found, {}, lambda cls: cls.goes_with_size)) \
        and is_noise(engine, fitted)


def is_noise(engine, fitted):
    """Whether a fit leaves noise, or bursts of it, beside a motion that lasts: what the size of a
    residual tells presumes that."""
    return _moving_share(engine.problem.record.reference[:, engine.problem.axis]) > _LASTS \
        and all(part == "bursts" for _, part in engine.structure(fitted))


def _moving_share(reference):
    """Share of a record for which the reference moves: its mean power's square over the mean square
    of the power, in stretches."""
    count = max(len(reference) // _STRETCH, 1)
    moving = (reference - reference.mean())[:count * _STRETCH].reshape(count, -1)
    power = np.mean(np.square(moving), axis=1)
    return float(power.mean()**2 / max(np.mean(power**2), 1e-300))


def readings(engine, fitted, found, shown, wanted=lambda cls: True):
    """(Cause, effect, `Reading`) of each wanted cause that the record shows by itself."""
    p = engine.problem
    here = p.coherent
    record = p.part(here)
    rows = record.valid.copy()
    rows[:64] = rows[-64:] = False
    seen = Seen(record, found, p.axis, p.recorded[here], fitted.output[here], rows,
                rows & p.used[here], rows & p.taken(engine.spikes)[here],
                engine.coarse_step(fitted) is not None, lambda: {
                    entry["part"]: entry["share"] for entry in engine.budget(fitted).parts
                    if entry["ci95"][0] > 0},
                lambda: _unguessed(p, fitted, here))
    # what is known of each sample is no noise for others
    ordered = sorted(known_effects().items(), key=lambda entry: not entry[1].known_by_sample)
    for cause, cls in ordered:
        if not (cls.read_off or cause in shown) or not wanted(cls):
            continue
        recognised = cls.recognised(seen, shown.get(cause))
        if recognised is not None:
            yield cause, *recognised
            if recognised[1].added is not None:
                seen = dataclasses.replace(seen, measured=seen.measured - recognised[1].added)


def _unguessed(problem, fitted, here):
    """`Seen.unguessed` of a fit, in some rows."""
    plain = {cause: effect for cause, effect in fitted.effects.items()
             if type(effect).unknown_density is Effect.unknown_density}
    if len(plain) == len(fitted.effects):
        return None
    return (fitted.output + problem.simulate(plain) - fitted.simulated)[here]
