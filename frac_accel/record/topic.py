"""What the samples of one topic say by themselves: clock, lattice of values, limits, faults."""

import dataclasses
import functools

import numpy as np

from ..errors import FracAccelError
from ..shown import several
from .clipping import at_limits, certain, pile_up
from .clock import Clock, require_span, usable
from .lattice import lattice_step, stuck_bit

# Samples that make a topic.
_FEWEST = 32
# Scatter of the stamps [sampling intervals] below which it counts as none.
_JITTER = 2e-4
# Times the scatter that rounding to the stamps' unit makes up to which it is made by that.
_BY_ROUNDING = 1.1
# A gap of both topics: half an interval at its ends, which may be jitter; samples that the other
# one would have in it, at least, to tell; share of them that it may have. Share of the rate from
# which a single sample tells.
_EDGE, _TELLS, _EMPTY, _AS_FAST = 0.5, 2.5, 0.1, 0.9
# Time [s] within which the stamps of two topics jump together, and share by which their jumps may
# differ.
_TOGETHER_S, _SAME_JUMP = 1.0, 0.1


@dataclasses.dataclass(frozen=True)
class Integrity:
    """Findings about the data of one axis.

    Attributes
    ----------
    samples : int
        Usable samples.
    missing : int
        Instants of the topic's clock without a sample, while the other topic has some.
    duplicates, stamps_back, not_finite : int
        Samples that were left out for it.
    jitter_rms_s : float
        Scatter of the stamps about a uniform clock.
    step : float or None
        Distance of the values' lattice [output units].
    lower, upper : float or None
        Limits at which samples pile up.
    words : list of str
    rounds_stamps : bool
        Whether the stamps scatter by no more than their own rounding makes.
    reference_noise : budget.reference_noise.ReferenceNoise or None
        Of the other topic, where the two together show it.
    jump : clock.Jump or None
        Of the stamps, which has been undone.
    """

    samples: int
    missing: int
    duplicates: int
    stamps_back: int
    not_finite: int
    jitter_rms_s: float
    step: float | None
    lower: float | None
    upper: float | None
    words: list
    rounds_stamps: bool = False
    reference_noise: object = None
    jump: object = None

    @property
    def dropped_fraction(self):
        """Share of the instants without a sample."""
        return self.missing / (self.samples + self.missing)


class Topic:
    """Usable samples of one topic; what is found of them is found once.

    Parameters
    ----------
    samples : Samples
    name : str
        What they are, for messages.

    Attributes
    ----------
    stamps_ns : ndarray of int64, shape (n,)
        Ascending.
    values : ndarray, shape (n, 3)
        Finite.
    index : ndarray of int, shape (n,), or None
        Their places among all samples; None where all are usable.
    duplicates, stamps_back, not_finite : int
        Numbers of the others.
    is_moved : bool
        Whether the values are no longer those that were published, but those of other instants.

    Raises
    ------
    FracAccelError
        If fewer than 32 samples are usable, or they are spread too far.
    """

    def __init__(self, samples, name, fewest=_FEWEST):
        good = usable(samples)
        self.name = name
        self.index = None if good.all() else np.flatnonzero(good)
        self.stamps_ns, self.values = (values if self.index is None else values[self.index]
                                       for values in (samples.stamps_ns, samples.values))
        if len(self) < fewest:
            raise FracAccelError(f"{name}: {len(self)} usable sample(s), expected at least "
                                 f"{fewest} whose stamps advance and whose values are finite"
                                 + _jump(samples.stamps_ns))
        require_span(self.stamps_ns, name)
        self._useless = np.empty(0, np.int64)
        self.duplicates = self.stamps_back = self.not_finite = 0
        if self.index is not None:
            finite = np.isfinite(samples.values).all(axis=1)
            self._useless = samples.stamps_ns[~finite]
            self.not_finite = len(self._useless)
            self.duplicates = int(np.sum(np.diff(samples.stamps_ns[finite]) == 0)
                                  - np.sum(np.diff(self.stamps_ns) == 0))
            self.stamps_back = max(len(good) - len(self) - self.duplicates - self.not_finite, 0)
        self._found, self.is_moved = {}, False

    def __len__(self):
        return len(self.stamps_ns)

    @functools.cached_property
    def clock(self):
        """The `Clock` behind its stamps."""
        return Clock.of(self.stamps_ns)

    @property
    def scatters(self):
        """Whether its stamps scatter about uniform instants by more than clocks do."""
        return self.clock.scatter_s * self.clock.rate_hz > _JITTER

    @functools.cached_property
    def rounded_to_s(self):
        """Unit of the stamps [s] where their scatter is no more than rounding to it makes, or 0."""
        unit = int(np.gcd.reduce(np.diff(self.stamps_ns))) * 1e-9
        return unit if self.clock.scatter_s < _BY_ROUNDING * unit / np.sqrt(12) else 0.0

    def shift(self, seconds):
        """Move all stamps; what has been found of them holds as it is."""
        self.stamps_ns = self.stamps_ns + round(seconds * 1e9)
        self._useless = self._useless + round(seconds * 1e9)

    def move(self, values, late_s):
        """Have the values, shape (n, 3), of instants so much earlier.

        Lattice and limits stay those of what was published, and what was at a limit stays there.
        """
        for column in range(3):
            published, (lower, upper) = self.values[:, column], self.limits(column)
            for limit in (lower, upper):
                if limit is not None:
                    values[published == limit, column] = limit
        self.clock = dataclasses.replace(self.clock, scatter_s=0.0,
                                         start_s=-self.clock.slot[0] / self.clock.rate_hz)
        self.stamps_ns = self.stamps_ns - np.round(1e9 * late_s).astype(np.int64)
        self.values, self.is_moved = values, True

    @functools.cached_property
    def missing(self):
        """Number of instants without a sample; a message whose value is no number came."""
        slot = self.clock.slot
        if not len(slot):
            return 0
        useless = np.round((self._useless - self.stamps_ns[0]) * 1e-9 * self.clock.rate_hz)
        useless = useless[(useless > slot[0]) & (useless < slot[-1])]
        here = len(np.union1d(slot, useless)) if len(useless) else \
            1 + int(np.count_nonzero(np.diff(slot)))
        return int(slot[-1] - slot[0] + 1 - here)

    @property
    def places_missing(self):
        """Number of places at which instants have no sample."""
        return int(np.count_nonzero(np.diff(self.clock.slot) > 1))

    def step(self, column):
        """Step of the lattice that one axis' values lie on, or None."""
        return self._once("step", column, lambda: lattice_step(self.values[:, column]))

    def limits(self, column):
        """Lower and upper limit at which one axis' samples pile up beyond doubt, or None."""
        def find():
            values = self.values[:, column]
            step = self.step(column)
            low, high = (certain(pile_up(side * values), step) for side in (-1, 1))
            return None if low is None else -low, high
        return self._once("limits", column, find)

    def paused_with(self, other):
        """How many of the instants without a sample lie in gaps in which the other topic has none
        either: the recording paused."""
        slot = self.clock.slot
        gaps = np.flatnonzero(np.diff(slot) > 1)
        if not len(gaps):
            return 0
        edge_ns = _EDGE * 1e9 / self.clock.rate_hz
        begin, end = self.stamps_ns[gaps] + edge_ns, self.stamps_ns[gaps + 1] - edge_ns
        first, last = (np.searchsorted(other.stamps_ns, instants) for instants in (begin, end))
        expected = (end - begin) * 1e-9 * other.clock.rate_hz
        # the other one has samples together with those before and after the gap, and none between
        near = np.r_[-np.inf, other.stamps_ns, np.inf]
        together = (first == last) & (other.clock.rate_hz > _AS_FAST * self.clock.rate_hz) \
            & (begin - near[first] < 2 * edge_ns) & (near[last + 1] - end < 2 * edge_ns)
        empty = together | (last - first < _EMPTY * expected) & (expected > _TELLS)
        return int(np.sum(np.diff(slot)[gaps][empty] - 1))

    @property
    def jump_words(self):
        """Words on a jump of its stamps that has been undone."""
        jump = self.clock.jump
        return (f"stamps jump by {1e3 * jump.size_s:.4g} ms at {jump.at_s:.6g} s while the samples "
                "go on evenly: their clock was set")

    def jumps_with(self, other):
        """Whether the stamps of another topic jump as this one's do: one clock has stamped both."""
        jumps = self.clock.jump, other.clock.jump
        if None in jumps:
            return False
        apart_s = 1e-9 * int(self.stamps_ns[0] - other.stamps_ns[0]) \
            + jumps[0].at_s - jumps[1].at_s
        return abs(apart_s) < _TOGETHER_S + abs(jumps[0].size_s) \
            and abs(jumps[0].size_s - jumps[1].size_s) < _SAME_JUMP * abs(jumps[0].size_s)

    def integrity(self, column, own_instants=True, other=None):
        """`Integrity` of one axis; of values on other instants, what still holds of them; of what
        is missing, what the `other` topic has."""
        clock = self.clock
        jitter = clock.scatter_s if self.scatters else 0.0
        step, (lower, upper) = self.step(column), self.limits(column)
        paused = self.paused_with(other) if other is not None else 0
        missing = max(self.missing - paused, 0)
        words = self._stamp_words(jitter, missing)
        if paused:
            words.append(several(paused, "instant has", "instants have")
                         + " a sample of neither topic: the recording paused")
        if step:
            words.append(f"the values are multiples of {step:.6g}")
        stuck = self._once("bit", column, lambda: stuck_bit(self.values[:, column], step))
        if stuck:
            words.append(f"a bit is stuck: the one that is worth {stuck:.6g} is the same in all "
                         "values")
        words += at_limits(self.values[:, column], lower, upper)
        if not own_instants:
            step = None
        return Integrity(len(self), missing, self.duplicates,
                         self.stamps_back, self.not_finite, jitter, step, lower, upper, words,
                         bool(jitter and self.rounded_to_s),
                         jump=None if other is not None and self.jumps_with(other) else clock.jump)

    def _stamp_words(self, jitter, missing):
        words, clock = [], self.clock
        if missing:
            total = len(self) + missing
            words.append(several(missing, f"of {total} samples is", f"of {total} samples are")
                         + f" missing ({missing / total:.2%})")
        for number, what in ((self.duplicates, "with a stamp that was there before"),
                             (self.stamps_back, "with a stamp that goes back"),
                             (self.not_finite, "with values that are not finite")):
            if number:
                words.append(f"left out: {several(number, 'sample')} {what}")
        if clock.kind == "uneven":
            steps = np.percentile(np.diff(self.stamps_ns), [5, 95]) * 1e-9
            words.append(f"the stamps are uneven: 90 % of the steps last {steps[0]:.3g} to "
                         f"{steps[1]:.3g} s")
        elif clock.kind == "batches":
            words.append(f"the samples come in batches: their instants are taken as uniform at "
                         f"{clock.rate_hz:.6g} Hz")
        if clock.jump:
            words.append(f"the {self.jump_words}")
        if jitter:
            unit = f"are multiples of {self.rounded_to_s:.3g} s, and " if self.rounded_to_s else ""
            words.append(f"the stamps {unit}scatter by {jitter:.3g} s (RMS), "
                         f"{jitter * clock.rate_hz:.2%} of the sampling interval")
        return words

    def _once(self, what, column, find):
        if (what, column) not in self._found:
            self._found[what, column] = find()
        return self._found[what, column]


def _jump(stamps_ns):
    """Words for the stamp behind which all others go back, or none."""
    steps = np.diff(stamps_ns.astype(float))
    if not len(steps) or np.max(steps) <= 0 or steps.min() > -steps.max() / 2:
        return ""
    return (f": {1e-9 * (float(stamps_ns[int(np.argmax(steps))]) - float(stamps_ns[0])):.6g} s "
            f"after the start the stamps jump by {1e-9 * steps.max():.6g} s, and go back then")
