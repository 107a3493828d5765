"""The streaming kernel: samples in, filtered samples out, for nodes and commands alike."""

import collections
import dataclasses

import numpy as np
from scipy.signal import lfilter

from ..errors import FracAccelError
from .filter import FilterState
from .timing import RATE_SAMPLES, SampleClock, estimate_rate

# Samples kept for a change of model: the new filter starts with these behind it.
HISTORY = 4096


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
        Their variance from the noise of the input, bridged gaps and what is not known of
        the motion before the start; NaN where the noise is not known.
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
    sample_rate_hz : float
        Sampling rate [Hz]; 0: estimated from the first hundred stamps.
    noise_std : float or sequence of three, optional
        Standard deviation of the white noise of the input, used where a sample comes without a
        variance.
    **wishes
        Passed on to `_design`.

    Notes
    -----
    A sample is given out `FilterDesign.delay_samples` samples after it came in. The first samples
    after a start are not given out, since the filter would have to invent the motion before them.
    What happens to stamps that scatter, repeat, go back or leave gaps stands in `timing`.
    `counters` says how many samples met which fate; always ``samples`` = ``given`` +
    ``waiting`` + ``warm_up`` + ``cut_off`` + ``duplicates`` + ``stamps_back`` + ``early`` +
    ``not_finite``.
    """

    def __init__(self, model, sample_rate_hz=0.0, noise_std=None, **wishes):
        if not np.isfinite(sample_rate_hz) or sample_rate_hz < 0:
            raise FracAccelError(f"sample_rate_hz: {sample_rate_hz} given, expected a number above "
                                 "0, or 0 to estimate it from the stamps")
        self._wishes = wishes
        self._model = model
        self._noise_std = noise_std
        self._held = []
        self._samples = 0
        self._totals = dict.fromkeys(("given", "warm_up", "cut_off"), 0)
        self._clock = None
        self.design = None
        if sample_rate_hz:
            self._start(float(sample_rate_hz))

    @property
    def sample_rate_hz(self):
        """Sampling rate [Hz]; None while it is being estimated."""
        return self.design.sampling_rate_hz if self.design else None

    @property
    def counters(self):
        """How many samples met which fate, as a new dict of str to int."""
        timing = self._clock.counters if self._clock else {}
        waiting = sum(len(block[0]) for block in self._held)
        if self._clock:
            waiting += int(np.sum(self._waiting_index >= 0))
        return {"samples": self._samples, "waiting": waiting, **self._totals, **timing}

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
        index = np.arange(self._samples, self._samples + len(stamps))
        self._samples += len(stamps)
        if self._clock is None:
            self._held.append((index, stamps, values, variance))
            if not self._estimate(RATE_SAMPLES):
                return _concatenated([])
            index, stamps, values, variance = (np.concatenate(part) for part in zip(*self._held))
            self._held = []
        return self._filter(index, stamps, values, variance)

    def finish(self):
        """Filter what is still held because the stream ended before its rate was known.

        Returns
        -------
        Filtered

        Raises
        ------
        FracAccelError
            If the rate cannot be estimated at all.
        """
        if self._clock is not None or not self._held:
            return _concatenated([])
        if not self._estimate(2):
            count = sum(len(block[0]) for block in self._held)
            raise FracAccelError(
                f"the sampling rate cannot be estimated from {count} sample(s) whose stamps do not "
                "advance; give it as sample_rate_hz")
        held, self._held = self._held, []
        return self._filter(*(np.concatenate(part) for part in zip(*held)))

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
        if self._clock is None:
            self._model, self._wishes = model, wishes
            return _concatenated([])
        design = self._design(model, self.sample_rate_hz, **wishes)
        self._model, self._wishes = model, wishes
        self._use(design)
        self._begin()
        return _concatenated([self._advance(run) for run in self._history])

    def _design(self, model, sample_rate_hz, **wishes):
        """FilterDesign for a model at a sampling rate."""
        raise NotImplementedError

    def _before(self, values):
        """What happens to the samples before the filters; shape (n, 3) in and out."""
        return values

    def _after(self, values):
        """What happens to the samples after the filters; shape (n, 3) in and out."""
        return values

    def _estimate(self, least):
        """Start at the rate of the first stamps, if there are enough of them.

        Which stamps these are must not depend on the blocks in which they come.
        """
        stamps = np.concatenate([block[1] for block in self._held])
        advancing = np.flatnonzero(np.diff(stamps) > 0)
        if not advancing.size or len(stamps) < least:
            return False
        self._start(estimate_rate(stamps[:max(RATE_SAMPLES, advancing[0] + 2)]))
        return True

    def _start(self, rate):
        self._use(self._design(self._model, rate, **self._wishes))
        self._clock = SampleClock(rate, self.design.warm_up_samples)
        self._last_given = -1
        self._forget()
        self._begin()

    def _use(self, design):
        self.design = design
        if self._clock:
            self._clock.longest_gap = design.warm_up_samples
        origin, unit = self._before(np.zeros((1, 3))), np.eye(3)
        # variance of the samples that the filters get, from that of the input
        self._spread = (self._before(unit) - origin)**2
        noise = self._model.noise_std if self._noise_std is None else self._noise_std
        self._noise_variance = np.broadcast_to(np.square(np.asarray(noise, float)), 3)

    def _begin(self):
        """Nothing is known of the motion before the next sample."""
        self._states = None
        self._since_start = 0
        self._kept = None
        self._waiting_index = np.empty(0, np.int64)
        self._waiting_stamps = np.empty(0, np.int64)

    def _filter(self, index, stamps, values, variance):
        parts = []
        for run in self._clock.sort(index, stamps, values, variance):
            if run.restart:
                lost = int(np.sum(self._waiting_index >= 0))
                given_up = "cut_off" if self._states else "warm_up"
                self._totals[given_up] += lost
                self._begin()
                self._forget()
            self._remember(run)
            parts.append(self._advance(run))
        return _concatenated(parts)

    def _forget(self):
        self._history, self._history_length = collections.deque(), 0

    def _remember(self, run):
        self._history.append(run)
        self._history_length += len(run.index)
        while self._history_length - len(self._history[0].index) >= HISTORY:
            self._history_length -= len(self._history.popleft().index)

    def _advance(self, run):
        """Run the filters over samples that follow the ones before."""
        self._waiting_index = np.r_[self._waiting_index, run.index]
        self._waiting_stamps = np.r_[self._waiting_stamps, run.stamps_ns]
        values = self._before(run.values)
        known = np.where(np.isnan(run.variance), self._noise_variance, run.variance)
        variance = sum(known[:, [axis]] * self._spread[axis] for axis in range(3))
        if self._states is None:
            if self._kept is not None:
                values = np.concatenate([self._kept[0], values])
                variance = np.concatenate([self._kept[1], variance])
            warm_up = self.design.warm_up_samples
            if len(values) <= warm_up:
                self._kept = values, variance
                return _concatenated([])
            self._fill(values[:warm_up], variance[:warm_up])
            values, variance = values[warm_up:], variance[warm_up:]
        return self._give(values, variance)

    def _fill(self, values, variance):
        """Bring the filters into the state that they have when their taps are first full."""
        self._kept = None
        self._states = []
        for axis, design in enumerate(self.design.axes):
            column = values[:, axis]
            # behind a high-pass every steady motion leaves the output at rest
            level = 0.0 if design.band_hz[0] else column.mean()
            state = FilterState(design.filter, level)
            state.process(column)
            head = np.square(design.filter.impulse_head)
            noise = np.r_[np.zeros(design.filter.lead), head], np.array([1.0, 0.0])
            initial = np.zeros(max(len(noise[0]), 2) - 1)
            _, initial = lfilter(*noise, variance[:, axis], zi=initial)
            self._states.append((state, noise, initial, np.mean((column - level)**2)))
        self._since_start = len(values)
        # the oldest of the waiting will have been passed over before the first output
        skipped = len(values) - self.design.delay_samples
        fresh = self._waiting_index[:skipped]
        self._totals["warm_up"] += int(np.sum(fresh > self._last_given))
        self._waiting_index = self._waiting_index[skipped:]
        self._waiting_stamps = self._waiting_stamps[skipped:]

    def _give(self, values, variance):
        count = len(values)
        result, spread = np.empty((count, 3)), np.empty((count, 3))
        since = self._since_start + np.arange(1, count + 1)
        for axis, design in enumerate(self.design.axes):
            state, noise, initial, power = self._states[axis]
            result[:, axis] = state.process(values[:, axis])
            soon, initial = lfilter(*noise, variance[:, axis], zi=initial)
            self._states[axis] = state, noise, initial, power
            later = max(design.noise_gain**2 - noise[0].sum(), 0.0)
            history = power * design.filter.unknown_history(since)**2
            spread[:, axis] = soon + later * variance[:, axis] + history
        self._since_start += count
        index, stamps = self._waiting_index[:count], self._waiting_stamps[:count]
        self._waiting_index = self._waiting_index[count:]
        self._waiting_stamps = self._waiting_stamps[count:]
        given = index > self._last_given
        if given.any():
            self._last_given = int(index[given][-1])
        self._totals["given"] += int(given.sum())
        return Filtered(index[given], stamps[given] - self.design.sensor_delay_ns,
                        self._after(result[given]),
                        np.where(spread[given] > 0, spread[given], np.nan))


def _concatenated(parts):
    if not parts:
        return Filtered(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 3)),
                        np.empty((0, 3)))
    return Filtered(*(np.concatenate([getattr(part, field.name) for part in parts])
                      for field in dataclasses.fields(Filtered)))
