"""A running pair of sensors: windows, change, and the stretches that a diagnosis can use."""

import collections
import dataclasses

import numpy as np

from ..errors import FracAccelError
from ..io.samples import Samples
from .blocks import BLOCK_S, SETTLING_S, Blocks, blocks_of
from .detector import FALSE_ALARM_H, TOGETHER, Detector
from .onset import onset

# Length of a window, and of what is taken before and after it, where the motion settles [s].
WINDOW_S = 10.0
_TAIL_S = 0.5
_LEAD_S = SETTLING_S
# Windows that are kept as they came, and blocks for the onset [s].
_RECENT_S = 300.0
_MEMORY_S = 3600.0
# Stretches in the ring, and the longest of them [s].
_STRETCHES = 4
_LONGEST_S = 60.0
# Share of the usual motion from which on a window counts as well excited.
_EXCITED = 0.5
# Time [s] from the onset on that a growing change is given before what it has become is diagnosed.
_GROWING_S = 120.0
# Excited time [s] after a change that a diagnosis is given.
ENOUGH_S = 30.0


@dataclasses.dataclass(frozen=True, eq=False)
class Window:
    """Samples of both topics over a window, and how much moved in it.

    Attributes
    ----------
    start_ns, stop_ns : int
    reference, sensor : Samples
    excitation : float
        Standard deviation of the motion [m/s²].
    rms : float
        Of the residual of the model in use [output units].
    """

    start_ns: int
    stop_ns: int
    reference: Samples
    sensor: Samples
    excitation: float
    rms: float


class Watch:
    """Watches one axis of a sensor against a reference.

    Parameters
    ----------
    model : SensorModel
        In use.
    axis : {"x", "y", "z"}
    false_alarm_h : float
        Mean time between false alarms [h].

    Attributes
    ----------
    changed : Onset or None
        The change that was noticed, and when it began.
    windows, skipped : int
        Judged, and those that were no pair.
    """

    def __init__(self, model, axis="x", false_alarm_h=FALSE_ALARM_H):
        self._axis, self._false_alarm_h = axis, false_alarm_h
        self._waiting = ([], [])
        self._next_ns = self._epoch_ns = None
        self.windows = self.skipped = 0
        self.use(model)

    def use(self, model):
        """Go on with another model: what was learnt of the one before says nothing of it."""
        self.model, self.changed = model, None
        self.detector = Detector(self._false_alarm_h, seed=self.windows)
        self._blocks, self._recent = collections.deque(), collections.deque()
        self._ring, self._usual = [], collections.deque(maxlen=360)

    @property
    def learning(self):
        """Whether it does not know yet what is usual."""
        return self.detector.learnt is None

    def add(self, reference, sensor):
        """Take in samples of both topics, either of which may be None.

        Returns
        -------
        list of Window
            Those that are complete now.
        """
        for place, samples in zip(self._waiting, (reference, sensor)):
            if samples is not None and len(samples.stamps_ns):
                place.append(samples)
        if not all(self._waiting):
            return []
        if self._next_ns is None:
            first = max(int(part[0].stamps_ns[0]) for part in self._waiting)
            self._epoch_ns, self._next_ns = first, first + round(_LEAD_S * 1e9)
        newest = min(int(part[-1].stamps_ns[-1]) for part in self._waiting)
        windows = []
        while newest >= self._next_ns + (WINDOW_S + _TAIL_S) * 1e9:
            found = self._window(self._next_ns)
            self._next_ns += round(WINDOW_S * 1e9)
            if found is not None:
                windows.append(found)
        return windows

    def residual_rms(self, model, window):
        """RMS of another model's residual in a window [output units]."""
        return blocks_of(window.reference, window.sensor, model, self._axis, window.start_ns,
                         self._epoch_ns)[1]

    def _window(self, start_ns):
        stop_ns = start_ns + round(WINDOW_S * 1e9)
        low, high = start_ns - round(_LEAD_S * 1e9), stop_ns + round(_TAIL_S * 1e9)
        parts = []
        for place in self._waiting:
            joined = Samples.concatenate(place)
            kept = joined.stamps_ns >= stop_ns - round(_LEAD_S * 1e9)
            rows = (joined.stamps_ns >= low) & (joined.stamps_ns < high)
            parts.append(_rows(joined, rows))
            place[:] = [_rows(joined, kept)]
        try:
            blocks, rms = blocks_of(*parts, self.model, self._axis, start_ns, self._epoch_ns)
        except FracAccelError:
            self.skipped += 1
            return None
        blocks = blocks.part(blocks.start_ns < stop_ns - round(BLOCK_S * 0.5e9))
        self.windows += 1
        window = Window(start_ns, stop_ns, *parts, blocks.excitation, rms)
        self._keep(window, blocks)
        if self.detector.add(blocks.merged(TOGETHER)) and self.changed is None:
            self.changed = onset(Blocks.joined(list(self._blocks)), self.detector.learnt)
        return window

    def _keep(self, window, blocks):
        self._blocks.append(blocks)
        while window.stop_ns - self._blocks[0].start_ns[0] > _MEMORY_S * 1e9:
            self._blocks.popleft()
        self._recent.append(window)
        while window.stop_ns - self._recent[0].start_ns > _RECENT_S * 1e9:
            self._recent.popleft()
        self._usual.append(window.excitation)
        if not self._is_excited(window):
            return
        last = self._ring[-1] if self._ring else None
        if last and last[-1].stop_ns == window.start_ns \
                and window.stop_ns - last[0].start_ns <= _LONGEST_S * 1e9:
            last.append(window)
            return
        self._ring.append([window])
        if len(self._ring) > _STRETCHES + 1:
            # the one that tells least goes, not the oldest one
            self._ring.remove(min(self._ring[:-1], key=_worth))

    def _is_excited(self, window):
        return window.excitation > 0 and window.excitation >= _EXCITED * np.median(self._usual)

    def excited_since_s(self):
        """Well excited time [s] since the change began."""
        return WINDOW_S * sum(map(self._is_excited, self._since_change()))

    def _since_change(self):
        if self.changed is None:
            return []
        if self.changed.is_gradual:
            # what is there now, rather than what has grown
            newest = self._recent[-1].stop_ns if self._recent else 0
            first = max(newest - _LONGEST_S * 1e9, self.changed.ns + _GROWING_S * 1e9)
            return [window for window in self._recent if window.start_ns >= first]
        return [window for window in self._recent if window.start_ns >= self.changed.high_ns]

    def to_diagnose(self):
        """Samples (reference, sensor) for a diagnosis, or None.

        Of a change, what came after it; otherwise the best excited stretch of the ring.
        """
        windows = self._since_change() if self.changed is not None \
            else max(self._ring, key=_worth, default=[])
        if not windows:
            return None
        stretch = []
        for window in windows:
            # only what follows without a gap: the longest run from the newest backwards
            stretch = [*stretch, window] if stretch and stretch[-1].stop_ns == window.start_ns \
                else [window]
        joined = (_joined([getattr(window, name) for window in stretch])
                  for name in ("reference", "sensor"))
        # a window's samples begin before it, where the change may not have been yet
        return tuple(_rows(samples, samples.stamps_ns >= stretch[0].start_ns)
                     for samples in joined)


def _worth(stretch):
    """How much a stretch can tell: the energy of its motion."""
    return sum(window.excitation**2 for window in stretch)


def _rows(samples, rows):
    return Samples(samples.stamps_ns[rows], samples.values[rows], samples.variance[rows],
                   samples.frame_id)


def _joined(parts):
    """One run of overlapping ones, in the order in which they came."""
    runs, last = [], -1
    for part in parts:
        runs.append(_rows(part, part.stamps_ns > last))
        last = int(part.stamps_ns.max(initial=last))
    return Samples.concatenate(runs)
