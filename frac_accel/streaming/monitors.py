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
        self._limits, self._noise_std = limits, noise_std
        self._largest_step = largest_rate / sampling_rate_hz or np.inf
        self._part, self._count = [], 0
        self._last = None
        self._only_zero = np.ones(3, bool)
        self._lattice = np.full(3, np.inf)
        # coarse until it has shown that it is not, in frames in which it was not still
        self._repeats, self._frames = np.ones(3), np.zeros(3)
        # repetitions in these frames, all together and the most in one
        self._repeated, self._most_repeated = np.zeros(3), np.zeros(3)
        self._still_s, self._moved_s, self._fine_s = np.zeros(3), np.zeros(3), np.zeros(3)
        self._still_at = np.full(3, np.nan)
        self._at_limit, self._held = np.zeros(3, int), np.zeros(3, int)
        self._code, self._since = np.zeros(3, int), np.full(3, CLEAR_FRAMES)
        # from which sample on each axis has had which fault
        self.changes = [(-1, (0, 0, 0))]

    @property
    def faults(self):
        return tuple(FAULTS[code] for code in self.changes[-1][1])

    def set_limits(self, limits, noise_std):
        """Go on with what another model says."""
        self._limits, self._noise_std = limits, noise_std

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
        frame = frame[np.isfinite(frame).all(axis=1)]
        if len(frame) < 2:
            return
        before = frame[:1] if self._last is None else self._last[None]
        # axis by axis in memory, as numpy is ten times slower along the other way
        frame = np.ascontiguousarray(np.concatenate([before, frame]).T)
        steps = np.abs(np.diff(frame, axis=1))
        frame = frame[:, 1:]
        self._last = frame[:, -1]
        moved = np.where(steps > 0, steps, np.inf).min(axis=1)
        self._lattice = np.minimum(self._lattice, moved)
        span = np.ptp(frame, axis=1)
        repeated = np.mean(steps == 0, axis=1)
        found = np.zeros(3, int)
        self._find_still(frame, span, repeated, found)
        self._only_zero &= (frame == 0).all(axis=1)
        found[(found == 1) & self._only_zero] = FAULTS.index(NOT_CONNECTED)
        low, high = (limit[:, None] for limit in self._limits)
        at_limit = np.mean((frame <= low) | (frame >= high), axis=1) > 0.5
        self._at_limit = np.where(at_limit, self._at_limit + 1, 0)
        found[self._at_limit >= 2] = 3
        with np.errstate(invalid="ignore"):
            jumps = np.divide(steps.sum(axis=1), np.sum(steps > 0, axis=1),
                              out=np.zeros(3), where=(steps > 0).any(axis=1))
            held = ((repeated > REPEATED) & (jumps > JUMPS * self._lattice)
                    & (span > MOVES * self._lattice))
        self._held = np.where(held, self._held + 1, 0)
        found[(self._held >= HELD_FRAMES) & (found == 0)] = 4
        found[(steps > self._largest_step).any(axis=1) & (found == 0)] = 5
        self._since = np.where(found > 0, 0, self._since + 1)
        self._code = np.where(found > 0, found,
                              np.where(self._since >= CLEAR_FRAMES, 0, self._code))
        code = tuple(int(each) for each in self._code)
        if code != self.changes[-1][1]:
            self.changes.append((end, code))

    def _find_still(self, frame, span, repeated, found):
        others = np.array([max(span[i - 1], span[i - 2]) for i in range(3)])
        tolerance = np.maximum(_NOISE_SHARE * self._noise_std, _OTHER_SHARE * others)
        same = np.abs(frame[:, 0] - self._still_at) <= tolerance
        still = (span <= tolerance) & (same | np.isnan(self._still_at))
        self._still_at = np.where(span <= tolerance, np.where(still, self._still_at, np.nan),
                                  np.nan)
        self._still_at = np.where(np.isnan(self._still_at) & (span <= tolerance), frame[:, 0],
                                  self._still_at)
        self._still_s = np.where(still, self._still_s + self._frame_s, 0.0)
        moving = span >= MOVES * self._lattice
        fine = moving & (repeated <= _USED_TO)
        others_move, others_fine = (np.array([axes[i - 1] or axes[i - 2] for i in range(3)])
                                    for axes in (moving, fine))
        self._moved_s = np.where(still, self._moved_s + self._frame_s * others_move, 0.0)
        self._fine_s = np.where(still, self._fine_s + self._frame_s * others_fine, 0.0)
        used_to = self._repeats > _USED_TO
        # the frame in which an axis dies is half still
        unknown = self._repeated - self._most_repeated <= _USED_TO * self._frames
        # a still axis says nothing of what it is used to
        learns = np.maximum(_LEARNS, 1 / (self._frames + _PRIOR))
        self._repeats = np.where(still, self._repeats,
                                 self._repeats + learns * (repeated - self._repeats))
        self._frames += ~still
        self._repeated += np.where(still, 0.0, repeated)
        self._most_repeated = np.where(still, self._most_repeated,
                                       np.maximum(self._most_repeated, repeated))
        needed = np.where(used_to, COARSE_S, STUCK_S) * (1 - 1e-9)
        stuck = ((self._moved_s >= needed) | (self._still_s >= LONG_S)
                 | unknown & (self._fine_s >= UNKNOWN_S * (1 - 1e-9)))
        found[stuck] = np.where(np.abs(frame[:, -1]) <= tolerance, 1, 2)[stuck]
