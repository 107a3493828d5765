"""What stamps say: the sampling rate, and which samples follow each other.

The stated policy, each case counted:

* The samples are taken as uniform at the sampling rate; stamps scatter around a clock that follows
  them slowly. A stamp off that clock by more than a tenth of an interval counts as ``jitter``.
* A stamp late by `MISSING` intervals or more is a gap. A gap that is shorter than the filter's
  memory is bridged by linear interpolation (``gaps``, ``filled``), with the errors that `bridging`
  finds for it; a longer one starts the filter anew (``restarts``), and so does every gap while more
  than `MOST_LOST` of the last `LOSS_WINDOW` samples are missing: nothing is given out then.
* Samples that come in batches with one stamp get instants of their own before all this (`batches`).
* The same stamp again is dropped otherwise (``duplicates``), and so is a stamp that goes back
  (``stamps_back``); after `PATIENCE` of these in a row the clock itself has been set back, and the
  filter starts anew. A stamp that is `MISSING` intervals early is one sample too many (``early``).
* A sample with a value that is not finite (``not_finite``) or that cannot be true (``implausible``,
  see `plausibility`) is dropped and bridged like a gap.
"""

import collections
import dataclasses

import numpy as np

from ..signals.linear_filter import run_filter
from ..signals.sample_rate import interval_of
from .bridging import BridgeErrors

# Stamps that tell the rate; intervals by which a stamp is off the clock, or a sample is missing;
# stamps in a row until a clock has been set back; largest value that a sample may have.
RATE_SAMPLES = 100
JITTER = 0.1
MISSING = 0.75
PATIENCE = 10
LARGEST = 1e100
# Share of missing samples up to which the stated variance holds, with room for chance (50 % lost).
MOST_LOST, LOSS_WINDOW = 0.58, 1000
# Scatter from which on stamps say nothing of whole intervals, if the steps differ so much, too.
_NOT_WHOLE, _UNEVEN = 0.2, 0.4
_FOLLOW = 0.1
_CHUNK = 4096
_FOLLOWING = np.array([_FOLLOW]), np.array([1.0, _FOLLOW - 1.0])


def _followed(late, offset):
    """Slow mean of how late stamps are, (n,), after one that was `offset`."""
    return run_filter(*_FOLLOWING, late[None], np.array([[(1.0 - _FOLLOW) * offset]]))[0][0]


def _followed_by_one(late, offset):
    """The same of a single stamp, as plain numbers."""
    return (1.0 - _FOLLOW) * offset + _FOLLOW * late


# Where the compiled filter rounds once for a product and a sum, as it may on some processors, plain
# numbers would differ from it in the last bit.
_ROUNDS_ALIKE = all(_followed(np.array([k / 7]), 1 / k)[0] == _followed_by_one(k / 7, 1 / k)
                    for k in range(1, 100))


def tells_rate(stamps_ns):
    """Whether stamps [ns] tell the sampling rate: not where most samples are lost between them."""
    steps = np.diff(np.asarray(stamps_ns, np.int64))
    steps = steps[steps > 0].astype(float)
    if len(steps) < 2:
        return bool(len(steps))
    interval, scatter = interval_of(steps)
    counts = np.maximum(np.round(steps / interval), 1)
    if scatter > _NOT_WHOLE:
        # no interval fits: clocks that scatter around one do so more evenly
        usual = steps[steps <= 5 * np.median(steps)]
        return bool(np.std(usual) < _UNEVEN * np.mean(usual))
    # one pause is no loss
    return bool(counts[counts <= 5 * np.median(counts)].mean() * (1 - MOST_LOST) <= 1)


@dataclasses.dataclass
class Run:
    """Samples that follow each other at the sampling rate, those of bridged gaps included.

    Attributes
    ----------
    index : ndarray of int64, shape (n,)
        Running number of each sample; -1 where it was interpolated.
    stamps_ns : ndarray of int64, shape (n,)
    values, variance : ndarray, shape (n, 3)
        The variance of interpolated samples is 0: their errors are in `bridges`.
    restart : bool
        Whether the run does not continue the one before.
    bridges : list of (int, ndarray of shape (m, 3, MEMBERS))
        First sample of each gap, and the ensemble of its errors.
    """

    index: np.ndarray
    stamps_ns: np.ndarray
    values: np.ndarray
    variance: np.ndarray
    restart: bool
    bridges: list = dataclasses.field(default_factory=list)


class SampleClock:
    """Sorts incoming samples into uniform runs, by the policy of this module.

    Parameters
    ----------
    sampling_rate_hz : float
    longest_gap : int
        Most missing samples [samples] that are bridged.

    Attributes
    ----------
    noise_variance : ndarray, shape (3,)
        Of samples that come without one; 0 where it is not known.
    """

    def __init__(self, sampling_rate_hz, longest_gap):
        self.interval_ns = 1e9 / sampling_rate_hz
        self.noise_variance = np.zeros(3)
        self.longest_gap = longest_gap
        # where each of the last gaps ended, and how many samples were missing
        self._losses, self._lost, self._place = collections.deque(), 0, 0
        self.counters = dict.fromkeys(
            ("jitter", "gaps", "filled", "duplicates", "stamps_back", "early", "not_finite",
             "implausible", "restarts"), 0)
        self._last = self._anew_at = None
        self._backward = 0

    def begin_anew(self, index):
        """Let the sample with this running number follow no other."""
        self._anew_at = index

    @property
    def longest_gap(self):
        """Most missing samples that are bridged."""
        return self._longest_gap

    @longest_gap.setter
    def longest_gap(self, count):
        self._longest_gap = count
        self._errors = BridgeErrors(count)

    def sort(self, index, stamps_ns, values, variance, usable=None, finite=None):
        """List of `Run` for the next samples, in blocks of any length.

        usable, finite : ndarray of bool, shape (n,), or None
            Samples that are not usable are dropped, as not finite or implausible; None: all are.
        """
        runs, start = [], 0
        while start < len(index):
            stop = start + _CHUNK
            if self._anew_at is not None:
                stop = min(stop, start + int(np.searchsorted(index[start:], self._anew_at)))
                if stop == start:
                    self.counters["restarts"] += self._last is not None
                    self._last = self._anew_at = None
                    continue
            part = slice(start, stop)
            self._sort(index[part], stamps_ns[part], values[part], variance[part],
                       None if usable is None else usable[part],
                       None if finite is None else finite[part], runs)
            start = stop
        return joined(runs)

    def _drop(self, is_finite):
        self.counters["implausible" if is_finite else "not_finite"] += 1

    def _sort(self, index, stamps, values, variance, usable, is_number, runs):
        finite = None if usable is None or usable.all() else usable
        position = 0
        while position < len(index):
            if self._last is None:
                accepted = 1 if finite is None or finite[position] else 0
                if accepted:
                    self._begin(stamps[position], values[position])
                    runs.append(Run(index[position:position + 1], stamps[position:position + 1],
                                    values[position:position + 1],
                                    variance[position:position + 1], True))
                else:
                    self._drop(is_number is None or is_number[position])
                position += 1
                continue
            accepted = self._accept(stamps[position:], values[position:],
                                    None if finite is None else finite[position:])
            if accepted:
                part = slice(position, position + accepted)
                runs.append(Run(index[part], stamps[part], values[part], variance[part], False))
                position += accepted
            if position < len(index):
                one = slice(position, position + 1)
                bridge = self._exception(stamps[position], values[position], variance[position],
                                         finite is None or finite[position],
                                         is_number is None or is_number[position])
                if bridge is not None:
                    filled_stamps, filled_values, members = bridge
                    count = len(filled_stamps)
                    runs.append(Run(
                        np.r_[np.full(count, -1), index[one]],
                        np.r_[filled_stamps, stamps[one]], np.r_[filled_values, values[one]],
                        np.r_[np.zeros((count, 3)), variance[one]], self._restarted,
                        [(0, members)] if count else []))
                position += 1

    def _begin(self, stamp, values):
        self._origin, self._count = int(stamp), 0
        self._offset = 0.0
        self._last, self._last_values = int(stamp), values
        self._backward = 0
        self._place += 1
        self._errors.forget()
        self._errors.add(values[None])

    def _accept(self, stamps, values, finite):
        """Number of leading samples that simply follow; the clock is moved on by these."""
        if len(stamps) == 1 and _ROUNDS_ALIKE:
            return int((finite is None or finite[0]) and self._accept_one(stamps, values))
        steps = np.empty_like(stamps)
        np.subtract(stamps[:1], self._last, out=steps[:1])
        np.subtract(stamps[1:], stamps[:-1], out=steps[1:])
        ahead = np.arange(self._count + 1, self._count + 1 + len(stamps))
        # time against a clock that started with the first stamp; its slow mean is the clock's error
        late = (stamps - self._origin) - ahead * self.interval_ns
        mean = _followed(late, self._offset)
        late[0] -= self._offset
        late[1:] -= mean[:-1]
        error = np.abs(late / self.interval_ns)
        largest = error.max()
        if finite is None and largest < MISSING and steps.min() > 0:
            accepted = len(stamps)
        else:
            plain = (steps > 0) & (error < MISSING) & (True if finite is None else finite)
            accepted = len(plain) if plain.all() else int(np.argmin(plain))
        if accepted:
            if largest > JITTER:
                self.counters["jitter"] += int(np.count_nonzero(error[:accepted] > JITTER))
            self._follow(stamps[:accepted], values[:accepted], float(mean[accepted - 1]))
        return accepted

    def _accept_one(self, stamps, values):
        """`_accept` for a single sample, without arrays."""
        stamp = int(stamps[0])
        late = (stamp - self._origin) - (self._count + 1) * self.interval_ns
        error = abs((late - self._offset) / self.interval_ns)
        if stamp <= self._last or not error < MISSING:
            return False
        self.counters["jitter"] += error > JITTER
        self._follow(stamps, values, _followed_by_one(late, self._offset))
        return True

    def _follow(self, stamps, values, offset):
        self._errors.add(values)
        self._offset, self._backward = offset, 0
        self._count += len(stamps)
        self._place += len(stamps)
        self._last, self._last_values = int(stamps[-1]), values[-1]

    def _exception(self, stamp, values, variance, finite, is_number):
        """Deal with one sample that does not simply follow; the bridge to it, or None: dropped."""
        self._restarted = False
        step = int(stamp) - self._last
        if step <= 0:
            self.counters["duplicates" if step == 0 else "stamps_back"] += 1
            self._backward += step < 0
            if self._backward > PATIENCE and finite:
                self.counters["stamps_back"] -= 1
                return self._restart(stamp, values)
            return None
        if not finite:
            self._drop(is_number)
            return None
        late = (int(stamp) - self._origin) - (self._count + 1) * self.interval_ns
        missing = int(round((late - self._offset) / self.interval_ns))
        if missing < 0:
            self.counters["early"] += 1
            return None
        self._backward = 0
        if missing > self.longest_gap or self._too_many_lost(missing):
            return self._restart(stamp, values)
        self.counters["gaps"] += 1
        self.counters["filled"] += missing
        share = np.arange(1, missing + 1) / (missing + 1)
        change = values - self._last_values
        noise = np.where(np.isnan(variance), self.noise_variance, variance)
        bridge = (np.round(self._last + share * step).astype(np.int64),
                  self._last_values + share[:, None] * change,
                  self._errors.draw(missing, change, noise) if missing else None)
        self._errors.add(np.concatenate([np.full((missing, 3), np.nan), values[None]]))
        self._count += missing + 1
        self._place += missing + 1
        self._offset = self._offset + _FOLLOW * (late - missing * self.interval_ns - self._offset)
        self._last, self._last_values = int(stamp), values
        return bridge

    def _too_many_lost(self, missing):
        """Whether most samples are missing from the last window, this gap included."""
        self._losses.append((self._place + missing, missing))
        self._lost += missing
        window = max(LOSS_WINDOW, 4 * self._longest_gap)
        while self._losses[0][0] <= self._place + missing - window:
            self._lost -= self._losses.popleft()[1]
        if self._lost <= MOST_LOST * window:
            return False
        self._place += missing
        return True

    def _restart(self, stamp, values):
        self.counters["restarts"] += 1
        self._begin(stamp, values)
        self._restarted = True
        return np.empty(0, np.int64), np.empty((0, 3)), None


def joined(runs):
    """Runs that continue each other made one."""
    if len(runs) < 2:
        return runs
    groups = []
    for run in runs:
        if run.restart or not groups:
            groups.append([])
        groups[-1].append(run)
    return [_one(group) for group in groups]


def _one(group):
    starts = np.cumsum([0, *(len(run.index) for run in group)])
    return Run(*(np.concatenate([getattr(run, name) for run in group])
                 for name in ("index", "stamps_ns", "values", "variance")), group[0].restart,
               [(int(start) + at, members) for start, run in zip(starts, group)
                for at, members in run.bridges])
