"""Figures of a running correction: errors against a reference, self-consistency, latency."""

import collections
import dataclasses

import numpy as np

from ..model import AXES
from ..signals.metrics import error_metrics, interpolate
from ..signals.sample_rate import estimate_rate

# A window never holds more samples than this, so that judging it stays cheap at any rate.
MOST_SAMPLES = 8192
# Fewest samples that are judged against a reference.
FEWEST_SAMPLES = 64
# Clipping is suspected where at least this share of a window sits at its end.
CLIPPED_SHARE = 1e-3
_CLIPPED_RUN = 3
_TOGETHER = 256
_FEWEST_LEVELS = 16

ERROR_NAMES = ("amplitude_error", "phase_error_deg", "nrmse", "peak_error")


class Window:
    """Newest samples of one signal, over a length of time.

    Parameters
    ----------
    length_s : float
        Time [s] that it reaches back, by the stamps.
    """

    def __init__(self, length_s):
        self._length_ns = int(length_s * 1e9)
        self._blocks = collections.deque()
        self._count = 0

    def add(self, stamps_ns, values):
        """Append samples; those whose stamps go back start the window anew."""
        if not len(stamps_ns):
            return
        if self._blocks and stamps_ns[0] < self._blocks[-1][0][-1] - self._length_ns:
            self.clear()
        self._blocks.append((stamps_ns, values))
        self._count += len(stamps_ns)
        newest = stamps_ns[-1]
        while len(self._blocks) > 1 and (
                self._blocks[0][0][-1] < newest - self._length_ns
                or self._count - len(self._blocks[0][0]) >= MOST_SAMPLES):
            self._count -= len(self._blocks.popleft()[0])

    def add_all(self, stamps_ns, values):
        """Append blocks of samples, many small ones as one."""
        together = np.concatenate(stamps_ns), np.concatenate(values)
        if len(together[0]) <= MOST_SAMPLES and not (np.diff(together[0]) < 0).any():
            stamps_ns, values = [together[0]], [together[1]]
        for block in zip(stamps_ns, values):
            self.add(*block)

    def clear(self):
        """Forget all samples."""
        self._blocks.clear()
        self._count = 0

    def samples(self):
        """Stamps (n,) in ascending order, without repetition, and their finite values (n, 3)."""
        if not self._blocks:
            return np.empty(0, np.int64), np.empty((0, 3))
        stamps = np.concatenate([block[0] for block in self._blocks])[-MOST_SAMPLES:]
        values = np.concatenate([block[1] for block in self._blocks])[-MOST_SAMPLES:]
        finite = np.isfinite(values).all(axis=1) & (stamps >= stamps[-1] - self._length_ns)
        stamps, first = np.unique(stamps[finite], return_index=True)
        return stamps, values[finite][first]


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """Signals of one window, each a pair of stamps (n,) and values (n, 3), for `evaluate`.

    Attributes
    ----------
    raw, corrected, reference : tuple of ndarray
    sampling_rate_hz : float or None
        Rate of raw and corrected; None while it is not known.
    bands : sequence of sequence of (float, float)
        Adjoining bands [Hz] for each axis.
    """

    raw: tuple
    corrected: tuple
    reference: tuple
    sampling_rate_hz: float | None
    bands: tuple


class LiveMetrics:
    """Gathers the signals of a running correction, cheaply, for `evaluate` in another thread.

    Parameters
    ----------
    window_s : float
        Time [s] over which signals are judged.
    band_edges_hz : sequence of float
        Edges of the bands that errors are given for; empty: the filter's band only.
    """

    def __init__(self, window_s, band_edges_hz=()):
        self._raw, self._corrected = Window(window_s), Window(window_s)
        self._bands = tuple(zip(band_edges_hz[:-1], band_edges_hz[1:]))
        self._added, self._latencies_s = [], []

    def add(self, raw, stamps_ns, values, arrivals_ns, now_ns):
        """Append raw `Samples`, and corrected ones that came at some instants and go out now."""
        # looked at together with others: a little at a time costs more
        self._added.append((raw, stamps_ns, values, arrivals_ns, now_ns))
        if len(self._added) >= _TOGETHER:
            self._take_in()

    def _take_in(self):
        added, self._added = self._added, []
        if not added:
            return
        raw, stamps_ns, values, arrivals_ns, now_ns = zip(*added)
        self._raw.add_all([one.stamps_ns for one in raw], [one.values for one in raw])
        self._corrected.add_all(stamps_ns, values)
        now_ns = np.repeat(now_ns, [len(one) for one in arrivals_ns])
        self._latencies_s.append(1e-9 * (now_ns - np.concatenate(arrivals_ns)))

    def snapshot(self, reference, design):
        """`Snapshot` of now.

        Parameters
        ----------
        reference : Window or None
        design : FilterDesign or None
        """
        self._take_in()
        reference = reference or Window(0)
        bands = tuple(self._bands or (axis.band_hz,) for axis in design.axes) if design else ()
        return Snapshot(self._raw.samples(), self._corrected.samples(), reference.samples(),
                        design.sampling_rate_hz if design else None, bands)

    def take_latencies(self):
        """Figures of the latencies since the last call, by topic name."""
        self._take_in()
        latencies, self._latencies_s = self._latencies_s, []
        latencies = np.concatenate(latencies) if latencies else np.empty(0)
        if not len(latencies):
            return {}
        names, shares = ("latency_p50_s", "latency_p99_s", "latency_max_s"), (0.5, 0.99, 1.0)
        # as np.percentile, at a tenth of its cost
        last = len(latencies) - 1
        return dict(zip(names, np.interp(np.multiply(shares, last), np.arange(last + 1),
                                         np.sort(latencies)).tolist()))


def evaluate(snapshot):
    """Figures of a snapshot.

    Returns
    -------
    figures : dict of str to float
        By the names that the topics have below ``~/metrics/``.
    findings : Findings
        What the diagnostics have to say about the signals.
    """
    figures = {}
    clipped = {}
    stamps, raw = snapshot.raw
    if len(raw):
        for i, axis in enumerate(AXES):
            clipped[axis] = figures[f"{axis}/raw/clipped_share"] = clipped_share(raw[:, i])
            figures[f"{axis}/raw/std"] = float(np.std(raw[:, i]))
    for i, axis in enumerate(AXES):
        if len(snapshot.corrected[1]):
            figures[f"{axis}/corrected/std"] = float(np.std(snapshot.corrected[1][:, i]))
    overlap = None
    if snapshot.sampling_rate_hz and len(snapshot.reference[0]) >= FEWEST_SAMPLES:
        for name in ("raw", "corrected"):
            errors = errors_against(snapshot.reference, getattr(snapshot, name),
                                    snapshot.sampling_rate_hz, snapshot.bands)
            overlap = bool(overlap) or bool(errors)
            for axis, of_axis in (errors or {}).items():
                figures.update(_named(f"{axis}/{name}", of_axis))
    rate = estimate_rate(stamps) if len(stamps) > 1 else None
    if rate:
        figures["stamp_rate_hz"] = rate
    findings = Findings(
        clipped_axes="".join(axis for axis, share in clipped.items() if share >= CLIPPED_SHARE),
        constant=len(raw) >= FEWEST_SAMPLES and not np.ptp(raw, axis=0).any(),
        stamp_rate_hz=rate, reference_overlaps=overlap)
    return {name: value for name, value in figures.items() if np.isfinite(value)}, findings


@dataclasses.dataclass(frozen=True)
class Findings:
    """What `evaluate` says about the signals of its window.

    Attributes
    ----------
    clipped_axes : str
        Axes whose raw signal seems to be clipped.
    constant : bool
        Whether no axis of the raw signal changes at all.
    stamp_rate_hz : float or None
        Rate of the raw stamps.
    reference_overlaps : bool or None
        Whether reference and sensor have time in common; None without a reference.
    """

    clipped_axes: str = ""
    constant: bool = False
    stamp_rate_hz: float | None = None
    reference_overlaps: bool | None = None


def errors_against(reference, signal, sampling_rate_hz, bands):
    """Errors of a signal against a reference that has its own stamps.

    Parameters
    ----------
    reference, signal : tuple of ndarray
        Stamps [ns] (n,), ascending, and values (n, 3).
    sampling_rate_hz : float
        Rate of the signal.
    bands : sequence of sequence of (float, float)
        Adjoining bands [Hz] for each axis.

    Returns
    -------
    dict of str to ErrorMetrics, or None
        By axis, over the longest run without a gap; None where that is shorter than
        `FEWEST_SAMPLES`.
    """
    reference_rate = estimate_rate(reference[0])
    truth = interpolate(*reference, signal[0], reference_rate)
    run = _longest_run(signal[0], np.isfinite(truth).all(axis=1), 1e9 / sampling_rate_hz)
    if run.stop - run.start < FEWEST_SAMPLES:
        return None
    return {axis: error_metrics(truth[run, i], signal[1][run, i], sampling_rate_hz, bands[i])
            for i, axis in enumerate(AXES)}


def clipped_share(values):
    """Share of the samples of one axis that look clipped.

    A sample counts where at least three in a row sit at the very end of the range and the signal
    came there, or left, by a jump: a slow quantised signal stays at its highest level, too, but
    gets there by single steps.
    """
    levels = np.unique(values)
    if len(levels) < _FEWEST_LEVELS:
        return 0.0
    step = 1.5 * np.min(np.diff(levels))
    share = 0.0
    for end in (levels[0], levels[-1]):
        padded = np.r_[False, values == end, False].astype(np.int8)
        starts, stops = (np.flatnonzero(np.diff(padded) == sign) for sign in (1, -1))
        for start, stop in zip(starts, stops):
            around = [abs(values[i] - end) for i in (start - 1, stop) if 0 <= i < len(values)]
            if stop - start >= _CLIPPED_RUN and max(around, default=0.0) > step:
                share += (stop - start) / len(values)
    return float(share)


def _named(prefix, metrics):
    """Figures of one `ErrorMetrics` by topic name."""
    figures = {f"{prefix}/median_relative_error_percent": metrics.median_relative_error_percent}
    parts = {prefix: metrics.total}
    if len(metrics.bands) > 1:
        for band in metrics.bands:
            low, high = (f"{edge:g}".replace(".", "_").replace("-", "_").replace("+", "_")
                         for edge in band.band_hz)
            parts[f"{prefix}/from_{low}_to_{high}_hz"] = band
    for name, errors in parts.items():
        figures.update({f"{name}/{key}": getattr(errors, key) for key in ERROR_NAMES})
    return figures


def _longest_run(stamps, usable, interval):
    """Slice of the longest run of usable samples one interval apart."""
    if not len(stamps):
        return slice(0, 0)
    joined = (np.abs(np.diff(stamps) / interval - 1) < 0.5) & usable[1:] & usable[:-1]
    edges = np.flatnonzero(~joined) + 1
    starts, stops = np.r_[0, edges], np.r_[edges, len(stamps)]
    longest = int(np.argmax((stops - starts) * usable[starts]))
    if not usable[starts[longest]]:
        return slice(0, 0)
    return slice(int(starts[longest]), int(stops[longest]))
