"""What stamps say: the sampling rate, and which samples follow each other.

The stated policy, each case counted:

* The samples are taken as uniform at the sampling rate; stamps scatter around a clock that follows
  them slowly. A stamp off that clock by more than a tenth of an interval counts as ``jitter``.
* A stamp late by `MISSING` intervals or more is a gap. A gap that is shorter than the filter's
  memory is bridged by linear interpolation (``gaps``, ``filled``), with the variance of a random
  walk between its ends; a longer one starts the filter anew (``restarts``).
* The same stamp again is dropped (``duplicates``), and so is a stamp that goes back
  (``stamps_back``); after `PATIENCE` of these in a row the clock itself has been set back, and the
  filter starts anew. A stamp that is `MISSING` intervals early is one sample too many (``early``).
* A sample with a value that is not finite, or beyond `LARGEST` (its filtered value would not be),
  is dropped (``not_finite``) and bridged like a gap.
"""

import dataclasses

import numpy as np

from ..linear_filter import run_filter

RATE_SAMPLES = 100
JITTER = 0.1
MISSING = 0.75
PATIENCE = 10
LARGEST = 1e100
_FOLLOW = 0.1
_SCATTER_MEMORY = 0.01
_CHUNK = 4096
_FOLLOWING = np.array([_FOLLOW]), np.array([1.0, _FOLLOW - 1.0])
_SCATTERING = np.array([_SCATTER_MEMORY]), np.array([1.0, _SCATTER_MEMORY - 1.0])


def estimate_rate(stamps_ns):
    """Sampling rate [Hz] from stamps [ns] that may scatter, repeat or have gaps.

    Returns
    -------
    float or None
        None where fewer than two stamps follow each other.
    """
    steps = np.diff(np.asarray(stamps_ns, np.int64))
    steps = steps[steps > 0].astype(float)
    if not len(steps):
        return None
    interval = np.median(steps)
    counts = np.maximum(np.round(steps / interval), 1)
    # a gap says how often the interval fits, but a long one says it badly
    near = counts <= 5
    return float(1e9 * counts[near].sum() / steps[near].sum())


@dataclasses.dataclass
class Run:
    """Samples that follow each other at the sampling rate, those of bridged gaps included.

    Attributes
    ----------
    index : ndarray of int64, shape (n,)
        Running number of each sample; -1 where it was interpolated.
    stamps_ns : ndarray of int64, shape (n,)
    values, variance : ndarray, shape (n, 3)
    restart : bool
        Whether the run does not continue the one before.
    """

    index: np.ndarray
    stamps_ns: np.ndarray
    values: np.ndarray
    variance: np.ndarray
    restart: bool


class SampleClock:
    """Sorts incoming samples into uniform runs, by the policy of this module.

    Parameters
    ----------
    sampling_rate_hz : float
    longest_gap : int
        Most missing samples [samples] that are bridged.
    """

    def __init__(self, sampling_rate_hz, longest_gap):
        self.interval_ns = 1e9 / sampling_rate_hz
        self.longest_gap = longest_gap
        self.counters = dict.fromkeys(
            ("jitter", "gaps", "filled", "duplicates", "stamps_back", "early", "not_finite",
             "restarts"), 0)
        self._last = None
        self._backward = 0

    def sort(self, index, stamps_ns, values, variance):
        """List of `Run` for the next samples, in blocks of any length."""
        runs = []
        for start in range(0, len(index), _CHUNK):
            part = slice(start, start + _CHUNK)
            self._sort(index[part], stamps_ns[part], values[part], variance[part], runs)
        return _joined(runs)

    def _sort(self, index, stamps, values, variance, runs):
        size = np.abs(values)
        # the rule is quick to see
        finite = None if size.max() < LARGEST else (size < LARGEST).all(axis=1)
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
                    self.counters["not_finite"] += 1
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
                bridge = self._exception(stamps[position], values[position],
                                         finite is None or finite[position])
                if bridge is not None:
                    filled_stamps, filled_values, filled_variance = bridge
                    runs.append(Run(
                        np.r_[np.full(len(filled_stamps), -1), index[one]],
                        np.r_[filled_stamps, stamps[one]], np.r_[filled_values, values[one]],
                        np.r_[filled_variance, variance[one]], self._restarted))
                position += 1

    def _begin(self, stamp, values):
        self._origin, self._count = int(stamp), 0
        self._offset = np.zeros(1)
        self._scatter = np.zeros((1, 3))
        self._last, self._last_values = int(stamp), values
        self._backward = 0

    def _accept(self, stamps, values, finite):
        """Number of leading samples that simply follow; the clock is moved on by these."""
        steps = np.empty_like(stamps)
        np.subtract(stamps[:1], self._last, out=steps[:1])
        np.subtract(stamps[1:], stamps[:-1], out=steps[1:])
        ahead = np.arange(self._count + 1, self._count + 1 + len(stamps))
        # time against a clock that started with the first stamp; its slow mean is the clock's error
        late = (stamps - self._origin) - ahead * self.interval_ns
        mean = run_filter(*_FOLLOWING, late[None], (1.0 - _FOLLOW) * self._offset[None])[0][0]
        late[0] -= self._offset[0]
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
            self._follow(stamps[:accepted], values[:accepted], mean[accepted - 1:accepted])
            self._backward = 0
        return accepted

    def _follow(self, stamps, values, offset):
        increments = np.empty((3, len(values)))
        increments[:, 0] = values[0] - self._last_values
        np.subtract(values[1:].T, values[:-1].T, out=increments[:, 1:])
        increments *= increments
        scatter, _ = run_filter(*_SCATTERING, increments,
                                (1.0 - _SCATTER_MEMORY) * self._scatter.T)
        self._scatter = scatter[:, -1][None]
        self._offset = offset
        self._count += len(stamps)
        self._last, self._last_values = int(stamps[-1]), values[-1]

    def _exception(self, stamp, values, finite):
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
            self.counters["not_finite"] += 1
            return None
        late = (int(stamp) - self._origin) - (self._count + 1) * self.interval_ns
        missing = int(round((late - self._offset[0]) / self.interval_ns))
        if missing < 0:
            self.counters["early"] += 1
            return None
        self._backward = 0
        if missing > self.longest_gap:
            return self._restart(stamp, values)
        self.counters["gaps"] += 1
        self.counters["filled"] += missing
        share = np.arange(1, missing + 1) / (missing + 1)
        bridge = (np.round(self._last + share * step).astype(np.int64),
                  self._last_values + share[:, None] * (values - self._last_values),
                  (share * (1 - share) * (missing + 1))[:, None] * self._scatter)
        self._count += missing + 1
        self._offset = self._offset + _FOLLOW * (late - missing * self.interval_ns - self._offset)
        self._last, self._last_values = int(stamp), values
        return bridge

    def _restart(self, stamp, values):
        self.counters["restarts"] += 1
        self._begin(stamp, values)
        self._restarted = True
        return np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3))


def _joined(runs):
    """Runs that continue each other made one."""
    if len(runs) < 2:
        return runs
    groups = []
    for run in runs:
        if run.restart or not groups:
            groups.append([])
        groups[-1].append(run)
    return [Run(*(np.concatenate([getattr(run, name) for run in group])
                  for name in ("index", "stamps_ns", "values", "variance")), group[0].restart)
            for group in groups]
