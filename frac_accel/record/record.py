"""A reference and a sensor on the same uniform instants: what everything else begins with."""

import dataclasses
import functools

import numpy as np

from ..errors import FracAccelError
from ..model import AXES, AxisModel, SensorModel
from .beyond import beyond
from .clock import usable
from .glitches import glitch_words, glitches, is_cut_off
from .gravity import STANDARD_GRAVITY, gravity_words
from .held import first_of_held
from .instants import put_on_instants
from .ordering import in_order, late_words
from .pairing import FEWEST, by_slots, by_stamps, same_clock, share_instants
from .relation import clock_offset, refined
from .resampling import filled, guessed, inner_filter
from .set_clock import settle
from .temperature import Temperature
from .topic import Topic

# Offset of the clocks [s], and in periods of the motion, from which on it is no sensor's delay.
_FAR_S = 1.0
_FAR_PERIODS = 3.0
# Lead of the sensor that is told: standard uncertainties, and seconds.
_SIGNIFICANT = 4.0
_LATE_S = 0.01
# Instants on either side of a sample of another rate that it changes.
_REACHED = 4
# Steps of the reference [of its standard deviation] that are worth telling, and how near to a
# number of two digits one is round.
_COARSE = 0.01
_ROUND = 1e-5


@dataclasses.dataclass(frozen=True, eq=False)
class Record:
    """Reference and sensor on uniform instants.

    Attributes
    ----------
    sampling_rate_hz : float
    reference : ndarray, shape (n, 3)
        Acceleration [m/s²]; bridged where a sample is missing.
    sensor : ndarray, shape (n, 3)
        Output in the sensor's units.
    valid : ndarray of bool, shape (n,)
        False where either of the two is missing.
    lag_s : float
        Time [s] by which the sensor's instants are later than the reference's; within half a
        sampling interval, and 0 where one of them has been resampled.
    start_ns : int
        Stamp of the first instant.
    sensor_std : float
        Standard deviation that the messages themselves state for the sensor's noise; NaN without.
    temperature_c : ndarray, shape (n,), or None
        Temperature [°C] at the instants.
    band_hz : float or None
        Highest frequency up to which the two may be compared, where one of them (`resampled`) was
        put on the other's instants; None where no value was changed.
    resampled : tuple of str
        Which of "reference" and "sensor" have been.
    offset_s, offset_std_s : float or None
        By how much the sensor's stamps are later for the same motion, as far as the correlation
        shows it clearly. Below zero, the reference's are later: that is no sensor's doing.
    taken_out_s : float
        The part of it that has been taken out of the sensor's stamps: 0, or `offset_s` where the
        clocks are so far apart that no sensor's delay can be behind it.
    words : tuple of str
        What was done to put them together.
    topics : tuple of Topic, or None
        The usable samples of reference and sensor, with what can be said of each.
    since_start_s : float
        Time [s] from the sensor's first sample, from which drifts and steps count, to its first
        one here.
    present : tuple of ndarray of bool, shape (n,), or None
        Where reference and sensor each have a sample; None where only `valid` is known.
    unfiltered : ndarray, shape (n,), or None
        Reference of the axis that `comparable` has filtered, as it was before.
    taken_off : ndarray, shape (n,), or None
        What `without` took off the sensor's output on the diagnosed axis.

    Examples
    --------
    >>> import frac_accel
    >>> frac_accel.Record.load("bags/classical_bench.mcap")
    Record(4000 samples at 1000 Hz, 4 s)
    """

    sampling_rate_hz: float
    reference: np.ndarray
    sensor: np.ndarray
    valid: np.ndarray
    lag_s: float = 0.0
    start_ns: int = 0
    sensor_std: float = np.nan
    temperature_c: np.ndarray | None = None
    band_hz: float | None = None
    resampled: tuple = ()
    offset_s: float | None = None
    offset_std_s: float | None = None
    taken_out_s: float = 0.0
    words: tuple = ()
    topics: tuple | None = None
    since_start_s: float = 0.0
    present: tuple | None = None
    unfiltered: np.ndarray | None = None
    taken_off: np.ndarray | None = None

    def __len__(self):
        return len(self.valid)

    def __repr__(self):
        band = f", up to {self.band_hz:.4g} Hz" if self.band_hz else ""
        return (f"Record({len(self)} samples at {self.sampling_rate_hz:.6g} Hz, "
                f"{len(self) / self.sampling_rate_hz:.4g} s{band})")

    def part(self, rows):
        """The record's samples of a slice with a start."""
        celsius = None if self.temperature_c is None else self.temperature_c[rows]
        return dataclasses.replace(
            self, reference=self.reference[rows], sensor=self.sensor[rows], valid=self.valid[rows],
            present=self.present and tuple(there[rows] for there in self.present),
            temperature_c=celsius,
            unfiltered=None if self.unfiltered is None else self.unfiltered[rows],
            taken_off=None if self.taken_off is None else self.taken_off[rows],
            start_ns=self.start_ns + int(rows.start * 1e9 / self.sampling_rate_hz),
            since_start_s=self.since_start_s + rows.start / self.sampling_rate_hz)

    def comparable(self, column, used):
        """The same with nothing that one of the two cannot show (`band_hz`).

        `used` (n,) are the samples that count on an axis, `column`; others are bridged.
        """
        if self.band_hz is None or not used.any():
            return self
        unknown = [~there for there in self.present] if self.present else [~self.valid] * 2
        unknown[1] = unknown[1] | (self.valid & ~used)
        signals = self.reference.copy(), self.sensor.copy()
        # copies, since the signals are filtered in place
        inside = inner_filter(self.sampling_rate_hz, self.band_hz, len(self))
        guesses = {axis: [guessed(values[:, axis].copy(), other[:, axis], which, inside)
                          for values, other, which in zip(signals, signals[::-1], unknown)]
                   for axis in range(3)}
        for axis, own in guesses.items():
            for values, guess in zip(signals, own):
                # what stands still does so beyond any filter
                if np.ptp(guess):
                    values[:, axis] = inside(guess)
        # beside a slower reference as filtered: the rest of that is its noise, which a law lets
        # through, and against which a search tries filters (four times as long, the same answer)
        whole = signals[0][:, column] if "sensor" in self.resampled else guesses[column][0]
        return dataclasses.replace(self, reference=signals[0], sensor=signals[1], unfiltered=whole)

    def without(self, column, known):
        """The same without something known of each sample, shape (n,), on an axis, `column`."""
        sensor = self.sensor.copy()
        sensor[:, column] -= known
        before = 0.0 if self.taken_off is None else self.taken_off
        return dataclasses.replace(self, sensor=sensor, taken_off=before + known)

    def instants_of(self, which, column):
        """Mask, shape (n,): instants at which the sensor's value comes from some of its samples.

        Parameters
        ----------
        which : callable
            The mask of values as they were recorded that is meant.
        column : int
        """
        if "sensor" not in self.resampled:
            return which(self.sensor[:, column])
        topic = self.topics[1]
        stamps = topic.stamps_ns[which(topic.values[:, column])]
        place = ((stamps - self.start_ns) * 1e-9 - self.lag_s) * self.sampling_rate_hz
        reached = np.floor(place).astype(int)[:, None] + np.arange(1 - _REACHED, _REACHED + 1)
        found = np.zeros(len(self), bool)
        found[reached[(reached >= 0) & (reached < len(self))]] = True
        return found

    def place(self, seconds):
        """Places among the record's instants of times [s] after the sensor's first stamp."""
        start_s = (self.topics[1].stamps_ns[0] - self.start_ns) * 1e-9 - self.lag_s
        return (start_s + seconds) * self.sampling_rate_hz

    def beyond(self, column):
        """`Beyond` of one axis: what the sensor shows where a slower reference cannot; None without
        one, or where the sensor has no uniform instants of its own."""
        if self.band_hz is None or self.topics is None:
            return None
        reference, topic = self.topics
        if topic.clock.kind == "uneven" or topic.clock.rate_hz <= reference.clock.rate_hz:
            return None
        values, _ = filled(topic.clock.slot, topic.values)
        return beyond(values[:, column], topic.clock.rate_hz, self.band_hz, self.sampling_rate_hz)

    @functools.cached_property
    def rates_std_ppm(self):
        """Standard uncertainty [1e-6] of the ratio of the topics' rates, where their instants come
        from lines through stamps that scatter; 0 where they are counted."""
        if not self.resampled or self.topics is None:
            return 0.0
        # of a fitted line's slope; the stamps of a batch say the same
        slopes = [np.sqrt(12 / topic.clock.independent_stamps(topic.stamps_ns))
                  * topic.clock.scatter_s
                  / max(1e-9 * float(topic.stamps_ns[-1] - topic.stamps_ns[0]), 1e-9)
                  for topic in self.topics]
        return float(1e6 * np.hypot(*slopes))

    @functools.cached_property
    def lag_std_s(self):
        """Standard uncertainty [s] that stamps leave to how late one topic is against the other:
        their mean or median where they scatter, and of batches an instant within an interval."""
        stds = [0.0]
        for topic in self.topics or ():
            clock = topic.clock
            stds.append(1 / (np.sqrt(12) * clock.rate_hz) if clock.kind == "batches" else
                        1.25 * clock.scatter_s
                        / np.sqrt(clock.independent_stamps(topic.stamps_ns)))
        return float(np.linalg.norm(stds))

    @property
    def start_time_s(self):
        """Time [s] from which drifts and steps count, at the reference's first instant here."""
        return self.since_start_s - self.lag_s

    @property
    def is_reference_late(self):
        """Whether the sensor shows the motion clearly before the reference does."""
        return self.offset_s is not None and not self.taken_out_s \
            and self.is_reference_late_by(self.offset_s)

    def is_reference_late_by(self, offset_s):
        """Whether such an offset, as sure as the record's, is clearly one of a late reference."""
        return _is_lead(offset_s, self.offset_std_s)

    @functools.cached_property
    def _topics(self):
        """The topics, or what the record's own arrays give for them."""
        if self.topics is not None:
            return self.topics
        from ..io.samples import Samples
        stamps = np.round(np.flatnonzero(self.valid) * 1e9 / self.sampling_rate_hz)
        return tuple(Topic(Samples.of(stamps, values[self.valid]), name, fewest=3) for name, values
                     in (("reference", self.reference), ("sensor", self.sensor)))

    def is_on_other_instants(self, name):
        """Whether the values of "reference" or "sensor" are those of other instants than the
        published ones, so that they lie on no lattice."""
        return name in self.resampled or self._topics[name == "sensor"].is_moved

    def step(self, name, column):
        """Lattice step of an axis of "reference" or "sensor" as published, or None."""
        return self._topics[name == "sensor"].step(column)

    def as_laid_out(self, model):
        """A model as it acts on these samples, which go on evenly where their stamps jump."""
        jump = self.topics and self.topics[1].clock.jump
        if not jump:
            return model

        def beside(effects):
            return tuple(effect.beside_jump(jump) for effect in effects)
        axes = {name: AxisModel(own.core, beside(own.effects))
                for name, own in zip(AXES, model.axes)}
        return SensorModel(model.core, beside(model.effects), axes, model.metadata,
                           model.reference_faults)

    def integrity(self, column):
        """`Integrity` of an axis of the sensor."""
        found = self._topics[1].integrity(column, not self.is_on_other_instants("sensor"),
                                          self._topics[0])
        found.words.extend([*self.words, *gravity_words(self.reference[self.valid],
                                                       self.sensor[self.valid])])
        one, two = self._topics
        if one.clock.jump and not two.jumps_with(one):
            found.words.append(f"the reference's {one.jump_words}")
        step = self.step("reference", column)
        if step and step > _COARSE * np.std(self.reference[:, column]):
            found.words.append(f"the reference's values are multiples of {step:.6g}{_in_g(step)}")
        return found

    @classmethod
    def load(cls, bag, reference=None, sensor=None, axis="x"):
        """Record of two topics of a bag (default: the usual ones); errors as `of` and `read_bag`.
        """
        from ..io.bag import RAW_TOPIC, REFERENCE_TOPIC, read_bag
        names = [reference or REFERENCE_TOPIC, sensor or RAW_TOPIC]
        topics = read_bag(bag, names)
        try:
            return cls.of(*(topics[name] for name in names), axis)
        except FracAccelError as error:
            raise type(error)(f"{bag}: {error}") from None

    @classmethod
    def of(cls, reference, sensor, axis="x", temperature=None):
        """Put two runs of samples on the same uniform instants.

        With one rate, sample belongs to sample, and the scatter of the stamps averages out. Where
        rates or clocks differ, the stamps say when each sample was taken: the slower topic keeps
        its instants and sets the band, and the other is resampled to them.

        Parameters
        ----------
        reference, sensor : Samples
        axis : {"x", "y", "z"}
            The axis that must hold a signal.
        temperature : Temperature or (stamps_ns, celsius), optional

        Returns
        -------
        Record
            It ends with the last instant at which both have a sample.

        Raises
        ------
        FracAccelError
            If a topic has too few samples, no signal on the axis, stamps that do not advance or
            leave gaps ten times as long as all samples, or no time in common with the other;
            or no temperature is finite.
        """
        (reference, late), (sensor, late_too) = in_order(reference), in_order(sensor)
        words = [late_words(number, name)
                 for name, number in (("reference", late), ("sensor", late_too)) if number]
        record = cls._paired(reference, sensor, axis, temperature)
        faulty, more = record._reference_alone(reference, AXES.index(axis))
        if faulty.any():
            values = np.where(faulty[:, None], np.nan, reference.values)
            record = cls._paired(reference._replace(values=values), sensor, axis, temperature)
        words += more
        return dataclasses.replace(record, words=(*words, *record.words)) if words else record

    def _reference_alone(self, reference, column):
        """Mask of the reference's samples that are its own fault, and words."""
        faulty, starts = np.zeros(len(reference.stamps_ns), bool), []
        place = (reference.stamps_ns - self.start_ns) * 1e-9 * self.sampling_rate_hz
        for rows in glitches(self.reference[:, column], self.sensor[:, column], self.valid):
            there = (place > rows.start - 0.5) & (place < rows.stop - 0.5)
            if not is_cut_off(reference.values[:, column], there):
                faulty |= there
                starts.append(rows.start / self.sampling_rate_hz)
        return faulty, [glitch_words(int(faulty.sum()), starts)] if starts else []

    @classmethod
    def _paired(cls, reference, sensor, axis, temperature):
        """`of`, whatever the reference's values are."""
        column = AXES.index(axis)
        (reference, held), (sensor, held_too) = map(first_of_held, (reference, sensor))
        one, two = Topic(reference, "reference"), Topic(sensor, "sensor")
        for topic in (one, two):
            _require_signal(topic, column)
        share_instants(one, two)
        offset = clock_offset(one, two, int(one.stamps_ns[0]))
        taken_out = 0.0
        words = [f"the {topic.name} holds each value for {length:.3g} samples: the first of them "
                 f"counts, at {topic.clock.rate_hz:.4g} Hz"
                 for topic, length in ((one, held), (two, held_too)) if length > 1]
        words += [said for topic in (one, two) for said in put_on_instants(topic)]
        if offset is not None and _far(offset, one, two):
            taken_out = offset.seconds
            two.shift(-taken_out)
        paired = _laid_out(one, two)
        if settle(paired, two, words):
            paired = _laid_out(one, two)
        stated = sensor.variance[:, column]
        std = np.sqrt(np.nanmean(stated)) if np.isfinite(stated).any() else np.nan
        valid = paired.valid
        last = int(np.flatnonzero(valid)[-1]) + 1 if valid.any() else 0
        if np.count_nonzero(valid) < FEWEST // 2:
            raise FracAccelError(f"reference and sensor have {np.count_nonzero(valid)} "
                                 f"instants in common, expected at least {FEWEST}")
        lag = paired.lag_s
        if offset is not None:
            rest = refined(paired.reference, paired.sensor, valid, paired.sampling_rate_hz,
                           offset.seconds - taken_out - lag, paired.band_hz)
            if rest is not None:
                offset = dataclasses.replace(rest, seconds=rest.seconds + lag + taken_out)
                if taken_out:
                    taken_out, lag = offset.seconds, -rest.seconds
            words += _offset_words(offset, taken_out)
        celsius = None
        if temperature is not None:
            instants = np.round(np.arange(last) * 1e9 / paired.sampling_rate_hz).astype(np.int64)
            celsius = Temperature.of(temperature)(
                paired.start_ns + round(taken_out * 1e9) + instants)
        return cls(paired.sampling_rate_hz, paired.reference[:last], paired.sensor[:last],
                   valid[:last], lag, paired.start_ns, float(std), celsius,
                   paired.band_hz, paired.resampled, offset and offset.seconds,
                   offset and offset.std_s, taken_out, (*words, *paired.words), (one, two),
                   1e-9 * (paired.start_ns - int(two.stamps_ns[0])) + lag,
                   tuple(there[:last] for there in paired.present))


def _laid_out(one, two):
    return by_slots(one, two) if same_clock(one, two) else by_stamps(one, two)


@dataclasses.dataclass(frozen=True, eq=False)
class UniformSamples:
    """Samples of one topic on uniform instants.

    Attributes
    ----------
    sampling_rate_hz : float
    values : ndarray, shape (n, 3)
        Bridged linearly where a sample is missing.
    index : ndarray of int, shape (m,)
        Samples that are usable.
    slot : ndarray of int, shape (m,)
        Their places among the uniform instants.
    """

    sampling_rate_hz: float
    values: np.ndarray
    index: np.ndarray
    slot: np.ndarray

    @property
    def bridged(self):
        """Number of instants without a sample."""
        return len(self.values) - len(self.slot)

    @classmethod
    def of(cls, samples, where):
        """Put one run of samples (or None) on uniform instants; `where` is its name in messages.

        Raises
        ------
        FracAccelError
            If fewer than two samples are usable, or they are spread too far.
        """
        from .clock import long_term_rate
        count = int(usable(samples).sum()) if samples is not None else 0
        if count < 2:
            raise FracAccelError(f"{where}: {count} usable sample(s), expected at least 2 whose "
                                 "stamps advance and whose values are finite")
        topic = Topic(samples, where, fewest=2)
        stamps, values = topic.stamps_ns, topic.values
        index = np.arange(count) if topic.index is None else topic.index
        rate = long_term_rate(stamps)
        slot = np.round((stamps - stamps[0]) * rate * 1e-9).astype(np.int64)
        # stamps that scatter so much that two samples share an instant: the first one counts
        first = np.r_[True, np.diff(slot) > 0]
        index, slot, values = index[first], slot[first], values[first]
        grid = np.arange(slot[-1] + 1)
        bridged = np.stack([np.interp(grid, slot, values[:, i]) for i in range(3)], axis=1)
        return cls(rate, bridged, index, slot)


def _require_signal(topic, column):
    spread = np.ptp(topic.values, axis=0)
    if spread[column] == 0:
        others = [AXES[i] for i in np.flatnonzero(spread)]
        hint = f"; there is signal on {' and '.join(others)}" if others else ""
        raise FracAccelError(f"{topic.name}: axis {AXES[column]} is constant at "
                             f"{topic.values[0, column]:g}{hint}")


def _offset_words(offset, taken_out):
    """What is to be said of the clocks: nothing where a sensor's own delay may be behind it."""
    size = _with_std(abs(offset.seconds), offset.std_s) + " s"
    if taken_out:
        later = "ahead of" if offset.seconds > 0 else "behind"
        return [f"the sensor's clock is {size} {later} the reference's, by what both measure: this "
                "is taken out of its stamps, and no delay of the sensor can be told"]
    if _is_lead(offset.seconds, offset.std_s):
        return [f"the sensor shows the motion {size} before the reference does, which no sensor "
                "can: the reference's stamps are late, or the sensor's early"]
    return []


def _is_lead(seconds, std_s):
    return seconds < -max(_SIGNIFICANT * std_s, _LATE_S)


def _in_g(step):
    """The same in g, where it is a round number there."""
    g = step / STANDARD_GRAVITY
    return f" ({g:.2g} g)" if abs(g / float(f"{g:.2g}") - 1) < _ROUND else ""


def _with_std(value, std):
    """Value and standard uncertainty with as many digits as that leaves."""
    digits = max(0, int(np.ceil(-np.log10(max(std, 1e-9)))))
    return f"{value:.{digits}f} ± {std:.1g}"


def _far(offset, one, two):
    """Whether clocks are so far apart that no delay of a sensor is behind it."""
    start = max(one.stamps_ns[0], two.stamps_ns[0])
    stop = min(one.stamps_ns[-1], two.stamps_ns[-1])
    if stop - start < FEWEST * 1e9 / min(one.clock.rate_hz, two.clock.rate_hz):
        return True
    moving = one.values[:, int(np.argmax(np.std(one.values, axis=0)))]
    moving = moving - moving.mean()
    # mean period by the crossings of the mean
    crossings = max(int(np.count_nonzero(np.diff(np.signbit(moving)))), 1)
    period = 2 * float(one.stamps_ns[-1] - one.stamps_ns[0]) * 1e-9 / crossings
    return abs(offset.seconds) > max(_FAR_S, _FAR_PERIODS * period)


