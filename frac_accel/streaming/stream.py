"""The streaming kernel: samples in, filtered samples out, for nodes and commands alike."""

import collections
import dataclasses

import numpy as np

from ..correction.parameter_uncertainty import ParameterUncertaintyState
from ..correction.static_terms import StaticTermsState
from ..errors import DesignError, FracAccelError
from ..io.samples import Samples
from ..model.effects import Circumstances
from ..signals.parallel_filter import FilterState, MotionPower, ParallelFilter
from ..signals.sample_rate import estimate_rate
from .batches import Batches, rate_of_batches, share_stamps
from .bridging import BridgeEnsemble
from .history import UnknownHistory
from .monitors import FAULTS, NOT_CONNECTED, AxisMonitors
from .plausibility import Plausibility, stated_range
from .temperature import HeldTemperature
from .timing import LARGEST, RATE_SAMPLES, SampleClock, joined, tells_rate

# Variance of a faulty axis [output units squared]: no fusion filter gives it any weight.
DISTRUSTED = 1e9
# Time [s] over which what a model leaves lasts beside the motion that it comes from.
_LASTING_S = 10.0
ON_FAULT = ("covariance", "drop", "report")
# Samples kept for a change of model: the new filter starts with these behind it.
HISTORY = 4096
# Samples that are put together in it at a time, at least.
_TOGETHER = 64
# Most samples that are held while their stamps do not advance.
HELD = 100_000
# Largest stamp that an int64 can hold.
LARGEST_STAMP_NS = 2**63 - 1


@dataclasses.dataclass(frozen=True)
class Filtered:
    """Filtered samples.

    Attributes
    ----------
    index : ndarray of int64, shape (n,)
        Running number of the input sample that each belongs to, counted from 0.
    stamps_ns : ndarray of int64, shape (n,)
        Instants that the values estimate.
    values : ndarray, shape (n, 3)
    variance : ndarray, shape (n, 3)
        Their variance from the noise of the input, the uncertainty of the model's parameters,
        bridged gaps, what is not known of the motion before the start, the filter's own error and
        what the model is known to leave (`model_error`);
        NaN where the noise is not known.
    """

    index: np.ndarray
    stamps_ns: np.ndarray
    values: np.ndarray
    variance: np.ndarray

    def __len__(self):
        return len(self.index)


class Stream:
    """Runs the filters of three axes over a stream of samples, in blocks of any length.

    The numbers are the same to the last bit however the stream is split into blocks. A subclass
    says how the filters are designed and what happens to the samples before and after them.

    Parameters
    ----------
    model : SensorModel
    sampling_rate_hz : float
        Sampling rate [Hz]; 0: estimated from the first hundred stamps.
    noise_std : float or sequence of three, optional
        Standard deviation of the white noise of the input, used where a sample comes without a
        variance.
    plausible_range : sequence of two floats, optional
        Lowest and highest value that can be true; default: see `plausibility`.
    on_fault : {"covariance", "drop", "report"}
        What happens to the output while an axis is faulty (`monitors`): its variance becomes
        `DISTRUSTED`, nothing is given out, or nothing happens. An axis that is not connected has
        the variance, but withholds nothing of the others.
    largest_rate : float
        Largest rate of change [input units/s] that is no fault; 0: any.
    **wishes
        Passed on to `_design`.

    Notes
    -----
    A sample is given out `FilterDesign.delay_samples` samples after it came in. The first samples
    after a start are not given out, since the filter would have to invent the motion before them.
    What happens to stamps that scatter, repeat, go back or leave gaps stands in `timing`.
    `counters` says how many samples met which fate; always ``samples`` = ``given`` +
    ``waiting`` + ``warm_up`` + ``cut_off`` + ``duplicates`` + ``stamps_back`` + ``early`` +
    ``not_finite`` + ``implausible`` + ``without_rate`` + ``faulty``. Those given while an axis
    was distrusted are ``distrusted``.

    Attributes
    ----------
    taken : (ndarray of int64, Samples) or None
        Running numbers of the samples that the last call of `process` or `finish` has looked at,
        and these with the stamps that they were taken for, where they share stamps (`batches`).
    """

    # Whether the axes are watched; what drives a simulation may stand still.
    _is_watched = True

    def __init__(self, model, sampling_rate_hz=0.0, noise_std=None, plausible_range=None,
                 on_fault="covariance", largest_rate=0.0, **wishes):
        # as it was called first
        sampling_rate_hz = wishes.pop("sample_rate_hz", sampling_rate_hz)
        if not np.isfinite(sampling_rate_hz) or sampling_rate_hz < 0:
            raise FracAccelError(f"sampling_rate_hz: {sampling_rate_hz} given, expected a number "
                                 "above 0, or 0 to estimate it from the stamps")
        self._wishes = wishes
        self._adopt(model)
        self._noise_std = noise_std
        if on_fault not in ON_FAULT:
            raise FracAccelError(f"on_fault: {on_fault!r} given, expected one of "
                                 f"{', '.join(ON_FAULT)}")
        self._on_fault, self._largest_rate = on_fault, largest_rate
        self._plausible_range = _range_of(plausible_range)
        self._held, self._held_count, self._advancing = [], 0, False
        self._samples = 0
        self._totals = dict.fromkeys(("given", "warm_up", "cut_off", "duplicates",
                                      "without_rate", "faulty", "distrusted"), 0)
        self._temperature = HeldTemperature()
        self._record_start_ns = self._record_end_ns = None
        self._clock = None
        self._prepared = None
        self.design = None
        self.taken = None
        if sampling_rate_hz:
            self._start(float(sampling_rate_hz))

    def __repr__(self):
        rate = f"{self.sampling_rate_hz:.6g} Hz" if self.design else "rate not yet known"
        return f"<{type(self).__name__}: {rate}, {self._model!r}>"

    @property
    def model(self):
        """SensorModel in use."""
        return self._model

    @property
    def sampling_rate_hz(self):
        """Sampling rate [Hz]; None while it is being estimated."""
        return self.design.sampling_rate_hz if self.design else None

    sample_rate_hz = sampling_rate_hz

    @property
    def faults(self):
        """What is wrong with each axis now, tuple of str: see `monitors.FAULTS`."""
        return self._monitors.faults if self._clock else ("",) * 3

    @property
    def learns_range(self):
        """Whether what can be true is taken from the record, as no range is stated."""
        return self._clock is not None and self._plausibility.learns

    @property
    def batch_size(self):
        """How many samples share a stamp, where they do (`batches`); else 0."""
        return self._batches.size if self._clock else 0.0

    @property
    def counters(self):
        """How many samples met which fate, as a new dict of str to int."""
        counters = {"samples": self._samples, "waiting": self._held_count, **self._totals}
        if self._clock:
            counters["waiting"] = (int(np.sum(self._waiting_index >= 0))
                                   + self._plausibility.waiting + len(self._batches.waiting))
            for name, count in self._clock.counters.items():
                counters[name] = counters.get(name, 0) + count
        return counters

    @property
    def waiting(self):
        """Running numbers of the samples that can still be given out, ascending."""
        if self._clock is None:
            return np.concatenate([np.empty(0, np.int64), *(block[0] for block in self._held)])
        waiting = self._waiting_index[self._waiting_index > self._last_given]
        held = self._plausibility.held
        return np.concatenate([waiting, *held[:1], self._batches.waiting])

    def process(self, stamps_ns, values, variance=None):
        """Filter the next samples.

        Parameters
        ----------
        stamps_ns : array_like of int, shape (n,)
            Stamps [ns].
        values : array_like, shape (n, 3)
            Samples.
        variance : array_like, shape (n, 3), optional
            Their variance; NaN where it is not known.

        Returns
        -------
        Filtered
            The samples that are ready; may be none.

        Raises
        ------
        FracAccelError
            If the shapes do not fit.
        DesignError
            If the rate has just been estimated and the filter cannot be met at it.
        """
        stamps = np.asarray(stamps_ns, np.int64)
        values = np.asarray(values, float)
        if values.shape != (len(stamps), 3):
            raise FracAccelError(f"values: shape {values.shape} given, expected "
                                 f"({len(stamps)}, 3)")
        if variance is None:
            variance = np.full(values.shape, np.nan)
        variance = np.asarray(variance, float)
        if variance.shape != values.shape:
            raise FracAccelError(f"variance: shape {variance.shape} given, expected "
                                 f"{values.shape}")
        self.taken = None
        if not len(stamps):
            return _concatenated([])
        if not (variance.min() >= 0 and variance.max() < LARGEST):
            # no noise has such a variance: it is not known
            variance = np.where((variance >= 0) & (variance < LARGEST), variance, np.nan)
        self._count(values)
        index = np.arange(self._samples, self._samples + len(stamps))
        self._samples += len(stamps)
        if self._clock is not None:
            return self._filter(index, stamps, values, variance)
        self._hold(index, stamps, values, variance)
        return self._filter_held() if self._estimate(RATE_SAMPLES) else _concatenated([])

    def set_temperature(self, celsius):
        """Temperature [°C] of the sensor from the next sample on; held until the next value."""
        if np.isfinite(celsius):
            self._temperature.set(self._samples, float(celsius))

    def finish(self):
        """Filter what is still held: there is no more to tell the rate or what is plausible by.

        Returns
        -------
        Filtered

        Raises
        ------
        FracAccelError
            If the rate cannot be estimated at all.
        """
        self.taken = None
        if self._clock is None:
            if not self._held_count:
                return _concatenated([])
            if not self._estimate(2):
                raise FracAccelError(
                    f"the sampling rate cannot be estimated from {self._samples} sample(s) whose "
                    "stamps do not advance or are too far apart; give it as sampling_rate_hz")
            return _concatenated([self._filter_held(), self._finish()])
        return self._finish()

    def prepare(self, model, design=None, **wishes):
        """Design the filters of another model without using them yet.

        It may run in another thread than `process`; `replace` with the same model and wishes then
        takes no time.

        Parameters
        ----------
        model, **wishes
            As in `replace`.
        design : FilterDesign, optional
            That of this model at this rate with these wishes, where somebody has made it already.

        Raises
        ------
        DesignError
            If they cannot be met.
        """
        wishes = {**self._wishes, **wishes}
        if self.sampling_rate_hz:
            design = design or self._designed(model, self.sampling_rate_hz, wishes)
            self._prepared = model, wishes, design

    def replace(self, model, **wishes):
        """Go on with another model, without losing a sample.

        Parameters
        ----------
        model : SensorModel
        **wishes
            As in the constructor, those that change.

        Returns
        -------
        Filtered
            Samples that are ready with the new filter but were not with the old.

        Raises
        ------
        DesignError
            If the new filter cannot be met; the old model then stays.
        """
        wishes = {**self._wishes, **wishes}
        self.taken = None
        if self._clock is None:
            self._adopt(model)
            self._wishes = wishes
            return _concatenated([])
        prepared, self._prepared = self._prepared, None
        if prepared and prepared[0] is model and prepared[1] == wishes:
            design = prepared[2]
        else:
            design = self._designed(model, self.sampling_rate_hz, wishes)
        self._adopt(model)
        self._wishes = wishes
        self._use(design)
        self._begin()
        return _concatenated([self._advance(run) for run in [*self._history, *self._latest]])

    def _adopt(self, model):
        """Take a model as the one in use."""
        self._model = model

    def _design(self, model, sampling_rate_hz, **wishes):
        """FilterDesign for a model at a sampling rate."""
        raise NotImplementedError

    def _designed(self, model, sampling_rate_hz, wishes):
        """The same; whatever goes wrong is a DesignError."""
        try:
            return self._design(model, sampling_rate_hz, **wishes)
        except FracAccelError:
            raise
        except Exception as error:  # a model can be beyond what the linear algebra can bear
            raise DesignError("the filter cannot be designed with these parameters: "
                              f"{type(error).__name__}") from error

    def _stated_range(self):
        """What `stated_range` says of this stream's input."""
        return stated_range(self._plausible_range, self._limits(), np.ones(3))

    def _limits(self):
        """Lowest and highest value that each axis of the input can say, shape (3,) each."""
        return np.full(3, -np.inf), np.full(3, np.inf)

    def _errors_before(self, members, values, index, stamps_ns):
        """Ensemble of errors (m, 3, k) of samples (m, 3), after what `_before` does to these."""
        return members

    def _count(self, values):
        """Count what is to be counted of incoming samples, shape (n, 3)."""

    def _before(self, values, variance, index, stamps_ns):
        """What happens to the samples and their variance before the filters; (n, 3) each."""
        return values, variance

    def _after(self, values, variance, index, stamps_ns):
        """What happens to the samples and their variance after the filters; (n, 3) each."""
        return values, variance

    def _stamps(self, stamps_ns):
        """Stamps of the output from those of the samples that it belongs to."""
        return stamps_ns

    def _circumstances(self, index, stamps_ns):
        return Circumstances(1e-9 * (stamps_ns - self._record_start_ns),
                             self._temperature.at(index))

    def _hold(self, index, stamps, values, variance):
        """Keep samples until there are enough to tell the rate."""
        before = self._held[-1][1][-1:] if self._held else stamps[:1]
        if not len(stamps):
            return
        self._advancing |= bool((np.diff(np.r_[before, stamps]) > 0).any())
        self._held.append((index, stamps, values, variance))
        self._held_count += len(index)
        if self._held_count > HELD and not self._advancing:
            # stamps that never advance: all but the newest sample repeat it
            self._held = [tuple(part[-1:] for part in self._held[-1])]
            self._totals["duplicates"] += self._held_count - 1
            self._held_count = 1

    def _filter_held(self):
        held, self._held, self._held_count = self._held, [], 0
        return self._filter(*(np.concatenate(part) for part in zip(*held)))

    def _estimate(self, least):
        """Start at the rate of the first stamps that tell it, if there are enough of them.

        Which stamps these are must not depend on the blocks in which they come.
        """
        while self._advancing and self._held_count >= least:
            index, stamps, values, variance = (np.concatenate(part) for part in zip(*self._held))
            count = max(RATE_SAMPLES, int(np.argmax(np.diff(stamps) > 0)) + 2)
            if share_stamps(stamps[:count], values[:count]):
                rate, unusable = rate_of_batches(stamps, least < RATE_SAMPLES)
                if rate:
                    self._start(rate)
                    self._batches.begin(len(stamps) / len(np.unique(stamps)))
                elif unusable:
                    count = unusable
                if not unusable:
                    return rate is not None
            elif tells_rate(stamps[:count]):
                self._start(estimate_rate(stamps[:count]))
                return True
            # most of the samples are missing between them
            self._totals["without_rate"] += len(stamps[:count])
            self._held = [(index[count:], stamps[count:], values[count:], variance[count:])]
            self._held_count = len(index[count:])
            self._advancing = bool((np.diff(stamps[count:]) > 0).any())
            if not self._held_count:
                self._held = []
        return False

    def _start(self, rate):
        self._use(self._designed(self._model, rate, self._wishes))
        self._clock = SampleClock(rate, self.design.warm_up_samples)
        self._clock.noise_variance = self._noise_variance
        self._batches = Batches(rate)
        self._last_given = -1
        self._forget()
        self._begin()

    def _use(self, design):
        self.design = design
        if self._clock:
            self._clock.longest_gap = design.warm_up_samples
        noise = self._model.noise_std if self._noise_std is None else self._noise_std
        self._noise_variance = np.broadcast_to(np.square(np.asarray(noise, float)), 3)
        noise_std = np.sqrt(self._noise_variance)
        if self._clock:
            self._monitors.set_limits(self._limits(), noise_std)
            self._clock.noise_variance = self._noise_variance
            self._plausibility.set_range(*self._stated_range())
        else:
            self._plausibility = Plausibility(*self._stated_range())
            self._monitors = AxisMonitors(design.sampling_rate_hz, self._limits(), noise_std,
                                          self._largest_rate)

    def _begin(self):
        """Nothing is known of the motion before the next sample."""
        self._states = None
        self._kept = None
        self._waiting_index = np.empty(0, np.int64)
        self._waiting_stamps = np.empty(0, np.int64)

    def _filter(self, *samples, is_end=False):
        samples, began_at = self._batches.take(*samples, is_end)
        if began_at is not None:
            self._clock.begin_anew(began_at)
        if self._batches.size:
            self.taken = samples[0], Samples.of(*samples[1:])
        if self._is_watched:
            self._monitors.add(samples[0], samples[2])
        return self._filter_decided(*self._plausibility.judge(*samples))

    def _finish(self):
        none = np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3))
        taken = self.taken
        ready = [self._filter(*none, is_end=True),
                 self._filter_decided(*self._plausibility.judge(*none, True))]
        self.taken = _both(taken, self.taken)
        return _concatenated(ready)

    def _filter_decided(self, index, stamps, values, variance, plausible, finite):
        parts = []
        for run in self._clock.sort(index, stamps, values, variance, plausible, finite):
            self._note_time(run.stamps_ns)
            if run.restart:
                lost = int(np.sum(self._waiting_index >= 0))
                given_up = "cut_off" if self._states else "warm_up"
                self._totals[given_up] += lost
                self._begin()
                self._forget()
            self._remember(run)
            parts.append(self._advance(run))
        return _concatenated(parts)

    def _note_time(self, stamps_ns):
        """Drifts count from the first sample, and go on where a clock has been set back."""
        if self._record_start_ns is None:
            self._record_start_ns = int(stamps_ns[0])
        elif stamps_ns[0] < self._record_end_ns:
            # absurd stamps may add up to more than a stamp can be
            moved = self._record_start_ns - self._record_end_ns + int(stamps_ns[0])
            self._record_start_ns = min(max(moved, -LARGEST_STAMP_NS), LARGEST_STAMP_NS)
        self._record_end_ns = int(stamps_ns[-1])

    def _forget(self):
        self._history, self._history_length = collections.deque(), 0
        self._latest, self._latest_length = [], 0

    def _remember(self, run):
        self._latest.append(run)
        self._latest_length += len(run.index)
        if self._latest_length < _TOGETHER:
            return
        # runs of one sample each take twenty times the memory of their samples
        self._history += joined(self._latest)
        self._history_length += self._latest_length
        self._latest, self._latest_length = [], 0
        while self._history_length - len(self._history[0].index) >= HISTORY:
            self._history_length -= len(self._history.popleft().index)

    def _advance(self, run):
        """Run the filters over samples that follow the ones before."""
        self._waiting_index = np.concatenate([self._waiting_index, run.index])
        self._waiting_stamps = np.concatenate([self._waiting_stamps, run.stamps_ns])
        variance, noise_known, index = run.variance, None, run.index
        if np.isnan(variance.min()):
            stated = ~np.isnan(variance)
            noise_known = (stated | (self._noise_variance > 0)).all(axis=1)
            variance = np.where(stated, variance, self._noise_variance)
        if run.bridges:
            # a bridged sample is as warm as the one after it, and its variance says nothing of
            # the noise: that of the sample after it does
            following = np.where(index < 0, len(index) - 1, np.arange(len(index)))
            following = np.minimum.accumulate(following[::-1])[::-1]
            index = index[following]
            noise_known = None if noise_known is None else noise_known[following]
        values, variance = self._before(run.values, variance, index, run.stamps_ns)
        bridges = [(at, self._errors_before(members, run.values[at:at + len(members)],
                                            index[at:at + len(members)],
                                            run.stamps_ns[at:at + len(members)]))
                   for at, members in run.bridges]
        if self._states is None:
            if self._kept is not None:
                bridges = [*self._kept[2], *_shifted(bridges, len(self._kept[0]))]
                values = np.concatenate([self._kept[0], values])
                variance = np.concatenate([self._kept[1], variance])
            warm_up = self.design.warm_up_samples
            if len(values) <= warm_up:
                self._kept = values, variance, bridges
                return _concatenated([])
            self._fill(values[:warm_up], variance[:warm_up], _cut(bridges, 0, warm_up))
            bridges = _cut(bridges, warm_up, len(values))
            values, variance = values[warm_up:], variance[warm_up:]
        return self._give(values, variance, bridges,
                          None if noise_known is None else noise_known[-len(values):])

    def _fill(self, values, variance, bridges):
        """Bring the filters into the state that they have when their taps are first full."""
        self._kept = None
        self._states = []
        filters = list(zip(self.design.axes, self.design.static_terms,
                           self.design.parameter_uncertainty))
        # axes with the same filter run through it together
        for design, terms, uncertainty in dict.fromkeys(filters):
            rows = [axis for axis in range(3)
                    if filters[axis] == (design, terms, uncertainty)]
            rows = slice(None) if len(rows) == 3 else rows
            columns = values[:, rows].T
            # behind a high-pass every steady motion leaves the output at rest
            level = np.zeros(len(columns)) if design.band_hz[0] else columns.mean(axis=1)
            state = FilterState(design.filter, level)
            power = MotionPower(level * design.filter.static_gain, len(values))
            before = state.process(columns)
            power.process(before)
            head = np.r_[np.zeros(design.filter.lead), np.square(design.filter.impulse_head)]
            noise = FilterState(ParallelFilter(head, np.empty(0), np.empty(0)),
                                np.zeros(len(columns)))
            noise.process(variance[:, rows].T)
            later = max(design.noise_gain**2 - head.sum(), 0.0)
            static, parts = None, ()
            if terms:
                static = StaticTermsState(terms, columns.mean(axis=1) * (not terms.is_coupled),
                                          uncertainty.parts if uncertainty else (),
                                          1e-9 * (self._waiting_stamps[0] - self._record_start_ns))
                parts = static.process(columns, variance[:, rows].T)[2]
            doubt = None
            if uncertainty:
                doubt = ParameterUncertaintyState(uncertainty, columns.mean(axis=1))
                doubt.process(columns, parts)
            history = None
            if len(design.filter.poles):
                history = UnknownHistory(design.filter, level, design.band_hz[0] > 0)
                history.process(columns)
            ensemble = BridgeEnsemble(design.filter, len(columns))
            ensemble.process(len(values), _rows_of(bridges, rows))
            slow = None
            if self._model.model_error:
                slow = MotionPower(level * design.filter.static_gain,
                                   round(_LASTING_S * self.design.sampling_rate_hz))
                slow.process(before)
            self._states.append((rows, state, design.rms_error**2, power, slow, noise, later,
                                 history, static, doubt, ensemble))
        # the oldest of the waiting will have been passed over before the first output
        skipped = len(values) - self.design.delay_samples
        fresh = self._waiting_index[:skipped]
        self._totals["warm_up"] += int(np.sum(fresh > self._last_given))
        self._waiting_index = self._waiting_index[skipped:]
        self._waiting_stamps = self._waiting_stamps[skipped:]

    def _give(self, values, variance, bridges, noise_known):
        count = len(values)
        result, spread = np.empty((3, count)), np.empty((3, count))
        values, variance = np.ascontiguousarray(values.T), np.ascontiguousarray(variance.T)
        for (rows, state, error, power, slow, noise, later, history, static, doubt,
             ensemble) in self._states:
            own, known = values[rows], variance[rows]
            corrected = state.process(own)
            total = noise.process(known)
            if later:
                total += later * known
            moving = power.process(corrected)
            total += error * moving
            if slow:
                # it begins with the motion, and lasts
                total += self._model.model_error**2 * np.maximum(moving, slow.process(corrected))
            if history:
                added, more = history.process(own)
                corrected += added
                total += more
            gaps = ensemble.process(count, _rows_of(bridges, rows))
            if gaps is not None:
                total += gaps
            parts = ()
            if static:
                added, more, parts = static.process(own, known)
                corrected += added
                total += more
            if doubt:
                total += doubt.process(own, parts)
            result[rows], spread[rows] = corrected, total
        result, spread = result.T, spread.T
        if noise_known is not None:
            spread[~noise_known] = np.nan
        index, stamps = self._waiting_index[:count], self._waiting_stamps[:count]
        self._waiting_index = self._waiting_index[count:]
        self._waiting_stamps = self._waiting_stamps[count:]
        if index.min() <= self._last_given:
            given = index > self._last_given
            index, stamps = index[given], stamps[given]
            result, spread = result[given], spread[given]
        if len(index):
            self._last_given = int(index[-1])
        filtered = Filtered(index, self._stamps(stamps),
                            *self._after(result, spread, index, stamps))
        codes = (self._monitors.codes(index + self.design.delay_samples)
                 if len(index) and self._on_fault != "report" else None)
        if codes is not None and codes.any():
            filtered = self._distrust(codes, filtered)
        self._totals["given"] += len(filtered)
        return filtered

    def _distrust(self, codes, filtered):
        """`Filtered` of which some axes are faulty, as `on_fault` wants it."""
        rows = ((codes > 0) & (codes != FAULTS.index(NOT_CONNECTED))).any(axis=1)
        if self._on_fault == "drop":
            self._totals["faulty"] += int(rows.sum())
            filtered = Filtered(*(getattr(filtered, field.name)[~rows]
                                  for field in dataclasses.fields(Filtered)))
            codes, rows = codes[~rows], rows[~rows]
        self._totals["distrusted"] += int(rows.sum())
        is_faulty, unknown = codes > 0, np.isnan(filtered.variance)
        # a message cannot say that one axis is bad and another's noise unknown: one that is only
        # not connected takes nothing from the others
        harmless = ~rows & (unknown & ~is_faulty).any(axis=1)
        bad = np.where(rows[:, None], is_faulty | unknown, is_faulty & ~harmless[:, None])
        variance = np.where(harmless[:, None] & is_faulty, np.nan, filtered.variance)
        return dataclasses.replace(filtered, variance=np.where(bad, DISTRUSTED, variance))


def _range_of(plausible_range):
    """Two floats, or None."""
    if plausible_range is None:
        return None
    low, high = (float(edge) for edge in plausible_range)
    if not low < high:
        raise FracAccelError(f"plausible_range: {low:g} to {high:g} given, expected the lowest and "
                             "the highest value that can be true")
    return low, high


def _both(taken, more):
    """What two calls have looked at."""
    if taken is None or more is None:
        return taken or more
    return np.concatenate([taken[0], more[0]]), Samples.concatenate([taken[1], more[1]])


def _shifted(bridges, by):
    return [(at + by, members) for at, members in bridges]


def _cut(bridges, start, stop):
    """What lies within so many samples, counted from the first of them."""
    parts = ((max(at, start), members[max(start - at, 0):max(stop - at, 0)])
             for at, members in bridges)
    return [(at - start, members) for at, members in parts if len(members)]


def _rows_of(bridges, rows):
    return [(at, members[:, rows]) for at, members in bridges]


def _concatenated(parts):
    if not parts:
        return Filtered(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 3)),
                        np.empty((0, 3)))
    if len(parts) == 1:
        return parts[0]
    return Filtered(*(np.concatenate([getattr(part, field.name) for part in parts])
                      for field in dataclasses.fields(Filtered)))
