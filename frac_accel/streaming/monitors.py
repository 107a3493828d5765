"""Axes that no longer measure: dead, stuck, saturated, held, or faster than the sensor can be.

What an axis says is looked at in frames of `FRAME_S`. A verdict holds from the end of the frame
that makes it, so what is decided depends on the samples and their order alone. The rules:

* *still*: an axis whose samples stay within a thousandth of the noise's deviation (or are all the
  same), or within a millionth of what another axis moves. Samples of a coarse quantiser are the
  same for seconds at rest, so it counts as *stuck* (*dead* at exactly zero) only after
  `STUCK_S` while another axis moves by `MOVES` of its own smallest steps or more; after `COARSE_S`
  where the axis is used to repeating itself; after `UNKNOWN_S` where it has not had the time to
  show whether it is, if another one that moves is not; after `LONG_S` if nothing moves at all;
* *not connected*: dead, and never anything but zero since the start, as an axis that a sensor
  of one or two axes does not have;
* *saturated*: more than half of a frame's samples at the limits of the model, twice in a row;
* *held*: more than `REPEATED` of the samples repeat the one before while the others jump by
  `JUMPS` of its smallest steps: the messages come faster than the sensor samples;
* *rate of change*: a step beyond a stated limit.

A verdict is withdrawn `CLEAR_FRAMES` after the last frame that made it, when the filter has seen
good samples again.
"""

import math
from typing import NamedTuple

import numpy as np

# Length of a frame [s] and its fewest samples; times [s] at rest until an axis is stuck; smallest
# steps that the others move meanwhile, and that tell held samples; share of repetitions in a frame
# of these, and how many frames they take; frames until a verdict is withdrawn; shares of the noise
# and of the others' motion that are stillness.
FRAME_S, FEWEST = 0.1, 10
STUCK_S, UNKNOWN_S, COARSE_S, LONG_S = 0.3, 0.8, 5.0, 60.0
MOVES, JUMPS = 8.0, 4.0
REPEATED, HELD_FRAMES = 0.3, 5
CLEAR_FRAMES = 10
_NOISE_SHARE, _OTHER_SHARE = 1e-3, 1e-6
# Share of repetitions from which on an axis is used to them, how slowly that is learnt, and by how
# many frames it is believed at the start: two seconds tell that it is not.
_USED_TO, _LEARNS, _PRIOR = 0.1, 0.05, 3
NOT_CONNECTED = "not connected"
FAULTS = ("", "dead", "stuck", "saturated", "held", "too fast", NOT_CONNECTED)


class AxisMonitors:
    """Watches the samples of three axes, in blocks of any length.

    Parameters
    ----------
    sampling_rate_hz : float
    limits : tuple of ndarray, shape (3,) each
        Lowest and highest value that each axis can say.
    noise_std : ndarray, shape (3,)
        0 where it is not known.
    largest_rate : float
        Largest rate of change [output units/s]; 0: any.

    Attributes
    ----------
    faults : tuple of str
        What is wrong with each axis now, of `FAULTS`.
    """

    def __init__(self, sampling_rate_hz, limits, noise_std, largest_rate=0.0):
        self._length = max(FEWEST, int(round(FRAME_S * sampling_rate_hz)))
        self._frame_s = self._length / sampling_rate_hz
        self.set_limits(limits, noise_std)
        self._largest_step = largest_rate / sampling_rate_hz or np.inf
        self._part, self._count = [], 0
        self._last = None
        self._axes = [_Axis(self._frame_s) for _ in range(3)]
        # from which sample on each axis has had which fault
        self.changes = [(-1, (0, 0, 0))]

    @property
    def faults(self):
        return tuple(FAULTS[code] for code in self.changes[-1][1])

    def set_limits(self, limits, noise_std):
        """Go on with what another model says."""
        self._limits = list(zip(*(limit.tolist() for limit in limits)))
        self._noise_std = noise_std.tolist()

    def add(self, index, values):
        """Look at the next samples: their running numbers and values, shape (n,) and (n, 3)."""
        start = 0
        while self._count + len(values) - start >= self._length:
            stop = start + self._length - self._count
            self._part.append(values[start:stop])
            self._judge(np.concatenate(self._part), int(index[stop - 1]))
            self._part, self._count = [], 0
            start = stop
        if start < len(values):
            self._part.append(values[start:])
            self._count += len(values) - start

    def codes(self, index):
        """Place in `FAULTS` of each axis's fault when these samples came, shape (n, 3); or None."""
        if len(self.changes) == 1 and not any(self.changes[0][1]):
            return None
        at = np.array([change[0] for change in self.changes])
        codes = np.array([change[1] for change in self.changes])
        result = codes[np.maximum(np.searchsorted(at, index, "left") - 1, 0)]
        # what is older is not asked for again
        del self.changes[:max(int(np.searchsorted(at, index[0], "left")) - 1, 0)]
        return result

    def _judge(self, frame, end):
        """Verdict on a whole frame, which ends with the sample of this running number."""
        # axis by axis in memory, as numpy is ten times slower along the other way
        frame = np.ascontiguousarray(frame.T)
        lowest, highest = frame.min(axis=1).tolist(), frame.max(axis=1).tolist()
        if not all(map(math.isfinite, (*lowest, *highest))):
            frame = frame[:, np.isfinite(frame).all(axis=0)]
            if frame.shape[1] < 2:
                return
            lowest, highest = frame.min(axis=1).tolist(), frame.max(axis=1).tolist()
        steps = np.empty_like(frame)
        np.subtract(frame[:, 1:], frame[:, :-1], out=steps[:, 1:])
        steps[:, 0] = 0.0 if self._last is None else frame[:, 0] - self._last
        np.abs(steps, out=steps)
        self._last = frame[:, -1]
        seen = [_seen(*each) for each in zip(frame, steps, lowest, highest)]
        # numbers of single axes from here on: arrays of three cost more than what is done to them
        moving = [axis.moves(own) for axis, own in zip(self._axes, seen)]
        fine = [moves and own.repeated <= _USED_TO for moves, own in zip(moving, seen)]
        for i, (axis, own) in enumerate(zip(self._axes, seen)):
            tolerance = max(_NOISE_SHARE * self._noise_std[i],
                            _OTHER_SHARE * max(seen[i - 1].span, seen[i - 2].span))
            stuck = axis.is_stuck(own, tolerance, moving[i - 1] or moving[i - 2],
                                  fine[i - 1] or fine[i - 2])
            axis.decide(own, stuck, tolerance, self._limits[i], self._largest_step)
        code = tuple(axis.code for axis in self._axes)
        if code != self.changes[-1][1]:
            self.changes.append((end, code))


class _Seen(NamedTuple):
    """A frame of one axis: samples, steps and what is told by them."""

    values: np.ndarray
    steps: np.ndarray
    lowest: float
    highest: float
    span: float
    repeated: float
    smallest_step: float


def _seen(values, steps, lowest, highest):
    smallest, repeated = float(steps.min()), 0.0
    if not smallest:
        repeated = (len(steps) - np.count_nonzero(steps)) / len(steps)
        smallest = float(np.where(steps > 0, steps, np.inf).min())
    return _Seen(values, steps, lowest, highest, highest - lowest, repeated, smallest)


class _Axis:
    """What one axis has shown so far.

    Attributes
    ----------
    code : int
        Place of its fault in `FAULTS`.
    """

    def __init__(self, frame_s):
        self._frame_s = frame_s
        self._only_zero = True
        self._lattice = math.inf
        # coarse until it has shown that it is not, in frames in which it was not still
        self._repeats, self._frames = 1.0, 0
        # repetitions in these frames, all together and the most in one
        self._repeated = self._most_repeated = 0.0
        self._still_s = self._moved_s = self._fine_s = 0.0
        self._still_at = None
        self._at_limit = self._held = 0
        self.code, self._since = 0, CLEAR_FRAMES

    def moves(self, own):
        """Whether it moves by some of its own smallest steps, this frame's included."""
        self._lattice = min(self._lattice, own.smallest_step)
        return own.span >= MOVES * self._lattice

    def is_stuck(self, own, tolerance, others_move, others_fine):
        """Whether it has been at rest for too long, beside others that move, perhaps finely."""
        first, rests = float(own.values[0]), own.span <= tolerance
        if not rests or (self._still_at is not None and abs(first - self._still_at) > tolerance):
            # it moves, or is at rest elsewhere
            self._still_at = first if rests else None
            self._still_s = self._moved_s = self._fine_s = 0.0
            self._learn(own.repeated)
            return False
        if self._still_at is None:
            self._still_at = first
        self._still_s += self._frame_s
        self._moved_s += self._frame_s * others_move
        self._fine_s += self._frame_s * others_fine
        # the frame in which an axis dies is half still
        unknown = self._repeated - self._most_repeated <= _USED_TO * self._frames
        needed_s = COARSE_S if self._repeats > _USED_TO else STUCK_S
        return (self._moved_s >= needed_s * (1 - 1e-9) or self._still_s >= LONG_S
                or unknown and self._fine_s >= UNKNOWN_S * (1 - 1e-9))

    def _learn(self, repeated):
        """Share of repetitions that it is used to; a still axis says nothing of that."""
        learns = max(_LEARNS, 1 / (self._frames + _PRIOR))
        self._repeats += learns * (repeated - self._repeats)
        self._frames += 1
        self._repeated += repeated
        self._most_repeated = max(self._most_repeated, repeated)

    def decide(self, own, stuck, tolerance, limits, largest_step):
        """Find the fault of this frame; one that is no longer there is withdrawn after a while."""
        self._only_zero = self._only_zero and own.lowest == 0 == own.highest
        found = ""
        if stuck:
            found = "dead" if abs(own.values[-1]) <= tolerance else "stuck"
            found = NOT_CONNECTED if found == "dead" and self._only_zero else found
        self._at_limit = self._at_limit + 1 if _is_at(own, *limits) else 0
        self._held = self._held + 1 if self._is_held(own) else 0
        if self._at_limit >= 2:
            found = "saturated"
        elif self._held >= HELD_FRAMES and not found:
            found = "held"
        elif not found and own.steps.max() > largest_step:
            found = "too fast"
        self._since = 0 if found else self._since + 1
        if found or self._since >= CLEAR_FRAMES:
            self.code = FAULTS.index(found)

    def _is_held(self, own):
        if own.repeated <= REPEATED or not own.span > MOVES * self._lattice:
            return False
        jumps = float(own.steps.sum()) / max(np.count_nonzero(own.steps), 1)
        return jumps > JUMPS * self._lattice


def _is_at(own, low, high):
    """Whether more than half of a frame's samples are at the limits."""
    if low < own.lowest and own.highest < high:
        return False
    return np.count_nonzero((own.values <= low) | (own.values >= high)) > 0.5 * len(own.values)
